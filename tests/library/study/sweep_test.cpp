// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/study/sweep.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "library/session/memory_limit.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

// The regions end where cells of every depth do.
const std::string kRegions = "fixed foot box -1 -1 -1 1 1 0.5000001\n"
                             "handle head box -1 -1 3.4999999 1 1 5\n";
const std::string kBend = kRegions + "frame 1\nmove head rotate 1 0 0 20\n"
                                     "frame 2\nmove head rotate 1 0 0 40\n";

/// A small bar of 8 cells along its length at depth 0.
struct SweptBar
{
    support::Folder folder;
    SweepInput input;
    SweepSettings settings;

    explicit SweptBar(const std::string& statements = kBend)
    {
        const Shape shape = support::box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 4);
        input.model = folder.write("bar.obj", support::obj_text(shape));
        input.handles = parse_handles("bar.handles", "cellwarp-handles 1\n" + statements);
        settings.session.cells.across = 8;
        settings.session.cells.gap = 0.1; // few voxels: a fast test
        settings.thresholds = {1e-2, 1e-4};
        settings.runs = 1;
    }
    SweepResult run() const { return run_sweep(input, settings); }
};

const SweepRow& row_of(const SweepResult& result, SweepKind kind, int depth,
                       const FieldChoice& field = FieldKind::Rbf, bool is_limited = false)
{
    const auto found =
        std::find_if(result.rows.begin(), result.rows.end(),
                     [&](const SweepRow& row)
                     {
                         return row.of.kind == kind && row.of.depth == depth &&
                                row.of.field == field && row.of.is_limited == is_limited;
                     });
    EXPECT_NE(found, result.rows.end());
    return *found;
}

} // namespace

TEST(Sweep, the_error_of_uniform_cells_falls_with_their_depth)
{
    const SweepResult result = SweptBar().run();
    ASSERT_TRUE(result.is_converged());
    EXPECT_EQ(result.across, 8);
    double largest = 1.0, rms = 1.0;
    for (int depth = 0; depth <= 2; ++depth)
    {
        SCOPED_TRACE(depth);
        const SweepRow& row = row_of(result, SweepKind::Uniform, depth);
        EXPECT_LT(row.error.largest, 0.6 * largest);
        EXPECT_LT(row.error.rms, 0.6 * rms);
        EXPECT_LE(row.error.rms, row.error.largest);
        EXPECT_EQ(row.cells, std::size_t(32) << (3 * depth));
        EXPECT_EQ(row.cells_per_depth.size(), idx(depth) + 1);
        EXPECT_EQ(row.from_coarser.has_value(), depth > 0);
        largest = row.error.largest;
        rms = row.error.rms;
    }
    EXPECT_GT(row_of(result, SweepKind::Uniform, 1).error.largest, 1e-4);
    EXPECT_LT(row_of(result, SweepKind::Uniform, 2).error.largest, 1e-5);
}

TEST(Sweep, the_reference_has_no_error_and_a_tight_gradient)
{
    const SweepResult result = SweptBar().run();
    const SweepRow& reference = result.rows.front();
    EXPECT_EQ(reference.of.kind, SweepKind::Reference);
    EXPECT_EQ(reference.error.largest, 0.0);
    EXPECT_EQ(reference.error.rms, 0.0);
    EXPECT_LE(reference.frames.back().solve.gradient, kReferenceTolerance);
    EXPECT_EQ(reference.run_seconds.size(), 1u);
    EXPECT_EQ(result.reference.size(), result.num_samples);
    EXPECT_LE(reference.frames.back().solve.energy_after,
              row_of(result, SweepKind::Uniform, 2).frames.back().solve.energy_after);
}

TEST(Sweep, a_smaller_threshold_never_has_fewer_cells_or_fewer_levels)
{
    const SweepResult result = SweptBar().run();
    const SweepRow* last = nullptr;
    for (const SweepRow& row : result.rows)
    {
        if (row.of.kind != SweepKind::Adaptive || row.of.field != FieldKind::Rbf)
            continue;
        EXPECT_GE(row.cells, row_of(result, SweepKind::Uniform, 0).cells);
        EXPECT_LE(row.cells, row_of(result, SweepKind::Uniform, 2).cells);
        if (last)
        {
            EXPECT_LT(row.of.threshold, last->of.threshold);
            EXPECT_GE(row.cells, last->cells);
            EXPECT_GE(row.cells_per_depth.size(), last->cells_per_depth.size());
        }
        last = &row;
    }
    EXPECT_TRUE(last);
}

TEST(Sweep, an_error_is_the_finest_fields_of_the_same_poses_and_a_distance_from_it)
{
    SweptBar bar;
    const FieldChoice small(FieldKind::Rbf, {1, 1.5, 1.5});
    bar.settings.max_depth = 1;
    bar.settings.fields = {FieldKind::Blend, FieldKind::Closest4, small, FieldKind::Rbf,
                           FieldKind::RbfGlobal};
    const SweepResult result = bar.run();
    for (const SweepRow& row : result.rows)
    {
        SCOPED_TRACE(case_name(row.of));
        EXPECT_EQ(row.parts.finest, FieldKind::RbfGlobal);
        EXPECT_EQ(row.parts.of_field.has_value(), row.of.field != FieldKind::RbfGlobal);
        if (row.of.kind != SweepKind::Uniform || !row.parts.of_field)
            continue;
        const SweepRow& finest =
            row_of(result, SweepKind::Uniform, row.of.depth, FieldKind::RbfGlobal);
        EXPECT_EQ(row.parts.of_cells.largest, finest.error.largest);
        EXPECT_EQ(row.parts.of_cells.rms, finest.error.rms);
        EXPECT_GT(row.parts.of_field->rms, 0.0);
        EXPECT_LE(row.error.rms, row.parts.of_cells.rms + row.parts.of_field->rms);
    }
    const auto field_rms = [&](const FieldChoice& field)
    { return row_of(result, SweepKind::Uniform, 0, field).parts.of_field->rms; };
    EXPECT_LT(field_rms(FieldKind::Rbf), field_rms(small));
    for (const FieldKind of_drags : {FieldKind::Blend, FieldKind::Closest4})
        EXPECT_LT(field_rms(small), field_rms(of_drags));
}

TEST(Sweep, without_the_global_field_the_local_one_is_the_finest)
{
    SweptBar bar;
    bar.settings.max_depth = 1;
    const SweepResult result = bar.run();
    const SweepRow& blend = row_of(result, SweepKind::Uniform, 0, FieldKind::Blend);
    const SweepRow& rbf = row_of(result, SweepKind::Uniform, 0);
    EXPECT_EQ(blend.parts.finest, FieldKind::Rbf);
    EXPECT_EQ(blend.parts.of_cells.rms, rbf.error.rms);
    EXPECT_TRUE(blend.parts.of_field);
    EXPECT_FALSE(rbf.parts.of_field);
}

TEST(Sweep, fields_have_names_that_read_back)
{
    for (const char* name : {"rbf", "blend", "closest4", "rbf-global", "rbf-centres",
                             "rbf:2:2:2.5", "rbf:1:0.5:64", "rbf:3:2:3"})
        EXPECT_EQ(field_name(field_of_name(name).value()), name);
    EXPECT_EQ(field_of_name("rbf:3:2:2.5"), FieldKind::Rbf) << "the release's own";
    for (const char* name : {"", "rbf:", "rbf:2", "rbf:2:2", "rbf:2:2:2:2", "rbf:0:2:2",
                             "rbf:1.5:2:2", "rbf:2:0:2", "rbf:2:3:2", "rbf:2:nan:2",
                             "rbf:2:2:inf", "rbf:65:2:2", "rbf:2:2:65", "blend:2:2:2"})
        EXPECT_FALSE(field_of_name(name)) << name;
}

TEST(Sweep, every_row_is_compared_with_a_result_from_elsewhere)
{
    SweptBar bar;
    bar.settings.max_depth = 1;
    const SweepResult alone = bar.run();
    for (const SweepRow& row : alone.rows)
        EXPECT_FALSE(row.against);
    bar.input.against = alone.reference;
    const SweepResult same = bar.run();
    for (const SweepRow& row : same.rows)
    {
        SCOPED_TRACE(case_name(row.of));
        EXPECT_EQ(row.against.value().largest, row.error.largest);
        EXPECT_EQ(row.against.value().rms, row.error.rms);
    }
    const double diagonal = std::sqrt(1.0 + 1.0 + 16.0);
    for (Eigen::Vector3d& x : bar.input.against)
        x.y() += 0.5 * diagonal;
    const SweepRow reference = bar.run().rows.front();
    EXPECT_NEAR(reference.against.value().largest, 0.5, 1e-12);
    EXPECT_NEAR(reference.against.value().rms, 0.5, 1e-12);
}

TEST(Sweep, a_result_from_elsewhere_has_as_many_samples_as_the_model)
{
    const SweptBar bar;
    const std::string other = bar.folder.write("other.xyz", "0 0 0\n1 0 0\n");
    const std::size_t count = read_geometry(bar.input.model).geometry.samples.size();
    EXPECT_EQ(error_of(Fault::Malformed, [&] { read_against(other, bar.input); }),
              other + ": has 2 samples, need " + std::to_string(count) + ", those of " +
                  bar.input.model + " in the same order");
    EXPECT_EQ(read_against(bar.input.model, bar.input).size(), count);
}

TEST(Sweep, distances_are_of_the_diagonal)
{
    const std::vector<Eigen::Vector3d> a = {{0, 0, 0}, {1, 0, 0}},
                                       b = {{0, 0, 0}, {1, 3, 4}};
    const Deviation found = deviation(a, b, 10.0);
    EXPECT_DOUBLE_EQ(found.largest, 0.5);
    EXPECT_DOUBLE_EQ(found.rms, 0.5 / std::sqrt(2.0));
    EXPECT_EQ(deviation(a, a, 0.0).largest, 0.0);
}

TEST(Sweep, cases_are_every_depth_threshold_field_and_limit)
{
    SweepSettings settings;
    settings.thresholds = {1e-2, 1e-3, 1e-4};
    settings.depths = {1, 2};
    settings.iteration_limits = {2};
    const std::vector<SweepCase> cases = sweep_cases(settings);
    ASSERT_EQ(cases.size(), 1u + 2 * 2 * (3 + 2 * 3));
    std::set<std::string> names;
    for (const SweepCase& of : cases)
        names.insert(case_name(of));
    EXPECT_EQ(names.size(), cases.size());
    for (const char* name :
         {"reference, rbf", "uniform 1, blend", "adaptive 0.001, rbf",
          "adaptive 0.001 to depth 1, rbf", "uniform 0, rbf, 2 iterations"})
        EXPECT_TRUE(names.contains(name)) << name;
}

TEST(Sweep, each_departure_is_taken_back_alone_and_then_all)
{
    SweptBar bar;
    bar.settings.takes_back = true;
    bar.settings.max_depth = 1;
    const SweepResult result = bar.run();
    ASSERT_TRUE(result.is_converged());
    std::map<std::string, int> runs;
    const SweepRow* usual = nullptr;
    for (const SweepRow& row : result.rows)
    {
        SCOPED_TRACE(case_name(row.of));
        if (row.of.kind == SweepKind::Reference)
            continue;
        ++runs[row.of.taken_back ? row.of.taken_back->name : ""];
        if (!usual)
            usual = &row;
        if (row.of.kind != SweepKind::Uniform || !row.of.taken_back)
            continue;
        const Departures& left = row.of.taken_back->departures;
        EXPECT_EQ(row.of.field == FieldKind::RbfCentres,
                  !left.local_rbf && row.of.taken_back->field == FieldKind::Rbf);
        EXPECT_EQ(row.of.field == FieldKind::Closest4,
                  !left.blend && row.of.taken_back->field == FieldKind::Blend);
        // What only decides over splitting, sizes or shells changes nothing here.
        const bool changes_nothing =
            !left.affine_errors || !left.level_changes || !left.smooth_borders;
        if (left != kBotsch07 && changes_nothing)
        {
            EXPECT_EQ(row.error.largest, usual->error.largest);
        }
        else
        {
            EXPECT_NE(row.error.largest, usual->error.largest);
        }
    }
    EXPECT_EQ(runs.size(), 10u);
    EXPECT_EQ(runs[""], 4);
    EXPECT_EQ(runs["glue in the face"], 2);
    EXPECT_EQ(runs["all (botsch07)"], 4);
}

TEST(Sweep, uniform_cells_have_the_references_material_and_adaptive_ones_their_own)
{
    SweepSettings settings;
    settings.max_depth = 3;
    settings.depths = {1};
    for (const SweepCase& of : sweep_cases(settings))
        EXPECT_EQ(of.grid_depth(), of.kind == SweepKind::Adaptive ? 1 : 3);
}

TEST(Sweep, each_run_counts_and_the_watch_sees_them)
{
    SweptBar bar;
    bar.settings.max_depth = 1;
    bar.settings.fields = {FieldKind::Blend};
    bar.settings.runs = 2;
    std::vector<std::size_t> seen;
    std::size_t num_runs = 0;
    const SweepResult result = run_sweep(bar.input, bar.settings,
                                         [&](const SweepProgress& now)
                                         {
                                             EXPECT_EQ(now.num_frames, 2u);
                                             num_runs = now.num_runs;
                                             if (seen.empty() || seen.back() != now.run)
                                                 seen.push_back(now.run);
                                         });
    EXPECT_EQ(num_runs, 1u + 2 * 4);
    ASSERT_EQ(seen.size(), num_runs);
    for (std::size_t i = 0; i < seen.size(); ++i)
        EXPECT_EQ(seen[i], i + 1);
    for (const SweepRow& row : result.rows)
    {
        EXPECT_EQ(row.run_seconds.size(), row.of.kind == SweepKind::Reference ? 1u : 2u);
        EXPECT_GT(row.seconds.total, 0.0);
        EXPECT_GT(row.peak_mb, 1.0);
        EXPECT_GE(row.seconds.total * (1.0 + 1e-9),
                  *std::min_element(row.run_seconds.begin(), row.run_seconds.end()));
    }
}

TEST(Sweep, a_limit_that_was_asked_for_is_no_failure)
{
    SweptBar bar;
    bar.settings.max_depth = 1;
    bar.settings.fields = {FieldKind::Rbf};
    bar.settings.iteration_limits = {1};
    const SweepResult result = bar.run();
    EXPECT_TRUE(result.is_converged());
    const SweepRow& limited = row_of(result, SweepKind::Uniform, 1, FieldKind::Rbf, true);
    EXPECT_EQ(limited.stop, Stop::IterationLimit);
    EXPECT_EQ(limited.iterations, 2);
    EXPECT_GT(limited.error.largest, row_of(result, SweepKind::Uniform, 1).error.largest);
    for (const std::string& warning : result.warnings)
        EXPECT_EQ(warning.find("converge"), std::string::npos) << warning;
}

TEST(Sweep, a_session_of_several_stages_is_swept)
{
    SweptBar bar(kRegions + "frame 1\nmove head rotate 1 0 0 20\ncommit\n" + kRegions +
                 "frame 2\nmove head rotate 0 0 1 20 about 0 0 0\n");
    bar.settings.max_depth = 1;
    const SweepResult result = bar.run();
    EXPECT_TRUE(result.is_converged());
    EXPECT_EQ(result.rows.front().frames.size(), 2u);
    EXPECT_GT(row_of(result, SweepKind::Uniform, 0).error.largest, 1e-4);
    EXPECT_LT(row_of(result, SweepKind::Uniform, 1).error.largest, 1e-5);
}

TEST(Sweep, a_reference_over_its_cells_names_a_depth_that_fits)
{
    SweptBar bar;
    bar.settings.session.cells.max_cells = 300;
    const std::string message = error_of(Fault::Budget, [&] { bar.run(); });
    EXPECT_TRUE(contains(message, "uniform cells of depth 2")) << message;
    EXPECT_TRUE(contains(message, "max_cells 300")) << message;
    EXPECT_TRUE(contains(message, "(use --max-depth 1)")) << message;
    bar.settings.max_depth = 1;
    EXPECT_TRUE(bar.run().is_converged());
}

TEST(Sweep, no_depth_is_named_where_none_fits)
{
    SweptBar bar;
    bar.settings.session.cells.max_cells = 3;
    const std::string message = error_of(Fault::Budget, [&] { bar.run(); });
    EXPECT_FALSE(contains(message, "--max-depth")) << message;
    EXPECT_TRUE(contains(message, "--across")) << message;
}

TEST(Sweep, a_reference_over_its_memory_names_a_depth_that_fits)
{
    SweptBar bar;
    bar.settings.max_depth = 4;
    bar.settings.session.cells.max_memory = resident_memory() + 95e6;
    const std::string message = error_of(Fault::Budget, [&] { bar.run(); });
    EXPECT_TRUE(contains(message, "(use --max-depth ")) << message;
}

TEST(Sweep, a_run_over_its_budget_gets_a_row_that_says_so)
{
    SweptBar bar;
    bar.settings.fields = {FieldKind::RbfGlobal, FieldKind::Blend};
    bar.settings.session.cells.max_memory = resident_memory() + 66e6;
    const SweepResult result = bar.run();
    EXPECT_FALSE(result.is_converged());
    const SweepRow& failed = row_of(result, SweepKind::Uniform, 2, FieldKind::RbfGlobal);
    EXPECT_FALSE(failed.is_done());
    EXPECT_TRUE(contains(failed.failure, "global")) << failed.failure;
    EXPECT_TRUE(row_of(result, SweepKind::Uniform, 1, FieldKind::RbfGlobal).is_done());
    const auto finest = [&](int depth)
    { return row_of(result, SweepKind::Uniform, depth, FieldKind::Blend).parts.finest; };
    EXPECT_EQ(finest(1), FieldKind::RbfGlobal);
    EXPECT_EQ(finest(2), FieldKind::Rbf);
    EXPECT_TRUE(std::any_of(result.warnings.begin(), result.warnings.end(),
                            [](const std::string& warning)
                            { return contains(warning, "uniform 2, rbf-global: "); }));
}

TEST(Sweep, a_model_that_changes_on_the_way_is_an_error)
{
    SweptBar bar;
    bar.settings.max_depth = 0;
    const auto change = [&](const SweepProgress& now)
    {
        if (now.run == 2)
            bar.folder.write("bar.obj", support::obj_text(support::box_shape(
                                            {-0.5, -0.5, 0}, {0.5, 0.5, 4}, 2)));
    };
    EXPECT_TRUE(contains(
        error_of(Fault::File, [&] { run_sweep(bar.input, bar.settings, change); }),
        "bar.obj: changed while it was swept"));
}

TEST(Sweep, results_are_the_same_to_the_bit_for_every_number_of_threads)
{
    SweptBar bar;
    bar.settings.max_depth = 1;
    const SweepResult first = bar.run();
    const ThreadLimit limit(1);
    const SweepResult second = bar.run();
    ASSERT_EQ(first.rows.size(), second.rows.size());
    EXPECT_EQ(first.reference, second.reference);
    for (std::size_t r = 0; r < first.rows.size(); ++r)
    {
        EXPECT_EQ(first.rows[r].error.largest, second.rows[r].error.largest);
        EXPECT_EQ(first.rows[r].error.rms, second.rows[r].error.rms);
        EXPECT_EQ(first.rows[r].iterations, second.rows[r].iterations);
    }
}

TEST(Sweep, a_case_played_again_ends_where_it_did)
{
    SweptBar bar;
    bar.settings.max_depth = 1;
    const SweepResult result = bar.run();
    const Session again = play_case(bar.input, bar.settings, result.rows.front().of);
    EXPECT_EQ(again.deformed().samples, result.reference);
}

TEST(Sweep, a_sessions_samples_by_its_own_field_are_its_samples)
{
    SweptBar bar(kRegions + "frame 1\nmove head rotate 1 0 0 20\ncommit\n" + kRegions +
                 "frame 2\nmove head rotate 0 0 1 20 about 0 0 0\n");
    for (const FieldKind kind : {FieldKind::Rbf, FieldKind::Blend, FieldKind::RbfGlobal})
    {
        const SweepCase of{SweepKind::Uniform, 0, 0, INFINITY, kind, 50, false};
        const Session session = play_case(bar.input, bar.settings, of);
        EXPECT_EQ(session.samples_by(kind), session.deformed().samples);
        EXPECT_NE(session.samples_by(FieldKind::Closest4), session.deformed().samples);
    }
}

} // namespace cellwarp::core
