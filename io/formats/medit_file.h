// SPDX-License-Identifier: GPL-3.0-or-later
// Medit mesh files (*.mesh) of solid cells, as plain values: lattices that were drawn.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

struct MeditMesh
{
    /// Numbers of vertices from 0; the reference of the file.
    template <std::size_t count>
    struct Cell
    {
        std::array<int, count> vertices{};
        std::int64_t reference = 0;
        std::int64_t line = 0;
    };
    std::vector<Eigen::Vector3d> vertices;
    std::vector<Cell<2>> edges;
    std::vector<Cell<4>> tetrahedra;
    std::vector<Cell<6>> prisms;
    std::vector<Cell<8>> hexahedra; ///< both loops of four, one above the other
};

/// Text, in three dimensions. Throws Fault::File, Fault::Malformed with line and section:
/// pyramids, vertices that are not there, files without solid cells.
MeditMesh read_medit(const std::string& path);
MeditMesh parse_medit(const std::string& path, std::string_view text);

} // namespace cellwarp::core
