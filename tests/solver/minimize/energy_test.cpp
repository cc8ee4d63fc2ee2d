// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/minimize/energy.h"

#include <algorithm>
#include <random>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "solver/minimize/newton.h"
#include "tests/support/dense_energy.h"
#include "tests/support/energy_checks.h"
#include "tests/support/held_body.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::HeldBody;

namespace
{

/// Free points: a second kind of unknowns beside cells.
class Points final : public State
{
public:
    Points(std::vector<Eigen::Vector3d> x, UnknownPlace begin)
        : State(begin), x_(x), base_(std::move(x)), sizes_(x_.size(), 3)
    {
    }
    const Eigen::Vector3d& operator[](int i) const { return x_[idx(i)]; }
    int first(int i) const { return begin().unknown + 3 * i; }
    std::span<const int> block_sizes() const override { return sizes_; }
    void move(const Eigen::VectorXd& step, double length) override
    {
        for (int i = 0; i < static_cast<int>(x_.size()); ++i)
            x_[idx(i)] = base_[idx(i)] + length * step.segment<3>(first(i));
    }
    void settle() override { base_ = x_; }
    double largest_move() const override
    {
        double largest = 0.0;
        for (std::size_t i = 0; i < x_.size(); ++i)
            largest = std::max(largest, (x_[i] - base_[i]).norm());
        return largest;
    }

private:
    std::vector<Eigen::Vector3d> x_, base_;
    std::vector<int> sizes_;
};

/// Springs of no length and stiffness 1: from a cell's centre to the first point, from
/// each point to the next, and from the last to a place. With J^T J alone.
class Line final : public Term
{
public:
    Line(const CellState& cells, UnknownCell unknown, const Points& points, int count,
         const Eigen::Vector3d& end)
        : cells_(cells), points_(points), unknown_(unknown), count_(count), end_(end)
    {
        const int point = points.begin().block, cell = cells.block(unknown);
        pairs_.emplace_back(std::max(point, cell), std::min(point, cell));
        for (int i = 1; i < count; ++i)
            pairs_.emplace_back(point + i, point + i - 1);
        std::sort(pairs_.begin(), pairs_.end());
    }
    /// What pulls along spring \p k.
    Eigen::Vector3d pull(int k) const
    {
        const Eigen::Vector3d& from =
            k == 0 ? cells_.pose(cells_.cell_of_unknown(unknown_)).p : points_[k - 1];
        return (k == count_ ? end_ : points_[k]) - from;
    }

    std::span<const std::pair<int, int>> pairs() const override { return pairs_; }
    double value() const override
    {
        double sum = 0.0;
        for (int k = 0; k <= count_; ++k)
            sum += 0.5 * pull(k).squaredNorm();
        return sum;
    }
    void add_gradient(Eigen::VectorXd& out) const override
    {
        Twist twist = Twist::Zero();
        twist.tail<3>() = -pull(0);
        cells_.add_body(unknown_, twist, out.data() + cells_.first(unknown_));
        for (int i = 0; i < count_; ++i)
            out.segment<3>(points_.first(i)) += pull(i) - pull(i + 1);
    }
    void add_rounding(std::span<double> out) const override
    {
        for (double& error : out)
            error += 1e-15;
    }
    void linearise(Curvature) override {}
    void add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override
    {
        Twist twist = cells_.world(unknown_, x.data() + cells_.first(unknown_));
        twist.head<3>().setZero();
        twist.tail<3>() -= x.segment<3>(points_.first(0));
        cells_.add_body(unknown_, twist, y.data() + cells_.first(unknown_));
        for (int i = 0; i < count_; ++i)
        {
            Eigen::Vector3d sum = 2.0 * x.segment<3>(points_.first(i));
            if (i == 0)
                sum -=
                    cells_.world(unknown_, x.data() + cells_.first(unknown_)).tail<3>();
            else
                sum -= x.segment<3>(points_.first(i - 1));
            if (i + 1 < count_)
                sum -= x.segment<3>(points_.first(i + 1));
            y.segment<3>(points_.first(i)) += sum;
        }
    }
    void add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const override
    {
        const int point = block - points_.begin().block;
        if (point >= 0 && point < count_)
            out += 2.0 * Eigen::Matrix3d::Identity();
        else if (block == cells_.block(unknown_))
            out += linear().transpose() * linear();
    }
    void add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const override
    {
        const int cell = cells_.block(unknown_);
        if (pairs_[idx(pair)].first == cell)
            out -= linear().transpose();
        else if (pairs_[idx(pair)].second == cell)
            out -= linear();
        else
            out -= Eigen::Matrix3d::Identity();
    }

private:
    Eigen::Matrix<double, 3, Eigen::Dynamic> linear() const
    {
        return cells_.basis(unknown_).bottomRows<3>();
    }

    const CellState& cells_;
    const Points& points_;
    UnknownCell unknown_;
    int count_;
    Eigen::Vector3d end_;
    std::vector<std::pair<int, int>> pairs_;
};

HeldBody held_bar()
{
    HeldBody body(support::bar(4, 1, 1).cells);
    body.prescribe([](const Cell& cell) { return cell.centre.x() < 1.0; });
    body.components = find_components(body.cells, body.constraints);
    return body;
}

/// A bar whose last cell hangs on a line of points that is drawn to a place far off: the
/// cells' unknowns come first, or the points'.
struct BarOnALine
{
    static constexpr int kPoints = 3;

    HeldBody body = held_bar();
    CellState cells;
    Points points;
    GlueTerm glue;
    Line line;
    Energy total;

    explicit BarOnALine(bool points_first = false)
        : cells(body.cells, body.constraints, true,
                points_first ? UnknownPlace{kPoints, 3 * kPoints} : UnknownPlace{}),
          points({{4, 1, 1}, {4, 2, 0}, {5, 3, 1}},
                 points_first ? UnknownPlace{} : cells.end()),
          glue(cells, body.glue, body.components),
          line(cells, UnknownCell(cells.num_unknown_cells() - 1), points, kPoints,
               {3, 4, 1}),
          total(points_first ? std::vector<State*>{&points, &cells}
                             : std::vector<State*>{&cells, &points},
                {&glue, &line})
    {
    }
    SolveReport solve(Method method)
    {
        const Eigen::Index n = total.num_unknowns();
        support::DensePreconditioner none(Eigen::MatrixXd::Identity(n, n));
        return NewtonSolver(total, none)
            .minimize({.method = method, .gradient_tolerance = 1e-10});
    }
};

} // namespace

TEST(Energy, adds_terms_of_one_state)
{
    HeldBody body = held_bar();
    CellState state(body.cells, body.constraints);
    GlueTerm one(state, body.glue, body.components), other = one;
    Energy single({&state}, {&one}), both({&state}, {&one, &other});
    std::mt19937 rng(3);
    std::vector<Pose> poses = body.rest();
    for (Pose& pose : poses)
        pose = {support::random_rotation(rng), pose.p + support::random_vector(rng, 0.3)};
    state.set_poses(poses);
    support::check_energy(both, rng);
    EXPECT_TRUE(std::ranges::equal(both.pairs(), single.pairs()));
    EXPECT_EQ(both.value(), 2.0 * single.value());
    Eigen::VectorXd g, twice;
    single.gradient(g);
    both.gradient(twice);
    EXPECT_LT((twice - 2.0 * g).norm(), 1e-14 * g.norm());
    EXPECT_LT(
        (support::dense_hessian(both) - 2.0 * support::dense_hessian(single)).norm(),
        1e-13 * support::dense_hessian(single).norm());
}

TEST(Energy, joins_states_of_different_kinds)
{
    for (const bool points_first : {false, true})
    {
        BarOnALine bar(points_first);
        support::check_structure(bar.total);
        support::check_gradient(bar.total);
        support::check_blocks(bar.total, kGaussNewton);
        support::check_gauss_newton(bar.total);
    }
}

TEST(Energy, of_joined_states_has_one_minimum_for_every_order_and_method)
{
    std::vector<double> lowest;
    for (const bool points_first : {false, true})
        for (const Method method : {Method::GaussNewton, Method::GaussNewtonDirect})
        {
            BarOnALine bar(points_first);
            const SolveReport report = bar.solve(method);
            EXPECT_EQ(report.stop, Stop::Converged);
            EXPECT_LT(report.energy_after, 0.9 * report.energy_before);
            lowest.push_back(report.energy_after);
            // One force runs through the line, and the glue gives as much back.
            for (int k = 1; k <= BarOnALine::kPoints; ++k)
                EXPECT_LT((bar.line.pull(k) - bar.line.pull(0)).norm(), 1e-7);
            EXPECT_GT(bar.line.pull(0).norm(), 0.1);
            EXPECT_GT(bar.glue.value(), 1e-3);
        }
    for (const double value : lowest)
        EXPECT_NEAR(value, lowest.front(), 1e-10 * lowest.front());
}

TEST(Energy, needs_states_that_follow_each_other)
{
    HeldBody body = held_bar();
    CellState first(body.cells, body.constraints);
    CellState gap(body.cells, body.constraints, true, {100, 600});
    CellState next(body.cells, body.constraints, true, first.end());
    EXPECT_THROW(Energy({}, {}), std::invalid_argument);
    EXPECT_THROW(Energy({&gap}, {}), std::invalid_argument);
    EXPECT_THROW(Energy({&first, &gap}, {}), std::invalid_argument);
    EXPECT_THROW(Energy({&first, &first}, {}), std::invalid_argument);
    EXPECT_EQ(Energy({&first, &next}, {}).num_unknowns(), 2 * first.end().unknown);
}

} // namespace cellwarp::core
