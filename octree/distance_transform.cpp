// SPDX-License-Identifier: GPL-3.0-or-later
// The squared distance separates: along a line, with f the squared distance found
// on the axes before, d(p) = min_q (p - q)^2 + f(q) is the lower envelope of
// parabolas, which a stack builds in one sweep. Where only what is near counts, a line
// without any site is left as it is: zeros in memory that nobody has written yet.
#include "octree/distance_transform.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp
{

namespace
{

constexpr float kFar = std::numeric_limits<float>::infinity();

constexpr std::size_t kBeside = NearDistances::kGroup; ///< lines taken together

/// What a line is transformed in.
struct LineScratch
{
    std::vector<float> f, from;
    std::vector<int> site;
    std::vector<std::int32_t> labels;
};

/// One line of \p count values in place, and of their labels if there are any.
void transform_line(float* values, std::int32_t* labels, int count, LineScratch& scratch)
{
    auto& [f, from, site, known] = scratch;
    f.assign(values, values + count);
    site.resize(idx(count));
    from.resize(idx(count) + 1);
    int top = -1;
    for (int q = 0; q < count; ++q)
    {
        const std::size_t at = idx(q);
        if (f[at] == kFar)
            continue;
        float start = -kFar;
        while (top >= 0)
        {
            const std::size_t p = idx(site[idx(top)]);
            const float fq = f[at] + static_cast<float>(q) * static_cast<float>(q);
            const float fp = f[p] + static_cast<float>(p) * static_cast<float>(p);
            start = (fq - fp) / (2.0f * static_cast<float>(q - static_cast<int>(p)));
            if (start > from[idx(top)])
                break;
            --top;
        }
        if (top < 0)
            start = -kFar;
        ++top;
        site[idx(top)] = q;
        from[idx(top)] = start;
    }
    if (top < 0)
        return;
    if (labels)
        known.assign(labels, labels + count);
    int next = 0;
    for (int q = 0; q < count; ++q)
    {
        while (next < top && from[idx(next) + 1] < static_cast<float>(q))
            ++next;
        const int p = site[idx(next)];
        const float d = static_cast<float>(q - p);
        values[q] = d * d + f[idx(p)];
        if (labels)
            labels[q] = known[idx(p)];
    }
}

/// The same for a line whose values are 0 or infinite, as all are along the first axis:
/// the nearer of the sites before and after, the one before where both are as near.
void transform_first_line(float* values, std::int32_t* labels, int count,
                          LineScratch& scratch)
{
    std::vector<int>& before = scratch.site;
    before.resize(idx(count));
    int site = -1;
    for (int q = 0; q < count; ++q)
    {
        if (values[q] == 0.0f)
            site = q;
        before[idx(q)] = site;
    }
    if (site < 0)
        return;
    int after = -1;
    for (int q = count; q-- > 0;)
    {
        const int p = before[idx(q)];
        if (p == q)
            after = q;
        const bool is_before = p >= 0 && (after < 0 || q - p <= after - q);
        const int nearest = is_before ? p : after;
        const float d = static_cast<float>(q - nearest);
        values[q] = d * d;
        if (labels)
            labels[q] = labels[nearest];
    }
}

/// What is kept of each voxel, as squared distances from and to: as they are.
struct Plain
{
    using Kept = float;
    float from(float kept) const { return kept; }
    float to(float squared) const { return squared; }
};

/// Up to a limit: 1 more than the squared distance, 0 beyond.
struct UpTo
{
    using Kept = std::uint32_t;
    float limit;
    float from(Kept kept) const
    {
        return kept == 0 ? kFar : static_cast<float>(kept - 1);
    }
    Kept to(float squared) const
    {
        return squared <= limit ? static_cast<Kept>(squared) + 1 : 0;
    }
};

/// Inside a set: the squared distance from what is outside of it, which itself has 0, or
/// 1 << 31 beyond a limit.
struct Depth
{
    using Kept = std::uint32_t;
    static constexpr Kept kDeep = Kept{1} << 31;
    float limit;
    float from(Kept kept) const
    {
        return kept == kDeep ? kFar : static_cast<float>(kept);
    }
    Kept to(float squared) const
    {
        return squared <= limit ? static_cast<Kept>(squared) : kDeep;
    }
};

/// Lines along one axis whose values stand apart in memory, \p beside of them side by
/// side: they are taken over together, each into a row of its own, so that no line of
/// the cache is fetched for one number. \p is_set(q): whether any of those of q is not 0;
/// others are not read, since memory that nobody has written has to be provided for that.
template <class From, class To, class Convert, class IsSet>
void gather(const From* from, std::size_t stride, int count, std::size_t beside,
            std::vector<To>& rows, Convert&& convert, IsSet&& is_set)
{
    rows.resize(beside * idx(count));
    const To zero = convert(From{});
    for (std::size_t q = 0; q < idx(count); ++q)
    {
        const bool reads = is_set(q);
        for (std::size_t line = 0; line < beside; ++line)
            rows[line * idx(count) + q] = reads ? convert(from[q * stride + line]) : zero;
    }
}

/// Back again. Without \p with_zeros zeros are left out, since no value becomes 0 that
/// was not, and they take no memory. Calls wrote(q) where there is another value.
template <class From, class To, class Convert, class Wrote>
void scatter(const std::vector<From>& rows, std::size_t stride, int count,
             std::size_t beside, To* to, bool with_zeros, Convert&& convert,
             Wrote&& wrote)
{
    for (std::size_t q = 0; q < idx(count); ++q)
    {
        bool is_set = false;
        for (std::size_t line = 0; line < beside; ++line)
        {
            const To value = convert(rows[line * idx(count) + q]);
            if (value == To{} && !with_zeros)
                continue;
            to[q * stride + line] = value;
            is_set = is_set || value != To{};
        }
        if (is_set)
            wrote(q);
    }
}

/// Along x, then y, then z. \p first_row(line, row) gives the values of a line along x,
/// 0 or infinite each, or false: all are kept as 0. Lines of zeros stay so and take no
/// time. \p is_set: of every kBeside voxels along x whether any is not 0 in the end.
template <class Coding, class FirstRow>
void transform(typename Coding::Kept* d, std::int32_t* labels,
               const Eigen::Vector3i& counts, const Coding& coding, FirstRow&& first_row,
               std::vector<char>& is_set)
{
    using Kept = typename Coding::Kept;
    const std::size_t nx = idx(counts.x());
    const std::size_t ny = idx(counts.y());
    const std::size_t nz = idx(counts.z());
    const std::size_t groups = (nx + kBeside - 1) / kBeside;
    is_set.assign(groups * ny * nz, 0);
    const auto unchanged = [](std::int32_t label) { return label; };
    const auto from = [&](Kept kept) { return coding.from(kept); };
    const auto to = [&](float squared) { return coding.to(squared); };
    parallel_ranges(
        ny * nz, 64,
        [&](std::size_t begin, std::size_t end)
        {
            LineScratch scratch;
            std::vector<float> row;
            for (std::size_t line = begin; line < end; ++line)
            {
                if (!first_row(line, row))
                    continue;
                transform_first_line(row.data(), labels ? labels + line * nx : nullptr,
                                     counts.x(), scratch);
                scatter(row, 1, counts.x(), 1, d + line * nx, false, to,
                        [&](std::size_t x) { is_set[line * groups + x / kBeside] = 1; });
            }
        });
    // Lines side by side along x, in groups.
    const auto sweep =
        [&](std::size_t planes, std::size_t plane_stride, std::size_t stride, int count)
    {
        parallel_ranges(
            planes * groups, 4,
            [&](std::size_t begin, std::size_t end)
            {
                LineScratch scratch;
                std::vector<float> rows;
                std::vector<std::int32_t> of_labels;
                for (std::size_t group = begin; group < end; ++group)
                {
                    const std::size_t x = group % groups * kBeside;
                    const std::size_t beside = std::min(kBeside, nx - x);
                    const std::size_t plane = group / groups * plane_stride;
                    char* const of_lines = &is_set[plane / nx * groups + group % groups];
                    const std::size_t step = stride / nx * groups;
                    bool is_any = false;
                    for (std::size_t q = 0; q < idx(count); ++q)
                        is_any = is_any || of_lines[q * step];
                    if (!is_any)
                        continue;
                    const std::size_t first = plane + x;
                    gather(d + first, stride, count, beside, rows, from,
                           [&](std::size_t q) { return of_lines[q * step] != 0; });
                    if (labels)
                        gather(labels + first, stride, count, beside, of_labels,
                               unchanged, [](std::size_t) { return true; });
                    for (std::size_t line = 0; line < beside; ++line)
                        transform_line(&rows[line * idx(count)],
                                       labels ? &of_labels[line * idx(count)] : nullptr,
                                       count, scratch);
                    scatter(rows, stride, count, beside, d + first, false, to,
                            [&](std::size_t q) { of_lines[q * step] = 1; });
                    if (labels)
                        scatter(of_labels, stride, count, beside, labels + first, true,
                                unchanged, [](std::size_t) {});
                }
            });
    };
    sweep(nz, nx * ny, nx, counts.y());
    sweep(ny, nx, nx * ny, counts.z());
}

/// Of all voxels, from values that are 0 or infinite.
void transform_all(std::vector<float>& d, std::int32_t* labels,
                   const Eigen::Vector3i& counts)
{
    const std::size_t nx = idx(counts.x());
    std::vector<char> is_set;
    transform(
        d.data(), labels, counts, Plain{},
        [&](std::size_t line, std::vector<float>& row)
        {
            const auto begin = d.begin() + static_cast<std::ptrdiff_t>(line * nx);
            row.assign(begin, begin + counts.x());
            return true;
        },
        is_set);
}

/// The values of a line along x: \p set and \p other for voxels that are not 0 and are
/// in \p flags. False if all are 0.
bool row_of(const VoxelFlags& flags, std::size_t line, std::size_t nx, float set,
            float other, std::vector<float>& row)
{
    if (flags.is_zero(line * nx, (line + 1) * nx))
        return false;
    const std::span<const std::uint8_t> of_line = flags.part(line * nx, (line + 1) * nx);
    row.resize(nx);
    std::transform(of_line.begin(), of_line.end(), row.begin(),
                   [&](std::uint8_t flag) { return flag ? set : other; });
    return true;
}

/// What is at most \p reach away, squared; between two whole numbers, so that nothing
/// rounds across.
float limit_of(double reach)
{
    return static_cast<float>(std::floor(reach * reach) + 0.5);
}

} // namespace

std::vector<float> squared_distances(const VoxelFlags& marks,
                                     const Eigen::Vector3i& counts)
{
    std::vector<float> d(marks.size());
    for (std::size_t i = 0; i < marks.size(); ++i)
        d[i] = marks[i] ? 0.0f : kFar;
    transform_all(d, nullptr, counts);
    return d;
}

NearDistances::NearDistances(const VoxelFlags& marks, const Eigen::Vector3i& counts,
                             double reach)
    : nx_(idx(counts.x())), codes_(marks.size())
{
    transform(
        codes_.data(), nullptr, counts, UpTo{limit_of(reach)},
        [&](std::size_t line, std::vector<float>& row)
        { return row_of(marks, line, nx_, 0.0f, kFar, row); },
        is_near_);
}

void shrink(VoxelFlags& set, const Eigen::Vector3i& counts, int reach)
{
    VoxelValues<std::uint32_t> depths(set.size());
    std::vector<char> is_set;
    transform(
        depths.data(), nullptr, counts, Depth{limit_of(reach)},
        [&](std::size_t line, std::vector<float>& row)
        { return row_of(set, line, idx(counts.x()), kFar, 0.0f, row); },
        is_set);
    parallel_for_each_set(set,
                          [&](std::size_t voxel)
                          {
                              if (depths[voxel] != Depth::kDeep)
                                  set[voxel] = 0;
                          });
}

void spread_labels(std::vector<std::int32_t>& labels, const Eigen::Vector3i& counts)
{
    std::vector<float> d(labels.size());
    for (std::size_t i = 0; i < labels.size(); ++i)
        d[i] = labels[i] >= 0 ? 0.0f : kFar;
    transform_all(d, labels.data(), counts);
}

} // namespace cellwarp
