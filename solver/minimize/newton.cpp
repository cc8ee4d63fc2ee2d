// SPDX-License-Identifier: GPL-3.0-or-later
// The linear systems are solved as well as pays: to a tenth of the gradient far from the
// solution, better as the gradient falls (eta = min(0.1, sqrt |g|_rel), [Nocedal06]),
// which makes Newton's method converge with order 3/2 at the end.
//   Far from the solution, where parts fold, the exact second derivatives tell little.
// The quadratic model has no minimum, or one far beyond where it holds. Three things help
// (docs/benchmarks.md has what each does):
// - Where the very first model of a solve curves downwards, its first two iterations take
//   Gauss-Newton's.
// - Where a step with exact derivatives was too long, the next ones stay within a trust
//   region as large as what was left of it [Steihaug83]. Shortening a whole step would
//   shorten what was right in it as well: the stiff directions, which conjugate gradients
//   find first. Gauss-Newton's steps have no such limit: soft parts want large ones.
// - After a shortened step along which the energy curves downwards come two of
//   Gauss-Newton's: such steps tell little, and one after another they lead through the
//   folds of a thin rod or sheet in twice as many.
// A solve that must not leave what is stable does without all three: it has to see every
// direction in which the energy curves downwards, and ends there. One of very few
// iterations, as a frame of a drag, begins with the exact derivatives in any case.
#include "solver/minimize/newton.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "octree/base/clock.h"
#include "octree/base/parallel.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

namespace
{

/// Decrease that a step must bring, relative to what its slope promises (Armijo).
constexpr double kSufficient = 1e-4;
constexpr int kMaxHalvings = 40;

/// When a step promises less than this share of the energy, the energy's own
/// rounding hides the decrease and the gradient is the better judge.
constexpr double kEnergyRounding = 1e-11;

/// How well the linear systems are solved at first, and how many steps that may take.
constexpr double kForcing = 0.1;
constexpr int kMaxLinearSteps = 250;

/// After more steps of one solve the preconditioner is made anew, which costs as much as
/// some twenty of them. Made at rest it stays good where parts turn, but not where a thin
/// sheet has become a strongly curved one.
constexpr int kSlowSteps = 40;

/// Steps of conjugate gradients that look for a direction of descent. Preconditioned, all
/// eigenvalues but those of unstable directions lie around 1: what is clearly negative
/// shows within six.
constexpr int kStabilitySteps = 8;

/// First damping when even J^T J does not factorise, relative to the diagonal;
/// tenfold with each of kMaxDampings retries.
constexpr double kFirstDamping = 1e-12;
constexpr int kMaxDampings = 8;

/// So many steps without the curvature of residuals, at a time.
constexpr int kPlainSteps = 2;

/// The trust region is halved, doubled or made four times as large where the energy falls
/// by less, or more, than this share of what the model promised.
constexpr double kPoor = 0.25, kGood = 0.75, kVeryGood = 0.9;

/// A step of this share of the trust region is one that it may have kept short.
constexpr double kAtRadius = 0.8;

void assemble(const Energy& energy, BlockMatrix& matrix)
{
    parallel_for(energy.block_sizes().size(),
                 [&](std::size_t b)
                 {
                     const int block = static_cast<int>(b);
                     energy.diagonal_block(block, matrix.diagonal(block));
                 });
    parallel_for(energy.pairs().size(),
                 [&](std::size_t p)
                 {
                     const auto& [row, column] = energy.pairs()[p];
                     energy.pair_block(static_cast<int>(p),
                                       matrix.block(matrix.find(row, column)));
                 });
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

void SolveReport::add_earlier(const SolveReport& earlier)
{
    iterations += std::max(0, earlier.iterations);
    linear_steps += earlier.linear_steps;
    refreshes += earlier.refreshes;
    downward_models += earlier.downward_models;
    damped_factorisations += earlier.damped_factorisations;
    backward_error = std::max(backward_error, earlier.backward_error);
    ms.linearise += earlier.ms.linearise;
    ms.linear += earlier.ms.linear;
    ms.line_search += earlier.ms.line_search;
    ms.factorise += earlier.ms.factorise;
    ms.stability += earlier.ms.stability;
}

NewtonSolver::NewtonSolver(Energy& energy, Preconditioner& preconditioner)
    : energy_(energy), preconditioner_(preconditioner),
      rounding_(energy.block_sizes().size())
{
    const Eigen::Index size = std::accumulate(
        energy.block_sizes().begin(), energy.block_sizes().end(), Eigen::Index(0));
    for (Eigen::VectorXd* vector : {&gradient_, &trial_gradient_, &right_, &step_})
        vector->resize(size);
    conjugate_gradients_ = ConjugateGradients(size);
}

/// One call of minimize().
class NewtonSolver::Run
{
public:
    Run(NewtonSolver& own, const SolveOptions& options) : own_(own), options_(options) {}
    SolveReport operator()();

private:
    enum class Found
    {
        Step,
        HiddenByRounding,
        Nothing
    };

    bool is_converged() const;
    bool has_small_gradient() const
    {
        return gradient_norm_ <= options_.gradient_tolerance * scale_;
    }
    bool find_step();
    void linearise(bool is_exact);
    void find_step_by_gradients();
    bool find_step_by_factor();
    Found search_line();
    void check_stability();
    bool is_out_of_time() const
    {
        return is_stop_requested() || Clock::now() > deadline_;
    }
    /// Whether a solve may begin with Gauss-Newton's steps.
    bool begins_plainly() const
    {
        return !options_.stays_stable && options_.max_iterations > kPlainSteps &&
               !is_out_of_time();
    }
    /// Whether the trust region kept the last step short.
    bool is_at_radius() const { return linear_.size > kAtRadius * radius_; }
    bool is_accepted(double value, double length, double slope, bool is_hidden);
    void fit_radius(double length, double change);
    void note_move(double length);

    NewtonSolver& own_;
    const SolveOptions& options_;
    SolveReport report_;
    double value_ = 0.0, gradient_norm_ = 0.0, scale_ = 0.0;
    LinearReport linear_;           ///< of the last step
    bool is_exact_ = false;         ///< whether that knew the exact derivatives
    double radius_ = INFINITY;      ///< of the trust region of such steps
    bool curves_downwards_ = false; ///< the energy, along the last step
    int plain_steps_ = 0;           ///< Gauss-Newton's, before Newton's go on
    double last_move_ = INFINITY;   ///< of a whole step just before; see note_move()
    Clock::time_point deadline_ = Clock::time_point::max();
};

/// No block's part of the gradient is more than its rounding: stiff cells must not hide
/// what soft ones still ask for.
bool NewtonSolver::Run::is_converged() const
{
    if (has_small_gradient() && report_.distance_left <= options_.place_tolerance)
        return true;
    Eigen::Index first = 0;
    for (std::size_t b = 0; b < own_.rounding_.size(); ++b)
    {
        const int size = own_.energy_.block_sizes()[b];
        if (!(own_.gradient_.segment(first, size).norm() <= own_.rounding_[b]))
            return false;
        first += size;
    }
    return true;
}

void NewtonSolver::Run::linearise(bool is_exact)
{
    const Clock::time_point start = Clock::now();
    is_exact_ = is_exact;
    own_.energy_.linearise(is_exact ? kExact : kGaussNewton);
    report_.ms.linearise += ms_since(start);
}

void NewtonSolver::Run::find_step_by_gradients()
{
    const Clock::time_point start = Clock::now();
    const double relative = scale_ > 0 ? gradient_norm_ / scale_ : 1.0;
    own_.right_ = -own_.gradient_;
    linear_ = own_.conjugate_gradients_.solve(
        own_.energy_, own_.preconditioner_, own_.right_,
        {std::min(kForcing, std::sqrt(relative)), kMaxLinearSteps, deadline_,
         is_exact_ ? radius_ : INFINITY},
        own_.step_);
    report_.linear_steps += linear_.steps;
    report_.ms.linear += ms_since(start);
    own_.is_slow_ = linear_.steps > kSlowSteps;
    curves_downwards_ = linear_.has_negative_curvature;
    if (is_exact_ && curves_downwards_)
        ++report_.downward_models;
}

bool NewtonSolver::Run::find_step_by_factor()
{
    Clock::time_point start = Clock::now();
    own_.analyse();
    BlockMatrix& A = *own_.matrix_;
    A.set_zero();
    assemble(own_.energy_, A);
    double damping = kFirstDamping;
    int retries = 0;
    for (; !own_.factor_->factorize(A); ++retries, damping *= 10.0)
    {
        if (retries == kMaxDampings)
            return false;
        ++report_.damped_factorisations;
        for (int b = 0; b < A.num_blocks(); ++b)
        {
            BlockMatrix::Block block = A.diagonal(b);
            block.diagonal() += damping * block.diagonal().cwiseAbs();
        }
    }
    report_.ms.factorise += ms_since(start);
    own_.right_ = -own_.gradient_;
    own_.factor_->solve(own_.right_, own_.step_);
    const double error = (A.multiply(own_.step_) - own_.right_).norm() /
                         (A.norm() * own_.step_.norm() + own_.right_.norm());
    report_.backward_error = std::max(report_.backward_error, error);
    return true;
}

bool NewtonSolver::Run::find_step()
{
    if (options_.method == Method::GaussNewtonDirect)
    {
        linearise(false);
        const Clock::time_point start = Clock::now();
        const bool is_found = find_step_by_factor();
        report_.ms.linear += ms_since(start);
        return is_found && own_.step_.allFinite();
    }
    if (own_.is_slow_ && options_.may_refresh)
    {
        linearise(false);
        const Clock::time_point start = Clock::now();
        own_.preconditioner_.refresh();
        radius_ = INFINITY; // it was measured by the old one
        report_.ms.linearise += ms_since(start);
        ++report_.refreshes;
        own_.is_slow_ = false;
    }
    const bool is_exact = options_.method == Method::Newton && plain_steps_ == 0;
    plain_steps_ = std::max(0, plain_steps_ - 1);
    linearise(is_exact);
    find_step_by_gradients();
    if (is_exact && curves_downwards_ && report_.iterations == 0 && begins_plainly())
    {
        plain_steps_ = kPlainSteps - 1;
        linearise(false);
        find_step_by_gradients();
    }
    return own_.step_.allFinite();
}

bool NewtonSolver::Run::is_accepted(double value, double length, double slope,
                                    bool is_hidden)
{
    if (value <= value_ + kSufficient * length * slope)
        return true;
    if (!is_hidden)
        return false;
    // Rounding hides the decrease: the gradient must fall instead.
    own_.energy_.gradient(own_.trial_gradient_);
    return own_.trial_gradient_.norm() < 0.5 * gradient_norm_ &&
           value <= value_ * (1.0 + 1e-13);
}

/// After a step of which \p length was gone, with that \p change of the energy.
void NewtonSolver::Run::fit_radius(double length, double change)
{
    const double share = change / linear_.change;
    if (length < 1.0)
        radius_ = length * linear_.size;
    else if (share < kPoor)
        radius_ = 0.5 * linear_.size;
    else if (share > kGood && is_at_radius())
        radius_ *= share > kVeryGood ? 4.0 : 2.0;
}

/// A step that was cut short, or was found without the curvature that counts, is no
/// measure of the distance that is left. A whole one is an upper bound. Where it follows
/// another one and is r times as long, the next ones are at most as long as r, r^2, ...
/// of it, because Newton's method converges faster than linearly.
void NewtonSolver::Run::note_move(double length)
{
    const bool is_whole =
        length == 1.0 && !curves_downwards_ &&
        (is_exact_ ? !is_at_radius() : options_.method != Method::Newton);
    const double move = is_whole ? own_.energy_.largest_move() : INFINITY;
    const double ratio = move / last_move_;
    report_.distance_left =
        options_.method == Method::Newton && std::isfinite(last_move_) && ratio < 0.5
            ? move * ratio / (1.0 - ratio)
            : move;
    last_move_ = move;
}

/// Halves the step until it lowers the energy; the state is moved if it does.
NewtonSolver::Run::Found NewtonSolver::Run::search_line()
{
    const double slope = own_.gradient_.dot(own_.step_);
    if (!(slope < 0.0))
        return Found::Nothing;
    const bool is_hidden = -slope <= kEnergyRounding * value_;
    double length = 1.0;
    for (int halving = 0; halving <= kMaxHalvings; ++halving, length *= 0.5)
    {
        own_.energy_.move(own_.step_, length);
        const double value = own_.energy_.value();
        if (is_accepted(value, length, slope, is_hidden))
        {
            note_move(length);
            if (is_exact_ && !is_hidden && !options_.stays_stable)
                fit_radius(length, value - value_);
            if (curves_downwards_ && length < 1.0)
                plain_steps_ = kPlainSteps;
            own_.energy_.settle();
            own_.energy_.gradient(own_.gradient_);
            gradient_norm_ = own_.gradient_.norm();
            value_ = value;
            return Found::Step;
        }
        if (is_hidden)
            break;
    }
    own_.energy_.move(own_.step_, 0.0);
    return is_hidden ? Found::HiddenByRounding : Found::Nothing;
}

/// From a right-hand side without any symmetry, always the same.
void NewtonSolver::Run::check_stability()
{
    const Clock::time_point start = Clock::now();
    own_.energy_.linearise(kExact);
    own_.right_.resize(own_.gradient_.size());
    std::minstd_rand random(1);
    for (double& number : own_.right_)
        number =
            static_cast<double>(random()) / static_cast<double>(std::minstd_rand::max()) -
            0.5;
    const LinearReport linear =
        own_.conjugate_gradients_.solve(own_.energy_, own_.preconditioner_, own_.right_,
                                        {1e-6, kStabilitySteps, deadline_}, own_.step_);
    report_.is_saddle = linear.has_negative_curvature;
    report_.ms.stability += ms_since(start);
}

SolveReport NewtonSolver::Run::operator()()
{
    if (options_.time_budget > 0)
        deadline_ = time_after(Clock::now(), options_.time_budget);
    report_.iterations = 0;
    value_ = own_.energy_.value();
    report_.energy_before = value_;
    own_.energy_.gradient(own_.gradient_);
    gradient_norm_ = own_.gradient_.norm();
    own_.energy_.rounding(own_.rounding_);
    scale_ = options_.gradient_scale > 0 ? options_.gradient_scale : gradient_norm_;
    const auto finish = [&](Stop stop)
    {
        report_.stop = stop;
        if (options_.checks_stability && stop == Stop::Converged &&
            own_.gradient_.size() > 0)
            check_stability();
        report_.energy_after = value_;
        report_.gradient = scale_ > 0 ? gradient_norm_ / scale_ : 0.0;
        return report_;
    };
    // Against a scale that overflowed everything would be small.
    if (!std::isfinite(value_ + gradient_norm_ + scale_))
        return finish(Stop::NotPositiveDefinite);
    for (;;)
    {
        if (is_converged())
            return finish(Stop::Converged);
        if (report_.iterations >= options_.max_iterations)
            return finish(Stop::IterationLimit);
        if (is_stop_requested())
            return finish(Stop::Stopped);
        if (Clock::now() > deadline_)
            return finish(Stop::TimeLimit);
        if (options_.watch)
            options_.watch(report_.iterations, scale_ > 0 ? gradient_norm_ / scale_ : 0.0,
                           value_);
        if (!find_step())
            return finish(Stop::NotPositiveDefinite);
        if (options_.stays_stable && curves_downwards_)
            return finish(Stop::NoDescent);
        const Clock::time_point search_start = Clock::now();
        const Found found = search_line();
        report_.ms.line_search += ms_since(search_start);
        if (found == Found::HiddenByRounding && is_exact_ && is_at_radius())
        {
            radius_ = INFINITY; // so short a step tells nothing
            continue;
        }
        if (found == Found::HiddenByRounding)
            return finish(Stop::Converged);
        if (found == Found::Nothing)
            return finish(has_small_gradient() ? Stop::Converged : Stop::NoDescent);
        ++report_.iterations;
    }
}

void NewtonSolver::analyse()
{
    if (factor_)
        return;
    const std::span<const std::pair<int, int>> pairs = energy_.pairs();
    matrix_.emplace(energy_.block_sizes(), std::vector(pairs.begin(), pairs.end()));
    factor_.emplace(*matrix_);
}

double NewtonSolver::factor_bytes()
{
    analyse();
    return 8.0 * factor_->factor_numbers();
}

SolveReport NewtonSolver::minimize(const SolveOptions& options)
{
    const StopDeferral deferral; // it ends between steps, in a state of its own
    return Run(*this, options)();
}

} // namespace cellwarp::core
