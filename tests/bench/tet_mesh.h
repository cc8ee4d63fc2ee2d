// SPDX-License-Identifier: GPL-3.0-or-later
// A body of tetrahedra: cut at the borders of regions, searched for places. tet_fill.h
// makes one of a surface.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core::bench
{

using Tet = std::array<int, 4>;

/// No point twice, no tetrahedron turned over.
struct TetMesh
{
    std::vector<Eigen::Vector3d> points;
    std::vector<Tet> tets;
    std::vector<int> region_of_point; ///< the region that prescribes it; -1: none
};

/// Gives the points their regions and takes the tetrahedra away that are prescribed
/// whole. Those that a region's border crosses are cut there, so that it lies where it is
/// and not where the nearest points happen to be. \p region_of: of a place; -1: none
TetMesh cut_at_regions(const TetMesh& mesh,
                       const std::function<int(const Eigen::Vector3d&)>& region_of);

/// Finds for places the tetrahedron that they are in, or the nearest one.
class TetFinder
{
public:
    explicit TetFinder(const TetMesh& mesh);

    struct Found
    {
        std::size_t tet = 0;
        Eigen::Vector4d weights; ///< barycentric; some are negative outside
    };
    Found find(const Eigen::Vector3d& x) const;

private:
    Eigen::Vector3i bin_of(const Eigen::Vector3d& x) const;
    std::size_t index(const Eigen::Vector3i& bin) const;

    const TetMesh& mesh_;
    Eigen::Vector3d low_;
    Eigen::Vector3i counts_;
    double width_ = 1.0; ///< of a bin
    std::vector<std::vector<std::size_t>> tets_of_bin_;
};

/// Six times the volume of a tetrahedron, with its sign.
double six_volumes(const TetMesh& mesh, const Tet& tet);

} // namespace cellwarp::core::bench
