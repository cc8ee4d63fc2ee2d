// SPDX-License-Identifier: GPL-3.0-or-later
// A saved deformation: a map of space that moves any data of the same space.
#pragma once

#include <cstdint>
#include <span>
#include <stop_token>
#include <string>

#include <Eigen/Core>

namespace cellwarp
{

class Deformation
{
public:
    /// Throws Fault::File or Fault::Malformed.
    explicit Deformation(const std::string& field_path);

    /// Directions hang on points. Rest in, moved out.
    struct Directions
    {
        std::span<const std::uint32_t> points;
        std::span<Eigen::Vector3d> vectors;
    };
    /// Unit quaternions w x y z.
    struct Rotations
    {
        std::span<const std::uint32_t> points;
        std::span<Eigen::Vector4d> quaternions;
    };

    /// Moves places [model unit] on all threads; each result depends on its point alone,
    /// to the bit. Returns early, with undefined results, when a stop is requested.
    void move(std::span<Eigen::Vector3d> places, Directions normals, Directions tangents,
              Rotations rotations, std::stop_token stop) const;

    /// How many maps are applied one after the other.
    std::size_t length() const { return 1; }

private:
    double rate_ = 0.0; ///< [rad/model unit] of the bend along z
};

} // namespace cellwarp
