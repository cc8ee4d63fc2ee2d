// SPDX-License-Identifier: GPL-3.0-or-later
// Writing a glTF whose moved numbers have no place of their own in it: they are
// compressed, stored as integers or sparse, or several nodes share them. Such numbers go
// into new accessors, a moved instance gets a mesh of its own, and data that were
// compressed stand there uncompressed. The JSON is written anew with all else that it
// says.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "io/formats/geometry.h"
#include "io/formats/gltf.h"

namespace cellwarp::core
{

/// All numbers of a run's accessor after a move, as floats.
struct MovedRun
{
    std::size_t part = 0; ///< of the layout
    GltfLayout::Run run;
    std::string numbers;
};

/// \p body: Geometry::unpacked with what has been patched there, whose \p bounds have
/// changed. \p moved: by parts. Names as for patched_gltf(). Throws Fault::Malformed for
/// a file without any buffer that could take new numbers.
PatchedGltf rebuilt_gltf(const GeometryFile& file, std::string body,
                         const std::vector<GltfBounds>& bounds,
                         const std::vector<MovedRun>& moved, const std::string& output);

} // namespace cellwarp::core
