// SPDX-License-Identifier: GPL-3.0-or-later
// Places of a rod that are unknown in advance: a rope in a hole, a ring on a rail. The
// parameter s is an unknown like the control points; constraints and joints hold the
// curve there. slide.cpp has the derivation. [Lenoir04]
#pragma once

#include <Eigen/Core>

#include "solver/dynamics/articulable_object.h"
#include "solver/rods/rod.h"

namespace cellwarp::core
{

struct RodSlide
{
    double begin = 0.0, end = 0.0; ///< parameters that it may slide between
    bool is_endless = false;       ///< once around a closed rod and on
    bool has_cut_behind = false, has_cut_ahead = false; ///< the rod ends there
    bool leaves = false;              ///< released where it arrives there; else it stops
    double sticks = 0.0, slips = 0.0; ///< friction at rest and in motion, sticks >= slips
    /// Inertia of the sliding itself, c of c s'' = lambda . P': above 0 it slows, below
    /// it hastens. [kg m^2 by parameter^2]
    double inertia = 0.0;
};

/// The force that acts on the rod where it slides.
struct SlidePress
{
    Eigen::Vector3d force = Eigen::Vector3d::Zero(); ///< [N]
    /// Projects onto the directions in which the place is held: a hole holds all, an axis
    /// those across it, a plane its normal.
    Eigen::Matrix3d held = Eigen::Matrix3d::Identity();
};

/// The slide where the state has it, before its first step.
Sliding begun(const RodSlide& slide, double s);

/// Values at a parameter; behind the ends of an open curve its end spans go on.
BasisValues sliding_values(const SplineBasis& basis, double s);

/// The parameter at which the curve is nearest to \p point in the directions of \p held
/// (see SlidePress), of \p tries places of the range of \p slide and then by Newton's
/// method.
double nearest_parameter(const RodSlide& slide, const RodState& state,
                         const Eigen::Vector3d& point,
                         const Eigen::Matrix3d& held = Eigen::Matrix3d::Identity(),
                         int tries = 1000);

/// d/ds of friction and inertia [N by ds].
double sliding_pull(const Sliding& now);
/// Their energy, as if of the state alone [J].
double sliding_energy(const Sliding& now);

/// Second derivatives of -force . P(s) and of sliding_energy() by s, and by s and the
/// control points; \p force [N] acts on the rod at s.
SingleUnknown sliding_unknown(const RodState& state, const Sliding& now,
                              const Eigen::Vector3d& force);

/// tau of a slide that slips under \p press; 0 of one that does not [N by ds].
double friction(const RodSlide& slide, const RodState& state, const Sliding& now,
                const SlidePress& press);

/// Stops what has slid past an end of its range there, or releases it; false: it has not.
bool stop_at_end(const RodSlide& slide, Sliding& now);

/// Whether a step that began as \p begin and ended as \p end, under \p press, must be
/// taken again: then mode and friction of both are changed. `is_last` lets no
/// mode change but where the end of the range is passed.
ArticulableObject::Again check_slide(const RodSlide& slide, const RodState& state,
                                     const SlidePress& press, bool is_last,
                                     Sliding& begin, Sliding& end);

} // namespace cellwarp::core
