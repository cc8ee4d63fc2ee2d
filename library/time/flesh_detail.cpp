// SPDX-License-Identifier: GPL-3.0-or-later
// A box whose eight parts are idle, all below a quarter of the threshold, for the time
// that detail takes to leave, begins to leave: the nodes that the larger cell will not
// have go to where it has them, on a cubic that begins with their speed and ends without.
// Then the larger cell takes over, and nothing jumps: neither places nor velocities.
#include "library/time/flesh_detail.h"

#include <algorithm>
#include <map>
#include <tuple>

#include <Eigen/Cholesky>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Parts are idle below this share of the threshold: halved cells have a quarter of the
/// error of whole ones where flesh bends.
constexpr double kIdle = 0.25;

auto box_key(const Leaf& leaf)
{
    return std::tuple(leaf.level, leaf.corner.x(), leaf.corner.y(), leaf.corner.z());
}

using FamilyNumbers = std::map<decltype(box_key(Leaf())), std::size_t>;

Leaf box_of(const Octree& octree, const std::vector<LeafNumber>& family)
{
    const Leaf& part = octree[family.front()];
    const int width = 2 * octree.width(part);
    return {part.corner / width * width, part.level - 1};
}

/// The leaves of these boxes, as far as they are halved once.
std::vector<LeafNumber> parts_of(const Octree& octree,
                                 std::span<const FleshDetail::Family> families)
{
    FamilyNumbers number;
    for (const FleshDetail::Family& family : families)
        number.emplace(box_key(family.box), number.size());
    std::vector<LeafNumber> parts;
    for (const std::vector<LeafNumber>& family : octree.siblings())
        if (number.contains(box_key(box_of(octree, family))))
            parts.insert(parts.end(), family.begin(), family.end());
    return parts;
}

bool is_leaf(const Octree& octree, const Leaf& box)
{
    const LeafNumber leaf = octree.find(box.corner);
    return leaf != LeafNumber::None && octree[leaf] == box;
}

/// Whether a node of the box's cells is still on its way.
bool is_on_its_way(const FleshBody& body, const FleshDetail& detail, const Leaf& box,
                   double now)
{
    std::vector<char> leaves(body.flesh->lattice().places.size(), 0);
    for (std::size_t k = 0; k < body.leaving.nodes.size(); ++k)
        leaves[idx(body.leaving.nodes[k].node)] = detail.fading[k].end > now;
    for (std::size_t c = 0; c < body.coarse_cell.size(); ++c)
        if (body.coarse_leaf[idx(body.coarse_cell[c])] == box)
            for (const int node : body.flesh->lattice().cells[c])
                if (leaves[idx(node)])
                    return true;
    return false;
}

/// Displacements and velocities of a point of a cell.
struct Moved
{
    Vector3d u = Vector3d::Zero(), v = Vector3d::Zero();
};

Moved moved_of(const CornerNodes& corners, const Vector3d& local, const FleshState& state)
{
    Moved out;
    const std::array<double, 8> shares = corner_shares(local);
    for (std::size_t k = 0; k < 8; ++k)
    {
        out.u += shares[k] * state.u.segment<3>(3 * corners[k]);
        out.v += shares[k] * state.v.segment<3>(3 * corners[k]);
    }
    return out;
}

void set_node(FleshState& state, int node, const Moved& to)
{
    state.u.segment<3>(3 * node) = to.u;
    state.v.segment<3>(3 * node) = to.v;
}

/// At a place outside of some nodes, by the affine map that is nearest to their motion.
Moved extrapolated(const Lattice& lattice, const std::vector<int>& nodes,
                   const FleshState& state, const Vector3d& at)
{
    using Matrix4 = Eigen::Matrix4d;
    Vector3d middle = Vector3d::Zero();
    for (const int node : nodes)
        middle += lattice.places[idx(node)] / double(nodes.size());
    const double size = (at - middle).norm();
    const auto row_of = [&](const Vector3d& x)
    {
        const Vector3d way = (x - middle) / size;
        return Eigen::Vector4d(1.0, way.x(), way.y(), way.z());
    };
    Matrix4 sums = Matrix4::Zero();
    Eigen::Matrix<double, 4, 6> right = Eigen::Matrix<double, 4, 6>::Zero();
    for (const int node : nodes)
    {
        const Eigen::Vector4d row = row_of(lattice.places[idx(node)]);
        sums += row * row.transpose();
        right.leftCols<3>() += row * state.u.segment<3>(3 * node).transpose();
        right.rightCols<3>() += row * state.v.segment<3>(3 * node).transpose();
    }
    const Eigen::Matrix<double, 6, 1> value =
        sums.ldlt().solve(right).transpose() * row_of(at);
    return {value.head<3>(), value.tail<3>()};
}

} // namespace

std::vector<double> uneven_strains(const FleshBody& body, const FleshState& state)
{
    std::vector<Matrix3d> strains = body.flesh->deformations(state);
    for (Matrix3d& F : strains)
        F = 0.5 * (F.transpose() * F - Matrix3d::Identity());
    std::vector<double> errors(strains.size(), 0.0);
    for (const CellSide& side : body.flesh->lattice().sides)
    {
        const double slope = (strains[idx(side.a)] - strains[idx(side.b)]).norm() /
                             (0.5 * (side.width_a + side.width_b));
        for (const auto& [cell, width] :
             {std::pair(side.a, side.width_a), {side.b, side.width_b}})
            errors[idx(cell)] = std::max(errors[idx(cell)], slope * width * width);
    }
    return errors;
}

DetailChange change_detail(const FleshBody& body, const DetailLook& look,
                           FleshDetail& detail)
{
    DetailChange out;
    const Octree& octree = *detail.octree;
    const std::vector<LatticeBox>& cells = body.flesh->lattice().boxes;
    std::vector<double> error(octree.leaves().size(), 0.0);
    std::vector<char> is_wanted(octree.leaves().size(), 0);
    for (std::size_t c = 0; c < cells.size(); ++c)
    {
        const std::size_t leaf = idx(octree.find(cells[c].corner));
        error[leaf] = std::max(error[leaf], look.errors[c]);
        is_wanted[leaf] = is_wanted[leaf] || look.is_wanted[c];
    }
    std::vector<LeafNumber> split;
    for (const LeafNumber leaf : octree.numbers())
        if (octree[leaf].level < octree.max_depth() &&
            (is_wanted[idx(leaf)] || error[idx(leaf)] > look.threshold))
            split.push_back(leaf);
    // What was idle or leaves stays so as long as it is idle.
    FamilyNumbers was_idle, was_leaving;
    for (std::size_t k = 0; k < detail.idle.size(); ++k)
        was_idle.emplace(box_key(detail.idle[k].box), k);
    for (std::size_t k = 0; k < detail.leaving.size(); ++k)
        was_leaving.emplace(box_key(detail.leaving[k].box), k);
    std::vector<FleshDetail::Family> idle, leaving, left;
    for (const std::vector<LeafNumber>& family : octree.siblings())
    {
        if (std::any_of(family.begin(), family.end(),
                        [&](LeafNumber leaf) {
                            return is_wanted[idx(leaf)] ||
                                   error[idx(leaf)] >= kIdle * look.threshold;
                        }))
            continue;
        const Leaf box = box_of(octree, family);
        const auto known = was_idle.find(box_key(box));
        const FleshDetail::Family one{
            box, known == was_idle.end() ? look.step : detail.idle[known->second].since};
        idle.push_back(one);
        if (const auto going = was_leaving.find(box_key(box)); going != was_leaving.end())
        {
            const FleshDetail::Family& old = detail.leaving[going->second];
            const bool has_left = look.step - old.since >= look.steps_of_fade &&
                                  !is_on_its_way(body, detail, box, look.time);
            (has_left ? left : leaving).push_back(old);
        }
        else if (look.step - one.since >= look.steps_of_fade)
            leaving.push_back({box, look.step});
    }
    const MaterialTest has_material = body.model->has_material();
    Octree next = octree;
    // The worst first, as far as there is room.
    std::stable_sort(split.begin(), split.end(),
                     [&](LeafNumber a, LeafNumber b)
                     {
                         return std::pair(is_wanted[idx(a)], error[idx(a)]) >
                                std::pair(is_wanted[idx(b)], error[idx(b)]);
                     });
    for (std::size_t count = split.size(); count > 0; count /= 2)
    {
        Octree finer = octree.split(std::span(split).first(count), has_material);
        if (static_cast<std::int64_t>(finer.leaves().size()) > look.most_cells)
        {
            out.is_full = true;
            continue;
        }
        next = std::move(finer);
        out.split = count;
        break;
    }
    if (!left.empty())
    {
        const std::size_t before = next.leaves().size();
        next = next.merge(parts_of(next, left));
        out.merged = next.leaves().size() < before ? left.size() : 0;
    }
    Octree coarser = next.merge(parts_of(next, leaving));
    std::erase_if(leaving, [&](const FleshDetail::Family& family)
                  { return !is_leaf(coarser, family.box); });
    detail.idle = std::move(idle);
    detail.leaving = std::move(leaving);
    if (next.leaves() == octree.leaves() && coarser.leaves() == detail.coarser->leaves())
        return out;
    out.has_changed = true;
    if (next.leaves() != octree.leaves())
        detail.octree = std::make_shared<const Octree>(std::move(next));
    detail.coarser = detail.leaving.empty()
                         ? detail.octree
                         : std::make_shared<const Octree>(std::move(coarser));
    return out;
}

CarriedState carried_to(const FleshBody& to, const FleshBody& from,
                        const FleshState& state)
{
    const Lattice &lattice = to.flesh->lattice(), &old = from.flesh->lattice();
    const Eigen::Index size = Eigen::Index(3 * lattice.places.size());
    CarriedState out{{VectorXd::Zero(size), VectorXd::Zero(size)},
                     std::vector<int>(lattice.places.size(), -1)};
    std::vector<char> is_set(lattice.places.size(), 0);
    const std::vector<int> cells = cells_around(to, from);
    for (std::size_t c = 0; c < lattice.cells.size(); ++c)
    {
        const int cell = cells[c];
        const LatticeBox &box = lattice.boxes[c], &was = old.boxes[idx(cell)];
        const bool has_left = was.width < box.width;
        const CornerNodes& corners =
            has_left ? from.leaving.coarse_cells[idx(from.coarse_cell[idx(cell)])]
                     : old.cells[idx(cell)];
        const bool is_same = has_left || was == box;
        for (std::size_t k = 0; k < 8; ++k)
        {
            const int node = lattice.cells[c][k];
            if (is_same)
                out.old_node[idx(node)] = corners[k];
            if (is_set[idx(node)])
                continue;
            is_set[idx(node)] = 1;
            const LatticeBox& around = has_left ? box : was;
            const Vector3d local = place_in(around, corner_of(box, static_cast<int>(k)));
            set_node(out.state, node, moved_of(corners, local, state));
        }
    }
    // Corners of coarser cells that no cell has.
    std::vector<std::vector<int>> cells_of_coarse(to.leaving.coarse_cells.size());
    for (std::size_t c = 0; c < to.coarse_cell.size(); ++c)
        cells_of_coarse[idx(to.coarse_cell[c])].push_back(static_cast<int>(c));
    for (std::size_t c = 0; c < to.leaving.coarse_cells.size(); ++c)
        for (std::size_t k = 0; k < 8; ++k)
        {
            const int node = to.leaving.coarse_cells[c][k];
            if (is_set[idx(node)])
                continue;
            is_set[idx(node)] = 1;
            const int cell = cells[idx(cells_of_coarse[c].front())];
            if (!from.coarse_cell.empty() &&
                from.coarse_leaf[idx(from.coarse_cell[idx(cell)])] == to.coarse_leaf[c])
            {
                const int was =
                    from.leaving.coarse_cells[idx(from.coarse_cell[idx(cell)])][k];
                out.old_node[idx(node)] = was;
                set_node(out.state, node,
                         {state.u.segment<3>(3 * was), state.v.segment<3>(3 * was)});
                continue;
            }
            std::vector<int> nodes;
            for (const int part : cells_of_coarse[c])
                nodes.insert(nodes.end(), lattice.cells[idx(part)].begin(),
                             lattice.cells[idx(part)].end());
            std::sort(nodes.begin(), nodes.end());
            nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
            set_node(out.state, node,
                     extrapolated(lattice, nodes, out.state, lattice.places[idx(node)]));
        }
    return out;
}

} // namespace cellwarp::core
