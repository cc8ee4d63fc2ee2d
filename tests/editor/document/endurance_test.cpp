// SPDX-License-Identifier: GPL-3.0-or-later
// Long sessions: what ten thousand edits leave behind.
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include "editor/document/editing.h"
#include "io/formats/geometry_file.h"
#include "library/session/scene_settings.h"
#include "octree/base/clock.h"
#include "tests/editor/document/random_edits.h"
#include "tests/support/random.h"
#include "tests/support/sanitized.h"

namespace cellwarp::core
{

namespace
{

using support::contents;
using support::edit_at_random;
using support::hold_ends;

constexpr std::size_t kEdits = 10000;

/// What the process has in memory [MB]; what is free but not given back is not counted.
double resident_mb()
{
    ::malloc_trim(0);
    std::ifstream pages("/proc/self/statm");
    double total = 0, resident = 0;
    pages >> total >> resident;
    return resident * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1e6;
}

/// Ready for edits that are solved for in no time.
void hold_ends_in_large_cells(Editing& editing)
{
    SceneSettings settings;
    settings.cells.across = 6;
    settings.cells.max_depth = 0;
    settings.cells.gap = 0.1; // coarse voxels
    editing.document().change_settings(settings);
    hold_ends(editing.document());
    editing.wait();
}

/// What a saved scene replays to.
std::vector<Eigen::Vector3d> replayed_scene(const std::string& path)
{
    const SceneFile scene = read_scene(path);
    Session session(read_geometry(scene.model).geometry, read_handles(scene.handles),
                    settings_of(scene));
    while (session.next_frame(true))
        ;
    return session.deformed().samples;
}

} // namespace

TEST(Endurance, ten_thousand_edits_go_back_and_forth_in_little_memory_at_one_speed)
{
    const support::BarDocument bar;
    Document document = bar.open();
    const std::string start = contents(document);
    hold_ends(document);
    std::mt19937 rng(7);
    const auto edit_until = [&](std::size_t count)
    {
        const Clock::time_point begun = Clock::now();
        while (document.history().size() < count)
            edit_at_random(document, rng);
        return seconds_since(begun);
    };
    const double first_seconds = edit_until(kEdits / 10);
    const double early_mb = resident_mb();
    edit_until(kEdits / 10 * 9);
    const double last_seconds = edit_until(kEdits);
    const double late_mb = resident_mb();
    const std::string end = contents(document);
    const Clock::time_point begun = Clock::now();
    while (document.can_undo())
        document.undo();
    EXPECT_EQ(contents(document), start);
    while (document.can_redo())
        document.redo();
    EXPECT_TRUE(contents(document) == end);
    std::printf("%zu edits: %.1f MB more than after %zu; the first %zu took %.3f s, the "
                "last %.3f s, undo and redo of all %.3f s\n",
                kEdits, late_mb - early_mb, kEdits / 10, kEdits / 10, first_seconds,
                last_seconds, seconds_since(begun));
    if (!support::kIsSanitized)
    {
        EXPECT_LE(late_mb - early_mb, 5.0);
    }
    // A noisy machine is no reason to fail; a cost that grows with the edits is.
    EXPECT_LE(last_seconds, 4 * first_seconds + 0.1);
}

TEST(Endurance, three_hundred_solved_edits_are_the_same_to_the_bit_there_and_back)
{
    const support::BarDocument bar;
    Editing editing(bar.open());
    Document& document = editing.document();
    hold_ends_in_large_cells(editing);
    std::mt19937 rng(11);
    for (int k = 0; k < 300; ++k)
    {
        const std::size_t before = document.history().position();
        edit_at_random(document, rng);
        if (k % 25 != 24)
            continue;
        editing.wait();
        // Regions that cannot be solved are told; the user takes them back.
        for (; !editing.result() && document.can_undo(); editing.wait())
            document.undo();
        ASSERT_NE(editing.result(), nullptr) << before << ": " << editing.status().error;
    }
    const std::vector<Eigen::Vector3d> end = editing.result()->samples;
    EXPECT_GT(document.history().size(), 100u);
    EXPECT_GT(document.handles().stages.size(), 3u);
    document.save(bar.folder / "scene.json");
    EXPECT_TRUE(replayed_scene(bar.folder / "scene.json") == end);
    const std::size_t done = document.history().position();
    for (std::size_t k = 1; document.can_undo(); ++k)
    {
        document.undo();
        if (k % 25 == 0)
            editing.wait();
    }
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_TRUE(editing.result()->samples == document.model()->geometry.samples);
    for (std::size_t k = 1; document.history().position() < done; ++k)
    {
        document.redo();
        if (k % 25 == 0)
            editing.wait();
    }
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_TRUE(editing.result()->samples == end);
}

/// A minute of them, sixty a second, or as many as CELLWARP_DRAG_EVENTS says: an hour has
/// 216,000.
TEST(Endurance, drag_events_take_no_more_memory_in_the_end_than_after_a_tenth)
{
    constexpr std::size_t kOfOneDrag = 300;
    const char* const wanted = std::getenv("CELLWARP_DRAG_EVENTS");
    const std::size_t events =
        std::max(kOfOneDrag, wanted ? std::strtoul(wanted, nullptr, 10) : 3600);
    const support::BarDocument bar;
    Editing editing(bar.open());
    Document& document = editing.document();
    hold_ends_in_large_cells(editing);
    std::mt19937 rng(13);
    double early_mb = 0.0;
    std::size_t num_shown = 0;
    for (std::size_t event = 0; event < events; ++event)
    {
        if (event == events / 10)
            early_mb = resident_mb();
        if (event % kOfOneDrag == 0)
        {
            ASSERT_TRUE(editing.begin_drag("head"));
        }
        RigidMove to;
        to.axis = Eigen::Vector3d::UnitY();
        to.degrees = support::random_number(rng, -60.0, 60.0);
        to.translation = support::random_vector(rng, 0.5);
        const std::uint64_t shown = editing.drag_status().frames;
        editing.drag_to(to);
        // Every one is solved for: none is replaced by the next.
        for (int tries = 0; tries < 20000 && editing.drag_status().frames == shown;
             ++tries)
        {
            editing.update();
            std::this_thread::sleep_for(std::chrono::microseconds(50));
        }
        num_shown += editing.drag_status().frames - shown;
        if (event % kOfOneDrag != kOfOneDrag - 1)
            continue;
        editing.end_drag();
        document.save(bar.folder / "scene.json"); // while it solves
        editing.wait();
        ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    }
    const double late_mb = resident_mb();
    std::printf("%zu events, %zu shown: %.1f MB more than after a tenth\n", events,
                num_shown, late_mb - early_mb);
    EXPECT_GE(num_shown, events * 99 / 100);
    if (!support::kIsSanitized)
    {
        EXPECT_LE(late_mb - early_mb, 5.0);
    }
    EXPECT_TRUE(replayed_scene(bar.folder / "scene.json") == editing.result()->samples);
}

} // namespace cellwarp::core
