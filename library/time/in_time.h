// SPDX-License-Identifier: GPL-3.0-or-later
// A scene in time, frame by frame: rods with what they carry, flesh that follows a
// skeleton, or both. Each kind has a file of its own.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"
#include "library/session/body.h"
#include "library/session/deformation.h"
#include "library/session/json.h"
#include "library/session/session_settings.h"
#include "library/session/skeleton_handle.h"

namespace cellwarp::core
{

/// The shapes of a scene in time at one moment, in one unit.
struct FilmFrame
{
    std::vector<Geometry> parts;
    std::vector<PosedJoint> joints; ///< of a skeleton
    /// Cells of a lattice: corner k is at the upper end of axis a if bit a of k is set.
    std::vector<std::array<Eigen::Vector3d, 8>> cells;
};

class InTime
{
public:
    /// How rods are written.
    struct Drawing
    {
        bool writes_lines = false;
        int around = 12; ///< corners of a tube
    };
    /// What a frame is told of.
    struct Told
    {
        Json json;
        std::vector<std::string> problems; ///< what did not converge
    };

    virtual ~InTime() = default;

    /// So far.
    virtual std::vector<std::string> warnings() const = 0;
    virtual bool is_static() const = 0;
    /// An equilibrium is frame 0; of all else the first is 0.
    virtual std::int64_t last_frame() const = 0;
    virtual double time_of(std::int64_t frame) const = 0; ///< [s]
    virtual std::int64_t num_steps() const = 0;
    virtual std::int64_t steps_done() const = 0;
    /// Goes on by one; \p wants_samples: of the model; \p watch: after each step.
    virtual void next_frame(const std::function<void()>& watch, bool wants_samples) = 0;
    /// What went on since the last call; without \p wants_json only its problems.
    virtual Told tell(std::int64_t frame, bool wants_json) = 0;
    /// What is told of the whole, behind the frames.
    virtual void add_to(Json& json) const = 0;

    /// Null: there is none. Its samples are those that were wanted last.
    virtual std::shared_ptr<const GeometryFile> model() const = 0;
    virtual const DeformedSamples& deformed() const = 0;
    /// Rods as a file of this name; nothing: the scene has none. \p unit: of the file
    /// [m].
    virtual std::optional<std::string> bytes_of_rods(const std::string& name, double unit,
                                                     const Drawing& drawing) const = 0;
    virtual double unit() const = 0; ///< of the model [m]

    /// What a picture shows of now.
    virtual FilmFrame seen(int around) const = 0;
};

struct InTimeOptions
{
    bool is_tight = false;
    std::function<void(const FrameProgress&)> watch = {}; ///< on the way of cells
};

/// Nothing for models and for scenes of edits.
std::unique_ptr<InTime> open_in_time(const SceneFile& scene,
                                     const InTimeOptions& options = {});

/// Rods: rods_in_time.cpp.
std::unique_ptr<InTime> open_rods_in_time(const SceneFile& scene,
                                          const InTimeOptions& options);
/// Lists of the parts of a scene of rods in time, and its duration; null for others.
Json scene_in_time(const SceneFile& scene);
/// Flesh: flesh_in_time.cpp.
std::unique_ptr<InTime> open_flesh_in_time(const SceneFile& scene,
                                           const InTimeOptions& options);
/// Both: joined_in_time.cpp.
std::unique_ptr<InTime> open_joined_in_time(const SceneFile& scene,
                                            const InTimeOptions& options);

/// Facts of rods in time for `check`.
struct RodFacts
{
    Json rods; ///< an object each
    std::int64_t num_frames = 0, num_steps = 0;
    std::string text; ///< "2 rods, 1 sheet, 61 frames, 600 steps"
    std::vector<std::string> warnings;
    /// No edit is beside them: the model, if there is one, is theirs.
    bool are_all = false;
};
/// Nothing for scenes without rods in time.
std::optional<RodFacts> facts_of_rods(const SceneFile& scene);

/// Facts of flesh for `check`.
struct FleshFacts
{
    Json json;
    std::string text;
    std::vector<std::string> warnings;
};
/// Nothing for scenes without flesh.
std::optional<FleshFacts> facts_of_flesh(const SceneFile& scene,
                                         const HandleFile& handles,
                                         const Geometry& geometry,
                                         const CellSettings& cells);

} // namespace cellwarp::core
