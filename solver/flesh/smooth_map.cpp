// SPDX-License-Identifier: GPL-3.0-or-later
// With B(t) the product of three quadratic B-splines and s the edge of the cells, the map
//   x(X) = sum_a B(X / s - a) c_a
// over the 27 nodes around the nearest one is the trilinear map averaged over a box of
// edge s. It is continuous with its gradient, and exact for affine maps, since sum_a a
// B(x - a) = x. With c_a = x_a it would smooth what bends, by s^2 u'' / 8. The
// coefficients
//   c_a = x_a - 1/8 sum_e (x_{a-e} - 2 x_a + x_{a+e}),   e the axes,
// undo that up to third derivatives [deBoor78].
//
// Border. A node beyond the material has the coefficient that continues those of the two
// next nodes along an axis linearly, the mean over the axes that lead to such. Along an
// axis on which a node is the last one, its second difference is 0. A node around which
// there is next to no material is where little holds it, and counts as one beyond, if
// there are two others along an axis on which it is the last one.
//
// Cells of several sizes. The map is a spline on the grid of the smallest cells, or of
// twice their edge, and so on, where that grid would have too many boxes. Its
// nodes in larger cells are those of the same map on a grid of twice the edge, and so on:
// so the map is one spline, and smooth, whatever its values are. On a coarser grid the
// smaller cells of a box, as far as glue joins them, are one box; a corner of it that
// none of them has continues the trilinear map of the one next to it.
//
// Glue. What a box sees are the 64 corners of itself and of the boxes around it. One of
// these is a node of the lattice where glue leads to a box that has it, straight or round
// a corner; of several (a palm sees two fingers at one place) the one that is fewer boxes
// away. It also sees what a glued box sees, unless the boxes that have it touch this one
// and glue does not lead there. So a finger sees no node of the next one, and what nobody
// has is continued from its own nodes.
//
// Forks. The maps of two glued boxes may thus differ. Then one of them, b, goes over to
// the other ones, n, at their sides: with t_n the way from that side in edges, w = t^2 (3
// - 2 t) and r = (1 - w) / w its map is (x_b + sum_n r_n x_n) / (1 + sum_n r_n). On the
// side value and gradient are those of n, which there is continued, as r^-1 grows with
// t^2; on the far side they are its own. So that nothing jumps on the other sides of b,
// it goes over to all glued boxes but to those that go over to it: those that come later,
// boxes that have several ones on one side first. What is left are the lines where a slit
// ends.
#include "solver/flesh/smooth_map.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "octree/base/parallel.h"
#include "octree/base/union_find.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

constexpr std::size_t kStencilsAtOnce = 16; ///< of one thread

/// So much material around a node is enough to hold it [volume of a box].
constexpr double kEnough = 0.5;

/// Corners along an axis that a box sees: -1, 0, 1, 2 from its first one, in its edges.
constexpr int kWide = 4, kSeen = kWide * kWide * kWide;

/// The number of a place among those that a box sees.
int number_of(const Vector3i& place)
{
    return ((place.z() + 1) * kWide + place.y() + 1) * kWide + place.x() + 1;
}
Vector3i place_of(int number)
{
    return Vector3i(number % kWide, number / kWide % kWide, number / (kWide * kWide)) -
           Vector3i::Ones();
}
bool is_seen(const Vector3i& place)
{
    return (place.array() >= -1).all() && (place.array() <= 2).all();
}
/// Number of coordinates that lie beyond the box.
int num_beyond(const Vector3i& place)
{
    return static_cast<int>((place.array() < 0 || place.array() > 1).count());
}
/// Corner k of a box.
Vector3i corner_place(int k)
{
    return {k & 1, k >> 1 & 1, k >> 2 & 1};
}
/// Neighbour k of the 27 around a corner or a box, itself among them.
Vector3i around(int k)
{
    return Vector3i(k % 3, k / 3 % 3, k / 9) - Vector3i::Ones();
}
Vector3i middle_of(const Vector3d& local)
{
    return (local.array() >= 0.5).cast<int>();
}

/// Calls visit(place seen from a box, the same from the box one \p step on) for all that
/// both see.
template <class Visit>
void for_common(const Vector3i& step, const Visit& visit)
{
    for (int n = 0; n < kSeen; ++n)
        if (const Vector3i place = place_of(n); is_seen(place - step))
            visit(place, place - step);
}

/// The three splines at a place t from the middle one, and their slopes.
struct Splines
{
    explicit Splines(double t)
        : values{0.5 * (0.5 - t) * (0.5 - t), 0.75 - t * t, 0.5 * (0.5 + t) * (0.5 + t)},
          slopes{t - 0.5, -2.0 * t, t + 0.5}
    {
    }
    std::array<double, 3> values, slopes;
};

/// A number and its slope along the axes.
struct Sloped
{
    double value = 0.0;
    Vector3d slope = Vector3d::Zero();

    Sloped operator+(const Sloped& other) const
    {
        return {value + other.value, slope + other.slope};
    }
    Sloped operator*(const Sloped& other) const
    {
        return {value * other.value, value * other.slope + other.value * slope};
    }
    Sloped operator/(const Sloped& other) const
    {
        const double share = value / other.value;
        return {share, (slope - share * other.slope) / other.value};
    }
};

/// The values around a node, and their map.
class Around
{
public:
    Around(std::span<const Vector3d> slots, std::span<const std::int32_t, 27> numbers)
    {
        for (std::size_t k = 0; k < 27; ++k)
            values_[k] = slots[idx(numbers[k])];
    }

    /// \p t: from the node, in edges; so are gradients.
    SmoothMap::Value at(const Vector3d& t, bool wants_gradient) const
    {
        const Splines x(t.x()), y(t.y()), z(t.z());
        SmoothMap::Value out;
        for (std::size_t c = 0; c < 3; ++c)
            for (std::size_t b = 0; b < 3; ++b)
            {
                const Vector3d* const row = &values_[9 * c + 3 * b];
                const Vector3d along =
                    x.values[0] * row[0] + x.values[1] * row[1] + x.values[2] * row[2];
                out.displacement += z.values[c] * y.values[b] * along;
                if (!wants_gradient)
                    continue;
                out.gradient.col(0) +=
                    z.values[c] * y.values[b] *
                    (x.slopes[0] * row[0] + x.slopes[1] * row[1] + x.slopes[2] * row[2]);
                out.gradient.col(1) += z.values[c] * y.slopes[b] * along;
                out.gradient.col(2) += z.slopes[c] * y.values[b] * along;
            }
        return out;
    }

private:
    std::array<Vector3d, 27> values_;
};

/// A side at which the map of a box goes over to that of the box beyond it.
struct ForkSide
{
    Vector3i towards = Vector3i::Zero(); ///< unit vector
    int box = 0;
};

/// The boxes of one edge: cells of that edge, what smaller cells make together, and the
/// parts of larger cells.
struct SmoothLevel
{
    int width = 1;                 ///< [finest leaf]
    std::vector<Vector3i> corners; ///< of the boxes
    std::vector<int> cell_of_box;  ///< the first one of several
    std::vector<int> box_of_cell;  ///< of a larger one the first part
    std::vector<std::vector<int>>
        smaller; ///< of each box, the smaller cells that make it
    std::vector<std::pair<int, int>> glued; ///< the second one lies one edge higher
    /// For each box and axis the boxes glued to it below and above.
    std::vector<std::array<std::vector<int>, 6>> beside;
    /// The corners that each box sees: equal numbers are one corner.
    std::vector<std::array<std::int32_t, kSeen>> seen;
    std::vector<std::int32_t> first_place; ///< of each corner, and one for their end
    std::vector<std::int32_t> places;      ///< kSeen * box + what it sees, ascending
    std::vector<std::int32_t> node;        ///< of each corner the lattice's; -1: none
    std::vector<char> is_corner;           ///< of some box
    std::vector<char> is_real;             ///< likewise, with enough material around it
    /// Slots of values and coefficients; -1: not found yet.
    std::vector<std::int32_t> value, coefficient;

    Vector3i step(int from, int to) const
    {
        return (corners[idx(to)] - corners[idx(from)]) / width;
    }
};

} // namespace

class SmoothMapBuilder
{
public:
    SmoothMapBuilder(const Octree& octree, const Cells& cells, const Lattice& lattice,
                     std::size_t most_boxes, SmoothMap& out)
        : octree_(octree), cells_(cells), lattice_(lattice), out_(out)
    {
        out_.num_nodes_ = lattice.places.size();
        if (cells.cells.empty())
            return;
        std::size_t smallest = 0, largest = 0;
        for (std::size_t c = 0; c < cells.size(); ++c)
        {
            smallest = width(c) < width(smallest) ? c : smallest;
            largest = width(c) > width(largest) ? c : largest;
        }
        int finest = width(smallest);
        while (finest < width(largest) && num_boxes(finest) > most_boxes)
            finest *= 2;
        out_.edge_ = lattice.edge(static_cast<int>(smallest)) * finest / width(smallest);
        for (int w = finest; w <= width(largest); w *= 2)
            add_level(w);
        find_forks(levels_[0]);
    }

    void add(std::span<const SmoothMap::Place> places)
    {
        std::map<std::pair<int, int>, std::size_t> known; // box, middle corner
        std::vector<std::vector<SmoothMap::PlaceInStencil>> of_stencil;
        for (std::size_t i = 0; i < places.size(); ++i)
        {
            Vector3d local = places[i].local;
            const int box = part_at(0, places[i].cell, local);
            if (forks_.contains(box))
            {
                SmoothMap::ForkedPlace& place = out_.forked_.emplace_back();
                place.number = i;
                add_terms(box, local, {1.0, Vector3d::Zero()}, place.terms);
                continue;
            }
            const Vector3i middle = middle_of(local);
            const auto [found, is_new] =
                known.emplace(std::pair(box, number_of(middle)), of_stencil.size());
            if (is_new)
            {
                of_stencil.emplace_back();
                out_.stencils_.push_back({slots_around(box, middle), 0});
            }
            of_stencil[found->second].push_back({local - middle.cast<double>(), i});
        }
        for (std::size_t s = 0; s < of_stencil.size(); ++s)
        {
            out_.stencils_[s].first_place = out_.places_.size();
            out_.places_.insert(out_.places_.end(), of_stencil[s].begin(),
                                of_stencil[s].end());
        }
        out_.stencils_.emplace_back().first_place = out_.places_.size();
    }

private:
    int width(std::size_t cell) const
    {
        return octree_.width(octree_[cells_.cells[cell].leaf]);
    }
    const Vector3i& corner(std::size_t cell) const
    {
        return octree_[cells_.cells[cell].leaf].corner;
    }

    /// Boxes of a level, where each smaller cell counts as a part of one.
    std::size_t num_boxes(int width_of_level) const
    {
        double sum = 0.0;
        for (std::size_t c = 0; c < cells_.size(); ++c)
            sum += std::pow(static_cast<double>(width(c)) / width_of_level, 3);
        return static_cast<std::size_t>(std::ceil(sum));
    }

    void add_level(int width_of_level)
    {
        SmoothLevel& level = levels_.emplace_back();
        level.width = width_of_level;
        add_boxes(level);
        add_glue(level);
        find_seen(level);
        find_nodes(level);
        list_places(level);
        leave_what_little_holds(level);
    }

    void add_boxes(SmoothLevel& level) const
    {
        const int w = level.width;
        const auto corner_above = [&](std::size_t cell)
        { return Vector3i(corner(cell).unaryExpr([&](int x) { return x / w * w; })); };
        UnionFind joined(cells_.size());
        for (const Face& face : cells_.faces)
            if (width(idx(face.a)) < w && width(idx(face.b)) < w &&
                corner_above(idx(face.a)) == corner_above(idx(face.b)))
                joined.join(face.a, face.b);
        level.box_of_cell.assign(cells_.size(), -1);
        for (std::size_t c = 0; c < cells_.size(); ++c)
        {
            const auto first = idx(joined.first_of(static_cast<int>(c)));
            if (first == c)
            {
                level.box_of_cell[c] = static_cast<int>(level.corners.size());
                const int parts = std::max(1, width(c) / w);
                const Vector3i from = width(c) < w ? corner_above(c) : corner(c);
                for (int k = 0; k < parts * parts * parts; ++k)
                {
                    const Vector3i part(k % parts, k / parts % parts,
                                        k / (parts * parts));
                    level.corners.push_back(from + w * part);
                    level.cell_of_box.push_back(static_cast<int>(c));
                    level.smaller.emplace_back();
                }
            }
            level.box_of_cell[c] = level.box_of_cell[first];
            if (width(c) < w)
                level.smaller[idx(level.box_of_cell[c])].push_back(static_cast<int>(c));
        }
    }

    /// The box of a level that a cell is, or is in; of several the one at \p place.
    int box_at(const SmoothLevel& level, int cell, const Vector3i& place) const
    {
        const int first = level.box_of_cell[idx(cell)];
        const int parts = width(idx(cell)) / level.width;
        if (parts <= 1)
            return first;
        const Vector3i part = (place - corner(idx(cell))) / level.width;
        return first + (part.z() * parts + part.y()) * parts + part.x();
    }

    void add_glue(SmoothLevel& level) const
    {
        const int w = level.width;
        for (const Face& face : cells_.faces)
        {
            const int a = level.box_of_cell[idx(face.a)],
                      b = level.box_of_cell[idx(face.b)];
            if (a == b)
                continue;
            const auto size = [&](int cell) { return std::max(w, width(idx(cell))); };
            const Vector3i low =
                level.corners[idx(a)].cwiseMax(level.corners[idx(b)]); // on their side
            const Vector3i high = (level.corners[idx(a)].array() + size(face.a))
                                      .min(level.corners[idx(b)].array() + size(face.b));
            const int i = (face.axis + 1) % 3, j = (face.axis + 2) % 3;
            Vector3i place = low;
            for (place[i] = low[i]; place[i] < high[i]; place[i] += w)
                for (place[j] = low[j]; place[j] < high[j]; place[j] += w)
                    level.glued.emplace_back(
                        box_at(level, face.a, place - w * Vector3i::Unit(face.axis)),
                        box_at(level, face.b, place));
        }
        for (std::size_t c = 0; c < cells_.size(); ++c)
        {
            const int parts = width(c) / w;
            for (int k = 0; parts > 1 && k < parts * parts * parts; ++k)
            {
                const int box = level.box_of_cell[c] + k;
                const Vector3i at(k % parts, k / parts % parts, k / (parts * parts));
                for (int axis = 0, step = 1; axis < 3; ++axis, step *= parts)
                    if (at[axis] + 1 < parts)
                        level.glued.emplace_back(box, box + step);
            }
        }
        std::sort(level.glued.begin(), level.glued.end());
        level.glued.erase(std::unique(level.glued.begin(), level.glued.end()),
                          level.glued.end());
        level.beside.resize(level.corners.size());
        for (const auto& [a, b] : level.glued)
        {
            int axis = 0;
            level.step(a, b).maxCoeff(&axis);
            level.beside[idx(b)][idx(2 * axis)].push_back(a);
            level.beside[idx(a)][idx(2 * axis + 1)].push_back(b);
        }
    }

    bool is_part(const SmoothLevel& level, std::size_t box) const
    {
        return width(idx(level.cell_of_box[box])) > level.width;
    }

    /// The boxes around one to which glue leads, straight or round a corner.
    static std::array<std::vector<int>, 27> boxes_around(const SmoothLevel& level,
                                                         int box)
    {
        std::array<std::vector<int>, 27> reached;
        const auto number = [](const Vector3i& step)
        { return idx(9 * (step.z() + 1) + 3 * (step.y() + 1) + step.x() + 1); };
        reached[number(Vector3i::Zero())] = {box};
        for (int steps = 1; steps <= 3; ++steps)
            for (int k = 0; k < 27; ++k)
            {
                const Vector3i step = around(k);
                if (step.cwiseAbs().sum() != steps)
                    continue;
                std::vector<int>& out = reached[idx(k)];
                for (int axis = 0; axis < 3; ++axis)
                    if (step[axis] != 0)
                        for (const int from :
                             reached[number(step - step[axis] * Vector3i::Unit(axis))])
                        {
                            const std::vector<int>& next =
                                level.beside[idx(from)][idx(2 * axis + (step[axis] > 0))];
                            out.insert(out.end(), next.begin(), next.end());
                        }
                std::sort(out.begin(), out.end());
                out.erase(std::unique(out.begin(), out.end()), out.end());
            }
        return reached;
    }

    static void find_seen(SmoothLevel& level)
    {
        const std::size_t num_boxes = level.corners.size();
        const auto corner_at = [](int box, const Vector3i& place)
        { return 8 * box + place.x() + 2 * place.y() + 4 * place.z(); };
        UnionFind own(8 * num_boxes);
        for (const auto& [a, b] : level.glued)
            for_common(level.step(a, b),
                       [&, a = a, b = b](const Vector3i& in_a, const Vector3i& in_b)
                       {
                           if (num_beyond(in_a) == 0 && num_beyond(in_b) == 0)
                               own.join(corner_at(a, in_a), corner_at(b, in_b));
                       });
        std::vector<std::int32_t> number(8 * num_boxes, -1);
        for (std::size_t e = 0; e < 8 * num_boxes; ++e)
        {
            const auto first = idx(own.first_of(static_cast<int>(e)));
            if (first == e)
            {
                number[e] = static_cast<std::int32_t>(level.is_corner.size());
                level.is_corner.push_back(1);
            }
            number[e] = number[first];
        }
        level.seen.resize(num_boxes);
        for (std::size_t box = 0; box < num_boxes; ++box)
        {
            const auto reached = boxes_around(level, static_cast<int>(box));
            for (int n = 0; n < kSeen; ++n)
            {
                const Vector3i place = place_of(n);
                std::pair<int, std::int32_t> best{4, -1}; // steps, corner
                for (int k = 0; k < 27; ++k)
                    if (const Vector3i there = place - around(k); num_beyond(there) == 0)
                        for (const int other : reached[idx(k)])
                            best = std::min(
                                best, std::pair(around(k).cwiseAbs().sum(),
                                                number[idx(corner_at(other, there))]));
                level.seen[box][idx(n)] = best.second;
            }
        }
        see_through_others(level, number);
        // A corner that no box has is one for two glued boxes that both see none there.
        UnionFind beyond(kSeen * num_boxes);
        const auto element = [](int box, const Vector3i& place)
        { return kSeen * box + number_of(place); };
        for (const auto& [a, b] : level.glued)
            for_common(level.step(a, b),
                       [&, a = a, b = b](const Vector3i& in_a, const Vector3i& in_b)
                       {
                           if (level.seen[idx(a)][idx(number_of(in_a))] < 0 &&
                               level.seen[idx(b)][idx(number_of(in_b))] < 0)
                               beyond.join(element(a, in_a), element(b, in_b));
                       });
        for (std::size_t e = 0; e < kSeen * num_boxes; ++e)
        {
            std::int32_t& seen = level.seen[e / kSeen][e % kSeen];
            if (seen >= 0)
                continue;
            const auto first = idx(beyond.first_of(static_cast<int>(e)));
            if (first == e)
            {
                seen = static_cast<std::int32_t>(level.is_corner.size());
                level.is_corner.push_back(0);
            }
            seen = level.seen[first / kSeen][first % kSeen];
        }
    }

    /// \p number: the corners that boxes have, eight each.
    static void see_through_others(SmoothLevel& level,
                                   std::span<const std::int32_t> number)
    {
        std::vector<std::vector<int>> owners(level.is_corner.size());
        for (std::size_t e = 0; e < number.size(); ++e)
            owners[idx(number[e])].push_back(static_cast<int>(e / 8));
        const auto is_apart = [&](int box, std::int32_t corner)
        {
            return std::none_of(
                owners[idx(corner)].begin(), owners[idx(corner)].end(),
                [&](int owner)
                { return level.step(box, owner).cwiseAbs().maxCoeff() <= 1; });
        };
        for (bool has_changed = true; std::exchange(has_changed, false);)
            for (const auto& [a, b] : level.glued)
                for_common(level.step(a, b),
                           [&, a = a, b = b](const Vector3i& in_a, const Vector3i& in_b)
                           {
                               std::int32_t &of_a =
                                                level.seen[idx(a)][idx(number_of(in_a))],
                                            &of_b =
                                                level.seen[idx(b)][idx(number_of(in_b))];
                               if (of_a >= 0 && of_b < 0 && is_apart(b, of_a))
                                   of_b = of_a;
                               else if (of_b >= 0 && of_a < 0 && is_apart(a, of_b))
                                   of_a = of_b;
                               else
                                   return;
                               has_changed = true;
                           });
    }

    /// The lattice's nodes at corners; of several those that do not hang first.
    void find_nodes(SmoothLevel& level) const
    {
        level.node.assign(level.is_corner.size(), -1);
        for (std::size_t c = 0; c < cells_.size(); ++c)
            for (int k = 0; k < 8; ++k)
            {
                const Vector3i bits = corner_place(k);
                const Vector3i place = corner(c) + width(c) * bits;
                const int box = box_at(level, static_cast<int>(c),
                                       place - level.width * bits); // inside of the cell
                const Vector3i from = place - level.corners[idx(box)];
                if (!(from.array() == 0 || from.array() == level.width).all())
                    continue;
                std::int32_t& node = level.node[idx(
                    level.seen[idx(box)][idx(number_of(from / level.width))])];
                const int found = lattice_.cells[c][idx(k)];
                if (node < 0 || (!lattice_.hanging[idx(node)].empty() &&
                                 lattice_.hanging[idx(found)].empty()))
                    node = found;
            }
    }

    static void list_places(SmoothLevel& level)
    {
        const std::size_t count = level.is_corner.size();
        level.value.assign(count, -1);
        level.coefficient.assign(count, -1);
        level.first_place.assign(count + 1, 0);
        for (const auto& of_box : level.seen)
            for (const std::int32_t seen : of_box)
                ++level.first_place[idx(seen) + 1];
        for (std::size_t c = 0; c < count; ++c)
            level.first_place[c + 1] += level.first_place[c];
        level.places.resize(kSeen * level.seen.size());
        std::vector<std::int32_t> next(level.first_place.begin(),
                                       level.first_place.end() - 1);
        for (std::size_t e = 0; e < level.places.size(); ++e)
            level.places[idx(next[idx(level.seen[e / kSeen][e % kSeen])]++)] =
                static_cast<std::int32_t>(e);
    }

    void leave_what_little_holds(SmoothLevel& level) const
    {
        std::vector<double> around(level.is_corner.size(), 0.0); // material [box]
        for (std::size_t box = 0; box < level.seen.size(); ++box)
        {
            const auto share = [&](int cell)
            {
                const Cell& of = cells_.cells[idx(cell)];
                const double in_boxes =
                    static_cast<double>(std::min(width(idx(cell)), level.width)) /
                    level.width / of.edge;
                return of.volume * in_boxes * in_boxes * in_boxes;
            };
            double held = 0.0;
            if (level.smaller[box].empty())
                held = share(level.cell_of_box[box]);
            for (const int cell : level.smaller[box])
                held += share(cell);
            for (int k = 0; k < 8; ++k)
                around[idx(level.seen[box][idx(number_of(corner_place(k)))])] += held;
        }
        std::vector<char> is_enough = level.is_corner;
        for (std::size_t c = 0; c < around.size(); ++c)
            is_enough[c] = is_enough[c] && around[c] >= kEnough;
        level.is_real = is_enough;
        for (std::size_t c = 0; c < around.size(); ++c)
            if (level.is_corner[c] && !is_enough[c])
                level.is_real[c] =
                    ways_inward(level, static_cast<int>(c), is_enough).empty();
    }

    /// The next two corners, both good, along each axis on which a corner of boxes is the
    /// last one.
    std::vector<std::pair<int, int>> ways_inward(const SmoothLevel& level, int corner,
                                                 const std::vector<char>& is_good) const
    {
        std::vector<std::pair<int, int>> ways;
        for (const std::int32_t place : places_of(level, corner))
        {
            const Vector3i at = place_of(place % kSeen);
            if (num_beyond(at) > 0)
                continue;
            const auto& seen = level.seen[idx(place) / kSeen];
            for (int axis = 0; axis < 3; ++axis)
            {
                const Vector3i step = Vector3i::Unit(axis) * (at[axis] == 0 ? 1 : -1);
                const std::int32_t next = seen[idx(number_of(at + step))],
                                   after = seen[idx(number_of(at + 2 * step))];
                const std::int32_t beyond = seen[idx(number_of(at - step))];
                if (is_good[idx(next)] && is_good[idx(after)] &&
                    !level.is_corner[idx(beyond)])
                    ways.emplace_back(next, after);
            }
        }
        return ways;
    }

    std::span<const std::int32_t> places_of(const SmoothLevel& level, int corner) const
    {
        const std::size_t first = idx(level.first_place[idx(corner)]);
        return std::span(level.places)
            .subspan(first, idx(level.first_place[idx(corner) + 1]) - first);
    }

    /// The box of a level that a place of a cell lies in; \p local becomes that in the
    /// box.
    int part_at(std::size_t level, int cell, Vector3d& local) const
    {
        const int w = levels_[level].width;
        const Vector3d place =
            corner(idx(cell)).cast<double>() + width(idx(cell)) * local;
        const int last = std::max(0, width(idx(cell)) / w - 1);
        const Vector3i part = (local * width(idx(cell)) / w)
                                  .array()
                                  .floor()
                                  .max(0.0)
                                  .min(static_cast<double>(last))
                                  .cast<int>();
        const int box = box_at(levels_[level], cell, corner(idx(cell)) + w * part);
        local = (place - levels_[level].corners[idx(box)].cast<double>()) / w;
        return box;
    }

    /// A new slot, unless the row is one.
    std::int32_t slot_of(NodeShares row)
    {
        row = gathered(std::move(row));
        if (row.size() == 1 && row.front().share == 1.0)
            return row.front().node;
        out_.rows_.add(row);
        return static_cast<std::int32_t>(out_.num_nodes_ + out_.rows_.size() - 1);
    }

    std::int32_t value_of(std::size_t level, int corner)
    {
        if (const std::int32_t known = levels_[level].value[idx(corner)]; known >= 0)
            return known;
        const std::int32_t found = new_value(level, corner);
        return levels_[level].value[idx(corner)] = found;
    }

    std::int32_t new_value(std::size_t number, int corner)
    {
        const SmoothLevel& level = levels_[number];
        const std::int32_t node = level.node[idx(corner)];
        if (node >= 0 && lattice_.hanging[idx(node)].empty())
            return node;
        for (const std::int32_t place : places_of(level, corner))
        {
            const std::size_t box = idx(place) / kSeen;
            const Vector3i at = place_of(place % kSeen);
            if (num_beyond(at) > 0 || !is_part(level, box))
                continue;
            // Inside of a larger cell: the map of the next level.
            const int cell = level.cell_of_box[box];
            Vector3d local =
                (level.corners[box] + level.width * at - this->corner(idx(cell)))
                    .cast<double>() /
                width(idx(cell));
            const int above = part_at(number + 1, cell, local);
            return slot_of(map_at(number + 1, above, local));
        }
        return node >= 0 ? node : slot_of(continued(level, corner));
    }

    /// The trilinear map of the smaller cell that is nearest to a corner of its box.
    NodeShares continued(const SmoothLevel& level, int corner) const
    {
        int nearest = -1;
        double least = 0.0;
        Vector3d local_there = Vector3d::Zero();
        for (const std::int32_t place : places_of(level, corner))
        {
            const Vector3i at = place_of(place % kSeen);
            if (num_beyond(at) > 0)
                continue;
            for (const std::size_t box = idx(place) / kSeen;
                 const int cell : level.smaller[box])
            {
                const Vector3d local =
                    (level.corners[box] + level.width * at - this->corner(idx(cell)))
                        .cast<double>() /
                    width(idx(cell));
                const double beyond =
                    (local - local.cwiseMax(0.0).cwiseMin(1.0)).norm() * width(idx(cell));
                if (nearest >= 0 && beyond >= least)
                    continue;
                nearest = cell;
                least = beyond;
                local_there = local;
            }
        }
        return shares_of(lattice_.cells[idx(nearest)], lattice_.hanging, local_there);
    }

    /// The shares of slots in the map of a level at a place of a box.
    NodeShares map_at(std::size_t level, int box, const Vector3d& local)
    {
        const Vector3i middle = middle_of(local);
        const Vector3d t = local - middle.cast<double>();
        const Splines x(t.x()), y(t.y()), z(t.z());
        NodeShares row;
        for (int k = 0; k < 27; ++k)
        {
            const double share =
                x.values[idx(k % 3)] * y.values[idx(k / 3 % 3)] * z.values[idx(k / 9)];
            if (share != 0.0)
                row.push_back({coefficient_of(level, levels_[level].seen[idx(box)][idx(
                                                         number_of(middle + around(k)))]),
                               share});
        }
        return row;
    }

    std::int32_t coefficient_of(std::size_t level, int corner)
    {
        if (const std::int32_t known = levels_[level].coefficient[idx(corner)];
            known >= 0)
            return known;
        const std::int32_t found = levels_[level].is_real[idx(corner)]
                                       ? real_coefficient(level, corner)
                                       : coefficient_beyond(level, corner);
        return levels_[level].coefficient[idx(corner)] = found;
    }

    /// x - 1/8 of the second differences.
    std::int32_t real_coefficient(std::size_t number, int corner)
    {
        const SmoothLevel& level = levels_[number];
        const std::int32_t here = value_of(number, corner);
        NodeShares row = {{here, 1.0}};
        for (int axis = 0; axis < 3; ++axis)
            for (const std::int32_t place : places_of(level, corner))
            {
                const Vector3i at = place_of(place % kSeen);
                if (num_beyond(at) > 0)
                    continue;
                const auto& seen = level.seen[idx(place) / kSeen];
                const int below = seen[idx(number_of(at - Vector3i::Unit(axis)))],
                          above = seen[idx(number_of(at + Vector3i::Unit(axis)))];
                if (!level.is_real[idx(below)] || !level.is_real[idx(above)])
                    continue;
                row.push_back({value_of(number, below), -0.125});
                row.push_back({here, 0.25});
                row.push_back({value_of(number, above), -0.125});
                break;
            }
        return slot_of(std::move(row));
    }

    /// Continues the coefficients of the two next corners along an axis: the mean of
    /// all ways from where it is seen with the fewest coordinates beyond a box.
    std::int32_t coefficient_beyond(std::size_t number, int corner)
    {
        const SmoothLevel& level = levels_[number];
        int least = 3;
        for (const std::int32_t place : places_of(level, corner))
            least = std::min(least, num_beyond(place_of(place % kSeen)));
        std::vector<std::pair<int, int>> ways; // next corner, and the one after it
        if (least == 0)
            ways = ways_inward(level, corner, level.is_real);
        for (const std::int32_t place : places_of(level, corner))
        {
            const Vector3i at = place_of(place % kSeen);
            if (least == 0 || num_beyond(at) > least)
                continue;
            const auto& seen = level.seen[idx(place) / kSeen];
            for (int axis = 0; axis < 3; ++axis)
                if (at[axis] < 0 || at[axis] > 1)
                {
                    const Vector3i step = Vector3i::Unit(axis) * (at[axis] < 0 ? 1 : -1);
                    ways.emplace_back(seen[idx(number_of(at + step))],
                                      seen[idx(number_of(at + 2 * step))]);
                }
        }
        std::sort(ways.begin(), ways.end());
        ways.erase(std::unique(ways.begin(), ways.end()), ways.end());
        NodeShares row;
        const double share = 1.0 / static_cast<double>(ways.size());
        for (const auto& [next, after] : ways)
        {
            row.push_back({coefficient_of(number, next), 2.0 * share});
            row.push_back({coefficient_of(number, after), -share});
        }
        return slot_of(std::move(row));
    }

    SmoothMap::Slots slots_around(int box, const Vector3i& middle)
    {
        SmoothMap::Slots slots;
        for (int k = 0; k < 27; ++k)
            slots[idx(k)] = coefficient_of(
                0, levels_[0].seen[idx(box)][idx(number_of(middle + around(k)))]);
        return slots;
    }

    /// Boxes whose maps differ from those of glued ones.
    void find_forks(const SmoothLevel& level)
    {
        std::vector<std::size_t> most; // boxes on one side
        for (const auto& of_box : level.beside)
            most.push_back(std::max_element(of_box.begin(), of_box.end(),
                                            [](const auto& a, const auto& b)
                                            { return a.size() < b.size(); })
                               ->size());
        const auto comes_before = [&](int a, int b)
        {
            return std::pair(-static_cast<std::ptrdiff_t>(most[idx(a)]), a) <
                   std::pair(-static_cast<std::ptrdiff_t>(most[idx(b)]), b);
        };
        for (const auto& [a, b] : level.glued)
        {
            bool differ = false;
            for_common(level.step(a, b),
                       [&, a = a, b = b](const Vector3i& in_a, const Vector3i& in_b)
                       {
                           differ |= level.seen[idx(a)][idx(number_of(in_a))] !=
                                     level.seen[idx(b)][idx(number_of(in_b))];
                       });
            if (differ)
                forks_.try_emplace(comes_before(a, b) ? b : a);
        }
        for (auto& [box, sides] : forks_)
            for (const auto& of_side : level.beside[idx(box)])
                for (const int other : of_side)
                    if (!forks_.contains(other) || comes_before(other, box))
                        sides.push_back({level.step(box, other), other});
    }

    /// The maps that count at a place of a box, which may lie beyond it, with \p weight.
    void add_terms(int box, const Vector3d& local, const Sloped& weight,
                   std::vector<SmoothMap::Term>& terms)
    {
        if (weight.value == 0.0 && weight.slope.isZero(0.0))
            return;
        const auto found = forks_.find(box);
        const std::vector<ForkSide> sides =
            found == forks_.end() ? std::vector<ForkSide>() : found->second;
        // All is times the product of the w: nothing divides by 0 on one side.
        std::vector<Sloped> w;
        for (const ForkSide& side : sides)
        {
            const double way = side.towards.cast<double>().dot(local);
            const double t =
                std::clamp(side.towards.sum() < 0 ? -way : 1.0 - way, 0.0, 1.0);
            w.push_back({t * t * (3.0 - 2.0 * t),
                         -6.0 * t * (1.0 - t) * side.towards.cast<double>()});
        }
        const auto product_but = [&](std::size_t left_out)
        {
            Sloped product{1.0, Vector3d::Zero()};
            for (std::size_t k = 0; k < w.size(); ++k)
                if (k != left_out)
                    product = product * w[k];
            return product;
        };
        Sloped own = product_but(w.size()), sum = own;
        std::vector<Sloped> shares;
        for (std::size_t k = 0; k < w.size(); ++k)
        {
            shares.push_back(Sloped{1.0 - w[k].value, -w[k].slope} * product_but(k));
            sum = sum + shares[k];
        }
        if (!(sum.value > 0.0)) // on an edge between two sides, where either will do
        {
            own = {};
            shares.assign(w.size(), {});
            shares[0].value = sum.value = 1.0;
            sum.slope.setZero();
        }
        own = own / sum * weight;
        if (own.value != 0.0 || !own.slope.isZero(0.0))
        {
            const Vector3i middle = middle_of(local);
            terms.push_back({slots_around(box, middle), local - middle.cast<double>(),
                             own.value, own.slope});
        }
        for (std::size_t k = 0; k < sides.size(); ++k)
            add_terms(sides[k].box, local - sides[k].towards.cast<double>(),
                      shares[k] / sum * weight, terms);
    }

    const Octree& octree_;
    const Cells& cells_;
    const Lattice& lattice_;
    SmoothMap& out_;
    std::vector<SmoothLevel> levels_; ///< from the smallest boxes on
    std::map<int, std::vector<ForkSide>> forks_;
};

SmoothMap::SmoothMap(const Octree& octree, const Cells& cells, const Lattice& lattice,
                     std::span<const Place> places, std::size_t most_boxes)
{
    SmoothMapBuilder(octree, cells, lattice, most_boxes, *this).add(places);
}

std::vector<SmoothMap::Value> SmoothMap::values(const Eigen::VectorXd& u,
                                                std::size_t without) const
{
    std::vector<Vector3d> slots;
    slots.reserve(num_nodes_ + rows_.size());
    for (std::size_t n = 0; n < num_nodes_; ++n)
        slots.push_back(u.segment<3>(Eigen::Index(3 * n)));
    for (std::size_t r = 0; r < rows_.size(); ++r)
    {
        Vector3d sum = Vector3d::Zero();
        for (const NodeShare& share : rows_[r])
            sum += share.share * slots[idx(share.node)];
        slots.push_back(sum);
    }
    std::vector<Value> out(places_.size() + forked_.size());
    const std::size_t num_stencils = stencils_.empty() ? 0 : stencils_.size() - 1;
    parallel_for(num_stencils, kStencilsAtOnce,
                 [&](std::size_t s)
                 {
                     const Around around(slots, stencils_[s].slots);
                     for (std::size_t i = stencils_[s].first_place;
                          i < stencils_[s + 1].first_place; ++i)
                     {
                         Value value =
                             around.at(places_[i].local, places_[i].number >= without);
                         value.gradient /= edge_;
                         out[places_[i].number] = value;
                     }
                 });
    parallel_for(forked_.size(), kStencilsAtOnce,
                 [&](std::size_t f)
                 {
                     const bool wants_gradient = forked_[f].number >= without;
                     Value sum;
                     for (const Term& term : forked_[f].terms)
                     {
                         const Value value =
                             Around(slots, term.slots).at(term.local, wants_gradient);
                         sum.displacement += term.weight * value.displacement;
                         if (wants_gradient)
                             sum.gradient += term.weight * value.gradient +
                                             value.displacement * term.slope.transpose();
                     }
                     sum.gradient /= edge_;
                     out[forked_[f].number] = sum;
                 });
    return out;
}

} // namespace cellwarp::core
