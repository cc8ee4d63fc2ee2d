// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/deform.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "tests/support/files.h"
#include "tests/support/interface.h"

namespace cellwarp
{

using support::Bar;
using support::bend;
using support::coarse;
using support::contains;
using support::error_of;
using support::numbers;

TEST(Deform, moves_the_handle_and_holds_the_rest)
{
    const Bar bar;
    const Result result = deform(Model(bar), bend(), coarse());
    ASSERT_EQ(result.frames.size(), 1u);
    EXPECT_TRUE(result.is_converged());
    EXPECT_EQ(result.frames[0].stop, Stop::Converged);
    EXPECT_GT(result.frames[0].cells, 0u);
    const std::span<const double> moved = result.deformed.samples();
    ASSERT_EQ(moved.size(), 3 * bar.samples.size());
    double farthest = 0.0;
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
    {
        double distance = 0.0;
        for (std::size_t k = 0; k < 3; ++k)
            distance += std::pow(moved[3 * i + k] - bar.samples[i][k], 2);
        if (bar.samples[i][2] <= 0.5)
        {
            EXPECT_LT(distance, 1e-18) << i;
        }
        farthest = std::max(farthest, distance);
    }
    EXPECT_GT(farthest, 0.25);
}

TEST(Deform, gives_the_same_bits_for_every_layout_and_number_of_threads)
{
    const Bar bar;
    const std::vector<double> expected =
        numbers(deform(Model(bar), bend(), coarse()).deformed.samples());
    ShapeView shape = bar;
    std::vector<double> columns(3 * bar.samples.size());
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
        for (std::size_t k = 0; k < 3; ++k)
            columns[k * bar.samples.size() + i] = bar.samples[i][k];
    shape.samples = PointsView::columns(columns.data(), bar.samples.size());
    for (const int threads : {0, 1, 2, 5})
    {
        Settings settings = coarse();
        settings.threads = threads;
        EXPECT_TRUE(numbers(deform(Model(shape), bend(), settings).deformed.samples()) ==
                    expected)
            << threads;
    }
}

TEST(Deform, turns_what_hangs_on_samples)
{
    const Bar bar;
    const std::size_t n = bar.samples.size();
    std::vector<double> along(3 * n, 0.0), rotations(4 * n, 0.0);
    for (std::size_t i = 0; i < n; ++i)
        along[3 * i + 2] = rotations[4 * i] = 1.0;
    ShapeView shape = bar;
    shape.normals = along;
    shape.tangents = along;
    shape.rotations = rotations;
    const Model model(shape);
    EXPECT_EQ(model.num_normals(), n);
    const Result result = deform(model, bend(30.0), coarse());
    ASSERT_EQ(result.deformed.normals().size(), 3 * n);
    ASSERT_EQ(result.deformed.tangents().size(), 3 * n);
    ASSERT_EQ(result.deformed.rotations().size(), 4 * n);
    constexpr double kRadians = 3.14159265358979323846 / 180.0;
    for (std::size_t i = 0; i < n; ++i)
        if (bar.samples[i][2] >= 4.5)
        {
            EXPECT_NEAR(result.deformed.normals()[3 * i + 2], std::cos(30 * kRadians),
                        1e-9);
            EXPECT_NEAR(result.deformed.tangents()[3 * i + 1], -std::sin(30 * kRadians),
                        1e-9);
            EXPECT_NEAR(result.deformed.rotations()[4 * i], std::cos(15 * kRadians),
                        1e-9);
        }
    shape.normals = {};
    std::vector<double> of_corners(12 * bar.faces.size(), 0.0);
    for (std::size_t c = 0; c < 4 * bar.faces.size(); ++c)
        of_corners[3 * c] = 1.0;
    shape.corner_normals = of_corners;
    const Model by_corners(shape);
    EXPECT_EQ(by_corners.num_normals(), 4 * bar.faces.size());
    const Result turned = deform(by_corners, bend(30.0), coarse());
    for (std::size_t c = 0; c < 4 * bar.faces.size(); ++c)
        if (bar.samples[bar.faces[c / 4][c % 4]][2] >= 4.5)
        {
            EXPECT_NEAR(turned.deformed.normals()[3 * c], 1.0, 1e-9);
        }
}

TEST(Deform, chooses_by_masks_indices_and_groups_alike)
{
    const Bar bar;
    std::vector<std::uint8_t> foot, head;
    std::vector<std::int64_t> head_numbers;
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
    {
        foot.push_back(bar.samples[i][2] <= 0.5);
        head.push_back(bar.samples[i][2] >= 4.5);
        if (head.back())
            head_numbers.insert(head_numbers.begin(), static_cast<std::int64_t>(i));
    }
    const auto result = [&](const Selector& where)
    {
        Edit edit;
        edit.fixed("foot", Selector::mask(foot)).handle("head", where);
        edit.frame(1).move("head", {rotate({1, 0, 0}, 30)});
        return numbers(deform(Model(bar), edit, coarse()).deformed.samples());
    };
    EXPECT_TRUE(result(Selector::mask(head)) == result(Selector::indices(head_numbers)));
    std::vector<std::uint8_t> too_long(bar.samples.size() + 1, 0);
    too_long.back() = 1;
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { result(Selector::mask(too_long)); }), "head"));
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { result(Selector::group("none")); }), "none"));
}

TEST(Deform, without_a_frame_leaves_the_samples_and_says_so)
{
    const Bar bar;
    const Result result = deform(Model(bar), Edit());
    EXPECT_TRUE(result.is_converged());
    EXPECT_TRUE(result.frames.empty());
    ASSERT_EQ(result.warnings.size(), 1u);
    EXPECT_TRUE(contains(result.warnings[0], "no frame"));
    EXPECT_EQ(result.deformed.samples()[5], bar.samples[1][2]);
}

TEST(Deform, says_that_a_frame_has_not_converged)
{
    Settings settings = coarse();
    settings.max_iterations = 1;
    const Result result = deform(Model(Bar()), bend(120.0), settings);
    EXPECT_FALSE(result.is_converged());
    EXPECT_EQ(result.frames[0].stop, Stop::IterationLimit);
    ASSERT_FALSE(result.warnings.empty());
    EXPECT_TRUE(contains(result.warnings.back(), "did not converge (iteration limit"));
}

TEST(Deform, refuses_what_cannot_be_solved)
{
    const Model model{Bar()};
    Settings settings;
    settings.cells.gap = -1.0;
    error_of(Fault::Usage, [&] { deform(model, bend(), settings); });
    settings = coarse();
    settings.max_memory = 1.0;
    error_of(Fault::Budget, [&] { deform(model, bend(), settings); });
    Edit empty;
    empty.fixed("foot", Selector::sphere({50, 0, 0}, 0.1)).frame(1);
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { deform(model, empty, coarse()); }), "foot"));
}

TEST(Deform, results_outlive_models_and_edits)
{
    std::optional<Deformed> kept;
    {
        const Result result = deform(Model(Bar()), bend(), coarse());
        kept = result.deformed;
    }
    EXPECT_EQ(kept->samples().size(), 3 * Bar().samples.size());
}

TEST(Deform, measures_volume_and_intersections)
{
    const Model model{Bar()};
    const Result result = deform(model, bend(), coarse());
    const std::optional<Volume> volume = volume_of(model, result.deformed);
    ASSERT_TRUE(volume);
    EXPECT_NEAR(volume->before, 5.0, 1e-12);
    EXPECT_NEAR(volume->after, 5.0, 0.25);
    const std::vector<std::string> parts = features();
    const auto crossings = self_intersections_of(model, result.deformed);
    ASSERT_EQ(crossings.has_value(),
              std::find(parts.begin(), parts.end(), "cgal") != parts.end());
    if (crossings)
    {
        EXPECT_EQ(crossings->fresh, 0u);
    }
    ShapeView other;
    const std::vector<double> places = {0, 0, 0, 1, 0, 0};
    other.samples = places;
    error_of(Fault::Usage, [&] { volume_of(Model(other), result.deformed); });
}

TEST(Deform, writes_plain_files_of_models_in_memory)
{
    const core::support::Folder folder;
    const Model model{Bar()};
    const Result result = deform(model, bend(), coarse());
    for (const char* name : {"a.obj", "a.ply", "a.off"})
    {
        write(folder / name, model, result.deformed);
        const Model again = Model::read(folder / name);
        EXPECT_EQ(again.num_faces(), model.num_faces()) << name;
        EXPECT_TRUE(numbers(again.samples()) == numbers(result.deformed.samples()))
            << name;
    }
    error_of(Fault::File, [&] { write(folder / "a.obj", model, result.deformed); });
    write(folder / "a.obj", model, result.deformed, Overwrite::Yes);
    error_of(Fault::Usage, [&] { write(folder / "a.what", model, result.deformed); });
    error_of(Fault::Usage, [&] { write(folder / "a.gltf", model, result.deformed); });
}

TEST(Deform, shows_its_progress)
{
    std::vector<Progress> seen;
    const std::thread::id own = std::this_thread::get_id();
    Control control;
    control.watch = [&](const Progress& progress)
    {
        EXPECT_EQ(std::this_thread::get_id(), own);
        seen.push_back(progress);
    };
    Edit edit = bend(60.0);
    edit.frame(2).move("head", {rotate_about_border({1, 0, 0}, -60)});
    deform(Model(Bar()), edit, {}, control);
    ASSERT_FALSE(seen.empty());
    double share = 0.0;
    for (const Progress& progress : seen)
    {
        EXPECT_GE(progress.share, share);
        EXPECT_LE(progress.share, 1.0);
        share = progress.share;
        EXPECT_EQ(progress.all, 2u);
    }
    EXPECT_EQ(seen.back().share, 1.0);
    EXPECT_EQ(seen.back().done, 2u);
}

TEST(Deform, stops_in_each_phase)
{
    const Model model{Bar(12)};
    // Requests after ever longer times: from the first look on to the end.
    const auto start = std::chrono::steady_clock::now();
    const std::vector<double> whole = numbers(deform(model, bend()).deformed.samples());
    const auto all = std::chrono::steady_clock::now() - start;
    int num_stopped = 0;
    for (int part = 0; part <= 8; ++part)
    {
        std::stop_source source;
        std::jthread asker(
            [&]
            {
                std::this_thread::sleep_for(part * all / 10);
                source.request_stop();
            });
        Control control;
        control.stop = source.get_token();
        try
        {
            EXPECT_TRUE(numbers(deform(model, bend(), {}, control).deformed.samples()) ==
                        whole);
        }
        catch (const Error& error)
        {
            EXPECT_EQ(error.fault(), Fault::Stopped);
            ++num_stopped;
        }
    }
    EXPECT_GE(num_stopped, 1);
    std::stop_source at_once;
    at_once.request_stop();
    Control control;
    control.stop = at_once.get_token();
    error_of(Fault::Stopped, [&] { deform(model, bend(), {}, control); });
}

TEST(Deform, lets_exceptions_of_the_caller_through)
{
    struct Own
    {
        int number;
    };
    Control control;
    control.watch = [](const Progress&) { throw Own{7}; };
    try
    {
        deform(Model(Bar(12)), bend(), {}, control);
        FAIL();
    }
    catch (const Own& own)
    {
        EXPECT_EQ(own.number, 7);
    }
}

TEST(Deform, works_in_several_threads_at_once)
{
    const Model model{Bar()};
    const std::vector<double> expected =
        numbers(deform(model, bend(), coarse()).deformed.samples());
    std::vector<std::jthread> threads;
    std::array<bool, 4> is_equal{};
    for (bool& equal : is_equal)
        threads.emplace_back(
            [&] {
                equal = numbers(deform(model, bend(), coarse()).deformed.samples()) ==
                        expected;
            });
    threads.clear();
    for (const bool equal : is_equal)
        EXPECT_TRUE(equal);
}

TEST(Deform, has_its_version)
{
    EXPECT_TRUE(version().starts_with(std::to_string(CELLWARP_VERSION_MAJOR) + "." +
                                      std::to_string(CELLWARP_VERSION_MINOR) + "."));
}

} // namespace cellwarp
