// SPDX-License-Identifier: GPL-3.0-or-later
// Which cells may move, and how: free, prescribed, pinned at a point, grouped to one body
// that is, or idle or following in a component that nothing holds.
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"

namespace cellwarp::core
{

enum class Hold
{
    Free,
    Prescribed, ///< its pose is given
    Pinned,     ///< one of its points is given, it turns about it
    Sliding,    ///< one of its points stays on a curve, it turns about it
    Grouped,    ///< with others it is one rigid body, which turns about a given point
    Idle,       ///< nothing holds its component: it stays at rest
    Following   ///< nothing holds its component: it goes with another one
};

/// A place of a curve, and its derivatives by the parameter.
struct RailPlace
{
    Eigen::Vector3d place, first, second;
};

/// A curve that places of cells stay on.
class Rail
{
public:
    virtual ~Rail() = default;
    virtual RailPlace at(double s) const = 0;
    /// Parameters that it ends at; of a closed one all are places.
    virtual double begin() const = 0;
    virtual double end() const = 0;
    virtual bool is_closed() const = 0;
};

/// A side of a box among the six.
constexpr std::size_t side_of(int axis, bool is_high)
{
    return 2 * static_cast<std::size_t>(axis) + is_high;
}

struct Constraint
{
    Hold hold = Hold::Free;
    /// Of a pinned or sliding cell, or of the body of a grouped one.
    Eigen::Vector3d held_rest = Eigen::Vector3d::Zero();
    Eigen::Vector3d held_now = Eigen::Vector3d::Zero();
    const Rail* rail = nullptr; ///< of a sliding cell: held_now is its place at s
    double s = 0.0;
    int leader = -1; ///< of a grouped cell: the one of its group that stands for all
    /// Of a flat cell: across its plane. It turns about this axis alone, and stays in the
    /// plane.
    int flat_axis = -1;
    /// Of a cell of a rigid region: how far within each side of its box, by side_of(),
    /// the region ends, on average over the free cells there; 0 where it reaches the
    /// side, or where it is not measured [work].
    std::array<double, 6> insets = {};

    /// Whether it is a part of something rigid that is larger: a region.
    bool is_of_rigid_region() const
    {
        return hold == Hold::Prescribed || hold == Hold::Grouped;
    }
};

/// A connected component of the glue.
struct Component
{
    std::vector<int> cells;
    bool is_held = false;   ///< by a cell that is neither free, idle nor following
    int free_rotations = 0; ///< of the whole component: 3 about one pin, 1 about an axis
};

/// The components, by first cell, a group joining those that its cells are in; sets
/// Hold::Idle in the ones that nothing holds, unless they follow.
std::vector<Component> find_components(const Cells& cells,
                                       std::vector<Constraint>& constraints);

/// Moves a cell that turns about a held point so that this is where it must be.
Pose held_at_pin(const Pose& pose, const Constraint& pin, const Eigen::Vector3d& centre);

} // namespace cellwarp::core
