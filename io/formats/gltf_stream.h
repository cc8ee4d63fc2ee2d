// SPDX-License-Identifier: GPL-3.0-or-later
// A glTF from disk to disk: its JSON is read whole, the numbers of its buffers in ranges.
#pragma once

#include <string>

#include "io/formats/stream.h"

namespace cellwarp::core
{

/// As stream_geometry(), for a file of \p format gltf or glb; what write_geometry() would
/// write beside \p output is written as well. Throws Fault::Usage for stdin, and for a
/// JSON (with the buffers inside it) that is too large to be in memory; Fault::Malformed
/// for a file that cannot be written, also where nothing would move.
StreamReport stream_gltf(const std::string& input, const std::string& output,
                         const std::string& format, OutputSet& outputs,
                         const StreamOptions& options, const StreamWork& work);

} // namespace cellwarp::core
