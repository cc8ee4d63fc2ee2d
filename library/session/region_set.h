// SPDX-License-Identifier: GPL-3.0-or-later
// The regions of one stage on its rest shape: the voxels of each, however the shape is
// cut into cells.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "library/session/body.h"
#include "library/session/regions.h"
#include "library/session/skeleton_handle.h"
#include "octree/voxel_runs.h"

namespace cellwarp::core
{

/// How much of each cell's material belongs to a region, by volume. Crumbs make no cell
/// larger, so they never make a share of more than 1.
struct RegionShares
{
    std::vector<std::pair<int, double>> cells; ///< (cell, share > 0), ascending
    std::vector<int> homes;   ///< components that hold samples of it, ascending
    std::vector<int> on_line; ///< cells that the line of a bone passes, ascending
    double largest() const;
};

/// Immutable.
class RegionSet
{
public:
    /// A voxel belongs to a region by its centre if it lies in a shape, and by its
    /// nearest sample through the material if that is listed; to a rod also if its line
    /// passes through it. A region that holds samples
    /// but no voxel centre counts as the list of its samples. \p file is where the
    /// regions stand, for messages. Throws Fault::Malformed for a region that selects
    /// nothing, Fault::Unsolvable for a rod whose tube meets no material.
    /// Bones that meet no material are left out, see outside(); \p skeleton: of those
    /// that are there, or null.
    RegionSet(std::shared_ptr<const RestShape> shape, std::vector<Region> regions,
              std::string file, std::shared_ptr<const SkeletonHandle> skeleton = nullptr);

    std::size_t size() const { return regions_.size(); }
    const Region& operator[](std::size_t region) const { return regions_[region]; }
    const std::vector<Region>& regions() const { return regions_; }
    const std::string& file() const { return file_; }
    const std::shared_ptr<const SkeletonHandle>& skeleton() const { return skeleton_; }
    /// Names of bones that meet no material.
    const std::vector<std::string>& outside() const { return outside_; }

    const VoxelRuns& voxels(std::size_t region) const { return voxels_[region]; }

    /// Of all regions in the cells of a body of this shape. Every component of the body
    /// that holds samples of a region has a share of it, be it a token; none of a curve.
    std::vector<RegionShares> shares(const Body& body) const;

    /// The box of a region's samples, or of its voxels' centres if it has none: how far
    /// it travels [work].
    const ModelBox& box(std::size_t region) const { return boxes_[region]; }
    /// Region::centre [work].
    Eigen::Vector3d centre(std::size_t region) const
    {
        return shape_->frame.to_work(regions_[region].centre);
    }

    /// A sample that two regions hold that move as one: their motions must agree about
    /// it.
    struct Overlap
    {
        std::size_t a, b;
        std::uint32_t sample;
    };
    const std::vector<Overlap>& overlaps() const { return overlaps_; }

private:
    void find_voxels();
    void leave_out_bones();
    void measure();
    void find_overlaps();
    std::vector<std::uint32_t> samples_without(std::span<const double> part,
                                               std::span<const int> component,
                                               std::size_t region,
                                               const Body& body) const;

    std::shared_ptr<const RestShape> shape_;
    std::vector<Region> regions_;
    std::string file_;
    std::shared_ptr<const SkeletonHandle> skeleton_;
    std::vector<std::string> outside_;
    std::vector<VoxelRuns> voxels_;
    /// Of the voxels in each finest box of the octree that holds any, by its number.
    std::vector<std::vector<std::pair<std::size_t, double>>> volumes_;
    std::vector<std::vector<std::uint32_t>> line_voxels_; ///< of bones
    std::vector<ModelBox> boxes_;
    std::vector<Overlap> overlaps_;
};

} // namespace cellwarp::core
