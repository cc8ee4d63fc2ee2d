// SPDX-License-Identifier: GPL-3.0-or-later
// The one writer of numbers: a copy of bytes with those replaced that changed.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// What one part of a file ends with, in its order.
struct PartPatch
{
    std::span<const Eigen::Vector3d> samples; ///< as many as the part's geometry has
    std::span<const Eigen::Vector3d> directions, tangents; ///< likewise
    std::span<const Eigen::Vector4d> rotations;            ///< likewise
    std::span<const IndexEdit> indices;                    ///< of an OBJ; ascending
};

/// Bytes with numbers in them that change. Whole files and parts alike are written by it.
/// What it is made of is the caller's and stays where it is.
class PatchedBytes
{
public:
    /// \p bytes start at byte \p start of the file \p path and hold \p geometry.
    PatchedBytes(const std::string& path, std::string_view bytes, std::uint64_t start,
                 const Geometry& geometry, const PartPatch& patch);

    /// Appends all of them. Throws as patched() does.
    void append_to(std::string& out) const;

    /// [byte] of the file: where to part it into ranges of about \p length (> 0) so that
    /// no number is cut, from its beginning to where the last number ends.
    std::vector<std::uint64_t> cuts(std::uint64_t length) const;
    /// Appends what stands from one of cuts() up to another. Throws as patched() does.
    void append_to(std::string& out, std::uint64_t from, std::uint64_t to) const;
    /// What stands behind the last number.
    std::string_view tail() const { return bytes_.substr(end_ - start_); }

private:
    std::size_t index_at(std::uint64_t byte) const;

    const std::string& path_;
    std::string_view bytes_;
    std::uint64_t start_ = 0;
    const Geometry& geometry_;
    PartPatch patch_;
    std::uint64_t end_ = 0; ///< [byte] behind the last number
};

} // namespace cellwarp::core
