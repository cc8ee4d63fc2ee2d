// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "io/error.h"
#include "io/number.h"
#include "octree/nearest_sample.h"
#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

/// Samples closer than this are twins [diagonal].
constexpr double kTwin = 1e-9;

/// A cell belongs to a region whose share is at least this.
constexpr double kMajority = 0.5 - 1e-6;

/// Shares that differ by less are equal.
constexpr double kSameShare = 1e-6;

/// Share of the cells that stand for samples without a voxel: below any real one.
constexpr double kTokenShare = 1e-3;

/// The test of a geometric selector. Relative ones test points in the box's own
/// coordinates, where a flat axis is 0; distances are lengths of the model.
RegionShape shape_of(const Selector& selector, const Units& units)
{
    const std::vector<double>& n = selector.numbers;
    const Eigen::Vector3d low = units.box.low, size = units.box.size();
    const bool is_relative = units.is_relative;
    const auto relative = [=](const Eigen::Vector3d& x)
    {
        Eigen::Vector3d u = x;
        if (is_relative)
            for (int k = 0; k < 3; ++k)
                u[k] = size[k] > 0 ? (x[k] - low[k]) / size[k] : 0.0;
        return u;
    };
    const auto absolute = [=](const Eigen::Vector3d& u)
    { return is_relative ? Eigen::Vector3d(low + u.cwiseProduct(size)) : u; };
    switch (selector.kind)
    {
    case Selector::Kind::Box:
    {
        const Eigen::Vector3d first(n[0], n[1], n[2]), last(n[3], n[4], n[5]);
        const Eigen::Vector3d unit = is_relative ? size : Eigen::Vector3d::Ones();
        return {[=](const Eigen::Vector3d& x)
                {
                    const Eigen::Array3d u = relative(x).array();
                    return (u >= first.array()).all() && (u <= last.array()).all();
                },
                [=](const Eigen::Vector3d& x)
                {
                    const Eigen::Vector3d u = relative(x);
                    return (first - u)
                        .cwiseMax(u - last)
                        .cwiseMax(0.0)
                        .cwiseProduct(unit)
                        .norm();
                },
                absolute(first), absolute(last)};
    }
    case Selector::Kind::Sphere:
    case Selector::Kind::Capsule:
    {
        const Eigen::Vector3d a = absolute({n[0], n[1], n[2]});
        const bool is_capsule = selector.kind == Selector::Kind::Capsule;
        const Eigen::Vector3d b = is_capsule ? absolute({n[3], n[4], n[5]}) : a;
        const double r = n.back() * (is_relative ? size.norm() : 1.0);
        const Eigen::Vector3d axis = b - a;
        const double squared = axis.squaredNorm();
        const auto from_axis = [=](const Eigen::Vector3d& x)
        {
            const double t =
                squared > 0 ? std::clamp((x - a).dot(axis) / squared, 0.0, 1.0) : 0.0;
            return (x - a - t * axis).stableNorm();
        };
        return {[=](const Eigen::Vector3d& x) { return from_axis(x) <= r; },
                [=](const Eigen::Vector3d& x) { return from_axis(x) - r; },
                a.cwiseMin(b) - Eigen::Vector3d::Constant(r),
                a.cwiseMax(b) + Eigen::Vector3d::Constant(r)};
    }
    case Selector::Kind::Halfspace:
    {
        const Eigen::Vector3d normal(n[0], n[1], n[2]);
        const double d = n[3], unit = is_relative ? size.norm() : 1.0;
        return {[=](const Eigen::Vector3d& x) { return normal.dot(relative(x)) >= d; },
                [=](const Eigen::Vector3d& x)
                { return unit * (d - normal.dot(relative(x))) / normal.norm(); }};
    }
    default:
        return {[](const Eigen::Vector3d&) { return true; },
                [](const Eigen::Vector3d&) { return 0.0; }};
    }
}

/// Finds every sample within a tolerance of a listed one.
class Twins
{
public:
    Twins(const std::vector<Eigen::Vector3d>& samples, double tolerance)
        : samples_(samples), tolerance_(tolerance)
    {
        for (std::size_t i = 0; i < samples.size(); ++i)
            cells_.emplace_back(key(samples[i]), static_cast<std::uint32_t>(i));
        std::sort(cells_.begin(), cells_.end());
    }

    std::vector<std::uint32_t> of(const std::vector<std::uint32_t>& listed) const
    {
        std::vector<std::uint32_t> all;
        std::set<std::array<double, 3>> done; // coincident samples have the same twins
        for (const std::uint32_t i : listed)
            if (done.insert({samples_[i].x(), samples_[i].y(), samples_[i].z()}).second)
                gather(samples_[i], all);
        std::sort(all.begin(), all.end());
        all.erase(std::unique(all.begin(), all.end()), all.end());
        return all;
    }

private:
    /// Cells far larger than the tolerance: only a place that lies within it of a
    /// cell's border must look into the next cell.
    static constexpr double kCell = 1024.0; ///< [tolerance]
    using Key = std::array<double, 3>;

    Key key(const Eigen::Vector3d& x) const
    {
        Key k{};
        for (int axis = 0; axis < 3; ++axis)
            k[static_cast<std::size_t>(axis)] =
                tolerance_ > 0 ? std::floor(x[axis] / (kCell * tolerance_)) : x[axis];
        return k;
    }
    void gather(const Eigen::Vector3d& x, std::vector<std::uint32_t>& all) const
    {
        const Key low = key(x - Eigen::Vector3d::Constant(tolerance_));
        const Key high = key(x + Eigen::Vector3d::Constant(tolerance_));
        std::set<Key> keys;
        for (const double i : {low[0], high[0]})
            for (const double j : {low[1], high[1]})
                for (const double k : {low[2], high[2]})
                    keys.insert({i, j, k});
        for (const Key& near : keys)
            for (auto at = std::lower_bound(cells_.begin(), cells_.end(),
                                            std::pair(near, std::uint32_t(0)));
                 at != cells_.end() && at->first == near; ++at)
                if ((samples_[at->second] - x).norm() <= tolerance_)
                    all.push_back(at->second);
    }

    const std::vector<Eigen::Vector3d>& samples_;
    double tolerance_;
    std::vector<std::pair<Key, std::uint32_t>> cells_;
};

/// The samples that a list selector names, without twins.
std::vector<std::uint32_t>
listed_samples(const RegionStatement& statement, const Geometry& geometry,
               std::size_t num_samples, const std::string& file,
               std::map<std::string, std::vector<std::int64_t>>& labels)
{
    const Selector& selector = statement.selector;
    const Where where{file, statement.line, statement.name};
    std::vector<std::uint32_t> listed;
    if (selector.kind == Selector::Kind::Indices)
    {
        for (const auto& [first, last] : selector.ranges)
        {
            if (last >= static_cast<std::int64_t>(num_samples))
                throw malformed(where, "sample index is out of range (got " +
                                           std::to_string(last) + ", need 0 to " +
                                           std::to_string(num_samples - 1) + ")");
            for (std::int64_t i = first; i <= last; ++i)
                listed.push_back(static_cast<std::uint32_t>(i));
        }
    }
    else if (selector.kind == Selector::Kind::Labels)
    {
        auto [found, is_new] = labels.try_emplace(selector.name);
        if (is_new)
            found->second = read_labels(selector.name);
        if (found->second.size() != num_samples)
            throw malformed(where, selector.name + " has " +
                                       std::to_string(found->second.size()) +
                                       " labels, need one for each of " +
                                       std::to_string(num_samples) + " samples");
        for (std::size_t i = 0; i < num_samples; ++i)
            if (found->second[i] == selector.label)
                listed.push_back(static_cast<std::uint32_t>(i));
    }
    else
    {
        bool is_known = false;
        for (const FaceGroup& group : geometry.groups)
            if (group.name == selector.name)
            {
                is_known = true;
                for (std::size_t f = group.first_face; f < group.end_face; ++f)
                    for (const std::uint32_t corner : geometry.face(f))
                        listed.push_back(corner);
            }
        if (!is_known)
            throw malformed(where, "the model has no group " + in_quotes(selector.name));
    }
    std::sort(listed.begin(), listed.end());
    listed.erase(std::unique(listed.begin(), listed.end()), listed.end());
    return listed;
}

bool is_geometric(Selector::Kind kind)
{
    return kind != Selector::Kind::Indices && kind != Selector::Kind::Labels &&
           kind != Selector::Kind::Group;
}

} // namespace

bool Region::holds(const Eigen::Vector3d& model_point) const
{
    return std::any_of(shapes.begin(), shapes.end(),
                       [&](const auto& shape) { return shape.holds(model_point); });
}

std::string nearest_sample_note(const Region& region,
                                const std::vector<Eigen::Vector3d>& samples)
{
    double least = INFINITY;
    std::size_t nearest = 0;
    for (const RegionShape& shape : region.shapes)
        for (std::size_t i = 0; i < samples.size(); ++i)
            if (const double d = shape.distance(samples[i]); d < least)
            {
                least = d;
                nearest = i;
            }
    return region.shapes.empty() ? " (it lists no sample)"
                                 : " (the nearest sample, " + std::to_string(nearest) +
                                       ", is " + shortest(least) + " away)";
}

std::vector<Region> resolve_regions(const std::vector<RegionStatement>& statements,
                                    const Geometry& geometry,
                                    const std::vector<Eigen::Vector3d>& samples,
                                    const Units& units, const std::string& file)
{
    std::vector<Region> regions;
    std::map<std::string, std::size_t> by_name;
    std::map<std::string, std::vector<std::int64_t>> labels;
    for (const RegionStatement& statement : statements)
    {
        const auto [found, is_new] = by_name.try_emplace(statement.name, regions.size());
        if (is_new)
        {
            Region region;
            region.role = statement.role;
            region.name = statement.name;
            region.factor = statement.factor;
            region.line = statement.line;
            regions.push_back(std::move(region));
        }
        Region& region = regions[found->second];
        if (region.factor != statement.factor)
            throw malformed({file, statement.line, statement.name},
                            "has another factor than on line " +
                                std::to_string(region.line) + " (got " +
                                shortest(statement.factor) + ", need " +
                                shortest(region.factor) + ")");
        if (is_geometric(statement.selector.kind))
            region.shapes.push_back(shape_of(statement.selector, units));
        else
        {
            const std::vector<std::uint32_t> more =
                listed_samples(statement, geometry, samples.size(), file, labels);
            region.listed.insert(region.listed.end(), more.begin(), more.end());
        }
    }
    std::optional<Twins> twins;
    for (Region& region : regions)
    {
        if (!region.listed.empty())
        {
            if (!twins)
                twins.emplace(samples, kTwin * units.box.size().norm());
            region.listed = twins->of(region.listed);
        }
        std::vector<bool> is_listed(region.shapes.empty() ? 0 : samples.size(), false);
        if (region.shapes.empty())
            region.samples = region.listed;
        else
        {
            for (const std::uint32_t i : region.listed)
                is_listed[i] = true;
            for (std::size_t i = 0; i < samples.size(); ++i)
                if (is_listed[i] || region.holds(samples[i]))
                    region.samples.push_back(static_cast<std::uint32_t>(i));
        }
    }
    return regions;
}

double RegionShares::largest() const
{
    double most = 0.0;
    for (const auto& [cell, share] : cells)
        most = std::max(most, share);
    return most;
}

namespace
{

/// Volumes of material by cell, of the whole and of each region.
class ShareSums
{
public:
    ShareSums(const VoxelGrid& grid, const Pieces& pieces, std::size_t num_regions)
        : grid_(grid), pieces_(pieces), whole_(pieces.size(), 0.0), parts_(num_regions)
    {
        for (std::size_t i = 0; i < grid.size(); ++i)
            if (pieces.piece_of_voxel[i] >= 0)
                whole_[static_cast<std::size_t>(pieces.piece_of_voxel[i])] +=
                    volume(grid.coordinates(i));
    }

    void add(std::size_t region, std::size_t voxel)
    {
        parts_[region][pieces_.piece_of_voxel[voxel]] += volume(grid_.coordinates(voxel));
    }
    bool has_voxels(std::size_t region) const { return !parts_[region].empty(); }
    RegionShares shares(std::size_t region) const
    {
        RegionShares result;
        for (const auto& [cell, part] : parts_[region])
            result.cells.emplace_back(cell,
                                      part / whole_[static_cast<std::size_t>(cell)]);
        return result;
    }

private:
    double volume(const Eigen::Vector3i& v) const
    {
        double product = 1.0;
        for (int axis = 0; axis < 3; ++axis)
        {
            const std::vector<double>& lines = grid_.lines(axis);
            const std::size_t i = static_cast<std::size_t>(v[axis]);
            product *= lines[i + 1] - lines[i];
        }
        return product;
    }

    const VoxelGrid& grid_;
    const Pieces& pieces_;
    std::vector<double> whole_;
    std::vector<std::map<int, double>> parts_;
};

/// Range of voxels that bounds in model coordinates reach.
void voxel_range(const RegionShape& shape, const VoxelGrid& grid, const WorkFrame& frame,
                 Eigen::Vector3i& first, Eigen::Vector3i& last)
{
    first.setZero();
    last = grid.counts() - Eigen::Vector3i::Ones();
    if (!shape.low.allFinite() || !shape.high.allFinite())
        return;
    Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY), high = -low;
    for (int k = 0; k < 8; ++k)
    {
        const Eigen::Vector3d corner(k & 1 ? shape.high.x() : shape.low.x(),
                                     k & 2 ? shape.high.y() : shape.low.y(),
                                     k & 4 ? shape.high.z() : shape.low.z());
        const Eigen::Vector3d x = frame.to_work(corner);
        low = low.cwiseMin(x);
        high = high.cwiseMax(x);
    }
    if (!low.allFinite() || !high.allFinite())
        return;
    // One voxel more on each side: the test itself decides.
    first = (grid.locate(low).array() - 1).cwiseMax(0);
    last = (grid.locate(high).array() + 1).cwiseMin(last.array());
}

} // namespace

std::vector<RegionShares> region_shares(const std::vector<Region>& regions,
                                        const VoxelGrid& grid, const Pieces& pieces,
                                        const WorkFrame& frame,
                                        const std::vector<Eigen::Vector3d>& work_samples)
{
    ShareSums sums(grid, pieces, regions.size());
    // Voxels in the shapes, each once.
    std::vector<std::vector<std::size_t>> in_shapes(regions.size());
    parallel_for(
        regions.size(),
        [&](std::size_t r)
        {
            for (const RegionShape& shape : regions[r].shapes)
            {
                Eigen::Vector3i first, last;
                voxel_range(shape, grid, frame, first, last);
                for (int k = first.z(); k <= last.z(); ++k)
                    for (int j = first.y(); j <= last.y(); ++j)
                        for (int i = first.x(); i <= last.x(); ++i)
                        {
                            const std::size_t voxel = grid.index(i, j, k);
                            if (pieces.piece_of_voxel[voxel] >= 0 &&
                                shape.holds(frame.to_model(grid.centre({i, j, k}))))
                                in_shapes[r].push_back(voxel);
                        }
            }
            std::sort(in_shapes[r].begin(), in_shapes[r].end());
            in_shapes[r].erase(std::unique(in_shapes[r].begin(), in_shapes[r].end()),
                               in_shapes[r].end());
        });
    // Samples that stand for their voxels: listed ones, and all those of a region
    // that holds no voxel centre.
    std::vector<std::vector<std::uint32_t>> regions_of_sample(work_samples.size());
    bool has_lists = false;
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        const bool is_shape_empty = in_shapes[r].empty();
        const std::vector<std::uint32_t>& list =
            is_shape_empty ? regions[r].samples : regions[r].listed;
        for (const std::uint32_t i : list)
            regions_of_sample[i].push_back(static_cast<std::uint32_t>(r));
        has_lists |= !list.empty();
    }
    if (has_lists)
    {
        const std::vector<std::uint32_t> nearest = nearest_samples(grid, work_samples);
        for (std::size_t voxel = 0; voxel < grid.size(); ++voxel)
        {
            if (pieces.piece_of_voxel[voxel] < 0 || nearest[voxel] == kNoSample)
                continue;
            for (const std::uint32_t r : regions_of_sample[nearest[voxel]])
                if (!std::binary_search(in_shapes[r].begin(), in_shapes[r].end(), voxel))
                    sums.add(r, voxel);
        }
    }
    for (std::size_t r = 0; r < regions.size(); ++r)
        for (const std::size_t voxel : in_shapes[r])
            sums.add(r, voxel);
    std::vector<RegionShares> shares;
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        shares.push_back(sums.shares(r));
        // No voxel is nearest to any of its samples, because others outnumber them
        // or coincide with them: the cells that hold them stand for it.
        std::map<int, double> held;
        if (shares.back().cells.empty())
            for (const std::uint32_t i : regions[r].samples)
                held[pieces.piece_of_voxel[grid.index(grid.locate(work_samples[i]))]] =
                    kTokenShare;
        shares.back().cells.insert(shares.back().cells.end(), held.begin(), held.end());
    }
    return shares;
}

std::vector<int> prescribing_regions(const std::vector<Region>& regions,
                                     const std::vector<RegionShares>& shares,
                                     std::size_t num_cells, const std::string& file)
{
    std::vector<int> owner(num_cells, -1);
    std::vector<double> owned_share(num_cells, 0.0);
    std::vector<int> num_owned(regions.size(), 0);
    const auto take = [&](std::size_t region, int cell, double share)
    {
        const std::size_t c = static_cast<std::size_t>(cell);
        if (owner[c] >= 0)
        {
            if (share <= owned_share[c] + kSameShare)
                return;
            --num_owned[static_cast<std::size_t>(owner[c])];
        }
        owner[c] = static_cast<int>(region);
        owned_share[c] = share;
        ++num_owned[region];
    };
    std::vector<double> largest(regions.size());
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        largest[r] = shares[r].largest();
        for (const auto& [cell, share] : shares[r].cells)
            if (regions[r].prescribes() && share >= kMajority)
                take(r, cell, share);
    }
    // A region without a majority anywhere takes the cells it has most of, unless
    // a larger share holds them.
    for (std::size_t r = 0; r < regions.size(); ++r)
        for (const auto& [cell, share] : shares[r].cells)
            if (regions[r].prescribes() && largest[r] < kMajority &&
                share >= largest[r] - kSameShare)
                take(r, cell, share);
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        if (!regions[r].prescribes() || shares[r].cells.empty() || num_owned[r] > 0)
            continue;
        const auto most = std::max_element(shares[r].cells.begin(), shares[r].cells.end(),
                                           [](const auto& a, const auto& b)
                                           { return a.second < b.second; });
        const Region& other = regions[static_cast<std::size_t>(
            owner[static_cast<std::size_t>(most->first)])];
        throw Error(Fault::Unsolvable,
                    at({file, regions[r].line, regions[r].name},
                       "has no cell of its own: " + role_name(other.role) + " region " +
                           other.name + " holds cell " + std::to_string(most->first) +
                           " (smaller cells would part them: raise --across or "
                           "--max-depth)"));
    }
    return owner;
}

std::vector<double> cell_factors(const std::vector<Region>& regions,
                                 const std::vector<RegionShares>& shares,
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
            const std::size_t c = static_cast<std::size_t>(cell);
            if (share >= needed && share > best[c] + kSameShare)
            {
                best[c] = share;
                factors[c] = regions[r].factor;
            }
        }
    }
    return factors;
}

} // namespace cellwarp
