// SPDX-License-Identifier: GPL-3.0-or-later
// What the region statements of a handle file mean for one model: the places and samples
// that a region names.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "editor/session/coincident_samples.h"
#include "editor/session/handle_trajectory.h"
#include "io/geometry.h"
#include "io/handle_file.h"

namespace cellwarp
{

/// A geometric selector in model coordinates.
struct RegionShape
{
    std::function<bool(const Eigen::Vector3d&)> holds;      ///< closed
    std::function<double(const Eigen::Vector3d&)> distance; ///< of a point outside
    /// Bounds of it; infinite where it has none.
    Eigen::Vector3d low = Eigen::Vector3d::Constant(-INFINITY);
    Eigen::Vector3d high = Eigen::Vector3d::Constant(INFINITY);
};

/// A region of one stage, all its selectors together.
struct Region
{
    Role role = Role::Fixed;
    std::string name;
    double factor = 1.0;                ///< of a stiff region
    std::int64_t line = 0;              ///< of its first statement
    std::vector<std::uint32_t> samples; ///< sorted
    /// About which it turns where a move does not say: the centre of the box of its rest
    /// samples; of one without samples, of its shapes as far as they are in the model's
    /// box [model unit].
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    /// Sorted; the ones named one by one (lists, labels, groups), with all that coincide.
    std::vector<std::uint32_t> listed;
    std::vector<RegionShape> shapes; ///< one a geometric selector

    bool prescribes() const { return role != Role::Stiff; }
    bool holds(const Eigen::Vector3d& model_point) const;
};

/// Resolves statements of \p file. \p samples: the rest samples [model unit], in the
/// order of \p geometry, which gives the groups; \p known_coincident: of them, where
/// somebody has them already. Throws Fault::Malformed for a group or label that does not
/// exist, an index out of range, a label file of another length, and what reading that
/// one throws.
std::vector<Region> resolve_regions(const std::vector<RegionStatement>& statements,
                                    const Geometry& geometry,
                                    const std::vector<Eigen::Vector3d>& samples,
                                    const Units& units, const HandleFile& file,
                                    const CoincidentSamples* known_coincident = nullptr);

/// " (the nearest sample, 17, is 0.3 away)": by how much a region missed the model.
std::string nearest_sample_note(const Region& region,
                                const std::vector<Eigen::Vector3d>& samples);

} // namespace cellwarp
