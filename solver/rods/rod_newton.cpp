// SPDX-License-Identifier: GPL-3.0-or-later
// What is minimised is Phi(x) = U - F . x, in time with inertia
//   1/2 c |x - begin|_M^2 - v . M (x - begin) / step,   c = 1 / step^2 + viscosity /
//   step,
// subject to g(x) = 0. A slender rod is millions of times stiffer along itself than
// across. Plain Newton steps stretch it to second order, which a line search cannot
// allow: it crawls. Hence
//  - the stretch force in the second derivatives is the one that the last step predicted,
//    not that of the state;
//  - tangents turn by no more than kTurn in a step;
//  - what a step stretches to second order is taken back with the same factor, twice;
//  - where the pivots show that the matrix is not definite on what the constraints leave
//    free, pushing stretch forces count as none, then all curvature is left out, then a
//    share of the mass is added.
#include "solver/rods/rod_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cellwarp
{

namespace
{

constexpr double kTurn = 0.5; ///< [rad]
/// Each takes back all but an eighth or less of what is left, down to where only rounding
/// is.
constexpr int kCorrections = 12;
constexpr double kCorrected = 1e-10;
constexpr double kSmallTurn = 0.01; ///< [rad]
constexpr int kHalvings = 30;
constexpr double kRounding = std::numeric_limits<double>::epsilon();

} // namespace

const char* stop_name(RodStop stop)
{
    switch (stop)
    {
    case RodStop::NotRun:
        return "not run";
    case RodStop::Converged:
        return "converged";
    case RodStop::IterationLimit:
        return "iteration limit";
    case RodStop::NoDescent:
        return "no descent";
    case RodStop::NotFinite:
        return "not finite";
    }
    return "";
}

RodNewton::RodNewton(RodModel& model)
    : model_(model),
      weight_(model.rod().layout().num_unknowns, model.rod().layout().half_band)
{
    model.mass().add_to(weight_, 1.0);
    for (int j = 0; j < weight_.rows(); ++j)
        heaviest_ = std::max(heaviest_, weight_.lower(j, j));
    for (const RodSpan& span : model.rod().spans())
    {
        const Section section = model.rod().section_at(0.5 * (span.begin + span.end));
        const double L = span.length;
        stiffness_of_spans_ =
            std::max(stiffness_of_spans_,
                     section.stretch / L +
                         std::max(section.bending[0], section.bending[1]) / (L * L * L));
    }
}

/// One solve.
class RodNewton::Run
{
public:
    Run(RodNewton& newton, const RodInertia* inertia, const RodState* midpoint)
        : newton_(newton), model_(newton.model_), inertia_(inertia), midpoint_(midpoint)
    {
        if (inertia)
            pull_ = inertia->viscosity / inertia->step +
                    1.0 / (inertia->step * inertia->step);
    }

    /// What constraints are violated by, with their rows and without.
    RodModel::Rows rows(const RodState& state) const
    {
        return midpoint_ ? model_.rows(end_of(state)) : model_.rows(state);
    }
    Eigen::VectorXd violations(const RodState& state) const
    {
        return rows(state).violation;
    }
    double value(const RodState& state) const
    {
        double sum = model_.potential(state);
        if (inertia_)
        {
            const Eigen::VectorXd way = state.x() - inertia_->begin;
            const Eigen::VectorXd M = model_.mass().times(way);
            sum += 0.5 * pull_ * way.dot(M) - inertia_->velocity.dot(M) / inertia_->step;
        }
        return sum;
    }
    /// Gives the largest force that takes part in the balance.
    double gradient(const RodState& state, Eigen::VectorXd& out) const
    {
        model_.gradient(state, out);
        double largest = out.cwiseAbs().maxCoeff();
        if (!inertia_)
            return largest;
        const Eigen::VectorXd held = model_.mass().times(
            pull_ * (state.x() - inertia_->begin) - inertia_->velocity / inertia_->step);
        out += held;
        return std::max(largest, held.cwiseAbs().maxCoeff());
    }
    /// False if it is not finite.
    bool factorize(const RodState& state, const RodModel::Rows& rows, int& num_dropped)
    {
        double added = 0.0;
        for (const RodHessian how :
             {RodHessian::Exact, RodHessian::Tensed, RodHessian::Definite})
        {
            model_.hessian(state, how, newton_.matrix_);
            if (inertia_)
                model_.mass().add_to(newton_.matrix_, pull_);
            const SaddleSolver::Report told =
                newton_.saddle_.factorize(newton_.matrix_, rows.rows, rows.groups);
            if (!told.is_finite)
                return false;
            num_dropped = told.num_dropped;
            if (told.num_negative == 0)
                return true;
        }
        // Held by nothing: as little weight as makes it definite.
        double stiffness = 0.0;
        for (int j = 0; j < newton_.matrix_.rows(); ++j)
            stiffness = std::max(stiffness, std::abs(newton_.matrix_.lower(j, j)));
        for (double share = 1e-12; share < 1e6; share *= 100.0)
        {
            const double more = share * stiffness / newton_.heaviest_;
            model_.mass().add_to(newton_.matrix_, more - added);
            added = more;
            const SaddleSolver::Report told =
                newton_.saddle_.factorize(newton_.matrix_, rows.rows, rows.groups);
            num_dropped = told.num_dropped;
            if (!told.is_finite || told.num_negative == 0)
                return told.is_finite;
        }
        return false;
    }

private:
    /// Of a step whose middle the state is.
    RodState end_of(const RodState& state) const
    {
        RodState end = *midpoint_;
        end.move_to(2.0 * state.x() - midpoint_->x());
        return end;
    }

    RodNewton& newton_;
    RodModel& model_;
    const RodInertia* inertia_;
    const RodState* midpoint_;
    double pull_ = 0.0;
};

RodNewtonReport RodNewton::solve(RodState& state, const RodInertia* inertia,
                                 const RodNewtonOptions& options,
                                 const RodState* midpoint)
{
    Run run(*this, inertia, midpoint);
    RodNewtonReport report;
    report.iterations = 0;
    const Rod& rod = model_.rod();
    const double size = rod.arc_length().total();
    // Rounding of the places leaves so much of the forces.
    const double pull = inertia ? 1.0 / (inertia->step * inertia->step) : 0.0;
    const double floor = 8.0 * kRounding * (stiffness_of_spans_ + pull * heaviest_) *
                         std::max(size, state.x().cwiseAbs().maxCoeff());
    // How much a step of the unknowns moves what constraints are of.
    const double lead = midpoint ? 2.0 : 1.0;
    Eigen::VectorXd gradient, residual, step, right, values;
    for (const std::unique_ptr<RodTerm>& term : model_.terms)
        term->predict(state, nullptr);
    double penalty = 0.0;
    for (;; ++report.iterations)
    {
        const RodModel::Rows rows = run.rows(state);
        if (lambda_.size() != rows.violation.size())
            lambda_ = Eigen::VectorXd::Zero(rows.violation.size());
        const double force = run.gradient(state, gradient);
        residual = gradient;
        add_forces(rows.rows, lambda_, -1.0, residual);
        report.residual = residual.cwiseAbs().maxCoeff();
        report.violation =
            rows.violation.size() > 0 ? rows.violation.cwiseAbs().maxCoeff() : 0.0;
        if (!std::isfinite(report.residual) || !std::isfinite(report.violation))
        {
            report.stop = RodStop::NotFinite;
            return report;
        }
        const double at_work =
            lambda_.size() > 0 ? std::max(force, lambda_.cwiseAbs().maxCoeff()) : force;
        const bool is_balanced =
            report.residual <= std::max(floor, options.tolerance * at_work);
        if (report.iterations > 0 && is_balanced &&
            report.violation <= 1e-11 * std::max(size, 1.0))
        {
            report.stop = RodStop::Converged;
            return report;
        }
        if (report.iterations >= options.max_iterations)
        {
            report.stop = RodStop::IterationLimit;
            return report;
        }
        if (!run.factorize(state, rows, report.num_dropped))
        {
            report.stop = RodStop::NotFinite;
            return report;
        }
        step = -gradient;
        values = rows.violation / lead;
        saddle_.solve(step, values);
        const Eigen::VectorXd next_lambda = values;
        if (!step.allFinite())
        {
            report.stop = RodStop::NotFinite;
            return report;
        }
        // Of every tangent.
        double turn = 0.0;
        for (std::size_t e = 0; e < rod.spans().size(); ++e)
            for (int p = 0; p < rod.num_places(); ++p)
            {
                Eigen::Vector3d change = Eigen::Vector3d::Zero();
                for (int j = 0; j < rod.order(); ++j)
                    change +=
                        rod.first(e, p)[j] *
                        step.segment<3>(rod.layout().control[idx(rod.controls(e)[j])]);
                const Eigen::Vector3d u = state.first(e, p);
                const double l2 = u.squaredNorm();
                turn = std::max(turn,
                                (change - u.dot(change) / l2 * u).norm() / std::sqrt(l2));
            }
        const bool is_capped = turn > kTurn;
        const double reach = is_capped ? kTurn / turn : 1.0;
        step *= reach;
        penalty = std::max(
            penalty,
            1.5 * (next_lambda.size() > 0 ? next_lambda.cwiseAbs().maxCoeff() : 0.0));
        // Couples have no potential: their work on the way there is taken by its ends.
        const Eigen::VectorXd couples = model_.couples(state);
        const auto merit = [&](const RodState& at, const Eigen::VectorXd& violation)
        {
            return run.value(at) + penalty * violation.cwiseAbs().sum() -
                   0.5 * (couples + model_.couples(at)).dot(at.x() - state.x());
        };
        const double before = merit(state, rows.violation);
        const double slope =
            gradient.dot(step) - penalty * reach * rows.violation.cwiseAbs().sum();
        // What rounding makes of the sums.
        const double noise =
            64.0 * kRounding *
            (std::abs(before) + 1e-6 * stiffness_of_spans_ * size * size);
        RodState best = state;
        bool is_accepted = false;
        double length = 1.0;
        for (int halving = 0; halving < kHalvings && !is_accepted;
             ++halving, length *= 0.5)
        {
            RodState trial = state;
            const Eigen::VectorXd part = length * step;
            trial.move(part);
            // Small steps of soft rods need no correction.
            const auto lowers = [&]
            {
                return merit(trial, run.violations(trial)) <=
                       before + 1e-4 * length * std::min(slope, 0.0) + noise;
            };
            bool is_lower = length * reach * turn < kSmallTurn && lowers();
            for (int correction = 0; correction < kCorrections && !is_lower; ++correction)
            {
                right.setZero(step.size());
                for (const std::unique_ptr<RodTerm>& term : model_.terms)
                    term->add_correction(state, trial, part, right);
                values =
                    (run.violations(trial) - (1.0 - length * reach) * rows.violation) /
                    lead;
                saddle_.solve(right, values);
                if (!right.allFinite())
                    break;
                trial.move(right);
                if (right.cwiseAbs().maxCoeff() <=
                    kCorrected * step.cwiseAbs().maxCoeff())
                    break;
            }
            if (is_lower || lowers())
            {
                best = std::move(trial);
                is_accepted = true;
            }
        }
        if (!is_accepted)
        {
            report.stop = is_balanced ? RodStop::Converged : RodStop::NoDescent;
            return report;
        }
        const bool is_whole = !is_capped && length >= 0.25;
        for (const std::unique_ptr<RodTerm>& term : model_.terms)
        {
            if (is_whole)
                term->predict(state, &step);
            else
                term->predict(best, nullptr);
        }
        lambda_ = next_lambda;
        state = std::move(best);
    }
}

} // namespace cellwarp
