// SPDX-License-Identifier: GPL-3.0-or-later
// What all subcommands of the command line share: settings, messages, progress.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "editor/cli/flag_script.h"
#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/formats/animation_file.h"
#include "io/scene/scene_file.h"
#include "library/session/json.h"
#include "library/session/session.h"
#include "library/session/session_request.h"
#include "library/time/in_time.h"
#include "octree/base/clock.h"

namespace cellwarp::core
{

/// Flags that every subcommand has.
struct CommonFlags
{
    int threads = 0;
    bool is_quiet = false;
    bool is_json = false;
    bool overwrites = false;

    Overwrite overwrite() const { return overwrites ? Overwrite::Yes : Overwrite::No; }
};

/// Flags about cells and solving, as given: what is left out falls to the scene,
/// then to the defaults of SessionSettings.
struct SessionFlags
{
    std::string model;
    std::string columns;
    std::string handles, sel, def;
    FlagScript script;
    SceneSettings settings;
    std::optional<double> time;
    std::optional<std::int64_t> max_iterations;
    std::optional<std::string> solver, max_memory;
    bool is_preview = false, is_tight = false;

    void add_to(CLI::App& app);
    bool has_session() const; ///< a scene, or a model with handles
};

/// A subcommand: its flags are added to the app, its run() gives the exit code.
void add_deform(CLI::App& app, CommonFlags& common, int& exit_code);
void add_apply(CLI::App& app, CommonFlags& common, int& exit_code);
void add_info(CLI::App& app, CommonFlags& common, int& exit_code);
void add_check(CLI::App& app, CommonFlags& common, int& exit_code);
void add_sweep(CLI::App& app, CommonFlags& common, int& exit_code);
void add_simulate(CLI::App& app, CommonFlags& common, int& exit_code);
/// Without an exit code: the editor's own takes its place.
void add_edit(CLI::App& app, CommonFlags& common);
/// The subcommands that this build has beyond those: editor/cli/features.cpp.
void add_features(CLI::App& app, CommonFlags& common, int& exit_code);

/// Draws states of one session side by side, from one viewpoint and at one scale.
struct Pictures
{
    /// The model with its samples at other places; also its cells as glass, where they
    /// are.
    std::function<void(const Session&, const std::vector<Eigen::Vector3d>& samples,
                       bool shows_cells)>
        add;
    std::function<std::string()> png; ///< a file's bytes
};
/// Nothing in a build without pictures: editor/cli/features.cpp.
std::optional<Pictures> make_pictures();

/// Exit code: some frame did not converge.
inline constexpr int kNotConverged = 7;

/// A scene in time.
struct Film
{
    std::int64_t last = 0; ///< number of its last frame; the first is 0
    /// What is seen of a frame, asked for in ascending order.
    std::function<FilmFrame(std::int64_t frame)> frame;
    /// Whether all that was asked for so far converged.
    std::function<bool()> is_converged;
    std::function<std::vector<std::string>()> warnings; ///< so far
};
/// Nothing for models and for scenes of edits.
std::optional<Film> film_of(const std::string& input);

/// Normals for AnimationFile: of a smooth surface in a .glb, else none. Keeps a reference
/// to \p geometry.
AnimationFile::NormalsOf normals_to_write(const std::string& output,
                                          const Geometry& geometry);

/// Reads the scene (if the model is one) and the handle file; flags win. Throws Error.
SessionRequest read_request(const SessionFlags& flags, ForTime for_time = ForTime::No);

/// Adds --max-memory.
void add_max_memory(CLI::App& app, std::optional<std::string>& max_memory);
/// What it says, or default_memory_limit() [byte]. Throws Fault::Usage.
double memory_limit(const std::optional<std::string>& max_memory);

/// Adds --columns.
void add_columns(CLI::App& app, std::string& columns);

/// Output of --json: one object, with the program's version before its own keys. Text
/// that is no UTF-8, as names of files may be, has marks in its place.
std::string json_text(const Json& json);

/// The keys of an error, null for what it does not know: "fault", "file", "line",
/// "field", "message".
Json error_json(const Error& error);
/// The same for an error without a place.
Json error_json(const std::string& fault, const std::string& message);

/// Throws Fault::Usage if the output is stdout, which --json needs.
void check_stdout(const std::string& output, const CommonFlags& common);

/// "warning: ..." on stderr, unless quiet.
void print_warnings(const std::vector<std::string>& warnings, const CommonFlags& common);

/// Onto stderr; that it cannot be written there is no failure.
void say(const std::string& text);

/// Draws a bar on stderr, only where that is a terminal and not quiet; at most ten times
/// a second.
class Progress
{
public:
    explicit Progress(const CommonFlags& common, std::size_t frames = 0);
    ~Progress();
    void show(const FrameProgress& now);
    /// The share that is done, in [0, 1], and what is under way.
    void show(double done, const std::string& what);
    /// Takes the bar away.
    void end();

private:
    bool is_shown_;
    std::size_t frames_;
    Clock::time_point last_ = {};
};

} // namespace cellwarp::core
