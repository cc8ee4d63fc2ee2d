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

#include "library/session/cell_system.h"

namespace cellwarp::core
{

/// Starts with the coarsest cells that leave every region one of its own.
class CellRefiner
{
public:
    CellRefiner(std::shared_ptr<const RestShape> rest,
                std::shared_ptr<const RegionSet> regions, const CellSettings& settings,
                const CellSystemSettings& system_settings);

    /// The system in the first cells, at rest. Throws as CellSystem does, and
    /// Fault::Budget when the coarsest grid alone is over max_cells.
    CellSystem first();

    /// Each makes the same system in other cells, its poses handed on, or nothing if the
    /// cells are as they should be.
    /// Parts the material of regions that \p motions move differently, to max_depth.
    std::optional<CellSystem> parted(const CellSystem& system,
                                     std::span<const Motion> motions);
    /// Splits the cells whose error is above the threshold, once or twice, the worst if
    /// all would be too many.
    std::optional<CellSystem> finer(const CellSystem& system);
    /// Merges siblings whose errors are so small that their parent's will be well below
    /// the threshold.
    std::optional<CellSystem> coarser(const CellSystem& system);

    /// Bodies in ever larger cells, from which a solve in those of \p system may begin:
    /// each has at most half as many cells as the one before, the last one few, and what
    /// \p motions part is parted. Empty where the system has few.
    std::vector<std::shared_ptr<const Body>>
    larger_bodies(const CellSystem& system, std::span<const Motion> motions) const;
    /// Between the cells of \p system and the smaller ones of \p target: those of
    /// \p system are split that have the largest errors, a few of all.
    std::shared_ptr<const Body> partly_split(const CellSystem& system,
                                             const Body& target) const;
    /// The same system in the cells of \p body, its poses handed on.
    CellSystem handed_to(const std::shared_ptr<const Body>& body,
                         const CellSystem& system) const;
    /// Brings another system of the same shape to where \p from is.
    void hand_on(const CellSystem& from, CellSystem& to) const;

    /// The system that is in \p state in the cells of \p body, in those of \p other.
    CellSystem in_cells_of(const CellSystem& other,
                           const std::shared_ptr<const Body>& body,
                           const CellSystemState& state) const;

    bool is_adaptive() const;
    /// What is never merged beyond; null before first().
    const Octree* coarsest() const { return coarsest_ ? &*coarsest_ : nullptr; }
    /// Of the leaves that finer() last looked at, those that the threshold would split
    /// but the depth does not let.
    int num_at_limit() const { return num_at_limit_; }
    /// Those since the last call.
    std::vector<std::string> take_warnings() { return std::exchange(warnings_, {}); }

private:
    Octree split_twice(const Octree& octree, std::span<const LeafNumber> leaves,
                       std::size_t num_twice) const;
    Octree split(const Octree& octree, std::span<const LeafNumber> worst_first,
                 std::size_t num_twice, std::int64_t most) const;
    std::shared_ptr<const Body> finer_body(const std::shared_ptr<const Body>& body,
                                           std::span<const LeafNumber> worst_first,
                                           std::size_t num_twice = 0);
    bool splits_all(const Body& body, std::span<const LeafNumber> leaves,
                    const Body& next) const;
    void warn_of_budget(const Body& body);
    double threshold_of(const CellSystem& system) const;
    std::vector<double> errors_of(const CellSystem& system) const;
    std::vector<double> errors_of_leaves(const CellSystem& system) const;
    std::vector<LeafNumber> crowded_leaves(const Body& body,
                                           std::span<const RegionShares> shares) const;
    std::shared_ptr<const Body> with_homes(std::shared_ptr<const Body> body);
    std::optional<CellSystem> in_cells(const CellSystem& system,
                                       const std::shared_ptr<const Body>& cells) const;
    /// Regions, one of each motion, that have material in a leaf.
    std::vector<std::vector<int>>
    differing_regions(const Body& body, std::span<const RegionShares> shares,
                      std::span<const Motion> motions) const;
    std::vector<LeafNumber> contested_leaves(const Body& body,
                                             std::span<const RegionShares> shares,
                                             std::span<const Motion> motions) const;

    std::shared_ptr<const RestShape> rest_;
    std::shared_ptr<const RegionSet> regions_;
    CellSettings settings_;
    CellSystemSettings system_settings_;
    MaterialTest has_material_;
    std::optional<Octree> coarsest_; ///< never merged beyond
    std::vector<std::string> warnings_;
    bool is_over_budget_ = false;
    int num_at_limit_ = 0;
};

} // namespace cellwarp::core
