// SPDX-License-Identifier: GPL-3.0-or-later
// A session whose statements change under way gives what a new one gives, to the bit.
#include <algorithm>
#include <random>
#include <stop_token>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "library/session/checkpoints.h"
#include "library/session/script_fingerprint.h"
#include "library/session/session.h"
#include "octree/base/index.h"
#include "octree/base/stop_scope.h"
#include "tests/support/counted_stop.h"
#include "tests/support/rest_model.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

const std::string kRegions = "fixed back box -1 -1 -1 0.500001 2 5\n"
                             "handle knob box 1.74 -1 2.99 3 2 3.51\n";
const std::string kPinned = "fixed back box -1 -1 -1 0.500001 2 5\n"
                            "pin knob box 1.74 -1 2.99 3 2 3.51\n"
                            "stiff plate box 0.6 -1 0 1.2 2 1.5 20\n";
const std::string kCommit = "commit\nfixed low box -5 -5 -5 5 5 1.01\n"
                            "handle top box -5 -5 3.4 5 5 9\n";

/// Frames that need other cells, and some that come back.
std::string frame(int number)
{
    const char* const moves[] = {"translate 0.3 0.1 0.1", "translate 0.3 0.1 0.5",
                                 "rotate 0 1 0 40 translate 0.2 0 0",
                                 "rotate 0 1 0 110 translate 0.2 0 0",
                                 "translate 0.05 0 0"};
    return "frame " + std::to_string(number) + "\nmove knob " + moves[idx(number) % 5] +
           "\n";
}

std::string frames(int first, int last)
{
    std::string text;
    for (int n = first; n <= last; ++n)
        text += frame(n);
    return text;
}

std::string top_frame(int number, double angle)
{
    return "frame " + std::to_string(number) + "\nmove top rotate 1 0 0 " +
           std::to_string(angle) + "\n";
}

Geometry block()
{
    return scan_geometry("model.obj",
                         support::obj_text(support::box_shape({0, 0, 0}, {2, 1, 4}, 8)))
        .geometry;
}

HandleFile handles(const std::string& text)
{
    return parse_handles("h.handles", "cellwarp-handles 1\n" + text);
}

SessionSettings settings(bool keeps_checkpoints)
{
    SessionSettings s;
    s.cells.across = 8;
    s.cells.max_depth = 2;
    s.cells.threshold = 4e-3;
    s.cells.gap = 0.03;
    s.keeps_checkpoints = keeps_checkpoints;
    return s;
}

void play(Session& session)
{
    while (session.next_frame(session.num_upcoming() == 1))
        ;
}

/// What a command line would make of it.
Session replayed(const std::string& text)
{
    Session session(block(), handles(text), settings(false));
    play(session);
    return session;
}

void expect_same(const Session& edited, const std::string& text)
{
    SCOPED_TRACE(text);
    const Session fresh = replayed(text);
    ASSERT_EQ(edited.deformed().samples.size(), fresh.deformed().samples.size());
    EXPECT_TRUE(edited.deformed().samples == fresh.deformed().samples);
    EXPECT_EQ(edited.warnings(), fresh.warnings());
    EXPECT_EQ(edited.frames().back().cells, fresh.frames().back().cells);
    EXPECT_EQ(edited.frames().back().solve.energy_after,
              fresh.frames().back().solve.energy_after);
}

/// The end of a frame of this script, in no cells.
Checkpoint state_at(const ScriptFingerprint& chain, std::size_t frame)
{
    return {chain.up_to({0, frame}),
            {0, frame},
            nullptr,
            Octree(GridShape{}, [](const Leaf&) { return false; }),
            {},
            {},
            {},
            {},
            {},
            frame};
}

} // namespace

TEST(EditingSession, frames_added_one_by_one_end_where_a_replay_ends)
{
    Session session(block(), handles(kRegions), settings(true));
    ASSERT_NE(session.system(), nullptr);
    EXPECT_EQ(session.deformed().samples, session.geometry().samples);
    int refinements = 0;
    for (int last = 1; last <= 4; ++last)
    {
        session.set_script(handles(kRegions + frames(1, last)));
        EXPECT_EQ(session.num_upcoming(), 1u);
        play(session);
        refinements += session.frames().back().refinements;
        expect_same(session, kRegions + frames(1, last));
    }
    EXPECT_GT(refinements, 2);
}

TEST(EditingSession, pins_and_stiff_parts_go_on_from_a_kept_state_to_the_same_bits)
{
    Session session(block(), handles(kPinned + frames(5, 5) + frames(6, 6)),
                    settings(true));
    play(session);
    session.set_script(handles(kPinned + frames(5, 5)));
    const std::string other = kPinned + frames(5, 5) + frames(10, 11);
    session.set_script(handles(other));
    play(session);
    expect_same(session, other);
}

TEST(EditingSession, what_a_hard_frame_left_in_the_solver_does_not_count)
{
    // Squashed so that the preconditioner is made anew under way, in cells that stay.
    const std::string regions = "fixed foot box -1 -1 -1 3 2 0.500001\n"
                                "handle head box -1 -1 3.4999 3 2 5\n";
    const std::string squashed = regions + "frame 1\nmove head translate 0 0 -3.3\n";
    const std::string text = squashed + "frame 2\nmove head translate 0.3 0 -3\n";
    SessionSettings uniform = settings(true);
    uniform.cells.across = 16;
    uniform.cells.max_depth = 0;
    Session session(block(), handles(text), uniform);
    int refreshes = 0;
    while (session.next_frame(session.num_upcoming() == 1))
        refreshes += session.frames().back().solve.refreshes;
    ASSERT_GT(refreshes, 0);
    const std::vector<Eigen::Vector3d> wrung = session.deformed().samples;
    session.set_script(handles(squashed));
    session.set_script(handles(text));
    play(session);
    EXPECT_TRUE(session.deformed().samples == wrung);
}

TEST(EditingSession, goes_back_by_any_number_of_frames_and_on_in_another_way)
{
    Session session(block(), handles(kRegions + frames(1, 6)), settings(true));
    play(session);
    for (const int last : {5, 2, 4, 1})
    {
        session.set_script(handles(kRegions + frames(1, last)));
        play(session);
        expect_same(session, kRegions + frames(1, last));
        const std::string other = kRegions + frames(1, last) + frames(12, 13);
        session.set_script(handles(other));
        play(session);
        expect_same(session, other);
    }
    session.set_script(handles(kRegions));
    EXPECT_EQ(session.deformed().samples, session.geometry().samples);
}

TEST(EditingSession, commits_are_passed_and_taken_back)
{
    const std::string before = kRegions + frames(1, 2);
    Session session(block(), handles(before), settings(true));
    play(session);
    session.set_script(handles(before + kCommit));
    EXPECT_EQ(session.system()->regions()[1].name, "top");
    const std::string bent = before + kCommit + top_frame(3, 30.0);
    session.set_script(handles(bent));
    play(session);
    expect_same(session, bent);
    session.set_script(handles(before));
    EXPECT_EQ(session.system()->regions()[1].name, "knob");
    expect_same(session, before);
    session.set_script(handles(before + kCommit + top_frame(3, -20.0)));
    play(session);
    expect_same(session, before + kCommit + top_frame(3, -20.0));
}

TEST(EditingSession, other_regions_at_rest_keep_the_material)
{
    Session session(block(), handles(kRegions), settings(true));
    const RestShape* const material = &session.system()->rest();
    session.set_script(handles(kPinned));
    EXPECT_EQ(&session.system()->rest(), material);
    EXPECT_EQ(session.system()->regions().size(), 3u);
}

TEST(EditingSession, statements_that_cannot_be_leave_what_the_next_ones_need)
{
    const std::string good = kRegions + frames(1, 2);
    Session session(block(), handles(good), settings(true));
    play(session);
    support::error_of(Fault::Malformed,
                      [&] {
                          session.set_script(handles(
                              good + kCommit + "fixed far box 90 90 90 99 99 99\n"));
                      });
    EXPECT_EQ(session.system(), nullptr);
    session.set_script(handles(good + frames(3, 3)));
    EXPECT_EQ(session.num_upcoming(), 1u);
    play(session);
    expect_same(session, good + frames(3, 3));
}

TEST(EditingSession, a_stopped_frame_is_done_again)
{
    const std::string text = kRegions + frames(1, 2);
    std::stop_source source;
    Session session(block(), handles(kRegions + frames(1, 1)), settings(true));
    play(session);
    session.set_script(handles(text));
    {
        const StopOnRequest scope(source.get_token());
        source.request_stop();
        EXPECT_THROW(play(session), Stopped);
    }
    EXPECT_EQ(session.system(), nullptr);
    session.set_script(handles(text));
    EXPECT_EQ(session.num_upcoming(), 1u);
    play(session);
    expect_same(session, text);
}

TEST(EditingSession, a_frame_that_throws_leaves_the_session_as_it_was)
{
    const std::string before = kRegions + frames(1, 1);
    Session session(block(), handles(before), settings(true));
    play(session);
    const std::vector<Eigen::Vector3d> bent = session.deformed().samples;
    session.set_script(handles(before + "frame 2\nmove knob translate 1e160 0 0\n"));
    for (int trial = 0; trial < 2; ++trial)
    {
        support::error_of(Fault::Unsolvable, [&] { session.next_frame(true); });
        EXPECT_EQ(session.upcoming_frame(), 2);
        ASSERT_NE(session.system(), nullptr);
        EXPECT_EQ(session.frames().size(), 1u);
        EXPECT_EQ(session.frames().back().frame, 1);
        EXPECT_TRUE(session.deformed().samples == bent);
    }
    session.set_script(handles(before));
    expect_same(session, before);
    session.set_script(handles(kRegions + frames(1, 2)));
    play(session);
    expect_same(session, kRegions + frames(1, 2));
}

TEST(EditingSession, a_frame_that_throws_leaves_a_session_that_keeps_no_states_too)
{
    Session session(
        block(),
        handles(kRegions + frames(1, 1) + "frame 2\nmove knob translate 1e160 0 0\n"),
        settings(false));
    session.next_frame(true);
    const std::vector<Eigen::Vector3d> bent = session.deformed().samples;
    const std::vector<std::string> warnings = session.warnings();
    for (int trial = 0; trial < 2; ++trial)
    {
        support::error_of(Fault::Unsolvable, [&] { session.next_frame(true); });
        EXPECT_EQ(session.upcoming_frame(), 2);
        EXPECT_EQ(session.frames().size(), 1u);
        EXPECT_TRUE(session.deformed().samples == bent);
        EXPECT_EQ(session.warnings(), warnings);
        EXPECT_TRUE(session.samples_by(FieldKind::Rbf) == bent);
    }
}

TEST(EditingSession, a_commit_that_throws_can_be_tried_again)
{
    const std::string before = kRegions + frames(1, 2);
    const std::string wrong = before +
                              "commit\nfixed far box 90 90 90 99 99 99\n"
                              "handle top box -5 -5 3.4 5 5 9\n" +
                              top_frame(3, 30.0);
    for (const bool keeps_checkpoints : {false, true})
    {
        SCOPED_TRACE(keeps_checkpoints);
        Session session(block(), handles(wrong), settings(keeps_checkpoints));
        session.next_frame(true);
        session.next_frame(true);
        const std::vector<Eigen::Vector3d> bent = session.deformed().samples;
        for (int trial = 0; trial < 2; ++trial)
        {
            support::error_of(Fault::Malformed, [&] { session.next_frame(true); });
            EXPECT_EQ(session.upcoming_frame(), 3);
            ASSERT_NE(session.system(), nullptr);
            EXPECT_EQ(session.system()->regions()[1].name, "knob");
            EXPECT_TRUE(session.deformed().samples == bent);
        }
        if (!keeps_checkpoints)
            continue;
        session.set_script(handles(before + kCommit + top_frame(3, 30.0)));
        play(session);
        expect_same(session, before + kCommit + top_frame(3, 30.0));
    }
}

TEST(EditingSession, samples_whose_field_was_stopped_are_not_taken_for_those_of_the_frame)
{
    for (const std::string& after : {std::string(), kCommit})
    {
        SCOPED_TRACE(after);
        Session session(block(), handles(kRegions + frames(1, 2)), settings(true));
        while (session.next_frame(true))
            ;
        const std::string text = kRegions + frames(1, 1) + after;
        {
            const support::CountedStop stopped(0);
            EXPECT_THROW(session.set_script(handles(text)), Stopped);
        }
        EXPECT_EQ(session.system(), nullptr);
        EXPECT_FALSE(session.next_frame(true));
        session.set_script(handles(text));
        ASSERT_NE(session.system(), nullptr);
        EXPECT_TRUE(session.deformed().samples == replayed(text).deformed().samples);
        session.set_script(
            handles(kRegions + frames(1, 1) + kCommit + top_frame(2, 30.0)));
        play(session);
        expect_same(session, kRegions + frames(1, 1) + kCommit + top_frame(2, 30.0));
    }
}

TEST(EditingSession, a_commit_whose_field_was_stopped_commits_nothing)
{
    const std::string text = kRegions + frames(1, 2) + kCommit + top_frame(3, 30.0);
    Session session(block(), handles(text), settings(false));
    session.next_frame(true);
    session.next_frame(false); // its samples are wanted by the commit first
    const std::vector<Eigen::Vector3d> bent = session.deformed().samples;
    {
        const support::CountedStop stopped(0);
        EXPECT_THROW(session.next_frame(true), Stopped);
    }
    EXPECT_EQ(session.upcoming_frame(), 3);
    EXPECT_EQ(session.frames().size(), 2u);
    EXPECT_TRUE(session.deformed().samples == bent);
    EXPECT_TRUE(session.next_frame(true));
    expect_same(session, text);
}

TEST(EditingSession, a_flat_model_is_kept_in_its_plane_as_the_statements_are_now)
{
    const Geometry sheet =
        scan_geometry("model.obj", support::obj_text(support::sheet_shape(3, 1, 6)))
            .geometry;
    const std::string regions = "fixed foot box -1 -1 -1 0.3 2 1\n"
                                "handle hand box 2.7 -1 -1 4 2 1\n",
                      within = "move hand rotate 0 0 1 40\n",
                      lifted = "move hand translate 0 0 0.4\n";
    Session session(sheet, handles(regions), settings(true));
    for (const auto& [text, is_flat] : std::vector<std::pair<std::string, bool>>{
             {"frame 1\n" + within, true},
             {"frame 1\n" + within + "frame 2\nmove hand translate 0 0.2 0\n", true},
             {"frame 1\n", false},
             {"frame 1\nframe 2\n" + within, true},
             {"frame 1\nframe 2\n" + lifted, false},
             {"frame 1\n" + lifted + "frame 2\n" + within, false},
             {"frame 1\n" + within + "commit\n" + regions + "frame 2\n" + within, true},
             {"frame 1\n" + within + "commit\n" + regions + "frame 2\n" + lifted, false},
             {"frame 1\n" + within + "commit\n" + regions + "frame 2\n" + within, true},
             {"frame 1\n" + within, true}})
    {
        SCOPED_TRACE(text);
        session.set_script(handles(regions + text));
        play(session);
        Session fresh(sheet, handles(regions + text), settings(false));
        play(fresh);
        EXPECT_EQ(fresh.system()->rest().is_flat(), is_flat);
        EXPECT_EQ(session.system()->rest().is_flat(), is_flat);
        EXPECT_TRUE(session.deformed().samples == fresh.deformed().samples);
        EXPECT_EQ(session.frames().back().cells, fresh.frames().back().cells);
        EXPECT_EQ(session.frames().back().solve.energy_after,
                  fresh.frames().back().solve.energy_after);
        EXPECT_EQ(session.warnings(), fresh.warnings());
    }
    const auto leave = [&] {
        session.set_script(
            handles(regions + "frame 1\n" + within + "frame 2\n" + lifted));
    };
    EXPECT_TRUE(support::contains(support::error_of(Fault::Malformed, leave),
                                  "frame 2: leaves the plane"));
    session.set_script(handles(regions + "frame 1\n" + within));
    EXPECT_TRUE(session.system()->rest().is_flat());
}

TEST(ScriptFingerprint, tells_where_two_files_part)
{
    const ScriptFingerprint a(handles(kRegions + frames(1, 3)));
    const ScriptFingerprint b(
        handles("# moved down\n\n" + kRegions + frames(1, 2) + frames(8, 8)));
    EXPECT_EQ(a.up_to({0, 2}), b.up_to({0, 2}));
    EXPECT_NE(a.up_to({0, 3}), b.up_to({0, 3}));
    EXPECT_FALSE(a.has({0, 4}));
    EXPECT_FALSE(a.has({1, 0}));
    const ScriptFingerprint other(handles(kPinned + frame(5)));
    EXPECT_EQ(a.before(0), other.before(0));
    EXPECT_NE(a.up_to({0, 0}), other.up_to({0, 0}));
}

TEST(Checkpoints, are_few_and_the_way_from_them_is_no_longer_than_the_way_back)
{
    constexpr std::size_t kFrames = 2000;
    const ScriptFingerprint all(handles(kRegions + frames(1, kFrames)));
    Checkpoints kept;
    for (std::size_t n = 0; n <= kFrames; ++n)
        kept.add(state_at(all, n));
    EXPECT_LE(kept.size(), 16u);
    for (const std::size_t back : {1u, 2u, 5u, 10u, 50u, 300u, 1000u})
    {
        SCOPED_TRACE(back);
        const Checkpoint* const state = kept.latest_on(ScriptFingerprint(
            handles(kRegions + frames(1, static_cast<int>(kFrames - back)))));
        ASSERT_NE(state, nullptr);
        EXPECT_LE(kFrames - back - state->place.frame, 2 * back);
    }
}

TEST(Checkpoints, count_all_that_they_hold_and_what_they_share_once)
{
    CellSettings cells;
    cells.across = 8;
    const auto start = [&]
    {
        const support::RestModel model(support::box_shape({0, 0, 0}, {2, 1, 4}, 8),
                                       "fixed back box -1 -1 -1 0.500001 2 5\n", cells);
        auto rest = std::make_shared<StageRest>();
        rest->samples.samples.resize(1000000);
        rest->shape = model.rest;
        return std::make_shared<const StageStart>(StageStart{
            rest,
            model.regions,
            {},
            CellRefiner(model.rest, model.regions, cells, CellSystemSettings())});
    };
    const std::size_t samples = 1000000 * sizeof(Eigen::Vector3d);
    const ScriptFingerprint chain(handles(kRegions + frames(1, 9)));
    Checkpoints kept(5 * samples / 2);
    const auto add = [&](std::size_t stage, std::size_t frame, const auto& of)
    {
        Checkpoint state = state_at(chain, stage + frame);
        state.frames_done = 10 * stage + frame;
        state.place = {stage, frame};
        state.start = of;
        kept.add(std::move(state));
    };
    const auto first = start();
    for (std::size_t frame = 0; frame < 5; ++frame)
        add(0, frame, first);
    EXPECT_EQ(kept.size(), 5u);
    EXPECT_GT(kept.bytes(), samples);
    EXPECT_LT(kept.bytes(), samples + samples / 2);
    add(1, 0, start());
    EXPECT_EQ(kept.size(), 6u);
    EXPECT_GT(kept.bytes(), 2 * samples);
    add(2, 0, start()); // one of the stages has to go
    EXPECT_LT(kept.bytes(), 5 * samples / 2);
    EXPECT_LT(kept.size(), 7u);
}

} // namespace cellwarp::core
