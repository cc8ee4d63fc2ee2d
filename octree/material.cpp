// SPDX-License-Identifier: GPL-3.0-or-later
// Surface: a triangle marks every voxel that it touches, found by cutting its
// range of voxels in halves and testing each half for a separating axis. Marks of
// a connected surface are then connected through voxel faces, and a flood through
// faces cannot leak across them.
//
// Inside of a closed surface: along the line of a voxel column the winding number
// is the sum of the signs of the crossings below. It is not zero in overlapping
// parts, where parity would say outside. Of a surface with a few holes each ray
// may be wrong: the six axis rays vote, and what a sealed flood reaches is outside.
//
// Inside of soups and clouds: marks are widened by r until a flood from outside no
// longer enters; then the outside is widened by r in turn (a closing), so that
// nothing is added on the outside.
#include "octree/material.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>

#include <Eigen/Geometry>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "octree/distance_transform.h"
#include "octree/point_tree.h"

namespace cellwarp
{

namespace
{

/// Largest opening that is closed to find an inside, as a radius [of the diagonal].
/// The bunny's two base holes need 0.03; a bowl, about as wide as it is long, stays
/// a shell.
constexpr double kMaxSealRadius = 0.04;

/// A surface counts as nearly closed below this share of open edges. A soup that
/// lost every third triangle has more than half of its edges open.
constexpr double kNearlyClosed = 0.2;

/// An inside smaller than this share of the surface voxels is a pocket between
/// marks, not an inside.
constexpr double kMinInsideShare = 0.02;

void mark(std::uint8_t& voxel)
{
    std::atomic_ref<std::uint8_t>(voxel).store(1, std::memory_order_relaxed);
}

/// Marks the voxels that one triangle (corners in voxel units) touches.
class TriangleMarker
{
public:
    TriangleMarker(VoxelGrid& grid, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                   const Eigen::Vector3d& c)
        : grid_(grid), corners_{a, b, c}
    {
        const Eigen::Vector3d edges[3] = {b - a, c - b, a - c};
        axes_[0] = edges[0].cross(edges[1]);
        for (int e = 0; e < 3; ++e)
            for (int k = 0; k < 3; ++k)
                axes_[1 + 3 * e + k] = Eigen::Vector3d::Unit(k).cross(edges[e]);
        for (int s = 0; s < 10; ++s)
        {
            double low = INFINITY, high = -INFINITY;
            for (const Eigen::Vector3d& corner : corners_)
            {
                low = std::min(low, axes_[s].dot(corner));
                high = std::max(high, axes_[s].dot(corner));
            }
            // Touching counts, also when rounding says otherwise.
            const double slack = 1e-9 * (axes_[s].norm() + std::abs(low) + std::abs(high));
            low_[s] = low - slack;
            high_[s] = high + slack;
        }
        Eigen::Vector3i first, last;
        for (int k = 0; k < 3; ++k)
        {
            const double low = std::min({a[k], b[k], c[k]}), high = std::max({a[k], b[k], c[k]});
            const double end = grid.counts()[k] - 1.0;
            first[k] = static_cast<int>(std::clamp(std::floor(low), 0.0, end));
            last[k] = static_cast<int>(std::clamp(std::floor(high), 0.0, end));
        }
        visit(first, last);
    }

private:
    bool is_separate(const Eigen::Vector3i& first, const Eigen::Vector3i& last) const
    {
        const Eigen::Vector3d half = 0.5 * (last - first + Eigen::Vector3i::Ones()).cast<double>();
        const Eigen::Vector3d middle = first.cast<double>() + half;
        for (int s = 0; s < 10; ++s)
        {
            const double centre = axes_[s].dot(middle), reach = axes_[s].cwiseAbs().dot(half);
            if (centre - reach > high_[s] || centre + reach < low_[s])
                return true;
        }
        return false;
    }

    void visit(const Eigen::Vector3i& first, const Eigen::Vector3i& last)
    {
        int axis = 0;
        const int extent = (last - first).maxCoeff(&axis);
        if (extent > 0 && is_separate(first, last))
            return;
        if (extent == 0)
        {
            if (!is_separate(first, last))
                mark(grid_.material()[grid_.index(first)]);
            return;
        }
        const int middle = (first[axis] + last[axis]) / 2;
        Eigen::Vector3i low_last = last, high_first = first;
        low_last[axis] = middle;
        high_first[axis] = middle + 1;
        visit(first, low_last);
        visit(high_first, last);
    }

    VoxelGrid& grid_;
    Eigen::Vector3d corners_[3];
    Eigen::Vector3d axes_[10];
    double low_[10], high_[10];
};

void mark_surface(const Shape& shape, VoxelGrid& grid)
{
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, shape.samples.size(), 4096),
                      [&](const auto& range) {
                          for (std::size_t i = range.begin(); i < range.end(); ++i)
                              mark(grid.material()[grid.index(grid.locate(shape.samples[i]))]);
                      });
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, shape.triangles.size(), 1024), [&](const auto& range) {
            for (std::size_t t = range.begin(); t < range.end(); ++t)
            {
                const Triangle& triangle = shape.triangles[t];
                const Eigen::Vector3d a = grid.to_voxels(shape.samples[triangle[0]]);
                const Eigen::Vector3d b = grid.to_voxels(shape.samples[triangle[1]]);
                const Eigen::Vector3d c = grid.to_voxels(shape.samples[triangle[2]]);
                // Most triangles of a fine mesh lie in the voxel of their corners.
                const Eigen::Vector3i va = a.array().floor().cast<int>();
                if (va == b.array().floor().cast<int>().matrix() &&
                    va == c.array().floor().cast<int>().matrix())
                    continue;
                TriangleMarker(grid, a, b, c);
            }
        });
}

/// Sample numbers with coincident samples joined to the first of them.
std::vector<std::uint32_t> joined_samples(const std::vector<Eigen::Vector3d>& samples)
{
    std::vector<std::uint32_t> order(samples.size()), joined(samples.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto key = [&](std::uint32_t i) {
        return std::tuple(samples[i].x(), samples[i].y(), samples[i].z());
    };
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
        return std::tuple_cat(key(a), std::tuple(a)) < std::tuple_cat(key(b), std::tuple(b));
    });
    std::uint32_t first = 0;
    for (std::size_t i = 0; i < order.size(); ++i)
    {
        if (i == 0 || key(order[i]) != key(first))
            first = order[i];
        joined[order[i]] = first;
    }
    return joined;
}

/// A triangle with its smallest corner first, the orientation kept.
Triangle canonical(Triangle t)
{
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
}

/// The triangles that bound something: coincident corners joined, degenerate ones
/// and repeated copies dropped.
std::vector<Triangle> bounding_triangles(const Shape& shape)
{
    const std::vector<std::uint32_t> joined = joined_samples(shape.samples);
    std::vector<Triangle> triangles;
    triangles.reserve(shape.triangles.size());
    for (const Triangle& t : shape.triangles)
    {
        const Triangle j = {joined[t[0]], joined[t[1]], joined[t[2]]};
        if (j[0] != j[1] && j[1] != j[2] && j[2] != j[0])
            triangles.push_back(canonical(j));
    }
    std::sort(triangles.begin(), triangles.end());
    triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
    return triangles;
}

double open_share(const std::vector<Triangle>& triangles)
{
    if (triangles.empty())
        return 1.0;
    // Each edge once as (low, high), its direction as a sign.
    std::vector<std::pair<std::uint64_t, int>> edges;
    edges.reserve(3 * triangles.size());
    for (const Triangle& t : triangles)
        for (std::size_t k = 0; k < 3; ++k)
        {
            const std::uint64_t a = t[k], b = t[(k + 1) % 3];
            edges.emplace_back(std::min(a, b) << 32 | std::max(a, b), a < b ? 1 : -1);
        }
    std::sort(edges.begin(), edges.end());
    std::size_t open = 0, total = 0;
    for (std::size_t i = 0; i < edges.size(); ++total)
    {
        int balance = 0;
        const std::uint64_t edge = edges[i].first;
        for (; i < edges.size() && edges[i].first == edge; ++i)
            balance += edges[i].second;
        open += balance != 0;
    }
    return static_cast<double>(open) / static_cast<double>(total);
}

/// Where the lines through the voxel centres along one axis cross the triangles.
struct Crossing
{
    std::uint64_t column;
    double height;  ///< [voxel]
    int sign;
    bool operator<(const Crossing& other) const
    {
        return std::tuple(column, height, sign) <
               std::tuple(other.column, other.height, other.sign);
    }
};

/// Side of the point (x, y) seen along the edge a -> b, never 0: a point on the
/// edge counts as moved by an infinitely small (e, e^2), the same for both
/// triangles of the edge.
int side(const double* a, const double* b, double x, double y)
{
    const bool swapped = std::pair(b[0], b[1]) < std::pair(a[0], a[1]);
    if (swapped)
        std::swap(a, b);
    const double cross = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
    const double value = cross != 0 ? cross : b[1] != a[1] ? -(b[1] - a[1]) : b[0] - a[0];
    const int sign = value > 0 ? 1 : value < 0 ? -1 : 0;
    return swapped ? -sign : sign;
}

std::vector<Crossing> crossings(const Shape& shape, const std::vector<Triangle>& triangles,
                                const VoxelGrid& grid, int axis)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    std::vector<Crossing> found;
    for (const Triangle& t : triangles)
    {
        double p[3][2], h[3];
        for (std::size_t k = 0; k < 3; ++k)
        {
            const Eigen::Vector3d x = grid.to_voxels(shape.samples[t[k]]);
            p[k][0] = x[u];
            p[k][1] = x[v];
            h[k] = x[axis];
        }
        int low[2], high[2];
        for (int d = 0; d < 2; ++d)
        {
            const double end = grid.counts()[d == 0 ? u : v] - 1.0;
            low[d] = static_cast<int>(std::clamp(
                std::ceil(std::min({p[0][d], p[1][d], p[2][d]}) - 0.5), 0.0, end + 1));
            high[d] = static_cast<int>(std::clamp(
                std::floor(std::max({p[0][d], p[1][d], p[2][d]}) - 0.5), -1.0, end));
        }
        for (int j = low[1]; j <= high[1]; ++j)
            for (int i = low[0]; i <= high[0]; ++i)
            {
                const double x = i + 0.5, y = j + 0.5;
                const int s0 = side(p[0], p[1], x, y), s1 = side(p[1], p[2], x, y),
                          s2 = side(p[2], p[0], x, y);
                if (s0 != s1 || s1 != s2 || s0 == 0)
                    continue;
                const double area = (p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) -
                                    (p[1][1] - p[0][1]) * (p[2][0] - p[0][0]);
                if (area == 0)
                    continue;
                const double w1 = ((x - p[0][0]) * (p[2][1] - p[0][1]) -
                                   (y - p[0][1]) * (p[2][0] - p[0][0])) /
                                  area;
                const double w2 = ((p[1][0] - p[0][0]) * (y - p[0][1]) -
                                   (p[1][1] - p[0][1]) * (x - p[0][0])) /
                                  area;
                const std::uint64_t column =
                    static_cast<std::uint64_t>(j) *
                        static_cast<std::uint64_t>(grid.counts()[u]) +
                    static_cast<std::uint64_t>(i);
                found.push_back({column, h[0] + w1 * (h[1] - h[0]) + w2 * (h[2] - h[0]), s0});
            }
    }
    std::sort(found.begin(), found.end());
    return found;
}

/// Calls \p visit(voxel index, winding number seen from below, from above) for the
/// voxels of all columns that are crossed.
template <class Visit>
void walk_columns(const std::vector<Crossing>& found, const VoxelGrid& grid, int axis,
                  Visit&& visit)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (std::size_t first = 0; first < found.size();)
    {
        std::size_t end = first;
        int total = 0;
        while (end < found.size() && found[end].column == found[first].column)
            total += found[end++].sign;
        Eigen::Vector3i voxel;
        voxel[u] = static_cast<int>(found[first].column %
                                    static_cast<std::uint64_t>(grid.counts()[u]));
        voxel[v] = static_cast<int>(found[first].column /
                                    static_cast<std::uint64_t>(grid.counts()[u]));
        int below = 0;
        std::size_t next = first;
        for (int h = 0; h < grid.counts()[axis]; ++h)
        {
            while (next < end && found[next].height < h + 0.5)
                below += found[next++].sign;
            voxel[axis] = h;
            visit(grid.index(voxel), below, total - below);
        }
        first = end;
    }
}

void fill_by_winding(const Shape& shape, const std::vector<Triangle>& triangles,
                     VoxelGrid& grid)
{
    walk_columns(crossings(shape, triangles, grid, 2), grid, 2,
                 [&](std::size_t voxel, int below, int) {
                     if (below != 0)
                         grid.material()[voxel] = 1;
                 });
}

/// How many of the six axis rays of each voxel say that it is inside.
std::vector<std::uint8_t> inside_votes(const Shape& shape,
                                       const std::vector<Triangle>& triangles,
                                       const VoxelGrid& grid)
{
    std::vector<std::uint8_t> votes(grid.size(), 0);
    for (int axis = 0; axis < 3; ++axis)
        walk_columns(crossings(shape, triangles, grid, axis), grid, axis,
                     [&](std::size_t voxel, int below, int above) {
                         votes[voxel] = static_cast<std::uint8_t>(
                             votes[voxel] + (below != 0) + (above != 0));
                     });
    return votes;
}

/// A copy of the grid's marks with a free border all around, so that a flood can
/// come from every side.
struct PaddedMarks
{
    Eigen::Vector3i counts;
    int border;
    std::vector<std::uint8_t> marks;

    PaddedMarks(const VoxelGrid& grid, int width)
        : counts((grid.counts().array() + 2 * width).matrix()), border(width)
    {
        marks.assign(static_cast<std::size_t>(counts.x()) * static_cast<std::size_t>(counts.y()) *
                         static_cast<std::size_t>(counts.z()),
                     0);
        for (int k = 0; k < grid.counts().z(); ++k)
            for (int j = 0; j < grid.counts().y(); ++j)
                std::copy_n(&grid.material()[grid.index(0, j, k)], grid.counts().x(),
                            &marks[at(0, j, k)]);
    }
    std::size_t at(int i, int j, int k) const
    {
        return (static_cast<std::size_t>(k + border) * static_cast<std::size_t>(counts.y()) +
                static_cast<std::size_t>(j + border)) *
                   static_cast<std::size_t>(counts.x()) +
               static_cast<std::size_t>(i + border);
    }
};

/// 1 for the voxels farther than r from a mark that a flood from the first voxel,
/// through faces, reaches.
std::vector<std::uint8_t> flooded(const std::vector<float>& distances, float r_squared,
                                  const Eigen::Vector3i& counts)
{
    std::vector<std::uint8_t> reached(distances.size(), 0);
    const std::ptrdiff_t step[3] = {1, counts.x(),
                                    static_cast<std::ptrdiff_t>(counts.x()) * counts.y()};
    std::vector<std::size_t> stack = {0};
    reached[0] = 1;
    while (!stack.empty())
    {
        const std::size_t voxel = stack.back();
        stack.pop_back();
        const std::size_t nx = static_cast<std::size_t>(counts.x());
        const std::size_t ny = static_cast<std::size_t>(counts.y());
        const std::size_t place[3] = {voxel % nx, voxel / nx % ny, voxel / nx / ny};
        for (int axis = 0; axis < 3; ++axis)
            for (const int direction : {-1, 1})
            {
                if (place[axis] == (direction < 0 ? 0 : static_cast<std::size_t>(counts[axis] - 1)))
                    continue;
                const std::size_t next = static_cast<std::size_t>(
                    static_cast<std::ptrdiff_t>(voxel) + direction * step[axis]);
                if (!reached[next] && distances[next] > r_squared)
                {
                    reached[next] = 1;
                    stack.push_back(next);
                }
            }
    }
    return reached;
}

/// Fills what marks enclose once openings up to a radius are closed; the radius is
/// the one that encloses most. Returns it [voxel], or -1 if nothing is enclosed.
/// Only voxels that \p may_fill accepts are filled.
template <class MayFill>
double fill_by_flood(VoxelGrid& grid, int max_radius, MayFill&& may_fill)
{
    const PaddedMarks padded(grid, max_radius + 2);
    const std::vector<float> distances = squared_distances(padded.marks, padded.counts);
    const std::size_t num_marks = static_cast<std::size_t>(
        std::count(grid.material().begin(), grid.material().end(), std::uint8_t(1)));
    std::size_t best_inside = 0;
    int best_radius = -1;
    std::vector<std::uint8_t> best_reached;
    for (int r = 0; r <= max_radius; ++r)
    {
        const float r_squared = static_cast<float>(r * r);
        std::vector<std::uint8_t> reached = flooded(distances, r_squared, padded.counts);
        std::size_t inside = 0;
        for (std::size_t i = 0; i < reached.size(); ++i)
            inside += !reached[i] && distances[i] > r_squared;
        if (inside > best_inside)
        {
            best_inside = inside;
            best_radius = r;
            best_reached = std::move(reached);
        }
    }
    if (static_cast<double>(best_inside) <
        std::max(1.0, kMinInsideShare * static_cast<double>(num_marks)))
        return -1.0;
    const std::vector<float> outside = squared_distances(best_reached, padded.counts);
    const float r_squared = static_cast<float>(best_radius * best_radius);
    for (int k = 0; k < grid.counts().z(); ++k)
        for (int j = 0; j < grid.counts().y(); ++j)
            for (int i = 0; i < grid.counts().x(); ++i)
            {
                const std::size_t voxel = grid.index(i, j, k);
                if (outside[padded.at(i, j, k)] > r_squared && may_fill(voxel))
                    grid.material()[voxel] = 1;
            }
    return best_radius;
}

/// Joins points that are up to 2 r apart by a closing, so that a cloud's surface
/// becomes one sheet.
void close_gaps(VoxelGrid& grid, int r)
{
    const PaddedMarks padded(grid, r + 2);
    const std::vector<float> distances = squared_distances(padded.marks, padded.counts);
    std::vector<std::uint8_t> far(distances.size());
    const float r_squared = static_cast<float>(r * r);
    for (std::size_t i = 0; i < far.size(); ++i)
        far[i] = distances[i] > r_squared;
    const std::vector<float> inner = squared_distances(far, padded.counts);
    for (int k = 0; k < grid.counts().z(); ++k)
        for (int j = 0; j < grid.counts().y(); ++j)
            for (int i = 0; i < grid.counts().x(); ++i)
                if (inner[padded.at(i, j, k)] > r_squared)
                    grid.material()[grid.index(i, j, k)] = 1;
}

} // namespace

double open_edge_share(const Shape& shape) { return open_share(bounding_triangles(shape)); }

double point_spacing(std::span<const Eigen::Vector3d> points)
{
    // The sixth neighbour: on a surface sampled at random it is about as far as
    // the widest of the gaps around a point. 2,000 points tell the median.
    constexpr std::size_t kNeighbours = 7, kProbes = 2000;
    std::vector<Eigen::Vector3d> places(points.begin(), points.end());
    const auto key = [](const Eigen::Vector3d& p) { return std::tuple(p.x(), p.y(), p.z()); };
    std::sort(places.begin(), places.end(),
              [&](const auto& a, const auto& b) { return key(a) < key(b); });
    places.erase(std::unique(places.begin(), places.end()), places.end());
    if (places.size() < 2)
        return 0.0;
    const PointTree tree(places);
    const std::size_t step = std::max<std::size_t>(1, places.size() / kProbes);
    std::vector<double> distances;
    std::vector<PointTree::Neighbour> near;
    for (std::size_t i = 0; i < places.size(); i += step)
    {
        tree.nearest(places[i], kNeighbours, near);
        distances.push_back(std::sqrt(near.back().distance_squared));
    }
    std::nth_element(distances.begin(),
                     distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2),
                     distances.end());
    return distances[distances.size() / 2];
}

Material find_material(const Shape& shape, const GridShape& grid_shape, Fill fill)
{
    Material material{VoxelGrid(grid_shape)};
    VoxelGrid& grid = material.grid;
    mark_surface(shape, grid);
    const double voxel = grid_shape.voxel();
    const bool is_cloud = shape.triangles.empty();
    if (is_cloud)
        material.spacing = point_spacing(shape.samples);
    const int max_radius =
        std::max(1, static_cast<int>(kMaxSealRadius * grid_shape.size.norm() / voxel));
    if (fill == Fill::Solid)
    {
        const std::vector<Triangle> triangles = bounding_triangles(shape);
        const double open = open_share(triangles);
        if (open == 0.0)
        {
            fill_by_winding(shape, triangles, grid);
            material.method = InsideMethod::Winding;
            return material;
        }
        std::vector<std::uint8_t> votes;
        if (open < kNearlyClosed)
            votes = inside_votes(shape, triangles, grid);
        const double radius = fill_by_flood(grid, max_radius, [&](std::size_t i) {
            return votes.empty() || votes[i] >= 4;
        });
        if (radius >= 0)
        {
            material.method = votes.empty() ? InsideMethod::Flood : InsideMethod::Votes;
            material.seal_radius = radius * voxel;
            return material;
        }
    }
    if (is_cloud && material.spacing > 0)
        close_gaps(grid, std::clamp(static_cast<int>(std::ceil(material.spacing / voxel)), 1,
                                    max_radius));
    return material;
}

} // namespace cellwarp
