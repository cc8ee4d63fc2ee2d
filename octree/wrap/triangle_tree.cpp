// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/wrap/triangle_tree.h"

#include <algorithm>
#include <iterator>
#include <numeric>
#include <utility>

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/Simple_cartesian.h>

namespace cellwarp::core
{

namespace
{

using Kernel = CGAL::Simple_cartesian<double>;

/// A triangle as the library asks for it: by its number.
struct Numbered
{
    using Id = std::uint32_t;
    using Point = Kernel::Point_3;
    using Datum = Kernel::Triangle_3;
    using Shared_data = const TriangleTree*;

    std::uint32_t number = 0;

    Numbered() = default;
    Numbered(std::vector<std::uint32_t>::const_iterator from, const TriangleTree*)
        : number(*from)
    {
    }
    Id id() const { return number; }
    static Point corner(const TriangleTree* of, std::uint32_t number, std::size_t k)
    {
        const Eigen::Vector3d& x = of->vertices()[of->triangles()[number][k]];
        return {x.x(), x.y(), x.z()};
    }
    Datum datum(const TriangleTree* of) const
    {
        return {corner(of, number, 0), corner(of, number, 1), corner(of, number, 2)};
    }
    Point reference_point(const TriangleTree* of) const { return corner(of, number, 0); }
    static Shared_data construct_shared_data(const TriangleTree* of) { return of; }
};

} // namespace

struct TriangleTree::Tree
{
    CGAL::AABB_tree<CGAL::AABB_traits<Kernel, Numbered>> boxes;
};

TriangleTree::TriangleTree(std::vector<Eigen::Vector3d> vertices,
                           std::vector<std::array<std::uint32_t, 3>> triangles)
    : vertices_(std::move(vertices)), triangles_(std::move(triangles)),
      tree_(std::make_unique<Tree>())
{
    std::vector<std::uint32_t> all(triangles_.size());
    std::iota(all.begin(), all.end(), std::uint32_t(0));
    tree_->boxes.insert(all.cbegin(), all.cend(), this);
    tree_->boxes.build();
}

TriangleTree::~TriangleTree() = default;

void TriangleTree::near(const Eigen::Vector3d& place, double reach,
                        std::vector<std::uint32_t>& out) const
{
    out.clear();
    const CGAL::Bbox_3 cube(place.x() - reach, place.y() - reach, place.z() - reach,
                            place.x() + reach, place.y() + reach, place.z() + reach);
    tree_->boxes.all_intersected_primitives(cube, std::back_inserter(out));
    std::sort(out.begin(), out.end());
}

} // namespace cellwarp::core
