// SPDX-License-Identifier: GPL-3.0-or-later
// Flat models are kept in their plane without being told, where their first moves keep
// it.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "io/scene/handle_file.h"
#include "library/session/body.h"
#include "library/session/handle_trajectory.h"

namespace cellwarp::core
{

/// The plane that a stage is kept in where cells.flat is left open and its first frame
/// that moves something keeps it.
class DefaultPlane
{
public:
    /// That of samples [model unit]; nothing where they lie in none, on a line or at one
    /// place, or where the scene's frame has no axis across it. Throws what given_frame()
    /// throws.
    static std::optional<DefaultPlane> of(const std::vector<Eigen::Vector3d>& samples,
                                          const CellSettings& settings);

    /// Whether it keeps a stage: one of regions alone, no rods, curves and joints.
    bool keeps(const Stage& stage, bool is_relative) const;
    /// Whether it keeps a stage with \p more frames at its end, but not all of these.
    bool is_left(const Stage& stage, std::span<const FrameStatement> more,
                 bool is_relative) const;
    /// Whether octrees of what it keeps have axes of their own, and boxes of regions too.
    bool is_askew() const { return is_askew_; }

private:
    DefaultPlane(const WorkFrame& frame, const ModelBox& box,
                 const Eigen::Vector3d& normal, const Eigen::Vector3d& place,
                 bool is_askew)
        : frame_(frame), box_(box), normal_(normal), place_(place), is_askew_(is_askew)
    {
    }
    std::vector<Motion> motions(const FrameStatement& frame, bool is_relative) const;
    bool keeps(const FrameStatement& frame, bool is_relative) const;
    std::optional<bool> keeps_first(std::span<const FrameStatement> frames,
                                    bool is_relative) const;

    WorkFrame frame_;
    ModelBox box_;
    Eigen::Vector3d normal_, place_; ///< across it, and in it [work]
    bool is_askew_;
};

} // namespace cellwarp::core
