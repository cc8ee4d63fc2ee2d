// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/session.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

/// Of the block.
const double kDiagonal = std::sqrt(4.0 + 1.0 + 16.0);

/// 2 x 1 x 4, held at its back.
Shape block()
{
    return support::box_shape({0, 0, 0}, {2, 1, 4}, 8);
}

const std::string kRegions = "fixed back box -1 -1 -1 0.500001 2 5\n"
                             "handle knob box 1.74 -1 2.99 3 2 3.51\n";
const std::string kPull = "move knob translate 0.3 0.1 0.1\n";
const std::string kTurn = "move knob rotate 0 1 0 25 translate 0.1 0 0\n";
const std::string kBack = "move knob translate 0 0 0\n";

Geometry model()
{
    return scan_geometry("model.obj", support::obj_text(block())).geometry;
}

HandleFile handles(const std::string& text)
{
    return parse_handles("h.handles", "cellwarp-handles 1\n" + text);
}

SessionSettings adaptive(double threshold, int max_depth = 2)
{
    SessionSettings s;
    s.cells.across = 8;
    s.cells.max_depth = max_depth;
    s.cells.threshold = threshold;
    s.cells.gap = 0.03;
    return s;
}

Session played(const std::string& text, const SessionSettings& s)
{
    Session session(model(), handles(text), s);
    while (session.next_frame(true))
        ;
    return session;
}

const std::vector<Leaf>& leaves(const Session& session)
{
    return session.system()->body().octree.leaves();
}

double largest_difference(const std::vector<Eigen::Vector3d>& a,
                          const std::vector<Eigen::Vector3d>& b)
{
    double largest = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i)
        largest = std::max(largest, (a[i] - b[i]).norm());
    return largest;
}

double rms_difference(const std::vector<Eigen::Vector3d>& a,
                      const std::vector<Eigen::Vector3d>& b)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i)
        sum += (a[i] - b[i]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(a.size()));
}

/// A sample that ships with the project, from cells of a twelfth of it on.
Session played_sample(const std::string& name, const std::string& model_name, double gap,
                      double threshold)
{
    const std::string folder = support::samples_folder() + "/";
    SessionSettings s;
    s.cells.across = 12;
    s.cells.max_depth = 2;
    s.cells.threshold = threshold;
    s.cells.gap = gap;
    s.gradient_tolerance = 1e-4;
    Session session(read_geometry(folder + model_name).geometry,
                    read_handles(folder + name + ".handles"), s);
    while (session.next_frame(true))
        ;
    return session;
}

std::size_t num_components(const Cells& cells)
{
    const std::vector<int> components = connected_components(cells);
    return idx(*std::max_element(components.begin(), components.end())) + 1;
}

/// Calls visit(a, b) with the centres of each pair of glued cells [model unit].
template <class Visit>
void for_each_glued_pair(const Session& session, Visit&& visit)
{
    const Cells& cells = session.system()->body().cells;
    const WorkFrame& frame = session.system()->rest().frame;
    for (const Face& face : cells.faces)
        visit(frame.to_model(cells.cells[idx(face.a)].centre),
              frame.to_model(cells.cells[idx(face.b)].centre));
}

} // namespace

TEST(AdaptiveSession, refines_near_a_local_handle_and_not_far_away)
{
    const Session session = played(kRegions + "frame 1\n" + kPull, adaptive(1e-3, 3));
    const Body& body = session.system()->body();
    std::size_t num_fine = 0;
    for (const Cell& cell : body.cells.cells)
    {
        const Eigen::Vector3d x = session.system()->rest().frame.to_model(cell.centre);
        const int level = leaves(session)[idx(cell.leaf)].level;
        num_fine += level > 1;
        if (x.z() < 1.5)
        {
            EXPECT_EQ(level, 0);
        }
    }
    EXPECT_GT(num_fine, 100u);
    EXPECT_TRUE(body.octree.is_balanced());
    EXPECT_LT(body.cells.size(), 64u * 512u / 5u);
    EXPECT_EQ(session.frames()[0].cells, body.cells.size());
    EXPECT_GE(session.frames()[0].refinements, 2);
    EXPECT_EQ(session.frames()[0].solve.stop, Stop::Converged);
    EXPECT_LT(session.frames()[0].handle_residual, 1e-12);
}

TEST(AdaptiveSession, errors_fall_with_the_threshold)
{
    const std::string text = kRegions + "frame 1\n" + kPull;
    SessionSettings deepest = adaptive(INFINITY);
    deepest.cells.min_depth = 2;
    const Session wanted = played(text, deepest);
    ASSERT_EQ(wanted.system()->body().cells.size(), 4096u);
    double last_error = INFINITY;
    std::size_t last_cells = 0;
    for (const double threshold : {1e-1, 2e-3, 3e-4})
    {
        SCOPED_TRACE(threshold);
        const Session session = played(text, adaptive(threshold));
        const double error =
            rms_difference(session.deformed().samples, wanted.deformed().samples) /
            kDiagonal;
        EXPECT_LT(error, 0.6 * last_error);
        EXPECT_GT(session.system()->body().cells.size(), last_cells);
        last_error = error;
        last_cells = session.system()->body().cells.size();
    }
    EXPECT_LT(last_error, 5e-4);
    EXPECT_LT(last_cells, 4096u);
}

TEST(AdaptiveSession, no_threshold_leads_to_a_chain_of_small_rounds)
{
    // Beside smaller cells errors are somewhat larger than elsewhere: a front of splits
    // could pass through the whole body, some cells at a time.
    const Shape bar = support::box_shape({0, 0, 0}, {4, 1, 1}, 8);
    double last_error = INFINITY;
    std::vector<Eigen::Vector3d> exact;
    for (const double threshold : {0.0, 2e-4, 1e-4, 5e-5, 2e-5})
    {
        SCOPED_TRACE(threshold);
        SessionSettings settings = adaptive(threshold);
        settings.cells.across = 16;
        Session session(
            scan_geometry("bar.obj", support::obj_text(bar)).geometry,
            handles("fixed foot box -1 -1 -1 0.25 2 2\nhandle head box 3.75 -1 -1 5 2 2\n"
                    "frame 1\nmove head rotate 1 0 0 90 about 4 0.5 0.5\n"),
            settings);
        while (session.next_frame(true))
            ;
        EXPECT_LE(session.frames().back().refinements, 7);
        if (threshold == 0.0)
        {
            exact = session.deformed().samples;
            continue;
        }
        const double error = rms_difference(session.deformed().samples, exact);
        EXPECT_LT(error, last_error);
        last_error = error;
    }
}

TEST(AdaptiveSession, out_and_back_is_at_rest_in_the_cells_of_the_start)
{
    const SessionSettings s = adaptive(1e-3);
    Session session(model(),
                    handles(kRegions + "frame 1\n" + kPull + "frame 2\n" + kTurn +
                            "frame 3\n" + kBack),
                    s);
    const std::vector<Leaf> start = leaves(session);
    EXPECT_EQ(start.size(), 64u);
    session.next_frame(true);
    EXPECT_GT(leaves(session).size(), 2 * start.size());
    session.next_frame(false);
    EXPECT_GT(leaves(session).size(), 2 * start.size());
    session.next_frame(true);
    EXPECT_EQ(leaves(session), start);
    EXPECT_LT(largest_difference(session.deformed().samples, block().samples),
              1e-6 * kDiagonal);
}

TEST(AdaptiveSession, a_strong_bend_is_merged_when_it_is_back)
{
    const std::string head = "fixed back box -1 -1 -1 3 2 0.500001\n"
                             "handle knob box -1 -1 3.499999 3 2 5\n";
    Session session(model(),
                    handles(head + "frame 1\nmove knob rotate 1 0 0 60\n" +
                            "frame 2\nmove knob rotate 1 0 0 0\n"),
                    adaptive(5e-4));
    const std::vector<Leaf> start = leaves(session);
    session.next_frame(false);
    EXPECT_GT(leaves(session).size(), 10 * start.size());
    session.next_frame(true);
    EXPECT_EQ(leaves(session), start);
}

TEST(AdaptiveSession, a_part_of_a_region_that_is_smaller_than_a_cell_gets_cells)
{
    // The sphere alone would be too small for a cell; the box of the same name is not.
    const std::string text = "fixed back box -1 -1 -1 3 2 0.500001\n"
                             "handle knob box -1 -1 3.499999 3 2 5\n"
                             "handle knob sphere 0 0.5 2 0.2\n"
                             "frame 1\nmove knob translate -0.3 0 0\n";
    Session session(model(), handles(text), adaptive(1e9));
    session.next_frame(false);
    const CellSystem& system = *session.system();
    const auto moved = [&](std::size_t c)
    {
        const Eigen::Vector3d place =
            system.rest().frame.to_model(system.body().cells.cells[c].centre);
        return system.region_of_cell()[c] == 1 && std::abs(place.z() - 2.0) < 0.2;
    };
    int num_moved = 0;
    for (std::size_t c = 0; c < system.poses().size(); ++c)
        num_moved += moved(c);
    EXPECT_GT(num_moved, 0);
}

TEST(AdaptiveSession, a_leaf_that_splits_into_one_is_split_further)
{
    // A crumb of a shape in one octant of its leaf, half of it fixed, half of it moved.
    const Shape shape =
        support::joined(block(), support::box_shape({2.4, 0.4, 2.0}, {2.5, 0.5, 2.1}));
    SessionSettings s = adaptive(1e9, 5);
    s.cells.gap = 0.01;
    Session session(scan_geometry("model.obj", support::obj_text(shape)).geometry,
                    handles("fixed back box -1 -1 -1 3 2 0.5\n"
                            "fixed low box 2.35 0 1.9 2.55 1 2.06\n"
                            "handle high box 2.35 0 2.0605 2.55 1 2.2\n"
                            "frame 1\nmove high translate 0 0 0.02\n"),
                    s);
    session.next_frame(true);
    std::vector<bool> has_cell(3, false);
    for (const int region : session.system()->region_of_cell())
        if (region >= 0)
            has_cell[idx(region)] = true;
    EXPECT_EQ(has_cell, std::vector<bool>(3, true));
}

TEST(AdaptiveSession, cells_and_samples_are_a_function_of_the_file)
{
    const std::string text =
        kRegions + "frame 1\n" + kPull + "frame 2\n" + kTurn + "frame 3\n" + kPull;
    std::vector<Eigen::Vector3d> samples;
    std::vector<Leaf> cells;
    for (const int threads : {1, 2, 4})
    {
        SCOPED_TRACE(threads);
        const ThreadLimit limit(threads);
        const Session session = played(text, adaptive(2e-3));
        if (samples.empty())
        {
            samples = session.deformed().samples;
            cells = leaves(session);
            EXPECT_GT(cells.size(), 64u);
        }
        EXPECT_EQ(session.deformed().samples, samples);
        EXPECT_EQ(leaves(session), cells);
    }
}

TEST(AdaptiveSession, samples_that_nobody_wants_change_no_cell)
{
    const std::string text = kRegions + "frame 1\n" + kPull + "frame 2\n" + kTurn;
    const Session wanted = played(text, adaptive(2e-3));
    Session session(model(), handles(text), adaptive(2e-3));
    session.next_frame(false);
    session.next_frame(true);
    EXPECT_EQ(leaves(session), leaves(wanted));
    EXPECT_EQ(session.deformed().samples, wanted.deformed().samples);
}

TEST(AdaptiveSession, without_a_threshold_nothing_is_cut_anew)
{
    const std::string text = kRegions + "frame 1\n" + kPull + "frame 2\n" + kTurn;
    const Session session = played(text, adaptive(INFINITY));
    EXPECT_EQ(leaves(session).size(), 64u);
    for (const FrameReport& frame : session.frames())
        EXPECT_EQ(frame.refinements, 0);
}

TEST(AdaptiveSession, a_rigid_motion_of_all_regions_refines_nothing)
{
    const Session session =
        played("handle back box -1 -1 -1 0.500001 2 5\n"
               "handle knob box 1.74 -1 2.99 3 2 3.51\n"
               "frame 1\n"
               "move back rotate 1 2 3 70 about 0 0 0 translate 1 2 3\n"
               "move knob rotate 1 2 3 70 about 0 0 0 translate 1 2 3\n",
               adaptive(1e-9));
    EXPECT_EQ(session.frames()[0].refinements, 0);
    EXPECT_EQ(leaves(session).size(), 64u);
}

TEST(AdaptiveSession, even_strain_refines_nothing)
{
    // 4 x 1 x 1, held in its first quarter and from its third on: half of it stretches.
    SessionSettings s;
    s.cells.across = 16;
    s.cells.max_depth = 2;
    s.cells.threshold = 2e-3;
    Session session(
        scan_geometry("bar.obj",
                      support::obj_text(support::box_shape({0, 0, 0}, {4, 1, 1}, 4)))
            .geometry,
        handles("fixed foot box -1 -1 -1 1 2 2\nhandle head box 3 -1 -1 5 2 2\n"
                "frame 1\nmove head translate 1 0 0\n"),
        s);
    session.next_frame(true);
    EXPECT_EQ(leaves(session).size(), 256u);
    EXPECT_EQ(session.frames()[0].refinements, 0);
    // Strain of a half in a volume of two.
    const double diagonal = session.system()->rest().frame.diagonal();
    EXPECT_NEAR(session.system()->energy() * std::pow(std::sqrt(18.0) / diagonal, 3), 0.5,
                1e-6);
}

TEST(AdaptiveSession, small_cells_find_the_minimum_of_uniform_ones_where_a_fold_forms)
{
    const Shape bar = support::box_shape({0, 0, 0}, {1, 1, 4}, 6);
    const auto bent = [&](double threshold, int min_depth)
    {
        SessionSettings s;
        s.cells.across = 6;
        s.cells.max_depth = 2;
        s.cells.min_depth = min_depth;
        s.cells.threshold = threshold;
        Session session(scan_geometry("bar.obj", support::obj_text(bar)).geometry,
                        handles("fixed foot box -1 -1 -1 2 2 2.5\n"
                                "handle head box -1 -1 3.8 2 2 5\nframe 1\n"
                                "move head rotate 1 0 0 60 about 0.5 0.5 3.4\n"),
                        s);
        session.next_frame(true);
        return session;
    };
    const Session uniform = bent(0.0, 2), adaptive = bent(1e-9, 0);
    EXPECT_EQ(uniform.frames()[0].second_start, SecondStart::None);
    EXPECT_EQ(adaptive.frames()[0].second_start, SecondStart::Taken);
    EXPECT_NEAR(adaptive.system()->energy() / uniform.system()->energy(), 1.0, 1e-6);
    EXPECT_LT(largest_difference(adaptive.deformed().samples, uniform.deformed().samples),
              1e-3 * std::sqrt(18.0));
}

namespace
{

/// A bar of 6,912 cells bent by 60 degrees in one frame, or in eight, none of which is a
/// long way.
Session bent_in_many_cells(const std::string& statements, int num_frames)
{
    SessionSettings s;
    s.cells.across = 48;
    s.cells.max_depth = 0;
    s.gradient_tolerance = 1e-9;
    std::string text = statements;
    for (int frame = 1; frame <= num_frames; ++frame)
        text += "frame " + std::to_string(frame) + "\nmove head rotate 1 0 0 " +
                std::to_string(60.0 / num_frames * frame) + " about 0.5 0.5 2.4\n";
    Session session(scan_geometry("bar.obj", support::obj_text(support::box_shape(
                                                 {0, 0, 0}, {1, 1, 4}, 6)))
                        .geometry,
                    handles(text), s);
    for (int frame = 1; frame <= num_frames; ++frame)
        session.next_frame(frame == num_frames);
    return session;
}

} // namespace

TEST(AdaptiveSession, a_long_hard_way_in_many_cells_is_gone_in_larger_ones_first)
{
    const std::string ends = "fixed foot box -1 -1 -1 2 2 1.5\n"
                             "handle head box -1 -1 2.8 2 2 5\n";
    const Session once = bent_in_many_cells(ends, 1),
                  by_and_by = bent_in_many_cells(ends, 8);
    const FrameReport& report = once.frames()[0];
    EXPECT_EQ(report.cells, 6912u);
    EXPECT_EQ(report.solve.stop, Stop::Converged);
    EXPECT_GE(report.iterations_in_larger_cells, 5);
    EXPECT_LE(report.solve.iterations - report.iterations_in_larger_cells, 6);
    for (const FrameReport& small : by_and_by.frames())
        EXPECT_EQ(small.iterations_in_larger_cells, 0);
    EXPECT_NEAR(once.system()->energy() / by_and_by.system()->energy(), 1.0, 1e-7);
    EXPECT_LT(largest_difference(once.deformed().samples, by_and_by.deformed().samples),
              1e-4);
}

namespace
{

/// Of a bar of 16,384 cells that is turned over in one frame.
FrameReport turned_over(int max_iterations)
{
    SessionSettings s;
    s.cells.across = 64;
    s.cells.max_depth = 0;
    s.max_iterations = max_iterations;
    Session session(scan_geometry("bar.obj", support::obj_text(support::box_shape(
                                                 {0, 0, 0}, {1, 1, 4}, 6)))
                        .geometry,
                    handles("fixed foot box -1 -1 -1 2 2 0.2500001\n"
                            "handle head box -1 -1 3.7499999 2 2 5\n"
                            "frame 1\nmove head rotate 1 0 0 170 about 0.5 0.5 2\n"),
                    s);
    session.next_frame(true);
    EXPECT_EQ(session.frames()[0].cells, 16384u);
    return session.frames()[0];
}

} // namespace

/// Where some folds have formed in a few small cells, others want a few more.
TEST(AdaptiveSession, folds_that_follow_from_folds_form_in_few_cells_as_well)
{
    const FrameReport report = turned_over(200);
    EXPECT_EQ(report.solve.stop, Stop::Converged);
    EXPECT_GT(report.iterations_in_larger_cells, 15);
    EXPECT_LE(report.solve.iterations - report.iterations_in_larger_cells, 8);
}

TEST(AdaptiveSession, folds_in_few_cells_leave_iterations_for_the_cells_themselves)
{
    const FrameReport report = turned_over(60);
    EXPECT_GT(report.iterations_in_larger_cells, 10);
    EXPECT_LE(report.iterations_in_larger_cells, 30);
    EXPECT_LE(report.solve.iterations, 60);
    EXPECT_GT(report.solve.iterations, report.iterations_in_larger_cells);
}

TEST(AdaptiveSession, time_that_runs_out_in_larger_cells_leaves_more_than_a_guess)
{
    SessionSettings s;
    s.cells.across = 48;
    s.cells.max_depth = 0;
    const auto energy_within = [&](double seconds)
    {
        s.time_budget = seconds;
        Session session(
            scan_geometry("bar.obj",
                          support::obj_text(support::box_shape({0, 0, 0}, {1, 1, 4}, 6)))
                .geometry,
            handles("fixed foot box -1 -1 -1 2 2 1.5\nhandle head box -1 -1 2.8 2 2 5\n"
                    "frame 1\nmove head rotate 1 0 0 60 about 0.5 0.5 2.4\n"),
            s);
        session.next_frame(true);
        EXPECT_EQ(session.frames()[0].solve.stop,
                  seconds > 0 ? Stop::TimeLimit : Stop::Converged);
        return session.system()->energy();
    };
    EXPECT_LT(energy_within(1e-9), 4.0 * energy_within(0.0));
}

TEST(AdaptiveSession, an_easy_way_is_gone_in_its_own_cells_however_many)
{
    const Session once = bent_in_many_cells("fixed foot box -1 -1 -1 2 2 0.3\n"
                                            "handle head box -1 -1 3.7 2 2 5\n",
                                            1);
    const FrameReport& report = once.frames()[0];
    EXPECT_GT(report.iterations_in_larger_cells, 0); // which told that it is easy
    EXPECT_LT(report.iterations_in_larger_cells, 8);
    EXPECT_LT(report.solve.iterations - report.iterations_in_larger_cells, 10);
}

TEST(AdaptiveSession, a_budget_of_time_that_runs_out_leaves_a_state_to_draw)
{
    SessionSettings s = adaptive(1e-3);
    s.time_budget = 1e-9;
    const Session session =
        played(kRegions + "frame 1\n" + kPull + "frame 2\n" + kTurn, s);
    ASSERT_EQ(session.frames().size(), 2u);
    for (const FrameReport& frame : session.frames())
    {
        EXPECT_EQ(frame.solve.stop, Stop::TimeLimit);
        EXPECT_LT(frame.handle_residual, 1e-12);
    }
    for (const Eigen::Vector3d& x : session.deformed().samples)
        ASSERT_TRUE(x.allFinite());
    EXPECT_LT(largest_difference(session.deformed().samples, block().samples), 2.0);
}

TEST(AdaptiveSession, a_commit_starts_from_coarse_cells)
{
    Session session(model(),
                    handles(kRegions + "frame 1\n" + kPull +
                            "commit\n"
                            "fixed back box -1 -1 -1 0.500001 2 5\n"
                            "handle knob box 1.9 -1 3.1 3 2 3.6\n"
                            "frame 2\nmove knob translate 0 0 1e-6\n"),
                    adaptive(2e-3));
    session.next_frame(true);
    EXPECT_GT(leaves(session).size(), 80u);
    session.next_frame(true);
    EXPECT_EQ(session.frames()[1].refinements, 0);
    for (const Leaf& leaf : leaves(session))
        EXPECT_EQ(leaf.level, 0);
}

TEST(AdaptiveSession, cells_over_the_budget_are_warned_of_once)
{
    SessionSettings s = adaptive(1e-4);
    s.cells.max_cells = 300;
    const Session session =
        played(kRegions + "frame 1\n" + kPull + "frame 2\n" + kTurn, s);
    EXPECT_LE(leaves(session).size(), 300u);
    EXPECT_GT(leaves(session).size(), 200u);
    EXPECT_EQ(session.warnings().size(), 1u) << session.warnings().back();
}

TEST(AdaptiveSession, links_of_a_chain_stay_apart_at_every_size)
{
    const Session coarse = played_sample("chain", "chain.obj", 0.008, INFINITY);
    EXPECT_EQ(num_components(coarse.system()->body().cells), 5u);
    const Session fine = played_sample("chain", "chain.obj", 0.008, 1e-3);
    EXPECT_GT(leaves(fine).size(), leaves(coarse).size() + 100u);
    EXPECT_EQ(num_components(fine.system()->body().cells), 5u);
}

TEST(AdaptiveSession, turns_of_a_coil_are_glued_along_the_wire_alone)
{
    // A threshold so small that there are cells of three sizes.
    const Session session = played_sample("coil", "coil.obj", 0.006, 3e-5);
    std::set<int> levels;
    for (const Leaf& leaf : leaves(session))
        levels.insert(leaf.level);
    EXPECT_EQ(levels.size(), 3u);
    EXPECT_EQ(num_components(session.system()->body().cells), 1u);
    // Where on the wire a place is [turn]: it rises evenly as it goes round.
    constexpr double kPitch = 0.139;
    const auto turns = [](const Eigen::Vector3d& x)
    {
        const double part = std::atan2(x.z(), x.x()) / (2.0 * std::numbers::pi);
        return std::round(x.y() / kPitch - part) + part;
    };
    double longest = 0.0;
    for_each_glued_pair(session, [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b)
                        { longest = std::max(longest, std::abs(turns(a) - turns(b))); });
    EXPECT_LT(longest, 0.2);
    EXPECT_GT(longest, 0.01);
}

TEST(AdaptiveSession, fingers_of_a_hand_are_never_glued_to_each_other)
{
    const Session session = played_sample("hand", "hand.ply", 0.005, 5e-3);
    EXPECT_EQ(num_components(session.system()->body().cells), 1u);
    constexpr double kPitch = 0.1946, kKnuckles = 1.0;
    std::size_t num_pairs = 0, num_fingers_glued = 0;
    for_each_glued_pair(session,
                        [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b)
                        {
                            if (a.y() < kKnuckles || b.y() < kKnuckles)
                                return;
                            ++num_pairs;
                            num_fingers_glued += std::lround(a.x() / kPitch) !=
                                                 std::lround(b.x() / kPitch);
                        });
    EXPECT_GT(num_pairs, 200u);
    EXPECT_EQ(num_fingers_glued, 0u);
    // The ring finger, which nobody moves, stays nearly where it is.
    const std::vector<Eigen::Vector3d>& rest = session.geometry().samples;
    double ring = 0.0, middle = 0.0;
    for (std::size_t i = 0; i < rest.size(); ++i)
        if (rest[i].y() > 1.45 && rest[i].x() > -0.5 * kPitch)
        {
            const double way = (session.deformed().samples[i] - rest[i]).norm();
            const long finger = std::lround(rest[i].x() / kPitch);
            (finger == 0 ? middle : ring) = std::max(finger == 0 ? middle : ring, way);
        }
    EXPECT_GT(middle, 0.2);
    EXPECT_LT(ring, 0.1 * middle);
}

} // namespace cellwarp::core
