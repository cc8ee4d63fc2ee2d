// SPDX-License-Identifier: GPL-3.0-or-later
// Rods and the cells that they carry in one energy.
#include <algorithm>
#include <cmath>
#include <memory>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "solver/cells/cell_energy.h"
#include "solver/cells/rigid_multigrid.h"
#include "solver/coupled/pushing_rods.h"
#include "solver/linear/conjugate_gradients.h"
#include "solver/minimize/newton.h"
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

using Eigen::Vector3d;

/// YA L^2 = 1e4 YI, YI = GJ = 1.
Rod slender(const std::vector<Vector3d>& points)
{
    Spline spline = spline_through(points, false, 2);
    const double length = ArcLength(spline).total();
    const Section section{
        1e4 / (length * length), {1.0, 1.0}, 1.0, 1.0 / length, 0.0, 0.1};
    return Rod(std::move(spline), [section](double) { return section; }, {});
}

/// A body with rods, each of which carries the cells nearer than \p radius.
class Coupled
{
public:
    Coupled(const HeldBody& held, const std::vector<std::vector<Vector3d>>& lines,
            double stiffness, double radius = 0.6)
        : body_(held)
    {
        for (const std::vector<Vector3d>& line : lines)
        {
            rods_.push_back(std::make_unique<Rod>(slender(line)));
            rests_.push_back(std::make_unique<RodState>(*rods_.back()));
            CoupledRod& one = coupled_.emplace_back();
            one.rest = rests_.back().get();
            one.stiffness = stiffness;
            for (std::size_t c = 0; c < body_.cells.size(); ++c)
            {
                const Vector3d& centre = body_.cells.cells[c].centre;
                const double s = nearest(*rods_.back(), centre);
                if (body_.constraints[c].hold != Hold::Free ||
                    (rests_.back()->at(s).place - centre).norm() > radius)
                    continue;
                one.cells.push_back({static_cast<int>(c), s, centre});
                body_.constraints[c].hold = Hold::Prescribed;
            }
        }
        components_ = find_components(body_.cells, body_.constraints);
        energy_ = std::make_unique<CellEnergy>(
            body_.cells, body_.glue, body_.constraints, components_, true,
            [&](CellState& cells, const GlueTerm& glue)
            {
                auto made = std::make_unique<PushingRods>(cells, glue, coupled_);
                pushing_ = made.get();
                return made;
            });
    }

    Energy& total() { return energy_->total; }
    CellEnergy& energy() { return *energy_; }
    RodUnknowns& rods() { return pushing_->rods(); }
    const HeldBody& body() const { return body_; }

    /// Place and frame at the begin of the first rod, a place within it.
    void hold()
    {
        RodConstraint place, frame, inside;
        const RodState& now = rods().state(0);
        place.point = now.at(0.0).place;
        frame.hold = HoldKind::Frame;
        frame.frame = now.frame(0.0);
        place.s = frame.s = rods_[0]->basis().begin();
        inside.s = 0.5 * (rods_[0]->basis().begin() + rods_[0]->basis().end());
        inside.point = now.at(inside.s).place;
        holds_ = {place, frame, inside};
        rods().set(0, now, {}, holds_);
    }
    double violation()
    {
        return hold_rows(rods().state(0), holds_).violation.lpNorm<Eigen::Infinity>();
    }
    /// A random step of all unknowns, made the base.
    void shake(double size, unsigned seed)
    {
        std::mt19937 rng(seed);
        Eigen::VectorXd step(total().num_unknowns());
        for (double& number : step)
            number = support::random_number(rng, -size, size);
        total().move(step, 1.0);
        total().settle();
    }
    RigidMultigrid multigrid()
    {
        total().linearise(kGaussNewton);
        return RigidMultigrid(total(), energy_->bodies(grid_places(body_.cells)));
    }
    /// Conjugate gradients to 1e-6 from a random right-hand side.
    int steps()
    {
        RigidMultigrid preconditioner = multigrid();
        std::mt19937 rng(5);
        Eigen::VectorXd right(total().num_unknowns()), x;
        for (double& number : right)
            number = support::random_number(rng, -1.0, 1.0);
        for (int k = 0; k < rods().num_unknowns(); ++k)
            if (rods().is_taken(k))
                right[rods().begin().unknown + k] = 0.0;
        ConjugateGradients solver;
        const LinearReport report =
            solver.solve(total(), preconditioner, right, {.max_steps = 500}, x);
        EXPECT_LE(report.residual, 1e-6);
        EXPECT_FALSE(report.has_negative_curvature);
        return report.steps;
    }

private:
    static double nearest(const Rod& rod, const Vector3d& x)
    {
        constexpr int kPlaces = 400;
        double best = 0.0, least = INFINITY;
        for (int k = 0; k <= kPlaces; ++k)
        {
            const double s = rod.basis().begin() +
                             k * (rod.basis().end() - rod.basis().begin()) / kPlaces;
            if (const double d = (rod.rest().at(s).place - x).norm(); d < least)
            {
                least = d;
                best = s;
            }
        }
        return best;
    }

    HeldBody body_;
    std::vector<std::unique_ptr<Rod>> rods_;
    std::vector<std::unique_ptr<RodState>> rests_;
    std::vector<CoupledRod> coupled_;
    std::vector<RodConstraint> holds_;
    std::vector<Component> components_;
    std::unique_ptr<CellEnergy> energy_;
    PushingRods* pushing_ = nullptr;
};

HeldBody held_bar(int nx, int ny, int nz)
{
    HeldBody body(support::bar(nx, ny, nz).cells);
    body.prescribe([](const Cell& cell) { return cell.centre.x() < 1.0; });
    return body;
}

/// Through a bar from 1.2 on, not quite straight.
std::vector<Vector3d> line_in(int nx, int ny, int nz)
{
    std::vector<Vector3d> line;
    for (int k = 0; k <= 4; ++k)
        line.emplace_back(1.2 + (nx - 1.4) * k / 4.0, 0.5 * ny + 0.1 * std::sin(1.7 * k),
                          0.5 * nz + 0.05 * k);
    return line;
}

Coupled small_bar(double stiffness = 0.7)
{
    return Coupled(held_bar(5, 2, 2), {line_in(5, 2, 2)}, stiffness);
}

} // namespace

TEST(RodCoupling, energy_is_zero_at_rest_and_after_one_rigid_motion_of_all)
{
    Coupled scene(HeldBody(support::bar(5, 2, 2).cells), {line_in(5, 2, 2)}, 2.0);
    EXPECT_NEAR(scene.total().value(), 0.0, 1e-25);
    std::mt19937 rng(3);
    const Motion motion{support::random_rotation(rng), {1.0, -2.0, 0.5}};
    std::vector<Pose> poses = scene.body().rest();
    for (std::size_t c = 0; c < poses.size(); ++c)
        poses[c] = carried(motion, scene.body().cells.cells[c].centre);
    scene.energy().state.set_poses(poses);
    scene.rods().set(0, scene.rods().state(0), motion, {});
    EXPECT_NEAR(scene.total().value(), 0.0, 1e-20);
    Eigen::VectorXd gradient;
    scene.total().gradient(gradient);
    EXPECT_LT(gradient.norm(), 1e-12);
}

TEST(RodCoupling, derivatives_are_those_of_the_value)
{
    for (const bool is_held : {false, true})
        for (const unsigned seed : {1u, 2u, 3u})
        {
            Coupled scene = small_bar();
            scene.shake(0.1, seed);
            if (is_held)
                scene.hold();
            support::check_structure(scene.total());
            support::check_gradient(scene.total());
            support::check_blocks(scene.total(), kExact);
            support::check_gauss_newton(scene.total());
        }
}

TEST(RodCoupling, second_derivatives_are_exact_where_no_force_acts)
{
    for (const bool is_held : {false, true})
    {
        Coupled scene = small_bar();
        if (is_held)
            scene.hold();
        scene.total().linearise(kExact);
        Eigen::MatrixXd H = support::dense_hessian(scene.total());
        // What holds have taken has a stiffness but no energy.
        for (int k = 0; k < scene.rods().num_unknowns(); ++k)
            if (scene.rods().is_taken(k))
                H(scene.rods().begin().unknown + k, scene.rods().begin().unknown + k) =
                    0.0;
        const Eigen::MatrixXd by_values = support::hessian_by_values(scene.total());
        EXPECT_LT((H - by_values).norm(), 1e-5 * H.norm());
    }
}

TEST(RodCoupling,
     what_nothing_holds_has_six_rigid_motions_and_no_other_that_costs_nothing)
{
    Coupled scene(HeldBody(support::bar(4, 2, 2).cells), {line_in(4, 2, 2)}, 0.5);
    scene.total().linearise(kExact);
    const Eigen::MatrixXd H = support::dense_hessian(scene.total());
    const Eigen::VectorXd values =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(H, Eigen::EigenvaluesOnly)
            .eigenvalues();
    EXPECT_GT(values[0], -1e-9 * values[values.size() - 1]);
    EXPECT_LT(values[5], 1e-9 * values[values.size() - 1]);
    EXPECT_GT(values[6], 1e-7 * values[values.size() - 1]);
}

TEST(RodCoupling, holds_take_as_many_unknowns_as_they_have_rows_and_are_kept)
{
    Coupled scene = small_bar();
    scene.hold();
    int taken = 0;
    for (int k = 0; k < scene.rods().num_unknowns(); ++k)
        taken += scene.rods().is_taken(k);
    EXPECT_EQ(taken, 9);
    scene.shake(0.05, 7);
    EXPECT_LT(scene.violation(), 1e-12);
}

TEST(RodCoupling, conjugate_gradients_take_about_as_many_steps_as_for_cells_alone)
{
    for (const auto& [nx, ny, nz] : {std::array{24, 6, 6}, std::array{32, 3, 3}})
    {
        HeldBody alone = held_bar(nx, ny, nz);
        CellEnergy energy = alone.energy();
        energy.total.linearise(kGaussNewton);
        RigidMultigrid multigrid(energy.total, energy.bodies(grid_places(alone.cells)));
        std::mt19937 rng(5);
        Eigen::VectorXd right(energy.total.num_unknowns()), x;
        for (double& number : right)
            number = support::random_number(rng, -1.0, 1.0);
        ConjugateGradients solver;
        const int steps =
            solver.solve(energy.total, multigrid, right, {.max_steps = 500}, x).steps;
        for (const double ratio : {0.1, 1.0, 10.0, 1000.0})
            for (const bool is_held : {false, true})
            {
                // Of the bending stiffness of the bar.
                Coupled scene(held_bar(nx, ny, nz), {line_in(nx, ny, nz)},
                              ratio * 2.0 * ny * nz * nz * nz / 12.0, 0.8);
                if (is_held)
                    scene.hold();
                const int own = scene.steps();
                EXPECT_LE(own, 1.5 * steps) << nx << " x " << ny << ", " << ratio;
            }
    }
}

TEST(RodCoupling, two_rods_that_touch_are_coupled)
{
    Coupled scene(held_bar(8, 3, 3),
                  {{{1.2, 1.5, 1.5}, {3, 1.5, 1.5}, {4.5, 1.5, 1.5}},
                   {{4.5, 0.5, 1.5}, {5, 1.5, 1.5}, {6.5, 2.5, 1.5}}},
                  5.0, 0.8);
    scene.shake(0.05, 11);
    support::check_gradient(scene.total());
    support::check_blocks(scene.total(), kExact);
    EXPECT_LE(scene.steps(), 40);
}

TEST(RodCoupling, a_step_that_turns_a_rod_too_far_counts_as_one_that_costs_too_much)
{
    Coupled scene = small_bar();
    Eigen::VectorXd step = Eigen::VectorXd::Zero(scene.total().num_unknowns());
    const int first = scene.rods().begin().unknown +
                      scene.rods().state(0).rod().layout().control.back();
    step[first + 1] = 10.0;
    scene.total().move(step, 1.0);
    EXPECT_TRUE(std::isinf(scene.total().value()));
    scene.total().move(step, 1e-3);
    EXPECT_TRUE(std::isfinite(scene.total().value()));
}

} // namespace cellwarp::core
