// SPDX-License-Identifier: GPL-3.0-or-later
// A scripted edit session: a model, its cells, and the frames of a handle file. The
// result is a function of the files and settings alone. No window, no printing.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "editor/session/recutting.h"
#include "editor/session/rig.h"
#include "io/field_file.h"
#include "io/geometry.h"
#include "io/handle_file.h"
#include "solver/field/field.h"

namespace cellwarp
{

/// Where a session is: frames done, and how far the next one is.
struct FrameProgress
{
    std::size_t frames_done = 0;
    std::int64_t frame = 0;  ///< its number
    int step = 0, steps = 1; ///< of its way
    int iteration = 0;
    double gradient = 1.0; ///< relative; 1 where it is not known yet
};

struct SessionSettings
{
    CellSettings cells;
    Method method = Method::Newton;
    int max_iterations = 200; ///< of one frame, all its steps together
    double gradient_tolerance = 1e-6;
    double time_budget = 0.0; ///< [s] of one frame's solve, 0: no limit
    FieldChoice field = FieldKind::Rbf;
    bool keeps_fields = false; ///< of commits, for field_file()
    std::stop_token stop = {};
    /// Called on the way, in the thread that runs the session: at every iteration.
    std::function<void(const FrameProgress&)> watch = {};
};

/// What one frame took and reached. Lengths are relative to the diagonal.
struct FrameReport
{
    std::int64_t frame = 0;
    SolveReport solve; ///< of the last step; iterations of all
    int steps = 0;
    int recuts = 0; ///< times that other cells were made
    std::size_t cells = 0;
    int cells_at_limit = 0; ///< above the threshold, but at the deepest level
    double handle_residual = 0.0;
    double max_pair_gap = 0.0;
    double cells_ms = 0.0, solve_ms = 0.0, fit_ms = 0.0, apply_ms = 0.0;
};

/// What parts were built, counted where they are built.
struct PartCounts
{
    int interior = 0, refinement = 0, blend = 0, rbf = 0, rbf_global = 0, normals = 0,
        faces = 0;
};

/// What a closed mesh encloses.
struct Volume
{
    double before = 0.0, after = 0.0; ///< [model unit^3]
};

class Session
{
public:
    /// Builds the cells of the first stage and checks all of its statements against
    /// the model, so that what cannot be done fails before anything is. A later stage
    /// is checked when its commit has made its rest shape. Throws Error.
    Session(GeometryFile model, HandleFile handles, SessionSettings settings);
    ~Session();
    Session(Session&&) noexcept;
    Session& operator=(Session&&) noexcept;

    /// Solves the next frame; false when there is none left. \p wants_samples: fit
    /// the field and move the samples (a commit does so in any case).
    bool next_frame(bool wants_samples);
    /// The number of the frame that next_frame() would solve.
    std::optional<std::int64_t> upcoming_frame() const;

    const GeometryFile& model() const { return model_; }
    /// The samples and directions after the last frame that wanted them.
    const Patch& patch() const { return patch_; }
    const std::vector<FrameReport>& frames() const { return reports_; }
    const std::vector<std::string>& warnings() const { return warnings_; }
    const PartCounts& parts() const { return parts_; }
    /// The field of the last frame that wanted samples; may be null.
    const Field* field() const;
    /// What patch().samples would be by another field of the same poses. Throws
    /// Fault::Budget. \pre the last frame wanted samples
    std::vector<Eigen::Vector3d> samples_by(const FieldChoice& field) const;
    /// The maps of all commits and of the last frame that wanted samples, as a chain.
    /// \pre keeps_fields, and there was such a frame
    FieldFile field_file() const;
    /// What the session works on now: null before its first stage, and valid until the
    /// next one begins.
    const Rig* rig() const;
    /// Null unless every edge has exactly two, opposite faces.
    std::optional<Volume> volume() const;

private:
    struct StageState;

    void start_stage(std::size_t stage);
    void check_memory_of(const FieldChoice& field) const;
    void plan_frames(const std::vector<FrameStatement>& frames);
    void check_overlaps(const std::vector<Motion>& motions, std::int64_t line) const;
    struct FrameSolve;

    bool stands() const;
    void move_regions(double t);
    void solve_on(FrameSolve& frame, bool is_last);
    void travel(FrameSolve& frame, int& steps);
    bool takes(std::optional<Rig> (Recutting::*change)(const Rig&), FrameReport& report);
    void recut(FrameSolve& frame, FrameReport& report);
    void part_regions(FrameReport& report);
    void solve_frame(FrameReport& report);
    std::vector<MovedRegion> moved_regions() const;
    void move_samples(FrameReport& report);
    void commit();

    GeometryFile model_;
    HandleFile handles_;
    SessionSettings settings_;
    std::size_t stage_ = 0, frame_ = 0;
    Patch rest_;                             ///< of this stage
    std::vector<std::uint32_t> use_samples_; ///< of the direction uses
    Patch patch_;
    std::vector<FrameReport> reports_;
    std::vector<std::string> warnings_;
    PartCounts parts_;
    std::vector<StoredField> committed_fields_;
    std::unique_ptr<StageState> state_;
};

} // namespace cellwarp
