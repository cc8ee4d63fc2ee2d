// SPDX-License-Identifier: GPL-3.0-or-later
// A saved deformation applied to files of any size, one or many. No printing.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "io/base/error.h"
#include "io/formats/stream.h"
#include "library/session/deformation.h"

namespace cellwarp::core
{

struct ApplySettings
{
    std::string format; ///< empty: as the input's extension says
    ReadOptions read;
    Overwrite overwrite = Overwrite::No;
    int threads = 0; ///< of all loops, 0: as many as there are cores; for memory only
    int jobs = 1;    ///< files at once
    /// [byte] that may be taken beyond the deformation, 0: no limit. Parts become fewer
    /// and smaller, as far as that goes; changes no result.
    double max_memory = 0.0;
    bool resumes = false;    ///< leaves out what the manifest says is done
    bool fails_fast = false; ///< the first failure ends the batch
    std::stop_token stop = {};
    /// Told the share that is done, in [0, 1], and the file; by any thread, one at a
    /// time.
    std::function<void(double done, const std::string& input)> watch = {};
};

/// Moves one file; the output is added to \p outputs, for the caller to commit unless the
/// stream was stopped. Throws as stream_geometry() does, and Fault::Budget where even the
/// fewest and smallest parts are over the budget.
StreamReport apply_to_file(const Deformation& deformation, const std::string& input,
                           const std::string& output, OutputSet& outputs,
                           const ApplySettings& settings);

/// A file of a batch.
struct BatchFile
{
    std::string input, output;
};

enum class FileStatus
{
    Done,
    Skipped, ///< the manifest says that it is done
    Failed,
    Stopped, ///< midway, on request or because another one failed
    Left     ///< likewise, and not begun
};

struct FileReport
{
    FileStatus status = FileStatus::Left;
    StreamReport stream;
    double seconds = 0.0;
    std::optional<Error> error; ///< of the failure
};

/// Moves every file and keeps a manifest: one line when a file is begun and one when it
/// has ended, with tabs between its columns, appended at once: input, status (started,
/// done or failed), samples, seconds, bytes of the output, bytes of the input, time of
/// the input's last change [ns], checksum of the field, message. Of one input the last
/// line counts; a last line without its end was torn and does not.
/// One that cannot be read or written fails alone. Throws Fault::File, before any work,
/// if an output cannot be written (one that a resumed manifest names is replaced), or if
/// the manifest cannot; Fault::Budget as apply_to_file() does.
std::vector<FileReport> apply_to_batch(const Deformation& deformation,
                                       const std::vector<BatchFile>& files,
                                       const std::string& manifest,
                                       const ApplySettings& settings);

} // namespace cellwarp::core
