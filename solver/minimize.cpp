// SPDX-License-Identifier: GPL-3.0-or-later
// Unknowns are twists about the current centres: 6 numbers for a free cell. A
// pinned cell, whose held point is at X, has 3: with q = p - X the centre follows,
//   p' = X + rot(omega) q = p + omega x q + 1/2 omega x (omega x q) + ...,
// which is a twist with v = omega x q: its gradient is g_omega + q x g_v, and its block
// P^T H P with P = [I; -[q]x].
#include "solver/minimize.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

/// Decrease that a step must bring, relative to what its slope promises (Armijo).
constexpr double kSufficient = 1e-4;
constexpr int kMaxHalvings = 40;

/// When a step promises less than this share of the energy, the energy's own
/// rounding hides the decrease and the gradient is the better judge.
constexpr double kEnergyRounding = 1e-11;

/// Proximal term on rotations that nothing holds, relative to the diagonal: it
/// vanishes with the step and so does not change the solution.
constexpr double kProximal = 1e-3;

/// Shares of the curvature that Newton's method tries, until the matrix is positive
/// definite. Half of it still saves most of the crawl of plain Gauss-Newton.
constexpr double kCurvatureShares[] = {1.0, 0.5, 0.25};

/// First damping when even J^T J does not factorise, relative to the diagonal;
/// tenfold with each of kMaxDampings retries.
constexpr double kFirstDamping = 1e-12;
constexpr int kMaxDampings = 8;

using Clock = std::chrono::steady_clock;

Eigen::Matrix<double, 6, 3> pin_basis(const Eigen::Vector3d& q)
{
    Eigen::Matrix<double, 6, 3> P;
    P.topRows<3>().setIdentity();
    P.bottomRows<3>() = -cross_matrix(q);
    return P;
}

} // namespace

std::string stop_name(Stop stop)
{
    switch (stop)
    {
    case Stop::NotRun:
        return "not run";
    case Stop::Converged:
        return "converged";
    case Stop::IterationLimit:
        return "iteration limit";
    case Stop::TimeLimit:
        return "time limit";
    case Stop::Stopped:
        return "stopped";
    case Stop::NoDescent:
    case Stop::NotPositiveDefinite:
        return "no descent";
    }
    return {};
}

Minimizer::Minimizer(const Cells& cells, const Glue& glue,
                     std::span<const Constraint> constraints,
                     std::span<const Component> components)
    : glue_(glue), constraints_(constraints.begin(), constraints.end())
{
    std::vector<int> sizes;
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        centres_.push_back(cells.cells[i].centre);
        const Hold hold = constraints_[i].hold;
        const bool is_unknown = hold == Hold::Free || hold == Hold::Pinned;
        unknown_of_cell_.push_back(is_unknown ? static_cast<int>(cell_of_unknown_.size())
                                              : -1);
        if (is_unknown)
        {
            cell_of_unknown_.push_back(static_cast<int>(i));
            sizes.push_back(hold == Hold::Free ? 6 : 3);
        }
    }
    turns_freely_.assign(cell_of_unknown_.size(), false);
    for (const Component& component : components)
        if (component.free_rotations > 0)
            for (const int cell : component.cells)
                if (constraints_[static_cast<std::size_t>(cell)].hold == Hold::Pinned)
                    turns_freely_[static_cast<std::size_t>(
                        unknown_of_cell_[static_cast<std::size_t>(cell)])] = true;
    std::vector<std::pair<int, int>> pairs;
    for (const GlueFace& face : glue_.faces)
    {
        const int a = unknown_of_cell_[static_cast<std::size_t>(face.a)];
        const int b = unknown_of_cell_[static_cast<std::size_t>(face.b)];
        if (a >= 0 && b >= 0)
            pairs.emplace_back(std::max(a, b), std::min(a, b));
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    matrix_ = BlockMatrix(sizes, pairs);
    for (const GlueFace& face : glue_.faces)
    {
        const int a = unknown_of_cell_[static_cast<std::size_t>(face.a)];
        const int b = unknown_of_cell_[static_cast<std::size_t>(face.b)];
        block_of_face_.push_back(
            a >= 0 && b >= 0 ? matrix_.find(std::max(a, b), std::min(a, b)) : -1);
    }
    face_blocks_.resize(glue_.faces.size());
    if (!sizes.empty())
        solver_.emplace(matrix_);
}

void Minimizer::set_held_points(std::span<const Constraint> constraints)
{
    for (std::size_t i = 0; i < constraints_.size(); ++i)
        constraints_[i].held_now = constraints[i].held_now;
}

Residual Minimizer::residual(std::span<const Pose> poses) const
{
    std::vector<Eigen::Matrix<double, 12, 1>> gradients(glue_.faces.size());
    parallel_for(glue_.faces.size(),
                 [&](std::size_t f)
                 {
                     const GlueFace& face = glue_.faces[f];
                     gradients[f] =
                         glue_gradient(face, poses[static_cast<std::size_t>(face.a)],
                                       poses[static_cast<std::size_t>(face.b)]);
                 });
    Residual result;
    double uncancelled = 0.0;
    for (const int cell : cell_of_unknown_)
    {
        double forces = 0.0, sizes = 0.0;
        for (int k = glue_.first_face[static_cast<std::size_t>(cell)];
             k < glue_.first_face[static_cast<std::size_t>(cell) + 1]; ++k)
        {
            const std::size_t f = static_cast<std::size_t>(
                glue_.faces_of_cell[static_cast<std::size_t>(k)]);
            const GlueFace& face = glue_.faces[f];
            forces += gradients[f].segment<6>(face.a == cell ? 0 : 6).norm();
            sizes += 2.0 * face.stiffness *
                     (poses[static_cast<std::size_t>(face.a)].p.norm() +
                      poses[static_cast<std::size_t>(face.b)].p.norm());
        }
        uncancelled += forces * forces;
        result.rounding.push_back(4.0 * std::numeric_limits<double>::epsilon() * sizes);
    }
    result.gradient = reduced_gradient(poses).norm();
    result.uncancelled = std::sqrt(uncancelled);
    return result;
}

bool Minimizer::is_rounding(const Eigen::VectorXd& gradient,
                            std::span<const double> rounding) const
{
    for (int u = 0; u < num_unknown_cells(); ++u)
        if (!(gradient.segment(matrix_.first(u), matrix_.size(u)).norm() <=
              rounding[static_cast<std::size_t>(u)]))
            return false;
    return true;
}

Eigen::VectorXd Minimizer::reduced_gradient(std::span<const Pose> poses) const
{
    Eigen::VectorXd gradient(matrix_.rows());
    parallel_for(
        num_unknown_cells(),
        [&](int u)
        {
            const int cell = cell_of_unknown_[static_cast<std::size_t>(u)];
            Twist sum = Twist::Zero();
            for (int k = glue_.first_face[static_cast<std::size_t>(cell)];
                 k < glue_.first_face[static_cast<std::size_t>(cell) + 1]; ++k)
            {
                const GlueFace& face = glue_.faces[static_cast<std::size_t>(
                    glue_.faces_of_cell[static_cast<std::size_t>(k)])];
                sum += glue_gradient(face, poses[static_cast<std::size_t>(face.a)],
                                     poses[static_cast<std::size_t>(face.b)])
                           .segment<6>(face.a == cell ? 0 : 6);
            }
            const Constraint& constraint = constraints_[static_cast<std::size_t>(cell)];
            if (constraint.hold == Hold::Pinned)
            {
                const Eigen::Vector3d q =
                    poses[static_cast<std::size_t>(cell)].p - constraint.held_now;
                gradient.segment<3>(matrix_.first(u)) = pin_basis(q).transpose() * sum;
            }
            else
                gradient.segment<6>(matrix_.first(u)) = sum;
        });
    return gradient;
}

void Minimizer::assemble(std::span<const Pose> poses, Curvature curvature)
{
    parallel_for(glue_.faces.size(),
                 [&](std::size_t f)
                 {
                     const GlueFace& face = glue_.faces[f];
                     face_blocks_[f] =
                         glue_block(face, poses[static_cast<std::size_t>(face.a)],
                                    poses[static_cast<std::size_t>(face.b)], curvature);
                 });
    matrix_.set_zero();
    const auto q_of = [&](int cell) -> Eigen::Vector3d
    {
        return poses[static_cast<std::size_t>(cell)].p -
               constraints_[static_cast<std::size_t>(cell)].held_now;
    };
    const auto is_pinned = [&](int cell)
    { return constraints_[static_cast<std::size_t>(cell)].hold == Hold::Pinned; };
    parallel_for(num_unknown_cells(),
                 [&](int u)
                 {
                     const int cell = cell_of_unknown_[static_cast<std::size_t>(u)];
                     Eigen::Matrix<double, 6, 6> sum =
                         Eigen::Matrix<double, 6, 6>::Zero();
                     for (int k = glue_.first_face[static_cast<std::size_t>(cell)];
                          k < glue_.first_face[static_cast<std::size_t>(cell) + 1]; ++k)
                     {
                         const std::size_t f = static_cast<std::size_t>(
                             glue_.faces_of_cell[static_cast<std::size_t>(k)]);
                         const int at = glue_.faces[f].a == cell ? 0 : 6;
                         sum += face_blocks_[f].hessian.block<6, 6>(at, at);
                     }
                     if (!is_pinned(cell))
                     {
                         matrix_.diagonal(u) = sum;
                         return;
                     }
                     const Eigen::Vector3d q = q_of(cell);
                     const Eigen::Matrix<double, 6, 3> P = pin_basis(q);
                     Eigen::Matrix3d block = P.transpose() * sum * P;
                     if (turns_freely_[static_cast<std::size_t>(u)])
                         block += kProximal * sum.topLeftCorner<3, 3>().trace() / 3.0 *
                                  Eigen::Matrix3d::Identity();
                     matrix_.diagonal(u) = block;
                 });
    parallel_for(glue_.faces.size(),
                 [&](std::size_t f)
                 {
                     if (block_of_face_[f] < 0)
                         return;
                     const GlueFace& face = glue_.faces[f];
                     const int a = unknown_of_cell_[static_cast<std::size_t>(face.a)];
                     const int b = unknown_of_cell_[static_cast<std::size_t>(face.b)];
                     // The block of the larger unknown's rows and the smaller one's
                     // columns.
                     const bool a_is_row = a > b;
                     const int row_cell = a_is_row ? face.a : face.b;
                     const int column_cell = a_is_row ? face.b : face.a;
                     Eigen::MatrixXd block = face_blocks_[f].hessian.block<6, 6>(
                         a_is_row ? 0 : 6, a_is_row ? 6 : 0);
                     if (is_pinned(row_cell))
                         block = (pin_basis(q_of(row_cell)).transpose() * block).eval();
                     if (is_pinned(column_cell))
                         block = (block * pin_basis(q_of(column_cell))).eval();
                     matrix_.block(block_of_face_[f]) = block;
                 });
}

void Minimizer::add_damping(double factor)
{
    for (int u = 0; u < num_unknown_cells(); ++u)
    {
        BlockMatrix::Block block = matrix_.diagonal(u);
        block.diagonal() += factor * block.diagonal().cwiseAbs();
    }
}

bool Minimizer::factorize(std::span<const Pose> poses, Method method, SolveReport& report)
{
    report.is_saddle = false;
    for (const double share : kCurvatureShares)
    {
        if (method != Method::Newton)
            break;
        assemble(poses, {share});
        if (solver_->factorize(matrix_))
        {
            report.newton_iterations += share == 1.0;
            return true;
        }
        report.is_saddle = true;
    }
    assemble(poses, kGaussNewton);
    double damping = kFirstDamping;
    for (int retry = 0; retry <= kMaxDampings; ++retry, damping *= 10.0)
    {
        if (solver_->factorize(matrix_))
            return true;
        add_damping(damping);
        ++report.damped_factorisations;
    }
    return false;
}

std::vector<Pose> Minimizer::stepped(std::span<const Pose> poses,
                                     const Eigen::VectorXd& step, double length) const
{
    std::vector<Pose> next(poses.begin(), poses.end());
    for (int u = 0; u < num_unknown_cells(); ++u)
    {
        const std::size_t cell =
            static_cast<std::size_t>(cell_of_unknown_[static_cast<std::size_t>(u)]);
        Twist twist = Twist::Zero();
        twist.head(matrix_.size(u)) =
            length * step.segment(matrix_.first(u), matrix_.size(u));
        next[cell] = moved(poses[cell], twist);
        if (constraints_[cell].hold == Hold::Pinned)
            next[cell] = held_at_pin(next[cell], constraints_[cell], centres_[cell]);
    }
    return next;
}

SolveReport Minimizer::minimize(std::vector<Pose>& poses, const SolveOptions& options)
{
    const Clock::time_point start = Clock::now();
    SolveReport report;
    report.iterations = 0;
    double energy = glue_energy(glue_, poses);
    report.energy_before = energy;
    const Residual first = residual(poses);
    const double scale =
        options.gradient_scale > 0 ? options.gradient_scale : first.gradient;
    Eigen::VectorXd gradient = reduced_gradient(poses);
    double gradient_norm = first.gradient;
    const auto finish = [&](Stop stop)
    {
        report.stop = stop;
        report.energy_after = energy;
        report.gradient = scale > 0 ? gradient_norm / scale : 0.0;
        return report;
    };
    if (num_unknown_cells() == 0)
        return finish(Stop::Converged);
    // Against a scale that overflowed everything would be small.
    if (!std::isfinite(energy + gradient_norm + scale + first.uncancelled))
        return finish(Stop::NotPositiveDefinite);
    for (;;)
    {
        if (gradient_norm <= options.gradient_tolerance * scale ||
            is_rounding(gradient, first.rounding))
            return finish(Stop::Converged);
        if (report.iterations >= options.max_iterations)
            return finish(Stop::IterationLimit);
        if (options.stop.stop_requested())
            return finish(Stop::Stopped);
        if (options.time_budget > 0 &&
            std::chrono::duration<double>(Clock::now() - start).count() >
                options.time_budget)
            return finish(Stop::TimeLimit);

        if (!factorize(poses, options.method, report))
            return finish(Stop::NotPositiveDefinite);
        const Eigen::VectorXd step = -solver_->solve(gradient);
        if (!step.allFinite())
            return finish(Stop::NotPositiveDefinite);
        const double error = (matrix_.multiply(step) + gradient).norm() /
                             (matrix_.norm() * step.norm() + gradient.norm());
        report.backward_error = std::max(report.backward_error, error);

        const double slope = gradient.dot(step);
        const bool is_hidden = -slope <= kEnergyRounding * energy;
        bool is_accepted = false;
        double length = 1.0;
        for (int halving = 0; halving <= kMaxHalvings && !is_accepted;
             ++halving, length *= 0.5)
        {
            std::vector<Pose> trial = stepped(poses, step, length);
            const double trial_energy = glue_energy(glue_, trial);
            is_accepted = trial_energy <= energy + kSufficient * length * slope;
            if (!is_accepted && is_hidden)
            {
                // Rounding hides the decrease: the gradient must fall instead.
                is_accepted = reduced_gradient(trial).norm() < 0.5 * gradient_norm &&
                              trial_energy <= energy * (1.0 + 1e-13);
                if (!is_accepted)
                    break;
            }
            if (is_accepted)
            {
                poses = std::move(trial);
                energy = trial_energy;
                gradient = reduced_gradient(poses);
                gradient_norm = gradient.norm();
            }
        }
        if (!is_accepted)
            return finish(is_hidden ? Stop::Converged : Stop::NoDescent);
        ++report.iterations;
    }
}

} // namespace cellwarp
