// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/study/convergence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace cellwarp::core
{

namespace
{

/// Rows farther apart in error are not interpolated: the finer one may have become the
/// reference's own cells, whose error says nothing about those between.
constexpr double kWidestGap = 10.0;

using Measure = double Deviation::*;
using Points = std::vector<std::array<double, 2>>;

bool is_told(const SweepRow& row, SweepKind kind, const FieldChoice& field)
{
    return row.is_done() && !row.of.is_limited && !row.of.taken_back &&
           row.of.kind == kind && row.of.field == field;
}

std::vector<FieldChoice> fields_of(std::span<const SweepRow> rows)
{
    std::vector<FieldChoice> fields;
    for (const SweepRow& row : rows)
        if (row.of.kind != SweepKind::Reference &&
            std::find(fields.begin(), fields.end(), row.of.field) == fields.end())
            fields.push_back(row.of.field);
    return fields;
}

/// By what power of b a quantity a grows from one point to the next.
std::optional<double> power(double a0, double a1, double b0, double b1)
{
    const double found = std::log(a1 / a0) / std::log(b1 / b0);
    return std::isfinite(found) ? std::optional(found) : std::nullopt;
}

std::optional<double> fitted_power(const Points& points)
{
    double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
    for (const auto& [edge, error] : points)
    {
        const double u = std::log(edge), v = std::log(error);
        n += 1.0;
        x += u;
        y += v;
        xx += u * u;
        xy += u * v;
    }
    const double slope = (n * xy - x * y) / (n * xx - x * x);
    return points.size() > 1 && std::isfinite(slope) ? std::optional(slope)
                                                     : std::nullopt;
}

/// \p uniform from the coarsest down.
Orders orders_of(const std::vector<const SweepRow*>& uniform, Measure measure)
{
    Orders orders;
    Points above_reference, differences;
    for (const SweepRow* row : uniform)
    {
        if (row->of.is_above_reference())
            above_reference.push_back({row->cell_edge, row->error.*measure});
        if (row->from_coarser)
            differences.push_back({row->cell_edge, (*row->from_coarser).*measure});
    }
    const auto steps = [](const Points& points)
    {
        std::vector<std::optional<double>> found;
        for (std::size_t i = 1; i < points.size(); ++i)
            found.push_back(
                power(points[i - 1][1], points[i][1], points[i - 1][0], points[i][0]));
        return found;
    };
    orders.steps = steps(above_reference);
    orders.fitted = fitted_power(above_reference);
    orders.of_differences = steps(differences);
    return orders;
}

/// The cheapest adaptive rows: each has a smaller error than all that cost less.
/// Points are cost and error.
Points cheapest(const std::vector<const SweepRow*>& adaptive, Measure measure,
                double (*cost)(const SweepRow&))
{
    Points points;
    for (const SweepRow* row : adaptive)
        points.push_back({cost(*row), row->error.*measure});
    std::sort(points.begin(), points.end());
    Points front;
    for (const std::array<double, 2>& point : points)
        if (front.empty() || point[1] < front.back()[1])
            front.push_back(point);
    return front;
}

struct Cost
{
    double value;
    bool is_bound;
};

/// What an error costs; nothing where it is not reached.
std::optional<Cost> cost_of(const Points& front, double error)
{
    const auto reached = std::find_if(
        front.begin(), front.end(), [&](const auto& point) { return point[1] <= error; });
    if (reached == front.end())
        return std::nullopt;
    if (reached == front.begin())
        return Cost{(*reached)[0], (*reached)[1] < error};
    const auto& [cost0, error0] = *(reached - 1);
    const auto& [cost1, error1] = *reached;
    if (!(error0 <= kWidestGap * error1))
        return Cost{cost1, false};
    const double t = std::log(error0 / error) / std::log(error0 / error1);
    return Cost{cost0 * std::pow(cost1 / cost0, t), false};
}

double cells_of(const SweepRow& row)
{
    return static_cast<double>(row.cells);
}

double seconds_of(const SweepRow& row)
{
    return row.seconds.total;
}

std::optional<Share> share_of(const SweepRow& uniform,
                              const std::vector<const SweepRow*>& adaptive,
                              Measure measure)
{
    const double error = uniform.error.*measure;
    const std::optional<Cost> cells =
        cost_of(cheapest(adaptive, measure, cells_of), error);
    const std::optional<Cost> seconds =
        cost_of(cheapest(adaptive, measure, seconds_of), error);
    if (!cells || !seconds)
        return std::nullopt;
    return Share{cells->value / cells_of(uniform), seconds->value / seconds_of(uniform),
                 cells->is_bound};
}

} // namespace

std::vector<Convergence> convergence_of(std::span<const SweepRow> rows)
{
    std::vector<Convergence> all;
    for (const FieldChoice& field : fields_of(rows))
    {
        std::vector<const SweepRow*> uniform;
        for (const SweepRow& row : rows)
            if (is_told(row, SweepKind::Uniform, field))
                uniform.push_back(&row);
        all.push_back({field, orders_of(uniform, &Deviation::largest),
                       orders_of(uniform, &Deviation::rms)});
    }
    return all;
}

std::vector<Saving> savings_of(std::span<const SweepRow> rows)
{
    std::vector<Saving> all;
    for (const FieldChoice& field : fields_of(rows))
    {
        std::set<int> depths;
        for (const SweepRow& row : rows)
            if (is_told(row, SweepKind::Adaptive, field))
                depths.insert(row.of.depth);
        for (const int depth : depths)
        {
            std::vector<const SweepRow*> adaptive;
            for (const SweepRow& row : rows)
                if (is_told(row, SweepKind::Adaptive, field) && row.of.depth == depth)
                    adaptive.push_back(&row);
            for (const SweepRow& row : rows)
                if (is_told(row, SweepKind::Uniform, field) && row.of.depth > 0 &&
                    row.of.is_above_reference())
                    all.push_back({field, depth, row.of.depth, row.error,
                                   share_of(row, adaptive, &Deviation::largest),
                                   share_of(row, adaptive, &Deviation::rms)});
        }
    }
    return all;
}

} // namespace cellwarp::core
