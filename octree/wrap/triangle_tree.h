// SPDX-License-Identifier: GPL-3.0-or-later
// Which triangles are near a place. Optional: a build without CGAL has
// no_triangle_tree.cpp in its place, which looks at all of them.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

class TriangleTree
{
public:
    TriangleTree(std::vector<Eigen::Vector3d> vertices,
                 std::vector<std::array<std::uint32_t, 3>> triangles);
    ~TriangleTree();

    const std::vector<Eigen::Vector3d>& vertices() const { return vertices_; }
    const std::vector<std::array<std::uint32_t, 3>>& triangles() const
    {
        return triangles_;
    }
    /// \p out: numbers of all triangles that meet the cube of \p reach about a place, and
    /// of none that are far from it, ascending.
    void near(const Eigen::Vector3d& place, double reach,
              std::vector<std::uint32_t>& out) const;

private:
    struct Tree;
    std::vector<Eigen::Vector3d> vertices_;
    std::vector<std::array<std::uint32_t, 3>> triangles_;
    std::unique_ptr<Tree> tree_;
};

} // namespace cellwarp::core
