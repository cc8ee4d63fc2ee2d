// SPDX-License-Identifier: GPL-3.0-or-later
// A model with a skeleton and weights as one file for engines: a skinned glTF.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "io/formats/geometry.h"
#include "io/scene/skeleton_file.h"

namespace cellwarp::core
{

/// Up to four joints that carry a sample: their numbers, and shares that sum to 1.
struct SkinShares
{
    std::array<std::uint16_t, 4> joints{};
    std::array<float, 4> shares{};
};

/// The bytes of a .glb: a mesh with smooth normals, a node a joint at its place without a
/// turn, a skin, and the tracks of \p skeleton as an animation; keys go straight between
/// them. Texture coordinates and colours are left out. \p path names it. Throws
/// Fault::Usage for more than 65,535 joints or 4 GB, Fault::Malformed for what 32-bit
/// numbers cannot hold. \pre one of \p shares a sample
std::string skinned_glb(const std::string& path, const Geometry& geometry,
                        const SkeletonValues& skeleton,
                        const std::vector<SkinShares>& shares);

} // namespace cellwarp::core
