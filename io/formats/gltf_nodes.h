// SPDX-License-Identifier: GPL-3.0-or-later
// The tree of a glTF's nodes.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "io/formats/gltf_json.h"

namespace cellwarp::core
{

/// No node is nested deeper.
inline constexpr std::size_t kMaxNodeNesting = 128;

class GltfNodes
{
public:
    /// \p json must outlive it. Throws Fault::Malformed for nodes with two parents, and
    /// for rings.
    explicit GltfNodes(const GltfJson& json);

    std::size_t size() const { return children_.size(); }
    const GltfJson::Json& operator[](std::size_t node) const;
    const std::vector<std::size_t>& children(std::size_t node) const
    {
        return children_[node];
    }
    /// -1: none.
    int parent(std::size_t node) const { return parents_[node]; }
    /// Of the scene that is shown; of all nodes where there is none.
    const std::vector<std::size_t>& roots() const { return roots_; }
    /// To the space of its parent, as it stands.
    Eigen::Affine3d matrix(std::size_t node) const;
    /// Its name, or an empty one.
    std::string name(std::size_t node) const;

private:
    void find_roots();

    const GltfJson& json_;
    std::vector<std::vector<std::size_t>> children_;
    std::vector<int> parents_;
    std::vector<std::size_t> roots_;
};

} // namespace cellwarp::core
