// SPDX-License-Identifier: GPL-3.0-or-later
// The squared distance separates: along a line, with f the squared distance found on the
// axes before, d(p) = min_q (p - q)^2 + f(q). As only what is near counts, q goes
// outwards from p, up to the reach or until (p - q)^2 is as large as what was found. That
// takes more steps than the lower envelope of the parabolas (distance_transform.cpp), but
// each is done for the lines of a group, side by side in memory, at once.
//
// Where only what is near counts, a group of lines without any site is left as it is:
// zeros in memory that nobody has written yet.
#include "octree/near_distances.h"

#include <array>
#include <cmath>
#include <span>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

using Squared = std::uint16_t;

/// Beyond every reach; with the square of one added to it still a number.
constexpr Squared kBeyond = 32'762;
static_assert(NearDistances::kFarthest * NearDistances::kFarthest < kBeyond);
static_assert(kBeyond + NearDistances::kFarthest * NearDistances::kFarthest < 65'536);

/// What is kept of each voxel, as squared distances from and to: 1 more than it, 0
/// beyond the limit. kIsZeroSite: whether what is kept as 0 is a site, and stays so.
struct OfMarks
{
    static constexpr bool kIsZeroSite = false;
    Squared limit;
    Squared from(Squared kept) const
    {
        return kept == 0 ? kBeyond : static_cast<Squared>(kept - 1);
    }
    Squared to(Squared squared) const
    {
        return squared <= limit ? static_cast<Squared>(squared + 1) : Squared{0};
    }
};

/// Inside a set: the squared distance from what is outside of it, which itself has 0.
struct OfOutside
{
    static constexpr bool kIsZeroSite = true;
    Squared limit;
    Squared from(Squared kept) const { return kept; }
    Squared to(Squared squared) const { return squared <= limit ? squared : kBeyond; }
};

constexpr std::size_t kBeside = NearDistances::kGroup; ///< lines taken together
using Row = std::array<Squared, kBeside>;              ///< a number of each of them

/// From the sites of a line: the nearer of those before and after. False without any.
bool from_sites(std::span<const std::uint8_t> is_site, Squared limit,
                std::vector<Squared>& squared)
{
    constexpr int kTooFar = static_cast<int>(NearDistances::kFarthest) + 1;
    const int count = static_cast<int>(is_site.size());
    squared.assign(is_site.size(), kBeyond);
    bool has_any = false;
    const auto go = [&](int begin, int end, int step)
    {
        int since = kTooFar; // the last site
        for (int q = begin; q != end; q += step)
        {
            since = is_site[idx(q)] ? 0 : std::min(since + 1, kTooFar);
            has_any = has_any || since == 0;
            if (since * since <= limit)
                squared[idx(q)] =
                    std::min(squared[idx(q)], static_cast<Squared>(since * since));
        }
    };
    go(0, count, 1);
    go(count - 1, -1, -1);
    return has_any;
}

Squared largest(const Row& row)
{
    Squared most = 0;
    for (const Squared value : row)
        most = std::max(most, value);
    return most;
}

/// Lines side by side of which those at [q] of \p f follow each other: what is found at
/// \p q, from those within \p reach that \p has_sites tells of.
Row nearest(const std::vector<Row>& f, const std::vector<char>& has_sites, std::size_t q,
            std::size_t reach)
{
    Row least = f[q];
    const auto add = [&](std::size_t from, std::size_t way)
    {
        if (!has_sites[from])
            return;
        const Squared squared = static_cast<Squared>(way * way);
        const Row& row = f[from];
        for (std::size_t i = 0; i < kBeside; ++i)
            least[i] = std::min(least[i], static_cast<Squared>(row[i] + squared));
    };
    const std::size_t before = q, after = f.size() - 1 - q;
    for (std::size_t way = 1; way <= std::min(reach, std::max(before, after)); ++way)
    {
        // What is found is looked at now and then: that costs as much as a step.
        constexpr std::size_t kLook = 4;
        if (way % kLook == 1 && largest(least) <= way * way)
            break;
        if (way <= before)
            add(q - way, way);
        if (way <= after)
            add(q + way, way);
    }
    return least;
}

/// Lines along y or z that are side by side along x, one a group of voxels of each.
struct LineGroup
{
    Squared* first;           ///< value of the first line
    std::size_t beside;       ///< lines
    std::size_t count;        ///< values of a line
    std::size_t stride;       ///< from one of them to the next
    char* is_set;             ///< of the first of all lines: whether any is not 0
    std::size_t flags_stride; ///< from one of these to the next

    char& is_set_at(std::size_t q) const { return is_set[q * flags_stride]; }
};

/// Squared distances along the lines of a group, from those on the axes before.
template <class Coding>
void transform_group(const LineGroup& lines, std::size_t reach, const Coding& coding,
                     std::vector<Row>& f, std::vector<char>& has_sites)
{
    f.resize(lines.count);
    has_sites.resize(lines.count);
    for (std::size_t q = 0; q < lines.count; ++q)
    {
        f[q].fill(0); // where there are fewer lines the others hold nothing up
        const bool reads = lines.is_set_at(q) != 0;
        has_sites[q] = reads || Coding::kIsZeroSite;
        for (std::size_t i = 0; i < lines.beside; ++i)
            f[q][i] = coding.from(reads ? lines.first[q * lines.stride + i] : 0);
    }
    for (std::size_t q = 0; q < lines.count; ++q)
    {
        if (Coding::kIsZeroSite && !lines.is_set_at(q))
            continue;
        Row row = nearest(f, has_sites, q, reach);
        Squared any = 0;
        for (std::size_t i = 0; i < kBeside; ++i)
        {
            row[i] = coding.to(row[i]);
            any |= i < lines.beside ? row[i] : 0;
        }
        if (any == 0)
            continue;
        std::copy_n(row.begin(), lines.beside, lines.first + q * lines.stride);
        lines.is_set_at(q) = 1;
    }
}

/// Along x, then y, then z. \p first_line(line, squared) gives the squared distances
/// along x, or false: all are kept as 0. \p is_set: of every kBeside voxels along x
/// whether any is not 0 in the end.
template <class Coding, class FirstLine>
void transform(VoxelValues<Squared>& kept, const Eigen::Vector3i& counts, double reach,
               const Coding& coding, FirstLine&& first_line, std::vector<char>& is_set)
{
    const std::size_t nx = idx(counts.x()), ny = idx(counts.y()), nz = idx(counts.z());
    const std::size_t groups = (nx + kBeside - 1) / kBeside;
    is_set.assign(groups * ny * nz, 0);
    parallel_ranges(ny * nz, 64,
                    [&](std::size_t begin, std::size_t end)
                    {
                        std::vector<Squared> squared;
                        for (std::size_t line = begin; line < end; ++line)
                        {
                            if (!first_line(line, squared))
                                continue;
                            for (std::size_t x = 0; x < nx; ++x)
                                if (const Squared value = coding.to(squared[x]))
                                {
                                    kept[line * nx + x] = value;
                                    is_set[line * groups + x / kBeside] = 1;
                                }
                        }
                    });
    const auto sweep =
        [&](std::size_t planes, std::size_t plane_stride, std::size_t stride, int length)
    {
        parallel_ranges(
            planes * groups, 4,
            [&](std::size_t begin, std::size_t end)
            {
                std::vector<Row> f;
                std::vector<char> has_sites;
                for (std::size_t group = begin; group < end; ++group)
                {
                    const std::size_t x = group % groups * kBeside;
                    const std::size_t plane = group / groups * plane_stride;
                    const LineGroup lines{kept.data() + plane + x,
                                          std::min(kBeside, nx - x),
                                          idx(length),
                                          stride,
                                          &is_set[plane / nx * groups + group % groups],
                                          stride / nx * groups};
                    bool is_any = false;
                    for (std::size_t q = 0; q < lines.count; ++q)
                        is_any = is_any || lines.is_set_at(q);
                    if (is_any)
                        transform_group(lines, static_cast<std::size_t>(reach), coding, f,
                                        has_sites);
                }
            });
    };
    sweep(nz, nx * ny, nx, counts.y());
    sweep(ny, nx, nx * ny, counts.z());
}

/// What is at most \p reach away, squared.
Squared limit_of(double reach)
{
    return static_cast<Squared>(std::floor(reach * reach));
}

} // namespace

NearDistances::NearDistances(const VoxelFlags& marks, const Eigen::Vector3i& counts,
                             double reach)
    : nx_(idx(counts.x())), codes_(marks.size())
{
    reach = std::min(reach, kFarthest);
    const OfMarks coding{limit_of(reach)};
    transform(
        codes_, counts, reach, coding,
        [&](std::size_t line, std::vector<Squared>& squared)
        {
            return !marks.is_zero(line * nx_, (line + 1) * nx_) &&
                   from_sites(marks.part(line * nx_, (line + 1) * nx_), coding.limit,
                              squared);
        },
        is_near_);
}

void shrink(VoxelFlags& set, const Eigen::Vector3i& counts, int reach)
{
    const double most = std::min<double>(reach, NearDistances::kFarthest);
    const OfOutside coding{limit_of(most)};
    const std::size_t nx = idx(counts.x());
    VoxelValues<Squared> depths(set.size());
    std::vector<char> is_set;
    transform(
        depths, counts, most, coding,
        [&](std::size_t line, std::vector<Squared>& squared)
        {
            if (set.is_zero(line * nx, (line + 1) * nx))
                return false;
            std::vector<std::uint8_t> is_outside(nx);
            for (std::size_t x = 0; x < nx; ++x)
                is_outside[x] = set[line * nx + x] == 0;
            from_sites(is_outside, coding.limit, squared);
            return true;
        },
        is_set);
    parallel_for_each_set(set,
                          [&](std::size_t voxel)
                          {
                              if (depths[voxel] != kBeyond)
                                  set[voxel] = 0;
                          });
}

} // namespace cellwarp::core
