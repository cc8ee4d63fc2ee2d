// SPDX-License-Identifier: GPL-3.0-or-later
// Plays a text file of events through the same way as real ones, for tests, pictures and
// measurements.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "editor/window/editor.h"

namespace cellwarp::core
{

/// One line of the file that says something.
struct Statement
{
    std::int64_t line = 0;
    std::vector<std::string> words; ///< at least one
};

/// Reads a file and checks that every statement is known and has as many words as it
/// needs. Throws Fault::File, Fault::Malformed.
std::vector<Statement> read_statements(const std::string& path);

/// What one drag took, a value an event.
struct DragTimes
{
    std::int64_t line = 0;
    std::vector<FrameParts> frames;
    std::vector<double> solve_ms, blend_ms, latency_ms;
    std::uint64_t solved = 0;    ///< frames that the solver finished meanwhile
    FrameParts release;          ///< the frame that follows the release of the button
    double release_cpu_ms = 0.0; ///< of it, on all threads
};

/// How long a `wait` took from the last event or statement before it.
struct WaitTime
{
    std::int64_t line = 0;
    /// Until the finished shape was drawn; where drawing is slow, with coarse edges
    /// still.
    double shape_ms = 0.0;
    double ms = 0.0; ///< until the next drag could begin
};

struct PlaybackReport
{
    std::string model, renderer;
    int width = 0, height = 0;
    std::size_t samples = 0;
    std::vector<DragTimes> drags;
    std::vector<WaitTime> waits;
};

/// Does what the statements say, a frame for each event. Throws Error; what a line asks
/// for in vain is Fault::Malformed with that line.
PlaybackReport play(Editor& editor, const std::string& path,
                    const std::vector<Statement>& statements);

/// As JSON: medians, 95 % and worst of everything that was measured.
std::string report_text(const PlaybackReport& report);

/// What the statements are, for --help.
std::string statement_help();

} // namespace cellwarp::core
