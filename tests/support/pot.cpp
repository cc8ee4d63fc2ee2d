// SPDX-License-Identifier: GPL-3.0-or-later
// Surface nets: a vertex in every cube that the surface crosses, a quad around every
// edge that it crosses.
#include "tests/support/pot.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "octree/base/index.h"

namespace cellwarp::core::support
{

namespace
{

using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr std::uint32_t kNone = 0xffffffffu;

/// Values on the corners of cubes.
struct Field
{
    Vector3i counts;
    Vector3d low;
    double h;
    std::vector<double> values;

    std::size_t at(const Vector3i& i) const
    {
        return idx((i.z() * counts.y() + i.y()) * counts.x() + i.x());
    }
    Vector3d place(const Vector3i& i) const { return low + h * i.cast<double>(); }
};

/// The mean of where the surface crosses the edges of a cube; whether it does.
bool crossing(const Field& field, const Vector3i& cube, Vector3d& mean)
{
    Vector3d sum = Vector3d::Zero();
    int count = 0;
    for (int axis = 0; axis < 3; ++axis)
        for (int corner = 0; corner < 4; ++corner)
        {
            Vector3i a = cube;
            a[(axis + 1) % 3] += corner & 1;
            a[(axis + 2) % 3] += corner >> 1;
            const Vector3i b = a + Vector3i::Unit(axis);
            const double va = field.values[field.at(a)], vb = field.values[field.at(b)];
            if ((va < 0) == (vb < 0))
                continue;
            sum += field.place(a) + va / (va - vb) * field.h * Vector3d::Unit(axis);
            ++count;
        }
    mean = sum / std::max(1, count);
    return count > 0;
}

double capsule(const Vector3d& x, const Vector3d& a, const Vector3d& b, double r)
{
    const double t = std::clamp((x - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
    return (x - a - t * (b - a)).norm() - r;
}

double pot_distance(const Vector3d& x)
{
    const double body = 0.8 * (x.cwiseQuotient(Vector3d(1.0, 0.8, 1.0)).norm() - 1.0);
    const double spout = capsule(x, {0.7, -0.2, 0}, {1.6, 0.6, 0}, 0.16);
    const Vector3d c = x - Vector3d(-1.05, 0.05, 0);
    const double handle = std::hypot(std::hypot(c.x(), c.y()) - 0.42, c.z()) - 0.1;
    return std::min({body, spout, handle});
}

} // namespace

Shape level_set(const std::function<double(const Vector3d&)>& distance,
                const Vector3d& low, const Vector3d& high, double h)
{
    Field field{((high - low) / h).array().ceil().cast<int>() + 1, low, h, {}};
    field.values.resize(idx(field.counts.prod()));
    Vector3i i;
    const auto for_all = [&](auto&& visit)
    {
        for (i.z() = 0; i.z() < field.counts.z(); ++i.z())
            for (i.y() = 0; i.y() < field.counts.y(); ++i.y())
                for (i.x() = 0; i.x() < field.counts.x(); ++i.x())
                    visit();
    };
    for_all([&] { field.values[field.at(i)] = distance(field.place(i)); });
    Shape shape;
    std::vector<std::uint32_t> vertex(field.values.size(), kNone);
    for_all(
        [&]
        {
            Vector3d mean;
            if ((i.array() + 1 < field.counts.array()).all() && crossing(field, i, mean))
            {
                vertex[field.at(i)] = static_cast<std::uint32_t>(shape.samples.size());
                shape.samples.push_back(mean);
            }
        });
    for_all(
        [&]
        {
            for (int axis = 0; axis < 3; ++axis)
            {
                const Vector3i u = Vector3i::Unit((axis + 1) % 3);
                const Vector3i v = Vector3i::Unit((axis + 2) % 3);
                const Vector3i end = i + Vector3i::Unit(axis);
                if ((i - u - v).minCoeff() < 0 ||
                    (end.array() >= field.counts.array()).any())
                    continue;
                const bool from_inside = field.values[field.at(i)] < 0;
                if (from_inside == (field.values[field.at(end)] < 0))
                    continue;
                std::uint32_t q[4] = {vertex[field.at(i - u - v)],
                                      vertex[field.at(i - v)], vertex[field.at(i)],
                                      vertex[field.at(i - u)]};
                if (!from_inside)
                    std::swap(q[1], q[3]);
                shape.triangles.push_back({q[0], q[1], q[2]});
                shape.triangles.push_back({q[0], q[2], q[3]});
            }
        });
    return shape;
}

Shape pot(double h)
{
    return level_set(pot_distance, {-1.8, -1.0, -1.2}, {2.0, 1.0, 1.2}, h);
}

Shape with_hole(const Shape& shape, const Vector3d& centre, double radius)
{
    Shape open = shape;
    std::erase_if(
        open.triangles,
        [&](const Triangle& t)
        {
            const Vector3d centroid =
                (shape.samples[t[0]] + shape.samples[t[1]] + shape.samples[t[2]]) / 3.0;
            return (centroid - centre).norm() < radius;
        });
    // Samples that no triangle uses would count as points.
    std::map<std::uint32_t, std::uint32_t> number;
    open.samples.clear();
    for (Triangle& t : open.triangles)
        for (std::uint32_t& k : t)
        {
            const auto [found, is_new] =
                number.try_emplace(k, static_cast<std::uint32_t>(number.size()));
            if (is_new)
                open.samples.push_back(shape.samples[k]);
            k = found->second;
        }
    return open;
}

Shape cloud_with_hole(const std::vector<Vector3d>& points, const Vector3d& centre,
                      double radius)
{
    Shape cloud{points, {}};
    std::erase_if(cloud.samples,
                  [&](const Vector3d& x) { return (x - centre).norm() < radius; });
    return cloud;
}

Vector3d to_origin(std::initializer_list<Shape*> shapes)
{
    Vector3d low = Vector3d::Constant(1e300), high = -low;
    for (const Shape* shape : shapes)
        for (const Vector3d& x : shape->samples)
        {
            low = low.cwiseMin(x);
            high = high.cwiseMax(x);
        }
    for (Shape* shape : shapes)
        for (Vector3d& x : shape->samples)
            x -= low;
    return high - low;
}

} // namespace cellwarp::core::support
