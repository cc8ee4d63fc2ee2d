// SPDX-License-Identifier: GPL-3.0-or-later
// Joined objects in time, by implicit steps. The step is fixed; where a step would add
// energy it is taken in smaller parts, by rules that know nothing of the clock: the same
// steps whatever is watched.
#pragma once

#include <vector>

#include "solver/dynamics/articulation.h"

namespace cellwarp::core
{

struct StepReport
{
    MotionStop stop = MotionStop::NotRun; ///< of the parts that could not be cut further
    int iterations = 0, parts = 0;
    double violation = 0.0;
    int num_dropped = 0;
    /// The steps before it failed in all their parts: it was taken at once, as it came
    /// out.
    bool is_at_once = false;
};

class ImplicitStepper
{
public:
    /// The objects must outlive it. \p noise: share of its energy that a step may add.
    explicit ImplicitStepper(std::vector<ArticulableObject*> objects,
                             std::vector<Joint> joints = {}, double noise = 1e-9,
                             Coupling* coupling = nullptr);

    /// Goes on by \p step [s].
    StepReport step(double step);

    /// To where nothing moves any more: by longer and longer steps, each from rest.
    StepReport settle();

    /// The last solve, with its multipliers.
    const Articulation& solved() const { return all_; }

private:
    bool try_step(double step, bool is_last, MotionStop& stop, StepReport& report);
    void undo();
    ArticulableObject::Energy energy() const;
    bool is_driven() const;

    std::vector<ArticulableObject*> objects_;
    Coupling* coupling_;
    Articulation all_;
    double noise_;
    int parts_ = 1;      ///< of a step, as a power of 2
    int num_good_ = 0;   ///< parts that went well since the last change
    int num_failed_ = 0; ///< successive steps that found no parts that go well
};

} // namespace cellwarp::core
