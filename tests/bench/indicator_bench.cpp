// SPDX-License-Identifier: GPL-3.0-or-later
// What tells best where smaller cells are wanted: error of the samples over cells, for
// the indicator of the program and two others, as a table. Each has thresholds of its
// own, for their lengths mean different things; what counts is the error for as many
// cells.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <fmt/format.h>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/formats/geometry_file.h"
#include "io/scene/handle_file.h"
#include "library/session/session.h"
#include "octree/base/index.h"
#include "solver/cells/refinement.h"

namespace cellwarp::core
{

namespace
{

using Indicator = std::function<std::vector<double>(const CellSystem&)>;

struct Scene
{
    const char* name;
    int across, depth;
};

/// Depths that let each indicator choose; references of 80,000 cells and more.
constexpr Scene kScenes[] = {{"block", 7, 3}, {"bar", 16, 2}, {"creature", 14, 2}};

constexpr double kThresholds[] = {1.6e-2, 8e-3, 4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4};

/// Where an error is compared for as many cells [cells of the reference].
constexpr double kShares[] = {0.01, 0.03, 0.1};

/// The largest gap over a face of each cell.
std::vector<double> plain_gaps(const CellSystem& system)
{
    std::vector<double> errors(system.poses().size(), 0.0);
    for (const GlueFace& face : system.glue().faces)
    {
        const std::size_t a = idx(face.a);
        const std::size_t b = idx(face.b);
        const double gap = std::sqrt(
            glue_energy(face, system.poses()[a], system.poses()[b]) / face.stiffness);
        errors[a] = std::max(errors[a], gap);
        errors[b] = std::max(errors[b], gap);
    }
    return errors;
}

/// How far the two fields are apart in each cell.
std::vector<double> field_differences(const CellSystem& system)
{
    const Cells& cells = system.body().cells;
    const Field blend =
        fit_field(FieldKind::Blend, cells, system.poses(), system.constraints(), {});
    const Field rbf =
        fit_field(FieldKind::Rbf, cells, system.poses(), system.constraints(), {});
    std::vector<double> errors(cells.size(), 0.0);
    for (std::size_t c = 0; c < cells.size(); ++c)
        for (int k = 0; k < 8; ++k)
        {
            const Eigen::Vector3d corner(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
            const Eigen::Vector3d x =
                cells.cells[c].anchor + 0.25 * cells.cells[c].edge * corner;
            const int own = static_cast<int>(c);
            errors[c] = std::max(errors[c], (blend.value(x, own).displacement -
                                             rbf.value(x, own).displacement)
                                                .norm());
        }
    return errors;
}

struct Result
{
    std::size_t cells = 0;
    double largest = 0.0, rms = 0.0;
    std::vector<Eigen::Vector3d> samples;
};

Result run(const Scene& scene, const CellSettings& cells, const Result* reference)
{
    const std::string path = std::string(CELLWARP_SAMPLES) + "/" + scene.name;
    SessionSettings settings;
    settings.cells = cells;
    settings.cells.across = scene.across;
    settings.cells.max_depth = scene.depth;
    Session session(read_geometry(path + ".obj", {}).geometry,
                    read_handles(path + ".handles"), settings);
    while (session.upcoming_frame())
        session.next_frame(true);
    Result result;
    result.cells = session.system()->body().cells.size();
    result.samples = session.deformed().samples;
    if (!reference)
        return result;
    const std::vector<Eigen::Vector3d>& rest = session.geometry().samples;
    Eigen::Vector3d low = rest[0], high = low;
    for (const Eigen::Vector3d& x : rest)
    {
        low = low.cwiseMin(x);
        high = high.cwiseMax(x);
    }
    for (std::size_t i = 0; i < rest.size(); ++i)
    {
        const double error =
            (result.samples[i] - reference->samples[i]).norm() / (high - low).norm();
        result.largest = std::max(result.largest, error);
        result.rms += error * error / static_cast<double>(rest.size());
    }
    result.rms = std::sqrt(result.rms);
    return result;
}

/// RMS error for so many cells, between the results that have fewer and more.
double rms_at(const std::vector<Result>& results, double cells)
{
    for (std::size_t i = 1; i < results.size(); ++i)
    {
        const double n0 = static_cast<double>(results[i - 1].cells);
        const double n1 = static_cast<double>(results[i].cells);
        if (n0 <= cells && cells <= n1 && n0 < n1)
            return results[i - 1].rms *
                   std::pow(results[i].rms / results[i - 1].rms,
                            std::log(cells / n0) / std::log(n1 / n0));
    }
    return NAN;
}

void compare(const Scene& scene)
{
    CellSettings deepest;
    deepest.min_depth = scene.depth;
    const Result reference = run(scene, deepest, nullptr);
    fmt::print("{}: reference {} cells\n", scene.name, reference.cells);
    const std::pair<const char*, Indicator> indicators[] = {
        {"jump without common strain", {}},
        {"plain pair gap", plain_gaps},
        {"blend against RBF", field_differences}};
    for (const auto& [name, indicator] : indicators)
    {
        std::vector<Result> results;
        for (const double threshold : kThresholds)
        {
            CellSettings cells;
            cells.threshold = threshold;
            cells.errors = indicator;
            results.push_back(run(scene, cells, &reference));
            fmt::print("  {:<28} threshold {:<8} cells {:>7} largest {:.2e} rms {:.2e}\n",
                       name, threshold, results.back().cells, results.back().largest,
                       results.back().rms);
            std::fflush(stdout);
        }
        for (const double share : kShares)
            fmt::print("  {:<28} rms at {:g} of the reference's cells: {:.2e}\n", name,
                       share,
                       rms_at(results, share * static_cast<double>(reference.cells)));
    }
}

} // namespace

} // namespace cellwarp::core

int main()
{
    try
    {
        for (const cellwarp::core::Scene& scene : cellwarp::core::kScenes)
            cellwarp::core::compare(scene);
    }
    catch (const std::exception& error)
    {
        fmt::print(stderr, "error: {}\n", error.what());
        return 1;
    }
}
