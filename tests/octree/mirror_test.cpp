// SPDX-License-Identifier: GPL-3.0-or-later
// Mirror images and half turns of shapes whose faces lie where symmetry is easily lost:
// walls inside, shared or crossing, and boxes that the leaves overhang by a half.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "octree/cells.h"
#include "tests/support/bodies.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::box_shape;
using support::Built;
using support::built;
using support::joined;

namespace
{

/// Of all shapes here; leaves along the longest side leave a half over on the others.
const Eigen::Vector3d kSize(4.0, 1.5, 1.0);

struct Scene
{
    const char* name;
    Shape shape;
    bool is_symmetric; ///< about the middle of each axis
};

std::vector<Scene> scenes()
{
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    const Shape whole = box_shape(zero, kSize, 2);
    return {
        {"box", whole, true},
        // Each closed by itself: the wall between them stands twice.
        {"halves that share a wall",
         joined(box_shape(zero, {2.0, 1.5, 1.0}, 2), box_shape({2.0, 0, 0}, kSize, 2)),
         true},
        {"halves and a block across the wall",
         joined(joined(box_shape(zero, {2.0, 1.5, 1.0}, 2),
                       box_shape({2.0, 0, 0}, kSize, 2)),
                box_shape({1.25, 0.25, 0.25}, {2.75, 1.25, 0.75}, 2)),
         true},
        {"box with an open wall inside",
         joined(whole, {{{1.9, 0, 0}, {1.9, 1.5, 0}, {1.9, 1.5, 1}, {1.9, 0, 1}},
                        {{0, 1, 2}, {0, 2, 3}}}),
         false},
        {"thirds, one of them thin",
         joined(joined(box_shape(zero, {1.3, 1.5, 1.0}, 2),
                       box_shape({1.3, 0.5, 0.0}, {2.6, 1.0, 1.0}, 2)),
                box_shape({2.6, 0, 0}, kSize, 2)),
         false}};
}

Eigen::Vector3d image(const Eigen::Vector3d& x, const Eigen::Vector3d& signs)
{
    return (signs.array() < 0).select(kSize - x, x);
}

/// What tells a cell from others, and what of it must come out alike.
std::vector<std::array<double, 6>> cells_of(const Built& body,
                                            const Eigen::Vector3d& signs)
{
    std::vector<std::array<double, 6>> list;
    for (const Cell& cell : body.cells.cells)
    {
        const Eigen::Vector3d x = image(cell.box_centre, signs);
        const Eigen::Vector3d c = image(cell.centre, signs);
        list.push_back({x.x(), x.y(), x.z(), cell.volume, cell.edge,
                        c.x() + 2.0 * c.y() + 3.0 * c.z()});
    }
    return list;
}

std::vector<std::array<double, 6>> faces_of(const Built& body,
                                            const Eigen::Vector3d& signs)
{
    std::vector<std::array<double, 6>> list;
    for (const Face& face : body.cells.faces)
    {
        const Eigen::Vector3d x = image(face.centre, signs);
        list.push_back({x.x(), x.y(), x.z(), face.area, face.distance,
                        face.turning.trace() + face.axis});
    }
    return list;
}

void expect_same(std::vector<std::array<double, 6>> a,
                 std::vector<std::array<double, 6>> b, const std::string& what)
{
    ASSERT_EQ(a.size(), b.size()) << what;
    // Numbers that are equal but for rounding are sorted alike.
    const auto before =
        [](const std::array<double, 6>& one, const std::array<double, 6>& other)
    {
        for (std::size_t k = 0; k < one.size(); ++k)
            if (std::abs(one[k] - other[k]) > 1e-9)
                return one[k] < other[k];
        return false;
    };
    std::sort(a.begin(), a.end(), before);
    std::sort(b.begin(), b.end(), before);
    for (std::size_t i = 0; i < a.size(); ++i)
        for (std::size_t k = 0; k < a[i].size(); ++k)
            ASSERT_NEAR(a[i][k], b[i][k], 1e-9) << what << ", " << i << " " << k;
}

void expect_images(const Built& one, const Built& other, const Eigen::Vector3d& signs,
                   const std::string& what)
{
    const VoxelGrid &a = one.material.grid, &b = other.material.grid;
    ASSERT_EQ(a.counts(), b.counts()) << what;
    std::size_t num_different = 0;
    for (std::size_t v = 0; v < a.size(); ++v)
    {
        const Eigen::Vector3i place = a.coordinates(v);
        const Eigen::Vector3i there =
            (signs.array() < 0)
                .select(a.counts() - Eigen::Vector3i::Ones() - place, place);
        num_different += a.material()[v] != b.material()[b.index(there)];
    }
    EXPECT_EQ(num_different, 0u) << what;
    expect_same(cells_of(one, signs), cells_of(other, Eigen::Vector3d::Ones()), what);
    expect_same(faces_of(one, signs), faces_of(other, Eigen::Vector3d::Ones()), what);
}

} // namespace

TEST(Mirror, walls_inside_and_leaves_that_overhang_by_a_half_come_out_alike)
{
    for (const Scene& scene : scenes())
        for (const int across : {3, 4, 5, 8})
            for (const int depth : {0, 1})
                for (const Fill fill : {Fill::Solid, Fill::Shell})
                {
                    const Built rest = built(scene.shape, across, depth, fill, 0.06);
                    for (const Eigen::Vector3d& signs :
                         {Eigen::Vector3d(-1, 1, 1), Eigen::Vector3d(1, -1, 1),
                          Eigen::Vector3d(1, 1, -1), Eigen::Vector3d(-1, -1, 1)})
                    {
                        const std::string what =
                            std::string(scene.name) + ", " + std::to_string(across) +
                            " across, depth " + std::to_string(depth) +
                            (fill == Fill::Solid ? "" : ", shell");
                        const Built turned =
                            built(support::turned(scene.shape, signs.asDiagonal()),
                                  across, depth, fill, 0.06);
                        expect_images(rest, turned, signs, what);
                        if (scene.is_symmetric)
                            expect_images(rest, rest, signs, what + ", itself");
                    }
                }
}

} // namespace cellwarp::core
