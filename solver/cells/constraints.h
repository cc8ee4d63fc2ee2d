// SPDX-License-Identifier: GPL-3.0-or-later
// Which cells may move, and how: free, prescribed, pinned at a point, or idle in a
// component that nothing holds.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"

namespace cellwarp
{

enum class Hold
{
    Free,
    Prescribed, ///< its pose is given
    Pinned,     ///< one of its points is given, it turns about it
    Sliding,    ///< one of its points stays on a curve, it turns about it
    Idle        ///< no region holds its component: it stays at rest
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

struct Constraint
{
    Hold hold = Hold::Free;
    Eigen::Vector3d held_rest = Eigen::Vector3d::Zero(); ///< of a pinned or sliding cell
    Eigen::Vector3d held_now = Eigen::Vector3d::Zero();
    const Rail* rail = nullptr; ///< of a sliding cell: held_now is its place at s
    double s = 0.0;
};

/// A connected component of the glue.
struct Component
{
    std::vector<int> cells;
    bool is_held = false;   ///< by a prescribed, pinned or sliding cell
    int free_rotations = 0; ///< of the whole component: 3 about one pin, 1 about an axis
};

/// The components, by first cell; sets Hold::Idle in the ones that nothing holds.
std::vector<Component> find_components(const Cells& cells,
                                       std::vector<Constraint>& constraints);

/// Moves a pinned or sliding cell so that its held point is where it must be.
Pose held_at_pin(const Pose& pose, const Constraint& pin, const Eigen::Vector3d& centre);

} // namespace cellwarp
