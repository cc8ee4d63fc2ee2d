// SPDX-License-Identifier: GPL-3.0-or-later
// The thread that solves what the document asks for, always the newest, as a replay of
// its file would: to the same bits.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/scene/scene_file.h"
#include "library/session/prepared_drag.h"
#include "library/session/session.h"
#include "library/session/shape.h"

namespace cellwarp::core
{

/// The figures of a result.
struct ResultFigures
{
    std::optional<FrameReport> report; ///< of the last frame
    std::size_t cells = 0, free_cells = 0, centres = 0, clusters = 0;
    std::vector<int> cells_per_depth;
    int across = 0;
    double energy = 0.0, max_gap = 0.0;
    double diagonal = 0.0; ///< [model unit]
    std::string inside;    ///< how the inside was found
};

/// What the solve thread is doing, and what it did last.
struct SolveStatus : ResultFigures
{
    enum class State
    {
        Idle,      ///< nothing is asked for, and the last result was taken
        Preparing, ///< material, cells
        Solving,
        Field, ///< release field
        Failed ///< see error
    };
    State state = State::Idle;
    FrameProgress progress;        ///< while Solving
    std::size_t frames_to_do = 0;  ///< of this request; progress counts from
    std::size_t frames_before = 0; ///< those done before it
    double seconds = 0.0;          ///< since it began, or what it took
    std::string error;             ///< in words; of the last attempt
    std::string error_region;      ///< that it concerns, if it is one
    std::vector<std::string> warnings;
    /// Energy against seconds of the last solve.
    std::vector<std::pair<double, double>> energy_curve;
};

/// What is to be solved.
struct SolveRequest
{
    std::uint64_t revision = 0;
    HandleFile handles;
    SceneFile scene; ///< settings
    std::shared_ptr<const ShapeLayout> layout;
    bool is_for_drag = false; ///< of what comes out the drag alone is wanted
};

/// What came out.
struct Solved
{
    std::uint64_t revision = 0;
    bool is_for_drag = false; ///< as it was asked for
    std::shared_ptr<const DeformedSamples> patch;
    ShownShape shape;
    ShownCells cells;
    ResultFigures figures;
    std::shared_ptr<const std::vector<Eigen::Vector3d>> rest; ///< of the last stage
    std::uint64_t stage_fingerprint = 0;
    std::map<std::string, Eigen::Vector3d> borders; ///< Session::borders()
    /// Of the last stage; nothing where no region can be moved.
    std::optional<DragSource> drag;
};

class SolveWorker
{
public:
    SolveWorker(std::shared_ptr<const GeometryFile> model, const WorkFrame& view);
    /// Stops the solve as soon as the call in flight allows.
    ~SolveWorker();
    SolveWorker(const SolveWorker&) = delete;
    SolveWorker& operator=(const SolveWorker&) = delete;

    /// Instead of what was asked for before. A solve under way goes on where the new
    /// request begins with it, and is given up otherwise.
    void ask(SolveRequest request);
    /// Gives up what is under way; the request counts as failed.
    void cancel();
    /// The newest result, once.
    std::optional<Solved> take();
    SolveStatus status() const;
    /// Whether something is asked for that has neither been solved nor failed.
    bool is_busy() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
