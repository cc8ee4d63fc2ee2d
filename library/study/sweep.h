// SPDX-License-Identifier: GPL-3.0-or-later
// What a choice of cells costs and buys: one scripted session run with many choices, each
// compared with a reference and timed. No printing and no files but the model's; what the
// rows say together is the business of convergence.h.
#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "library/session/session.h"

namespace cellwarp::core
{

enum class SweepKind
{
    Reference, ///< uniform at the deepest level, solved to kReferenceTolerance
    Uniform,
    Adaptive
};

/// "reference", "uniform" or "adaptive".
std::string kind_name(SweepKind kind);

/// "rbf", "blend", "closest4", "rbf-global" or "rbf-centres"; "rbf:2:2:3" of other
/// clusters than the release's, by their core, support and reach.
std::string field_name(const FieldChoice& field);
/// Nothing if there is no such field.
std::optional<FieldChoice> field_of_name(const std::string& name);

/// What the reference is solved to; relative, as SessionSettings::gradient_tolerance.
inline constexpr double kReferenceTolerance = 1e-10;

/// Departures from [Botsch07] with one of them taken back, or all.
struct TakenBack
{
    std::string
        name; ///< of what is taken back: "glue in the face", ..., "all (botsch07)"
    Departures departures;
    FieldKind field = FieldKind::Rbf; ///< of the session; use() makes the paper's of it
};

/// Each departure taken back alone, in the order of Departures, and then all, with the
/// release field and with that of drags.
const std::vector<TakenBack>& departures_taken_back();

/// One choice of cells, field and iterations.
struct SweepCase
{
    SweepKind kind = SweepKind::Reference;
    int depth = 0;               ///< of the deepest cells that there may be
    int reference_depth = 0;     ///< of the deepest cells of the whole sweep
    double threshold = INFINITY; ///< [diagonal] infinity: not adaptive
    FieldChoice field = FieldKind::Rbf;
    int max_iterations = 0;  ///< of one frame
    bool is_limited = false; ///< stopped early on purpose: it need not converge
    const TakenBack* taken_back = nullptr; ///< of departures_taken_back(); null: nothing

    /// Of the grid in whose voxels the material is found: uniform cells of every depth
    /// have the reference's material.
    int grid_depth() const
    {
        return kind == SweepKind::Adaptive ? depth : reference_depth;
    }
    bool is_above_reference() const { return depth < reference_depth; }
};

/// "uniform 1, blend", "adaptive 0.001, rbf"; a depth that is not the reference's, a
/// limit that is not the usual one.
std::string case_name(const SweepCase& of);

/// The files of a session. They are read anew for each run, as a single edit would.
struct SweepInput
{
    std::string model;
    ReadOptions read;
    HandleFile handles;
    /// A result from elsewhere, with which every row is compared; empty: none.
    std::vector<Eigen::Vector3d> against = {};
    /// In the place of the file; null: it is read.
    std::shared_ptr<const Geometry> geometry = {};
};

/// The samples of a result from elsewhere, in any format that is read. Throws
/// Fault::Malformed where they are not as many as those of \p input's model.
std::vector<Eigen::Vector3d> read_against(const std::string& path,
                                          const SweepInput& input);

struct SweepSettings
{
    /// What all runs have in common; its depths, threshold, field and watch are not used.
    SessionSettings session;
    int max_depth = 2; ///< of the reference; each level takes some eight times the cells
    std::vector<double> thresholds = {1e-1, 3e-2, 1e-2, 3e-3, 1e-3,
                                      3e-4, 1e-4, 3e-5, 1e-5}; ///< [diagonal]
    std::vector<int> depths; ///< of the adaptive cells; empty: max_depth
    std::vector<FieldChoice> fields = {FieldKind::Rbf, FieldKind::Blend};
    /// Of one frame. Each is tried with all cells and fields, beside no such limit.
    std::vector<int> iteration_limits;
    /// Instead of thresholds: each departure taken back, in the coarsest cells and in
    /// adaptive ones of the usual threshold of its errors.
    bool takes_back = false;
    int runs = 3; ///< of each case but the reference; times and memory are medians
};

/// Distance of the samples of two results, relative to the diagonal of the rest model.
struct Deviation
{
    double largest = 0.0, rms = 0.0;
};

/// Distance of \p samples from \p others, which are as many
Deviation deviation(const std::vector<Eigen::Vector3d>& samples,
                    const std::vector<Eigen::Vector3d>& others, double diagonal);

struct StageSeconds
{
    double load = 0.0, cells = 0.0, solve = 0.0, field_fit = 0.0, field_apply = 0.0;
    double total = 0.0; ///< from the files to the last frame's samples
};

/// What of an error is the field's, and what the cells': both of the same poses.
struct ErrorParts
{
    /// rbf-global where the sweep has it and its memory allows, else rbf.
    FieldChoice finest = FieldKind::Rbf;
    Deviation of_cells; ///< of the finest field from the reference
    /// Of the field from the finest; nothing if it is the finest itself.
    std::optional<Deviation> of_field;
};

/// What one case took and reached.
struct SweepRow
{
    SweepCase of;
    std::string failure; ///< why there is no result; all below is empty then
    Deviation error;     ///< after the last frame, from the reference
    ErrorParts parts;
    /// From the result that comes from elsewhere, if there is one.
    std::optional<Deviation> against;
    /// Of uniform cells: the distance from those one level coarser.
    std::optional<Deviation> from_coarser;
    std::size_t cells = 0; ///< of the last stage, as those below
    std::vector<int> cells_per_depth;
    double cell_edge = 0.0;          ///< of the smallest cell [diagonal]
    std::vector<FrameReport> frames; ///< of the first run
    int iterations = 0;              ///< of all frames
    Stop stop = Stop::NotRun;        ///< of the first frame that did not converge, if any
    StageSeconds seconds;
    std::vector<double> run_seconds; ///< total of each run
    /// Of the whole process in that run. What the sweep itself keeps, two sets of
    /// samples, is in it.
    double peak_mb = 0.0;

    bool is_done() const { return failure.empty(); }
    bool is_converged() const { return is_done() && stop == Stop::Converged; }
};

/// Which run is under way.
struct SweepProgress
{
    std::size_t run = 0, num_runs = 0; ///< run counts from 1
    const SweepCase& of;
    FrameProgress frame; ///< of this run
    std::size_t num_frames = 0;
};

struct SweepResult
{
    std::size_t num_samples = 0, num_faces = 0;
    int across = 0;                         ///< coarsest cells along the longest side
    std::vector<SweepRow> rows;             ///< the reference first
    std::vector<Eigen::Vector3d> reference; ///< samples after the last frame
    std::vector<std::string> warnings;
    bool is_peak_of_run = true; ///< else peaks are of the process, up to the run

    /// Whether all runs but those stopped on purpose converged.
    bool is_converged() const;
};

/// Frames of all stages.
std::size_t num_frames(const HandleFile& handles);

/// All cases in the order in which they run: the reference, then for each limit and field
/// uniform cells of every depth and adaptive ones from the largest threshold down.
std::vector<SweepCase> sweep_cases(const SweepSettings& settings);

/// Runs the reference, then all cases \p settings.runs times in turn, so that what slows
/// the machine for a while meets all of them. A case that a budget or its regions forbid
/// gets a row that says so. Throws Error where the reference cannot be had;
/// Fault::Budget then names a max_depth that can. \pre there is a frame; what the rows
/// are compared with has as many samples as the model
SweepResult run_sweep(const SweepInput& input, const SweepSettings& settings,
                      const std::function<void(const SweepProgress&)>& watch = {});

/// One case by itself, after its last frame.
Session play_case(const SweepInput& input, const SweepSettings& settings,
                  const SweepCase& of);

} // namespace cellwarp::core
