// SPDX-License-Identifier: GPL-3.0-or-later
// Cutting. Points are inside a region, outside of all, or on a border (where an edge
// would be cut next to its end, that end is taken for the border instead, for otherwise
// slivers arise). What is left of a tetrahedron is convex. It becomes tetrahedra by
// pulling: its point of the smallest number is joined with all faces that it is not in,
// and these are fans around their own point of the smallest number. So both sides of a
// face cut it alike.
#include "tests/bench/tet_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "octree/base/index.h"

namespace cellwarp::core::bench
{

namespace
{

/// An edge is not cut nearer than this to its end [edge].
constexpr double kNextToEnd = 0.02;

/// Without the points that no tetrahedron has.
TetMesh compacted(const TetMesh& mesh)
{
    TetMesh compact;
    std::vector<int> numbers(mesh.points.size(), -1);
    for (Tet tet : mesh.tets)
    {
        for (int& point : tet)
        {
            const std::size_t old = idx(point);
            if (numbers[old] < 0)
            {
                numbers[old] = static_cast<int>(compact.points.size());
                compact.points.push_back(mesh.points[old]);
                compact.region_of_point.push_back(mesh.region_of_point[old]);
            }
            point = numbers[old];
        }
        compact.tets.push_back(tet);
    }
    return compact;
}

/// Takes away what regions hold.
class Cutter
{
public:
    Cutter(const TetMesh& mesh,
           const std::function<int(const Eigen::Vector3d&)>& region_of)
        : mesh_(mesh), region_of_(region_of)
    {
        for (const Eigen::Vector3d& x : mesh.points)
        {
            mesh_.region_of_point.push_back(region_of(x));
            sides_.push_back(mesh_.region_of_point.back() < 0 ? Side::Outside
                                                              : Side::Inside);
        }
    }

    TetMesh cut()
    {
        const std::vector<Tet> tets = std::move(mesh_.tets);
        mesh_.tets.clear();
        for (const Tet& tet : tets)
            take_ends(tet);
        for (const Tet& tet : tets)
            add_rest(tet);
        return compacted(mesh_);
    }

private:
    enum class Side
    {
        Inside,
        Border,
        Outside
    };
    using Polygon = std::vector<int>;

    bool is(int point, Side side) const { return sides_[idx(point)] == side; }
    const Eigen::Vector3d& place(int point) const { return mesh_.points[idx(point)]; }

    struct Crossing
    {
        double share; ///< of the way from the inner point to the outer one
        int region;
    };
    Crossing crossing(int inner, int outer) const
    {
        constexpr int kHalvings = 40;
        Crossing found{0.0, mesh_.region_of_point[idx(inner)]};
        double beyond = 1.0;
        for (int k = 0; k < kHalvings; ++k)
        {
            const double middle = 0.5 * (found.share + beyond);
            const int region =
                region_of_(place(inner) + middle * (place(outer) - place(inner)));
            if (region < 0)
                beyond = middle;
            else
                found = {middle, region};
        }
        return found;
    }

    /// Puts the ends of edges that would be cut next to them onto the border.
    void take_ends(const Tet& tet)
    {
        for (const int inner : tet)
            for (const int outer : tet)
            {
                if (!is(inner, Side::Inside) || !is(outer, Side::Outside))
                    continue;
                const Crossing at = crossing(inner, outer);
                if (at.share > 1.0 - kNextToEnd)
                {
                    sides_[idx(outer)] = Side::Border;
                    mesh_.region_of_point[idx(outer)] = at.region;
                }
                else if (at.share < kNextToEnd)
                    sides_[idx(inner)] = Side::Border;
            }
    }

    /// The point where the border crosses an edge.
    int cut_point(int inner, int outer)
    {
        const auto [found, is_new] =
            cuts_.try_emplace({inner, outer}, static_cast<int>(mesh_.points.size()));
        if (is_new)
        {
            const Crossing at = crossing(inner, outer);
            mesh_.points.push_back(place(inner) +
                                   at.share * (place(outer) - place(inner)));
            mesh_.region_of_point.push_back(at.region);
            sides_.push_back(Side::Border);
        }
        return found->second;
    }

    /// What is left of one of a tetrahedron's faces.
    Polygon rest_of(const std::array<int, 3>& face)
    {
        Polygon rest;
        for (std::size_t k = 0; k < 3; ++k)
        {
            const int here = face[k], next = face[(k + 1) % 3];
            if (!is(here, Side::Inside))
                rest.push_back(here);
            if (is(here, Side::Inside) && is(next, Side::Outside))
                rest.push_back(cut_point(here, next));
            if (is(here, Side::Outside) && is(next, Side::Inside))
                rest.push_back(cut_point(next, here));
        }
        return rest;
    }

    /// Where the border cuts a tetrahedron through.
    Polygon cut_face(const Tet& tet)
    {
        Polygon inside, outside, face;
        for (const int point : tet)
        {
            if (is(point, Side::Inside))
                inside.push_back(point);
            else if (is(point, Side::Outside))
                outside.push_back(point);
            else
                face.push_back(point);
        }
        for (const int outer : outside)
        {
            for (const int inner : inside)
                face.push_back(cut_point(inner, outer));
            std::reverse(inside.begin(), inside.end()); // around the face
        }
        return face;
    }

    void add_rest(const Tet& tet)
    {
        const auto count = [&](Side side)
        {
            return std::count_if(tet.begin(), tet.end(),
                                 [&](int point) { return is(point, side); });
        };
        if (count(Side::Outside) == 0)
            return;
        if (count(Side::Inside) == 0)
        {
            add_tet(tet);
            return;
        }
        std::vector<Polygon> faces = {cut_face(tet)};
        for (const std::array<std::size_t, 3>& f :
             {std::array<std::size_t, 3>{0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}})
            faces.push_back(rest_of({tet[f[0]], tet[f[1]], tet[f[2]]}));
        int apex = std::numeric_limits<int>::max();
        for (const Polygon& face : faces)
            for (const int point : face)
                apex = std::min(apex, point);
        for (Polygon& face : faces)
        {
            if (face.size() < 3 ||
                std::find(face.begin(), face.end(), apex) != face.end())
                continue;
            std::rotate(face.begin(), std::min_element(face.begin(), face.end()),
                        face.end());
            for (std::size_t k = 2; k < face.size(); ++k)
                add_tet({apex, face[0], face[k - 1], face[k]});
        }
    }

    void add_tet(Tet tet)
    {
        const double volume = six_volumes(mesh_, tet);
        if (volume < 0)
            std::swap(tet[0], tet[1]);
        if (volume != 0)
            mesh_.tets.push_back(tet);
    }

    TetMesh mesh_;
    const std::function<int(const Eigen::Vector3d&)>& region_of_;
    std::vector<Side> sides_; ///< of the points
    std::map<std::pair<int, int>, int> cuts_;
};

/// Barycentric weights of a place.
Eigen::Vector4d weights_of(const TetMesh& mesh, const Tet& tet, const Eigen::Vector3d& x)
{
    const auto point = [&](int k) -> const Eigen::Vector3d&
    { return mesh.points[idx(tet[idx(k)])]; };
    Eigen::Matrix3d edges;
    for (int k = 0; k < 3; ++k)
        edges.col(k) = point(k + 1) - point(0);
    const Eigen::Vector3d rest = edges.inverse() * (x - point(0));
    return {1.0 - rest.sum(), rest.x(), rest.y(), rest.z()};
}

/// How far a place with these weights is from the tetrahedron, or a little more: from
/// where the negative ones are 0. 0 inside.
double distance_from(const TetMesh& mesh, const Tet& tet, const Eigen::Vector4d& weights,
                     const Eigen::Vector3d& x)
{
    if (weights.minCoeff() >= 0)
        return 0.0;
    const Eigen::Vector4d inside = weights.cwiseMax(0.0) / weights.cwiseMax(0.0).sum();
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < 4; ++k)
        place += inside[static_cast<Eigen::Index>(k)] * mesh.points[idx(tet[k])];
    return (x - place).norm();
}

} // namespace

double six_volumes(const TetMesh& mesh, const Tet& tet)
{
    const auto point = [&](std::size_t k) -> const Eigen::Vector3d&
    { return mesh.points[idx(tet[k])]; };
    return (point(1) - point(0)).cross(point(2) - point(0)).dot(point(3) - point(0));
}

TetMesh cut_at_regions(const TetMesh& mesh,
                       const std::function<int(const Eigen::Vector3d&)>& region_of)
{
    return Cutter(mesh, region_of).cut();
}

TetFinder::TetFinder(const TetMesh& mesh) : mesh_(mesh)
{
    Eigen::Vector3d high = Eigen::Vector3d::Constant(-INFINITY);
    low_ = -high;
    for (const Eigen::Vector3d& x : mesh.points)
    {
        low_ = low_.cwiseMin(x);
        high = high.cwiseMax(x);
    }
    // About one tetrahedron a bin.
    const Eigen::Vector3d size = high - low_;
    width_ = std::cbrt(size.prod() / static_cast<double>(mesh.tets.size()));
    counts_ = (size / width_).array().floor().cast<int>() + 1;
    tets_of_bin_.resize(idx(counts_.cast<std::int64_t>().prod()));
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    {
        Eigen::Vector3i first = counts_, last = -Eigen::Vector3i::Ones();
        for (const int point : mesh.tets[t])
        {
            const Eigen::Vector3i bin = bin_of(mesh.points[idx(point)]);
            first = first.cwiseMin(bin);
            last = last.cwiseMax(bin);
        }
        for (int k = first.z(); k <= last.z(); ++k)
            for (int j = first.y(); j <= last.y(); ++j)
                for (int i = first.x(); i <= last.x(); ++i)
                    tets_of_bin_[index({i, j, k})].push_back(t);
    }
}

Eigen::Vector3i TetFinder::bin_of(const Eigen::Vector3d& x) const
{
    const Eigen::Vector3i bin = ((x - low_) / width_).array().floor().cast<int>();
    return bin.cwiseMax(0).cwiseMin(counts_ - Eigen::Vector3i::Ones());
}

std::size_t TetFinder::index(const Eigen::Vector3i& bin) const
{
    return idx(bin.x() +
               static_cast<std::int64_t>(counts_.x()) *
                   (bin.y() + static_cast<std::int64_t>(counts_.y()) * bin.z()));
}

TetFinder::Found TetFinder::find(const Eigen::Vector3d& x) const
{
    const Eigen::Vector3i bin = bin_of(x);
    Found found;
    double best = INFINITY;
    // One ring of bins beyond the first that has a tetrahedron: the nearest may be there.
    for (int ring = 0, last = counts_.maxCoeff(); ring <= last; ++ring)
    {
        const Eigen::Vector3i low = (bin.array() - ring).max(0);
        const Eigen::Vector3i high = (bin.array() + ring).min(counts_.array() - 1);
        for (int k = low.z(); k <= high.z(); ++k)
            for (int j = low.y(); j <= high.y(); ++j)
                for (int i = low.x(); i <= high.x(); ++i)
                    for (const std::size_t t : tets_of_bin_[index({i, j, k})])
                    {
                        const Tet& tet = mesh_.tets[t];
                        const Eigen::Vector4d weights = weights_of(mesh_, tet, x);
                        const double distance = distance_from(mesh_, tet, weights, x);
                        if (distance < best)
                        {
                            best = distance;
                            found = {t, weights};
                        }
                    }
        if (best == 0)
            break;
        if (best < INFINITY)
            last = std::min(last, ring + 1);
    }
    return found;
}

} // namespace cellwarp::core::bench
