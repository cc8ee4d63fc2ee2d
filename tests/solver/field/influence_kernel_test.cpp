// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/influence_kernel.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "solver/field/blend.h"
#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

using Rows = Eigen::Array<double, kPlaceLanes, Eigen::Dynamic>;
using support::random_vector;

/// Boxes of two sizes around the own one, and places in and beside it.
struct WeightCase
{
    std::vector<CellBox> boxes;
    Rows places{kPlaceLanes, 3};

    explicit WeightCase(std::mt19937& rng)
    {
        for (const double shift : {-1.0, 0.0, 1.0})
            boxes.push_back({{0.5 + shift, 0.5, 0.5}, 1.0});
        boxes.push_back({{0.25, 1.25, 0.25}, 0.5});
        for (Eigen::Index l = 0; l < places.rows(); ++l)
            places.row(l) =
                (Eigen::Vector3d::Constant(0.5) + random_vector(rng, 0.7)).transpose();
        places.row(0).setConstant(0.5); // the centre of the own box
    }
};

struct Weights
{
    Rows inside{kPlaceLanes, 3}, is_within{kPlaceLanes, 3}, rests, weights, slopes;

    Weights(InstructionSet set, const WeightCase& c, bool wants_slopes)
    {
        const auto n = static_cast<Eigen::Index>(c.boxes.size());
        rests.resize(kPlaceLanes, n);
        weights.resize(kPlaceLanes, 4 * n); // of each box its weight, then its slopes
        weights.setZero();
        influence_kernels(set).weights(
            {c.boxes.data(), c.boxes.size(), 1, kBoxSlack, c.places.data(), inside.data(),
             is_within.data(), rests.data(), weights.data(),
             wants_slopes ? weights.col(1).data() : nullptr, 4 * kPlaceLanes});
    }
};

} // namespace

TEST(InfluenceKernel, weights_are_the_plain_ones_to_the_same_bits_in_every_set)
{
    std::mt19937 rng(3);
    for (int trial = 0; trial < 20; ++trial)
    {
        const WeightCase c(rng);
        const Weights plain(InstructionSet::Plain, c, true);
        for (Eigen::Index l = 0; l < c.places.rows(); ++l)
        {
            const Eigen::Vector3d x = c.places.row(l).transpose().matrix();
            const Eigen::Vector3d inside =
                nearest_in_box(Eigen::Vector3d::Constant(0.5), 1.0, x);
            EXPECT_EQ(plain.inside.row(l).transpose().matrix(), inside);
            double sum = 0.0;
            std::vector<double> squares;
            for (const CellBox& box : c.boxes)
            {
                const double d = (inside - Eigen::Vector3d(box.centre)).norm();
                squares.push_back(std::pow(std::max(0.0, 1.0 - d / box.edge), 2));
                sum += squares.back();
            }
            for (std::size_t i = 0; i < c.boxes.size(); ++i)
                EXPECT_NEAR(plain.weights(l, static_cast<Eigen::Index>(4 * i)),
                            squares[i] / sum, 1e-15);
            for (int k = 0; k < 3; ++k)
                EXPECT_EQ(plain.is_within(l, k), inside[k] == x[k] ? 1.0 : 0.0);
        }
        for (const InstructionSet set : instruction_sets())
        {
            const Weights other(set, c, true), alone(set, c, false);
            EXPECT_TRUE((other.inside == plain.inside).all());
            EXPECT_TRUE((other.rests == plain.rests).all());
            EXPECT_TRUE((other.weights == plain.weights).all());
            for (Eigen::Index i = 0; i < plain.weights.cols(); i += 4)
                EXPECT_TRUE((alone.weights.col(i) == plain.weights.col(i)).all());
        }
    }
}

TEST(InfluenceKernel, blends_maps_to_the_same_bits_in_every_set)
{
    std::mt19937 rng(4);
    constexpr int kCells = 5;
    std::vector<CellMap> maps(kCells);
    for (CellMap& map : maps)
    {
        for (double& number : map.turn)
            number = support::random_number(rng, -1.0, 1.0);
        for (std::size_t k = 0; k < 3; ++k)
        {
            map.shift[k] = support::random_number(rng, -1.0, 1.0);
            map.centre[k] = support::random_number(rng, -1.0, 1.0);
        }
    }
    const int cells[] = {4, 0, 2};
    const Rows places = Rows::Random(kPlaceLanes, 3),
               numbers = Rows::Random(kPlaceLanes, 12); // a weight and three slopes each
    const auto blended = [&](InstructionSet set, bool wants_slopes)
    {
        Rows out = Rows::Zero(kPlaceLanes, 12);
        influence_kernels(set).blend({maps.data(), cells, numbers.data(),
                                      wants_slopes ? numbers.col(1).data() : nullptr, 3,
                                      4 * kPlaceLanes, 1, places.data(), out.data(),
                                      out.col(3).data()});
        return out;
    };
    const Rows plain = blended(InstructionSet::Plain, true);
    using Turn = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
    for (Eigen::Index l = 0; l < places.rows(); ++l)
    {
        Eigen::Vector3d d = Eigen::Vector3d::Zero();
        Eigen::Matrix3d slope = Eigen::Matrix3d::Zero();
        for (Eigen::Index i = 0; i < 3; ++i)
        {
            const CellMap& map = maps[static_cast<std::size_t>(cells[i])];
            const Eigen::Map<const Turn> turn(map.turn);
            const Eigen::Vector3d moved = turn * (places.row(l).transpose().matrix() -
                                                  Eigen::Vector3d(map.centre)) +
                                          Eigen::Vector3d(map.shift);
            d += numbers(l, 4 * i) * moved;
            slope += numbers(l, 4 * i) * turn +
                     moved * numbers.row(l).segment<3>(4 * i + 1).matrix();
        }
        EXPECT_LT((plain.row(l).head<3>().transpose().matrix() - d).norm(), 1e-14);
        for (Eigen::Index axis = 0; axis < 3; ++axis)
            EXPECT_LT((plain.row(l).segment<3>(3 + 3 * axis).transpose().matrix() -
                       slope.col(axis))
                          .norm(),
                      1e-14);
    }
    for (const InstructionSet set : instruction_sets())
    {
        EXPECT_TRUE((blended(set, true) == plain).all());
        EXPECT_TRUE((blended(set, false).leftCols<3>() == plain.leftCols<3>()).all());
    }
}

TEST(InfluenceKernel, squares_of_distances_and_their_least_are_the_same_in_every_set)
{
    constexpr Eigen::Index kNodes = 24, kStride = 32;
    const Eigen::ArrayXXd nodes = Eigen::ArrayXXd::Random(kStride, 3);
    const Eigen::Array3d x(0.1, -0.2, 0.3);
    for (const InstructionSet set : instruction_sets())
    {
        Eigen::ArrayXd squares = Eigen::ArrayXd::Constant(kStride, -1.0);
        const double least = influence_kernels(set).squares({nodes.data(),
                                                             idx(kNodes),
                                                             idx(kStride),
                                                             {x[0], x[1], x[2]},
                                                             squares.data()});
        for (Eigen::Index i = 0; i < kStride; ++i)
        {
            const Eigen::Array3d d = nodes.row(i).transpose() - x;
            EXPECT_EQ(squares[i],
                      i < kNodes ? d[0] * d[0] + d[1] * d[1] + d[2] * d[2] : -1.0);
        }
        EXPECT_EQ(least, squares.head<kNodes>().minCoeff());
    }
}

TEST(InfluenceKernel, ranks_are_how_many_numbers_are_less)
{
    std::mt19937 rng(3);
    std::vector<double> numbers(24);
    std::vector<std::int64_t> ranks(numbers.size());
    for (const std::size_t count : {1u, 7u, 16u, 21u})
    {
        for (double& number : numbers)
            number = std::uniform_int_distribution(0, 12)(rng) * 0.25;
        for (const InstructionSet set : instruction_sets())
        {
            influence_kernels(set).ranks(numbers.data(), count, ranks.data());
            for (std::size_t i = 0; i < count; ++i)
                EXPECT_EQ(ranks[i],
                          std::count_if(numbers.begin(),
                                        numbers.begin() + static_cast<long>(count),
                                        [&](double other) { return other < numbers[i]; }))
                    << i << " of " << count;
        }
    }
}

} // namespace cellwarp::core
