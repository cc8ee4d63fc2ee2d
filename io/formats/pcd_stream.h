// SPDX-License-Identifier: GPL-3.0-or-later
// A compressed PCD from disk to disk: its fields stand one after the other, so that it
// is unpacked into a temporary file, moved there, and packed again.
#pragma once

#include <string>

#include "io/formats/stream.h"

namespace cellwarp::core
{

/// As stream_geometry(), for a file that is_packed_pcd().
StreamReport stream_packed_pcd(const std::string& input, const std::string& output,
                               OutputSet& outputs, const StreamOptions& options,
                               const StreamWork& work);

} // namespace cellwarp::core
