// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/self_intersections.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <map>
#include <numbers>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "octree/base/parallel.h"
#include "octree/wrap/triangle_pair.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Corners = std::array<Eigen::Vector3d, 3>;

std::int64_t count_of(const Shape& shape)
{
    return IntersectionCounter(shape.triangles, shape.samples).count(shape.samples)->all;
}

/// By looking at every pair.
std::int64_t count_by_pairs(const Shape& shape)
{
    std::int64_t count = 0;
    for (std::size_t i = 0; i < shape.triangles.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
        {
            const auto corners = [&](std::size_t t)
            {
                const Triangle& of = shape.triangles[t];
                return Corners{shape.samples[of[0]], shape.samples[of[1]],
                               shape.samples[of[2]]};
            };
            count += triangles_meet(corners(i), corners(j), 0);
        }
    return count;
}

/// The same, for triangles that share corners: samples that are at one place at \p rest.
std::int64_t count_of_neighbours(const Shape& shape,
                                 const std::vector<Eigen::Vector3d>& rest)
{
    std::int64_t count = 0;
    for (std::size_t i = 0; i < shape.triangles.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
        {
            Triangle a = shape.triangles[i], b = shape.triangles[j];
            std::size_t shared = 0;
            for (std::size_t k = 0; k < 3; ++k)
                for (std::size_t l = shared; l < 3; ++l)
                    if (rest[a[k]] == rest[b[l]])
                    {
                        std::swap(a[k], a[shared]);
                        std::swap(b[l], b[shared]);
                        ++shared;
                        break;
                    }
            const auto corners = [&](const Triangle& t) {
                return Corners{shape.samples[t[0]], shape.samples[t[1]],
                               shape.samples[t[2]]};
            };
            count += triangles_meet(corners(a), corners(b), static_cast<int>(shared));
        }
    return count;
}

/// All pairs whose boxes meet, found along x and tested one by one.
SelfIntersections full_count(const Shape& rest, const std::vector<Eigen::Vector3d>& now)
{
    std::vector<Eigen::AlignedBox3d> boxes(rest.triangles.size());
    std::vector<std::size_t> order(boxes.size());
    for (std::size_t t = 0; t < boxes.size(); ++t)
    {
        order[t] = t;
        for (const std::uint32_t corner : rest.triangles[t])
            boxes[t].extend(now[corner]);
    }
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b)
              { return boxes[a].min().x() < boxes[b].min().x(); });
    SelfIntersections found;
    const auto test = [&](std::size_t one, std::size_t other)
    {
        Triangle a = rest.triangles[one], b = rest.triangles[other];
        std::size_t shared = 0;
        for (std::size_t k = 0; k < 3; ++k)
            for (std::size_t l = shared; l < 3; ++l)
                if (rest.samples[a[k]] == rest.samples[b[l]])
                {
                    std::swap(a[k], a[shared]);
                    std::swap(b[l], b[shared]);
                    ++shared;
                    break;
                }
        const auto do_meet = [&](const std::vector<Eigen::Vector3d>& at)
        {
            return triangles_meet({at[a[0]], at[a[1]], at[a[2]]},
                                  {at[b[0]], at[b[1]], at[b[2]]},
                                  static_cast<int>(shared));
        };
        if (!do_meet(now))
            return;
        ++found.all;
        if (do_meet(rest.samples))
            return;
        ++found.fresh;
        found.first_fresh =
            std::min(found.first_fresh.value_or(one), std::min(one, other));
    };
    for (std::size_t i = 0; i < order.size(); ++i)
        for (std::size_t j = i + 1;
             j < order.size() && boxes[order[j]].min().x() <= boxes[order[i]].max().x();
             ++j)
            if (boxes[order[i]].intersects(boxes[order[j]]))
                test(order[i], order[j]);
    return found;
}

/// The same surface in four times as many triangles, \p times.
Shape finer(Shape shape, int times)
{
    for (; times > 0; --times)
    {
        Shape next;
        next.samples = shape.samples;
        std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
        const auto middle = [&](std::uint32_t a, std::uint32_t b)
        {
            const auto [at, is_new] =
                middles.try_emplace(std::minmax(a, b), next.samples.size());
            if (is_new)
                next.samples.push_back(0.5 * (shape.samples[a] + shape.samples[b]));
            return at->second;
        };
        for (const auto& [a, b, c] : shape.triangles)
        {
            const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
            for (const Triangle& t : {Triangle{a, ab, ca}, Triangle{ab, b, bc},
                                      Triangle{ca, bc, c}, Triangle{ab, bc, ca}})
                next.triangles.push_back(t);
        }
        shape = std::move(next);
    }
    return shape;
}

/// Ways to move a shape whose longest side is about 1 along x.
using Move = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;
std::vector<Move> moves()
{
    const auto bend = [](double angle)
    {
        return [=](const Eigen::Vector3d& x)
        {
            const double radius = 1.0 / angle - x.y();
            return Eigen::Vector3d(radius * std::sin(angle * x.x()),
                                   1.0 / angle - radius * std::cos(angle * x.x()), x.z());
        };
    };
    const auto twist = [](double angle)
    {
        return [=](const Eigen::Vector3d& x) -> Eigen::Vector3d
        { return Eigen::AngleAxisd(angle * x.x(), Eigen::Vector3d::UnitX()) * x; };
    };
    const auto noise = [](double size)
    {
        return [size, rng = std::mt19937(11)](const Eigen::Vector3d& x) mutable
        { return Eigen::Vector3d(x + support::random_vector(rng, size)); };
    };
    const auto wave = [](double size)
    {
        return [=](const Eigen::Vector3d& x)
        {
            return Eigen::Vector3d(x +
                                   size * Eigen::Vector3d(std::sin(31.0 * x.y() + x.z()),
                                                          std::sin(37.0 * x.x()),
                                                          std::sin(29.0 * x.x() + 1.0)));
        };
    };
    return {[](const Eigen::Vector3d& x) { return x; },
            bend(1.5),
            bend(-4.0),
            bend(7.0),
            twist(4.0),
            twist(40.0),
            noise(1e-3),
            noise(1e-2),
            wave(0.02),
            wave(0.1),
            [](const Eigen::Vector3d& x)
            { return Eigen::Vector3d(std::abs(x.x() - 0.1), x.y(), x.z()); },
            [](const Eigen::Vector3d& x)
            { return Eigen::Vector3d(-x.x(), x.y(), 0.3 * x.z() * x.z()); },
            [](const Eigen::Vector3d& x)
            { return Eigen::Vector3d(x.x(), x.y() + x.x() * x.x(), 1e-9 * x.z()); }};
}

/// How many pairs intersect of the shape moved in all those ways.
std::int64_t expect_full_counts(Shape shape, const std::string& name)
{
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& x : shape.samples)
        box.extend(x);
    Eigen::Index longest = 0;
    const double size = box.sizes().maxCoeff(&longest);
    for (Eigen::Vector3d& x : shape.samples)
    {
        x = (x - box.center()) / size;
        std::rotate(x.data(), x.data() + longest, x.data() + 3);
    }
    const IntersectionCounter counter(shape.triangles, shape.samples);
    std::int64_t count = 0;
    int which = 0;
    for (const Move& move : moves())
    {
        SCOPED_TRACE(name + ", way " + std::to_string(which++));
        std::vector<Eigen::Vector3d> moved(shape.samples.size());
        // By place, so that samples at one place stay together.
        std::map<std::array<double, 3>, Eigen::Vector3d> known;
        for (std::size_t i = 0; i < moved.size(); ++i)
        {
            const Eigen::Vector3d& x = shape.samples[i];
            const auto [at, is_new] = known.try_emplace({x.x(), x.y(), x.z()});
            if (is_new)
                at->second = move(x);
            moved[i] = at->second;
        }
        const SelfIntersections wanted = full_count(shape, moved);
        const SelfIntersections found = *counter.count(moved);
        EXPECT_EQ(found.all, wanted.all);
        EXPECT_EQ(found.fresh, wanted.fresh);
        EXPECT_EQ(found.first_fresh, wanted.first_fresh);
        count += wanted.all;
    }
    return count;
}

/// Triangles around the origin, which see it one after the other: \p turns times around
/// the z axis, on a wavy cone.
Shape fan(int count, double turns, double wave)
{
    Shape shape;
    shape.samples.push_back(Eigen::Vector3d::Zero());
    const bool is_closed = turns == std::round(turns);
    const int corners = is_closed ? count : count + 1;
    for (int k = 0; k < corners; ++k)
    {
        const double angle = 2.0 * std::numbers::pi * turns * k / count;
        shape.samples.push_back({std::cos(angle), std::sin(angle),
                                 0.3 + wave * std::sin(3.0 * angle + 0.4 * k)});
    }
    for (int k = 0; k < count; ++k)
        shape.triangles.push_back({0, static_cast<std::uint32_t>(k + 1),
                                   static_cast<std::uint32_t>((k + 1) % corners + 1)});
    return shape;
}

const Corners kTriangle = {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(2, 0, 0),
                           Eigen::Vector3d(0, 2, 0)};

} // namespace

TEST(SelfIntersections, of_closed_bodies_are_none)
{
    for (const Shape& shape :
         {support::l_prism(), support::comb(), support::steps(),
          support::sheet_shape(3, 1), support::box_shape({0, 0, 0}, {1, 2, 3}, 7)})
    {
        EXPECT_EQ(count_of(shape), 0);
        Shape turned = shape;
        const Eigen::AngleAxisd turn(0.7, Eigen::Vector3d(1, 2, 3).normalized());
        for (Eigen::Vector3d& x : turned.samples)
            x = turn * x;
        EXPECT_EQ(count_of(turned), 0);
        Shape mirrored = shape;
        for (Eigen::Vector3d& x : mirrored.samples)
            x.x() = -x.x();
        EXPECT_EQ(count_of(mirrored), 0);
    }
}

TEST(SelfIntersections, of_a_soup_are_those_of_all_its_pairs)
{
    std::mt19937 rng(7);
    for (const double size : {0.02, 0.1, 0.5})
    {
        Shape soup;
        for (std::uint32_t t = 0; t < 300; ++t)
        {
            const Eigen::Vector3d middle = support::random_vector(rng, 1.0);
            for (int k = 0; k < 3; ++k)
                soup.samples.push_back(middle + size * support::random_vector(rng, 1.0));
            soup.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
        }
        const std::int64_t expected = count_by_pairs(soup);
        EXPECT_GT(expected, size > 0.4 ? 100 : size > 0.05 ? 0 : -1);
        EXPECT_EQ(count_of(soup), expected) << size;
        const ThreadLimit one(1);
        EXPECT_EQ(count_of(soup), expected);
    }
}

TEST(SelfIntersections, tell_those_of_rest_from_new_ones)
{
    // Two boxes overlap, a third comes.
    Shape shape =
        support::joined(support::box_shape({0, 0, 0}, {1, 1, 1}, 3),
                        support::box_shape({0.53, 0.2, 0.21}, {1.5, 0.7, 0.75}, 3));
    const std::int64_t at_rest = count_of(shape);
    EXPECT_GT(at_rest, 10);
    const std::size_t first = shape.samples.size();
    shape = support::joined(shape, support::box_shape({0, 0, 5}, {1, 1, 6}, 3));
    EXPECT_EQ(count_of(shape), at_rest);
    std::vector<Eigen::Vector3d> moved = shape.samples;
    for (std::size_t i = first; i < moved.size(); ++i)
        moved[i] += Eigen::Vector3d(-0.31, 0.33, -4.57);
    const SelfIntersections now =
        *IntersectionCounter(shape.triangles, shape.samples).count(moved);
    EXPECT_GT(now.fresh, 10);
    EXPECT_EQ(now.all, at_rest + now.fresh);
    // All new ones are among the first of their triangles and those behind it; without
    // it there are fewer.
    ASSERT_TRUE(now.first_fresh);
    const auto fresh_from = [&](std::size_t triangle)
    {
        return IntersectionCounter(std::span(shape.triangles).subspan(triangle),
                                   shape.samples)
            .count(moved)
            ->fresh;
    };
    EXPECT_EQ(fresh_from(*now.first_fresh), now.fresh);
    EXPECT_LT(fresh_from(*now.first_fresh + 1), now.fresh);
    const SelfIntersections apart =
        *IntersectionCounter(shape.triangles, moved).count(shape.samples);
    EXPECT_EQ(apart.all, at_rest);
    EXPECT_EQ(apart.fresh, 0);
    EXPECT_FALSE(apart.first_fresh);
    // One counter tells of one place after another, also of one far from the rest.
    const IntersectionCounter counter(shape.triangles, shape.samples);
    std::vector<Eigen::Vector3d> shuffled = shape.samples;
    std::mt19937 rng(2);
    std::shuffle(shuffled.begin(), shuffled.end(), rng);
    const std::int64_t wild = counter.count(shuffled)->all;
    EXPECT_GT(wild, now.all);
    EXPECT_EQ(counter.count(moved)->fresh, now.fresh);
    EXPECT_EQ(counter.count(shape.samples)->all, at_rest);
    EXPECT_EQ(counter.count(shuffled)->all, wild);
}

TEST(SelfIntersections, of_neighbours_are_what_they_share_beyond_corner_and_edge)
{
    const auto [a, b, c] = kTriangle;
    const auto beside = [&](const Eigen::Vector3d& third) {
        return triangles_meet({a, b, c}, {a, b, third}, 2);
    };
    EXPECT_FALSE(beside({0, -1, 0}));
    EXPECT_FALSE(beside({0, 1, 1e-300}));
    EXPECT_TRUE(beside({0, 1, 0})); // folded onto it
    const auto at_corner = [&](const Eigen::Vector3d& s, const Eigen::Vector3d& t) {
        return triangles_meet({a, b, c}, {a, s, t}, 1);
    };
    EXPECT_FALSE(at_corner({-1, 0, 0}, {0, -1, 0}));
    EXPECT_FALSE(at_corner({1, 1, 1}, {1, 1, 2}));
    EXPECT_TRUE(at_corner({0.5, 0.5, 1}, {0.5, 0.5, -1})); // its edge passes through
    EXPECT_TRUE(at_corner({3, 3, 1}, {3, 3, -1}));         // the other's edge does
    EXPECT_TRUE(at_corner({0.5, 0.1, 0}, {0.1, 0.5, 0}));  // inside it
    EXPECT_TRUE(triangles_meet(kTriangle, kTriangle, 3));
    // Corners at one place are one, whatever their numbers.
    Shape soup;
    soup.samples = {a, b, c, b, a, Eigen::Vector3d(0, -1, 0.5)};
    soup.triangles = {{0, 1, 2}, {3, 4, 5}};
    EXPECT_EQ(count_of(soup), 0);
}

TEST(SelfIntersections, of_crumpled_surfaces_are_those_of_all_their_pairs)
{
    std::mt19937 rng(5);
    std::int64_t count = 0;
    for (const double noise : {0.02, 0.1, 0.2, 0.4})
        for (const Shape& smooth : {support::box_shape({0, 0, 0}, {1, 2, 3}, 5),
                                    support::comb(), support::sheet_shape(3, 1, 5)})
        {
            Shape shape = smooth;
            for (Eigen::Vector3d& x : shape.samples)
                x += support::random_vector(rng, noise);
            const std::int64_t wanted = count_of_neighbours(shape, shape.samples);
            EXPECT_EQ(count_of(shape), wanted);
            count += wanted;
        }
    EXPECT_GT(count, 1000);
}

TEST(SelfIntersections, around_one_corner_are_those_of_all_its_pairs)
{
    std::int64_t count = 0;
    // Where their number is even, edges point opposite ways.
    for (const int triangles : {8, 11, 12})
        for (const double turns : {0.7, 1.0, 1.4, 2.0, 3.0})
            for (const double wave : {0.0, 0.2, 1.5})
            {
                const Shape one = fan(triangles, turns, wave);
                EXPECT_EQ(count_of(one), count_of_neighbours(one, one.samples))
                    << triangles << " " << turns << " " << wave;
                // Two that have nothing but the corner in common, or pass through each
                // other.
                for (const double lift : {-1.0, 0.4, 1.0})
                {
                    Shape other = fan(triangles, 1.0, wave);
                    for (Eigen::Vector3d& x : other.samples)
                        x.z() *= lift;
                    const Shape both = support::joined(one, other);
                    const std::int64_t wanted = count_of_neighbours(both, both.samples);
                    EXPECT_EQ(count_of(both), wanted)
                        << triangles << " " << turns << " " << wave << " " << lift;
                    count += wanted;
                }
            }
    EXPECT_GT(count, 300);
}

TEST(SelfIntersections, around_a_corner_are_found_where_steep_edges_lie_above_each_other)
{
    // Twice around: the first edge and the one half-way lie above each other, at more
    // than a right angle.
    Shape shape = fan(8, 2.0, 0.0);
    shape.samples[1].z() = 1.0;
    shape.samples[5].z() = -2.0;
    const std::int64_t wanted = count_of_neighbours(shape, shape.samples);
    EXPECT_GT(wanted, 0);
    EXPECT_EQ(count_of(shape), wanted);
}

TEST(SelfIntersections, are_found_where_a_seam_has_come_open)
{
    // Two halves of a fan with samples of their own: one is turned into the other.
    Shape shape = fan(12, 1.0, 0.1);
    const std::vector<Eigen::Vector3d> once = shape.samples;
    for (std::size_t t = 6; t < 12; ++t)
        for (std::uint32_t& corner : shape.triangles[t])
            corner += 13;
    shape.samples.insert(shape.samples.end(), once.begin(), once.end());
    const std::vector<Eigen::Vector3d> rest = shape.samples;
    EXPECT_EQ(IntersectionCounter(shape.triangles, rest).count(rest)->all, 0);
    const Eigen::AngleAxisd turn(2.0, Eigen::Vector3d(1, 0, 1).normalized());
    for (std::size_t i = 13; i < shape.samples.size(); ++i)
        shape.samples[i] = turn * shape.samples[i];
    const std::int64_t wanted = count_of_neighbours(shape, rest);
    EXPECT_GT(wanted, 0);
    EXPECT_EQ(IntersectionCounter(shape.triangles, rest).count(shape.samples)->fresh,
              wanted);
}

TEST(SelfIntersections, of_moved_surfaces_are_those_of_a_full_count)
{
    // Thousands of triangles, so that there are patches of several levels.
    std::int64_t count =
        expect_full_counts(finer(support::l_prism(), 2), "L-prism") +
        expect_full_counts(finer(support::comb(), 2), "comb") +
        expect_full_counts(support::sheet_shape(3, 1, 14), "sheet") +
        expect_full_counts(
            support::joined(support::box_shape({0, 0, 0}, {1, 0.1, 0.1}, 10),
                            support::box_shape({0.2, 0.11, 0.02}, {1.4, 0.2, 0.13}, 9)),
            "two bars side by side") +
        expect_full_counts(
            support::joined(
                support::sheet_shape(2, 1, 14),
                finer(support::box_shape({0.4, 0.4, -0.3}, {0.7, 0.7, 0.3}, 3), 1)),
            "sheet and a box through it");
    // Faces turned over at random, and with corners of their own.
    Shape soup = support::box_shape({0, 0, 0}, {3, 1, 1}, 10);
    std::mt19937 rng(3);
    std::shuffle(soup.triangles.begin(), soup.triangles.end(), rng);
    for (Triangle& t : soup.triangles)
        if (rng() % 9 == 0)
            std::swap(t[0], t[1]);
    count += expect_full_counts(soup, "faces turned over");
    Shape apart;
    for (const Triangle& t : soup.triangles)
    {
        const auto first = static_cast<std::uint32_t>(apart.samples.size());
        for (const std::uint32_t corner : t)
            apart.samples.push_back(soup.samples[corner]);
        apart.triangles.push_back({first, first + 1, first + 2});
    }
    count += expect_full_counts(apart, "soup");
    // Some twice, some without area.
    for (std::size_t t = 0; t < 40; ++t)
    {
        soup.triangles.push_back(soup.triangles[17 * t]);
        soup.triangles.push_back({soup.triangles[13 * t][0], soup.triangles[13 * t][1],
                                  soup.triangles[13 * t][0]});
    }
    count += expect_full_counts(soup, "faces that are there twice");
    EXPECT_GT(count, 10000);
}

TEST(SelfIntersections, of_moved_models_are_those_of_a_full_count)
{
    const char* const folder = std::getenv("CELLWARP_TEST_DATA");
    if (!folder)
        GTEST_SKIP() << "CELLWARP_TEST_DATA is not set";
    for (const char* const name :
         {"beetle.obj", "spot.obj", "fandisk.obj", "armadillo.obj"})
    {
        const GeometryFile file = read_geometry(std::string(folder) + "/" + name, {});
        Shape shape;
        shape.samples = file.geometry.samples;
        for (std::size_t f = 0; f < file.geometry.num_faces(); ++f)
            for (std::size_t k = 2; k < file.geometry.face(f).size(); ++k)
                shape.triangles.push_back({file.geometry.face(f)[0],
                                           file.geometry.face(f)[k - 1],
                                           file.geometry.face(f)[k]});
        expect_full_counts(shape, name);
    }
}

TEST(SelfIntersections, leave_out_triangles_without_area)
{
    Shape shape;
    shape.samples = {kTriangle[0],   kTriangle[1],  kTriangle[2],
                     {0.5, 0.5, -1}, {0.5, 0.5, 1}, {0.5, 0.5, 0}};
    shape.triangles = {{0, 1, 2}, {3, 4, 5}, {3, 4, 4}, {5, 5, 5}};
    EXPECT_EQ(count_of(shape), 0);
    shape.triangles.clear();
    EXPECT_EQ(count_of(shape), 0);
}

TEST(SelfIntersections, are_not_counted_where_all_triangles_lie_in_one_place)
{
    Shape heap;
    std::mt19937 rng(5);
    for (std::uint32_t t = 0; t < 3000; ++t)
    {
        for (int k = 0; k < 3; ++k)
            heap.samples.push_back(support::random_vector(rng, 1.0));
        heap.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    }
    EXPECT_FALSE(IntersectionCounter(heap.triangles, heap.samples).count(heap.samples));
}

} // namespace cellwarp::core
