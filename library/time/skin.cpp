// SPDX-License-Identifier: GPL-3.0-or-later
// F(x) = sum over balls c of (1 - |x - c|^2 / 4 R^2)^3 where that is positive. Along a
// line of balls a distance d apart, at R from it, F = int (3/4 - t^2 / 4 R^2)^3 dt / d =
// 0.668077 R / d: the surface.
//
// Surface nets: each cell of a grid whose corners are on both sides has a vertex, in the
// middle of where its edges cross; each edge that crosses has a quad of the four cells
// around it. Vertices are then brought onto the surface along its gradient. Only cells
// that a ball reaches exist.
#include "library/time/skin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <unordered_map>
#include <vector>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

constexpr double kLevel = 0.668077 / 0.5; // of balls half a radius apart
constexpr double kCell = 0.4;             // of the radius
constexpr int kSteps = 3;

using SkinCube = std::array<std::int32_t, 3>;

std::uint64_t key_of(const SkinCube& cell)
{
    constexpr std::uint64_t kHalf = std::uint64_t(1) << 20;
    std::uint64_t key = 0;
    for (const std::int32_t c : cell)
        key = key << 21 |
              ((static_cast<std::uint64_t>(std::int64_t(c)) + kHalf) & 0x1FFFFF);
    return key;
}

/// The balls, by cells as wide as they reach.
class SkinField
{
public:
    SkinField(std::span<const Vector3d> centres, double radius)
        : centres_(centres), reach_(2.0 * radius)
    {
        for (std::size_t k = 0; k < centres.size(); ++k)
            balls_[key_of(cell_of(centres[k]))].push_back(static_cast<std::uint32_t>(k));
    }
    /// F and its gradient.
    double at(const Vector3d& x, Vector3d& gradient) const
    {
        double sum = 0.0;
        gradient.setZero();
        const SkinCube at = cell_of(x);
        for (int i = -1; i <= 1; ++i)
            for (int j = -1; j <= 1; ++j)
                for (int k = -1; k <= 1; ++k)
                {
                    const auto found =
                        balls_.find(key_of({at[0] + i, at[1] + j, at[2] + k}));
                    if (found == balls_.end())
                        continue;
                    for (const std::uint32_t ball : found->second)
                    {
                        const Vector3d way = x - centres_[ball];
                        const double left = 1.0 - way.squaredNorm() / (reach_ * reach_);
                        if (left <= 0.0)
                            continue;
                        sum += left * left * left;
                        gradient -= 6.0 * left * left / (reach_ * reach_) * way;
                    }
                }
        return sum;
    }

private:
    SkinCube cell_of(const Vector3d& x) const
    {
        SkinCube out;
        for (std::size_t c = 0; c < 3; ++c)
            out[c] = static_cast<std::int32_t>(
                std::floor(x[static_cast<Eigen::Index>(c)] / reach_));
        return out;
    }

    std::span<const Vector3d> centres_;
    double reach_;
    std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> balls_;
};

} // namespace

void add_skin(std::span<const Vector3d> centres, double radius, const Colour& colour,
              Geometry& out)
{
    if (centres.empty())
        return;
    const double h = kCell * radius, reach = 2.0 * radius;
    // Corners of the grid that balls reach count from the first of them.
    Vector3d low = centres[0], high = centres[0];
    for (const Vector3d& c : centres)
    {
        low = low.cwiseMin(c);
        high = high.cwiseMax(c);
    }
    low.array() -= reach + h;
    if (((high - low).array() + reach > h * double(1 << 20)).any())
        throw std::invalid_argument("a skin so fine over so far is out of range");
    std::unordered_map<std::uint64_t, double> values;
    std::vector<SkinCube> corners; // in the order in which balls reach them
    for (const Vector3d& c : centres)
    {
        SkinCube first, last;
        for (std::size_t a = 0; a < 3; ++a)
        {
            const double at =
                c[static_cast<Eigen::Index>(a)] - low[static_cast<Eigen::Index>(a)];
            first[a] = static_cast<std::int32_t>(std::ceil((at - reach) / h));
            last[a] = static_cast<std::int32_t>(std::floor((at + reach) / h));
        }
        for (std::int32_t i = first[0]; i <= last[0]; ++i)
            for (std::int32_t j = first[1]; j <= last[1]; ++j)
                for (std::int32_t k = first[2]; k <= last[2]; ++k)
                {
                    const double left =
                        1.0 -
                        (low + h * Vector3d(i, j, k) - c).squaredNorm() / (reach * reach);
                    if (left <= 0.0)
                        continue;
                    const auto [value, is_new] =
                        values.try_emplace(key_of({i, j, k}), 0.0);
                    value->second += left * left * left;
                    if (is_new)
                        corners.push_back({i, j, k});
                }
        if (values.size() > kMostSkinCells)
            throw std::invalid_argument("a skin of more than 50 million cells");
    }
    const auto value_at = [&](const SkinCube& corner)
    {
        const auto found = values.find(key_of(corner));
        return found == values.end() ? 0.0 : found->second;
    };
    const SkinField field(centres, radius);
    out.groups.push_back({"skin", out.num_faces(), 0});
    std::unordered_map<std::uint64_t, std::uint32_t> vertices; // of cells
    const auto vertex_of = [&](const SkinCube& cell)
    {
        const auto [found, is_new] = vertices.try_emplace(
            key_of(cell), static_cast<std::uint32_t>(out.samples.size()));
        if (!is_new)
            return found->second;
        std::array<double, 8> at;
        const auto place = [](int n) { return Vector3d(n & 1, n >> 1 & 1, n >> 2); };
        for (int n = 0; n < 8; ++n)
            at[idx(n)] = value_at({cell[0] + (n & 1), cell[1] + (n >> 1 & 1),
                                   cell[2] + (n >> 2)}) -
                         kLevel;
        Vector3d sum = Vector3d::Zero();
        int count = 0;
        for (int n = 0; n < 8; ++n)
            for (const int axis : {1, 2, 4})
                if (const int m = n | axis;
                    m != n && (at[idx(n)] < 0.0) != (at[idx(m)] < 0.0))
                {
                    const double x = at[idx(n)] / (at[idx(n)] - at[idx(m)]);
                    sum += place(n) + x * (place(m) - place(n));
                    ++count;
                }
        Vector3d x =
            low + h * (Vector3d(cell[0], cell[1], cell[2]) + sum / std::max(count, 1));
        // Not farther than the cell is wide: where skins meet the gradient vanishes.
        for (int step = 0; step < kSteps; ++step)
        {
            Vector3d gradient;
            const double off = field.at(x, gradient) - kLevel;
            const double slope = gradient.squaredNorm();
            if (!(slope > 0.0) || std::abs(off) > 0.5 * h * std::sqrt(slope))
                break;
            x -= off / slope * gradient;
        }
        out.samples.push_back(x);
        out.colours.push_back(colour);
        return found->second;
    };
    for (const SkinCube& corner : corners)
    {
        const bool is_inside = value_at(corner) >= kLevel;
        if (!is_inside)
            continue;
        for (std::size_t axis = 0; axis < 3; ++axis)
            for (const int way : {-1, 1})
            {
                SkinCube other = corner;
                other[axis] += way;
                if (value_at(other) >= kLevel)
                    continue;
                // The four cells around the edge, counterclockwise as seen from outside.
                SkinCube cell = way > 0 ? corner : other;
                const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
                --cell[u];
                --cell[v];
                std::array<std::uint32_t, 4> quad;
                quad[0] = vertex_of(cell);
                ++cell[u];
                quad[1] = vertex_of(cell);
                ++cell[v];
                quad[2] = vertex_of(cell);
                --cell[u];
                quad[3] = vertex_of(cell);
                if (way < 0)
                    std::reverse(quad.begin(), quad.end());
                out.corners.insert(out.corners.end(), quad.begin(), quad.end());
                out.face_ends.push_back(out.corners.size());
            }
    }
    out.groups.back().end_face = out.num_faces();
}

} // namespace cellwarp::core
