// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/study.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "io/base/number.h"
#include "library/access.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/study/sweep.h"
#include "library/views.h"

namespace cellwarp
{

namespace
{

/// Checks each number of a list.
template <class Number>
void check_all(const char* field, const std::vector<Number>& numbers, Number low,
               Number high)
{
    for (std::size_t i = 0; i < numbers.size(); ++i)
        if (!(numbers[i] >= low && numbers[i] <= high))
            throw wrong_argument(field + ("[" + std::to_string(i) + "]"),
                                 "got " + core::shortest(double(numbers[i])) + ", need " +
                                     core::shortest(double(low)) + " to " +
                                     core::shortest(double(high)));
}

template <class Number, class Order>
std::vector<Number> in_order(std::vector<Number> numbers, Order order)
{
    std::sort(numbers.begin(), numbers.end(), order);
    numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
    return numbers;
}

core::SweepSettings settings_of(const SweepSettings& settings)
{
    constexpr int kDeepest = 20, kMostRuns = 100, kMostIterations = 1000000;
    check_all<int>("max_depth", {settings.max_depth}, 0, kDeepest);
    check_all<double>("thresholds", settings.thresholds,
                      std::numeric_limits<double>::min(),
                      std::numeric_limits<double>::max());
    check_all<int>("depths", settings.depths, 0, kDeepest);
    check_all<int>("iteration_limits", settings.iteration_limits, 1, kMostIterations);
    check_all<int>("runs", {settings.runs}, 1, kMostRuns);
    if (settings.fields.empty())
        throw wrong_argument("fields", "there is none");
    core::SweepSettings out;
    out.session = to_core(settings.settings);
    out.max_depth = settings.max_depth;
    out.thresholds = in_order(settings.thresholds, std::greater<>());
    out.depths = in_order(settings.depths, std::less<>());
    out.iteration_limits = in_order(settings.iteration_limits, std::less<>());
    out.runs = settings.runs;
    out.fields.clear();
    for (const FieldKind field : settings.fields)
        if (const core::FieldChoice choice = to_core(field);
            std::find(out.fields.begin(), out.fields.end(), choice) == out.fields.end())
            out.fields.push_back(choice);
    return out;
}

SweepRow row_of(const core::SweepRow& row)
{
    SweepRow out;
    out.kind = kind_name(row.of.kind);
    out.depth = row.of.depth;
    out.threshold = row.of.threshold;
    out.field = from_core(row.of.field.kind);
    out.max_iterations = row.of.is_limited ? row.of.max_iterations : 0;
    out.failure = row.failure;
    out.error_largest = row.error.largest;
    out.error_rms = row.error.rms;
    if (row.against)
    {
        out.against_largest = row.against->largest;
        out.against_rms = row.against->rms;
    }
    out.cells = row.cells;
    out.iterations = row.iterations;
    out.stop = from_core(row.stop);
    out.seconds = row.seconds.total;
    out.cells_seconds = row.seconds.cells;
    out.solve_seconds = row.seconds.solve;
    out.field_seconds = row.seconds.field_fit + row.seconds.field_apply;
    return out;
}

} // namespace

Sweep sweep(const Model& model, const Edit& edit, const SweepSettings& settings,
            const Control& control)
{
    const core::SweepSettings of_sweep = run_call([&] { return settings_of(settings); });
    return run_call(
        control, settings.settings.threads,
        [&](Watcher& watcher)
        {
            watcher.begin("run", 0.0);
            if (edit.num_frames() == 0)
                throw wrong_argument("edit", "there is no frame to measure");
            core::SweepInput input;
            input.model = model.path();
            input.handles = Access::handles(edit);
            input.geometry = geometry_of(Access::file(model));
            input.against = vectors_of<3>(settings.against, "against");
            if (!input.against.empty() && input.against.size() != model.num_samples())
                throw wrong_argument(
                    "against", "got " + std::to_string(input.against.size()) +
                                   ", need one for each of " +
                                   std::to_string(model.num_samples()) + " samples");
            const core::SweepResult result = run_sweep(
                input, of_sweep,
                [&](const core::SweepProgress& now)
                {
                    watcher.progress().done = now.run - 1;
                    watcher.progress().all = now.num_runs;
                    watcher.progress().iteration = now.frame.iteration;
                    watcher.progress().gradient = now.frame.gradient;
                    watcher.set_share(double(now.run - 1) / double(now.num_runs));
                    watcher.show();
                });
            Sweep out;
            for (const core::SweepRow& row : result.rows)
                out.rows.push_back(row_of(row));
            out.warnings = result.warnings;
            return out;
        });
}

} // namespace cellwarp
