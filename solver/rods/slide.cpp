// SPDX-License-Identifier: GPL-3.0-or-later
// g = P(s) - point, held in some directions n. A row n . g has the derivatives n b_k by
// control point k and n . P' by s; of -lambda . g, with the force Lambda = sum lambda n
// on the rod,
//   by control point k and s: -b'_k Lambda,   by s twice: -Lambda . P''.
// Without friction the row of s says Lambda . P' = 0. [Lenoir04]
//
// Friction F along the curve, whose size is held while a step is solved for, has the
// potential tau s with tau = F |P'|; inertia c of the sliding has
//   1/2 c / step^2 (s - s_0 - step s_0')^2.
// Then F = side * mu |Lambda across the curve| is brought up to date, and the step goes
// on from where it has come to.
//
// Coulomb. It sticks (s is fixed) while the force along the curve is at most `sticks`
// times that across it; else it slips to the side of that force. Where it would slip back
// it sticks. The directions in which nothing holds take no force: along and across are
// those of the curve as it is seen in the directions that are held.
#include "solver/rods/slide.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Mode = Sliding::Mode;
using Again = ArticulableObject::Again;

/// Tries of a step until friction agrees with what presses, to that share.
constexpr double kSettled = 1e-8;

/// A force as the slide feels it.
struct Pressed
{
    double along = 0.0, across = 0.0; ///< [N]
    double speed = 0.0;               ///< [m] by parameter

    Pressed(const RodState& state, const Sliding& now, const SlidePress& press)
    {
        const Vector3d eta =
            press.held * state.at(sliding_values(state.rod().basis(), now.s)).first;
        speed = eta.norm();
        const Vector3d e = speed > 0.0 ? Vector3d(eta / speed) : Vector3d::Zero();
        along = press.force.dot(e);
        across = (press.force - along * e).norm();
    }
};

} // namespace

Sliding begun(const RodSlide& slide, double s)
{
    Sliding now;
    now.s = s;
    now.mode = slide.sticks > 0.0 ? Mode::Sticks : Mode::Slips;
    return now;
}

BasisValues sliding_values(const SplineBasis& basis, double s)
{
    if (basis.is_closed() || (basis.begin() <= s && s <= basis.end()))
        return basis.values(s);
    return basis.values_in(
        s < basis.begin() ? 0 : static_cast<int>(basis.spans().size()) - 1, s);
}

double nearest_parameter(const RodSlide& slide, const RodState& state,
                         const Vector3d& point, const Eigen::Matrix3d& held, int tries)
{
    const SplineBasis& basis = state.rod().basis();
    double best = slide.begin, least = std::numeric_limits<double>::infinity();
    for (int k = 0; k <= tries; ++k)
    {
        const double s = slide.begin + (slide.end - slide.begin) * k / tries;
        const double away =
            (held * (state.at(sliding_values(basis, s)).place - point)).squaredNorm();
        if (away < least)
        {
            least = away;
            best = s;
        }
    }
    constexpr int kMost = 30;
    const double reach = (slide.end - slide.begin) / tries;
    for (int k = 0; k < kMost; ++k)
    {
        const CurvePoint at = state.at(sliding_values(basis, best));
        const Vector3d g = held * (at.place - point), eta = held * at.first;
        const double slope = eta.squaredNorm();
        if (!(slope > 0.0))
            break;
        const double step =
            -g.dot(eta) / (slope + std::max(g.dot(at.second), -0.5 * slope));
        const double next =
            std::clamp(best + std::clamp(step, -reach, reach), slide.begin, slide.end);
        if (next == best)
            break;
        best = next;
    }
    return best;
}

double sliding_pull(const Sliding& now)
{
    return now.is_free() ? now.drive + now.weight * (now.s - now.from) : 0.0;
}

double sliding_energy(const Sliding& now)
{
    if (!now.is_free())
        return 0.0;
    const double ahead = now.s - now.from;
    return now.drive * now.s + 0.5 * now.weight * ahead * ahead;
}

SingleUnknown sliding_unknown(const RodState& state, const Sliding& now,
                              const Vector3d& force)
{
    const BasisValues values = sliding_values(state.rod().basis(), now.s);
    SingleUnknown out;
    for (int j = 0; j < values.count; ++j)
    {
        const int first = state.rod().layout().control[idx(values.control[idx(j)])];
        out.from = j == 0 ? first : std::min(out.from, first);
        out.behind = std::max(out.behind, first + 2);
        for (int c = 0; c < 3 && now.is_free(); ++c)
            out.column.emplace_back(first + c, -values.value[1][idx(j)] * force[c]);
    }
    std::sort(out.column.begin(), out.column.end());
    if (now.is_free())
        out.diagonal = now.weight - force.dot(state.at(values).second);
    return out;
}

double friction(const RodSlide& slide, const RodState& state, const Sliding& now,
                const SlidePress& press)
{
    if (!now.is_free() || slide.slips == 0.0)
        return 0.0;
    const Pressed pressed(state, now, press);
    const double rubbing = slide.slips * pressed.across * pressed.speed;
    return std::copysign(rubbing, now.drive);
}

bool stop_at_end(const RodSlide& slide, Sliding& now)
{
    if (!now.is_free() || slide.is_endless ||
        (slide.begin <= now.s && now.s <= slide.end))
        return false;
    now.mode = slide.leaves          ? Mode::Gone
               : now.s < slide.begin ? Mode::AtBegin
                                     : Mode::AtEnd;
    now.s = std::clamp(now.s, slide.begin, slide.end);
    return true;
}

ArticulableObject::Again check_slide(const RodSlide& slide, const RodState& state,
                                     const SlidePress& press, bool is_last,
                                     Sliding& begin, Sliding& end)
{
    if (end.mode == Mode::Gone)
        return Again::No;
    const Pressed pressed(state, end, press);
    const double rubbing = slide.slips * pressed.across * pressed.speed;
    if (end.mode == Mode::Slips)
    {
        if (Sliding stopped = end; stop_at_end(slide, stopped))
        {
            begin.mode = stopped.mode;
            begin.s = stopped.s;
            return Again::FromBegin;
        }
        if (slide.slips == 0.0)
            return Again::No;
        // Without friction the drive is a zero, which has a sign, too.
        const double side = std::copysign(1.0, end.drive);
        if (side * (end.s - begin.s) < 0.0 && !is_last)
        {
            begin.mode = Mode::Sticks;
            begin.speed = 0.0;
            return Again::FromBegin;
        }
        const double before = end.drive;
        begin.drive = end.drive = side * rubbing;
        return std::abs(end.drive - before) >
                       kSettled * std::max(std::abs(before), std::abs(end.drive))
                   ? Again::FromHere
                   : Again::No;
    }
    if (is_last)
        return Again::No;
    // It holds on: does it still?
    const double most = slide.sticks * pressed.across;
    const bool may_go = end.mode == Mode::AtBegin ? pressed.along > most
                        : end.mode == Mode::AtEnd ? pressed.along < -most
                                                  : std::abs(pressed.along) > most;
    if (!may_go)
        return Again::No;
    begin.mode = Mode::Slips;
    begin.drive = std::copysign(rubbing, pressed.along);
    return Again::FromBegin;
}

} // namespace cellwarp::core
