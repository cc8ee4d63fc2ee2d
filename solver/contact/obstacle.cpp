// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/contact/obstacle.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Geometry>

#include "octree/wrap/triangle_tree.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

class PlaneObstacle final : public Obstacle
{
public:
    PlaneObstacle(const Vector3d& normal, double offset)
        : normal_(normal.normalized()), offset_(offset / normal.norm())
    {
        if (!(normal.norm() > 0.0))
            throw std::invalid_argument("a plane needs a normal with length");
    }
    void near(const Vector3d& point, double reach,
              std::vector<NearPlace>& out) const override
    {
        if (const double away = normal_.dot(point) - offset_; away <= reach)
            out.push_back({point - away * normal_, normal_});
    }

private:
    Vector3d normal_;
    double offset_;
};

class SphereObstacle final : public Obstacle
{
public:
    SphereObstacle(const Vector3d& centre, double radius)
        : centre_(centre), radius_(radius)
    {
    }
    void near(const Vector3d& point, double reach,
              std::vector<NearPlace>& out) const override
    {
        const Vector3d way = point - centre_;
        const double length = way.norm();
        if (length - radius_ > reach)
            return;
        const Vector3d normal = length > 0.0 ? Vector3d(way / length) : Vector3d::UnitY();
        out.push_back({centre_ + radius_ * normal, normal});
    }

private:
    Vector3d centre_;
    double radius_;
};

class MeshObstacle final : public Obstacle
{
public:
    MeshObstacle(std::vector<Vector3d> vertices,
                 std::vector<std::array<std::uint32_t, 3>> triangles)
        : tree_(std::move(vertices), std::move(triangles))
    {
    }

    // A place on the edge of one triangle is a nearest one only if no neighbour has one
    // that is nearer still.
    void near(const Vector3d& point, double reach,
              std::vector<NearPlace>& out) const override
    {
        std::vector<std::uint32_t> numbers;
        tree_.near(point, reach, numbers);
        struct Found
        {
            double away;
            std::uint32_t triangle;
            Vector3d place;
        };
        std::vector<Found> found;
        for (const std::uint32_t k : numbers)
        {
            const Vector3d place = nearest(k, point);
            if (const double away = (point - place).norm(); away <= reach)
                found.push_back({away, k, place});
        }
        std::sort(
            found.begin(), found.end(),
            [](const Found& a, const Found& b)
            { return std::pair(a.away, a.triangle) < std::pair(b.away, b.triangle); });
        constexpr double kSame = 1e-9; // of the reach
        for (std::size_t k = 0; k < found.size(); ++k)
        {
            const Found& one = found[k];
            bool is_nearest = true;
            for (std::size_t j = 0; j < k && is_nearest; ++j)
                is_nearest = (nearest(found[j].triangle, one.place) - one.place).norm() >
                             kSame * reach;
            if (!is_nearest)
                continue;
            const auto& [a, b, c] = tree_.triangles()[one.triangle];
            const Vector3d across = (tree_.vertices()[b] - tree_.vertices()[a])
                                        .cross(tree_.vertices()[c] - tree_.vertices()[a]);
            const Vector3d way = point - one.place;
            const Vector3d normal = one.away > kSame * reach ? way : across;
            if (normal.norm() > 0.0)
                out.push_back({one.place, normal.normalized()});
        }
    }

private:
    Vector3d nearest(std::uint32_t triangle, const Vector3d& point) const
    {
        const auto& [a, b, c] = tree_.triangles()[triangle];
        return nearest_on_triangle(tree_.vertices()[a], tree_.vertices()[b],
                                   tree_.vertices()[c], point);
    }

    TriangleTree tree_;
};

} // namespace

std::unique_ptr<Obstacle> plane_obstacle(const Vector3d& normal, double offset)
{
    return std::make_unique<PlaneObstacle>(normal, offset);
}

std::unique_ptr<Obstacle> sphere_obstacle(const Vector3d& centre, double radius)
{
    return std::make_unique<SphereObstacle>(centre, radius);
}

std::unique_ptr<Obstacle>
mesh_obstacle(std::vector<Vector3d> vertices,
              std::vector<std::array<std::uint32_t, 3>> triangles)
{
    return std::make_unique<MeshObstacle>(std::move(vertices), std::move(triangles));
}

// The regions of the plane that belong to corners, edges and the inside, by the signs of
// projections.
Vector3d nearest_on_triangle(const Vector3d& a, const Vector3d& b, const Vector3d& c,
                             const Vector3d& point)
{
    const Vector3d ab = b - a, ac = c - a, ap = point - a;
    const double d1 = ab.dot(ap), d2 = ac.dot(ap);
    if (d1 <= 0.0 && d2 <= 0.0)
        return a;
    const Vector3d bp = point - b;
    const double d3 = ab.dot(bp), d4 = ac.dot(bp);
    if (d3 >= 0.0 && d4 <= d3)
        return b;
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0)
        return d1 - d3 > 0.0 ? Vector3d(a + d1 / (d1 - d3) * ab) : a;
    const Vector3d cp = point - c;
    const double d5 = ab.dot(cp), d6 = ac.dot(cp);
    if (d6 >= 0.0 && d5 <= d6)
        return c;
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0)
        return d2 - d6 > 0.0 ? Vector3d(a + d2 / (d2 - d6) * ac) : a;
    const double va = d3 * d6 - d5 * d4, e = d4 - d3, f = d5 - d6;
    if (va <= 0.0 && e >= 0.0 && f >= 0.0)
        return e + f > 0.0 ? Vector3d(b + e / (e + f) * (c - b)) : b;
    const double sum = va + vb + vc;
    return sum > 0.0 ? Vector3d(a + vb / sum * ab + vc / sum * ac) : a;
}

} // namespace cellwarp::core
