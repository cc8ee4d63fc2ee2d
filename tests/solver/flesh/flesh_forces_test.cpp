// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/flesh_forces.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "octree/base/nearest_rotation.h"
#include "octree/base/parallel.h"
#include "solver/flesh/part_points.h"
#include "tests/support/bodies.h"
#include "tests/support/flesh.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

const std::vector<FleshMaterial> kFlesh = {{2e4, 0.4, 900.0}};

/// Cells of three sizes, cut by the surface.
Lattice mixed_lattice()
{
    const support::Built body = support::built_mixed(support::l_prism(), 7, 2, 11);
    return octree_lattice(body.octree, body.cells, 0.5);
}

/// Hexahedra with no right angle.
Lattice bent_lattice()
{
    Lattice lattice = support::grid_lattice({{{0, 1, 2, 3}, {0, 1, 2}, {0, 1}}});
    std::mt19937 rng(5);
    for (Vector3d& x : lattice.places)
        x += support::random_vector(rng, 0.1);
    std::vector<int> material(lattice.cells.size(), 0);
    return drawn_lattice(lattice.places, lattice.cells, material);
}

/// Two in one cell, and one in the last cell.
std::vector<TubePart> tubes_in(const Lattice& lattice, std::mt19937& rng)
{
    std::vector<TubePart> tubes;
    for (const int part : {0, 0, static_cast<int>(lattice.parts.size()) - 1})
    {
        Eigen::Matrix<double, 8, 8> root;
        for (int k = 0; k < 63; k += 3)
            root.reshaped().segment<3>(k) = support::random_vector(rng, 0.3);
        root.diagonal().array() += 0.1;
        tubes.push_back({part, 0, root * root.transpose(), 3e4});
    }
    return tubes;
}

VectorXd by_matrices(const Lattice& lattice, const FleshForces& forces, const VectorXd& x,
                     const FleshFactors& factors)
{
    VectorXd y = VectorXd::Zero(x.size());
    for (const LatticePart& part : lattice.parts)
    {
        const PartPoints points = points_of(lattice, part);
        const PartMatrix K = stiffness_of(points, kFlesh[0]);
        const Eigen::Matrix<double, 8, 8> M = mass_of(points, kFlesh[0].density);
        const Matrix3d& R = forces.frames()[idx(part.cell)];
        const CornerNodes& nodes = lattice.cells[idx(part.cell)];
        for (int a = 0; a < 8; ++a)
            for (int b = 0; b < 8; ++b)
                y.segment<3>(3 * nodes[idx(a)]) +=
                    (factors.mass * M(a, b) * Matrix3d::Identity() +
                     factors.stiffness * R * K.block<3, 3>(3 * a, 3 * b) *
                         R.transpose()) *
                    x.segment<3>(3 * nodes[idx(b)]);
    }
    for (const TubePart& tube : forces.tubes())
    {
        const CornerNodes& nodes = lattice.cells[idx(lattice.parts[idx(tube.part)].cell)];
        for (int a = 0; a < 8; ++a)
            for (int b = 0; b < 8; ++b)
                y.segment<3>(3 * nodes[idx(a)]) += factors.tube * tube.stiffness *
                                                   tube.overlap(a, b) *
                                                   x.segment<3>(3 * nodes[idx(b)]);
    }
    return y;
}

} // namespace

TEST(FleshForces, products_are_those_of_the_matrices_of_the_parts)
{
    std::mt19937 rng(7);
    for (const Lattice& lattice : {mixed_lattice(), bent_lattice()})
    {
        FleshForces forces(lattice, kFlesh, tubes_in(lattice, rng));
        forces.follow(support::random_field(lattice, rng, 0.05));
        const VectorXd x = support::random_field(lattice, rng, 1.0);
        const FleshFactors factors{0.3, 0.02, 0.01};
        VectorXd y;
        forces.multiply(x, factors, y);
        const VectorXd wanted = by_matrices(lattice, forces, x, factors);
        EXPECT_LT((y - wanted).norm(), 1e-12 * wanted.norm());
    }
}

TEST(FleshForces, all_instruction_sets_and_thread_counts_give_the_same_bits)
{
    std::mt19937 rng(8);
    for (const Lattice& lattice : {mixed_lattice(), bent_lattice()})
    {
        const VectorXd x = support::random_field(lattice, rng, 0.1);
        const std::vector<TubePart> tubes = tubes_in(lattice, rng);
        std::vector<VectorXd> results;
        for (const InstructionSet set : instruction_sets())
            for (const int threads : {1, 2})
            {
                const ThreadLimit limit(threads);
                FleshForces forces(lattice, kFlesh, tubes, set);
                forces.follow(x);
                VectorXd y, f;
                forces.multiply(x, {1.0, 0.1, 0.3}, y);
                forces.forces(x, std::vector<Motion>(1), f);
                y += f;
                results.push_back(y);
            }
        for (const VectorXd& y : results)
            EXPECT_EQ(y, results.front());
    }
}

TEST(FleshForces, rigid_motions_cost_nothing_however_far_they_turn)
{
    std::mt19937 rng(9);
    for (const Lattice& lattice : {mixed_lattice(), bent_lattice()})
        for (int trial = 0; trial < 5; ++trial)
        {
            const Motion T{support::random_rotation(rng),
                           support::random_vector(rng, 3.0)};
            const VectorXd u = support::field_of(
                lattice, [&](const Vector3d& x) -> Vector3d { return T(x) - x; });
            FleshForces forces(lattice, kFlesh, {});
            forces.follow(u);
            for (const Matrix3d& R : forces.frames())
                EXPECT_LT((R - T.R).norm(), 1e-12);
            VectorXd f;
            forces.forces(u, {}, f);
            EXPECT_LT(f.cwiseAbs().maxCoeff(), 1e-9);
            EXPECT_NEAR(forces.elastic_energy(u), 0.0, 1e-12);
        }
}

TEST(FleshForces, even_strain_pulls_at_no_inner_node)
{
    // Over cells of three sizes, hanging nodes included, at the cost of the continuum.
    const support::Built body =
        support::built_mixed(support::box_shape({0, 0, 0}, {4, 2, 2}), 4, 2, 3);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    std::mt19937 rng(10);
    Matrix3d G;
    for (double& g : G.reshaped())
        g = support::random_number(rng, -1e-3, 1e-3);
    const VectorXd u =
        support::field_of(lattice, [&](const Vector3d& x) -> Vector3d { return G * x; });
    FleshForces forces(lattice, kFlesh, {});
    VectorXd f;
    forces.forces(u, {}, f);
    const Matrix3d e = 0.5 * (G + G.transpose());
    double volume = 0.0;
    for (const LatticePart& part : lattice.parts)
        volume += part.volume;
    EXPECT_NEAR(forces.elastic_energy(u) /
                    (volume * (0.5 * kFlesh[0].lambda() * e.trace() * e.trace() +
                               kFlesh[0].shear() * e.squaredNorm())),
                1.0, 1e-12);
    // Forces on hanging nodes go to those that they follow.
    VectorXd on_free = f;
    bool hangs = false;
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
    {
        for (const NodeShare& share : lattice.hanging[n])
            on_free.segment<3>(3 * share.node) +=
                share.share * f.segment<3>(Eigen::Index(3 * n));
        if (!lattice.hanging[n].empty())
        {
            hangs = true;
            on_free.segment<3>(Eigen::Index(3 * n)).setZero();
        }
    }
    EXPECT_TRUE(hangs);
    int inner = 0;
    const double largest = on_free.cwiseAbs().maxCoeff();
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
    {
        const Vector3d& x = lattice.places[n];
        if (!((x.array() > 1e-9).all() && x.x() < 4 - 1e-9 && x.y() < 2 - 1e-9 &&
              x.z() < 2 - 1e-9))
            continue;
        ++inner;
        EXPECT_LT(on_free.segment<3>(Eigen::Index(3 * n)).norm(), 1e-13 * largest);
    }
    EXPECT_GT(inner, 20);
}

TEST(FleshForces, forces_are_the_slope_of_the_energy_while_frames_stand)
{
    std::mt19937 rng(12);
    for (const Lattice& lattice : {mixed_lattice(), bent_lattice()})
    {
        FleshForces forces(lattice, kFlesh, tubes_in(lattice, rng));
        const std::vector<Motion> motions = {
            {support::random_rotation(rng), support::random_vector(rng, 0.3)}};
        const VectorXd u = support::random_field(lattice, rng, 0.1);
        forces.follow(u);
        VectorXd f;
        forces.forces(u, motions, f);
        ASSERT_GT(f.norm(), 1.0);
        for (int trial = 0; trial < 5; ++trial)
        {
            const VectorXd way = support::random_field(lattice, rng, 1.0);
            const auto energy = [&](double t)
            {
                const VectorXd at = u + t * way;
                return forces.elastic_energy(at) + forces.tube_energy(at, motions);
            };
            const double step = 1e-4;
            const double slope = (energy(step) - energy(-step)) / (2.0 * step);
            EXPECT_NEAR(slope / -f.dot(way), 1.0, 1e-7);
        }
    }
}

TEST(FleshForces, two_slabs_in_the_same_cells_stay_apart)
{
    // A comb: its two teeth share cells, and move by themselves; its back joins them.
    const auto zero_modes = [](const Shape& shape)
    {
        const support::Built body = support::built(shape, 4, 0, Fill::Solid, 0.02);
        const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
        FleshForces forces(lattice, kFlesh, {});
        const Eigen::Index size = Eigen::Index(3 * lattice.places.size());
        Eigen::MatrixXd K(size, size);
        VectorXd image;
        for (Eigen::Index k = 0; k < size; ++k)
        {
            forces.multiply(VectorXd::Unit(size, k), {0.0, 1.0, 0.0}, image);
            K.col(k) = image;
        }
        return support::count_zero(
            Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(K).eigenvalues());
    };
    const Shape low = support::box_shape({0, 0, 0}, {4, 1, 0.45}),
                high = support::box_shape({0, 0, 0.55}, {4, 1, 1});
    EXPECT_EQ(zero_modes(support::joined(low, high)), 12);
    EXPECT_EQ(zero_modes(support::comb()), 6);
}

TEST(FleshForces, frames_follow_cells_that_are_turned_inside_out)
{
    const Lattice lattice = support::bar_lattice(1, 2);
    FleshForces forces(lattice, kFlesh, {});
    const Matrix3d F = Vector3d(-0.5, 1.2, 0.9).asDiagonal();
    const VectorXd u = support::field_of(
        lattice, [&](const Vector3d& x) -> Vector3d { return F * x - x; });
    forces.follow(u);
    for (const Matrix3d& R : forces.frames())
    {
        EXPECT_NEAR(R.determinant(), 1.0, 1e-12);
        EXPECT_LT((R - nearest_rotation(F)).norm(), 1e-12);
    }
}

} // namespace cellwarp::core
