// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/regions.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <map>
#include <unordered_set>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "io/error.h"
#include "io/number.h"
#include "octree/nearest_sample.h"

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
                }};
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
                [=](const Eigen::Vector3d& x) { return from_axis(x) - r; }};
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
    explicit Twins(const std::vector<Eigen::Vector3d>& samples, double tolerance)
        : samples_(samples), tolerance_(tolerance)
    {
    }

    std::vector<std::uint32_t> of(const std::vector<std::uint32_t>& listed) const
    {
        // Cells far larger than the tolerance: only a sample that lies within it of
        // a cell's border must look into the next cell.
        std::map<std::array<double, 3>, std::vector<std::uint32_t>> cells;
        for (const std::uint32_t i : listed)
            cells[key(samples_[i])].push_back(i);
        std::vector<std::uint32_t> all;
        for (std::size_t i = 0; i < samples_.size(); ++i)
            if (has_near(cells, samples_[i]))
                all.push_back(static_cast<std::uint32_t>(i));
        return all;
    }

private:
    static constexpr double kCell = 1024.0; ///< [tolerance]

    std::array<double, 3> key(const Eigen::Vector3d& x) const
    {
        std::array<double, 3> k{};
        for (int axis = 0; axis < 3; ++axis)
            k[static_cast<std::size_t>(axis)] =
                tolerance_ > 0 ? std::floor(x[axis] / (kCell * tolerance_)) : x[axis];
        return k;
    }
    bool
    has_near(const std::map<std::array<double, 3>, std::vector<std::uint32_t>>& cells,
             const Eigen::Vector3d& x) const
    {
        const std::array<double, 3> low = key(x - Eigen::Vector3d::Constant(tolerance_));
        const std::array<double, 3> high = key(x + Eigen::Vector3d::Constant(tolerance_));
        for (const double i : {low[0], high[0]})
            for (const double j : {low[1], high[1]})
                for (const double k : {low[2], high[2]})
                {
                    const auto found = cells.find({i, j, k});
                    if (found == cells.end())
                        continue;
                    for (const std::uint32_t other : found->second)
                        if ((samples_[other] - x).norm() <= tolerance_)
                            return true;
                }
        return false;
    }

    const std::vector<Eigen::Vector3d>& samples_;
    double tolerance_;
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
    const Twins twins(samples, kTwin * units.box.size().norm());
    for (Region& region : regions)
    {
        if (!region.listed.empty())
            region.listed = twins.of(region.listed);
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

RegionShares region_shares(const Region& region, const VoxelGrid& grid,
                           const Pieces& pieces, const WorkFrame& frame,
                           const std::vector<Eigen::Vector3d>& work_samples,
                           std::vector<std::uint32_t>& nearest)
{
    const auto volume = [&](const Eigen::Vector3i& v)
    {
        double product = 1.0;
        for (int axis = 0; axis < 3; ++axis)
        {
            const std::vector<double>& lines = grid.lines(axis);
            const std::size_t i = static_cast<std::size_t>(v[axis]);
            product *= lines[i + 1] - lines[i];
        }
        return product;
    };
    // One slice of voxels at a time; slices are added in their order.
    const std::size_t slice = static_cast<std::size_t>(grid.counts().x()) *
                              static_cast<std::size_t>(grid.counts().y());
    const auto gather = [&](const std::vector<std::uint32_t>& list, bool with_shapes)
    {
        std::vector<bool> is_listed;
        if (!list.empty())
        {
            if (nearest.empty())
                nearest = nearest_samples(grid, work_samples);
            is_listed.assign(work_samples.size(), false);
            for (const std::uint32_t i : list)
                is_listed[i] = true;
        }
        std::vector<std::uint8_t> is_inside(grid.size(), 0);
        tbb::parallel_for(
            0, grid.counts().z(),
            [&](int k)
            {
                const std::size_t first = slice * static_cast<std::size_t>(k);
                for (std::size_t i = first; i < first + slice; ++i)
                {
                    if (pieces.piece_of_voxel[i] < 0)
                        continue;
                    if (!list.empty() && nearest[i] != kNoSample && is_listed[nearest[i]])
                        is_inside[i] = 1;
                    else if (with_shapes && !region.shapes.empty() &&
                             region.holds(
                                 frame.to_model(grid.centre(grid.coordinates(i)))))
                        is_inside[i] = 1;
                }
            });
        RegionShares shares;
        shares.of_cell.assign(pieces.size(), 0.0);
        std::vector<double> whole(pieces.size(), 0.0);
        for (std::size_t i = 0; i < grid.size(); ++i)
        {
            const std::int32_t piece = pieces.piece_of_voxel[i];
            if (piece < 0)
                continue;
            const double v = volume(grid.coordinates(i));
            whole[static_cast<std::size_t>(piece)] += v;
            if (is_inside[i])
            {
                shares.of_cell[static_cast<std::size_t>(piece)] += v;
                shares.has_voxels = true;
            }
        }
        for (std::size_t c = 0; c < whole.size(); ++c)
            shares.of_cell[c] /= whole[c];
        return shares;
    };
    RegionShares shares = gather(region.listed, true);
    if (!shares.has_voxels && !region.samples.empty())
        shares = gather(region.samples, false);
    if (!shares.has_voxels && !region.samples.empty())
        // Its samples are nearest to no voxel: others coincide with or outnumber
        // them. The cells that hold them stand for it.
        for (const std::uint32_t i : region.samples)
        {
            const std::int32_t piece =
                pieces.piece_of_voxel[grid.index(grid.locate(work_samples[i]))];
            shares.of_cell[static_cast<std::size_t>(piece)] = 1e-3;
            shares.has_voxels = true;
        }
    return shares;
}

std::vector<int> prescribing_regions(const std::vector<Region>& regions,
                                     const std::vector<RegionShares>& shares,
                                     const std::string& file)
{
    const std::size_t num_cells = shares.empty() ? 0 : shares.front().of_cell.size();
    std::vector<int> owner(num_cells, -1);
    std::vector<double> owned_share(num_cells, 0.0);
    std::vector<int> num_owned(regions.size(), 0);
    const auto take = [&](std::size_t region, std::size_t cell, double share)
    {
        if (owner[cell] >= 0)
        {
            if (share <= owned_share[cell] + kSameShare)
                return;
            --num_owned[static_cast<std::size_t>(owner[cell])];
        }
        owner[cell] = static_cast<int>(region);
        owned_share[cell] = share;
        ++num_owned[region];
    };
    std::vector<bool> reaches_majority(regions.size(), false);
    for (std::size_t r = 0; r < regions.size(); ++r)
        for (std::size_t c = 0; regions[r].prescribes() && c < num_cells; ++c)
            if (shares[r].of_cell[c] >= kMajority)
            {
                reaches_majority[r] = true;
                take(r, c, shares[r].of_cell[c]);
            }
    // A region without a majority anywhere takes the cells it has most of, unless
    // a larger share holds them.
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        if (!regions[r].prescribes() || reaches_majority[r] || !shares[r].has_voxels)
            continue;
        const double largest =
            *std::max_element(shares[r].of_cell.begin(), shares[r].of_cell.end());
        for (std::size_t c = 0; c < num_cells; ++c)
            if (shares[r].of_cell[c] > 0 && shares[r].of_cell[c] >= largest - kSameShare)
                take(r, c, shares[r].of_cell[c]);
    }
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        if (!regions[r].prescribes() || !shares[r].has_voxels || num_owned[r] > 0)
            continue;
        const std::size_t cell = static_cast<std::size_t>(
            std::max_element(shares[r].of_cell.begin(), shares[r].of_cell.end()) -
            shares[r].of_cell.begin());
        const Region& other = regions[static_cast<std::size_t>(owner[cell])];
        throw Error(Fault::Unsolvable,
                    at({file, regions[r].line, regions[r].name},
                       "has no cell of its own: " + role_name(other.role) + " region " +
                           other.name + " holds cell " + std::to_string(cell) +
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
        if (regions[r].role != Role::Stiff || !shares[r].has_voxels)
            continue;
        if (factors.empty())
            factors.assign(num_cells, 1.0);
        const double largest =
            *std::max_element(shares[r].of_cell.begin(), shares[r].of_cell.end());
        const double needed = largest >= kMajority ? kMajority : largest - kSameShare;
        for (std::size_t c = 0; c < num_cells; ++c)
            if (shares[r].of_cell[c] >= needed &&
                shares[r].of_cell[c] > best[c] + kSameShare)
            {
                best[c] = shares[r].of_cell[c];
                factors[c] = regions[r].factor;
            }
    }
    return factors;
}

} // namespace cellwarp
