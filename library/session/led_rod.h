// SPDX-License-Identifier: GPL-3.0-or-later
// Rods that no statement moves but who runs the session: a simulation.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "library/session/spline_handle.h"
#include "library/session/work_frame.h"

namespace cellwarp::core
{

/// It carries cells as any other rod does.
struct LedRod
{
    std::string name;
    /// How it lies in the model at rest.
    std::function<std::shared_ptr<const SplineHandle>(const WorkFrame&)> at_rest;
};

/// Where it is. Nothing of it is told by points that are held.
class LedState : public SplineState
{
public:
    double energy() const final { return 0.0; }
    std::vector<Eigen::Vector3d> forces() const final { return {}; }
    std::vector<Eigen::Vector3d> points() const final { return {}; }
    Eigen::Matrix3d frame_at_point(std::size_t) const final
    {
        return Eigen::Matrix3d::Identity();
    }
    double turn_at_point(std::size_t) const final { return 0.0; }
};

/// At \p t in [0, 1] of the way between two states of a rod, which must outlive it;
/// exactly \p to at 1.
std::shared_ptr<const SplineState> on_the_way(const SplineHandle& rod,
                                              std::shared_ptr<const SplineState> from,
                                              std::shared_ptr<const SplineState> to,
                                              double t);

/// In how many parts it goes there: see parts_of_way(), of \p size.
int parts_between(const SplineHandle& rod, const SplineState& from, const SplineState& to,
                  double size);

} // namespace cellwarp::core
