// SPDX-License-Identifier: GPL-3.0-or-later
// A box of tetrahedra, for tests.
#pragma once

#include "tests/bench/tet_mesh.h"

namespace cellwarp::core::bench
{

/// Boxes of six tetrahedra each around a diagonal, so many along the axes. Its lowest
/// corner is 0.
inline TetMesh box_of_tets(const Eigen::Vector3d& size, const Eigen::Vector3i& counts)
{
    TetMesh mesh;
    const auto number = [&](const Eigen::Vector3i& at)
    { return at.x() + (counts.x() + 1) * (at.y() + (counts.y() + 1) * at.z()); };
    for (int k = 0; k <= counts.z(); ++k)
        for (int j = 0; j <= counts.y(); ++j)
            for (int i = 0; i <= counts.x(); ++i)
                mesh.points.push_back(size.cwiseProduct(Eigen::Vector3d(i, j, k))
                                          .cwiseQuotient(counts.cast<double>()));
    constexpr int kWays[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2},
                                 {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
    for (int k = 0; k < counts.z(); ++k)
        for (int j = 0; j < counts.y(); ++j)
            for (int i = 0; i < counts.x(); ++i)
                for (const auto& way : kWays)
                {
                    Eigen::Vector3i at(i, j, k);
                    Tet tet = {number(at)};
                    for (std::size_t step = 0; step < 3; ++step)
                    {
                        ++at[way[step]];
                        tet[step + 1] = number(at);
                    }
                    if (six_volumes(mesh, tet) < 0)
                        std::swap(tet[0], tet[1]);
                    mesh.tets.push_back(tet);
                }
    return mesh;
}

} // namespace cellwarp::core::bench
