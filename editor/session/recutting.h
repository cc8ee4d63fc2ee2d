// SPDX-License-Identifier: GPL-3.0-or-later
// Cells that follow the deformation: smaller ones where the error is large, larger ones
// where it no longer is. Decided by where the cells are, never by time.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "editor/session/rig.h"

namespace cellwarp
{

/// Starts with the coarsest cells that leave every region one of its own.
class Recutting
{
public:
    Recutting(std::shared_ptr<const RestShape> rest,
              std::shared_ptr<const RegionSet> regions, const CellSettings& settings,
              const RigSettings& rig_settings);

    /// The rig in the first cells, at rest. Throws as Rig does, and Fault::Budget when
    /// the coarsest grid alone is over max_cells.
    Rig first();

    /// Each makes the same rig in other cells, its poses handed on, or nothing if the
    /// cells are as they should be.
    /// Parts the material of regions that \p motions move differently, to max_depth.
    std::optional<Rig> parted(const Rig& rig, std::span<const Motion> motions);
    /// Splits the cells whose error is above the threshold, the worst if all would be too
    /// many.
    std::optional<Rig> finer(const Rig& rig);
    /// Merges siblings whose errors are so small that their parent's will be well below
    /// the threshold.
    std::optional<Rig> coarser(const Rig& rig);

    /// The rig that is in \p state in the cells of \p body, in those of \p other.
    Rig in_cells_of(const Rig& other, const std::shared_ptr<const Body>& body,
                    const RigState& state) const;

    bool is_adaptive() const;
    /// What is never merged beyond; null before first().
    const Octree* coarsest() const { return coarsest_ ? &*coarsest_ : nullptr; }
    /// Of the leaves that finer() last looked at, those that the threshold would split
    /// but the depth does not let.
    int num_at_limit() const { return num_at_limit_; }
    /// Those since the last call.
    std::vector<std::string> take_warnings() { return std::exchange(warnings_, {}); }

private:
    Octree split(const Octree& octree, std::span<const int> worst_first,
                 std::int64_t most) const;
    Body finer_body(const Body& body, std::span<const int> worst_first);
    bool splits_all(const Body& body, std::span<const int> leaves,
                    const Body& next) const;
    void warn_of_budget(const Body& body);
    double threshold_of(const Rig& rig) const;
    std::vector<double> errors_of(const Rig& rig) const;
    std::vector<int> crowded_leaves(const Body& body) const;
    Body with_homes(Body body);
    std::optional<Rig> recut(const Rig& rig, Body cells) const;
    Rig handed_to(const std::shared_ptr<const Body>& body, const Rig& rig) const;
    /// Regions, one of each motion, that have material in a leaf.
    std::vector<std::vector<int>>
    differing_regions(const Rig& rig, std::span<const Motion> motions) const;

    std::shared_ptr<const RestShape> rest_;
    std::shared_ptr<const RegionSet> regions_;
    CellSettings settings_;
    RigSettings rig_settings_;
    MaterialTest has_material_;
    std::optional<Octree> coarsest_; ///< never merged beyond
    std::vector<std::string> warnings_;
    bool is_over_budget_ = false;
    int num_at_limit_ = 0;
};

} // namespace cellwarp
