// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/face_triangles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <string>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Triangle = FaceCutter::Triangle;
using Polygon = std::vector<Vector2d>;

double number(std::mt19937& rng, double low, double high)
{
    return low + (high - low) * (static_cast<double>(rng()) / 4294967296.0);
}

double cross(const Vector2d& a, const Vector2d& b)
{
    return a.x() * b.y() - a.y() * b.x();
}

double area(const Polygon& polygon)
{
    double twice = 0.0;
    for (std::size_t k = 0; k < polygon.size(); ++k)
        twice += cross(polygon[k], polygon[(k + 1) % polygon.size()]);
    return 0.5 * twice;
}

/// A wedge of teeth, each with a gap beside it.
Polygon comb(int teeth)
{
    Polygon polygon = {{0, 0}, {2.0 * teeth - 1, 0}};
    for (int k = teeth - 1; k >= 0; --k)
    {
        polygon.emplace_back(2 * k + 1, 4);
        polygon.emplace_back(2 * k, 4 + 0.1 * k);
        if (k > 0)
        {
            polygon.emplace_back(2 * k, 1);
            polygon.emplace_back(2 * k - 1, 1.2);
        }
    }
    return polygon;
}

Polygon star(int tips, double inner)
{
    Polygon polygon;
    for (int k = 0; k < 2 * tips; ++k)
    {
        const double angle = std::numbers::pi * k / tips, r = k % 2 == 0 ? 1.0 : inner;
        polygon.emplace_back(r * std::cos(angle), r * std::sin(angle));
    }
    return polygon;
}

/// A band around a spiral.
Polygon spiral(int corners, double turns)
{
    Polygon out, in;
    for (int k = 0; k <= corners / 2; ++k)
    {
        const double angle = 2.0 * std::numbers::pi * turns * k / (corners / 2);
        const Vector2d to(std::cos(angle), std::sin(angle));
        out.push_back((1.4 + angle / 6.0) * to);
        in.push_back((1.0 + angle / 6.0) * to);
    }
    out.insert(out.end(), in.rbegin(), in.rend());
    return out;
}

/// Anything that does not cross itself: pieces between two edges that cross are turned
/// over until none do.
Polygon random_polygon(int corners, std::mt19937& rng)
{
    Polygon polygon;
    for (int k = 0; k < corners; ++k)
        polygon.emplace_back(number(rng, -1, 1), number(rng, -1, 1));
    const auto do_cross =
        [](const Vector2d& a, const Vector2d& b, const Vector2d& c, const Vector2d& d)
    {
        return cross(b - a, c - a) * cross(b - a, d - a) < 0 &&
               cross(d - c, a - c) * cross(d - c, b - c) < 0;
    };
    for (bool has_crossing = true; has_crossing;)
    {
        has_crossing = false;
        const std::size_t n = polygon.size();
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t j = i + 2; j < n; ++j)
                if (do_cross(polygon[i], polygon[i + 1], polygon[j],
                             polygon[(j + 1) % n]))
                {
                    std::reverse(polygon.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                                 polygon.begin() + static_cast<std::ptrdiff_t>(j) + 1);
                    has_crossing = true;
                }
    }
    if (area(polygon) < 0.0)
        std::reverse(polygon.begin(), polygon.end());
    return polygon;
}

struct Named
{
    std::string name;
    Polygon polygon;
};

std::vector<Named> polygons()
{
    std::vector<Named> all = {
        {"T", {{0, 0}, {4, 0}, {4, 1}, {2.5, 1}, {2.5, 3}, {1.5, 3}, {1.5, 1}, {0, 1}}},
        {"L", {{0, 0}, {4, 0}, {4, 1}, {1, 1}, {1, 2}, {0, 2}}},
        {"U", {{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}}},
        {"arrow", {{0, 0}, {3, 1}, {0, 2}, {1, 1}}},
        {"comb", comb(6)},
        {"star", star(5, 0.2)},
        {"spiral", spiral(60, 2.5)},
        {"collinear",
         {{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 1}, {3, 2}, {1.5, 1}, {0, 2}, {0, 1}}},
        {"coincident",
         {{0, 0}, {0, 0}, {4, 0}, {4, 3}, {2, 1}, {2, 1}, {2, 1}, {0, 3}, {0, 3}}},
        {"a hole, through a slit",
         {{0, 0},
          {4, 0},
          {4, 4},
          {0, 4},
          {0, 0},
          {1, 1},
          {1, 3},
          {3, 3},
          {3, 1},
          {1, 1}}},
        {"two holes, through slits from one corner",
         {{0, 0},
          {8, 0},
          {8, 4},
          {0, 4},
          {0, 0},
          {1, 2},
          {2, 3},
          {2, 2},
          {1, 2},
          {0, 0},
          {5, 1},
          {6, 3},
          {7, 1},
          {5, 1}}}};
    std::mt19937 rng(7);
    for (const int corners : {5, 6, 8, 13, 30, 60})
        for (int k = 0; k < 10; ++k)
            all.push_back({"random " + std::to_string(corners) + "." + std::to_string(k),
                           random_polygon(corners, rng)});
    return all;
}

Geometry face_of(const std::vector<Vector3d>& places)
{
    Geometry geometry;
    geometry.samples = places;
    for (std::size_t k = 0; k < places.size(); ++k)
        geometry.corners.push_back(static_cast<std::uint32_t>(k));
    geometry.face_ends.push_back(places.size());
    return geometry;
}

std::vector<Vector3d> in_space(const Polygon& polygon, const Matrix3d& Q)
{
    std::vector<Vector3d> places;
    for (const Vector2d& x : polygon)
        places.push_back(Q * Vector3d(x.x(), x.y(), 0.5));
    return places;
}

/// How often the triangles cover a place of the plane: the sum of their directions.
int covered(const Polygon& polygon, const std::vector<Triangle>& triangles,
            const Vector2d& x)
{
    int sum = 0;
    for (const Triangle& t : triangles)
    {
        int left = 0, right = 0;
        for (std::size_t k = 0; k < 3; ++k)
        {
            const Vector2d &a = polygon[t[k]], &b = polygon[t[(k + 1) % 3]];
            const double side = cross(b - a, x - a);
            left += side > 0.0;
            right += side < 0.0;
        }
        sum += left == 3 ? 1 : right == 3 ? 10 : 0;
    }
    return sum;
}

bool is_in(const Polygon& polygon, const Vector2d& x)
{
    bool is_inside = false;
    for (std::size_t k = 0; k < polygon.size(); ++k)
    {
        const Vector2d &a = polygon[k], &b = polygon[(k + 1) % polygon.size()];
        if ((a.y() > x.y()) != (b.y() > x.y()) &&
            x.x() < a.x() + (x.y() - a.y()) / (b.y() - a.y()) * (b.x() - a.x()))
            is_inside = !is_inside;
    }
    return is_inside;
}

/// Triangles by the places of their corners, whatever comes first; sorted.
using Surface = std::vector<std::array<std::array<double, 3>, 3>>;
Surface surface_of(const Geometry& geometry, const std::vector<Triangle>& triangles)
{
    Surface surface;
    for (const Triangle& t : triangles)
    {
        std::array<std::array<double, 3>, 3> places;
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t axis = 0; axis < 3; ++axis)
                places[k][axis] = geometry.samples[t[k]][static_cast<int>(axis)];
        std::rotate(places.begin(), std::min_element(places.begin(), places.end()),
                    places.end());
        surface.push_back(places);
    }
    std::sort(surface.begin(), surface.end());
    return surface;
}

/// The surface of a face when another corner comes first and samples are renumbered.
Surface begun_at(const std::vector<Vector3d>& places, std::size_t first,
                 std::mt19937& rng)
{
    std::vector<std::uint32_t> number_of(places.size());
    for (std::size_t k = 0; k < places.size(); ++k)
        number_of[k] = static_cast<std::uint32_t>(k);
    std::shuffle(number_of.begin(), number_of.end(), rng);
    Geometry geometry;
    geometry.samples.resize(places.size());
    for (std::size_t k = 0; k < places.size(); ++k)
        geometry.samples[number_of[k]] = places[k];
    for (std::size_t k = 0; k < places.size(); ++k)
        geometry.corners.push_back(number_of[(first + k) % places.size()]);
    geometry.face_ends.push_back(places.size());
    return surface_of(geometry, triangles_of(geometry));
}

Surface surface_of(const std::vector<Vector3d>& places)
{
    const Geometry geometry = face_of(places);
    return surface_of(geometry, triangles_of(geometry));
}

/// Mirror images and quarter turns of all axes.
std::vector<Matrix3d> symmetries()
{
    std::vector<Matrix3d> all;
    std::array<int, 3> axes = {0, 1, 2};
    do
        for (int signs = 0; signs < 8; ++signs)
        {
            Matrix3d G = Matrix3d::Zero();
            for (int k = 0; k < 3; ++k)
                G(k, axes[static_cast<std::size_t>(k)]) = (signs >> k & 1) ? -1.0 : 1.0;
            all.push_back(G);
        }
    while (std::next_permutation(axes.begin(), axes.end()));
    return all;
}

std::vector<Vector3d> moved(std::vector<Vector3d> places, const Matrix3d& G)
{
    for (Vector3d& x : places)
        x = G * x;
    if (G.determinant() < 0.0)
        std::reverse(places.begin(), places.end());
    return places;
}

} // namespace

TEST(FaceTriangles, cover_a_flat_face_once_and_nothing_else)
{
    std::mt19937 rng(11);
    const Matrix3d turned =
        Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    for (const Named& named : polygons())
        for (const Matrix3d& Q : {Matrix3d(Matrix3d::Identity()), turned})
            for (std::size_t first = 0; first < named.polygon.size(); ++first)
            {
                SCOPED_TRACE(named.name + " from corner " + std::to_string(first));
                Polygon polygon = named.polygon;
                std::rotate(polygon.begin(),
                            polygon.begin() + static_cast<std::ptrdiff_t>(first),
                            polygon.end());
                const std::vector<Triangle> triangles =
                    triangles_of(face_of(in_space(polygon, Q)));
                ASSERT_EQ(triangles.size(), polygon.size() - 2);
                double sum = 0.0;
                for (const auto& [a, b, c] : triangles)
                {
                    const double part =
                        0.5 * cross(polygon[b] - polygon[a], polygon[c] - polygon[a]);
                    EXPECT_GE(part, -1e-12);
                    sum += part;
                }
                EXPECT_NEAR(sum, area(polygon), 1e-12);
                Vector2d low = polygon[0], high = polygon[0];
                for (const Vector2d& x : polygon)
                {
                    low = low.cwiseMin(x);
                    high = high.cwiseMax(x);
                }
                for (int k = 0; k < 20; ++k)
                {
                    const Vector2d x(number(rng, low.x(), high.x()),
                                     number(rng, low.y(), high.y()));
                    ASSERT_EQ(covered(polygon, triangles, x), is_in(polygon, x) ? 1 : 0);
                }
            }
}

TEST(FaceTriangles, do_not_depend_on_the_first_corner_nor_on_numbers)
{
    std::mt19937 rng(12);
    std::vector<Named> all = polygons();
    all.push_back({"bow tie", {{0, 0}, {1, 1}, {1, 0}, {0, 1}}});
    all.push_back({"askew bow tie", {{0, 0}, {1.3, 1}, {1.1, 0}, {0, 0.8}}});
    all.push_back(
        {"crosses itself", {{0, 0}, {3, 2}, {3, 0}, {0, 2}, {1.5, 3}, {1, -1}}});
    all.push_back({"pentagram", {{0, 3}, {-2, -2}, {3, 1}, {-3, 1}, {2, -2}}});
    for (const Named& named : all)
        for (const double height : {0.0, 0.3})
        {
            std::vector<Vector3d> places = in_space(named.polygon, Matrix3d::Identity());
            for (Vector3d& x : places)
                x.z() += height * number(rng, -1, 1);
            const Surface surface = surface_of(places);
            for (std::size_t first = 0; first < places.size(); ++first)
                ASSERT_EQ(begun_at(places, first, rng), surface) << named.name;
        }
}

TEST(FaceTriangles, of_mirror_images_and_quarter_turns_are_mirrored_and_turned)
{
    std::mt19937 rng(13);
    for (int trial = 0; trial < 200; ++trial)
    {
        // Not flat, and of none of the symmetries itself.
        std::vector<Vector3d> places =
            in_space(random_polygon(4 + trial % 9, rng), Matrix3d::Identity());
        for (Vector3d& x : places)
            x.z() = number(rng, -0.2, 0.2);
        const Geometry face = face_of(places);
        const std::vector<Triangle> triangles = triangles_of(face);
        for (const Matrix3d& G : symmetries())
        {
            Geometry image = face;
            for (Vector3d& x : image.samples)
                x = G * x;
            std::vector<Triangle> expected = triangles;
            if (G.determinant() < 0.0)
                for (Triangle& t : expected)
                    std::swap(t[1], t[2]);
            ASSERT_EQ(surface_of(moved(places, G)), surface_of(image, expected)) << trial;
        }
    }
}

TEST(FaceTriangles, of_a_saddle_meet_in_the_higher_diagonal)
{
    // Both diagonals are equally long, and lie one above the other.
    for (const double middle : {0.0, 1.0})
    {
        const std::vector<Vector3d> saddle = {
            {0, 0, middle}, {1, 0, 0.5}, {1, 1, middle}, {0, 1, 0.5}};
        for (const Matrix3d& G : symmetries())
        {
            const std::vector<Vector3d> places = moved(saddle, G);
            const Vector3d up = (places[2] - places[0]).cross(places[3] - places[1]);
            double highest = -INFINITY;
            for (const auto& [a, b, c] : triangles_of(face_of(places)))
                for (const auto& [p, q] :
                     {std::pair(a, b), std::pair(b, c), std::pair(c, a)})
                    if ((p + 2) % 4 == q) // the diagonal
                        highest = std::max(highest, up.dot(places[p] + places[q]));
            EXPECT_NEAR(
                highest,
                std::max(up.dot(places[0] + places[2]), up.dot(places[1] + places[3])),
                1e-12);
        }
    }
}

TEST(FaceTriangles, of_a_quadrilateral_fold_along_the_diagonal_that_bends_least)
{
    // One corner is raised: what stays flat is one triangle.
    const Surface raised =
        surface_of(std::vector<Vector3d>{{0, 0, 1}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
    const Surface expected = {{{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}},
                              {{{0, 1, 0}, {1, 0, 0}, {1, 1, 0}}}};
    Surface sorted = expected;
    for (auto& t : sorted)
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    std::sort(sorted.begin(), sorted.end());
    EXPECT_EQ(raised, sorted);
}

TEST(FaceTriangles, are_as_many_as_ever_where_numbers_are_hard)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    const std::vector<std::vector<Vector3d>> faces = {
        {{0, 0, 0}, {1, 0, 0}, {nan, 1, 0}, {0, 1, 0}},
        {{nan, nan, nan}, {nan, 0, 0}, {nan, 1, 0}, {0, 1, nan}, {0, 0, 1}},
        {{INFINITY, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {-1, 0, 0}},
        {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}},
        {{1, 2, 3}, {1, 2, 3}, {1, 2, 3}, {1, 2, 3}, {1, 2, 3}, {1, 2, 3}},
        {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}, {4, 4, 4}},
        std::vector<Vector3d>(40, Vector3d(nan, nan, nan))};
    for (const std::vector<Vector3d>& places : faces)
    {
        const std::vector<Triangle> triangles = triangles_of(face_of(places));
        ASSERT_EQ(triangles.size(), places.size() - 2);
        for (const Triangle& t : triangles)
            for (const std::uint32_t corner : t)
                EXPECT_LT(corner, places.size());
    }
    // Squares and higher powers of these are no numbers.
    for (const double scale : {1e150, 1e-150, 1e-300})
        for (const Named& named : polygons())
        {
            const std::vector<Vector3d> places =
                in_space(named.polygon, Matrix3d::Identity());
            std::vector<Vector3d> scaled = places;
            for (Vector3d& x : scaled)
                x *= 0.1 * scale;
            double sum = 0.0;
            for (const auto& [a, b, c] : triangles_of(face_of(scaled)))
                sum += std::abs((places[b] - places[a]).cross(places[c] - places[a]).z());
            EXPECT_NEAR(0.5 * sum, area(named.polygon), 1e-12) << named.name;
        }
}

TEST(FaceTriangles, of_faces_with_many_corners_take_no_square_of_their_number)
{
    constexpr int kMany = 40000;
    std::mt19937 rng(14);
    Polygon rough;
    for (int k = 0; k < kMany; ++k)
    {
        const double angle = 2.0 * std::numbers::pi * k / kMany,
                     r = number(rng, 0.2, 1.0);
        rough.emplace_back(r * std::cos(angle), r * std::sin(angle));
    }
    for (const Polygon& polygon : {comb(kMany / 4), star(kMany / 2, 0.5),
                                   spiral(kMany, 50.0), star(kMany / 2, 1.0), rough})
    {
        double sum = 0.0;
        for (const auto& [a, b, c] :
             triangles_of(face_of(in_space(polygon, Matrix3d::Identity()))))
            sum +=
                0.5 * std::abs(cross(polygon[b] - polygon[a], polygon[c] - polygon[a]));
        EXPECT_NEAR(sum, area(polygon), 1e-9 * area(polygon));
    }
}

} // namespace cellwarp::core
