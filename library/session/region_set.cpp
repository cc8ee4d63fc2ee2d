// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/region_set.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "io/base/error.h"
#include "library/session/region_voxels.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Share of the cells that stand for samples without a voxel: below any real one.
constexpr double kTokenShare = 1e-3;

/// So many parts of boxes are kept before they are summed up.
constexpr std::size_t kFewVolumes = 4096;

double volume_of(const VoxelGrid& grid, const Eigen::Vector3i& v)
{
    double product = 1.0;
    for (int axis = 0; axis < 3; ++axis)
        product *= grid.extent(axis, v[axis]);
    return product;
}

/// Calls visit(voxel) for those of a finest box of the octree, ascending.
template <class Visit>
void for_each_in_box(const VoxelGrid& grid, const VoxelRuns& voxels, std::size_t box,
                     Visit&& visit)
{
    const auto [first, last] = grid.voxels_of_box(box);
    for (int k = first.z(); k <= last.z(); ++k)
        for (int j = first.y(); j <= last.y(); ++j)
        {
            const std::size_t row = grid.index(0, j, k);
            voxels.for_each_part(
                row + idx(first.x()), row + idx(last.x()) + 1,
                [&](std::size_t begin, std::size_t end)
                {
                    for (std::size_t v = begin; v < end; ++v)
                        visit(Eigen::Vector3i(static_cast<int>(v - row), j, k));
                });
        }
}

/// The volume of \p voxels in each finest box of the octree that holds any, by its
/// number.
std::vector<std::pair<std::size_t, double>> volumes_in_boxes(const VoxelGrid& grid,
                                                             const VoxelRuns& voxels)
{
    const std::size_t nx = idx(grid.counts().x());
    const int width = grid.shape().voxels_per_leaf;
    const std::vector<double>& lines = grid.lines(0);
    std::vector<std::pair<std::size_t, double>> volumes;
    std::size_t first = 0, count = 0; // of the layer of boxes; what is summed up
    const auto by_box = [](const auto& a, const auto& b) { return a.first < b.first; };
    // Adds up, of the layer, what is in one box: rows bring it in parts.
    const auto sum_up = [&]
    {
        const auto begin = volumes.begin() + static_cast<std::ptrdiff_t>(first);
        std::stable_sort(begin, volumes.end(), by_box);
        count = first;
        for (std::size_t k = first; k < volumes.size(); ++k)
            if (count > first && volumes[count - 1].first == volumes[k].first)
                volumes[count - 1].second += volumes[k].second;
            else
                volumes[count++] = volumes[k];
        volumes.resize(count);
    };
    int layer = -1;
    for (const VoxelRuns::Run& run : voxels.runs())
        for (std::size_t begin = run.begin; begin < run.end;)
        {
            // A run may go on in the next row.
            Eigen::Vector3i voxel = grid.coordinates(begin);
            const std::size_t row = begin - idx(voxel.x());
            const int end =
                static_cast<int>(std::min<std::size_t>(run.end, row + nx) - row);
            begin = row + idx(end);
            if (voxel.z() / width != layer)
            {
                sum_up();
                first = volumes.size();
                layer = voxel.z() / width;
            }
            else if (volumes.size() > 2 * count + kFewVolumes)
                sum_up();
            const double section = grid.extent(1, voxel.y()) * grid.extent(2, voxel.z());
            while (voxel.x() < end)
            {
                const int next = std::min(end, (voxel.x() / width + 1) * width);
                const double length = lines[idx(next)] - lines[idx(voxel.x())];
                volumes.emplace_back(grid.box(voxel), length * section);
                voxel.x() = next;
            }
        }
    sum_up();
    return volumes;
}

/// The samples as the file has them, nearly: for messages.
std::vector<Eigen::Vector3d> model_samples(const RestShape& rest)
{
    std::vector<Eigen::Vector3d> samples;
    for (const Eigen::Vector3d& x : rest.samples)
        samples.push_back(rest.frame.to_model(x));
    return samples;
}

} // namespace

double RegionShares::largest() const
{
    double most = 0.0;
    for (const auto& [cell, share] : cells)
        most = std::max(most, share);
    return most;
}

RegionSet::RegionSet(std::shared_ptr<const RestShape> shape, std::vector<Region> regions,
                     std::string file, std::shared_ptr<const SkeletonHandle> skeleton)
    : shape_(std::move(shape)), regions_(std::move(regions)), file_(std::move(file)),
      skeleton_(std::move(skeleton))
{
    find_voxels();
    leave_out_bones();
    for (std::size_t r = 0; r < size(); ++r)
        if (regions_[r].is_rod() && voxels_[r].empty() && regions_[r].samples.empty())
            throw Error(Fault::Unsolvable,
                        at({file_, regions_[r].line, regions_[r].name},
                           "its tube meets no material" +
                               nearest_sample_note(regions_[r], model_samples(*shape_))));
        else if (regions_[r].samples.empty() && voxels_[r].empty() &&
                 regions_[r].role != Role::Curve)
            throw malformed({file_, regions_[r].line, regions_[r].name},
                            "selects nothing of the model" +
                                nearest_sample_note(regions_[r], model_samples(*shape_)));
    volumes_.resize(size());
    parallel_for(size(), [&](std::size_t r)
                 { volumes_[r] = volumes_in_boxes(shape_->material.grid, voxels_[r]); });
    measure();
    find_overlaps();
}

void RegionSet::find_voxels()
{
    const VoxelGrid& grid = shape_->material.grid;
    voxels_.resize(size());
    line_voxels_.resize(size());
    parallel_for(size(),
                 [&](std::size_t r)
                 {
                     voxels_[r] = voxels_in_shapes(regions_[r], *shape_);
                     if (!regions_[r].bone)
                         return;
                     line_voxels_[r] = voxels_on_bone(regions_[r], grid);
                     VoxelRuns on_line;
                     for (const std::uint32_t voxel : line_voxels_[r])
                         on_line.add(voxel);
                     voxels_[r] = united(voxels_[r], on_line);
                 });
    // Samples that stand for their voxels: listed ones, and all those of a region
    // that holds no voxel centre. Those that the same regions list are of one kind.
    std::vector<std::uint32_t> kind_of_sample(shape_->samples.size(), 0);
    std::vector<std::vector<std::size_t>> regions_of_kind(1);
    for (std::size_t r = 0; r < size(); ++r)
    {
        std::map<std::uint32_t, std::uint32_t> with_region; // the kind that each becomes
        for (const std::uint32_t i :
             voxels_[r].empty() ? regions_[r].samples : regions_[r].listed)
        {
            const auto [kind, is_new] = with_region.try_emplace(
                kind_of_sample[i], static_cast<std::uint32_t>(regions_of_kind.size()));
            if (is_new)
            {
                regions_of_kind.push_back(regions_of_kind[kind_of_sample[i]]);
                regions_of_kind.back().push_back(r);
            }
            kind_of_sample[i] = kind->second;
        }
    }
    if (regions_of_kind.size() == 1)
        return;
    const std::vector<VoxelRuns> of_kind =
        shape_->nearest_samples().voxels_of(kind_of_sample, regions_of_kind.size());
    for (std::size_t kind = 1; kind < of_kind.size(); ++kind)
        for (const std::size_t r : regions_of_kind[kind])
            voxels_[r] = united(voxels_[r], of_kind[kind]);
}

void RegionSet::leave_out_bones()
{
    std::vector<Region> kept;
    std::vector<VoxelRuns> voxels;
    std::vector<std::vector<std::uint32_t>> line_voxels;
    for (std::size_t r = 0; r < regions_.size(); ++r)
    {
        if (regions_[r].bone && voxels_[r].empty())
        {
            outside_.push_back(regions_[r].name);
            continue;
        }
        kept.push_back(std::move(regions_[r]));
        voxels.push_back(std::move(voxels_[r]));
        line_voxels.push_back(std::move(line_voxels_[r]));
    }
    regions_ = std::move(kept);
    voxels_ = std::move(voxels);
    line_voxels_ = std::move(line_voxels);
}

/// Boxes of the regions' samples: how far they travel.
void RegionSet::measure()
{
    const VoxelGrid& grid = shape_->material.grid;
    for (std::size_t r = 0; r < size(); ++r)
    {
        ModelBox& box = boxes_.emplace_back();
        box.low.setConstant(INFINITY);
        box.high = -box.low;
        const auto include = [&](const Eigen::Vector3d& x)
        {
            box.low = box.low.cwiseMin(x);
            box.high = box.high.cwiseMax(x);
        };
        for (const std::uint32_t i : regions_[r].samples)
            include(shape_->samples[i]);
        if (regions_[r].samples.empty())
            voxels_[r].for_each([&](std::size_t voxel)
                                { include(grid.centre(grid.coordinates(voxel))); });
    }
}

void RegionSet::find_overlaps()
{
    std::vector<int> first_region(shape_->samples.size(), -1);
    for (std::size_t r = 0; r < size(); ++r)
        for (const std::uint32_t i : regions_[r].samples)
        {
            if (!regions_[r].moves_as_one())
                break;
            if (first_region[i] >= 0)
                overlaps_.push_back({idx(first_region[i]), r, i});
            else
                first_region[i] = static_cast<int>(r);
        }
}

/// The samples of a region in components of the body where it has no part of any piece.
std::vector<std::uint32_t> RegionSet::samples_without(std::span<const double> part,
                                                      std::span<const int> component,
                                                      std::size_t region,
                                                      const Body& body) const
{
    std::vector<bool> has_part(component.size(), false);
    for (std::size_t piece = 0; piece < part.size(); ++piece)
        if (part[piece] > 0)
            has_part[idx(component[piece])] = true;
    std::vector<std::uint32_t> samples;
    for (const std::uint32_t i : regions_[region].samples)
    {
        const std::size_t piece = idx(body.cell_of_sample[i]);
        if (!has_part[idx(component[piece])])
            samples.push_back(i);
    }
    return samples;
}

std::vector<RegionShares> RegionSet::shares(const Body& body) const
{
    const VoxelGrid& grid = shape_->material.grid;
    const Pieces& pieces = body.pieces;
    std::vector<RegionShares> result(size());
    const std::vector<int> component = connected_components(body.cells);
    parallel_for(
        size(),
        [&](std::size_t r)
        {
            std::vector<std::pair<int, double>>& cells = result[r].cells;
            std::vector<int>& homes = result[r].homes;
            std::vector<double> part(pieces.size(), 0.0);
            for (const auto& [box, volume] : volumes_[r])
            {
                const std::int32_t only = pieces.only(pieces.leaf_of_box(box));
                if (only >= 0)
                    part[idx(only)] += volume;
                else
                    for_each_in_box(grid, voxels_[r], box,
                                    [&](const Eigen::Vector3i& voxel) {
                                        part[idx(pieces.at(grid, voxel))] +=
                                            volume_of(grid, voxel);
                                    });
            }
            // Where none of its voxels is in a component that holds samples of it,
            // because it ends there within a voxel or others outnumber its samples: the
            // cells that hold these stand for it.
            if (regions_[r].moves_as_one() || voxels_[r].empty())
                for (const std::uint32_t i : samples_without(part, component, r, body))
                {
                    const std::size_t piece = idx(body.cell_of_sample[i]);
                    part[piece] = kTokenShare * body.cells.cells[piece].volume;
                }
            for (const std::uint32_t i : regions_[r].samples)
                if (!regions_[r].is_rod())
                    homes.push_back(component[idx(body.cell_of_sample[i])]);
            std::vector<int>& on_line = result[r].on_line;
            for (const std::uint32_t voxel : line_voxels_[r])
                on_line.push_back(pieces.at(grid, voxel));
            std::sort(on_line.begin(), on_line.end());
            on_line.erase(std::unique(on_line.begin(), on_line.end()), on_line.end());
            std::sort(homes.begin(), homes.end());
            homes.erase(std::unique(homes.begin(), homes.end()), homes.end());
            for (std::size_t piece = 0; piece < pieces.size(); ++piece)
                if (part[piece] > 0)
                    cells.emplace_back(
                        static_cast<int>(piece),
                        std::min(1.0, part[piece] / body.cells.cells[piece].volume));
        });
    return result;
}

} // namespace cellwarp::core
