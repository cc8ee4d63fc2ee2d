// SPDX-License-Identifier: GPL-3.0-or-later
// From the operations of a handle file to rigid motions, and the way from one
// frame's motion to the next in small steps.
#pragma once

#include <numbers>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <Eigen/Core>

#include "io/scene/handle_file.h"
#include "library/session/work_frame.h"
#include "octree/base/rigid_motion.h"
#include "octree/base/rigid_move.h"

namespace cellwarp::core
{

/// What turns a file's numbers into work coordinates.
struct Units
{
    WorkFrame frame;
    bool is_relative = false;
    ModelBox box; ///< of the rest samples [model unit]
    /// Of a coarsest cell [work]; where there are none yet, a share of the diagonal.
    double cell_edge = 0.0;

    Eigen::Vector3d point(const Eigen::Vector3d& given) const;  ///< [work]
    Eigen::Vector3d vector(const Eigen::Vector3d& given) const; ///< [work]
};

/// One operation in work space, which can be done in part: a shift, or a turn about a
/// unit axis, which has a pivot; or the motion of a matrix.
using MoveStep = std::variant<RigidMove, Motion>;

/// What the moves of a region refer to, at rest [work].
struct MoveGround
{
    Eigen::Vector3d centre; ///< of its samples' box: the default centre of rotations
    Eigen::Vector3d border; ///< where 'about border' turns
    Eigen::Vector3d place;  ///< of a pin
};

/// Operations in the order written, in work coordinates. A matrix that is no rigid motion
/// to 1e-4 is Fault::Malformed; one that is off by more than 1e-6 is mended and gives a
/// warning.
std::vector<MoveStep> steps_of(const Move& move, const Units& units,
                               const MoveGround& ground, const std::string& file,
                               std::vector<std::string>& warnings);

/// What a frame is gone in: parts of at most this turn [rad], and this way of what is to
/// be beside [diagonal, or another length]; so many at the most.
inline constexpr double kTurnOfPart = std::numbers::pi / 4.0, kWayOfPart = 0.25;
inline constexpr int kMostParts = 64;

/// How many equal parts a turn [rad] and a way [of that length] are gone in.
int parts_of_way(double turn, double way);

/// All steps, one after the other.
Motion motion_of(const std::vector<MoveStep>& steps);

/// The way of one region from its last steps to its new ones: step by step where
/// both lists have the same operations (no list counts as the same at zero), else
/// along one screw motion of the shortest angle. A screw of half a turn could go either
/// way round: it goes as rotation_vector() says, or the other way, see reversed().
class HandleTrajectory
{
public:
    HandleTrajectory() = default;
    HandleTrajectory(std::vector<MoveStep> from, std::vector<MoveStep> to);

    /// \p t in [0, 1]; exactly the new motion at 1.
    Motion at(double t) const;
    /// How many equal parts keep each to 45 degrees and a quarter of \p diagonal,
    /// for points in the box \p low, \p high; at most 64.
    int num_parts(const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                  double diagonal) const;
    /// Whether it begins or ends more than half a turn from rest: its end alone does not
    /// tell how the material is wound then.
    bool is_wound() const;
    /// The first screw of half a turn that it goes along, as a rotation; none: the
    /// statements say which way round it goes.
    std::optional<Eigen::Matrix3d> half_turn() const;
    /// The same way, but along screws of half a turn the other way round.
    HandleTrajectory reversed() const;

private:
    std::vector<Motion> screws() const;

    std::vector<MoveStep> from_, to_;
    bool is_same_ = true, is_reversed_ = false;
};

} // namespace cellwarp::core
