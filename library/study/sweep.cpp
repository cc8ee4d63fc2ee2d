// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/study/sweep.h"

#include <algorithm>
#include <set>
#include <string_view>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/formats/geometry_file.h"
#include "library/session/peak_memory.h"
#include "library/session/scene_settings.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Iterations of a frame of the reference, at the most: it has to converge, whatever it
/// takes.
constexpr int kReferenceIterations = 10000;

constexpr double kSecondsPerMs = 1e-3;

/// Before the size of other clusters than the release's, in the name of a field.
constexpr std::string_view kClustersPrefix = "rbf:";

/// Clusters that are larger are next to one RBF of all cells.
constexpr double kMaxClusterLength = 64.0;

/// "CORE:SUPPORT:REACH". Nothing if that is no size that clusters can have.
std::optional<ClusterSize> clusters_of(std::string_view text)
{
    const std::size_t first = text.find(':');
    const std::size_t second = text.find(':', first + 1);
    if (first == text.npos || second == text.npos)
        return std::nullopt;
    const std::optional<std::int64_t> core = parse_integer(text.substr(0, first));
    const std::optional<double> support =
        parse_double(text.substr(first + 1, second - first - 1));
    const std::optional<double> reach = parse_double(text.substr(second + 1));
    if (!core || !support || !reach || *core < 1 ||
        static_cast<double>(*core) > kMaxClusterLength || !(*support > 0) ||
        !(*support <= *reach) || !(*reach <= kMaxClusterLength))
        return std::nullopt;
    return ClusterSize{static_cast<int>(*core), *support, *reach};
}

double median(std::vector<double> values)
{
    std::sort(values.begin(), values.end());
    const std::size_t middle = values.size() / 2;
    return values.size() % 2 == 1 ? values[middle]
                                  : 0.5 * (values[middle - 1] + values[middle]);
}

/// The level of the coarsest leaf: where splitting everywhere got to.
int depth_everywhere(const Session& session)
{
    const std::vector<Leaf>& leaves = session.system()->body().octree.leaves();
    return std::min_element(leaves.begin(), leaves.end(),
                            [](const Leaf& a, const Leaf& b)
                            { return a.level < b.level; })
        ->level;
}

SessionSettings session_settings(const SweepSettings& settings, const SweepCase& of)
{
    SessionSettings session = settings.session;
    session.cells.max_depth = of.grid_depth();
    session.cells.min_depth = of.kind == SweepKind::Adaptive ? 0 : of.depth;
    session.cells.threshold = of.threshold;
    session.field = of.field;
    if (of.taken_back)
        use(of.taken_back->departures, session);
    session.max_iterations = of.max_iterations;
    session.watch = {};
    if (of.kind == SweepKind::Reference)
    {
        session.gradient_tolerance = kReferenceTolerance;
        session.time_budget = 0.0;
    }
    return session;
}

/// Throws where max_cells has stopped the reference above its depth.
void check_reference_depth(const Session& session, const SessionSettings& settings)
{
    if (depth_everywhere(session) < settings.cells.min_depth)
        throw Error(Fault::Budget, fmt::format("there are more than max_cells {}",
                                               settings.cells.max_cells));
}

/// A session after its last frame, and what it took.
struct Played
{
    Session session;
    StageSeconds seconds;
};

Played played(const SweepInput& input, const SessionSettings& settings,
              bool is_reference = false)
{
    StageSeconds seconds;
    const Clock::time_point start = Clock::now();
    std::shared_ptr<const Geometry> geometry = input.geometry;
    if (!geometry)
        geometry = std::make_shared<const Geometry>(
            read_geometry(input.model, input.read).geometry);
    seconds.load = seconds_since(start);
    const Clock::time_point build_start = Clock::now();
    Session session(std::move(geometry), input.handles, settings);
    seconds.cells = seconds_since(build_start);
    if (is_reference)
        check_reference_depth(session, settings);
    const std::size_t frames = num_frames(input.handles);
    for (std::size_t i = 0; i < frames; ++i)
    {
        session.next_frame(i + 1 == frames);
        if (is_reference)
            check_reference_depth(session, settings);
    }
    seconds.total = seconds_since(start);
    for (const FrameReport& report : session.frames())
    {
        seconds.cells += kSecondsPerMs * report.cells_ms;
        seconds.solve += kSecondsPerMs * report.solve_ms;
        seconds.field_fit += kSecondsPerMs * report.fit_ms;
        seconds.field_apply += kSecondsPerMs * report.apply_ms;
    }
    return {std::move(session), seconds};
}

/// What the first run of a case tells, beside its error.
void describe(SweepRow& row, const Session& session)
{
    const Body& body = session.system()->body();
    row.cells = body.cells.size();
    double edge = INFINITY;
    for (const Cell& cell : body.cells.cells)
    {
        const std::size_t level = idx(body.octree[cell.leaf].level);
        row.cells_per_depth.resize(std::max(row.cells_per_depth.size(), level + 1), 0);
        ++row.cells_per_depth[level];
        edge = std::min(edge, cell.edge);
    }
    row.cell_edge = edge / body.rest->frame.diagonal();
    row.frames = session.frames();
    row.stop = Stop::Converged;
    for (const FrameReport& report : row.frames)
    {
        row.iterations += std::max(0, report.solve.iterations);
        if (row.stop == Stop::Converged)
            row.stop = report.solve.stop;
    }
}

StageSeconds median_of(const std::vector<StageSeconds>& runs)
{
    const auto of = [&](double StageSeconds::*stage)
    {
        std::vector<double> values;
        for (const StageSeconds& run : runs)
            values.push_back(run.*stage);
        return median(std::move(values));
    };
    return {of(&StageSeconds::load),        of(&StageSeconds::cells),
            of(&StageSeconds::solve),       of(&StageSeconds::field_fit),
            of(&StageSeconds::field_apply), of(&StageSeconds::total)};
}

/// A sweep under way.
class Runner
{
public:
    Runner(const SweepInput& input, const SweepSettings& settings,
           const std::function<void(const SweepProgress&)>& watch)
        : input_(input), settings_(settings), watch_(watch)
    {
        for (const SweepCase& of : sweep_cases(settings))
            result_.rows.emplace_back().of = of;
        times_.resize(result_.rows.size());
        num_runs_ = 1 + (result_.rows.size() - 1) * idx(settings.runs);
    }

    SweepResult run()
    {
        run_reference();
        for (int round = 0; round < settings_.runs; ++round)
            for (std::size_t r = 1; r < result_.rows.size(); ++r)
                run_row(r, round == 0);
        for (std::size_t r = 0; r < result_.rows.size(); ++r)
            if (result_.rows[r].is_done())
                take_medians(result_.rows[r], times_[r]);
        return std::move(result_);
    }

private:
    struct Times
    {
        std::vector<StageSeconds> seconds;
        std::vector<double> peaks;
    };

    SessionSettings watched_settings(const SweepCase& of)
    {
        SessionSettings session = session_settings(settings_, of);
        ++run_;
        if (!watch_)
            return session;
        const std::size_t frames = num_frames(input_.handles);
        watch_({run_, num_runs_, of, {}, frames});
        session.watch = [this, &of, frames](const FrameProgress& now) {
            watch_({run_, num_runs_, of, now, frames});
        };
        return session;
    }

    ErrorParts parts_by(const FieldChoice& finest, const SweepCase& of,
                        const Session& session) const
    {
        const std::vector<Eigen::Vector3d>& samples = session.deformed().samples;
        if (finest == of.field)
            return {finest, deviation(samples, result_.reference, diagonal_), {}};
        const std::vector<Eigen::Vector3d> best = session.samples_by(finest);
        return {finest, deviation(best, result_.reference, diagonal_),
                deviation(samples, best, diagonal_)};
    }

    ErrorParts parts_of(const SweepCase& of, const Session& session) const
    {
        const std::vector<FieldChoice>& fields = settings_.fields;
        if (std::find(fields.begin(), fields.end(), FieldKind::RbfGlobal) != fields.end())
            try
            {
                return parts_by(FieldKind::RbfGlobal, of, session);
            }
            catch (const Error& error)
            {
                if (error.fault() != Fault::Budget)
                    throw;
            }
        return parts_by(FieldKind::Rbf, of, session);
    }

    Played measured(std::size_t r)
    {
        const SweepCase& of = result_.rows[r].of;
        const SessionSettings session = watched_settings(of);
        const PeakMemory peak;
        Played run = played(input_, session, of.kind == SweepKind::Reference);
        times_[r].peaks.push_back(peak.mb());
        times_[r].seconds.push_back(run.seconds);
        result_.is_peak_of_run = result_.is_peak_of_run && peak.is_since_start();
        return run;
    }

    void run_reference()
    {
        SweepRow& row = result_.rows.front();
        try
        {
            const Played run = measured(0);
            const Geometry& geometry = run.session.geometry();
            result_.num_samples = geometry.samples.size();
            result_.num_faces = geometry.num_faces();
            result_.across = run.session.system()->rest().across;
            diagonal_ = bounding_box(geometry.samples).size().norm();
            result_.reference = run.session.deformed().samples;
            check_count(result_.reference, input_.against);
            compare_with_elsewhere(row, result_.reference);
            row.parts = parts_of(row.of, run.session);
            describe(row, run.session);
            keep_warnings(row, run.session);
        }
        catch (const Error& error)
        {
            if (error.fault() != Fault::Budget || row.of.depth == 0)
                throw;
            throw Error(Fault::Budget,
                        fmt::format("the reference, uniform cells of depth {}: {}{}",
                                    row.of.depth, error.what(), smaller_depth()));
        }
    }

    /// The advice that belongs to a reference over its budget.
    std::string smaller_depth() const
    {
        for (int depth = settings_.max_depth - 1; depth >= 0; --depth)
        {
            SweepSettings smaller = settings_;
            smaller.max_depth = depth;
            const SessionSettings session =
                session_settings(smaller, sweep_cases(smaller).front());
            try
            {
                check_reference_depth(
                    Session(read_geometry(input_.model, input_.read).geometry,
                            input_.handles, session),
                    session);
                return fmt::format(" (use --max-depth {})", depth);
            }
            catch (const Error& error)
            {
                if (error.fault() != Fault::Budget)
                    throw;
            }
        }
        return "";
    }

    void run_row(std::size_t r, bool is_first)
    {
        SweepRow& row = result_.rows[r];
        if (!row.is_done())
        {
            ++run_;
            return;
        }
        try
        {
            const Played run = measured(r);
            if (!is_first)
                return;
            const std::vector<Eigen::Vector3d>& samples = run.session.deformed().samples;
            check_count(samples, result_.reference);
            describe(row, run.session);
            keep_warnings(row, run.session);
            row.error = deviation(samples, result_.reference, diagonal_);
            compare_with_elsewhere(row, samples);
            row.parts = parts_of(row.of, run.session);
            compare_with_coarser(r, samples);
        }
        catch (const Error& error)
        {
            if (error.fault() != Fault::Budget && error.fault() != Fault::Unsolvable)
                throw;
            row.failure = error.what();
            result_.warnings.push_back(case_name(row.of) + ": " + row.failure);
        }
    }

    /// The model is read anew for each run.
    void check_count(const std::vector<Eigen::Vector3d>& samples,
                     const std::vector<Eigen::Vector3d>& others) const
    {
        if (!others.empty() && samples.size() != others.size())
            throw Error(Fault::File,
                        at({input_.model, 0, ""}, "changed while it was swept"));
    }

    void compare_with_elsewhere(SweepRow& row,
                                const std::vector<Eigen::Vector3d>& samples) const
    {
        if (!input_.against.empty())
            row.against = deviation(samples, input_.against, diagonal_);
    }

    void compare_with_coarser(std::size_t r, const std::vector<Eigen::Vector3d>& samples)
    {
        SweepRow& row = result_.rows[r];
        if (row.of.kind != SweepKind::Uniform)
            return;
        const SweepRow& last = result_.rows[r - 1];
        if (row.of.depth > 0 && last.is_done())
            row.from_coarser = deviation(samples, coarser_, diagonal_);
        coarser_ = samples;
    }

    /// What the reference warns of, all others do; their own get their name.
    void keep_warnings(const SweepRow& row, const Session& session)
    {
        for (const std::string& warning : session.warnings())
            if (known_warnings_.insert(warning).second)
                result_.warnings.push_back(row.of.kind == SweepKind::Reference
                                               ? warning
                                               : case_name(row.of) + ": " + warning);
        if (!row.of.is_limited)
            for (const FrameReport& report : row.frames)
                if (report.solve.stop != Stop::Converged)
                    result_.warnings.push_back(
                        fmt::format("{}: frame {} did not converge ({}, gradient {:.3g})",
                                    case_name(row.of), report.frame,
                                    stop_name(report.solve.stop), report.solve.gradient));
    }

    static void take_medians(SweepRow& row, const Times& times)
    {
        row.seconds = median_of(times.seconds);
        row.peak_mb = median(times.peaks);
        for (const StageSeconds& run : times.seconds)
            row.run_seconds.push_back(run.total);
    }

    const SweepInput& input_;
    const SweepSettings& settings_;
    const std::function<void(const SweepProgress&)>& watch_;
    SweepResult result_;
    std::vector<Times> times_; ///< one a row
    std::size_t run_ = 0, num_runs_ = 0;
    double diagonal_ = 0.0;
    std::vector<Eigen::Vector3d> coarser_; ///< samples of the last uniform cells
    std::set<std::string> known_warnings_;
};

} // namespace

std::vector<Eigen::Vector3d> read_against(const std::string& path,
                                          const SweepInput& input)
{
    std::vector<Eigen::Vector3d> samples =
        read_geometry(path, input.read).geometry.samples;
    const std::size_t wanted =
        read_geometry(input.model, input.read).geometry.samples.size();
    if (samples.size() != wanted)
        throw malformed(
            {path, 0, ""},
            fmt::format("has {} samples, need {}, those of {} in the same order",
                        samples.size(), wanted, input.model));
    return samples;
}

std::string kind_name(SweepKind kind)
{
    switch (kind)
    {
    case SweepKind::Reference:
        return "reference";
    case SweepKind::Uniform:
        return "uniform";
    case SweepKind::Adaptive:
        return "adaptive";
    }
    return {};
}

std::string field_name(const FieldChoice& field)
{
    switch (field.kind)
    {
    case FieldKind::Blend:
        return "blend";
    case FieldKind::Closest4:
        return "closest4";
    case FieldKind::Rbf:
        return field == FieldKind::Rbf
                   ? "rbf"
                   : fmt::format("{}{}:{}:{}", kClustersPrefix, field.clusters.core,
                                 shortest(field.clusters.support),
                                 shortest(field.clusters.reach));
    case FieldKind::RbfGlobal:
        return "rbf-global";
    case FieldKind::RbfCentres:
        return "rbf-centres";
    }
    return {};
}

std::optional<FieldChoice> field_of_name(const std::string& name)
{
    for (const FieldKind field : {FieldKind::Blend, FieldKind::Closest4, FieldKind::Rbf,
                                  FieldKind::RbfGlobal, FieldKind::RbfCentres})
        if (field_name(field) == name)
            return field;
    if (!name.starts_with(kClustersPrefix))
        return std::nullopt;
    const std::optional<ClusterSize> clusters =
        clusters_of(std::string_view(name).substr(kClustersPrefix.size()));
    return clusters ? std::optional(FieldChoice(FieldKind::Rbf, *clusters))
                    : std::nullopt;
}

std::string case_name(const SweepCase& of)
{
    std::string name = kind_name(of.kind);
    if (of.kind == SweepKind::Uniform)
        name += fmt::format(" {}", of.depth);
    if (of.kind == SweepKind::Adaptive)
        name += fmt::format(" {:g}", of.threshold);
    if (of.kind == SweepKind::Adaptive && of.is_above_reference())
        name += fmt::format(" to depth {}", of.depth);
    name += ", " + field_name(of.field);
    if (of.is_limited)
        name += fmt::format(", {} iterations", of.max_iterations);
    if (of.taken_back)
        name += ", without " + of.taken_back->name;
    return name;
}

const std::vector<TakenBack>& departures_taken_back()
{
    static const std::vector<TakenBack> all = []
    {
        using Flag = bool Departures::*;
        std::vector<TakenBack> found;
        for (const auto& [name, flag, field] :
             {std::tuple("glue in the face", Flag(&Departures::glue_in_face),
                         FieldKind::Rbf),
              {"handing over at level changes", &Departures::level_changes,
               FieldKind::Rbf},
              {"measured borders", &Departures::measured_borders, FieldKind::Rbf},
              {"smooth borders", &Departures::smooth_borders, FieldKind::Rbf},
              {"rigid steps", &Departures::rigid_steps, FieldKind::Rbf},
              {"errors from the affine map", &Departures::affine_errors, FieldKind::Rbf},
              {"the blend along the glue", &Departures::blend, FieldKind::Blend},
              {"local RBFs", &Departures::local_rbf, FieldKind::Rbf}})
        {
            Departures departures;
            departures.*flag = false;
            found.push_back({name, departures, field});
        }
        for (const FieldKind field : {FieldKind::Rbf, FieldKind::Blend})
            found.push_back({"all (botsch07)", kBotsch07, field});
        return found;
    }();
    return all;
}

Deviation deviation(const std::vector<Eigen::Vector3d>& samples,
                    const std::vector<Eigen::Vector3d>& others, double diagonal)
{
    Deviation found;
    double sum = 0.0;
    for (std::size_t i = 0; i < samples.size(); ++i)
    {
        const double squared = (samples[i] - others[i]).squaredNorm();
        found.largest = std::max(found.largest, squared);
        sum += squared;
    }
    // Samples that are all in one place have no diagonal, and move as one.
    const double scale = diagonal > 0 ? diagonal : 1.0;
    found.largest = std::sqrt(found.largest) / scale;
    if (!samples.empty())
        found.rms = std::sqrt(sum / static_cast<double>(samples.size())) / scale;
    return found;
}

bool SweepResult::is_converged() const
{
    return std::all_of(rows.begin(), rows.end(),
                       [](const SweepRow& row) {
                           return row.is_done() &&
                                  (row.is_converged() || row.of.is_limited);
                       });
}

std::size_t num_frames(const HandleFile& handles)
{
    std::size_t count = 0;
    for (const Stage& stage : handles.stages)
        count += stage.frames.size();
    return count;
}

namespace
{

/// Nothing taken back, then each departure, in the coarsest cells and in adaptive ones.
std::vector<SweepCase> taken_back_cases(const SweepSettings& settings)
{
    std::vector<SweepCase> cases;
    const auto add = [&](const FieldChoice& field, const TakenBack* taken_back)
    {
        const int deepest = settings.max_depth;
        const int limit = settings.session.max_iterations;
        cases.push_back(
            {SweepKind::Uniform, 0, deepest, INFINITY, field, limit, false, taken_back});
        const bool has_gaps = taken_back && !taken_back->departures.affine_errors;
        cases.push_back({SweepKind::Adaptive, deepest, deepest,
                         has_gaps ? kUsualGap : kUsualThreshold, field, limit, false,
                         taken_back});
    };
    for (const FieldKind field : {FieldKind::Rbf, FieldKind::Blend})
        add(field, nullptr);
    for (const TakenBack& taken_back : departures_taken_back())
    {
        SessionSettings of_field;
        of_field.field = taken_back.field;
        use(taken_back.departures, of_field);
        add(of_field.field, &taken_back);
    }
    return cases;
}

} // namespace

std::vector<SweepCase> sweep_cases(const SweepSettings& settings)
{
    const int deepest = settings.max_depth;
    std::vector<SweepCase> cases = {{SweepKind::Reference, deepest, deepest, INFINITY,
                                     FieldKind::Rbf, kReferenceIterations, false}};
    if (settings.takes_back)
    {
        const std::vector<SweepCase> more = taken_back_cases(settings);
        cases.insert(cases.end(), more.begin(), more.end());
        return cases;
    }
    std::vector<int> depths = settings.depths;
    if (depths.empty())
        depths = {deepest};
    std::vector<std::pair<int, bool>> limits = {{settings.session.max_iterations, false}};
    for (const int limit : settings.iteration_limits)
        limits.emplace_back(limit, true);
    for (const auto& [limit, is_limited] : limits)
        for (const FieldChoice& field : settings.fields)
        {
            for (int depth = 0; depth <= deepest; ++depth)
                cases.push_back({SweepKind::Uniform, depth, deepest, INFINITY, field,
                                 limit, is_limited});
            for (const int depth : depths)
                for (const double threshold : settings.thresholds)
                    cases.push_back({SweepKind::Adaptive, depth, deepest, threshold,
                                     field, limit, is_limited});
        }
    return cases;
}

SweepResult run_sweep(const SweepInput& input, const SweepSettings& settings,
                      const std::function<void(const SweepProgress&)>& watch)
{
    return Runner(input, settings, watch).run();
}

Session play_case(const SweepInput& input, const SweepSettings& settings,
                  const SweepCase& of)
{
    return played(input, session_settings(settings, of)).session;
}

} // namespace cellwarp::core
