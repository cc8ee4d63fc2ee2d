// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/stability.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "editor/cli/report.h"
#include "io/base/error.h"
#include "io/formats/face_triangles.h"
#include "io/formats/geometry_file.h"
#include "library/session/session.h"
#include "library/session/session_request.h"
#include "library/time/simulation.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Of a frame's solve [s].
constexpr double kTime = 120.0;

/// A number of a row. What is more than \ref most is a fault.
struct Measure
{
    const char* key;
    std::optional<double> StabilityRow::*value;
    const char* fault = nullptr; ///< null: it may be anything
    double most = 0.0;
};

constexpr Measure kMeasures[] = {
    {"energy_rise", &StabilityRow::rise, "the energy rises by", 1e-12},
    {"gradient", &StabilityRow::gradient},
    {"handle_residual", &StabilityRow::residual, "handles are missed by", 1e-9},
    {"inverted_share", &StabilityRow::inverted},
    {"largest_jump_degrees", &StabilityRow::jump},
    {"orthonormality", &StabilityRow::orthonormality, "rotations are off by", 1e-12},
    // Beyond what the coordinates of the model themselves have lost.
    {"digits_lost", &StabilityRow::digits_lost, "digits lost:", 7.0},
    {"constraint", &StabilityRow::violation},
    // Of the energy of what moves alone; each step is solved to a tolerance.
    {"energy_growth", &StabilityRow::growth, "the energy grows by", 1e-3}};

/// What a run leaves to be compared.
struct Result
{
    std::vector<Eigen::Vector3d> samples;
    std::vector<double> numbers; ///< of scenes in time

    bool operator==(const Result& other) const
    {
        return samples == other.samples && numbers == other.numbers;
    }
    bool is_finite() const
    {
        return std::all_of(samples.begin(), samples.end(),
                           [](const Eigen::Vector3d& x) { return x.allFinite(); }) &&
               std::all_of(numbers.begin(), numbers.end(),
                           [](double x) { return std::isfinite(x); });
    }
};

/// Share of the triangles with an area that look against where their cell has turned
/// them.
double inverted_share(const Session& session)
{
    const CellSystem& system = *session.system();
    const std::vector<Eigen::Vector3d>& rest = system.rest().samples;
    std::vector<Eigen::Vector3d> now;
    for (const Eigen::Vector3d& x : session.deformed().samples)
        now.push_back(system.rest().frame.to_work(x));
    std::size_t inverted = 0, all = 0;
    for (const Triangle& t : triangles_of(session.geometry()))
    {
        const auto normal = [&](const std::vector<Eigen::Vector3d>& at)
        { return Eigen::Vector3d((at[t[1]] - at[t[0]]).cross(at[t[2]] - at[t[0]])); };
        const Eigen::Vector3d before = normal(rest), after = normal(now);
        const int cell = system.body().cell_of_sample[t[0]];
        if (cell < 0 || !(before.norm() > 0.0) || !(after.norm() > 0.0))
            continue;
        ++all;
        inverted += (system.poses()[idx(cell)].R * before).dot(after) < 0.0;
    }
    return all > 0 ? static_cast<double>(inverted) / static_cast<double>(all) : 0.0;
}

void measure_cells(const Session& session, StabilityRow& row)
{
    const CellSystem& system = *session.system();
    row.cells = system.body().cells.size();
    double jump = 0.0, off = 0.0;
    for (const Face& face : system.body().cells.faces)
        jump =
            std::max(jump, Eigen::AngleAxisd(system.poses()[idx(face.a)].R.transpose() *
                                             system.poses()[idx(face.b)].R)
                               .angle());
    for (const Pose& pose : system.poses())
        off = std::max(
            off, (pose.R.transpose() * pose.R - Eigen::Matrix3d::Identity()).norm());
    row.jump = jump * 180.0 / std::numbers::pi;
    row.orthonormality = off;
    if (session.geometry().num_faces() > 0)
        row.inverted = inverted_share(session);
}

/// Runs an edit to its end.
Result play(const SceneFile& scene, StabilityRow& row)
{
    SessionRequest request = request_of(scene, ForTime::No);
    request.settings.time_budget = kTime;
    Session session(geometry_of(std::make_shared<const GeometryFile>(
                        read_geometry(request.scene.model, request.read))),
                    request.handles ? std::move(*request.handles) : HandleFile(),
                    request.settings);
    while (session.upcoming_frame())
        session.next_frame(true);
    row.outcome = stop_name(Stop::Converged);
    row.iterations = 0;
    row.rise = row.gradient = row.residual = 0.0;
    for (const FrameReport& frame : session.frames())
    {
        *row.iterations += frame.solve.iterations;
        row.rise = std::max(*row.rise, frame.largest_rise);
        row.gradient = std::max(*row.gradient, frame.solve.gradient);
        row.residual = std::max(*row.residual, frame.handle_residual);
        if (frame.solve.stop != Stop::Converged)
            row.outcome = stop_name(frame.solve.stop);
    }
    if (session.system())
        measure_cells(session, row);
    return {session.deformed().samples, {}};
}

/// Runs a scene in time to its end.
Result follow(const SceneFile& scene, const StabilityCase& of, StabilityRow& row)
{
    Simulation simulation(read_simulation(scene));
    Result result;
    row.outcome = stop_name(Stop::Converged);
    row.iterations = 0;
    row.violation = 0.0;
    double first = 0.0, highest = -INFINITY, size = 0.0;
    for (std::int64_t frame = 0; frame <= simulation.last_frame(); ++frame)
    {
        if (frame > 0)
            simulation.next_frame({}, false);
        const SimulationReport report = simulation.report();
        const double all = report.kinetic + report.elastic + report.gravity;
        if (frame == 0)
            first = all;
        highest = std::max(highest, all);
        size = std::max({size, report.kinetic, report.elastic, std::abs(all - first)});
        // The first frame is as the scene has it: what is off there is brought to place.
        if (frame > 0)
            row.violation = std::max(*row.violation, report.violation);
        *row.iterations += report.iterations;
        if (report.stop != stop_name(Stop::Converged))
            row.outcome = report.stop;
        result.numbers.insert(result.numbers.end(), {report.kinetic, report.elastic,
                                                     report.gravity, *row.violation});
    }
    if (of.is_left_alone)
        row.growth = size > 0.0 ? (highest - first) / size : 0.0;
    return result;
}

/// What a case may not miss.
void judge(const Result& result, StabilityRow& row)
{
    if (!result.is_finite())
        row.faults.push_back("a result that is no number");
    if (row.has_same_bits && !*row.has_same_bits)
        row.faults.push_back("other bits when it is run again");
    for (const auto& [key, value, fault, most] : kMeasures)
        if (const std::optional<double>& found = row.*value;
            fault && found && !(*found <= most))
            row.faults.push_back(
                fmt::format("{} {:.2g}, more than {:.2g}", fault, *found, most));
}

/// How many digits of 16 are not those of another scene's result. What the rounding of
/// the coordinates themselves takes does not count.
double digits_lost(const StabilityCase& of, const std::vector<Eigen::Vector3d>& samples,
                   const std::vector<Eigen::Vector3d>& others)
{
    constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
    double farthest = 0.0, size = 0.0;
    for (std::size_t i = 0; i < samples.size(); ++i)
    {
        farthest =
            std::max(farthest, (samples[i] - of.scale * others[i] - of.offset).norm());
        size = std::max(size, of.scale * (others[i] - others[0]).norm());
    }
    const double rounding =
        kEpsilon * std::max(1.0, of.offset.cwiseAbs().maxCoeff() / size);
    return std::max(0.0, std::log10(std::max(farthest / size, 1e-300) / rounding));
}

Result run_once(const StabilityCase& of, StabilityRow& row)
{
    const SceneFile scene = read_scene(of.path);
    return scene.is_in_time() ? follow(scene, of, row) : play(scene, row);
}

StabilityRow run_case(const StabilityCase& of, std::map<std::string, Result>& results)
{
    StabilityRow row;
    row.of = of;
    const Clock::time_point start = Clock::now();
    try
    {
        const Result result = run_once(of, row);
        row.seconds = 1e-3 * ms_since(start);
        StabilityRow again;
        row.has_same_bits = run_once(of, again) == result;
        const auto other = results.find(of.same_as);
        if (other != results.end() &&
            other->second.samples.size() == result.samples.size())
            row.digits_lost = digits_lost(of, result.samples, other->second.samples);
        judge(result, row);
        results[of.name] = result;
    }
    catch (const Error& error)
    {
        row.seconds = 1e-3 * ms_since(start);
        row.outcome =
            fmt::format("exit {}: {}", static_cast<int>(error.fault()), error.what());
    }
    catch (const std::bad_alloc&)
    {
        row.outcome = fmt::format("exit {}: out of memory", int(Fault::Budget));
    }
    catch (const std::exception& error)
    {
        row.outcome = fmt::format("exit 1: {}", error.what());
        row.faults.push_back("an error that is no answer");
    }
    return row;
}

template <class Value>
Json or_null(const std::optional<Value>& value)
{
    return value ? Json(*value) : Json();
}

} // namespace

std::vector<StabilityRow> run_stability(const std::vector<StabilityCase>& cases,
                                        const std::function<void(std::size_t)>& watch)
{
    std::map<std::string, Result> results;
    std::vector<StabilityRow> rows;
    for (std::size_t k = 0; k < cases.size(); ++k)
    {
        if (watch)
            watch(k);
        rows.push_back(run_case(cases[k], results));
    }
    return rows;
}

Json stability_json(const std::vector<StabilityRow>& rows)
{
    Json cases = Json::array(), gates = Json::object();
    std::size_t faulty = 0;
    for (const StabilityRow& row : rows)
    {
        faulty += !row.faults.empty();
        Json json = {{"group", row.of.group},
                     {"name", row.of.name},
                     {"scene", row.of.path},
                     {"outcome", row.outcome},
                     {"faults", row.faults},
                     {"cells", or_null(row.cells)},
                     {"iterations", or_null(row.iterations)}};
        for (const Measure& measure : kMeasures)
            json[measure.key] = or_null(row.*measure.value);
        json["same_bits"] = or_null(row.has_same_bits);
        json["seconds"] = row.seconds;
        cases.push_back(std::move(json));
    }
    for (const Measure& measure : kMeasures)
        if (measure.fault)
            gates[measure.key] = measure.most;
    return {{"cases", cases}, {"faulty", faulty}, {"gates", gates}};
}

std::string stability_csv(const Json& json)
{
    const Json& cases = json["cases"];
    std::vector<CsvColumn> columns;
    for (const auto& item : cases.front().items())
        columns.push_back({item.key(), item.key()});
    return csv_text(columns, cases);
}

std::vector<std::string> stability_sentences(const std::vector<StabilityRow>& rows)
{
    std::map<std::string, std::size_t> outcomes;
    std::size_t faulty = 0;
    for (const StabilityRow& row : rows)
    {
        faulty += !row.faults.empty();
        ++outcomes[row.outcome.substr(0, row.outcome.find(':'))];
    }
    std::vector<std::string> counted;
    for (const auto& [outcome, count] : outcomes)
        counted.push_back(fmt::format("{} {}", count, outcome));
    std::vector<std::string> sentences = {fmt::format(
        "{} cases: {}; {} of them with faults.", rows.size(), fmt::join(counted, ", "),
        faulty == 0 ? std::string("none") : std::to_string(faulty))};
    for (const StabilityRow& row : rows)
        if (!row.faults.empty())
            sentences.push_back(fmt::format("{} ({}): {}.", row.of.name, row.outcome,
                                            fmt::join(row.faults, "; ")));
    return sentences;
}

} // namespace cellwarp::core
