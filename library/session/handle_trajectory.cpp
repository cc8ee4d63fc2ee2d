// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/handle_trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "octree/base/half_turn.h"
#include "octree/base/index.h"
#include "octree/base/nearest_rotation.h"

namespace cellwarp::core
{

namespace
{

/// Steps of a path along which its length is measured: finer than any part.
constexpr int kProbes = 64;

Motion about_point(const Eigen::Matrix3d& R, const Eigen::Vector3d& centre)
{
    return {R, (Eigen::Matrix3d::Identity() - R) * centre};
}

/// The part \p t of the screw motion \p motion of the shortest angle: a turn about
/// an axis in space and a shift along it. \p is_reversed: half a turn goes the other way
/// round.
Motion part_of_screw(const Motion& motion, double t, bool is_reversed)
{
    const Eigen::Vector3d rotation = rotation_vector(motion.R);
    double angle = rotation.norm();
    if (angle == 0.0)
        return {Eigen::Matrix3d::Identity(), t * motion.t};
    Eigen::Vector3d axis = rotation / angle;
    if (is_reversed && is_half_turn(motion.R))
    {
        axis = -axis;
        angle = 2.0 * std::numbers::pi - angle;
    }
    const Eigen::Vector3d along = axis.dot(motion.t) * axis;
    const Eigen::Vector3d across = motion.t - along;
    // The axis passes through c with (I - R) c = across, c normal to the axis:
    // c = (across + cot(angle / 2) axis x across) / 2. For tiny angles c is far
    // away; there the plain part of the translation is as good.
    if (angle < 1e-8)
        return {rotation_about(axis, t * angle), t * motion.t};
    const Eigen::Vector3d c = 0.5 * (across + axis.cross(across) / std::tan(0.5 * angle));
    Motion part = about_point(rotation_about(axis, t * angle), c);
    part.t += t * along;
    return part;
}

double radians(const RigidMove& turn)
{
    return turn.degrees * std::numbers::pi / 180.0;
}

Motion motion_of(const MoveStep& step)
{
    if (const Motion* const motion = std::get_if<Motion>(&step))
        return *motion;
    const RigidMove& move = std::get<RigidMove>(step);
    if (!move.pivot)
        return {Eigen::Matrix3d::Identity(), move.translation};
    return about_point(rotation_about(move.axis, radians(move)), *move.pivot);
}

/// Whether both are shifts, turns about the same axis, or matrices.
bool are_alike(const MoveStep& a, const MoveStep& b)
{
    if (a.index() != b.index())
        return false;
    const RigidMove *const x = std::get_if<RigidMove>(&a), *const y =
                                                               std::get_if<RigidMove>(&b);
    return !x || (x->pivot.has_value() == y->pivot.has_value() &&
                  (!x->pivot || x->axis == y->axis));
}

MoveStep at_zero(const MoveStep& step)
{
    if (std::holds_alternative<Motion>(step))
        return Motion();
    RigidMove move = std::get<RigidMove>(step);
    move.translation.setZero();
    move.degrees = 0.0;
    return move;
}

/// By how much more \p to turns [rad]; a matrix has no turns.
double turn_between(const MoveStep& from, const MoveStep& to)
{
    const RigidMove* const move = std::get_if<RigidMove>(&to);
    return move ? radians(*move) - radians(std::get<RigidMove>(from)) : 0.0;
}

/// \pre Both are alike.
Motion between(const MoveStep& from, const MoveStep& to, double t, bool is_reversed)
{
    if (const Motion* const end = std::get_if<Motion>(&to))
    {
        const Motion& begin = std::get<Motion>(from);
        return part_of_screw(*end * inverse(begin), t, is_reversed) * begin;
    }
    const RigidMove &a = std::get<RigidMove>(from), &b = std::get<RigidMove>(to);
    if (!b.pivot)
        return {Eigen::Matrix3d::Identity(),
                a.translation + t * (b.translation - a.translation)};
    const double angle = radians(a) + t * turn_between(from, to);
    const Eigen::Vector3d pivot = *a.pivot + t * (*b.pivot - *a.pivot);
    return about_point(rotation_about(b.axis, angle), pivot);
}

/// Once for each region and side: its other moves are as little.
void warn_of_flat_sides(const Eigen::Vector3d& way, const Units& units,
                        const Where& where, std::vector<std::string>& warnings)
{
    for (int axis = 0; axis < 3 && units.is_relative; ++axis)
    {
        if (way[axis] == 0.0 || units.box.size()[axis] != 0.0)
            continue;
        std::string warning =
            at(where, fmt::format("moves nothing along {}: the model's box has no size "
                                  "there, and relative units are shares of it",
                                  "xyz"[axis]));
        if (std::find(warnings.begin(), warnings.end(), warning) == warnings.end())
            warnings.push_back(std::move(warning));
    }
}

Motion rigid_motion(const Operation& operation, const Units& units, const Where& where,
                    std::vector<std::string>& warnings)
{
    Eigen::Matrix3d R = operation.matrix->topLeftCorner<3, 3>();
    const Eigen::Matrix3d nearest = nearest_rotation(R);
    const double distance = (R - nearest).norm(), determinant = R.determinant();
    if (!(determinant > 0) || !(distance <= 1e-4))
        throw malformed(where, std::string(determinant < 0    ? "is a mirror, "
                                           : determinant == 0 ? "is singular, "
                                                              : "is no rotation, ") +
                                   fmt::format("need a rigid motion (determinant "
                                               "{:.4g}, distance from a rotation {:.4g})",
                                               determinant, distance));
    if (distance > 1e-6)
        warnings.push_back(
            at(where, fmt::format("was re-orthonormalised (off by {:.4g})", distance)));
    if (distance > 1e-15)
        R = nearest;
    const Eigen::Vector3d t = operation.matrix->topRightCorner<3, 1>();
    Motion motion{units.frame.rotation_to_work(R), Eigen::Vector3d::Zero()};
    // Where the point goes that the file's coordinates call 0.
    const Eigen::Vector3d zero = units.point(Eigen::Vector3d::Zero());
    motion.t = (Eigen::Matrix3d::Identity() - motion.R) * zero + units.vector(t);
    return motion;
}

} // namespace

Eigen::Vector3d Units::point(const Eigen::Vector3d& given) const
{
    return frame.to_work(
        is_relative ? Eigen::Vector3d(box.low + given.cwiseProduct(box.size())) : given);
}

Eigen::Vector3d Units::vector(const Eigen::Vector3d& given) const
{
    return frame.vector_to_work(
        is_relative ? Eigen::Vector3d(given.cwiseProduct(box.size())) : given);
}

std::vector<MoveStep> steps_of(const Move& move, const Units& units,
                               const MoveGround& ground, const std::string& file,
                               std::vector<std::string>& warnings)
{
    std::vector<MoveStep> steps;
    for (const Operation& operation : move.operations)
    {
        RigidMove step;
        Motion motion;
        const bool is_matrix = operation.kind == Operation::Kind::Matrix;
        switch (operation.kind)
        {
        case Operation::Kind::Translate:
            warn_of_flat_sides(operation.move.translation, units, {file, 0, move.region},
                               warnings);
            step.translation = units.vector(operation.move.translation);
            break;
        case Operation::Kind::To:
            warn_of_flat_sides(operation.vector, units, {file, 0, move.region}, warnings);
            step.translation = units.point(operation.vector) - ground.place;
            break;
        case Operation::Kind::Turn: // of the points of rods: frame_plan.cpp
        case Operation::Kind::Tangent:
            break;
        case Operation::Kind::Rotate:
        {
            const RigidMove& given = operation.move;
            const double largest = given.axis.cwiseAbs().maxCoeff();
            const Eigen::Vector3d axis = (given.axis / largest).normalized();
            step.axis = units.frame.axes * axis;
            step.degrees = given.degrees;
            step.pivot = given.pivot                 ? units.point(*given.pivot)
                         : operation.is_about_border ? ground.border
                                                     : ground.centre;
            break;
        }
        case Operation::Kind::Matrix:
            warn_of_flat_sides(operation.matrix->topRightCorner<3, 1>(), units,
                               {file, 0, move.region}, warnings);
            motion = rigid_motion(operation, units,
                                  {file, move.line, move.region + ": matrix"}, warnings);
            break;
        }
        if (!step.translation.allFinite() || !step.axis.allFinite() ||
            (step.pivot && !step.pivot->allFinite()) || !motion.t.allFinite())
            throw malformed({file, move.line, move.region},
                            "moves beyond what numbers can hold");
        steps.push_back(is_matrix ? MoveStep(motion) : MoveStep(step));
    }
    return steps;
}

Motion motion_of(const std::vector<MoveStep>& steps)
{
    Motion motion;
    for (const MoveStep& step : steps)
        motion = motion_of(step) * motion;
    return motion;
}

int parts_of_way(double turn, double way)
{
    // A hair of tolerance: 45 degrees are one part whatever the rounding.
    const double parts = std::max(turn / kTurnOfPart, way / kWayOfPart) - 1e-9;
    return static_cast<int>(
        std::clamp(std::ceil(parts), 1.0, static_cast<double>(kMostParts)));
}

HandleTrajectory::HandleTrajectory(std::vector<MoveStep> from, std::vector<MoveStep> to)
    : from_(std::move(from)), to_(std::move(to))
{
    if (from_.empty())
        std::transform(to_.begin(), to_.end(), std::back_inserter(from_), at_zero);
    is_same_ = std::equal(from_.begin(), from_.end(), to_.begin(), to_.end(), are_alike);
}

Motion HandleTrajectory::at(double t) const
{
    if (t >= 1.0)
        return motion_of(to_);
    if (!is_same_)
    {
        const Motion from = motion_of(from_);
        return part_of_screw(motion_of(to_) * inverse(from), t, is_reversed_) * from;
    }
    Motion motion;
    for (std::size_t i = 0; i < to_.size(); ++i)
        motion = between(from_[i], to_[i], t, is_reversed_) * motion;
    return motion;
}

bool HandleTrajectory::is_wound() const
{
    const auto winds = [](const MoveStep& step)
    { return std::abs(turn_between(at_zero(step), step)) > std::numbers::pi; };
    return std::any_of(from_.begin(), from_.end(), winds) ||
           std::any_of(to_.begin(), to_.end(), winds);
}

/// Those that it goes along.
std::vector<Motion> HandleTrajectory::screws() const
{
    if (!is_same_)
        return {motion_of(to_) * inverse(motion_of(from_))};
    std::vector<Motion> screws;
    for (std::size_t i = 0; i < to_.size(); ++i)
        if (const Motion* const to = std::get_if<Motion>(&to_[i]))
            screws.push_back(*to * inverse(std::get<Motion>(from_[i])));
    return screws;
}

std::optional<Eigen::Matrix3d> HandleTrajectory::half_turn() const
{
    for (const Motion& screw : screws())
        if (is_half_turn(screw.R))
            return screw.R;
    return std::nullopt;
}

HandleTrajectory HandleTrajectory::reversed() const
{
    HandleTrajectory other = *this;
    other.is_reversed_ = !is_reversed_;
    return other;
}

int HandleTrajectory::num_parts(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                                double diagonal) const
{
    double turn = 0.0;
    std::array<double, 8> ways{};
    Motion last = at(0.0);
    for (int probe = 1; probe <= kProbes; ++probe)
    {
        const Motion next = at(static_cast<double>(probe) / kProbes);
        turn += rotation_vector(next.R * last.R.transpose()).norm();
        for (int k = 0; k < 8; ++k)
        {
            const Eigen::Vector3d corner(k & 1 ? high.x() : low.x(),
                                         k & 2 ? high.y() : low.y(),
                                         k & 4 ? high.z() : low.z());
            ways[idx(k)] += (next(corner) - last(corner)).norm();
        }
        last = next;
    }
    // Whole turns between two probes would not be seen.
    double wound = 0.0;
    for (std::size_t i = 0; is_same_ && i < to_.size(); ++i)
        wound += std::abs(turn_between(from_[i], to_[i]));
    turn = std::max(turn, wound);
    const double way = *std::max_element(ways.begin(), ways.end());
    return parts_of_way(turn, diagonal > 0 ? way / diagonal : 0.0);
}

} // namespace cellwarp::core
