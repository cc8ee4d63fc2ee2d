// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/point_tree.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <istream>
#include <limits>
#include <ostream>
#include <stdexcept>
#include <unordered_set>
#include <utility>
#include <vector>

// Where there is no memory the library prints beside throwing; the program tells of it
// itself. What the library includes stands above, so that this is for it alone.
#define fprintf(...) static_cast<void>(0)
#include <nanoflann.hpp>
#undef fprintf

namespace cellwarp::core
{

namespace
{

struct Cloud
{
    std::vector<Eigen::Vector3d> points;

    std::size_t kdtree_get_point_count() const { return points.size(); }
    double kdtree_get_pt(std::size_t i, std::size_t k) const
    {
        return points[i][static_cast<Eigen::Index>(k)];
    }
    template <class Box>
    bool kdtree_get_bbox(Box&) const
    {
        return false;
    }
};

using Tree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Cloud>,
                                        Cloud, 3>;

} // namespace

struct PointTree::Index
{
    Cloud cloud;
    Tree tree;
    explicit Index(std::span<const Eigen::Vector3d> points)
        : cloud{{points.begin(), points.end()}},
          tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16))
    {
    }
};

PointTree::PointTree(std::span<const Eigen::Vector3d> points)
    : index_(std::make_unique<Index>(points))
{
}
PointTree::~PointTree() = default;
PointTree::PointTree(PointTree&&) noexcept = default;
PointTree& PointTree::operator=(PointTree&&) noexcept = default;

const std::vector<Eigen::Vector3d>& PointTree::points() const
{
    return index_->cloud.points;
}

PointTree::Neighbour PointTree::nearest(const Eigen::Vector3d& x) const
{
    std::uint32_t index = 0;
    double squared = 0.0;
    index_->tree.knnSearch(x.data(), 1, &index, &squared);
    return {index, squared};
}

void PointTree::nearest(const Eigen::Vector3d& x, std::size_t count,
                        std::vector<Neighbour>& out) const
{
    out.clear();
    const std::size_t most = std::min(count, points().size());
    if (most == 0)
        return;
    // Two arrays for the search; most callers ask for few.
    constexpr std::size_t kFew = 32;
    std::uint32_t few_indices[kFew];
    double few_squares[kFew];
    std::vector<std::uint32_t> many_indices(most > kFew ? most : 0);
    std::vector<double> many_squares(many_indices.size());
    std::uint32_t* const indices = most > kFew ? many_indices.data() : few_indices;
    double* const squares = most > kFew ? many_squares.data() : few_squares;
    const std::size_t found = index_->tree.knnSearch(x.data(), most, indices, squares);
    for (std::size_t i = 0; i < found; ++i)
        out.push_back({indices[i], squares[i]});
}

void PointTree::within(const Eigen::Vector3d& x, double distance,
                       std::vector<Neighbour>& out) const
{
    out.clear();
    std::vector<std::pair<std::uint32_t, double>> found;
    nanoflann::SearchParams in_no_order;
    in_no_order.sorted = false;
    index_->tree.radiusSearch(x.data(), distance * distance, found, in_no_order);
    for (const auto& [index, squared] : found)
        out.push_back({index, squared});
}

} // namespace cellwarp::core
