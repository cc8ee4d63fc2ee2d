// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/lids.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/bounding_surface.h"
#include "octree/material.h"
#include "tests/support/bodies.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// A box without the triangles whose corners all lie where \p is_open says.
template <class IsOpen>
Shape opened(const Vector3d& size, IsOpen&& is_open)
{
    Shape box = support::box_shape(Vector3d::Zero(), size, 4);
    std::erase_if(box.triangles,
                  [&](const Triangle& t)
                  {
                      return std::ranges::all_of(t, [&](std::uint32_t i)
                                                 { return is_open(box.samples[i]); });
                  });
    return box;
}

double volume_of(const Material& material)
{
    double voxels = 0.0;
    for_each_set(material.grid.material(), [&](std::size_t) { voxels += 1.0; });
    return voxels * std::pow(material.grid.shape().voxel(), 3);
}

} // namespace

TEST(Lids, close_every_opening_whatever_its_width)
{
    // A tube without its two ends, and one open end with a window.
    const Shape tube =
        opened({2, 2, 4}, [](const Vector3d& x) { return x.z() == 0.0 || x.z() == 4.0; });
    const Shape tower = opened({2, 2, 4},
                               [](const Vector3d& x) {
                                   return x.z() == 0.0 || (x.x() == 2.0 && x.z() > 1.5 &&
                                                           x.z() < 3.5 && x.y() < 1.6);
                               });
    for (const Shape& shape : {tube, tower})
    {
        EXPECT_GT(bounding_surface(shape).open_edges, 0.0);
        const Shape closed = with_lids(shape);
        const BoundingSurface surface = bounding_surface(closed);
        EXPECT_EQ(surface.open_edges, 0.0);
        EXPECT_EQ(closed.samples.size(), shape.samples.size() + 2);
        EXPECT_TRUE(std::equal(shape.samples.begin(), shape.samples.end(),
                               closed.samples.begin()));
        const GridShape grid = grid_shape({2, 2, 4}, 16, 0, 0.0);
        const Material material = find_material(closed, surface, grid, Fill::Solid);
        EXPECT_EQ(material.method, InsideMethod::Winding);
        EXPECT_NEAR(volume_of(material), 16.0, 1e-9);
    }
}

TEST(Lids, leave_openings_open_whose_rim_is_longer_than_wanted)
{
    // Ends of 2 x 2 and of 1 x 1.
    Shape two = opened({2, 2, 4}, [](const Vector3d& x) { return x.z() == 0.0; });
    const Shape small = opened({1, 1, 4}, [](const Vector3d& x) { return x.z() == 4.0; });
    const auto first = static_cast<std::uint32_t>(two.samples.size());
    for (const Vector3d& x : small.samples)
        two.samples.push_back(x + Vector3d(5, 0, 0));
    for (const auto& [a, b, c] : small.triangles)
        two.triangles.push_back({a + first, b + first, c + first});
    EXPECT_EQ(with_lids(two, 3.9).samples.size(), two.samples.size());
    EXPECT_EQ(with_lids(two, 4.1).samples.size(), two.samples.size() + 1);
    EXPECT_EQ(with_lids(two, 8.1).samples.size(), two.samples.size() + 2);
    EXPECT_EQ(bounding_surface(with_lids(two, 8.1)).open_edges, 0.0);
}

TEST(Lids, lie_in_the_middle_of_their_loops_and_face_outwards)
{
    const Shape cup = opened({1, 1, 1}, [](const Vector3d& x) { return x.z() == 1.0; });
    const Shape closed = with_lids(cup);
    ASSERT_EQ(closed.samples.size(), cup.samples.size() + 1);
    EXPECT_LT((closed.samples.back() - Vector3d(0.5, 0.5, 1)).norm(), 1e-12);
    for (std::size_t t = cup.triangles.size(); t < closed.triangles.size(); ++t)
    {
        const auto& [a, b, c] = closed.triangles[t];
        EXPECT_GT((closed.samples[b] - closed.samples[a])
                      .cross(closed.samples[c] - closed.samples[a])
                      .z(),
                  0.0);
    }
}

TEST(Lids, nothing_is_added_where_nothing_is_open)
{
    const Shape box = support::box_shape({0, 0, 0}, {1, 2, 3});
    EXPECT_EQ(with_lids(box).triangles, box.triangles);
    EXPECT_EQ(with_lids(Shape{box.samples, {}}).samples.size(), box.samples.size());
}

} // namespace cellwarp::core
