// SPDX-License-Identifier: GPL-3.0-or-later
// What the user may do while threads are at work. Under the race checker these say
// nothing is shared that should not be.
#include <ctime>
#include <filesystem>
#include <optional>
#include <random>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "editor/document/editing.h"
#include "io/formats/geometry_file.h"
#include "library/session/scene_settings.h"
#include "tests/editor/document/random_edits.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

using support::between;
using support::hold_ends;

/// Editing a bar in few cells of two sizes; each frame takes some milliseconds.
struct Held
{
    support::BarDocument bar{8};
    Editing editing{bar.open()};

    explicit Held(int across = 10)
    {
        SceneSettings settings;
        settings.cells.across = across;
        settings.cells.max_depth = 1;
        settings.cells.gap = 0.03;
        settings.cells.threshold = 1e-4;
        document().change_settings(settings);
        hold_ends(document());
    }
    Document& document() { return editing.document(); }
    std::string scene() const { return bar.folder / "scene.json"; }
};

RigidMove bent(double degrees, double shift)
{
    RigidMove placement;
    placement.axis = Eigen::Vector3d::UnitY();
    placement.degrees = degrees;
    placement.translation.x() = shift;
    return placement;
}

/// So many frames that their solve is seen from another thread before it has ended.
constexpr int kFrames = 30;

void move_far(Document& document, double degrees)
{
    for (int k = 1; k <= kFrames; ++k)
        document.move_region("head", bent(degrees * k / kFrames, 0.5 * k / kFrames));
}

/// Until the solve has come this far.
void wait_for(Editing& editing, SolveStatus::State state)
{
    for (int k = 0; k < 300'000; ++k)
    {
        editing.update();
        if (editing.status().state == state)
            return;
        std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    FAIL() << "it has not come so far: " << editing.status().error;
}

/// What this process has computed so far, on all threads [s].
double computed()
{
    return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

std::vector<Eigen::Vector3d> replayed(const std::string& scene_path)
{
    const SceneFile scene = read_scene(scene_path);
    Session session(read_geometry(scene.model).geometry, read_handles(scene.handles),
                    settings_of(scene));
    while (session.next_frame(true))
        ;
    return session.deformed().samples;
}

/// Lets the hand rest until the drag goes on in smaller cells.
void rest_the_hand(Editing& editing)
{
    const std::size_t cells = editing.drag_status().cells;
    for (int k = 0; k < 12'000 && editing.drag_status().cells <= cells; ++k)
    {
        editing.update();
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    EXPECT_GT(editing.drag_status().cells, cells) << "no smaller cells have come";
}

/// Until the hand has been followed.
void wait_for_a_frame(Editing& editing)
{
    for (int k = 0; k < 60'000 && editing.drag_status().frames == 0; ++k)
    {
        editing.update();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_GT(editing.drag_status().frames, 0u) << "nothing follows the hand";
}

} // namespace

TEST(Threads, what_is_saved_while_it_solves_is_what_comes_out)
{
    Held held;
    move_far(held.document(), 60);
    wait_for(held.editing, SolveStatus::State::Solving);
    held.document().save(held.scene());
    EXPECT_TRUE(held.document().is_saved());
    held.editing.wait();
    ASSERT_NE(held.editing.result(), nullptr) << held.editing.status().error;
    EXPECT_TRUE(replayed(held.scene()) == held.editing.result()->samples);
}

TEST(Threads, edits_and_undo_during_a_solve_end_in_the_result_of_the_last)
{
    Held held;
    for (int k = 0; k < 6; ++k)
    {
        move_far(held.document(), 60 + 10 * k);
        wait_for(held.editing, SolveStatus::State::Solving);
        held.document().move_region("head", bent(65 + 10 * k, 0.5));
        if (k % 3 == 1)
            held.document().undo();
        if (k == 3) // other regions: a commit
        {
            held.document().select(between(held.document(), 1.7, 2.3), "Select by box");
            held.document().add_region(Role::Stiff, "belly");
        }
        held.editing.update();
    }
    held.document().save(held.scene());
    held.editing.wait();
    ASSERT_NE(held.editing.result(), nullptr) << held.editing.status().error;
    EXPECT_TRUE(replayed(held.scene()) == held.editing.result()->samples);
    while (held.document().can_undo())
        held.document().undo();
    held.editing.update();
    EXPECT_EQ(held.editing.result(), nullptr); // an older one is not shown as this one
    held.editing.wait();
    EXPECT_TRUE(held.editing.result()->samples ==
                held.document().model()->geometry.samples);
}

TEST(Threads, undo_during_a_drag_opens_the_hand_and_a_drag_during_a_solve_loses_nothing)
{
    Held held;
    held.editing.wait();
    held.document().move_region("head", bent(90, 0.5));
    held.editing.update();
    ASSERT_TRUE(held.editing.begin_drag("head"));
    for (int k = 0; k < 20; ++k)
    {
        held.editing.drag_to(bent(90 - k, 0.5));
        held.editing.update();
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    held.document().undo();
    held.editing.update();
    EXPECT_FALSE(held.editing.dragged());
    held.editing.end_drag();
    EXPECT_EQ(held.document().region("head")->placement, RigidMove());
    held.document().redo();
    held.editing.update();
    ASSERT_TRUE(held.editing.begin_drag("head")); // while it is solved again
    held.editing.drag_to(bent(71, 0.5));
    held.editing.end_drag();
    held.document().save(held.scene());
    held.editing.wait();
    ASSERT_NE(held.editing.result(), nullptr) << held.editing.status().error;
    EXPECT_EQ(held.document().region("head")->placement, bent(71, 0.5));
    EXPECT_TRUE(replayed(held.scene()) == held.editing.result()->samples);
}

TEST(Threads, closing_does_not_wait_for_a_solve_a_drag_or_smaller_cells)
{
    const double before = computed();
    {
        Held held;
        move_far(held.document(), 60);
        held.editing.wait();
        ASSERT_NE(held.editing.result(), nullptr) << held.editing.status().error;
    }
    const double whole = computed() - before;
    for (int moment = 0; moment < 5; ++moment)
    {
        SCOPED_TRACE(moment);
        auto held = std::make_unique<Held>();
        if (moment == 0) // at once
        {
            move_far(held->document(), 60);
            held->editing.update();
        }
        else if (moment == 1) // it solves
        {
            move_far(held->document(), 60);
            wait_for(held->editing, SolveStatus::State::Solving);
        }
        else
        {
            held->editing.wait();
            ASSERT_TRUE(held->editing.begin_drag("head"));
            held->editing.show_cells(true);
            held->editing.drag_to(bent(60, 0.5));
            wait_for_a_frame(held->editing);
            if (moment > 2)
                rest_the_hand(held->editing);
            if (moment == 4) // and what was refining is left over
                held->editing.cancel_drag();
        }
        // Counted in work, which a busy machine does not make more of.
        const double start = computed();
        held.reset();
        EXPECT_LT(computed() - start, 0.5 * whole);
    }
}

TEST(Threads, another_document_opens_while_one_solves)
{
    auto first = std::make_unique<Held>();
    move_far(first->document(), 60);
    wait_for(first->editing, SolveStatus::State::Solving);
    Held second;
    second.document().move_region("head", bent(-30, 0.2));
    second.editing.update();
    first.reset();
    second.document().save(second.scene());
    second.editing.wait();
    ASSERT_NE(second.editing.result(), nullptr) << second.editing.status().error;
    EXPECT_TRUE(replayed(second.scene()) == second.editing.result()->samples);
}

TEST(Threads, a_request_that_is_cancelled_says_so_and_the_next_one_is_solved)
{
    Held held;
    for (int k = 0; k < 4; ++k)
    {
        SCOPED_TRACE(k);
        move_far(held.document(), 30 + k);
        held.editing.update();
        if (k % 2)
            wait_for(held.editing, SolveStatus::State::Solving);
        held.editing.cancel();
        held.editing.wait();
        EXPECT_EQ(held.editing.result(), nullptr);
        EXPECT_EQ(held.editing.status().state, SolveStatus::State::Failed);
        EXPECT_EQ(held.editing.status().error, "cancelled");
        held.document().undo(); // so that the next one has something to do
    }
    held.document().move_region("head", bent(10, 0.5));
    held.editing.wait();
    EXPECT_NE(held.editing.result(), nullptr) << held.editing.status().error;
    EXPECT_TRUE(held.editing.status().error.empty());
}

TEST(Threads, nothing_is_awaited_while_edits_of_an_earlier_run_are_not_decided_on)
{
    const support::BarDocument bar;
    {
        Document document = bar.open();
        hold_ends(document);
    }
    Editing editing(bar.open());
    editing.wait();
    EXPECT_EQ(editing.result(), nullptr);
    editing.document().recover();
    editing.wait();
    EXPECT_NE(editing.result(), nullptr) << editing.status().error;
}

TEST(Threads, material_under_way_ends_when_it_is_not_wanted_and_serves_other_statements)
{
    std::mt19937 rng(6);
    std::uniform_real_distribution<double> number(0.0, 1.0);
    std::string text;
    for (int i = 0; i < 100000; ++i)
        text += fmt::format("{} {} {}\n", number(rng), number(rng), number(rng));
    const auto model = std::make_shared<const GeometryFile>(scan_geometry("c.xyz", text));
    const WorkFrame view = automatic_frame(bounding_box(model->geometry.samples));
    const auto request = [&](std::uint64_t revision)
    {
        return SolveRequest{
            revision,
            parse_handles("", fmt::format("cellwarp-handles 1\nunits relative\n"
                                          "fixed foot box 0 0 0 1 1 0.{}\n",
                                          revision)),
            SceneFile(), layout_of(model->geometry)};
    };
    const auto cpu = [] { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; };
    const auto wait_until = [](const auto& is_there)
    {
        while (!is_there())
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
    };
    double begin = cpu();
    const auto is_solved = [](SolveWorker& worker, std::uint64_t revision)
    {
        const std::optional<Solved> solved = worker.take();
        return solved && solved->revision == revision;
    };
    {
        SolveWorker worker(model, view);
        worker.ask(request(1));
        wait_until([&] { return is_solved(worker, 1); });
    }
    const double whole = cpu() - begin;
    for (const bool is_cancelled : {true, false})
    {
        std::optional<SolveWorker> worker(std::in_place, model, view);
        begin = cpu();
        worker->ask(request(1));
        wait_until([&] { return cpu() > begin + 0.4 * whole; });
        begin = cpu();
        if (is_cancelled)
        {
            worker->cancel();
            wait_until([&] { return !worker->is_busy(); });
            EXPECT_EQ(worker->status().error, "cancelled");
        }
        else
            worker.reset();
        EXPECT_LT(cpu() - begin, 0.2 * whole);
    }
    begin = cpu();
    SolveWorker worker(model, view);
    worker.ask(request(1));
    wait_until([&] { return cpu() > begin + 0.5 * whole; });
    worker.ask(request(2));
    wait_until([&] { return is_solved(worker, 2); });
    EXPECT_LT(cpu() - begin, 1.3 * whole);
}

TEST(Threads, nothing_is_done_before_its_shape_can_be_seen)
{
    const support::BarDocument bar(8);
    SceneFile scene;
    scene.settings.cells.across = 10;
    Document held = bar.open(false);
    hold_ends(held);
    SolveWorker worker(held.model(), automatic_frame(held.box()));
    const auto layout = layout_of(held.model()->geometry);
    for (const std::uint64_t revision : {1, 2})
    {
        worker.ask({revision, held.handles(), scene, layout});
        EXPECT_NE(worker.status().state, SolveStatus::State::Idle); // asked for
        while (worker.is_busy())
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        EXPECT_EQ(worker.status().state, SolveStatus::State::Field);
        const std::optional<Solved> solved = worker.take();
        ASSERT_TRUE(solved);
        EXPECT_GT(solved->figures.cells, 0u);
        EXPECT_EQ(worker.status().state, SolveStatus::State::Idle);
    }
}

TEST(Threads, a_drag_in_the_same_cells_serves_on_from_where_the_next_one_begins)
{
    const support::BarDocument bar(8);
    SceneFile scene;
    scene.settings.cells.across = 10;
    scene.settings.cells.max_depth = 0;
    Document held = bar.open(false);
    hold_ends(held);
    SolveWorker worker(held.model(), automatic_frame(held.box()));
    const auto layout = layout_of(held.model()->geometry);
    const auto solved = [&](std::uint64_t revision)
    {
        worker.ask({revision, held.handles(), scene, layout});
        std::optional<Solved> result;
        while (!(result = worker.take()) &&
               worker.status().state != SolveStatus::State::Failed)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        return *result->drag;
    };
    PreparedDrag drag = prepare_drag(solved(1));
    held.move_region("head", bent(30, 0.2));
    const DragSource next = solved(2);
    ASSERT_TRUE(serves_on(drag, next));
    start_from(drag, next);
    const PreparedDrag anew = prepare_drag(next);
    const auto places = [](const PreparedDrag& of)
    {
        const std::span<const float> now = of.drag->samples().positions();
        return std::vector<float>(now.begin(), now.end());
    };
    EXPECT_EQ(places(drag), places(anew));
    // Other regions are another drag.
    held.set_role("head", Role::Pin);
    EXPECT_FALSE(serves_on(drag, solved(3)));
}

TEST(Threads, a_drag_whose_smaller_cells_fail_goes_on_in_its_own)
{
    const support::BarDocument bar(8);
    SceneFile scene;
    scene.settings.cells.across = 10;
    scene.settings.cells.max_depth = 1;
    scene.settings.cells.gap = 0.03;
    scene.settings.cells.threshold = 1e-4;
    Document held = bar.open(false);
    hold_ends(held);
    const WorkFrame view = automatic_frame(held.box());
    SolveWorker worker(held.model(), view);
    worker.ask({1, held.handles(), scene, layout_of(held.model()->geometry)});
    std::optional<Solved> solved;
    while (!(solved = worker.take()) &&
           worker.status().state != SolveStatus::State::Failed)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ASSERT_TRUE(solved) << worker.status().error;
    PreparedDrag prepared = prepare_drag(*solved->drag);
    const std::size_t cells = prepared.source.body->cells.size();
    prepared.source.system = {1.0,
                              Method::GaussNewtonDirect}; // smaller ones find no memory
    LiveDrag live(std::move(prepared));
    const WorkFrame frame = solved->drag->body->rest->frame;
    live.move({Motion(), motion_of(bent(60, 0.5), held.region("head")->centre, frame)});
    std::this_thread::sleep_for(std::chrono::milliseconds(600));
    EXPECT_GT(live.status().frames, 0u);
    EXPECT_EQ(live.status().cells, cells);
    EXPECT_TRUE(live.status().error.empty());
    EXPECT_TRUE(live.stop().has_value());
}

} // namespace cellwarp::core
