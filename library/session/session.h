// SPDX-License-Identifier: GPL-3.0-or-later
// An edit session: a model, its cells, and the frames of a handle file, which may change
// under way. The result is a function of the files and settings alone. No window, no
// printing.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/field_file.h"
#include "io/formats/geometry.h"
#include "io/scene/handle_file.h"
#include "library/session/bone_regions.h"
#include "library/session/cell_refiner.h"
#include "library/session/cell_system.h"
#include "library/session/checkpoints.h"
#include "library/session/frame_plan.h"
#include "library/session/frame_report.h"
#include "library/session/rod_report.h"
#include "library/session/script_fingerprint.h"
#include "library/session/session_settings.h"
#include "solver/field/field.h"

namespace cellwarp::core
{

/// What parts were built, counted where they are built.
struct PartCounts
{
    int interior = 0, refinement = 0, blend = 0, rbf = 0, rbf_global = 0, normals = 0,
        faces = 0, rods = 0, skeleton = 0, contact = 0;
};

class Session
{
public:
    /// Builds the cells of the first stage and checks all of its statements against
    /// the model, so that what cannot be done fails before anything is. A later stage
    /// is checked when its commit has made its rest shape. Throws Error, and Stopped as
    /// all that takes long: where a StopScope (octree/base/stop_scope.h) asks for it.
    Session(Geometry geometry, HandleFile handles, SessionSettings settings);
    /// \p shape: what build_rest_shape() makes of the geometry with these settings, if it
    /// is there already; flat or not, another one is made where the other one is wanted.
    Session(std::shared_ptr<const Geometry> geometry, HandleFile handles,
            SessionSettings settings, std::shared_ptr<const RestShape> shape = nullptr);
    ~Session();
    Session(Session&&) noexcept;
    Session& operator=(Session&&) noexcept;

    /// Solves the next frame; false when there is none left. \p wants_samples: fit
    /// the field and move the samples (a commit does so in any case). Throws
    /// Fault::Unsolvable, Fault::Budget, Stopped, and of a commit what the constructor
    /// throws; the session is then as it was before the frame, but for field(), which is
    /// null. After Stopped system() is null as well until the next call: making its cells
    /// again takes time.
    bool next_frame(bool wants_samples);
    /// Where the next frame takes SessionSettings::led_rods, in their order; without it
    /// they stay. \pre one stage
    void lead(std::vector<std::shared_ptr<const SplineState>> rods);
    /// The number of the frame that next_frame() would solve.
    std::optional<std::int64_t> upcoming_frame() const;

    /// Has other statements from now on. What the same statements did stays done; where
    /// the old ones differ it goes back to a state before that. The rest is left for
    /// next_frame(), whose results are those of a new session with these statements, to
    /// the bit. With no frame left, the session stands in the last stage, its samples
    /// moved. Throws what the constructor throws; then system() is null, and there is no
    /// next frame, until another set_script(). \pre keeps_checkpoints
    void set_script(HandleFile handles);
    /// How many frames are left.
    std::size_t num_upcoming() const;

    /// At rest, before the first stage.
    const Geometry& geometry() const { return *geometry_; }
    /// The samples and directions after the last frame that wanted them.
    const DeformedSamples& deformed() const { return *deformed_; }
    /// The same, for whoever keeps them.
    std::shared_ptr<const DeformedSamples> shared_deformed() const { return deformed_; }
    /// Of the last frame alone where checkpoints are kept.
    const std::vector<FrameReport>& frames() const { return reports_; }
    const std::vector<std::string>& warnings() const { return warnings_; }
    const PartCounts& parts() const { return parts_; }
    /// Of this stage, in the order of their statements.
    std::vector<RodReport> rods() const;
    /// How the skeleton of this stage lies in the material; nothing: there is none.
    std::optional<SkeletonBinding> skeleton() const;
    /// Of the skeleton, where they are now.
    std::vector<PosedJoint> joints() const;
    /// The field of the last frame that wanted samples; may be null.
    const Field* field() const;
    /// What deformed().samples would be by another field of the same poses. Throws
    /// Fault::Budget. \pre the last frame wanted samples
    std::vector<Eigen::Vector3d> samples_by(const FieldChoice& field) const;
    /// The maps of all commits and of the last frame that wanted samples, as a chain.
    /// \pre keeps_fields, and field()
    FieldFile field_file() const;
    /// At rest in this stage [model unit]. \pre system()
    const std::vector<Eigen::Vector3d>& rest_samples() const
    {
        return rest_->samples.samples;
    }
    /// ScriptFingerprint::before() of this stage. \pre system()
    std::uint64_t stage_fingerprint() const { return rest_->fingerprint; }
    /// Where the glue between each region of this stage and free material is at rest, by
    /// its name: what 'about border' turns about [model unit]. \pre system()
    std::map<std::string, Eigen::Vector3d> borders() const;
    /// Makes other cells of the system. \pre system()
    CellRefiner refiner() const;
    /// What the session works on now: null before its first stage, and valid until the
    /// next one begins.
    const CellSystem* system() const;

private:
    struct StageState;

    CellSystemSettings system_settings() const;
    std::shared_ptr<const StageRest>
    make_rest(std::size_t stage, DeformedSamples samples,
              std::vector<std::shared_ptr<const StoredField>> fields = {});
    bool is_to_be_flat(const StageRest& rest) const;
    /// Whether it is flat as it is to be.
    bool fits(const StageRest& rest) const;
    /// Of this stage; they keep its rest.
    std::shared_ptr<const DeformedSamples> samples_at_rest() const;
    void start_stage(std::shared_ptr<const StageRest> rest);
    void warn_of_bones();
    Checkpoint checkpoint() const;
    void leave_for(const Checkpoint& to);
    void make_state(const Checkpoint& at);
    void go_to(const Checkpoint& kept);
    void go_back();
    void add_checkpoint();
    void commit();
    void commit_to_end();
    void check_memory_of(const FieldChoice& field) const;
    FramePlan plan(const FrameStatement& frame,
                   std::span<const std::shared_ptr<const SplineState>> led,
                   StageAims& aims, std::vector<std::string>& warnings) const;
    void check_frames();
    void solve_frame(FrameReport& report);
    std::vector<MovedRegion> moved_regions() const;
    void solve_next(bool wants_samples, double cells_ms);
    void end_frame(FrameReport& report, bool wants_samples);
    void make_field();
    void move_samples(FrameReport& report);
    void update_samples();

    std::shared_ptr<const Geometry> geometry_;
    std::shared_ptr<const RestShape> first_shape_; ///< given, until it is in a stage
    HandleFile handles_;
    SessionSettings settings_;
    ScriptFingerprint script_; ///< of the handles
    std::size_t stage_ = 0, frame_ = 0;
    std::vector<std::uint32_t> use_samples_;                  ///< of the direction uses
    std::shared_ptr<const StageRest> rest_;                   ///< of this stage
    std::shared_ptr<const StageRest> first_rest_, last_rest_; ///< to start stages from
    /// Where nothing has moved yet, those at rest in this stage.
    std::shared_ptr<const DeformedSamples> deformed_;
    bool is_deformed_current_ = true; ///< of the last frame
    std::vector<FrameReport> reports_;
    std::size_t frames_done_ = 0;
    std::vector<std::shared_ptr<const SplineState>> led_; ///< by the next frame
    Checkpoints checkpoints_;
    std::vector<std::string> warnings_;
    PartCounts parts_;
    std::unique_ptr<RbfSystems> rbf_systems_; ///< of this stage's fits
    std::unique_ptr<StageState> state_;
    std::unique_ptr<const Checkpoint> stopped_; ///< where to go on after Stopped
};

} // namespace cellwarp::core
