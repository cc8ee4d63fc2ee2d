// SPDX-License-Identifier: GPL-3.0-or-later
// Looks at the boxes of all triangles.
#include "octree/wrap/triangle_tree.h"

#include <utility>

namespace cellwarp::core
{

struct TriangleTree::Tree
{
};

TriangleTree::TriangleTree(std::vector<Eigen::Vector3d> vertices,
                           std::vector<std::array<std::uint32_t, 3>> triangles)
    : vertices_(std::move(vertices)), triangles_(std::move(triangles))
{
}

TriangleTree::~TriangleTree() = default;

void TriangleTree::near(const Eigen::Vector3d& place, double reach,
                        std::vector<std::uint32_t>& out) const
{
    out.clear();
    for (std::uint32_t k = 0; k < triangles_.size(); ++k)
    {
        const auto& [a, b, c] = triangles_[k];
        const Eigen::Vector3d low =
            vertices_[a].cwiseMin(vertices_[b]).cwiseMin(vertices_[c]);
        const Eigen::Vector3d high =
            vertices_[a].cwiseMax(vertices_[b]).cwiseMax(vertices_[c]);
        if (((low - place).array() <= reach).all() &&
            ((place - high).array() <= reach).all())
            out.push_back(k);
    }
}

} // namespace cellwarp::core
