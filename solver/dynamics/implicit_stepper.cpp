// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/implicit_stepper.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace cellwarp::core
{

namespace
{

constexpr int kMostParts = 1 << 8;
/// Iterations of Newton's method in a step, a try that fails counted as ten of them, and
/// as sixty where no length of a step was good; then the rest of it is taken at once, as
/// it comes out.
constexpr int kMostIterations = 1000, kFailedTry = 10, kNoDescent = 60;
constexpr int kGoodParts = 8; ///< after so many, parts are twice as long again
/// After so many steps whose parts all fail the next ones are not cut any more, until one
/// goes well.
constexpr int kFailedSteps = 2;
constexpr int kIterations = 40;

} // namespace

ImplicitStepper::ImplicitStepper(std::vector<ArticulableObject*> objects,
                                 std::vector<Joint> joints, double noise,
                                 Coupling* coupling)
    : objects_(objects), coupling_(coupling),
      all_(std::move(objects), std::move(joints), coupling), noise_(noise)
{
}

StepReport ImplicitStepper::step(double step)
{
    StepReport report;
    report.stop = MotionStop::Converged;
    // Counted in the smallest parts, so that they add up to the whole step.
    int done = 0, work = 0;
    report.is_at_once = num_failed_ >= kFailedSteps;
    while (done < kMostParts)
    {
        int length = kMostParts / parts_;
        while (done % length != 0)
            length /= 2;
        const bool is_given_up = report.is_at_once || work >= kMostIterations;
        if (is_given_up)
            length = kMostParts - done;
        const double part = step * length / kMostParts;
        MotionStop stop = MotionStop::NotRun;
        const int before = report.iterations;
        const bool is_good = try_step(part, length == 1 || is_given_up, stop, report);
        work += report.iterations - before +
                (is_good                         ? 1
                 : stop == MotionStop::NoDescent ? kNoDescent
                                                 : kFailedTry);
        if (is_good || length == 1 || is_given_up)
        {
            // What has not gone anywhere has not lost its velocity.
            if (!is_solved(stop) && report.iterations - before <= 1)
                undo();
            if (is_given_up)
                num_failed_ =
                    std::clamp(num_failed_ + (is_good ? -1 : 1), 0, kFailedSteps);
            done += length;
            ++report.parts;
            if (stop != MotionStop::Converged)
                report.stop = stop;
            else if (!is_good)
                report.stop = MotionStop::EnergyGrew;
            num_good_ = is_good ? num_good_ + 1 : 0;
            if (num_good_ >= kGoodParts && parts_ > 1)
            {
                parts_ /= 2;
                num_good_ = 0;
            }
            continue;
        }
        undo();
        parts_ = std::min(2 * (kMostParts / length), kMostParts);
        num_good_ = 0;
    }
    if (work < kMostIterations && !report.is_at_once)
        num_failed_ = 0;
    return report;
}

void ImplicitStepper::undo()
{
    for (ArticulableObject* const object : objects_)
        object->undo();
    if (coupling_)
        coupling_->undo();
}

ArticulableObject::Energy ImplicitStepper::energy() const
{
    ArticulableObject::Energy all;
    for (const ArticulableObject* const object : objects_)
    {
        const ArticulableObject::Energy one = object->energy();
        all.sum += one.sum;
        all.size += one.size;
    }
    if (coupling_)
        all.sum += coupling_->energy();
    return all;
}

/// Work comes in from outside, too, where constraints bring what they hold to another
/// place.
bool ImplicitStepper::is_driven() const
{
    return all_.is_pulled() ||
           std::any_of(objects_.begin(), objects_.end(),
                       [](const ArticulableObject* one) { return one->is_driven(); });
}

/// One part of a step. False where it did not converge, added energy, or was so long that
/// something may have been missed; \p is_last: there is no shorter one.
bool ImplicitStepper::try_step(double step, bool is_last, MotionStop& stop,
                               StepReport& report)
{
    const bool is_free = !is_driven();
    for (ArticulableObject* const object : objects_)
        object->start(step);
    const bool is_slow = !coupling_ || coupling_->start(step);
    if (!is_slow && !is_last)
        return false;
    const double before = energy().sum;
    MotionOptions options;
    options.max_iterations = kIterations;
    const MotionReport told = all_.solve(options);
    for (ArticulableObject* const object : objects_)
        object->finish();
    if (coupling_)
        coupling_->finish();
    report.iterations += told.iterations;
    report.num_dropped = std::max(report.num_dropped, told.num_dropped);
    report.violation = told.violation;
    stop = told.stop;
    if (!is_solved(stop))
        return false;
    if (!is_slow || (coupling_ && coupling_->is_beyond()))
    {
        stop = MotionStop::TooFast;
        return false;
    }
    if (!is_free)
        return true;
    const ArticulableObject::Energy now = energy();
    return now.sum <= before + noise_ * (now.size + std::abs(before)) + all_.rounding();
}

StepReport ImplicitStepper::settle()
{
    constexpr double kFirst = 0.01, kLongest = 100.0; // [s]
    constexpr int kMost = 1000;
    // Three steps of that length, each twice as long as the one before.
    constexpr double kStill = 1e-10, kLong = 5.0; // of the size, [s]
    constexpr int kStills = 3;
    StepReport report;
    report.stop = MotionStop::IterationLimit;
    double step = kFirst;
    int num_still = 0;
    ArticulableObject::Energy last;
    for (int k = 0; k < kMost; ++k)
    {
        for (ArticulableObject* const object : objects_)
        {
            object->rest();
            object->start(step);
        }
        MotionStop stop = MotionStop::TooFast;
        if (!coupling_ || coupling_->start(step))
        {
            const MotionReport told = all_.solve({});
            report.iterations += told.iterations;
            report.num_dropped = std::max(report.num_dropped, told.num_dropped);
            report.violation = told.violation;
            if (!is_solved(told.stop) || !coupling_ || !coupling_->is_beyond())
                stop = told.stop;
        }
        if (!is_solved(stop))
        {
            undo();
            step *= 0.25;
            if (step < 1e-6)
            {
                report.stop = stop;
                return report;
            }
            continue;
        }
        // What may move without end, such as what turns about itself, does so by the
        // rounding of forces; then the energy tells.
        constexpr double kSame = 1e-13;
        const ArticulableObject::Energy now = energy();
        const bool is_same =
            k > 0 && std::abs(now.sum - last.sum) <=
                         kSame * (now.size + std::abs(now.sum)) + all_.rounding();
        last = now;
        double way = 0.0, size = 0.0;
        for (ArticulableObject* const object : objects_)
        {
            object->finish();
            way = std::max(way, object->way());
            size = std::max(size, object->size());
            object->rest();
        }
        if (coupling_)
            coupling_->finish();
        ++report.parts;
        num_still = way <= kStill * size ? num_still + 1 : 0;
        if ((num_still >= kStills && step >= kLong) || (is_same && step >= kLongest))
        {
            report.stop = stop;
            return report;
        }
        step = std::min(2.0 * step, kLongest);
    }
    return report;
}

} // namespace cellwarp::core
