// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/bone_points.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <set>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Parts of a line, as shares of its length.
struct Interval
{
    double begin = 0.0, end = 1.0;
    bool is_empty() const { return !(end - begin > 1e-9); }
};

/// Places inside a cell at which it is asked whether the bone runs in its material.
constexpr int kProbes = 9;

/// What of a line lies in the box around a cell.
Interval in_bounds(const Lattice& lattice, int cell, const BoneLine& bone)
{
    Vector3d low = lattice.places[idx(lattice.cells[idx(cell)][0])], high = low;
    for (const int node : lattice.cells[idx(cell)])
    {
        low = low.cwiseMin(lattice.places[idx(node)]);
        high = high.cwiseMax(lattice.places[idx(node)]);
    }
    const Vector3d way = bone.to - bone.from;
    const double slack = 1e-9 * (high - low).maxCoeff();
    Interval out;
    for (int i = 0; i < 3; ++i)
        if (way[i] == 0.0)
        {
            if (bone.from[i] < low[i] - slack || bone.from[i] > high[i] + slack)
                return {1.0, 0.0};
        }
        else
        {
            const double a = (low[i] - bone.from[i]) / way[i],
                         b = (high[i] - bone.from[i]) / way[i];
            out.begin = std::max(out.begin, std::min(a, b));
            out.end = std::min(out.end, std::max(a, b));
        }
    return out;
}

bool is_inside(const Lattice& lattice, int cell, const Vector3d& x)
{
    constexpr double kSlack = 1e-9;
    const std::optional<Vector3d> local = local_place(lattice, cell, x);
    return local && local->minCoeff() >= -kSlack && local->maxCoeff() <= 1.0 + kSlack;
}

/// What of a line lies in a cell; of a bent cell one stretch of it.
Interval in_cell(const Lattice& lattice, int cell, const BoneLine& bone)
{
    Interval out = in_bounds(lattice, cell, bone);
    if (lattice.has_boxes || out.is_empty())
        return out;
    constexpr int kTries = 32, kHalvings = 50;
    const auto inside = [&](double t)
    { return is_inside(lattice, cell, bone.from + t * (bone.to - bone.from)); };
    const auto at = [&](int k) { return out.begin + (out.end - out.begin) * k / kTries; };
    int first = 0;
    while (first <= kTries && !inside(at(first)))
        ++first;
    if (first > kTries)
        return {1.0, 0.0};
    int last = first;
    while (last < kTries && inside(at(last + 1)))
        ++last;
    const auto border = [&](double in, double off)
    {
        for (int k = 0; k < kHalvings; ++k)
            (inside(0.5 * (in + off)) ? in : off) = 0.5 * (in + off);
        return in;
    };
    const Interval all = out;
    if (first > 0)
        out.begin =
            border(at(first), all.begin + (all.end - all.begin) * (first - 1) / kTries);
    if (last < kTries)
        out.end = border(all.begin + (all.end - all.begin) * last / kTries,
                         all.begin + (all.end - all.begin) * (last + 1) / kTries);
    return out;
}

/// Points whose equations are the same but for rounding have the same key.
std::vector<std::int64_t> key_of(const NodeShares& shares)
{
    constexpr double kDigits = 1e8;
    std::vector<std::int64_t> key;
    for (const NodeShare& share : shares)
        if (const std::int64_t digits = std::llround(kDigits * share.share); digits != 0)
        {
            key.push_back(share.node);
            key.push_back(digits);
        }
    return key;
}

} // namespace

std::vector<HeldPoint> points_on_bones(const Lattice& lattice,
                                       std::span<const BoneLine> bones,
                                       const HoldsPoint& holds)
{
    std::vector<HeldPoint> joints, crossings;
    std::set<std::vector<std::int64_t>> known;
    std::vector<std::pair<double, HeldPoint>> of_bone;
    for (const BoneLine& bone : bones)
    {
        of_bone.clear();
        const auto at = [&](double t) -> Vector3d
        { return bone.from + t * (bone.to - bone.from); };
        const auto add = [&](int cell, double t)
        {
            const Vector3d x = t <= 0.0 ? bone.from : (t >= 1.0 ? bone.to : at(t));
            const std::optional<Vector3d> local = local_place(lattice, cell, x);
            if (!local)
                return;
            of_bone.emplace_back(
                t, HeldPoint{shares_at(lattice, cell, local->cwiseMax(0.0).cwiseMin(1.0)),
                             x, bone.motion});
        };
        for (int cell = 0; cell < static_cast<int>(lattice.cells.size()); ++cell)
        {
            const Interval in = in_cell(lattice, cell, bone);
            if (in.is_empty())
                continue;
            bool is_own = false;
            for (int k = 0; k < kProbes && !is_own; ++k)
                is_own =
                    holds(cell, at(in.begin + (in.end - in.begin) * (k + 0.5) / kProbes));
            if (!is_own)
                continue;
            add(cell, in.begin);
            add(cell, in.end);
        }
        std::stable_sort(of_bone.begin(), of_bone.end(),
                         [](const auto& a, const auto& b) { return a.first < b.first; });
        for (auto& [t, point] : of_bone)
            (t <= 0.0 || t >= 1.0 ? joints : crossings).push_back(std::move(point));
    }
    std::vector<HeldPoint> points;
    for (std::vector<HeldPoint>* all : {&joints, &crossings})
        for (HeldPoint& point : *all)
            if (known.insert(key_of(point.shares)).second)
                points.push_back(std::move(point));
    return points;
}

} // namespace cellwarp::core
