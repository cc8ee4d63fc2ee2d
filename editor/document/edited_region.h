// SPDX-License-Identifier: GPL-3.0-or-later
// The regions of a stage as panels and tools see them, found from its statements.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "editor/session/coincident_samples.h"
#include "editor/session/handle_trajectory.h"
#include "io/geometry.h"
#include "io/handle_file.h"

namespace cellwarp
{

/// Where a region has been moved to from its rest shape: turned about the centre of its
/// rest samples' box, then shifted.
struct Placement
{
    Eigen::Vector3d axis = Eigen::Vector3d::UnitX();       ///< unit
    double degrees = 0.0;                                  ///< any number of turns
    Eigen::Vector3d translation = Eigen::Vector3d::Zero(); ///< [model unit]

    bool operator==(const Placement&) const = default;
};

/// How much stiffer a stiff region is that says nothing else.
inline constexpr double kUsualStiffness = 10.0;

/// A region of the current stage as panels and tools see it.
struct EditedRegion
{
    std::string name;
    Role role = Role::Fixed;
    double factor = 1.0;                              ///< of a stiff region
    std::vector<std::uint32_t> samples;               ///< ascending
    Eigen::Vector3d centre = Eigen::Vector3d::Zero(); ///< Region::centre [model unit]
    Placement placement;                              ///< at the current edit
    /// False where they follow from a rest shape that is not known yet: then they are
    /// those that the model would have.
    bool knows_samples = true, knows_placement = true;

    bool is_guided = false; ///< a pin that stays on a curve
    bool is_spline() const { return role == Role::Rod || role == Role::Curve; }
    bool moves() const
    {
        return role == Role::Handle || (role == Role::Pin && !is_guided) || is_spline();
    }
};

/// What a stage's statements are read on.
struct RegionGround
{
    const Geometry& geometry;
    const std::vector<Eigen::Vector3d>& rest; ///< samples [model unit]
    Units units;
    const HandleFile& file;              ///< of the statements
    const CoincidentSamples& coincident; ///< of the samples
    bool is_known = true; ///< false: the model stands for a rest that is not there yet
};

/// Of all statements, at rest. Throws what resolve_regions() throws.
std::vector<EditedRegion> edited_regions(const std::vector<RegionStatement>& statements,
                                         const RegionGround& ground);

/// A list of samples as a selector.
Selector selector_of(const std::vector<std::uint32_t>& samples);

/// Where a move puts a region. Throws what steps_of() throws.
Placement placement_of(const Move& move, const EditedRegion& region,
                       const RegionGround& ground);
/// Whether that is the same on any rest shape.
bool is_placed_anywhere(const Move& move, const RegionGround& ground);

/// A region's placement as a motion of work space.
Motion motion_of(const Placement& placement, const Eigen::Vector3d& centre,
                 const WorkFrame& frame);

/// The frames that take a region to a placement, numbers from \p number on: one, or two
/// where the way would not be clear from its end alone (more than half a turn about a new
/// axis).
std::vector<FrameStatement> frames_to(const EditedRegion& region, const Placement& to,
                                      std::int64_t number, const RegionGround& ground);

} // namespace cellwarp
