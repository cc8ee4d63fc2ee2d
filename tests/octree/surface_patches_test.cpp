// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/surface_patches.h"

#include <algorithm>
#include <numeric>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Side = SurfacePatches::Side;
using Loop = std::vector<Eigen::Vector2d>;

/// Closed lines in the plane z = 0, sorted; corners at one place are one.
struct Picture
{
    std::vector<Eigen::Vector3d> places;
    std::vector<Side> sides;

    Picture(std::initializer_list<Loop> loops)
    {
        for (const Loop& loop : loops)
        {
            std::vector<std::uint32_t> corners;
            for (const Eigen::Vector2d& at : loop)
                corners.push_back(corner_at({at.x(), at.y(), 0.0}));
            for (std::size_t k = 0; k < corners.size(); ++k)
                sides.emplace_back(corners[k], corners[(k + 1) % corners.size()]);
        }
        std::sort(sides.begin(), sides.end());
    }
    std::uint32_t corner_at(const Eigen::Vector3d& place)
    {
        for (std::size_t known = 0; known < places.size(); ++known)
            if (places[known] == place)
                return static_cast<std::uint32_t>(known);
        places.push_back(place);
        return static_cast<std::uint32_t>(places.size() - 1);
    }
    /// From above, where it lies, and turned.
    bool is_seen_whole() const
    {
        ContourView view;
        const bool is_seen =
            view.sees_all(sides, views_of(Eigen::Vector3d::UnitZ()), places);
        std::vector<Eigen::Vector3d> turned;
        for (const Eigen::Vector3d& x : places)
            turned.emplace_back(5.0 - 3.0 * x.z(), 3.0 * x.x() - 7.0, 3.0 * x.y() + 1.0);
        EXPECT_EQ(view.sees_all(sides, views_of(Eigen::Vector3d(1.0, 0.1, 0.2)), turned),
                  is_seen);
        return is_seen;
    }
};

Loop square(double x, double y, double size)
{
    return {{x, y}, {x + size, y}, {x + size, y + size}, {x, y + size}};
}

Loop reversed(Loop loop)
{
    std::reverse(loop.begin(), loop.end());
    return loop;
}

} // namespace

TEST(SurfacePatches, contours_are_the_sides_that_do_not_cancel)
{
    const Shape sheet = support::sheet_shape(4, 1, 16);
    std::vector<std::uint32_t> joined(sheet.samples.size()),
        order(sheet.triangles.size());
    std::iota(joined.begin(), joined.end(), 0u);
    std::iota(order.begin(), order.end(), 0u);
    const SurfacePatches patches(sheet.triangles, joined, order,
                                 [](std::size_t k) { return k % 1000 == 999; });
    std::size_t covered = 0;
    for (std::size_t p = 0; p < patches.num_patches(0); ++p)
    {
        const auto [begin, end] = patches.range(0, p);
        EXPECT_EQ(begin, covered);
        EXPECT_LE(end - begin, SurfacePatches::kSmallest);
        EXPECT_EQ(begin / 1000, (end - 1) / 1000);
        covered = end;
    }
    EXPECT_EQ(covered, order.size());
    const std::size_t top = patches.num_levels() - 1;
    ASSERT_EQ(patches.num_patches(top), 1u);
    EXPECT_EQ(patches.range(top, 0)[1], order.size());
    // The border of the sheet.
    EXPECT_EQ(patches.contour(top, 0).size(), 2u * (16 + 64));
    for (const Side& side : patches.contour(top, 0))
        for (const std::uint32_t corner : {side.from(), side.to()})
        {
            const Eigen::Vector3d& x = sheet.samples[corner];
            EXPECT_TRUE(x.x() == 0.0 || x.x() == 4.0 || x.y() == 0.0 || x.y() == 1.0);
        }
    // A closed body has none.
    const Shape box = support::box_shape({0, 0, 0}, {1, 1, 1}, 4);
    joined.resize(box.samples.size());
    order.resize(box.triangles.size());
    const SurfacePatches whole(box.triangles, joined, order,
                               [](std::size_t) { return false; });
    EXPECT_TRUE(whole.contour(0, 0).empty());
}

TEST(ContourView, sees_what_is_covered_once)
{
    EXPECT_TRUE(Picture({square(0, 0, 1)}).is_seen_whole());
    EXPECT_TRUE(Picture({square(0, 0, 1), square(2, 0, 1)}).is_seen_whole());
    // A hole, and a piece in it.
    EXPECT_TRUE(Picture({square(0, 0, 5), reversed(square(1, 1, 3))}).is_seen_whole());
    EXPECT_TRUE(Picture({square(0, 0, 5), reversed(square(1, 1, 3)), square(2, 2, 1)})
                    .is_seen_whole());
    // Two that share a corner.
    EXPECT_TRUE(Picture({square(0, 0, 1), square(1, 1, 1)}).is_seen_whole());
    // A comb.
    EXPECT_TRUE(Picture({{{0, 0},
                          {5, 0},
                          {5, 3},
                          {4, 3},
                          {4, 1},
                          {3, 1},
                          {3, 3},
                          {2, 3},
                          {2, 1},
                          {1, 1},
                          {1, 3},
                          {0, 3}}})
                    .is_seen_whole());
}

TEST(ContourView, does_not_see_what_is_covered_twice)
{
    EXPECT_FALSE(Picture({square(0, 0, 2), square(1, 1, 2)}).is_seen_whole());
    EXPECT_FALSE(Picture({square(0, 0, 5), square(1, 1, 3)}).is_seen_whole()); // above it
    EXPECT_FALSE(Picture({square(0, 0, 5), square(0, 0, 5)}).is_seen_whole());
    EXPECT_FALSE(
        Picture({square(0, 0, 5), square(0, 0, 3)}).is_seen_whole()); // one corner
    EXPECT_FALSE(Picture({square(0, 0, 1), square(1, 0, 1)}).is_seen_whole()); // a slit
    EXPECT_FALSE(Picture({{{0, 0}, {2, 2}, {2, 0}, {0, 2}}}).is_seen_whole()); // an eight
    // Round twice.
    EXPECT_FALSE(
        Picture({{{0, 0}, {9, 0}, {9, 9}, {1, 9}, {1, 1}, {8, 1}, {8, 8}, {0, 8}}})
            .is_seen_whole());
    // A tooth that folds over.
    EXPECT_FALSE(Picture({{{0, 0}, {4, 0}, {4, 4}, {3, 4}, {-1, 2}, {2, 4}, {0, 4}}})
                     .is_seen_whole());
    // Two that nearly touch are not sure.
    EXPECT_FALSE(
        Picture({square(0, 0, 1), {{1 + 1e-13, 0.5}, {2, 0}, {2, 1}}}).is_seen_whole());
    EXPECT_TRUE(
        Picture({square(0, 0, 1), {{1 + 1e-9, 0.5}, {2, 0}, {2, 1}}}).is_seen_whole());
}

TEST(ContourView, needs_a_direction_from_which_all_triangles_face_the_viewer)
{
    const Picture picture({square(0, 0, 1)});
    ContourView view;
    EXPECT_FALSE(view.sees_all(picture.sides, 0, picture.places));
    EXPECT_FALSE(view.sees_all({}, kAllViews, picture.places));
    // A right angle is seen from between its sides, opposite ones from nowhere.
    const auto both = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b)
    { return views_of(a) & views_of(b); };
    EXPECT_NE(both({0, 0, 2}, {0, 3, 0}), 0u);
    EXPECT_NE(both({0, 0, 2}, {1, 1, -1}), 0u);
    EXPECT_EQ(both({0.3, 0, 2}, {-0.3, 0, -2}), 0u);
    EXPECT_EQ(views_of(Eigen::Vector3d::Zero()), 0u);
}

} // namespace cellwarp::core
