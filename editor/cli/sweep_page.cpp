// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/sweep_page.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include <fmt/format.h>

#include "editor/cli/page.h"
#include "editor/cli/plot.h"
#include "io/base/base64.h"

namespace cellwarp::core
{

namespace
{

/// Colours that are told apart on white and on black, also by most who see fewer.
constexpr const char* kPalette[] = {"#3b7dd8", "#e0842c", "#2f9e6e", "#a663c7",
                                    "#c94f5d", "#8a8f3a", "#3aa6b9", "#8b6b56"};
/// Errors smaller than the smallest honest one by this are drawn at the plot's border.
constexpr double kBelowFloor = 100.0;

std::string with_commas(std::size_t number)
{
    std::string text = fmt::to_string(number);
    for (std::size_t end = text.size(); end > 3; end -= 3)
        text.insert(end - 3, ",");
    return text;
}

std::string tip_of(const SweepRow& row)
{
    return fmt::format("{}: {} cells, {:.3g} s, largest error {:.2g}, RMS {:.2g}",
                       case_name(row.of), with_commas(row.cells), row.seconds.total,
                       row.error.largest, row.error.rms);
}

using Value = double (*)(const SweepRow&);

double seconds_of(const SweepRow& row)
{
    return row.seconds.total;
}
double cells_of(const SweepRow& row)
{
    return static_cast<double>(row.cells);
}
double threshold_of(const SweepRow& row)
{
    return row.of.threshold;
}
double iterations_of(const SweepRow& row)
{
    return static_cast<double>(row.iterations);
}
double largest_of(const SweepRow& row)
{
    return row.error.largest;
}
double rms_of(const SweepRow& row)
{
    return row.error.rms;
}

/// 0, which no logarithmic axis shows, where there is nothing to compare with.
double against_largest_of(const SweepRow& row)
{
    return row.against ? row.against->largest : 0.0;
}

/// Rows that make one line of a plot.
struct Group
{
    std::string name;
    const char* colour;
    SweepKind kind;
    std::vector<const SweepRow*> rows;
};

std::string line_name(const SweepCase& of)
{
    const bool has_depth = of.kind == SweepKind::Adaptive && of.is_above_reference();
    return fmt::format("{}{}, {}{}", kind_name(of.kind),
                       has_depth ? fmt::format(" to depth {}", of.depth) : "",
                       field_name(of.field),
                       of.taken_back ? ", without " + of.taken_back->name : "");
}

/// Uniform and adaptive rows by field and depth; those stopped early are left out.
std::vector<Group> groups_of(const std::vector<SweepRow>& rows)
{
    std::vector<Group> groups;
    std::map<std::string, const char*> colour_of_field;
    std::size_t num_colours = 0;
    const auto next_colour = [&]
    { return kPalette[num_colours++ % std::size(kPalette)]; };
    for (const SweepRow& row : rows)
    {
        if (row.of.kind == SweepKind::Reference || row.of.is_limited || !row.is_done())
            continue;
        const std::string name = line_name(row.of);
        auto found = std::find_if(groups.begin(), groups.end(),
                                  [&](const Group& group) { return group.name == name; });
        if (found == groups.end())
        {
            // A field has one colour; only its adaptive cells to other depths differ.
            const bool is_other =
                row.of.kind == SweepKind::Adaptive && row.of.is_above_reference();
            const std::string field = field_name(row.of.field);
            if (!is_other && !colour_of_field.contains(field))
                colour_of_field[field] = next_colour();
            groups.push_back({name,
                              is_other ? next_colour() : colour_of_field[field],
                              row.of.kind,
                              {}});
            found = groups.end() - 1;
        }
        found->rows.push_back(&row);
    }
    return groups;
}

/// Where errors begin to tell only how near cells are to the reference's own.
double floor_of(const std::vector<SweepRow>& rows, Value error)
{
    double smallest = INFINITY;
    for (const SweepRow& row : rows)
        if (row.is_done() && row.of.kind == SweepKind::Uniform && !row.of.is_limited &&
            row.of.is_above_reference() && error(row) > 0)
            smallest = std::min(smallest, error(row));
    return std::isfinite(smallest) ? smallest / kBelowFloor : 0.0;
}

PlotSeries series_of(const Group& group, Value x, Value y)
{
    const bool is_uniform = group.kind == SweepKind::Uniform;
    PlotSeries series{group.name,
                      group.colour,
                      is_uniform,
                      is_uniform ? Marker::Square : Marker::Disc,
                      {}};
    for (const SweepRow* row : group.rows)
        series.points.push_back({x(*row), y(*row),
                                 is_uniform ? fmt::format("depth {}", row->of.depth) : "",
                                 tip_of(*row)});
    return series;
}

LogPlot error_plot(const std::vector<SweepRow>& rows, const std::string& title,
                   const std::string& x_label, Value x, Value y)
{
    LogPlot plot{title, x_label, "error [diagonal]", {}, floor_of(rows, y)};
    for (const Group& group : groups_of(rows))
        if (x != threshold_of || group.kind == SweepKind::Adaptive)
            plot.series.push_back(series_of(group, x, y));
    return plot;
}

/// The same cells with ever more iterations: the deepest of each line.
LogPlot iterations_plot(const std::vector<SweepRow>& rows)
{
    LogPlot plot{"Largest error over iterations",
                 "iterations of all frames",
                 "error [diagonal]",
                 {},
                 floor_of(rows, largest_of)};
    for (const Group& group : groups_of(rows))
    {
        const SweepCase& of = group.rows.back()->of;
        Group same{case_name(of), group.colour, group.kind, {}};
        for (const SweepRow& row : rows)
            if (row.is_done() && row.of.kind == of.kind && row.of.depth == of.depth &&
                row.of.field == of.field && row.of.threshold == of.threshold &&
                row.of.taken_back == of.taken_back)
                same.rows.push_back(&row);
        std::sort(same.rows.begin(), same.rows.end(),
                  [](const SweepRow* a, const SweepRow* b)
                  { return a->iterations < b->iterations; });
        PlotSeries series = series_of(same, iterations_of, largest_of);
        for (PlotPoint& point : series.points)
            point.label.clear();
        plot.series.push_back(std::move(series));
    }
    return plot;
}

std::string figure(const std::string& inside, const std::string& caption = "")
{
    return "<figure>" + inside +
           (caption.empty() ? "" : "<figcaption>" + caption + "</figcaption>") +
           "</figure>\n";
}

std::string plots(const SweepReport& report)
{
    const std::vector<SweepRow>& rows = report.result.rows;
    std::string page = "<h2>Error against run time</h2>\n<div class=\"plots\">\n";
    page += figure(svg_of(error_plot(rows, "Largest error over seconds", "seconds",
                                     seconds_of, largest_of)));
    page += figure(svg_of(
        error_plot(rows, "RMS error over seconds", "seconds", seconds_of, rms_of)));
    page += figure(svg_of(
        error_plot(rows, "Largest error over cells", "cells", cells_of, largest_of)));
    page += figure(svg_of(error_plot(rows, "Largest error over threshold",
                                     "threshold [diagonal]", threshold_of, largest_of)));
    if (!report.settings.iteration_limits.empty())
        page += figure(svg_of(iterations_plot(rows)));
    return page +
           "</div>\n<p class=\"soft\">Errors are distances of the samples after the last "
           "frame from the reference's, of the rest model's diagonal. Triangles at a "
           "lower "
           "border are errors below it: there the cells are nearly or all the "
           "reference's own, and the number tells how far the solve went, not how good "
           "the "
           "cells are.</p>\n";
}

/// All that is told of the fields, those of the same cells side by side; stopped ones are
/// left out.
std::vector<const SweepRow*> rows_by_cells(const std::vector<SweepRow>& rows)
{
    std::vector<const SweepRow*> sorted;
    for (const SweepRow& row : rows)
        if (row.is_done() && !row.of.is_limited)
            sorted.push_back(&row);
    const auto cells = [](const SweepRow* row)
    { return std::tuple(row->of.kind, row->of.depth, -row->of.threshold); };
    std::stable_sort(sorted.begin(), sorted.end(),
                     [&](const SweepRow* a, const SweepRow* b)
                     { return cells(a) < cells(b); });
    return sorted;
}

std::string deviation_fields(const std::optional<Deviation>& found)
{
    return found
               ? fmt::format("<td>{:.3g}</td><td>{:.3g}</td>", found->largest, found->rms)
               : "<td></td><td></td>";
}

std::string field_table(const std::vector<SweepRow>& rows)
{
    std::string page =
        "<div class=\"wide\"><table>\n<thead><tr><th class=\"word\">cells</th>"
        "<th class=\"word\">interpolator</th><th>largest error</th><th>RMS</th>"
        "<th class=\"word\">finest</th><th>the cells' largest</th><th>RMS</th>"
        "<th>the field's largest</th><th>RMS</th><th>fit s</th><th>apply s</th></tr>"
        "</thead>\n<tbody>\n";
    std::string last;
    for (const SweepRow* const row : rows_by_cells(rows))
    {
        const std::string name = cells_name(row->of);
        page += fmt::format(
            "<tr{}><td class=\"word\">{}</td><td class=\"word\">{}</td>{}"
            "<td class=\"word\">{}</td>{}{}<td>{:.3g}</td><td>{:.3g}</td>"
            "</tr>\n",
            name != last ? " class=\"begins\"" : "", name, field_name(row->of.field),
            deviation_fields(row->error), field_name(row->parts.finest),
            deviation_fields(row->parts.of_cells), deviation_fields(row->parts.of_field),
            row->seconds.field_fit, row->seconds.field_apply);
        last = name;
    }
    return page + "</tbody></table></div>\n";
}

/// Empty where no field has another to be compared with.
std::string field_part(const SweepReport& report)
{
    const std::vector<SweepRow>& rows = report.result.rows;
    if (std::none_of(rows.begin(), rows.end(),
                     [](const SweepRow& row) { return row.parts.of_field.has_value(); }))
        return "";
    return "<h2>Fields of the same poses</h2>\n<p class=\"soft\">Of the same cells and "
           "poses the finest field is rbf-global where it was asked for and its memory "
           "allows, else rbf. The cells' error is the finest field's distance from the "
           "reference, the field's its own distance from the finest.</p>\n" +
           field_table(rows);
}

/// Empty where there is no result from elsewhere.
std::string against_part(const SweepReport& report)
{
    if (report.against.empty())
        return "";
    return "<h2>Against a result from elsewhere</h2>\n<div class=\"plots\">\n" +
           figure(svg_of(error_plot(report.result.rows,
                                    "Largest distance from elsewhere over seconds",
                                    "seconds", seconds_of, against_largest_of))) +
           fmt::format(
               "</div>\n<p class=\"soft\">Distances of the samples after the last "
               "frame from those of {}, of the rest model's diagonal.</p>\n",
               in_markup(report.against));
}

std::string table(const SweepReport& report)
{
    const bool has_against = !report.against.empty();
    std::string page =
        "<h2>All runs</h2>\n<div class=\"wide\"><table>\n<thead><tr>"
        "<th class=\"word\">kind</th><th>threshold</th><th>depth</th>"
        "<th class=\"word\">interpolator</th><th>largest error</th><th>RMS error</th>";
    if (has_against)
        page += "<th>largest from elsewhere</th><th>RMS</th>";
    page +=
        "<th>cells</th><th>iterations</th><th>seconds</th><th>load s</th><th>cells s</th>"
        "<th>solve s</th><th>fit s</th><th>apply s</th><th>peak MB</th><th>energy</th>"
        "<th>gradient</th><th class=\"word\">stop</th></tr></thead>\n<tbody>\n";
    std::optional<SweepKind> last;
    for (const SweepRow& row : report.result.rows)
    {
        const SweepCase& of = row.of;
        page += fmt::format(
            "<tr{}><td class=\"word\">{}{}{}</td><td>{}</td><td>{}</td>"
            "<td class=\"word\">{}</td>",
            last && *last != of.kind ? " class=\"begins\"" : "", kind_name(of.kind),
            of.is_limited ? fmt::format(", {} iterations", of.max_iterations) : "",
            of.taken_back ? ", without " + of.taken_back->name : "",
            of.kind == SweepKind::Adaptive ? fmt::format("{:g}", of.threshold) : "",
            of.depth, field_name(of.field));
        last = of.kind;
        if (!row.is_done())
        {
            page += fmt::format("<td colspan=\"{}\" class=\"word\">{}</td></tr>\n",
                                has_against ? 16 : 14, in_markup(row.failure));
            continue;
        }
        const StageSeconds& s = row.seconds;
        page += deviation_fields(row.error);
        if (has_against)
            page += deviation_fields(row.against);
        page += fmt::format(
            "<td>{}</td><td>{}</td><td>{:.3g}</td>"
            "<td>{:.3g}</td><td>{:.3g}</td><td>{:.3g}</td><td>{:.3g}</td><td>{:.3g}</td>"
            "<td>{:.0f}</td><td>{:.6g}</td><td>{:.1e}</td><td "
            "class=\"word\">{}</td></tr>\n",
            with_commas(row.cells), row.iterations, s.total, s.load, s.cells, s.solve,
            s.field_fit, s.field_apply, row.peak_mb, row.frames.back().solve.energy_after,
            row.frames.back().solve.gradient, stop_name(row.stop));
    }
    return page + "</tbody></table></div>\n";
}

std::string listed(const std::vector<std::string>& items)
{
    std::string page = "<ul>\n";
    for (const std::string& item : items)
        page += "<li>" + in_markup(item) + "</li>\n";
    return page + "</ul>\n";
}

std::string pictures_part(const SweepPictures& pictures)
{
    if (pictures.png.empty())
        return fmt::format("<p class=\"soft\">{}</p>\n", in_markup(pictures.caption));
    return figure(fmt::format("<img alt=\"{}\" src=\"data:image/png;base64,{}\">",
                              in_markup(pictures.caption), base64_encoded(pictures.png)),
                  in_markup(pictures.caption));
}

std::string conditions(const SweepReport& report)
{
    const Machine& machine = report.machine;
    return fmt::format(
        "<h2>Machine and settings</h2>\n<p>{}, {} cores, {} threads; cellwarp {}, {} "
        "build, {}.</p>\n<p>{}.</p>\n<p>Peak memory is {}.</p>\n",
        in_markup(machine.processor), machine.cores, report.threads,
        in_markup(machine.version), in_markup(machine.build), in_markup(machine.compiler),
        in_markup(settings_text(report)),
        report.result.is_peak_of_run
            ? "that of each run"
            : "that of the process up to the run: this system does not let it be "
              "measured anew");
}

} // namespace

std::string sweep_page(const SweepReport& report, const SweepPictures& pictures)
{
    const SweepRow& reference = report.result.rows.front();
    std::string page = fmt::format(
        "<h1>{0}</h1>\n<p class=\"soft\">{1}: {2} samples, {3} faces. Reference: {4} "
        "uniform cells at depth {5}, {6}, gradient {7:.1e}.</p>\n",
        in_markup(report.scene), in_markup(report.model),
        with_commas(report.result.num_samples), with_commas(report.result.num_faces),
        with_commas(reference.cells), reference.of.depth, stop_name(reference.stop),
        reference.frames.back().solve.gradient);
    page += listed(sweep_sentences(report));
    page += pictures_part(pictures);
    page += plots(report);
    page += against_part(report);
    page += field_part(report);
    page += table(report);
    page += conditions(report);
    if (!report.result.warnings.empty())
        page += "<h2>Warnings</h2>\n" + listed(report.result.warnings);
    return html_page(report.scene + ": error against run time", page);
}

} // namespace cellwarp::core
