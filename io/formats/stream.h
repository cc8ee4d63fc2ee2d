// SPDX-License-Identifier: GPL-3.0-or-later
// A geometry file from disk to disk, its samples moved on the way: read, moved and
// written part by part, so that memory does not grow with the file.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/base/bytes.h"
#include "io/base/output_set.h"
#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// What moves of one part of a file: rest places and directions in, moved ones out.
struct PartMotion
{
    std::span<Eigen::Vector3d> samples; ///< [model unit]
    /// Normals; direction i belongs to sample direction_samples[i].
    std::span<const std::uint32_t> direction_samples;
    std::span<Eigen::Vector3d> directions;
    /// Likewise tangents, and rotations as quaternions w x y z.
    std::span<const std::uint32_t> tangent_samples = {};
    std::span<Eigen::Vector3d> tangents = {};
    std::span<const std::uint32_t> rotation_samples = {};
    std::span<Eigen::Vector4d> rotations = {};
    bool is_first = true; ///< false: these samples come again, or have come before
};

/// What the stream has others do.
struct StreamWork
{
    /// Moves a part; what becomes of a sample may depend on that sample alone. Called
    /// by several threads at once.
    std::function<void(const PartMotion&)> move;
    /// Calls job(i) for every i below \p count, on any threads. Jobs throw nothing.
    std::function<void(std::size_t count, const std::function<void(std::size_t)>& job)>
        run;
    /// Told the share that is done, in [0, 1]; 0 all the time for stdin. May be empty.
    std::function<void(double done)> progress;
    std::stop_token stop;
};

struct StreamOptions
{
    std::string format; ///< empty: as the input's extension says
    ReadOptions read;
    std::size_t part_bytes = std::size_t(1) << 19; ///< changes no result
    std::size_t parts_at_once = 4;                 ///< likewise
    /// Records of which a file larger than memory sorts at once; likewise.
    std::size_t sort_records = std::size_t(1) << 20;
    /// Memory that the JSON of a glTF may take, and a glTF that is read whole [byte]; 0:
    /// no limit.
    double max_whole_memory = 0.0;
};

struct StreamReport
{
    std::uint64_t samples = 0;
    std::uint64_t bytes = 0;   ///< of the output
    std::size_t num_split = 0; ///< OBJ normals, see patched()
    bool is_stopped = false;   ///< on request; there is no output then
    std::vector<std::string> warnings;
};

/// Writes to \p output what patched() gives for \p input with every sample moved, byte
/// by byte. "-" is stdin or stdout; stdin needs a format, and an OBJ whose faces use
/// normals cannot come from there, because it is read twice. Throws as read_geometry(),
/// patched() and AtomicFile do. The output and what stands beside it are added to
/// \p outputs, for the caller to commit unless the stream was stopped; what goes to
/// stdout is there at once.
StreamReport stream_geometry(const std::string& input, const std::string& output,
                             OutputSet& outputs, const StreamOptions& options,
                             const StreamWork& work);

} // namespace cellwarp::core
