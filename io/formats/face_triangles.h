// SPDX-License-Identifier: GPL-3.0-or-later
// The triangles of faces that have more than three corners: the one way to cut them, for
// material, intersections, volumes, pictures and the files that hold triangles alone.
// How a face is cut depends on the places of its corners at rest, not on their numbers
// nor on which of them comes first.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Cuts the faces of a geometry into triangles, which go round as their faces do: n - 2
/// of a face of n corners. They cover a flat face that does not cross itself, concave or
/// not, and nothing else; some have no area where corners coincide or lie in a line. A
/// face that crosses itself, seen along its mean normal, is covered in part or more than
/// once (face_triangles.cpp). Takes O(n log n) for usual faces. Coordinates that are not
/// finite leave the cut of their face unspecified.
class FaceCutter
{
public:
    using Triangle = std::array<std::uint32_t, 3>;

    /// \p geometry must outlive this.
    explicit FaceCutter(const Geometry& geometry);
    explicit FaceCutter(Geometry&&) = delete;
    ~FaceCutter();

    /// The triangles of one face, until the next call.
    std::span<const Triangle> triangles(std::size_t face)
    {
        const std::span<const std::uint32_t> corners = geometry_.face(face);
        if (corners.size() != 3)
            return cut(corners);
        single_ = {corners[0], corners[1], corners[2]};
        return {&single_, 1};
    }

private:
    class Polygon;

    std::span<const Triangle> cut(std::span<const std::uint32_t> corners);

    const Geometry& geometry_;
    Triangle single_{};
    std::vector<Triangle> several_;
    std::unique_ptr<Polygon> polygon_; ///< of the last face that needed it; keeps memory
};

/// The triangles of all faces, face by face.
std::vector<FaceCutter::Triangle> triangles_of(const Geometry& geometry);

} // namespace cellwarp::core
