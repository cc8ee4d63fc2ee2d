// SPDX-License-Identifier: GPL-3.0-or-later
// A face is projected along its mean normal, which is that of its vector area, and cut
// into the constrained Delaunay triangles of that polygon. These depend on nothing but
// the polygon, unless four corners lie on a circle.
//
// Let a quadrilateral a b c d have the angles A, B, C, D. In the plane the diagonal ac is
// Delaunay's where B + D < pi, which is where sin(B + D) > 0, and sin(A + C) is the
// opposite. A face that is not flat gets the diagonal for which
//   sin(B + D) - sin(A + C) > 0,
// with the angles in space: so each quadrilateral has one answer, whichever diagonal it
// has. With the edges p = a - b and q = c - b at the corner b,
//   cos B = p.q / (|p| |q|),  sin B = |p x q| / (|p| |q|),
// and both sines have the product of all four edges in their denominator.
//   On a circle, as in a rectangle, the sum is 0. Then the diagonal that lies higher,
//   seen
// from the side from which the corners go round counter-clockwise, is taken: a mirror
// image of the face has the mirror image of it. In a flat face it makes no difference to
// the surface; there the diagonal from the corner that comes first by x, then y, then z
// is taken. These three rules are those of one lower convex hull, of lifts
// |p|^2 - e height - e^2 (what comes first), with e infinitely small: changing one
// diagonal after another for the better ends, and always in the same triangles.
//
// The triangles that are made better so come from cutting off ears, corners whose
// triangle holds no other corner, the shortest cut first, which is near the best. Where
// the polygon crosses itself no ear may be left. Then the corner of the smallest triangle
// is cut off, in space, ear or not, and nothing is made better afterwards. The same holds
// for a face without a mean normal. Signs are of rounded numbers: what they get wrong has
// no area to speak of.
#include "io/formats/face_triangles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Numbers that differ by no more than this share are equal: coordinates are rounded.
constexpr double kSame = 1e-6;

bool is_before(const Vector3d& a, const Vector3d& b)
{
    return std::lexicographical_compare(a.data(), a.data() + 3, b.data(), b.data() + 3);
}

/// Whether the corner that comes first is one of the ends of the diagonal ac.
bool is_first_in(const Vector3d& a, const Vector3d& b, const Vector3d& c,
                 const Vector3d& d)
{
    const auto sorted = [](const Vector3d& p, const Vector3d& q)
    { return is_before(q, p) ? std::pair(q, p) : std::pair(p, q); };
    const auto [low, high] = sorted(a, c);
    const auto [other_low, other_high] = sorted(b, d);
    return is_before(low, other_low) ||
           (!is_before(other_low, low) && !is_before(other_high, high));
}

enum class Diagonal
{
    First,   ///< from a to c
    Second,  ///< from b to d
    Either,  ///< it is flat, and its corners lie on a circle
    Unclear, ///< it crosses itself, or has no mean normal
};

/// How the quadrilateral a b c d is cut. \p if_equal: where it makes no difference.
Diagonal diagonal_of(const Vector3d& a, const Vector3d& b, const Vector3d& c,
                     const Vector3d& d)
{
    const Vector3d ab = b - a, bc = c - b, cd = d - c, da = a - d;
    const Vector3d at_a = da.cross(ab), at_b = ab.cross(bc), at_c = bc.cross(cd),
                   at_d = cd.cross(da);
    const Vector3d normal = (c - a).cross(d - b);
    const double length = normal.norm();
    const double edges = std::sqrt(ab.squaredNorm() * cd.squaredNorm()) *
                         std::sqrt(bc.squaredNorm() * da.squaredNorm());
    // Squares of areas, and far from what a number can hold.
    if (!(length > 1e-12 * ((c - a).squaredNorm() + (d - b).squaredNorm())) ||
        !(edges < 1e300) || !(length * length > 1e-290))
        return Diagonal::Unclear;
    const bool first_turns_in = normal.dot(at_a) < 0.0 || normal.dot(at_c) < 0.0;
    const bool second_turns_in = normal.dot(at_b) < 0.0 || normal.dot(at_d) < 0.0;
    if (first_turns_in || second_turns_in)
        return first_turns_in && second_turns_in ? Diagonal::Unclear
               : first_turns_in                  ? Diagonal::First
                                                 : Diagonal::Second;
    // cos = -(one edge).(the next).
    const double better = at_a.norm() * bc.dot(cd) + at_c.norm() * da.dot(ab) -
                          at_b.norm() * cd.dot(da) - at_d.norm() * ab.dot(bc);
    if (std::abs(better) > kSame * edges)
        return better > 0.0 ? Diagonal::First : Diagonal::Second;
    const double height = normal.dot(a - b) / length;
    if (std::abs(height) > kSame * std::sqrt(length))
        return height > 0.0 ? Diagonal::First : Diagonal::Second;
    return Diagonal::Either;
}

/// Twice the area of a triangle of the plane; negative where it goes round clockwise.
double twice_area(const Vector2d& a, const Vector2d& b, const Vector2d& c)
{
    return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

/// Corners of a polygon that may lie in the way of an ear, in a tree of boxes.
class CornersInTheWay
{
public:
    /// \p places must outlive this.
    void build(const std::vector<Vector2d>& places,
               const std::vector<std::uint32_t>& corners)
    {
        places_ = &places;
        corners_ = corners;
        nodes_.clear();
        leaf_of_.assign(places.size(), kNone);
        if (!corners_.empty())
            add_node(0, corners_.size(), kNone);
    }
    bool has(std::uint32_t corner) const { return leaf_of_[corner] != kNone; }
    void remove(std::uint32_t corner)
    {
        for (std::uint32_t node = leaf_of_[corner]; node != kNone;
             node = nodes_[node].parent)
            --nodes_[node].count;
        leaf_of_[corner] = kNone;
    }
    /// Whether one of them lies in a triangle that goes round counter-clockwise, or on
    /// its rim but at its corners.
    bool meet(const std::array<Vector2d, 3>& triangle) const
    {
        const Vector2d low = triangle[0].cwiseMin(triangle[1]).cwiseMin(triangle[2]);
        const Vector2d high = triangle[0].cwiseMax(triangle[1]).cwiseMax(triangle[2]);
        return !nodes_.empty() && meets(0, triangle, low, high);
    }

private:
    static constexpr std::size_t kLeaf = 8;

    struct Node
    {
        Vector2d low, high;
        std::size_t begin, end;
        std::size_t count; ///< of those that are left
        std::uint32_t parent;
        std::uint32_t second; ///< child; the first one follows; kNone: a leaf
    };

    std::uint32_t add_node(std::size_t begin, std::size_t end, std::uint32_t parent)
    {
        const auto number = static_cast<std::uint32_t>(nodes_.size());
        Node node{place(begin), place(begin), begin, end, end - begin, parent, kNone};
        for (std::size_t i = begin; i < end; ++i)
        {
            node.low = node.low.cwiseMin(place(i));
            node.high = node.high.cwiseMax(place(i));
        }
        nodes_.push_back(node);
        if (end - begin <= kLeaf)
        {
            for (std::size_t i = begin; i < end; ++i)
                leaf_of_[corners_[i]] = number;
            return number;
        }
        const Vector2d size = node.high - node.low;
        const int axis = size.x() >= size.y() ? 0 : 1;
        const std::size_t middle = begin + (end - begin) / 2;
        const auto at = [&](std::size_t i)
        { return corners_.begin() + static_cast<std::ptrdiff_t>(i); };
        std::nth_element(at(begin), at(middle), at(end),
                         [&](std::uint32_t a, std::uint32_t b)
                         { return (*places_)[a][axis] < (*places_)[b][axis]; });
        add_node(begin, middle, number);
        const std::uint32_t second = add_node(middle, end, number);
        nodes_[number].second = second;
        return number;
    }

    bool meets(std::uint32_t number, const std::array<Vector2d, 3>& triangle,
               const Vector2d& low, const Vector2d& high) const
    {
        const Node& node = nodes_[number];
        if (node.count == 0 || (node.low.array() > high.array()).any() ||
            (node.high.array() < low.array()).any())
            return false;
        for (std::size_t k = 0; k < 3; ++k)
        {
            // The corner of the box that lies farthest to the left of the edge.
            const Vector2d &from = triangle[k], &to = triangle[(k + 1) % 3];
            if (twice_area(from, to,
                           {to.y() < from.y() ? node.high.x() : node.low.x(),
                            to.x() > from.x() ? node.high.y() : node.low.y()}) < 0.0)
                return false;
        }
        if (node.second != kNone)
            return meets(number + 1, triangle, low, high) ||
                   meets(node.second, triangle, low, high);
        for (std::size_t i = node.begin; i < node.end; ++i)
            if (has(corners_[i]) && is_in(place(i), triangle))
                return true;
        return false;
    }

    static bool is_in(const Vector2d& x, const std::array<Vector2d, 3>& triangle)
    {
        for (std::size_t k = 0; k < 3; ++k)
            if (x == triangle[k] ||
                twice_area(triangle[k], triangle[(k + 1) % 3], x) < 0.0)
                return false;
        return true;
    }

    const Vector2d& place(std::size_t i) const { return (*places_)[corners_[i]]; }

    const std::vector<Vector2d>* places_ = nullptr;
    std::vector<std::uint32_t> corners_;
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> leaf_of_; ///< of each corner; kNone: it is not in the way
};

} // namespace

/// A face of more than three corners.
class FaceCutter::Polygon
{
public:
    void cut(const std::vector<Vector3d>& samples, std::span<const std::uint32_t> corners,
             std::vector<Triangle>& out)
    {
        // The same numbers, rounded alike, whichever corner the face begins with.
        face_.assign(corners.begin(), corners.end());
        std::rotate(face_.begin(),
                    std::min_element(face_.begin(), face_.end(),
                                     [&](std::uint32_t a, std::uint32_t b)
                                     { return is_before(samples[a], samples[b]); }),
                    face_.end());
        load(samples);
        if (cut_off_all())
            improve();
        for (std::size_t h = 0; h < tails_.size(); h += 3)
            out.push_back({face_[tails_[h]], face_[tails_[h + 1]], face_[tails_[h + 2]]});
    }

private:
    /// A corner that can be cut off, as it was when this was found out.
    struct Candidate
    {
        bool is_ear;
        /// The squared length of an ear's cut, else twice the area of the triangle. It
        /// is rounded, so that equal sizes are equal to the bit.
        float size;
        std::uint32_t corner;
        std::uint32_t change; ///< number of the corner's last change then
    };

    std::uint32_t size() const { return static_cast<std::uint32_t>(places_.size()); }

    /// The places of the corners, in a box of size 1 around 0, and in the plane.
    void load(const std::vector<Vector3d>& samples)
    {
        Vector3d low = samples[face_[0]], high = low;
        for (const std::uint32_t corner : face_)
        {
            low = low.cwiseMin(samples[corner]);
            high = high.cwiseMax(samples[corner]);
        }
        const Vector3d middle = 0.5 * low + 0.5 * high;
        const double extent = (high - low).maxCoeff();
        const bool has_extent = std::isfinite(extent) && std::isnormal(1.0 / extent);
        places_.resize(face_.size());
        for (std::size_t k = 0; k < face_.size(); ++k)
        {
            places_[k] = (samples[face_[k]] - middle) / extent;
            if (!has_extent || !places_[k].allFinite())
                places_[k].setZero();
        }
        Vector3d normal = Vector3d::Zero();
        double around = 0.0;
        for (std::size_t k = 0; k < places_.size(); ++k)
        {
            const Vector3d& next = places_[k + 1 < places_.size() ? k + 1 : 0];
            normal += places_[k].cross(next);
            around += (next - places_[k]).norm();
        }
        constexpr double kLeastArea = 1e-12; // of the square of the length around
        in_plane_.assign(places_.size(), Vector2d::Zero());
        if (!(normal.norm() > kLeastArea * around * around))
            return; // all triangles of the plane have no area
        const Vector3d up = normal.normalized();
        const Vector3d u = up.unitOrthogonal(), v = up.cross(u);
        for (std::size_t k = 0; k < places_.size(); ++k)
            in_plane_[k] = {places_[k].dot(u), places_[k].dot(v)};
    }

    double turn_at(std::uint32_t corner) const
    {
        return twice_area(in_plane_[before_[corner]], in_plane_[corner],
                          in_plane_[after_[corner]]);
    }
    bool is_ear(std::uint32_t corner) const
    {
        return turn_at(corner) > 0.0 &&
               !in_the_way_.meet({in_plane_[before_[corner]], in_plane_[corner],
                                  in_plane_[after_[corner]]});
    }

    /// Whether \p a is cut off after \p b.
    bool is_later(const Candidate& a, const Candidate& b) const
    {
        if (a.is_ear != b.is_ear)
            return b.is_ear;
        if (a.size != b.size)
            return a.size > b.size;
        return is_before(places_[b.corner], places_[a.corner]);
    }

    auto later() const
    {
        return [this](const Candidate& a, const Candidate& b) { return is_later(a, b); };
    }

    void add_candidate(std::uint32_t corner)
    {
        const Vector3d &before = places_[before_[corner]],
                       &after = places_[after_[corner]];
        const bool is_one = is_ear(corner);
        const double size =
            is_one ? (after - before).squaredNorm()
                   : (places_[corner] - before).cross(after - places_[corner]).norm();
        candidates_.push_back(
            {is_one, static_cast<float>(size), corner, changes_[corner]});
        std::push_heap(candidates_.begin(), candidates_.end(), later());
    }

    /// Cuts off corner after corner. Returns whether all were ears.
    bool cut_off_all()
    {
        const std::uint32_t n = size();
        before_.resize(n);
        after_.resize(n);
        for (std::uint32_t k = 0; k < n; ++k)
        {
            before_[k] = k > 0 ? k - 1 : n - 1;
            after_[k] = k + 1 < n ? k + 1 : 0;
        }
        listed_.clear();
        for (std::uint32_t k = 0; k < n; ++k)
            if (!(turn_at(k) > 0.0))
                listed_.push_back(k);
        in_the_way_.build(in_plane_, listed_);
        changes_.assign(n, 0);
        beyond_.assign(n, kNone);
        tails_.clear();
        twins_.clear();
        candidates_.clear();
        for (std::uint32_t k = 0; k < n; ++k)
            add_candidate(k);
        bool are_ears = true;
        for (std::uint32_t left = n; left > 3;)
        {
            std::pop_heap(candidates_.begin(), candidates_.end(), later());
            const Candidate next = candidates_.back();
            candidates_.pop_back();
            if (next.change != changes_[next.corner])
                continue;
            are_ears = are_ears && (next.is_ear || is_ear(next.corner));
            cut_off(next.corner);
            --left;
            if (left == 3)
                break;
            for (const std::uint32_t side : {before_[next.corner], after_[next.corner]})
            {
                if (in_the_way_.has(side) && turn_at(side) > 0.0)
                    in_the_way_.remove(side);
                ++changes_[side];
                add_candidate(side);
            }
        }
        for (std::uint32_t k = 0; k < n; ++k)
            if (changes_[k] != kNone)
            {
                add_triangle(k);
                break;
            }
        return are_ears;
    }

    void cut_off(std::uint32_t corner)
    {
        add_triangle(corner);
        if (in_the_way_.has(corner))
            in_the_way_.remove(corner);
        changes_[corner] = kNone;
        after_[before_[corner]] = after_[corner];
        before_[after_[corner]] = before_[corner];
    }

    /// Adds the triangle of a corner and the two beside it.
    void add_triangle(std::uint32_t corner)
    {
        const auto first = static_cast<std::uint32_t>(tails_.size());
        const std::array<std::uint32_t, 3> of = {before_[corner], corner, after_[corner]};
        tails_.insert(tails_.end(), of.begin(), of.end());
        twins_.insert(twins_.end(), 3, kNone);
        join(first, beyond_[of[0]]);
        join(first + 1, beyond_[of[1]]);
        if (after_[of[2]] == of[0]) // it is the last one
            join(first + 2, beyond_[of[2]]);
        beyond_[of[0]] = first + 2;
    }
    void join(std::uint32_t one, std::uint32_t other)
    {
        twins_[one] = other;
        if (other != kNone)
            twins_[other] = one;
    }

    static std::uint32_t next_of(std::uint32_t half)
    {
        return half % 3 == 2 ? half - 2 : half + 1;
    }

    /// Changes diagonals until each is the one that its quadrilateral gets.
    void improve()
    {
        std::vector<std::uint32_t>& to_look_at = listed_;
        to_look_at.clear();
        for (std::uint32_t half = 0; half < twins_.size(); ++half)
            if (half < twins_[half])
                to_look_at.push_back(half);
        // Rounded numbers could go round in a circle, and round outlines of many thousand
        // corners could take the square of their number.
        std::size_t left = 200 * places_.size();
        while (!to_look_at.empty() && left > 0)
        {
            const std::uint32_t half = to_look_at.back();
            to_look_at.pop_back();
            if (!is_to_change(half))
                continue;
            --left;
            const std::array<std::uint32_t, 4> around = change(half);
            to_look_at.insert(to_look_at.end(), around.begin(), around.end());
        }
    }

    /// The diagonal leads from a to b; c lies to its left, d to its right.
    struct Around
    {
        std::uint32_t half, half_next, half_last; ///< a to b, b to c, c to a
        std::uint32_t twin, twin_next, twin_last; ///< b to a, a to d, d to b
    };
    Around around(std::uint32_t half) const
    {
        const std::uint32_t next = next_of(half), twin = twins_[half],
                            twin_next = next_of(twin);
        return {half, next, next_of(next), twin, twin_next, next_of(twin_next)};
    }

    bool is_to_change(std::uint32_t half) const
    {
        if (twins_[half] == kNone)
            return false; // an edge of the face
        const Around at = around(half);
        const std::uint32_t a = tails_[at.half], b = tails_[at.twin],
                            c = tails_[at.half_last], d = tails_[at.twin_last];
        return twice_area(in_plane_[c], in_plane_[a], in_plane_[d]) > 0.0 &&
               twice_area(in_plane_[d], in_plane_[b], in_plane_[c]) > 0.0 &&
               diagonal_of(places_[a], places_[d], places_[b], places_[c]) ==
                   Diagonal::Second;
    }

    /// Returns the four edges around it.
    std::array<std::uint32_t, 4> change(std::uint32_t half)
    {
        const Around at = around(half);
        const std::uint32_t c = tails_[at.half_last], d = tails_[at.twin_last];
        const std::uint32_t b_to_c = twins_[at.half_next], c_to_a = twins_[at.half_last],
                            a_to_d = twins_[at.twin_next], d_to_b = twins_[at.twin_last];
        const std::uint32_t a = tails_[at.half], b = tails_[at.twin];
        tails_[at.half] = c;
        tails_[at.half_next] = d;
        tails_[at.half_last] = b;
        tails_[at.twin] = d;
        tails_[at.twin_next] = c;
        tails_[at.twin_last] = a;
        join(at.half_next, d_to_b);
        join(at.half_last, b_to_c);
        join(at.twin_next, c_to_a);
        join(at.twin_last, a_to_d);
        return {at.half_next, at.half_last, at.twin_next, at.twin_last};
    }

    std::vector<std::uint32_t> face_; ///< its corners, from the one that comes first
    std::vector<Vector3d> places_;
    std::vector<Vector2d> in_plane_;
    std::vector<std::uint32_t> before_, after_; ///< of each corner that is left
    std::vector<std::uint32_t> changes_;        ///< of each corner; kNone: it is cut off
    std::vector<std::uint32_t> beyond_; ///< half edge beyond the edge that begins there
    CornersInTheWay in_the_way_;
    std::vector<Candidate> candidates_; ///< a heap
    /// Half edges, three a triangle: where they begin, and what goes the other way.
    std::vector<std::uint32_t> tails_, twins_;
    std::vector<std::uint32_t> listed_; ///< corners, then half edges
};

FaceCutter::FaceCutter(const Geometry& geometry) : geometry_(geometry) {}

FaceCutter::~FaceCutter() = default;

std::span<const FaceCutter::Triangle>
FaceCutter::cut(std::span<const std::uint32_t> corners)
{
    several_.clear();
    if (corners.size() < 3)
        return several_;
    const std::vector<Vector3d>& samples = geometry_.samples;
    if (corners.size() == 4)
    {
        const auto [a, b, c, d] =
            std::array{corners[0], corners[1], corners[2], corners[3]};
        const Diagonal diagonal =
            diagonal_of(samples[a], samples[b], samples[c], samples[d]);
        const bool is_either_first =
            diagonal == Diagonal::Either &&
            is_first_in(samples[a], samples[b], samples[c], samples[d]);
        if (diagonal == Diagonal::First || is_either_first)
            several_.insert(several_.end(), {{a, b, c}, {a, c, d}});
        else if (diagonal != Diagonal::Unclear)
            several_.insert(several_.end(), {{a, b, d}, {b, c, d}});
        if (!several_.empty())
            return several_;
    }
    if (!polygon_)
        polygon_ = std::make_unique<Polygon>();
    polygon_->cut(samples, corners, several_);
    return several_;
}

std::vector<FaceCutter::Triangle> triangles_of(const Geometry& geometry)
{
    std::vector<FaceCutter::Triangle> all;
    all.reserve(geometry.num_triangles());
    FaceCutter cutter(geometry);
    std::size_t begin = 0;
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::size_t end = geometry.face_ends[f];
        if (end - begin == 3)
            all.push_back({geometry.corners[begin], geometry.corners[begin + 1],
                           geometry.corners[begin + 2]});
        else
        {
            const std::span<const FaceCutter::Triangle> of_face = cutter.triangles(f);
            all.insert(all.end(), of_face.begin(), of_face.end());
        }
        begin = end;
    }
    return all;
}

} // namespace cellwarp::core
