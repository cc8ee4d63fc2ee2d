// SPDX-License-Identifier: GPL-3.0-or-later
// A session that is stopped at any look at its scope ends in the state that session.h
// states, and goes on from there to the bits of a session that was never stopped.
#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "io/formats/field_file.h"
#include "io/formats/geometry_file.h"
#include "library/session/session.h"
#include "tests/support/counted_stop.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

struct Scene
{
    std::string name;
    Geometry geometry;
    std::string handles;
    SessionSettings settings;
};

Geometry geometry_of_shape(const Shape& shape)
{
    return scan_geometry("model.obj", support::obj_text(shape)).geometry;
}

SessionSettings small_cells(int across)
{
    SessionSettings settings;
    settings.cells.across = across;
    settings.cells.max_depth = 2;
    settings.cells.threshold = 4e-3;
    settings.cells.gap = 0.03;
    return settings;
}

const std::string kHold = "fixed back box -1 -1 -1 0.500001 2 5\n"
                          "handle knob box 1.74 -1 2.99 3 2 3.51\n";
const std::string kMoves = "frame 1\nmove knob rotate 0 1 0 40 translate 0.2 0 0\n"
                           "frame 2\nmove knob translate 0.3 0.1 0.5\n";

/// Without their faces.
Geometry cloud()
{
    Geometry geometry = geometry_of_shape(support::box_shape({0, 0, 0}, {2, 1, 4}, 12));
    Geometry points;
    points.samples = std::move(geometry.samples);
    return points;
}

std::vector<Scene> scenes()
{
    const Geometry block = geometry_of_shape(support::box_shape({0, 0, 0}, {2, 1, 4}, 8));
    std::vector<Scene> all;
    all.push_back({"adaptive, with a commit", block,
                   kHold + kMoves +
                       "commit\nfixed low box -5 -5 -5 5 5 1.01\n"
                       "handle top box -5 -5 3.4 5 5 9\nframe 3\nmove top rotate 1 0 0 "
                       "30\n",
                   small_cells(8)});
    all.push_back({"a cloud", cloud(), kHold + kMoves, small_cells(0)});
    Scene contact{"contact", block, kHold + kMoves, small_cells(8)};
    contact.settings.cells.has_contact = true;
    contact.settings.cells.max_depth = 0;
    all.push_back(std::move(contact));
    return all;
}

HandleFile script(const std::string& text)
{
    return parse_handles("h.handles", "cellwarp-handles 1\n" + text);
}

/// All that a session gives out.
struct Result
{
    std::vector<Eigen::Vector3d> samples;
    std::vector<std::string> warnings;
    std::string field;
    double energy = 0.0;
    int refinements = 0;
    bool operator==(const Result&) const = default;
};

Result result_of(const Session& session)
{
    Result result;
    result.samples = session.deformed().samples;
    result.warnings = session.warnings();
    result.energy = session.frames().back().solve.energy_after;
    result.refinements = session.parts().refinement;
    return result;
}

Result played(const Scene& scene, bool keeps_checkpoints)
{
    SessionSettings settings = scene.settings;
    settings.keeps_checkpoints = keeps_checkpoints;
    Session session(scene.geometry, script(scene.handles), settings);
    while (session.next_frame(true))
        ;
    return result_of(session);
}

/// So many places in [0, count), some near both ends.
std::set<std::int64_t> places(std::int64_t count, int wanted, std::mt19937& rng)
{
    std::set<std::int64_t> chosen{0, 1, 2, count - 2, count - 1};
    while (static_cast<int>(chosen.size()) < wanted)
        chosen.insert(std::uniform_int_distribution<std::int64_t>(0, count - 1)(rng));
    chosen.erase(chosen.begin(), chosen.lower_bound(0));
    return chosen;
}

} // namespace

TEST(Stopping, a_session_stopped_at_any_look_goes_on_to_the_bits_of_another)
{
    std::mt19937 rng(3);
    for (const Scene& scene : scenes())
        for (const bool keeps_checkpoints : {false, true})
        {
            SCOPED_TRACE(scene.name + (keeps_checkpoints ? ", kept" : ""));
            const Result whole = played(scene, keeps_checkpoints);
            std::int64_t num_looks = 0;
            {
                const support::CountedStop all(INT64_MAX);
                EXPECT_EQ(played(scene, keeps_checkpoints), whole);
                num_looks = all.num_looks();
            }
            ASSERT_GT(num_looks, 1000);
            int num_unmade = 0;
            std::set<std::int64_t> stopped_frames;
            for (const std::int64_t look : places(num_looks, 24, rng))
            {
                SCOPED_TRACE(look);
                SessionSettings settings = scene.settings;
                settings.keeps_checkpoints = keeps_checkpoints;
                std::optional<Session> session;
                std::int64_t frame = 0;
                std::vector<Eigen::Vector3d> shown;
                std::size_t num_done = 0;
                bool is_stopped = false;
                try
                {
                    const support::CountedStop stop(look);
                    session.emplace(scene.geometry, script(scene.handles), settings);
                    do
                    {
                        frame = session->upcoming_frame().value_or(0);
                        shown = session->deformed().samples;
                        num_done = session->frames().size();
                    } while (session->next_frame(true));
                }
                catch (const Stopped&)
                {
                    is_stopped = true;
                }
                if (!session)
                {
                    ++num_unmade;
                    continue;
                }
                if (is_stopped)
                {
                    stopped_frames.insert(frame);
                    EXPECT_EQ(session->system(), nullptr);
                    EXPECT_EQ(session->field(), nullptr);
                    EXPECT_EQ(session->upcoming_frame(), frame);
                    EXPECT_EQ(session->frames().size(), num_done);
                    EXPECT_TRUE(session->deformed().samples == shown);
                }
                while (session->next_frame(true))
                    ;
                const Result now = result_of(*session);
                EXPECT_TRUE(now.samples == whole.samples);
                EXPECT_EQ(now.warnings, whole.warnings);
                EXPECT_EQ(now.energy, whole.energy);
                EXPECT_EQ(now.refinements, whole.refinements);
            }
            EXPECT_GT(num_unmade, 0);
            EXPECT_GT(stopped_frames.size(), 1u);
        }
}

TEST(Stopping, statements_that_were_stopped_can_be_given_again)
{
    std::mt19937 rng(5);
    const Scene scene = scenes().front();
    SessionSettings settings = scene.settings;
    settings.keeps_checkpoints = true;
    const std::string before = kHold + "frame 1\nmove knob translate 0.1 0 0\n";
    const Result whole = played(scene, true);
    for (int trial = 0; trial < 12; ++trial)
    {
        SCOPED_TRACE(trial);
        Session session(scene.geometry, script(before), settings);
        while (session.next_frame(true))
            ;
        const std::vector<Eigen::Vector3d> bent = session.deformed().samples;
        // Several times, at places where less or more is made already.
        for (int stop = 0; stop < 3; ++stop)
            try
            {
                const support::CountedStop scope(
                    std::uniform_int_distribution<std::int64_t>(0, 40 << trial)(rng));
                session.set_script(script(scene.handles));
                while (session.next_frame(true))
                    ;
            }
            catch (const Stopped&)
            {
                EXPECT_EQ(session.system(), nullptr);
            }
        session.set_script(script(scene.handles));
        while (session.next_frame(true))
            ;
        Result now = result_of(session);
        now.refinements = whole.refinements; // of all statements it has had
        EXPECT_EQ(now, whole);
        session.set_script(script(before));
        while (session.next_frame(true))
            ;
        EXPECT_EQ(session.deformed().samples, bent);
    }
}

TEST(Stopping, another_session_in_another_thread_goes_on)
{
    const Scene scene = scenes().front();
    const Result whole = played(scene, false);
    std::stop_source source;
    std::optional<Result> other;
    bool is_stopped = false;
    {
        std::jthread stopped(
            [&]
            {
                const StopOnRequest scope(source.get_token());
                try
                {
                    for (;;)
                        played(scene, false);
                }
                catch (const Stopped&)
                {
                    is_stopped = true;
                }
            });
        std::jthread untouched([&] { other = played(scene, false); });
        source.request_stop();
    }
    EXPECT_TRUE(is_stopped);
    EXPECT_EQ(other, whole);
}

TEST(Stopping, samples_by_another_field_and_the_field_file_can_be_had_after_a_stop)
{
    const Scene scene = scenes().front();
    SessionSettings settings = scene.settings;
    settings.keeps_fields = true;
    const auto bytes = [&](std::int64_t look)
    {
        Session session(scene.geometry, script(scene.handles), settings);
        while (session.next_frame(true))
            ;
        const std::vector<Eigen::Vector3d> bent = session.deformed().samples;
        int num_stopped = 0;
        for (std::int64_t k = 0; k < look; ++k)
            try
            {
                const support::CountedStop scope(3 * k);
                EXPECT_EQ(session.samples_by(FieldKind::Rbf), bent);
            }
            catch (const Stopped&)
            {
                ++num_stopped;
            }
        EXPECT_EQ(num_stopped > 0, look > 0);
        EXPECT_EQ(session.samples_by(FieldKind::Rbf), bent);
        return field_bytes(session.field_file());
    };
    EXPECT_TRUE(bytes(20) == bytes(0));
}

TEST(Stopping, time_that_runs_out_while_smaller_cells_are_made_ends_the_frame)
{
    constexpr double kBudget = 2.0; // [s]
    const Scene scene = scenes().front();
    SessionSettings settings = scene.settings;
    settings.time_budget = kBudget;
    int num_calls = 0;
    Clock::time_point begin;
    settings.cells.errors = [&](const CellSystem& system)
    {
        ++num_calls;
        std::this_thread::sleep_until(time_after(begin, kBudget + 0.05));
        return std::vector<double>(system.body().cells.size(), INFINITY);
    };
    const auto play = [&](const SessionSettings& with)
    {
        Session session(scene.geometry,
                        script(kHold + "frame 1\nmove knob translate 0.1 0 0\n"), with);
        begin = Clock::now();
        session.next_frame(true);
        return session;
    };
    const Session late = play(settings);
    EXPECT_EQ(num_calls, 1);
    EXPECT_EQ(late.frames().front().solve.stop, Stop::TimeLimit);
    EXPECT_EQ(late.frames().front().refinements, 0);
    ASSERT_NE(late.system(), nullptr);
    settings.cells.threshold = INFINITY;
    settings.time_budget = 0.0;
    const Session coarse = play(settings);
    EXPECT_EQ(late.frames().front().cells, coarse.frames().front().cells);
    EXPECT_LT(late.system()->energy(), 2.0 * coarse.system()->energy());
    // The samples are moved, and the handle is where it was led to.
    EXPECT_LE(late.frames().front().handle_residual, 1e-9);
}

} // namespace cellwarp::core
