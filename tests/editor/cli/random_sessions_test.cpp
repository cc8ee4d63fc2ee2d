// SPDX-License-Identifier: GPL-3.0-or-later
// Small scenes in this process, dozens in a second: what holds of every session holds of
// each of them, and another run, on other threads, gives the same bits. As many as
// CELLWARP_SMALL_SCENES says; the files of a scene that failed are kept, and named.
#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <string>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "editor/cli/session_flags.h"
#include "io/base/error.h"
#include "io/formats/geometry_file.h"
#include "library/session/session.h"
#include "octree/base/parallel.h"
#include "tests/support/files.h"
#include "tests/support/random_scene.h"
#include "tests/support/sanitized.h"

namespace cellwarp::core
{

namespace
{

using support::RandomScene;

constexpr std::uint32_t kShards = 16;

/// That failed once: samples at corners of another region's cells went with that one.
constexpr std::uint32_t kKept[] = {4302, 4303, 4319, 5256, 5625,
                                   5636, 7078, 7140, 9381, 9755};

/// What rounding makes of R^T R, and of an energy that should not rise.
constexpr double kRounding = 1e-9;

/// How one session went.
struct Outcome
{
    std::string error; ///< its fault and message; empty: it came to its end
    std::vector<Eigen::Vector3d> samples;
    std::vector<Pose> poses;
    std::vector<std::string> warnings;
    std::vector<FrameReport> frames;
    std::string fault; ///< what must never be; empty: nothing

    bool is_converged() const
    {
        return error.empty() &&
               std::all_of(frames.begin(), frames.end(),
                           [](const FrameReport& frame)
                           { return frame.solve.stop == Stop::Converged; });
    }
};

std::string fault_of(const CellSystem& system)
{
    for (const Pose& pose : system.poses())
    {
        if (!pose.R.allFinite() || !pose.p.allFinite())
            return "cells nowhere";
        if ((pose.R.transpose() * pose.R - Eigen::Matrix3d::Identity()).norm() >
                kRounding ||
            pose.R.determinant() < 0.0)
            return "a cell that is not turned but bent";
    }
    return "";
}

std::string fault_of(const FrameReport& frame)
{
    const SolveReport& solve = frame.solve;
    if (!std::isfinite(solve.energy_after) || solve.energy_after < 0.0)
        return "no energy";
    if (frame.largest_rise > kRounding)
        return "a step to a higher energy";
    if (solve.stop != Stop::Converged)
        return "";
    if (frame.handle_residual > kRounding)
        return "a solution that leaves samples behind";
    // Smaller cells may have more.
    if (frame.refinements == 0 &&
        solve.energy_after > (1.0 + 1e-7) * solve.energy_before + 1e-30)
        return "a solution of a higher energy";
    return "";
}

Outcome play(const SessionFlags& flags, int threads)
{
    const ThreadLimit limit(threads);
    Outcome outcome;
    try
    {
        SessionRequest request = read_request(flags);
        Session session(read_geometry(request.scene.model, request.read).geometry,
                        std::move(*request.handles), request.settings);
        while (outcome.fault.empty() && session.next_frame(true))
            outcome.fault = fault_of(*session.system());
        outcome.samples = session.deformed().samples;
        outcome.poses = session.system()->poses();
        outcome.warnings = session.warnings();
        outcome.frames = session.frames();
        for (const FrameReport& frame : outcome.frames)
            if (outcome.fault.empty())
                outcome.fault = fault_of(frame);
    }
    catch (const Error& error)
    {
        outcome.error =
            std::to_string(static_cast<int>(error.fault())) + " " + error.what();
        if (error.fault() == Fault::Usage || error.fault() == Fault::File)
            outcome.fault = "files and flags that are not understood";
    }
    catch (const std::exception& error)
    {
        outcome.fault = std::string("no documented error: ") + error.what();
    }
    return outcome;
}

bool same_bits(const Eigen::Vector3d& a, const Eigen::Vector3d& b)
{
    for (int k = 0; k < 3; ++k)
        if (std::bit_cast<std::uint64_t>(a[k]) != std::bit_cast<std::uint64_t>(b[k]))
            return false;
    return true;
}

std::string difference(const Outcome& a, const Outcome& b)
{
    if (a.error != b.error)
        return "another run ends otherwise";
    if (a.warnings != b.warnings || a.frames.size() != b.frames.size() ||
        a.samples.size() != b.samples.size() || a.poses.size() != b.poses.size())
        return "another run goes otherwise";
    for (std::size_t f = 0; f < a.frames.size(); ++f)
        if (a.frames[f].solve.iterations != b.frames[f].solve.iterations ||
            a.frames[f].solve.energy_after != b.frames[f].solve.energy_after)
            return "another run takes another way";
    for (std::size_t i = 0; i < a.samples.size(); ++i)
        if (!same_bits(a.samples[i], b.samples[i]))
            return "another run moves samples otherwise";
    for (std::size_t c = 0; c < a.poses.size(); ++c)
        if (!same_bits(a.poses[c].p, b.poses[c].p) ||
            !same_bits(a.poses[c].R.col(0), b.poses[c].R.col(0)) ||
            !same_bits(a.poses[c].R.col(1), b.poses[c].R.col(1)))
            return "another run moves cells otherwise";
    return "";
}

void play_scene(std::uint32_t seed, std::map<std::string, int>& ends)
{
    const RandomScene scene = support::small_random_scene(seed);
    const support::Folder folder;
    SessionFlags flags;
    CLI::App app;
    flags.add_to(app);
    int threads = 0; // the program's own flag; here each run has its own
    app.add_option("--threads", threads);
    std::vector<std::string> arguments = scene.arguments;
    arguments.insert(arguments.end(),
                     {folder.write(scene.model_name, scene.model_text), "--handles",
                      folder.write("scene.handles", scene.handles_text)});
    std::reverse(arguments.begin(), arguments.end()); // as the parser takes them
    app.parse(arguments);

    const Outcome outcome = play(flags, 1);
    ++ends[!outcome.error.empty()   ? "error_" + outcome.error.substr(0, 1)
           : outcome.is_converged() ? "converged"
                                    : "not_converged"];
    std::string fault = outcome.fault;
    if (fault.empty() && outcome.error.empty())
        fault = support::fault_of_samples(scene, outcome.samples);
    if (fault.empty() && outcome.error.find("finite numbers") != std::string::npos)
        fault = "a scene of finite numbers has no solution in them";
    if (fault.empty())
        fault = difference(outcome, play(flags, 2));
    EXPECT_EQ(fault, "") << "seed " << seed << ", files in "
                         << (fault.empty() ? "" : support::kept_copy(folder, seed))
                         << "\n"
                         << scene.describe() << outcome.error;
}

class RandomSessions : public testing::TestWithParam<std::uint32_t>
{
};

TEST_P(RandomSessions, KeepWhatHoldsOfAll)
{
    std::map<std::string, int> ends;
    const std::uint32_t count = support::number_of_scenes(
        "CELLWARP_SMALL_SCENES", support::kIsSanitized ? 64 : 480);
    for (std::uint32_t seed = GetParam(); seed < count; seed += kShards)
        play_scene(seed, ends);
    for (const std::uint32_t seed : kKept)
        if (seed % kShards == GetParam())
            play_scene(seed, ends);
    if (count > 10 * kShards)
    {
        EXPECT_GT(ends["converged"], 0);
    }
    for (const auto& [end, count_of_end] : ends)
        RecordProperty(end, std::to_string(count_of_end));
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomSessions, testing::Range(0u, kShards));

} // namespace

} // namespace cellwarp::core
