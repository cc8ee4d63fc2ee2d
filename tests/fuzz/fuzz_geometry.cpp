// SPDX-License-Identifier: GPL-3.0-or-later
// A geometry reader on arbitrary bytes: it accepts or refuses, and what it accepts is
// finite, in range, and comes back byte for byte. CELLWARP_FUZZ_NAME tells the format.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "io/base/error.h"
#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"

using namespace cellwarp::core;

namespace
{

void require(bool condition)
{
    if (!condition)
        std::abort();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    try
    {
        const GeometryFile file = scan_geometry(
            CELLWARP_FUZZ_NAME, std::string(reinterpret_cast<const char*>(data), size));
        const Geometry& geometry = file.geometry;
        require(!geometry.samples.empty());
        for (const Eigen::Vector3d& x : geometry.samples)
            require(x.allFinite());
        for (const std::uint32_t corner : geometry.corners)
            require(corner < geometry.samples.size());
        DeformedSamples patch{geometry.samples, {}};
        for (const DirectionUse& use : direction_uses(geometry))
            patch.directions.push_back(geometry.directions[use.direction]);
        require(patched(file, patch) == file.bytes);
        // Moved, it must read back as what was written.
        for (Eigen::Vector3d& x : patch.samples)
            x = Eigen::Vector3d(x.y(), 0.5, x.x());
        const GeometryFile again =
            scan_geometry(CELLWARP_FUZZ_NAME, patched(file, patch));
        require(again.geometry.samples.size() == geometry.samples.size());
        require(again.geometry.corners == geometry.corners);
    }
    catch (const Error&)
    {
    }
    return 0;
}
