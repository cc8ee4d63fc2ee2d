// SPDX-License-Identifier: GPL-3.0-or-later
// A deformation apart from the session that made it: a map of space for any points.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include <cellwarp/control.h>
#include <cellwarp/deform.h>
#include <cellwarp/export.h>
#include <cellwarp/points.h>

namespace cellwarp
{

/// Directions at places, in their order: one for each place, or none.
struct Directions
{
    PointsSpan normals = {}, tangents = {}; ///< they turn and keep their lengths
    QuaternionsSpan rotations = {};         ///< they turn with the material
};

/// Cheap to copy, never changes; any number of threads may use one.
class CELLWARP_API Field
{
public:
    /// A .cwf file, or its bytes. Throws Fault::File, Fault::Malformed, and Fault::Budget
    /// if it would take more than \p max_memory [byte] (0: no limit).
    static Field read(const std::string& path, double max_memory = 0.0);
    static Field parse(std::string_view bytes, double max_memory = 0.0);
    std::string bytes() const; ///< of a .cwf file
    void write(const std::string& path, Overwrite overwrite = Overwrite::No) const;

    /// Moves places in the caller's memory [model unit]. The result at a place depends on
    /// the place and the field alone, to the bit, so arrays may be cut anywhere; a sample
    /// of the session's model (as double) gets its place in the session's result. Places
    /// and directions that are not finite stay; their number is returned. \p threads: 0:
    /// all. Throws Fault::Usage for arrays of different lengths, Fault::Stopped; some
    /// places have then moved.
    std::size_t apply(PointsSpan places, const Directions& directions = {},
                      const Control& control = {}, int threads = 0) const;
    /// The same from one array to another.
    std::size_t apply_to(PointsSpan to, PointsView from, const Control& control = {},
                         int threads = 0) const;

    std::size_t num_maps() const; ///< one for each commit, and the last
    /// Number of places farther outside the model's box than a twentieth of its diagonal:
    /// there the nearest material leads, however far it is.
    std::uint64_t num_outside(PointsView places) const;

private:
    friend struct Access;
    struct Data;
    explicit Field(std::shared_ptr<const Data> data);
    std::shared_ptr<const Data> data_;
};

} // namespace cellwarp
