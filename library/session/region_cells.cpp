// SPDX-License-Identifier: GPL-3.0-or-later
// Why the glue at a border has a length of its own. From box centre to box centre half of
// it would stretch inside the region, which is rigid: every border would lie half a cell
// inside, and the result would be wrong by as much times the strain there. Measured on a
// bar bent by a handle at its end, the RMS error of 2,048 cells falls from 6e-4 to 5e-5
// of the diagonal by the true lengths, on the armadillo with 1,100 cells to a half.
#include "library/session/region_cells.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "io/base/error.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// A cell belongs to a region whose share is at least this.
constexpr double kMajority = 0.5 - 1e-6;

/// Shares that differ by less are equal.
constexpr double kSameShare = 1e-6;

/// Glue at a border is no shorter than this [half a free cell's edge]: the region may
/// reach its middle.
constexpr double kShortest = 0.1;

/// The voxels of one cell in its leaf, and which of them belong to a region: asked for
/// often, and dear to look up in all that body and region have. Takes a byte for each
/// voxel of the leaf.
class CellVoxels
{
public:
    CellVoxels(const Body& body, const VoxelRuns& region, int cell)
    {
        const VoxelGrid& grid = body.rest->material.grid;
        const LeafNumber leaf = body.cells.cells[idx(cell)].leaf;
        block_ = voxel_block(grid.shape(), body.octree[leaf]);
        const std::size_t width = idx(block_.width);
        bits_.resize(width * width * width, 0);
        body.pieces.for_each_run(
            grid, block_, leaf,
            [&](int j, int k, int first, int last, std::int32_t piece)
            {
                if (piece != cell)
                    return;
                char* const row = &bits_[(idx(k) * width + idx(j)) * width];
                std::fill(row + first, row + last, kOwn);
                const std::size_t start =
                    grid.index(block_.first + Eigen::Vector3i(0, j, k));
                region.for_each_part(start + idx(first), start + idx(last),
                                     [&](std::size_t begin, std::size_t end) {
                                         std::fill(row + begin - start, row + end - start,
                                                   static_cast<char>(kOwn | kHeld));
                                     });
            });
    }

    const VoxelBlock& block() const { return block_; }
    bool has(const Eigen::Vector3i& voxel) const
    {
        return is_in(block_, voxel) && bits(voxel) != 0;
    }
    /// How many voxels of the cell from \p voxel on, along the axis, are inside the
    /// region or not, as wanted.
    int run_length(Eigen::Vector3i voxel, int axis, int step, bool wants_inside) const
    {
        const int wanted = wants_inside ? kOwn | kHeld : kOwn;
        int count = 0;
        while (is_in(block_, voxel) && bits(voxel) == wanted)
        {
            ++count;
            voxel[axis] += step;
        }
        return count;
    }

private:
    static constexpr char kOwn = 1, kHeld = 2;

    char bits(const Eigen::Vector3i& voxel) const
    {
        const Eigen::Vector3i at = voxel - block_.first;
        const std::size_t width = idx(block_.width);
        return bits_[(idx(at.z()) * width + idx(at.y())) * width + idx(at.x())];
    }

    VoxelBlock block_;
    std::vector<char> bits_;
};

/// From the middle of the free cell to where the region ends, averaged over the face the
/// way springs side by side are [work].
double border_length(const Body& body, const VoxelRuns& region, const Face& face,
                     bool is_a_held)
{
    const VoxelGrid& grid = body.rest->material.grid;
    const CellVoxels a(body, region, face.a), b(body, region, face.b);
    const CellVoxels &held = is_a_held ? a : b, &loose = is_a_held ? b : a;
    const double half = 0.5 * body.cells.cells[idx(is_a_held ? face.b : face.a)].edge;
    const int outwards = is_a_held ? 1 : -1; // of the region
    const int axis = face.axis, u = (axis + 1) % 3, v = (axis + 2) % 3;
    const VoxelBlock& block = a.block();
    Eigen::Vector3i below;
    below[axis] = block.first[axis] + block.width - 1;
    double area = 0.0, stiffness = 0.0;
    for (int j = 0; j < block.width; ++j)
        for (int i = 0; i < block.width; ++i)
        {
            below[u] = block.first[u] + i;
            below[v] = block.first[v] + j;
            Eigen::Vector3i above = below;
            ++above[axis];
            if (!a.has(below) || !b.has(above))
                continue;
            int voxels =
                held.run_length(is_a_held ? below : above, axis, -outwards, false);
            if (voxels == 0)
                voxels =
                    -loose.run_length(is_a_held ? above : below, axis, outwards, true);
            const double part = grid.extent(u, below[u]) * grid.extent(v, below[v]);
            area += part;
            stiffness +=
                part / std::max(half + voxels * grid.shape().voxel(), kShortest * half);
        }
    // A face of crumbs alone, which lie in other leaves than their cells, ends where it
    // is.
    return area > 0.0 ? area / stiffness : half;
}

/// See prescribing_regions(); a region may be left without a cell. \p component: of each
/// cell.
std::vector<int> owners(const RegionSet& regions, std::span<const RegionShares> shares,
                        std::span<const int> component)
{
    const std::size_t num_cells = component.size();
    std::vector<int> owner(num_cells, -1);
    std::vector<double> owned_share(num_cells, 0.0);
    const auto take = [&](std::size_t region, int cell, double share)
    {
        const std::size_t c = idx(cell);
        if (owner[c] >= 0 && share <= owned_share[c] + kSameShare)
            return;
        owner[c] = static_cast<int>(region);
        owned_share[c] = share;
    };
    for (std::size_t r = 0; r < regions.size(); ++r)
        for (const auto& [cell, share] : shares[r].cells)
            if (regions[r].moves_as_one() && share >= kMajority)
                take(r, cell, share);
    // Without a majority anywhere, or in a component that holds samples of it, a region
    // takes the cells there that it has most of, unless a larger share holds them.
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        if (!regions[r].moves_as_one() || regions[r].bone)
            continue;
        std::map<int, double> largest; // of a component
        for (const int home : shares[r].homes)
            largest[home] = 0.0;
        const double of_all = shares[r].largest();
        for (const auto& [cell, share] : shares[r].cells)
            if (const auto found = largest.find(component[idx(cell)]);
                found != largest.end())
                found->second = std::max(found->second, share);
        for (const auto& [cell, share] : shares[r].cells)
        {
            const auto found = largest.find(component[idx(cell)]);
            const double most = found != largest.end() ? found->second : of_all;
            if (most < kMajority && share >= most - kSameShare)
                take(r, cell, share);
        }
    }
    // Of cells that two bones pass each has the ones that it has more of.
    for (std::size_t r = 0; r < regions.size(); ++r)
        for (const int cell : shares[r].on_line)
        {
            const auto share = std::lower_bound(
                shares[r].cells.begin(), shares[r].cells.end(), std::pair(cell, 0.0));
            const int other = owner[idx(cell)];
            if (other < 0 ||
                (regions[idx(other)].bone && owned_share[idx(cell)] < kMajority))
                take(r, cell, share->second);
        }
    for (std::size_t r = 0; r < regions.size(); ++r)
        if (regions[r].is_rod())
            for (const auto& [cell, share] : shares[r].cells)
                if (owner[idx(cell)] < 0)
                    owner[idx(cell)] = static_cast<int>(r);
    return owner;
}

/// A region that prescribes, but nothing where it has to; and a cell there, which another
/// one holds.
struct Homeless
{
    std::size_t region = 0;
    int cell = 0;
    bool has_others = false; ///< cells, in other components
};

/// Two that are both fixed, or that share samples, about which they must agree.
bool move_alike(const RegionSet& regions, std::size_t a, std::size_t b)
{
    return (regions[a].role == Role::Fixed && regions[b].role == Role::Fixed) ||
           std::any_of(regions.overlaps().begin(), regions.overlaps().end(),
                       [&](const RegionSet::Overlap& overlap) {
                           return (overlap.a == a && overlap.b == b) ||
                                  (overlap.a == b && overlap.b == a);
                       });
}

/// Everywhere, or in a component that holds samples of it and where no region that moves
/// alike holds a cell of it.
std::vector<Homeless> homeless_regions(const RegionSet& regions,
                                       std::span<const RegionShares> shares,
                                       std::span<const int> owner,
                                       std::span<const int> component)
{
    std::vector<Homeless> homeless;
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        if (!regions[r].prescribes() || regions[r].bone)
            continue;
        bool has_any = false;
        std::map<int, std::pair<int, double>> most; // of a component without: cell, share
        for (const int home : shares[r].homes)
            most[home] = {-1, 0.0};
        std::pair<int, double> of_all = {-1, 0.0};
        for (const auto& [cell, share] : shares[r].cells)
        {
            const std::size_t c = idx(cell);
            if (share > of_all.second)
                of_all = {cell, share};
            if (owner[c] == static_cast<int>(r))
            {
                has_any = true;
                most.erase(component[c]);
            }
            else if (const auto found = most.find(component[c]);
                     found != most.end() && share > found->second.second)
                found->second = {cell, share};
        }
        if (!has_any)
            homeless.push_back({r, of_all.first, false});
        for (const auto& [home, cell] : most)
        {
            const std::size_t other = idx(owner[idx(cell.first)]);
            if (has_any && !move_alike(regions, r, other))
                homeless.push_back({r, cell.first, true});
        }
    }
    return homeless;
}

} // namespace

std::vector<int> crowded_cells(const RegionSet& regions,
                               std::span<const RegionShares> shares, const Cells& cells)
{
    const std::vector<int> owner = owners(regions, shares, connected_components(cells));
    std::vector<int> crowded;
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        if (!regions[r].moves_as_one())
            continue;
        std::vector<bool> is_left(cells.size(), false);
        for (const auto& [cell, share] : shares[r].cells)
            is_left[idx(cell)] = true;
        for (const auto& [seed, share] : shares[r].cells)
        {
            if (!is_left[idx(seed)])
                continue;
            is_left[idx(seed)] = false;
            std::vector<int> part = {seed};
            bool has_home = false;
            for (std::size_t next = 0; next < part.size(); ++next)
            {
                has_home |= owner[idx(part[next])] == static_cast<int>(r);
                for (const int other : cells.neighbours_of(part[next]))
                    if (is_left[idx(other)])
                    {
                        is_left[idx(other)] = false;
                        part.push_back(other);
                    }
            }
            if (!has_home)
                crowded.insert(crowded.end(), part.begin(), part.end());
        }
    }
    return crowded;
}

std::vector<int> prescribing_regions(const RegionSet& regions,
                                     std::span<const RegionShares> shares,
                                     const Cells& cells)
{
    const std::vector<int> component = connected_components(cells);
    const std::vector<int> owner = owners(regions, shares, component);
    for (const auto& [r, cell, has_others] :
         homeless_regions(regions, shares, owner, component))
    {
        const Region& other = regions[idx(owner[idx(cell)])];
        // Where the other one holds all of it no size of cells would part them.
        const VoxelRuns& theirs = regions.voxels(idx(owner[idx(cell)]));
        bool is_within = true;
        regions.voxels(r).for_each([&](std::size_t voxel)
                                   { is_within = is_within && theirs.has(voxel); });
        throw Error(
            Fault::Unsolvable,
            at({regions.file(), regions[r].line, regions[r].name},
               "has no cell of its own" +
                   std::string(has_others ? " in a part of the shape that holds samples "
                                            "of it"
                                          : "") +
                   ": " + role_name(other.role) + " region " + other.name +
                   (is_within ? line_note(other) + " holds all of it as well"
                              : " holds cell " + std::to_string(cell) +
                                    " (smaller cells would part them: raise --across or "
                                    "--max-depth)")));
    }
    return owner;
}

std::vector<double> cell_factors(const RegionSet& regions,
                                 std::span<const RegionShares> shares,
                                 std::size_t num_cells)
{
    std::vector<double> factors;
    std::vector<double> best(num_cells, 0.0);
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        if (regions[r].role != Role::Stiff || shares[r].cells.empty())
            continue;
        factors.resize(num_cells, 1.0);
        const double needed = std::min(kMajority, shares[r].largest() - kSameShare);
        for (const auto& [cell, share] : shares[r].cells)
        {
            const std::size_t c = idx(cell);
            if (share >= needed && share > best[c] + kSameShare)
            {
                best[c] = share;
                factors[c] = regions[r].factor;
            }
        }
    }
    return factors;
}

std::vector<BorderGlue> border_glue(const Body& body, const RegionSet& regions,
                                    std::span<const int> region_of_cell)
{
    const auto holder = [&](int cell)
    {
        const int region = region_of_cell[idx(cell)];
        // Pins of one place and rods hold cells one by one: they end where the cells do.
        return region >= 0 && regions[idx(region)].moves_as_one() &&
                       !regions[idx(region)].is_pin_of_one_place()
                   ? region
                   : -1;
    };
    std::vector<BorderGlue> borders;
    std::vector<std::size_t> regions_there;
    for (std::size_t f = 0; f < body.cells.faces.size(); ++f)
    {
        const Face& face = body.cells.faces[f];
        const int of_a = holder(face.a), of_b = holder(face.b);
        if ((of_a >= 0) != (of_b >= 0))
        {
            borders.push_back({static_cast<int>(f), 0.0, of_a >= 0});
            regions_there.push_back(idx(std::max(of_a, of_b)));
        }
    }
    parallel_for(borders.size(), 4,
                 [&](std::size_t k)
                 {
                     BorderGlue& border = borders[k];
                     border.length = border_length(body, regions.voxels(regions_there[k]),
                                                   body.cells.faces[idx(border.face)],
                                                   border.is_a_rigid);
                 });
    return borders;
}

} // namespace cellwarp::core
