// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/gltf_nodes.h"

#include <cmath>
#include <set>

namespace cellwarp::core
{

using Json = GltfJson::Json;

GltfNodes::GltfNodes(const GltfJson& json) : json_(json)
{
    const Json& nodes = json_.list("nodes");
    children_.resize(nodes.size());
    parents_.assign(nodes.size(), -1);
    for (std::size_t i = 0; i < nodes.size(); ++i)
    {
        const std::string where = element("nodes", i);
        const Json* children = json_.find(nodes[i], "children");
        if (!children)
            continue;
        if (!children->is_array())
            json_.fail(where + ".children", "need a list of nodes");
        for (const Json& child : *children)
        {
            const std::size_t c =
                json_.index_of(child, where + ".children", "nodes", nodes.size());
            if (parents_[c] >= 0)
                json_.fail(element("nodes", c), "has two parents, nodes[" +
                                                    std::to_string(parents_[c]) +
                                                    "] and " + where);
            parents_[c] = static_cast<int>(i);
            children_[i].push_back(c);
        }
    }
    find_roots();
}

void GltfNodes::find_roots()
{
    std::vector<std::size_t> rest;
    for (std::size_t i = 0; i < size(); ++i)
        if (parents_[i] < 0)
            roots_.push_back(i);
    std::size_t reached = 0;
    for (rest = roots_; !rest.empty(); ++reached)
    {
        const std::size_t node = rest.back();
        rest.pop_back();
        rest.insert(rest.end(), children_[node].begin(), children_[node].end());
    }
    if (reached < size())
        json_.fail("nodes", "some are their own ancestors");
    const Json* scene = json_.find(json_.root(), "scene");
    if (!scene)
        return;
    const Json& scenes = json_.list("scenes");
    const std::size_t s = json_.index_of(*scene, "scene", "scenes", scenes.size());
    roots_.clear();
    const std::string where = element("scenes", s) + ".nodes";
    const Json* listed = json_.find(scenes[s], "nodes");
    if (listed && !listed->is_array())
        json_.fail(where, "need a list of nodes");
    std::set<std::size_t> known;
    for (const Json& node : listed ? *listed : Json::array())
    {
        const std::size_t n = json_.index_of(node, where, "nodes", size());
        if (parents_[n] >= 0 || !known.insert(n).second)
            json_.fail(where,
                       "nodes[" + std::to_string(n) + "] is no root, or listed twice");
        roots_.push_back(n);
    }
}

const Json& GltfNodes::operator[](std::size_t node) const
{
    return json_.list("nodes")[node];
}

Eigen::Affine3d GltfNodes::matrix(std::size_t node) const
{
    const Json& object = (*this)[node];
    const std::string where = element("nodes", node);
    Eigen::Affine3d map = Eigen::Affine3d::Identity();
    if (const auto matrix = json_.numbers<16>(object, "matrix", where))
    {
        const auto& m = *matrix;
        if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1)
            json_.fail(where + ".matrix", "its last row is not 0 0 0 1");
        for (int column = 0; column < 4; ++column)
            for (int row = 0; row < 3; ++row)
                map(row, column) = m[static_cast<std::size_t>(4 * column + row)];
        return map;
    }
    if (const auto shift = json_.numbers<3>(object, "translation", where))
        map.translate(Eigen::Vector3d((*shift)[0], (*shift)[1], (*shift)[2]));
    if (const auto turn = json_.numbers<4>(object, "rotation", where))
    {
        const Eigen::Quaterniond q((*turn)[3], (*turn)[0], (*turn)[1], (*turn)[2]);
        if (!(q.norm() > 0) || !std::isfinite(q.norm()))
            json_.fail(where + ".rotation", "is no rotation");
        if (q.vec() != Eigen::Vector3d::Zero())
            map.rotate(q.normalized());
    }
    if (const auto scale = json_.numbers<3>(object, "scale", where))
        map.scale(Eigen::Vector3d((*scale)[0], (*scale)[1], (*scale)[2]));
    return map;
}

std::string GltfNodes::name(std::size_t node) const
{
    const Json* const name = json_.find((*this)[node], "name");
    return name && name->is_string() ? name->get<std::string>() : std::string();
}

} // namespace cellwarp::core
