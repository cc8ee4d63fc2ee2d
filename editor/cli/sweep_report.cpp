// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/sweep_report.h"

#include <algorithm>

#include <fmt/format.h>

#include "editor/cli/report.h"

namespace cellwarp::core
{

namespace
{

const char* method_name(Method method)
{
    switch (method)
    {
    case Method::Newton:
        return "newton";
    case Method::GaussNewton:
        return "gauss-newton";
    case Method::GaussNewtonDirect:
        return "gauss-newton-direct";
    }
    return "";
}

std::string stop_of(const SweepRow& row)
{
    return row.is_done() ? stop_name(row.stop) : "failed";
}

std::vector<std::string> field_names(const std::vector<FieldChoice>& fields)
{
    std::vector<std::string> names;
    for (const FieldChoice& field : fields)
        names.push_back(field_name(field));
    return names;
}

const char* fill_name(const CellSettings& cells)
{
    return cells.has_lids ? "closed" : cells.fill == Fill::Solid ? "solid" : "shell";
}

Json settings_json(const SweepReport& report)
{
    const SweepSettings& settings = report.settings;
    const CellSettings& cells = settings.session.cells;
    return {{"max_depth", settings.max_depth},
            {"depths", settings.depths},
            {"thresholds", settings.thresholds},
            {"interpolators", field_names(settings.fields)},
            {"iterations", settings.iteration_limits},
            {"runs", settings.runs},
            {"fill", fill_name(cells)},
            {"across", report.result.across},
            {"gap", cells.gap},
            {"max_cells", cells.max_cells},
            {"solver", method_name(settings.session.method)},
            {"max_iterations", settings.session.max_iterations},
            {"time_budget", settings.session.time_budget},
            {"gradient_tolerance", settings.session.gradient_tolerance},
            {"reference_gradient_tolerance", kReferenceTolerance}};
}

Json deviation_json(const Deviation& found)
{
    return {{"largest", found.largest}, {"rms", found.rms}};
}

Json parts_json(const ErrorParts& parts)
{
    return {{"finest", field_name(parts.finest)},
            {"cells", deviation_json(parts.of_cells)},
            {"field", parts.of_field ? deviation_json(*parts.of_field) : Json(nullptr)}};
}

Json frames_json(const SweepRow& row)
{
    Json frames = Json::array();
    for (const FrameReport& frame : row.frames)
        frames.push_back({{"frame", frame.frame},
                          {"iterations", std::max(0, frame.solve.iterations)},
                          {"linear_steps", frame.solve.linear_steps},
                          {"energy", frame.solve.energy_after},
                          {"gradient", frame.solve.gradient},
                          {"stop", stop_name(frame.solve.stop)}});
    return frames;
}

Json row_json(const SweepRow& row)
{
    const bool is_adaptive = row.of.kind == SweepKind::Adaptive;
    Json json = {{"kind", kind_name(row.of.kind)},
                 {"threshold", is_adaptive ? Json(row.of.threshold) : Json(nullptr)},
                 {"max_depth", row.of.depth},
                 {"grid_depth", row.of.grid_depth()},
                 {"interpolator", field_name(row.of.field)},
                 {"max_iterations", row.of.max_iterations},
                 {"is_limited", row.of.is_limited},
                 {"stop", stop_of(row)}};
    if (row.of.taken_back)
        json["without"] = row.of.taken_back->name;
    if (!row.is_done())
    {
        json["failure"] = row.failure;
        return json;
    }
    json["max_error"] = row.error.largest;
    json["rms_error"] = row.error.rms;
    if (row.against)
    {
        json["against_max"] = row.against->largest;
        json["against_rms"] = row.against->rms;
    }
    json["error_parts"] = parts_json(row.parts);
    json["from_coarser"] =
        row.from_coarser ? deviation_json(*row.from_coarser) : Json(nullptr);
    json["cells"] = row.cells;
    json["cells_per_depth"] = row.cells_per_depth;
    json["cell_edge"] = row.cell_edge;
    json["iterations"] = row.iterations;
    json["energy"] = row.frames.back().solve.energy_after;
    json["gradient"] = row.frames.back().solve.gradient;
    json["frames"] = frames_json(row);
    json["seconds"] = row.seconds.total;
    json["stage_seconds"] = {{"load", row.seconds.load},
                             {"cells", row.seconds.cells},
                             {"solve", row.seconds.solve},
                             {"field_fit", row.seconds.field_fit},
                             {"field_apply", row.seconds.field_apply}};
    json["run_seconds"] = row.run_seconds;
    json["peak_mb"] = row.peak_mb;
    return json;
}

Json numbers_json(const std::vector<std::optional<double>>& numbers)
{
    Json json = Json::array();
    for (const std::optional<double>& number : numbers)
        json.push_back(number ? Json(*number) : Json(nullptr));
    return json;
}

Json orders_json(const Orders& orders)
{
    return {{"steps", numbers_json(orders.steps)},
            {"least_squares", orders.fitted ? Json(*orders.fitted) : Json(nullptr)},
            {"of_differences", numbers_json(orders.of_differences)}};
}

Json share_json(const std::optional<Share>& share)
{
    if (!share)
        return nullptr;
    return {{"cells", share->cells},
            {"seconds", share->seconds},
            {"is_bound", share->is_bound}};
}

Json machine_json(const SweepReport& report)
{
    return {{"processor", report.machine.processor},
            {"cores", report.machine.cores},
            {"threads", report.threads},
            {"compiler", report.machine.compiler},
            {"build", report.machine.build},
            {"version", report.machine.version}};
}

std::string number_text(const std::optional<double>& number)
{
    return number ? fmt::format("{:.2f}", *number) : "unknown";
}

std::string order_sentence(const Convergence& found)
{
    const std::string name = field_name(found.field);
    if (!found.largest.fitted || !found.rms.fitted)
        return fmt::format(
            "Uniform cells, {}: two depths above the reference's are needed "
            "to tell an order of convergence.",
            name);
    std::string text = fmt::format(
        "Uniform cells, {}: the largest error falls with the power {:.2f} of the cell "
        "edge, the RMS error with {:.2f} (least squares, against the reference)",
        name, *found.largest.fitted, *found.rms.fitted);
    if (!found.largest.of_differences.empty())
        text += fmt::format("; successive depths approach each other with {} and {}",
                            number_text(found.largest.of_differences.back()),
                            number_text(found.rms.of_differences.back()));
    return text + ".";
}

std::string against_sentence(const SweepReport& report)
{
    const Deviation& found = report.result.rows.front().against.value();
    return fmt::format("The reference is off {} by at most {:.2g}, RMS {:.2g}.",
                       report.against, found.largest, found.rms);
}

/// "0.12 of its cells" or "1.3 times its cells".
std::string times_text(double share, const char* what)
{
    return share < 1.0 ? fmt::format("{:.2g} of its {}", share, what)
                       : fmt::format("{:.3g} times its {}", share, what);
}

/// What stands behind an error: " with 0.12 of its cells and 0.2 of its time".
std::string share_text(const std::optional<Share>& share)
{
    if (!share)
        return " is not reached";
    return fmt::format(
        " with {}{} and {}{}", share->is_bound ? "at most " : "",
        times_text(share->cells, "cells"), times_text(share->seconds, "time"),
        share->cells >= 1.0 || share->seconds >= 1.0 ? ", which does not pay" : "");
}

/// What each field adds to the error of the uniform cells of one depth; empty where
/// there is nothing to compare.
std::string field_sentence(const std::vector<SweepRow>& rows, int depth)
{
    std::string cells, fields;
    for (const SweepRow& row : rows)
    {
        if (!row.is_done() || row.of.kind != SweepKind::Uniform || row.of.is_limited ||
            row.of.depth != depth)
            continue;
        const ErrorParts& parts = row.parts;
        if (cells.empty())
            cells = fmt::format("Uniform depth {}: the cells' own error ({}) is at most "
                                "{:.2g}, RMS {:.2g}",
                                depth, field_name(parts.finest), parts.of_cells.largest,
                                parts.of_cells.rms);
        if (parts.of_field)
            fields += fmt::format("; {} is off that by at most {:.2g}, RMS {:.2g}",
                                  field_name(row.of.field), parts.of_field->largest,
                                  parts.of_field->rms);
    }
    return fields.empty() ? "" : cells + fields + ".";
}

std::string saving_sentence(const Saving& saving)
{
    return fmt::format(
        "Adaptive cells to depth {}, {}: the largest error of uniform depth "
        "{} ({:.2g}){}; its RMS error ({:.2g}){}.",
        saving.adaptive_depth, field_name(saving.field), saving.uniform_depth,
        saving.error.largest, share_text(saving.largest), saving.error.rms,
        share_text(saving.rms));
}

} // namespace

Json sweep_json(const SweepReport& report)
{
    Json json = {{"scene", report.scene},
                 {"model", report.model},
                 {"samples", report.result.num_samples},
                 {"faces", report.result.num_faces},
                 {"settings", settings_json(report)},
                 {"machine", machine_json(report)},
                 {"peak_is_of", report.result.is_peak_of_run ? "run" : "process"}};
    if (!report.against.empty())
        json["against"] = report.against;
    json["rows"] = Json::array();
    for (const SweepRow& row : report.result.rows)
        json["rows"].push_back(row_json(row));
    json["convergence"] = Json::array();
    for (const Convergence& found : convergence_of(report.result.rows))
        json["convergence"].push_back({{"interpolator", field_name(found.field)},
                                       {"max_error", orders_json(found.largest)},
                                       {"rms_error", orders_json(found.rms)}});
    json["savings"] = Json::array();
    for (const Saving& saving : savings_of(report.result.rows))
        json["savings"].push_back({{"interpolator", field_name(saving.field)},
                                   {"adaptive_depth", saving.adaptive_depth},
                                   {"uniform_depth", saving.uniform_depth},
                                   {"max_error", saving.error.largest},
                                   {"rms_error", saving.error.rms},
                                   {"share_for_max_error", share_json(saving.largest)},
                                   {"share_for_rms_error", share_json(saving.rms)}});
    json["warnings"] = report.result.warnings;
    return json;
}

std::string sweep_csv(const Json& json)
{
    std::vector<CsvColumn> columns = {
        {"kind", "kind"},
        {"threshold", "threshold"},
        {"max_depth", "max_depth"},
        {"interpolator", "interpolator"},
        {"max_iterations", "max_iterations"},
        {"max_error", "max_error"},
        {"rms_error", "rms_error"},
        {"finest_interpolator", "error_parts/finest"},
        {"field_max", "error_parts/field/largest"},
        {"field_rms", "error_parts/field/rms"},
        {"cells_max", "error_parts/cells/largest"},
        {"cells_rms", "error_parts/cells/rms"},
        {"cells", "cells"},
        {"cell_edge", "cell_edge"},
        {"iterations", "iterations"},
        {"seconds", "seconds"},
        {"load_seconds", "stage_seconds/load"},
        {"cells_seconds", "stage_seconds/cells"},
        {"solve_seconds", "stage_seconds/solve"},
        {"field_fit_seconds", "stage_seconds/field_fit"},
        {"field_apply_seconds", "stage_seconds/field_apply"},
        {"peak_mb", "peak_mb"},
        {"energy", "energy"},
        {"gradient", "gradient"},
        {"stop", "stop"},
        {"scene", "scene"}};
    Json rows = json["rows"];
    for (Json& row : rows)
        row["scene"] = json["scene"];
    const auto add_if_any = [&](const char* key)
    {
        if (std::any_of(rows.begin(), rows.end(),
                        [&](const Json& row) { return row.contains(key); }))
            columns.push_back({key, key});
    };
    for (const char* key : {"against_max", "against_rms", "without"})
        add_if_any(key);
    return csv_text(columns, rows);
}

std::vector<std::string> sweep_sentences(const SweepReport& report)
{
    std::vector<std::string> sentences;
    if (!report.against.empty())
        sentences.push_back(against_sentence(report));
    if (report.settings.takes_back)
    {
        for (const SweepRow& row : report.result.rows)
            if (row.is_done() && row.of.kind != SweepKind::Reference)
                sentences.push_back(fmt::format(
                    "{}: error at most {:.2g}, RMS {:.2g}, {} cells, {:.2g} s.",
                    case_name(row.of), row.error.largest, row.error.rms, row.cells,
                    row.seconds.total));
        return sentences;
    }
    for (const Convergence& found : convergence_of(report.result.rows))
        sentences.push_back(order_sentence(found));
    for (int depth = 0; depth < report.settings.max_depth; ++depth)
        if (std::string text = field_sentence(report.result.rows, depth); !text.empty())
            sentences.push_back(std::move(text));
    for (const Saving& saving : savings_of(report.result.rows))
        sentences.push_back(saving_sentence(saving));
    return sentences;
}

} // namespace cellwarp::core
