// SPDX-License-Identifier: GPL-3.0-or-later
// The squared distance separates: along a line, with f the squared distance found
// on the axes before, d(p) = min_q (p - q)^2 + f(q) is the lower envelope of
// parabolas, which a stack builds in one sweep.
#include "octree/distance_transform.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

constexpr float kFar = std::numeric_limits<float>::infinity();

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

/// Lines along one axis whose values stand apart in memory, \p beside of them side by
/// side: they are taken over together, each into a row of its own, so that no line of
/// the cache is fetched for one number.
template <class Value>
void gather(const Value* from, std::size_t stride, int count, std::size_t beside,
            std::vector<Value>& rows)
{
    rows.resize(beside * idx(count));
    for (std::size_t q = 0; q < idx(count); ++q)
        for (std::size_t line = 0; line < beside; ++line)
            rows[line * idx(count) + q] = from[q * stride + line];
}

/// Back again.
template <class Value>
void scatter(const std::vector<Value>& rows, std::size_t stride, int count,
             std::size_t beside, Value* to)
{
    for (std::size_t q = 0; q < idx(count); ++q)
        for (std::size_t line = 0; line < beside; ++line)
            to[q * stride + line] = rows[line * idx(count) + q];
}

/// Along x, then y, then z, from values that are 0 or infinite.
void transform(std::vector<float>& d, std::int32_t* labels, const Eigen::Vector3i& counts)
{
    const std::size_t nx = idx(counts.x());
    const std::size_t ny = idx(counts.y());
    const std::size_t nz = idx(counts.z());
    parallel_ranges(ny * nz, 64,
                    [&](std::size_t begin, std::size_t end)
                    {
                        LineScratch scratch;
                        for (std::size_t line = begin; line < end; ++line)
                            transform_first_line(&d[line * nx],
                                                 labels ? labels + line * nx : nullptr,
                                                 counts.x(), scratch);
                    });
    constexpr std::size_t kBeside = 32; // lines taken together
    const std::size_t groups = (nx + kBeside - 1) / kBeside;
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
                    const std::size_t first = group / groups * plane_stride + x;
                    gather(&d[first], stride, count, beside, rows);
                    if (labels)
                        gather(labels + first, stride, count, beside, of_labels);
                    for (std::size_t line = 0; line < beside; ++line)
                        transform_line(&rows[line * idx(count)],
                                       labels ? &of_labels[line * idx(count)] : nullptr,
                                       count, scratch);
                    scatter(rows, stride, count, beside, &d[first]);
                    if (labels)
                        scatter(of_labels, stride, count, beside, labels + first);
                }
            });
    };
    sweep(nz, nx * ny, nx, counts.y());
    sweep(ny, nx, nx * ny, counts.z());
}

} // namespace

std::vector<float> squared_distances(const VoxelFlags& marks,
                                     const Eigen::Vector3i& counts)
{
    std::vector<float> d(marks.size());
    for (std::size_t i = 0; i < marks.size(); ++i)
        d[i] = marks[i] ? 0.0f : kFar;
    transform(d, nullptr, counts);
    return d;
}

void spread_labels(std::vector<std::int32_t>& labels, const Eigen::Vector3i& counts)
{
    std::vector<float> d(labels.size());
    for (std::size_t i = 0; i < labels.size(); ++i)
        d[i] = labels[i] >= 0 ? 0.0f : kFar;
    transform(d, labels.data(), counts);
}

} // namespace cellwarp::core
