// SPDX-License-Identifier: GPL-3.0-or-later
// States of a session that it can go back to: the newest ones, and ever fewer of the
// older.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/formats/field_file.h"
#include "io/formats/geometry.h"
#include "library/session/bone_regions.h"
#include "library/session/cell_refiner.h"
#include "library/session/cell_system.h"
#include "library/session/default_plane.h"
#include "library/session/frame_plan.h"
#include "library/session/frame_report.h"
#include "library/session/script_fingerprint.h"

namespace cellwarp::core
{

/// What a stage starts from.
struct StageRest
{
    std::size_t stage = 0;
    std::uint64_t fingerprint = 0; ///< of all statements before the stage
    DeformedSamples samples;       ///< at rest [model unit]
    std::shared_ptr<const RestShape> shape;
    std::optional<DefaultPlane> plane = {}; ///< that it may be kept in without being told
    /// Maps of the commits before it, where they are kept.
    std::vector<std::shared_ptr<const StoredField>> fields = {};
};

/// A stage before its first frame.
struct StageStart
{
    std::shared_ptr<const StageRest> rest;
    std::shared_ptr<const RegionSet> regions;
    Units units;
    CellRefiner refiner; ///< that has made its first cells
    /// CellSystem::region_borders() of the first cells: what moves mean does not change
    /// with refinement.
    std::vector<Eigen::Vector3d> borders = {};
    SkeletonBinding binding = {}; ///< of its skeleton, if it has one
};

/// The end of a frame, from which the next one follows to the bit.
struct Checkpoint
{
    std::uint64_t fingerprint = 0; ///< of all statements so far
    ScriptPlace place;
    std::shared_ptr<const StageStart> start;
    Octree octree;
    CellSystemState system;
    StageAims aims;
    SolveReport last_solve;
    std::optional<FrameReport> report; ///< none before the first frame
    std::vector<std::string> warnings;
    std::size_t frames_done = 0;
    /// The cells of the octree; null: they are cut anew, which takes time but no memory.
    std::shared_ptr<const Body> body = nullptr;
};

/// At most kMostCheckpoints, and of no more memory than \p most_bytes but for the newest
/// two: with all that they hold, once where several of them share it.
class Checkpoints
{
public:
    explicit Checkpoints(std::size_t most_bytes = std::size_t(256) << 20)
        : most_bytes_(most_bytes)
    {
    }

    void add(Checkpoint state);
    /// The latest that \p script passes through; null: none.
    const Checkpoint* latest_on(const ScriptFingerprint& script) const;
    std::size_t size() const { return states_.size(); }
    /// Of all of them, about [byte].
    std::size_t bytes() const;

private:
    void thin();

    std::size_t most_bytes_;
    std::vector<Checkpoint> states_; ///< in the order of their places
};

} // namespace cellwarp::core
