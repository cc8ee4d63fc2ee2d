// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/motion_stop.h"

namespace cellwarp::core
{

const char* stop_name(MotionStop stop)
{
    switch (stop)
    {
    case MotionStop::NotRun:
        return "not run";
    case MotionStop::Converged:
        return "converged";
    case MotionStop::EnergyGrew:
        return "energy grew";
    case MotionStop::TooFast:
        return "too fast";
    case MotionStop::Contradiction:
        return "contradictory constraints";
    case MotionStop::IterationLimit:
        return "iteration limit";
    case MotionStop::NoDescent:
        return "no descent";
    case MotionStop::NotFinite:
        return "not finite";
    }
    return "";
}

} // namespace cellwarp::core
