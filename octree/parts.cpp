// SPDX-License-Identifier: GPL-3.0-or-later
// A component of the surface is what hangs together by its corners. Only components that
// are near each other matter: their boxes, a voxel larger all around, meet. Those that
// are not closed hold together with what is near, as a soup does.
//   Parts get numbers such that two that are near have different ones: the largest first,
// each the lowest number above those of the larger parts near it. All parts of one number
// are then found at once, as one shape: they are too far apart to know of each other. And
// where voxels are wanted by several the higher number is that of the smaller part, which
// has them, since the larger one can spare them; but a voxel that a part only touches is
// left to one that has its middle inside.
#include "octree/parts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>

#include <Eigen/Geometry>

#include "octree/base/edges.h"
#include "octree/base/parallel.h"
#include "octree/base/point_tree.h"
#include "octree/base/union_find.h"
#include "octree/coincident_samples.h"
#include "octree/joined_samples.h"
#include "octree/winding.h"

namespace cellwarp::core
{

namespace
{

/// Numbers of materials are bytes.
constexpr int kMostNumbers = 255;

/// Boxes of components that are no farther apart are near each other: they might have
/// voxels side by side [voxel].
constexpr double kNear = 2.0;

/// Up to so many samples in no triangle are strays: each holds what is near it together.
/// More are a cloud, which holds all that is near its box.
constexpr std::size_t kMostStrays = 1000;

/// More components that are not closed than this count as one, as in a soup.
constexpr std::ptrdiff_t kMostOpen = 1000;

struct Bounds
{
    Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY);
    Eigen::Vector3d high = Eigen::Vector3d::Constant(-INFINITY);

    void add(const Eigen::Vector3d& x)
    {
        low = low.cwiseMin(x);
        high = high.cwiseMax(x);
    }
    void add(const Bounds& other)
    {
        low = low.cwiseMin(other.low);
        high = high.cwiseMax(other.high);
    }
    bool is_near(const Bounds& other, double distance) const
    {
        return (low.array() <= other.high.array() + distance).all() &&
               (other.low.array() <= high.array() + distance).all();
    }
    bool holds(const Eigen::Vector3d& x, double distance) const
    {
        return (x.array() >= low.array() - distance).all() &&
               (x.array() <= high.array() + distance).all();
    }
};

/// What hangs together by its corners; one is what is in no triangle, if there is any.
struct Component
{
    bool is_closed = true;
    bool is_strays = false; ///< a few samples in no triangle, anywhere
    double volume = 0.0;    ///< negative: it is seen from inside, or bounds a void
    Bounds bounds;
};

struct Components
{
    std::vector<Component> all;
    std::vector<int> of_sample;
};

/// Makes one of all components that are not closed.
void join_open_components(Components& components)
{
    std::vector<int> number(components.all.size());
    std::vector<Component> left;
    int open = -1;
    for (std::size_t c = 0; c < number.size(); ++c)
    {
        const Component& component = components.all[c];
        if (!component.is_closed && !component.is_strays && open >= 0)
        {
            number[c] = open;
            left[idx(open)].bounds.add(component.bounds);
            continue;
        }
        number[c] = static_cast<int>(left.size());
        if (!component.is_closed && !component.is_strays)
            open = number[c];
        left.push_back(component);
    }
    components.all = std::move(left);
    for (int& own : components.of_sample)
        own = number[idx(own)];
}

/// Empty where all is one.
Components components_of(const Shape& shape, const BoundingSurface& surface)
{
    Components found;
    if (surface.triangles.empty())
        return found;
    UnionFind sets(shape.samples.size());
    std::vector<char> is_corner(shape.samples.size(), 0);
    for (const Triangle& t : surface.triangles)
    {
        sets.join(static_cast<int>(t[0]), static_cast<int>(t[1]));
        sets.join(static_cast<int>(t[1]), static_cast<int>(t[2]));
        is_corner[t[0]] = is_corner[t[1]] = is_corner[t[2]] = 1;
    }
    std::vector<int> number(shape.samples.size(), -1); // of the first corner of each
    int count = 0;
    for (std::size_t i = 0; i < number.size(); ++i)
        if (is_corner[i] && sets.first_of(static_cast<int>(i)) == static_cast<int>(i))
            number[i] = count++;
    if (count < 2)
        return found;
    const std::vector<std::uint32_t> joined = joined_samples(shape.samples);
    found.all.resize(idx(count));
    found.of_sample.resize(shape.samples.size());
    std::optional<Component> loose;
    std::size_t num_loose = 0;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        int& own = found.of_sample[i];
        own = is_corner[joined[i]]
                  ? number[idx(sets.first_of(static_cast<int>(joined[i])))]
                  : count;
        if (own == count && !loose)
            loose.emplace().is_closed = false;
        num_loose += own == count;
        (own == count ? *loose : found.all[idx(own)]).bounds.add(shape.samples[i]);
    }
    if (loose)
    {
        loose->is_strays = num_loose <= kMostStrays;
        found.all.push_back(*loose);
    }
    const auto each_pass = [&](const auto& pass)
    {
        for (const Triangle& t : surface.triangles)
            for (std::size_t k = 0; k < 3; ++k)
                pass(t[k], t[(k + 1) % 3]);
    };
    for_each_edge(shape.samples.size(), each_pass,
                  [&](const Edge& edge)
                  {
                      if (edge.forward != edge.backward)
                          found.all[idx(found.of_sample[edge.low])].is_closed = false;
                  });
    for (const Triangle& t : surface.triangles)
    {
        Component& own = found.all[idx(found.of_sample[t[0]])];
        const Eigen::Vector3d& from = own.bounds.low;
        own.volume +=
            (shape.samples[t[0]] - from)
                .dot((shape.samples[t[1]] - from).cross(shape.samples[t[2]] - from)) /
            6.0;
    }
    if (std::count_if(found.all.begin(), found.all.end(),
                      [](const Component& component)
                      { return !component.is_closed; }) > kMostOpen)
        join_open_components(found);
    return found;
}

/// Which boxes are near each other, the lower number first. Empty ones are near none.
std::vector<std::pair<int, int>> near_pairs(const std::vector<Bounds>& boxes,
                                            double distance)
{
    // Along the axis on which they overlap least.
    Eigen::Vector3d extents = Eigen::Vector3d::Zero();
    Bounds all;
    std::vector<int> order;
    for (std::size_t i = 0; i < boxes.size(); ++i)
    {
        if (!boxes[i].low.allFinite())
            continue;
        order.push_back(static_cast<int>(i));
        extents += boxes[i].high - boxes[i].low;
        all.add(boxes[i]);
    }
    if (order.empty())
        return {};
    int axis = 0;
    (extents.array() / (all.high - all.low).array().max(1e-300)).minCoeff(&axis);
    std::sort(order.begin(), order.end(),
              [&](int a, int b)
              {
                  return std::pair(boxes[idx(a)].low[axis], a) <
                         std::pair(boxes[idx(b)].low[axis], b);
              });
    std::vector<std::pair<int, int>> pairs;
    std::vector<int> open; // whose ends have not been passed
    for (const int next : order)
    {
        const Bounds& box = boxes[idx(next)];
        std::erase_if(open, [&](int one)
                      { return boxes[idx(one)].high[axis] + distance < box.low[axis]; });
        for (const int one : open)
            if (boxes[idx(one)].is_near(box, distance))
                pairs.emplace_back(std::min(one, next), std::max(one, next));
        open.push_back(next);
    }
    std::sort(pairs.begin(), pairs.end());
    return pairs;
}

/// Joins components into parts, step by step.
class Joining
{
public:
    Joining(const Shape& shape, const BoundingSurface& surface,
            const Components& components, std::vector<std::pair<int, int>> near,
            double distance, const VoxelGrid& grid)
        : shape_(shape), surface_(surface), components_(components),
          near_(std::move(near)), sets_(components.all.size())
    {
        join_open();
        join_strays(distance);
        join_coincident();
        join_voids();
        join_enclosed(grid);
    }

    int first_of(int component) { return sets_.first_of(component); }
    void join(int a, int b) { sets_.join(a, b); }

private:
    const Component& of(int component) const { return components_.all[idx(component)]; }

    void join_open()
    {
        for (const auto& [a, b] : near_)
            if (!(of(a).is_closed && of(b).is_closed) && !of(a).is_strays &&
                !of(b).is_strays)
                sets_.join(a, b);
    }

    /// What is near one stray sample is one part.
    void join_strays(double distance)
    {
        for (std::size_t i = 0; i < shape_.samples.size(); ++i)
        {
            if (!of(components_.of_sample[i]).is_strays)
                continue;
            int first = -1;
            for (std::size_t c = 0; c < components_.all.size(); ++c)
                if (const Component& other = components_.all[c];
                    !other.is_strays && other.bounds.holds(shape_.samples[i], distance))
                {
                    const int near = static_cast<int>(c);
                    if (first >= 0)
                        sets_.join(first, near);
                    first = near;
                }
        }
    }

    void join_coincident()
    {
        Bounds all;
        for (const Component& component : components_.all)
            all.add(component.bounds);
        const double tolerance = kCoincident * (all.high - all.low).norm();
        // Only what is in the boxes of two can be at one place.
        std::vector<std::vector<int>> others(components_.all.size());
        for (const auto& [a, b] : near_)
            if (sets_.first_of(a) != sets_.first_of(b))
            {
                others[idx(a)].push_back(b);
                others[idx(b)].push_back(a);
            }
        std::vector<Eigen::Vector3d> places;
        std::vector<int> of_place;
        for (std::size_t i = 0; i < shape_.samples.size(); ++i)
        {
            const std::vector<int>& near = others[idx(components_.of_sample[i])];
            if (std::any_of(near.begin(), near.end(),
                            [&](int other) {
                                return of(other).bounds.holds(shape_.samples[i],
                                                              tolerance);
                            }))
            {
                places.push_back(shape_.samples[i]);
                of_place.push_back(components_.of_sample[i]);
            }
        }
        if (places.empty())
            return;
        constexpr std::size_t kAround = 8;
        const PointTree tree(places);
        std::vector<PointTree::Neighbour> around;
        for (std::size_t i = 0; i < places.size(); ++i)
        {
            tree.nearest(places[i], kAround, around);
            for (const PointTree::Neighbour& other : around)
                if (other.distance_squared <= tolerance * tolerance)
                    sets_.join(of_place[i], of_place[other.index]);
        }
    }

    /// Of all that are closed: 1, or -1 where they are seen from inside.
    double outwards() const
    {
        double sum = 0.0;
        for (const Component& component : components_.all)
            sum += component.is_closed ? component.volume : 0.0;
        return sum < 0.0 ? -1.0 : 1.0;
    }

    /// Calls visit(inner, outer) for closed components of which the second is no void and
    /// has the first in its box.
    template <class Visit>
    void for_each_nested(Visit&& visit) const
    {
        const double sign = outwards();
        for (const auto& [a, b] : near_)
            for (const auto& [inner, outer] : {std::pair(a, b), std::pair(b, a)})
                if (of(inner).is_closed && of(outer).is_closed &&
                    of(outer).volume * sign > 0.0 &&
                    of(outer).bounds.holds(of(inner).bounds.low, 0.0) &&
                    of(outer).bounds.holds(of(inner).bounds.high, 0.0))
                    visit(inner, outer);
    }

    /// A surface that is seen from inside, as most are not, belongs to the smallest one
    /// around it.
    void join_voids()
    {
        const double sign = outwards();
        std::vector<std::vector<int>> around(components_.all.size()); // of voids
        std::set<int> needed;
        for_each_nested(
            [&](int hole, int other)
            {
                if (of(hole).volume * sign >= 0.0)
                    return;
                around[idx(hole)].push_back(other);
                needed.insert({hole, other});
            });
        if (needed.empty())
            return;
        std::vector<std::vector<Triangle>> triangles(components_.all.size());
        for (const Triangle& t : surface_.triangles)
            if (const int own = components_.of_sample[t[0]]; needed.contains(own))
                triangles[idx(own)].push_back(t);
        for (std::size_t hole = 0; hole < around.size(); ++hole)
        {
            int best = -1;
            for (const int other : around[hole])
                if ((best < 0 ||
                     std::abs(of(other).volume) < std::abs(of(best).volume)) &&
                    std::abs(winding_number(shape_, triangles[idx(other)],
                                            shape_.samples[triangles[hole][0][0]])) > 0.5)
                    best = other;
            if (best >= 0)
                sets_.join(static_cast<int>(hole), best);
        }
    }

    /// What lies in the material of another one with all of its samples is held by it.
    void join_enclosed(const VoxelGrid& grid)
    {
        std::map<int, std::vector<int>> within; // of sets: components in their boxes
        for_each_nested(
            [&](int inner, int outer)
            {
                const int set = sets_.first_of(outer);
                if (set != sets_.first_of(inner))
                    within[set].push_back(inner);
            });
        for (const auto& [set, inner] : within)
        {
            const int now = sets_.first_of(set); // it may have been joined since
            std::vector<Triangle> triangles;
            for (const Triangle& t : surface_.triangles)
                if (sets_.first_of(components_.of_sample[t[0]]) == now)
                    triangles.push_back(t);
            const VoxelFlags inside = inside_by_winding(shape_, triangles, grid);
            std::vector<char> is_enclosed(components_.all.size(), 0);
            for (const int component : inner)
                is_enclosed[idx(component)] = 1;
            for (std::size_t i = 0; i < shape_.samples.size(); ++i)
                if (const std::size_t own = idx(components_.of_sample[i]);
                    is_enclosed[own] &&
                    !inside[grid.index(grid.locate(shape_.samples[i]))])
                    is_enclosed[own] = 0;
            for (const int component : inner)
                if (is_enclosed[idx(component)])
                    sets_.join(component, set);
        }
    }

    const Shape& shape_;
    const BoundingSurface& surface_;
    const Components& components_;
    std::vector<std::pair<int, int>> near_;
    UnionFind sets_;
};

/// The parts, each by the first of its components; nothing at the others.
struct Numbered
{
    std::vector<Bounds> bounds;
    std::vector<std::pair<int, int>> near; ///< the lower number first
    std::vector<int> number;               ///< of their material, from 1
};

/// Parts for which there is no number are joined with a larger one near them, which
/// changes the parts: then there are no numbers.
Numbered numbered(const Components& components, Joining& joining, double distance)
{
    const std::size_t count = components.all.size();
    Numbered parts;
    parts.bounds.resize(count);
    for (std::size_t c = 0; c < count; ++c)
        parts.bounds[idx(joining.first_of(static_cast<int>(c)))].add(
            components.all[c].bounds);
    parts.near = near_pairs(parts.bounds, distance);
    std::vector<double> sizes;
    for (const Bounds& box : parts.bounds)
        sizes.push_back((box.high - box.low).prod());
    std::vector<std::vector<int>> near(count);
    for (const auto& [a, b] : parts.near)
    {
        near[idx(a)].push_back(b);
        near[idx(b)].push_back(a);
    }
    std::vector<int> order; // largest first
    for (std::size_t c = 0; c < count; ++c)
        if (joining.first_of(static_cast<int>(c)) == static_cast<int>(c))
            order.push_back(static_cast<int>(c));
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return sizes[idx(a)] > sizes[idx(b)]; });
    std::vector<int> number(count, 0);
    bool are_all_numbered = true;
    for (const int part : order)
    {
        int highest = 0, of_highest = -1;
        for (const int other : near[idx(part)])
            if (number[idx(other)] > highest)
            {
                highest = number[idx(other)];
                of_highest = other;
            }
        number[idx(part)] = std::min(highest + 1, kMostNumbers);
        if (highest == kMostNumbers)
        {
            joining.join(part, of_highest);
            are_all_numbered = false;
        }
    }
    if (are_all_numbered)
        parts.number = std::move(number);
    return parts;
}

/// The samples of a shape for which \p is_in, with their triangles and lines.
template <class IsIn>
Shape some_of(const Shape& shape, const IsIn& is_in)
{
    Shape some;
    std::vector<std::uint32_t> number(shape.samples.size());
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
        if (is_in(i))
        {
            number[i] = static_cast<std::uint32_t>(some.samples.size());
            some.samples.push_back(shape.samples[i]);
        }
    for (const Triangle& t : shape.triangles)
        if (is_in(t[0]) && is_in(t[1]) && is_in(t[2]))
            some.triangles.push_back({number[t[0]], number[t[1]], number[t[2]]});
    for (const auto& [a, b] : shape.lines)
        if (is_in(a) && is_in(b))
            some.lines.push_back({number[a], number[b]});
    return some;
}

/// What is told of how the material was found, for several shapes together.
void add_facts(Material&& of, Material& material)
{
    const auto rank = [](InsideMethod method)
    { return method == InsideMethod::None ? -1 : static_cast<int>(method); };
    if (rank(of.method) > rank(material.method))
        material.method = of.method;
    material.spacing = std::max(material.spacing, of.spacing);
    material.seal_radius = std::max(material.seal_radius, of.seal_radius);
    material.joins_below = std::max(material.joins_below, of.joins_below);
    if (of.is_sheet.empty())
        return;
    if (material.is_sheet.empty())
        material.is_sheet = std::move(of.is_sheet);
    else
        for_each_set(of.is_sheet, [&](std::size_t voxel)
                     { material.is_sheet[voxel] = of.is_sheet[voxel]; });
}

/// The voxels of a box, a voxel larger all around.
VoxelRange voxels_of(const VoxelGrid& grid, const Bounds& bounds)
{
    const VoxelRange range{grid.locate(bounds.low).array() - 1,
                           grid.locate(bounds.high).array() + 1};
    return range.cut({Eigen::Vector3i::Zero(), grid.counts().array() - 1});
}

/// Of every sample the voxel of its own number that it touches, that of locate() first;
/// where there is none the nearest one of its part, and that of locate() where there is
/// none at all. \p part: of each sample.
std::vector<std::size_t> voxels_of_samples(const Shape& shape, const VoxelGrid& grid,
                                           std::span<const int> part,
                                           std::span<const int> number,
                                           std::span<const Bounds> bounds)
{
    constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
    std::vector<std::size_t> voxels(shape.samples.size(), kNone);
    parallel_for(voxels.size(), 4096,
                 [&](std::size_t i)
                 {
                     const int own = number[idx(part[i])];
                     const std::size_t at = grid.index(grid.locate(shape.samples[i]));
                     if (grid.material()[at] == own)
                         voxels[i] = at;
                     else
                         for_each_voxel(grid.touched(shape.samples[i]),
                                        [&](const Eigen::Vector3i& voxel)
                                        {
                                            const std::size_t v = grid.index(voxel);
                                            if (voxels[i] == kNone &&
                                                grid.material()[v] == own)
                                                voxels[i] = v;
                                        });
                 });
    std::vector<std::vector<std::size_t>> homeless(number.size()); // of each part
    for (std::size_t i = 0; i < voxels.size(); ++i)
        if (voxels[i] == kNone)
            homeless[idx(part[i])].push_back(i);
    for (std::size_t p = 0; p < homeless.size(); ++p)
    {
        if (homeless[p].empty())
            continue;
        std::vector<Eigen::Vector3d> centres;
        std::vector<std::size_t> of_centre;
        for_each_voxel(voxels_of(grid, bounds[p]),
                       [&](const Eigen::Vector3i& voxel)
                       {
                           const std::size_t v = grid.index(voxel);
                           if (grid.material()[v] != number[p])
                               return;
                           centres.push_back(grid.centre(voxel));
                           of_centre.push_back(v);
                       });
        std::optional<PointTree> tree;
        if (!centres.empty())
            tree.emplace(centres);
        for (const std::size_t i : homeless[p])
            voxels[i] = tree ? of_centre[tree->nearest(shape.samples[i]).index]
                             : grid.index(grid.locate(shape.samples[i]));
    }
    return voxels;
}

/// Whether two parts have voxels side by side.
bool have_contact(const VoxelGrid& grid, const Bounds& a, const Bounds& b,
                  std::uint8_t of_a, std::uint8_t of_b)
{
    const VoxelRange both = voxels_of(grid, a).cut(voxels_of(grid, b));
    bool found = false;
    for_each_voxel(both,
                   [&](const Eigen::Vector3i& voxel)
                   {
                       const std::uint8_t here = grid.material()[grid.index(voxel)];
                       if (found || (here != of_a && here != of_b))
                           return;
                       for (int axis = 0; axis < 3 && !found; ++axis)
                       {
                           Eigen::Vector3i next = voxel;
                           ++next[axis];
                           found =
                               both.contains(next) && grid.material()[grid.index(next)] ==
                                                          (here == of_a ? of_b : of_a);
                       }
                   });
    return found;
}

/// The voxels whose middles a surface encloses; of one that is not closed by most of six
/// rays.
VoxelFlags middles_inside(const Shape& shape, const BoundingSurface& surface,
                          const VoxelGrid& grid)
{
    if (surface.open_edges == 0.0)
        return inside_by_winding(shape, surface.triangles, grid);
    VoxelFlags votes = inside_votes(shape, surface.triangles, grid);
    parallel_for_each_set(votes,
                          [&](std::size_t voxel) { votes[voxel] = votes[voxel] > 3; });
    return votes;
}

} // namespace

std::size_t Parts::num_touching() const
{
    std::set<int> touched;
    for (const auto& [a, b] : touching)
    {
        touched.insert(a);
        touched.insert(b);
    }
    return touched.size();
}

bool may_have_parts(const Shape& shape, const BoundingSurface& surface)
{
    return !components_of(shape, surface).all.empty();
}

Material material_of_parts(const Shape& shape, const BoundingSurface& surface,
                           const GridShape& grid_shape, Fill fill, Parts& parts)
{
    parts = {{{0, shape.samples.size()}}, {}, {}};
    const Components components = components_of(shape, surface);
    if (components.all.empty())
        return find_material(shape, surface, grid_shape, fill);
    const double distance = kNear * grid_shape.voxel();
    std::vector<Bounds> boxes;
    for (const Component& component : components.all)
        boxes.push_back(component.bounds);
    Material material{VoxelGrid(grid_shape)};
    VoxelGrid& grid = material.grid;
    Joining joining(shape, surface, components, near_pairs(boxes, distance), distance,
                    grid);
    Numbered found = numbered(components, joining, distance);
    while (found.number.empty())
        found = numbered(components, joining, distance);
    const auto& [bounds, near, number] = found;

    // Open parts count as one.
    std::vector<char> is_open(components.all.size(), 0);
    for (std::size_t c = 0; c < components.all.size(); ++c)
        if (!components.all[c].is_closed)
            is_open[idx(joining.first_of(static_cast<int>(c)))] = 1;
    std::vector<int> part_of_sample(shape.samples.size()); // by first components
    std::vector<int> told(components.all.size(), -1);      // among parts.parts
    int told_open = -1;
    parts.parts.clear();
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        const int part = joining.first_of(components.of_sample[i]);
        part_of_sample[i] = part;
        int& own = is_open[idx(part)] ? told_open : told[idx(part)];
        if (own < 0)
        {
            own = static_cast<int>(parts.parts.size());
            parts.parts.push_back({static_cast<std::uint32_t>(i), 0});
        }
        told[idx(part)] = own;
        ++parts.parts[idx(own)].num_samples;
    }
    const int most = *std::max_element(number.begin(), number.end());
    if (most < 2)
        return find_material(shape, surface, grid_shape, fill);

    VoxelFlags is_middle_inside(grid.size()); // of the part that has the voxel
    for (int own = 1; own <= most; ++own)
    {
        const Shape some = some_of(shape, [&, &number = found.number](std::size_t i)
                                   { return number[idx(part_of_sample[i])] == own; });
        if (some.samples.empty())
            continue;
        const BoundingSurface of_some = bounding_surface(some);
        Material own_material = find_material(some, of_some, grid_shape, fill);
        const VoxelFlags inside =
            fill == Fill::Solid && own_material.method != InsideMethod::None
                ? middles_inside(some, of_some, grid)
                : VoxelFlags(grid.size());
        for_each_set(own_material.grid.material(),
                     [&](std::size_t voxel)
                     {
                         if (is_middle_inside[voxel] && !inside[voxel])
                             return;
                         grid.material()[voxel] = static_cast<std::uint8_t>(own);
                         is_middle_inside[voxel] = inside[voxel];
                     });
        add_facts(std::move(own_material), material);
    }
    parts.voxel_of_sample =
        voxels_of_samples(shape, grid, part_of_sample, number, bounds);
    std::set<std::pair<int, int>> touching;
    for (const auto& [a, b] : near)
        if (told[idx(a)] != told[idx(b)] &&
            have_contact(grid, bounds[idx(a)], bounds[idx(b)],
                         static_cast<std::uint8_t>(number[idx(a)]),
                         static_cast<std::uint8_t>(number[idx(b)])))
            touching.insert(std::minmax(told[idx(a)], told[idx(b)]));
    parts.touching.assign(touching.begin(), touching.end());
    return material;
}

} // namespace cellwarp::core
