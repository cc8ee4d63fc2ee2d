// SPDX-License-Identifier: GPL-3.0-or-later
// The one writer of numbers: a copy of bytes with those replaced that changed.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include <Eigen/Core>

#include "io/geometry.h"

namespace cellwarp
{

/// What one part of a file ends with, in its order.
struct PartPatch
{
    std::span<const Eigen::Vector3d> samples; ///< as many as the part's geometry has
    std::span<const Eigen::Vector3d> directions, tangents; ///< likewise
    std::span<const Eigen::Vector4d> rotations;            ///< likewise
    std::span<const std::uint64_t> index_starts; ///< [byte] of OBJ indices to replace
    std::span<const std::uint32_t> new_indices;  ///< 1-based
};

/// Appends \p bytes, which start at byte \p start of the file \p path and hold
/// \p geometry, with \p patch in place. Whole files and parts alike are written here.
/// Throws as patched() does.
void append_patched(const std::string& path, std::string_view bytes, std::uint64_t start,
                    const Geometry& geometry, const PartPatch& patch, std::string& out);

} // namespace cellwarp
