// SPDX-License-Identifier: GPL-3.0-or-later
// What is minimised is Phi(x) = U - F . x, in time with inertia, the viscosity gamma and
// the drags D,
//   1/2 (1 / step^2 + gamma / step) |x - begin|_M^2 + 1/2 |x - begin|_D^2 / step
//   - v . M (x - begin) / step,
// subject to g(x) = 0. A slender rod is millions of times stiffer along itself than
// across. Plain Newton steps stretch it to second order, which a line search cannot
// allow: it crawls. Hence
//  - the stretch force in the second derivatives is the one that the last step predicted,
//    not that of the state;
//  - tangents turn by no more than kTurn in a step;
//  - what a step stretches to second order is taken back with the same factor, again and
//    again until only rounding is left. The stretch that is left counts from the step
//    itself, not from what the corrections have made of it: with the latter the rod
//    creeps;
//  - where the pivots show that the matrix is not definite on what the constraints leave
//    free, pushing stretch forces count as none, then all curvature is left out, then a
//    share of the mass is added.
//
// Constraints that contradict are met in the sense of least squares: of the violations g
// no step removes the part r with L^T r = 0, L their rows; what is solved for is g - r =
// 0.
#include "solver/rods/rod_newton.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

namespace cellwarp
{

namespace
{

constexpr double kTurn = 0.5; ///< [rad]
/// Each takes back all but an eighth or less of what is left, down to where only rounding
/// is.
constexpr int kCorrections = 12;
constexpr double kCorrected = 1e-10;
/// Of constraints, of the rod's length.
constexpr double kViolation = 1e-11;
/// A residual that stays above this share of the last one no longer falls.
constexpr double kStill = 0.9;
/// Of constraints, of the rod's length: more of what contradicts is no rounding.
constexpr double kContradiction = 1e-9;
constexpr double kSmallTurn = 0.01; ///< [rad]
constexpr int kHalvings = 30;
constexpr double kRounding = std::numeric_limits<double>::epsilon();

/// The part of the violations that no step removes, to first order. Each row that says
/// nothing new is a sum of others, L_j = sum c_i L_i: what e_j - c takes of the
/// violations stays. Rows are sorted along the rod, so that L L^T is a band.
Eigen::VectorXd contradiction(const RodModel::Rows& of)
{
    const int k = static_cast<int>(of.rows.size());
    Eigen::VectorXd r = of.violation;
    if (!(r.cwiseAbs().maxCoeff() > 0.0))
        return r;
    std::vector<int> order(of.rows.size());
    std::iota(order.begin(), order.end(), 0);
    const auto first = [&](int row)
    { return of.rows[idx(row)].empty() ? 0 : of.rows[idx(row)].front().first; };
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return first(a) < first(b); });
    // Rows that share no unknown share no entry.
    int half_band = 0;
    for (int i = 0; i < k; ++i)
    {
        const SparseRow& row = of.rows[idx(order[idx(i)])];
        int end = i;
        while (!row.empty() && end + 1 < k &&
               first(order[idx(end + 1)]) <= row.back().first)
            ++end;
        half_band = std::max(half_band, end - i);
    }
    BandMatrix S(k, half_band);
    for (int j = 0; j < k; ++j)
        for (int i = j; i <= std::min(j + half_band, k - 1); ++i)
        {
            const SparseRow &a = of.rows[idx(order[idx(i)])],
                            &b = of.rows[idx(order[idx(j)])];
            for (auto p = a.begin(), q = b.begin(); p != a.end() && q != b.end();)
            {
                if (p->first == q->first)
                    S.lower(i, j) += p++->second * q++->second;
                else if (p->first < q->first)
                    ++p;
                else
                    ++q;
            }
        }
    BandFactor factor;
    factor.factorize(S, std::vector<char>(of.rows.size(), 1));
    std::vector<Eigen::VectorXd> idle;
    for (int j = 0; j < k; ++j)
    {
        if (!factor.is_left_out(j))
            continue;
        const Eigen::VectorXd one = Eigen::VectorXd::Unit(k, j);
        Eigen::VectorXd entries, sum;
        S.multiply(one, entries);
        factor.solve(entries);
        // Once more with what rounding has left.
        S.multiply(one - entries, sum);
        factor.solve(sum);
        idle.push_back(one - entries - sum);
    }
    if (idle.empty())
        return Eigen::VectorXd::Zero(k);
    Eigen::VectorXd sorted(k);
    for (int i = 0; i < k; ++i)
        sorted[i] = r[order[idx(i)]];
    const Eigen::Index m = static_cast<Eigen::Index>(idle.size());
    Eigen::MatrixXd N(k, m);
    for (Eigen::Index c = 0; c < m; ++c)
        N.col(c) = idle[static_cast<std::size_t>(c)];
    sorted = N * (N.transpose() * N).ldlt().solve(N.transpose() * sorted);
    for (int i = 0; i < k; ++i)
        r[order[idx(i)]] = sorted[i];
    return r;
}

} // namespace

const char* stop_name(RodStop stop)
{
    switch (stop)
    {
    case RodStop::NotRun:
        return "not run";
    case RodStop::Converged:
        return "converged";
    case RodStop::EnergyGrew:
        return "energy grew";
    case RodStop::Contradiction:
        return "contradictory constraints";
    case RodStop::IterationLimit:
        return "iteration limit";
    case RodStop::NoDescent:
        return "no descent";
    case RodStop::NotFinite:
        return "not finite";
    }
    return "";
}

RodNewton::RodNewton(RodModel& model) : model_(model)
{
    const RodLayout& layout = model.rod().layout();
    BandMatrix weight(layout.num_unknowns, layout.half_band);
    model.mass().add_to(weight, 1.0);
    for (int j = 0; j < weight.rows(); ++j)
        heaviest_ = std::max(heaviest_, weight.lower(j, j));
    for (const RodSpan& span : model.rod().spans())
    {
        const Section section = model.rod().section_at(0.5 * (span.begin + span.end));
        const double L = span.length;
        stiffness_ =
            std::max(stiffness_,
                     section.stretch / L +
                         std::max(section.bending[0], section.bending[1]) / (L * L * L));
    }
    for (const std::unique_ptr<RodTerm>& term : model.terms)
        stiffness_ += term->stiffness();
}

/// One solve.
class RodNewton::Run
{
public:
    Run(RodNewton& newton, RodState& state, const RodInertia* inertia,
        const RodState* midpoint);
    RodNewtonReport operator()(const RodNewtonOptions& options);

private:
    RodModel::Rows rows(const RodState& at) const
    {
        return midpoint_ ? model_.rows(end_of(at)) : model_.rows(at);
    }
    Eigen::VectorXd violations(const RodState& at) const
    {
        if (model_.constraints.empty())
            return {};
        const Eigen::VectorXd all =
            midpoint_ ? model_.violations(end_of(at)) : model_.violations(at);
        return has_contradiction_ ? all - contradiction_ : all;
    }
    RodState end_of(const RodState& at) const;
    /// Phi at a place, and what makes it up.
    struct Place
    {
        double value = 0.0;
        Eigen::VectorXd held; ///< by inertia, viscosity and drags [N]
        Eigen::VectorXd violation;
    };
    void look(const RodState& at, Place& place) const;
    double merit(const RodState& at, const Place& place) const;
    bool keeps_constraints() const
    {
        return largest(rows_.violation) <= kViolation * std::max(size_, 1.0);
    }
    static double largest(const Eigen::VectorXd& violation)
    {
        return violation.size() > 0 ? violation.cwiseAbs().maxCoeff() : 0.0;
    }
    RodStop converged() const
    {
        return report_.violation > kContradiction * std::max(size_, 1.0)
                   ? RodStop::Contradiction
                   : RodStop::Converged;
    }
    void take_off_contradiction();
    bool measure(const RodNewtonOptions& options);
    bool factorize();
    double largest_turn() const;
    bool advance();
    bool try_length(double length, RodState& trial);
    void correct(double length, RodState& trial);

    RodNewton& newton_;
    RodModel& model_;
    RodState& state_;
    const RodInertia* inertia_;
    const RodState* midpoint_; ///< the begin of a step whose middle the state is
    double size_;              ///< length at rest [m]
    double pull_ = 0.0;        ///< of the mass, in second derivatives [1/s^2]
    Eigen::VectorXd momentum_; ///< M v / step [N]
    double floor_;             ///< what rounding of the places leaves of the forces [N]
    double lead_;              ///< how much a step moves what constraints are of
    double penalty_ = 0.0;     ///< of what constraints are violated by [N]
    RodNewtonReport report_;
    bool is_balanced_ = false, has_contradiction_ = false;
    Eigen::VectorXd contradiction_; ///< the part of violations that is not solved for
    double last_residual_ = std::numeric_limits<double>::infinity();

    // Of this iteration.
    RodModel::Rows rows_;
    Place here_, there_; ///< of the state, and of where it is to go
    Eigen::VectorXd gradient_, step_, next_lambda_, couples_;
    double reach_ = 1.0; ///< of the whole step that the cap on turns allows
    double turn_ = 0.0;  ///< largest of a tangent in the whole step [rad]
    double before_ = 0.0, slope_ = 0.0, noise_ = 0.0;
};

RodNewton::Run::Run(RodNewton& newton, RodState& state, const RodInertia* inertia,
                    const RodState* midpoint)
    : newton_(newton), model_(newton.model_), state_(state), inertia_(inertia),
      midpoint_(midpoint), size_(model_.rod().arc_length().total()),
      lead_(midpoint ? 2.0 : 1.0)
{
    double of_mass = 0.0;
    if (inertia)
    {
        of_mass = 1.0 / (inertia->step * inertia->step);
        pull_ = model_.viscosity / inertia->step + of_mass;
        momentum_ = model_.mass().times(inertia->velocity) / inertia->step;
    }
    double of_drags = 0.0;
    for (const RodDrag& drag : model_.drags)
        of_drags += inertia ? drag.damping / inertia->step : 0.0;
    floor_ = 8.0 * kRounding *
             (newton.stiffness_ + of_mass * newton.heaviest_ + of_drags) *
             std::max(size_, state.x().cwiseAbs().maxCoeff());
    report_.iterations = 0;
}

RodState RodNewton::Run::end_of(const RodState& at) const
{
    RodState end = *midpoint_;
    end.move_to(2.0 * at.x() - midpoint_->x());
    return end;
}

void RodNewton::Run::look(const RodState& at, Place& place) const
{
    place.value = model_.potential(at);
    place.violation = violations(at);
    if (inertia_)
    {
        const Eigen::VectorXd way = at.x() - inertia_->begin;
        place.held = pull_ * model_.mass().times(way);
        model_.add_drag_forces(way / inertia_->step, place.held);
        place.value += 0.5 * way.dot(place.held) - momentum_.dot(way);
    }
}

/// What a step must lower. Couples have no potential: their work on the way to a place is
/// taken by the ends of the way.
double RodNewton::Run::merit(const RodState& at, const Place& place) const
{
    const double sum = place.value + penalty_ * place.violation.cwiseAbs().sum();
    return model_.has_couples()
               ? sum - 0.5 * (couples_ + model_.couples(at)).dot(at.x() - state_.x())
               : sum;
}

/// Gradient, rows and report of the state. False where the solve ends here.
bool RodNewton::Run::measure(const RodNewtonOptions& options)
{
    Eigen::VectorXd& lambda = newton_.lambda_;
    rows_ = rows(state_);
    report_.violation = largest(rows_.violation);
    if (has_contradiction_)
        take_off_contradiction();
    if (lambda.size() != rows_.violation.size())
        lambda = Eigen::VectorXd::Zero(rows_.violation.size());
    model_.gradient(state_, gradient_);
    double at_work = gradient_.cwiseAbs().maxCoeff();
    if (inertia_)
    {
        const Eigen::VectorXd held = here_.held - momentum_;
        at_work = std::max(at_work, held.cwiseAbs().maxCoeff());
        gradient_ += held;
    }
    if (lambda.size() > 0)
        at_work = std::max(at_work, lambda.cwiseAbs().maxCoeff());
    Eigen::VectorXd residual = gradient_;
    add_forces(rows_.rows, lambda, -1.0, residual);
    report_.residual = residual.cwiseAbs().maxCoeff();
    // Down to the floor the residual may still fall: forces across a slender rod are
    // small beside what rounding does to those along it.
    const bool is_done = report_.residual <= options.tolerance * at_work;
    const bool falls = report_.residual < kStill * last_residual_;
    last_residual_ = report_.residual;
    is_balanced_ = is_done || report_.residual <= floor_;
    if (!std::isfinite(report_.residual) || !std::isfinite(report_.violation))
        report_.stop = RodStop::NotFinite;
    else if (report_.iterations > 0 && is_balanced_ && (is_done || !falls) &&
             keeps_constraints())
        report_.stop = converged();
    else if (report_.iterations >= options.max_iterations)
        report_.stop = RodStop::IterationLimit;
    return report_.stop == RodStop::NotRun;
}

void RodNewton::Run::take_off_contradiction()
{
    has_contradiction_ = true;
    contradiction_ = contradiction(rows_);
    rows_.violation -= contradiction_;
    here_.violation = rows_.violation;
}

/// False if it is not finite.
bool RodNewton::Run::factorize()
{
    BandMatrix& matrix = newton_.matrix_;
    const auto is_done = [&](bool& is_finite)
    {
        const SaddleSolver::Report told =
            newton_.saddle_.factorize(matrix, rows_.rows, rows_.groups);
        report_.num_dropped = told.num_dropped;
        is_finite = told.is_finite;
        return !told.is_finite || told.num_negative == 0;
    };
    bool is_finite = true;
    for (const RodHessian how :
         {RodHessian::Exact, RodHessian::Tensed, RodHessian::Definite})
    {
        model_.hessian(state_, how, matrix);
        if (inertia_)
        {
            model_.mass().add_to(matrix, pull_);
            model_.add_drags(1.0 / inertia_->step, matrix);
        }
        if (is_done(is_finite))
            return is_finite;
    }
    // Held by nothing: as little weight as makes it definite.
    double stiffness = 0.0, added = 0.0;
    for (int j = 0; j < matrix.rows(); ++j)
        stiffness = std::max(stiffness, std::abs(matrix.lower(j, j)));
    for (double share = 1e-12; share < 1e6; share *= 100.0)
    {
        const double more = share * stiffness / newton_.heaviest_;
        model_.mass().add_to(matrix, more - added);
        added = more;
        if (is_done(is_finite))
            return is_finite;
    }
    return false;
}

/// Of all tangents, by the step [rad].
double RodNewton::Run::largest_turn() const
{
    const Rod& rod = model_.rod();
    double turn = 0.0;
    for (std::size_t e = 0; e < rod.spans().size(); ++e)
        for (int p = 0; p < rod.num_places(); ++p)
        {
            Eigen::Vector3d change = Eigen::Vector3d::Zero();
            for (int j = 0; j < rod.order(); ++j)
                change += rod.first(e, p)[j] *
                          step_.segment<3>(rod.layout().control[idx(rod.controls(e)[j])]);
            const auto& [u, t, l] = state_.velocity(e, p);
            turn = std::max(turn, (change - t.dot(change) * t).norm() / l);
        }
    return turn;
}

/// Takes back what a part of the step stretches to second order.
void RodNewton::Run::correct(double length, RodState& trial)
{
    const Eigen::VectorXd part = length * step_;
    const double largest = step_.cwiseAbs().maxCoeff();
    Eigen::VectorXd right, values;
    for (int correction = 0; correction < kCorrections; ++correction)
    {
        right.setZero(step_.size());
        for (const std::unique_ptr<RodTerm>& term : model_.terms)
            term->add_correction(state_, trial, part, right);
        values = (violations(trial) - (1.0 - length * reach_) * rows_.violation) / lead_;
        newton_.saddle_.solve(right, values);
        if (!right.allFinite())
            return;
        trial.move(right);
        if (right.cwiseAbs().maxCoeff() <= kCorrected * largest)
            return;
    }
}

/// Whether a part of the step lowers the merit enough. \p trial becomes its end.
bool RodNewton::Run::try_length(double length, RodState& trial)
{
    const auto is_lower = [&]
    {
        look(trial, there_);
        return merit(trial, there_) <=
               before_ + 1e-4 * length * std::min(slope_, 0.0) + noise_;
    };
    trial = state_;
    trial.move(step_, length);
    // Small steps of soft rods need no correction.
    if (length * reach_ * turn_ < kSmallTurn && is_lower())
        return true;
    correct(length, trial);
    return is_lower();
}

/// Goes on by one step. False where none lowers the merit.
bool RodNewton::Run::advance()
{
    turn_ = largest_turn();
    const bool is_capped = turn_ > kTurn;
    reach_ = is_capped ? kTurn / turn_ : 1.0;
    step_ *= reach_;
    if (next_lambda_.size() > 0)
    {
        // It may fall again, slowly: where the first steps are wild it is huge.
        const double enough = 1.5 * next_lambda_.cwiseAbs().maxCoeff();
        penalty_ = std::max(enough, std::sqrt(penalty_ * enough));
    }
    if (model_.has_couples())
        couples_ = model_.couples(state_);
    before_ = merit(state_, here_);
    slope_ = gradient_.dot(step_) - penalty_ * reach_ * rows_.violation.cwiseAbs().sum();
    // What rounding makes of the sums.
    double sums = std::abs(before_) + 1e-6 * newton_.stiffness_ * size_ * size_;
    for (const std::unique_ptr<RodTerm>& term : model_.terms)
        sums += term->cancelled();
    if (next_lambda_.size() > 0)
        sums += penalty_ * std::max(size_, state_.x().cwiseAbs().maxCoeff());
    noise_ = newton_.rounding_ = 64.0 * kRounding * sums;
    RodState trial = state_;
    double length = 1.0;
    for (int halving = 0; !try_length(length, trial); length *= 0.5)
        if (++halving == kHalvings)
            return false;
    const bool is_whole = !is_capped && length >= 0.25;
    for (const std::unique_ptr<RodTerm>& term : model_.terms)
    {
        if (is_whole)
            term->predict(state_, &step_);
        else
            term->predict(trial, nullptr);
    }
    newton_.lambda_ = next_lambda_;
    state_ = std::move(trial);
    std::swap(here_, there_);
    return true;
}

RodNewtonReport RodNewton::Run::operator()(const RodNewtonOptions& options)
{
    for (const std::unique_ptr<RodTerm>& term : model_.terms)
        term->predict(state_, nullptr);
    look(state_, here_);
    for (; measure(options); ++report_.iterations)
    {
        if (!factorize())
        {
            report_.stop = RodStop::NotFinite;
            break;
        }
        if (report_.num_dropped > 0 && !has_contradiction_)
            take_off_contradiction();
        step_ = -gradient_;
        next_lambda_ = rows_.violation / lead_;
        newton_.saddle_.solve(step_, next_lambda_);
        if (!step_.allFinite())
        {
            report_.stop = RodStop::NotFinite;
            break;
        }
        if (!advance())
        {
            report_.stop =
                is_balanced_ && keeps_constraints() ? converged() : RodStop::NoDescent;
            break;
        }
    }
    return report_;
}

RodNewtonReport RodNewton::solve(RodState& state, const RodInertia* inertia,
                                 const RodNewtonOptions& options,
                                 const RodState* midpoint)
{
    return Run(*this, state, inertia, midpoint)(options);
}

} // namespace cellwarp
