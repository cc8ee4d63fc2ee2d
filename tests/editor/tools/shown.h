// SPDX-License-Identifier: GPL-3.0-or-later
// Shapes as a view gets them, from shapes that are made by functions.
#pragma once

#include <algorithm>
#include <memory>
#include <numeric>
#include <random>
#include <utility>

#include "library/session/shape.h"
#include "octree/material.h"

namespace cellwarp::core::support
{

/// A layout with its places in random order.
inline std::shared_ptr<const ShapeLayout> layout_of(const Shape& shape, unsigned seed = 1)
{
    auto layout = std::make_shared<ShapeLayout>();
    layout->order.resize(shape.samples.size());
    std::iota(layout->order.begin(), layout->order.end(), 0u);
    std::mt19937 rng(seed);
    std::shuffle(layout->order.begin(), layout->order.end(), rng);
    layout->place_of.resize(layout->order.size());
    for (std::uint32_t place = 0; place < layout->order.size(); ++place)
        layout->place_of[layout->order[place]] = place;
    for (const Triangle& triangle : shape.triangles)
        for (const std::uint32_t corner : triangle)
            layout->triangles.push_back(layout->place_of[corner]);
    return layout;
}

/// The samples, which are in view space, in a layout that was made for them.
inline ShownShape shown(const Shape& shape, std::shared_ptr<const ShapeLayout> layout,
                        std::uint64_t version,
                        const Eigen::Matrix4d& to_view = Eigen::Matrix4d::Identity())
{
    ShownShape result;
    result.layout = std::move(layout);
    result.to_view = to_view;
    result.version = version;
    const Eigen::Matrix4d to_work = to_view.inverse();
    for (const std::uint32_t sample : result.layout->order)
    {
        const Eigen::Vector4d x = to_work * shape.samples[sample].homogeneous();
        for (int k = 0; k < 3; ++k)
            result.positions.push_back(static_cast<float>(x[k]));
    }
    return result;
}

} // namespace cellwarp::core::support
