// SPDX-License-Identifier: GPL-3.0-or-later
// Parts that come to touch, from the file to the samples.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>

#include <gtest/gtest.h>

#include "io/formats/face_triangles.h"
#include "io/formats/geometry_file.h"
#include "library/session/contact_finder.h"
#include "library/session/session.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/self_intersections.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

SessionSettings settings(bool has_contact)
{
    SessionSettings s;
    s.cells.has_contact = has_contact;
    return s;
}

/// The fingers of a hand, 1 % of the diagonal apart; one is leant on its neighbour.
Session leaning(bool has_contact, const std::string& move = "rotate 0 0 1 -12 translate "
                                                            "0.15 0 0")
{
    Session session(
        read_geometry(support::samples_folder() + "/hand.ply").geometry,
        parse_handles("h.handles", "cellwarp-handles 1\n"
                                   "fixed wrist box -2 -1 -1 2 0.25 1\n"
                                   "handle index box -0.29 1.40 -1 -0.11 2 1\n"
                                   "frame 1\nmove index " +
                                       move + "\n"),
        settings(has_contact));
    while (session.next_frame(true))
        ;
    return session;
}

std::int64_t num_new_intersections(const Session& session, const Geometry& geometry)
{
    const std::vector<Triangle> triangles = triangles_of(geometry);
    const auto found = IntersectionCounter(triangles, geometry.samples)
                           .count(session.deformed().samples);
    return found ? found->fresh : -1;
}

/// By how much samples around a place have moved along x, on average.
double shift_at(const Session& session, const Geometry& geometry,
                const Eigen::Vector3d& place)
{
    double sum = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < geometry.samples.size(); ++i)
        if ((geometry.samples[i] - place).norm() < 0.12)
        {
            sum += session.deformed().samples[i].x() - geometry.samples[i].x();
            ++count;
        }
    EXPECT_GT(count, 10);
    return sum / count;
}

const Eigen::Vector3d kMiddleTip(0.0, 1.6, 0.0);

} // namespace

TEST(Contact, a_finger_that_leans_on_the_next_one_pushes_it_aside)
{
    const Geometry hand = read_geometry(support::samples_folder() + "/hand.ply").geometry;
    const Session free = leaning(false), touching = leaning(true);
    EXPECT_FALSE(free.frames()[0].contacts);
    ASSERT_TRUE(touching.frames()[0].contacts);
    EXPECT_EQ(touching.frames()[0].solve.stop, Stop::Converged);
    EXPECT_GT(touching.frames()[0].contacts->points, 10);
    EXPECT_LT(touching.frames()[0].contacts->deepest, 0.003);
    EXPECT_LT(std::abs(shift_at(free, hand, kMiddleTip)), 0.01);
    EXPECT_GT(shift_at(touching, hand, kMiddleTip), 0.1);
    if (num_new_intersections(free, hand) >= 0)
    {
        EXPECT_GT(num_new_intersections(free, hand), 100);
        EXPECT_EQ(num_new_intersections(touching, hand), 0);
    }
}

TEST(Contact, changes_nothing_where_nothing_comes_to_touch)
{
    const std::string away = "rotate 1 0 0 20";
    const Session free = leaning(false, away), touching = leaning(true, away);
    ASSERT_TRUE(touching.frames()[0].contacts);
    EXPECT_EQ(touching.frames()[0].contacts->points, 0);
    double largest = 0.0;
    for (std::size_t i = 0; i < free.deformed().samples.size(); ++i)
        largest = std::max(
            largest,
            (free.deformed().samples[i] - touching.deformed().samples[i]).norm());
    EXPECT_LT(largest, 1e-5); // another way, the same place
}

TEST(Contact, is_the_same_to_the_bit_on_any_number_of_threads)
{
    std::vector<Eigen::Vector3d> first;
    for (const int threads : {1, 2})
    {
        const ThreadLimit limit(threads);
        const Session session = leaning(true);
        if (first.empty())
            first = session.deformed().samples;
        else
            EXPECT_TRUE(first == session.deformed().samples);
    }
}

TEST(Contact, of_edits_that_go_back_and_on_again_is_that_of_the_file)
{
    const Geometry hand = read_geometry(support::samples_folder() + "/hand.ply").geometry;
    const std::string regions = "cellwarp-handles 1\n"
                                "fixed wrist box -2 -1 -1 2 0.25 1\n"
                                "handle index box -0.29 1.40 -1 -0.11 2 1\n";
    const std::string touches = "frame 1\nmove index rotate 0 0 1 -8 translate 0.1 0 0\n";
    const std::string leans = "frame 2\nmove index rotate 0 0 1 -12 translate 0.15 0 0\n";
    const std::string away = "frame 2\nmove index rotate 1 0 0 20\n";
    const auto script = [&](const std::string& frames)
    { return parse_handles("h.handles", regions + frames); };
    const auto play = [](Session& session)
    {
        while (session.next_frame(session.num_upcoming() == 1))
            ;
    };
    SessionSettings s = settings(true);
    s.keeps_checkpoints = true;
    Session edited(hand, script(touches + leans), s);
    play(edited);
    for (const std::string& last : {away, std::string(), leans})
    {
        edited.set_script(script(touches + last));
        play(edited);
        Session fresh(hand, script(touches + last), settings(true));
        play(fresh);
        EXPECT_TRUE(edited.deformed().samples == fresh.deformed().samples) << last;
        EXPECT_EQ(edited.frames().back().solve.energy_after,
                  fresh.frames().back().solve.energy_after)
            << last;
    }
}

TEST(Contact, of_parts_that_touch_at_rest_is_found_when_they_come_nearer)
{
    // Two closed boxes without a common sample, side by side.
    const Shape shape =
        support::joined(support::box_shape({0, 0, 0}, {2, 1, 1}, 4),
                        support::box_shape({2, 0.13, 0.21}, {3, 0.77, 0.83}, 3));
    const Geometry geometry = scan_geometry("two.obj", support::obj_text(shape)).geometry;
    SessionSettings s = settings(true);
    s.cells.across = 15;
    const auto rest = build_rest_shape(geometry, geometry.samples, s.cells);
    ASSERT_TRUE(rest->boundary);
    ASSERT_EQ(rest->parts.count(), 2u);
    const auto body = std::make_shared<const Body>(build_body(rest, s.cells));
    const ContactFinder finder(body, {}, std::vector<Constraint>(body->cells.size()));
    const double unit = rest->frame.size.x() / 3.0; // [work]
    const auto deepest = [&](double nearer)
    {
        std::vector<Pose> poses;
        for (const Cell& cell : body->cells.cells)
        {
            poses.push_back({Eigen::Matrix3d::Identity(), cell.centre});
            if (cell.centre.x() > 2.0 * unit)
                poses.back().p.x() -= nearer * unit;
        }
        double depth = -INFINITY;
        for (const FoundContact& found : finder.find(poses))
        {
            depth = std::max(depth, found.depth / unit);
            EXPECT_GT(std::abs(found.contact.outward.x()), 0.7);
        }
        return depth;
    };
    EXPECT_NEAR(deepest(0.0), 0.0, 1e-9);         // they may stay as near as they are
    for (const double nearer : {0.02, 0.1, 0.25}) // the last is deeper than a cell
        EXPECT_NEAR(deepest(nearer), nearer, 1e-9) << nearer;
    EXPECT_EQ(deepest(-0.3), -INFINITY);
}

TEST(Contact, keeps_parts_of_a_flat_model_apart)
{
    // Two arms of a U in a plane, which are pressed together.
    std::array<std::vector<double>, 3> lines;
    for (int i = 0; i <= 20; ++i)
        lines[0].push_back(0.05 * i);
    for (int i = 0; i <= 40; ++i)
        lines[1].push_back(0.05 * i);
    std::string obj;
    std::map<std::pair<int, int>, int> numbers;
    std::string faces;
    const auto vertex = [&](int i, int j)
    {
        const auto [found, is_new] =
            numbers.try_emplace({i, j}, static_cast<int>(numbers.size()) + 1);
        if (is_new)
            obj += "v " + std::to_string(lines[0][idx(i)]) + " " +
                   std::to_string(lines[1][idx(j)]) + " 0\n";
        return std::to_string(found->second);
    };
    for (int i = 0; i < 20; ++i)
        for (int j = 0; j < 40; ++j)
            if (j < 8 || i < 8 || i >= 12)
                faces += "f " + vertex(i, j) + " " + vertex(i + 1, j) + " " +
                         vertex(i + 1, j + 1) + " " + vertex(i, j + 1) + "\n";
    const auto gap_of = [&](bool has_contact)
    {
        SessionSettings s = settings(has_contact);
        s.cells.is_flat = true;
        s.cells.across = 20;
        const Geometry geometry = scan_geometry("u.obj", obj + faces).geometry;
        Session session(geometry,
                        parse_handles("h.handles",
                                      "cellwarp-handles 1\n"
                                      "fixed base box -1 -1 -1 2 0.1 1\n"
                                      "handle left box -1 1.9 -1 0.1 3 1\n"
                                      "frame 1\nmove left translate 0.3 0 0\n"),
                        s);
        while (session.next_frame(true))
            ;
        // Of the two tips.
        double left = -INFINITY, right = INFINITY;
        for (std::size_t i = 0; i < geometry.samples.size(); ++i)
        {
            const Eigen::Vector3d& x = geometry.samples[i];
            const double now = session.deformed().samples[i].x();
            EXPECT_EQ(session.deformed().samples[i].z(), 0.0);
            if (x.y() > 1.8)
                x.x() < 0.5 ? left = std::max(left, now) : right = std::min(right, now);
        }
        return right - left;
    };
    EXPECT_LT(gap_of(false), -0.05);
    EXPECT_GT(gap_of(true), -0.005);
}

} // namespace cellwarp::core
