// SPDX-License-Identifier: GPL-3.0-or-later
// A field moves places, and turns what has a direction at them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "library/session/work_frame.h"
#include "solver/field/field.h"

namespace cellwarp::core
{

/// Vectors, or rotations, each at one of the places.
template <class Vector>
struct AtPlaces
{
    std::span<const std::uint32_t> places;
    std::span<Vector> vectors;
};

/// Places and what hangs on them [model unit]: at rest before, carried afterwards.
struct Carried
{
    std::span<Eigen::Vector3d> places; ///< none: moved_places() does it
    AtPlaces<Eigen::Vector3d> normals = {}, tangents = {};
    AtPlaces<Eigen::Vector4d> rotations = {}; ///< quaternions w x y z

    bool has_directions() const
    {
        return !normals.vectors.empty() || !tangents.vectors.empty() ||
               !rotations.vectors.empty();
    }
};

/// Moves what is at places by what is known at each of them [work].
void carry(const WorkFrame& frame, std::span<const FieldValue> values,
           const Carried& carried);

/// \p work: the places in the field's own space; \p own: the cell that holds each. On all
/// threads; what a place becomes depends on it alone, to the bit. Returns the
/// displacements [work].
std::vector<Eigen::Vector3d> apply_field(const Field& field, const WorkFrame& frame,
                                         std::span<const Eigen::Vector3d> work,
                                         std::span<const int> own,
                                         const Carried& carried);

/// Places at rest [model unit] moved by displacements [work], in the memory of these.
std::vector<Eigen::Vector3d> moved_places(const WorkFrame& frame,
                                          std::span<const Eigen::Vector3d> rest,
                                          std::vector<Eigen::Vector3d> displacements);

} // namespace cellwarp::core
