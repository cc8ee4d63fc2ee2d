// SPDX-License-Identifier: GPL-3.0-or-later
// The squared distance separates: along a line, with f the squared distance found
// on the axes before, d(p) = min_q (p - q)^2 + f(q) is the lower envelope of
// parabolas, which a stack builds in one sweep.
#include "octree/distance_transform.h"

#include <limits>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp
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

/// One line of \p count values, \p stride apart, in place, and of their labels if there
/// are any.
void transform_line(float* values, std::int32_t* labels, std::size_t stride, int count,
                    LineScratch& scratch)
{
    auto& [f, from, site, known] = scratch;
    f.resize(idx(count));
    site.resize(idx(count));
    from.resize(idx(count) + 1);
    int top = -1;
    for (int q = 0; q < count; ++q)
    {
        const std::size_t at = idx(q);
        f[at] = values[at * stride];
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
    known.clear();
    for (std::size_t q = 0; labels && q < f.size(); ++q)
        known.push_back(labels[q * stride]);
    int next = 0;
    for (int q = 0; q < count; ++q)
    {
        while (next < top && from[idx(next) + 1] < static_cast<float>(q))
            ++next;
        const int p = site[idx(next)];
        const float d = static_cast<float>(q - p);
        values[idx(q) * stride] = d * d + f[idx(p)];
        if (labels)
            labels[idx(q) * stride] = known[idx(p)];
    }
}

/// Along x, then y, then z.
void transform(std::vector<float>& d, std::int32_t* labels, const Eigen::Vector3i& counts)
{
    const std::size_t nx = idx(counts.x());
    const std::size_t ny = idx(counts.y());
    const std::size_t nz = idx(counts.z());
    const auto sweep = [&](std::size_t lines, std::size_t stride, int count, auto first)
    {
        parallel_ranges(lines, 64,
                        [&](std::size_t begin, std::size_t end)
                        {
                            LineScratch scratch;
                            for (std::size_t line = begin; line < end; ++line)
                                transform_line(d.data() + first(line),
                                               labels ? labels + first(line) : nullptr,
                                               stride, count, scratch);
                        });
    };
    sweep(ny * nz, 1, counts.x(), [=](std::size_t line) { return line * nx; });
    sweep(nx * nz, nx, counts.y(),
          [=](std::size_t line) { return line / nx * nx * ny + line % nx; });
    sweep(nx * ny, nx * ny, counts.z(), [=](std::size_t line) { return line; });
}

} // namespace

std::vector<float> squared_distances(const std::vector<std::uint8_t>& marks,
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

} // namespace cellwarp
