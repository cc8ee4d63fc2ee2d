// SPDX-License-Identifier: GPL-3.0-or-later
// Region i has the cells with a node of which it has a share, and those around them; M_i,
// K_i and the tubes' T_i are sums over these alone. With R, t the motion of its bone at
// the end of the step, and X the places at rest [theory-skeleton 7]:
//   u^ = R^T (X + u + h v - t) - X,   v^ = R^T v,
//   (M + h C + h^2 (K + T)) dv^ = h (R^T f - (K + T) u^ - C v^ + T g^),
// C = alpha M + beta K, and g^ = R^T (T_b x - t) - x at a node x of a tube of bone b:
// zero for the region's own. Where the body moves as the bone does u^ is zero, and so is
// the force. Then dv = sum_i share_i R_i dv^_i on free nodes, and the held points' rows
// are met again by the nodes that they bind. The border of a region lacks forces of the
// cells beyond; no node there has a share.
#include "solver/flesh/blended_regions.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <utility>

#include <Eigen/SparseCore>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/flesh/part_points.h"
#include "solver/linear/block_matrix.h"
#include "solver/linear/cholesky.h"

namespace cellwarp
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using SparseByRows = Eigen::SparseMatrix<double, Eigen::RowMajor>;

/// Of a matrix without a factor, what its diagonal gets, as a share of its norm.
constexpr double kLeastAdded = 1e-14, kMostAdded = 1e-6;

/// Of the sum of a node's shares.
constexpr double kSumsToOne = 1e-9;

Vector3d at(const VectorXd& x, int node)
{
    return x.segment<3>(3 * node);
}

} // namespace

std::vector<FleshRegionShares>
shares_by_distance(const Lattice& lattice, std::span<const std::vector<double>> distances,
                   std::span<const int> motions, double reach)
{
    std::vector<FleshRegionShares> regions(distances.size());
    for (std::size_t i = 0; i < regions.size(); ++i)
        regions[i].motion = motions[i];
    std::vector<double> shares(distances.size());
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
    {
        if (!lattice.hanging[n].empty())
            continue;
        double least = INFINITY, sum = 0.0;
        for (const std::vector<double>& of_bone : distances)
            least = std::min(least, of_bone[n]);
        for (std::size_t i = 0; i < shares.size(); ++i)
        {
            // Infinitely far from all bones: the first one's.
            const double farther =
                std::isfinite(least) ? distances[i][n] - least : (i == 0 ? 0.0 : reach);
            const double falls = std::max(0.0, 1.0 - farther / reach);
            shares[i] = falls * falls;
            sum += shares[i];
        }
        for (std::size_t i = 0; i < shares.size(); ++i)
            if (shares[i] > 0.0)
                regions[i].shares.push_back({static_cast<int>(n), shares[i] / sum});
    }
    return regions;
}

struct BlendedRegions::Region
{
    int motion = 0;
    std::vector<std::pair<int, double>> shares; ///< free node here, and its share
    std::vector<int> own_free;                  ///< of `shares`: place among all free

    std::vector<int> nodes; ///< all of the cells here
    std::vector<int> free;  ///< places among all free nodes
    /// What a node here takes of the free ones here, and of the held points.
    std::vector<NodeShares> by_free, by_points;

    SparseByRows mass, stiffness,
        tube;                     ///< mass: a number a pair of nodes, the others nine
    SparseByRows step;            ///< M + h C + h^2 (K + T)
    std::vector<double> row_sums; ///< of the mass [kg]
    struct Tube
    {
        const TubePart* part;
        std::array<int, 8> corners; ///< nodes here
    };
    std::vector<Tube> tubes;

    BlockMatrix matrix;
    std::unique_ptr<SparseCholesky> factor;
    bool is_taken = false; ///< the factor is that of a spare

    // Scratch.
    mutable VectorXd u, v, force, image, held, b, x;

    Region(const Lattice& lattice, const BoundNodes& bound,
           std::span<const FleshMaterial> materials, std::span<const TubePart> tube_parts,
           const FleshRegionShares& of)
        : motion(of.motion)
    {
        const std::vector<char> is_in = cells_of(lattice, of);
        std::vector<int> place(lattice.places.size(), -1);
        for (std::size_t c = 0; c < lattice.cells.size(); ++c)
            if (is_in[c])
                for (const int node : lattice.cells[c])
                    if (place[idx(node)] < 0)
                    {
                        place[idx(node)] = static_cast<int>(nodes.size());
                        nodes.push_back(node);
                    }
        take_free_nodes(bound, lattice.places.size());
        for (const NodeShare& share : of.shares)
            if (const auto found = free_here_.find(free_of_node_[idx(share.node)]);
                found != free_here_.end())
            {
                shares.emplace_back(found->second, share.share);
                own_free.push_back(found->first);
            }
        std::vector<Eigen::Triplet<double>> M, K, T;
        row_sums.assign(nodes.size(), 0.0);
        for (const LatticePart& part : lattice.parts)
        {
            if (!is_in[idx(part.cell)])
                continue;
            const FleshMaterial& material = materials[idx(part.material)];
            const PartPoints points = points_of(lattice, part);
            const Eigen::Matrix<double, 8, 8> mass_part =
                mass_of(points, material.density);
            const PartMatrix stiff = stiffness_of(points, material);
            const CornerNodes& corners = lattice.cells[idx(part.cell)];
            for (int a = 0; a < 8; ++a)
                for (int c = 0; c < 8; ++c)
                {
                    const int row = place[idx(corners[idx(a)])],
                              column = place[idx(corners[idx(c)])];
                    M.emplace_back(row, column, mass_part(a, c));
                    row_sums[idx(row)] += mass_part(a, c);
                    for (int i = 0; i < 3; ++i)
                        for (int j = 0; j < 3; ++j)
                            K.emplace_back(3 * row + i, 3 * column + j,
                                           stiff(3 * a + i, 3 * c + j));
                }
        }
        for (const TubePart& part : tube_parts)
        {
            const int cell = lattice.parts[idx(part.part)].cell;
            if (!is_in[idx(cell)])
                continue;
            Tube& tube_here = tubes.emplace_back();
            tube_here.part = &part;
            const CornerNodes& corners = lattice.cells[idx(cell)];
            for (std::size_t a = 0; a < 8; ++a)
                tube_here.corners[a] = place[idx(corners[a])];
            for (int a = 0; a < 8; ++a)
                for (int c = 0; c < 8; ++c)
                    T.emplace_back(tube_here.corners[idx(a)], tube_here.corners[idx(c)],
                                   part.stiffness * part.overlap(a, c));
        }
        const Eigen::Index count = Eigen::Index(nodes.size());
        mass.resize(count, count);
        mass.setFromTriplets(M.begin(), M.end());
        tube.resize(count, count);
        tube.setFromTriplets(T.begin(), T.end());
        stiffness.resize(3 * count, 3 * count);
        stiffness.setFromTriplets(K.begin(), K.end());
    }

    /// y += factor S x, S a number for each pair of nodes.
    static void add_product(const SparseByRows& S, const VectorXd& x, double factor,
                            VectorXd& y)
    {
        for (Eigen::Index row = 0; row < S.rows(); ++row)
        {
            Vector3d sum = Vector3d::Zero();
            for (SparseByRows::InnerIterator entry(S, row); entry; ++entry)
                sum += entry.value() * x.segment<3>(3 * entry.col());
            y.segment<3>(3 * row) += factor * sum;
        }
    }

    /// \p S a number for each pair of nodes.
    static void add_entries(const SparseByRows& S, double factor,
                            std::vector<Eigen::Triplet<double>>& out)
    {
        for (Eigen::Index row = 0; row < S.rows(); ++row)
            for (SparseByRows::InnerIterator entry(S, row); entry; ++entry)
                for (Eigen::Index c = 0; c < 3; ++c)
                    out.emplace_back(3 * row + c, 3 * entry.col() + c,
                                     factor * entry.value());
    }

    /// \p spares: regions of another lattice, whose factor serves where the matrix is the
    /// same. False: there is no factor.
    bool factorize(double dt, double alpha, double beta,
                   std::span<const std::unique_ptr<Region>> spares)
    {
        std::vector<Eigen::Triplet<double>> entries;
        add_entries(mass, 1.0 + dt * alpha, entries);
        add_entries(tube, dt * dt, entries);
        SparseByRows other(stiffness.rows(), stiffness.cols());
        other.setFromTriplets(entries.begin(), entries.end());
        step = (dt * dt + dt * beta) * stiffness + other;
        // By free nodes: Z^T A Z.
        std::map<std::pair<int, int>, Matrix3d> blocks;
        for (int node = 0; node < static_cast<int>(nodes.size()); ++node)
            for (int axis = 0; axis < 3; ++axis)
                for (SparseByRows::InnerIterator entry(step, 3 * node + axis); entry;
                     ++entry)
                    for (const NodeShare& row : by_free[idx(node)])
                        for (const NodeShare& column :
                             by_free[static_cast<std::size_t>(entry.col() / 3)])
                            if (row.node >= column.node)
                                blocks
                                    .try_emplace({row.node, column.node},
                                                 Matrix3d::Zero())
                                    .first->second(axis, entry.col() % 3) +=
                                    row.share * column.share * entry.value();
        if (!factor)
        {
            std::vector<std::pair<int, int>> pairs;
            for (const auto& [pair, block] : blocks)
                if (pair.first > pair.second)
                    pairs.push_back(pair);
            matrix = BlockMatrix(std::vector<int>(free.size(), 3), std::move(pairs));
        }
        matrix.set_zero();
        for (const auto& [pair, block] : blocks)
            (pair.first == pair.second
                 ? matrix.diagonal(pair.first)
                 : matrix.block(matrix.find(pair.first, pair.second))) = block;
        is_taken = false;
        for (const std::unique_ptr<Region>& spare : spares)
            if (spare->motion == motion && spare->factor && spare->matrix == matrix)
            {
                factor = std::move(spare->factor);
                is_taken = true;
                return true;
            }
        if (!factor)
            factor = std::make_unique<SparseCholesky>(matrix);
        // Corners that slivers of material alone hold may leave nothing but rounding of
        // their entries: they get as little as a factor needs.
        const double most = matrix.norm();
        for (double added = 0.0; added <= kMostAdded;
             added = std::max(kLeastAdded, 100.0 * added))
        {
            for (int node = 0; node < matrix.num_blocks(); ++node)
                matrix.diagonal(node).diagonal().array() += added * most;
            if (factor->factorize(matrix))
                return true;
        }
        return false;
    }

    /// x: what changes in this region's frame, of its free nodes.
    void solve(const Lattice& lattice, const VectorXd& predicted,
               const VectorXd& velocity, const Outside& outside, double dt, double alpha,
               double beta) const
    {
        const Motion& frame = outside.motions[idx(motion)];
        const Matrix3d back = frame.R.transpose();
        const Eigen::Index size = Eigen::Index(3 * nodes.size());
        u.resize(size);
        v.resize(size);
        force.resize(size);
        held.setZero(size);
        const Vector3d weight = back * outside.gravity;
        for (std::size_t n = 0; n < nodes.size(); ++n)
        {
            const Eigen::Index here = Eigen::Index(3 * n);
            const Vector3d& rest = lattice.places[idx(nodes[n])];
            u.segment<3>(here) = back * (rest + at(predicted, nodes[n]) - frame.t) - rest;
            v.segment<3>(here) = back * at(velocity, nodes[n]);
            force.segment<3>(here) =
                back * at(outside.loads, nodes[n]) + row_sums[n] * weight;
            for (const NodeShare& point : by_points[n])
                held.segment<3>(here) +=
                    point.share * (back * at(outside.held, point.node));
        }
        image.noalias() = stiffness * u;
        force -= image;
        if (beta > 0.0)
        {
            image.noalias() = stiffness * v;
            force -= beta * image;
        }
        if (alpha > 0.0)
            add_product(mass, v, -alpha, force);
        add_product(tube, u, -1.0, force);
        for (const Tube& one : tubes)
        {
            if (one.part->motion == motion)
                continue;
            const Motion& bone = outside.motions[idx(one.part->motion)];
            Eigen::Matrix<double, 8, 3> way;
            for (int a = 0; a < 8; ++a)
            {
                const Vector3d& rest =
                    lattice.places[idx(nodes[idx(one.corners[idx(a)])])];
                way.row(a) = (back * (bone(rest) - frame.t) - rest).transpose();
            }
            const Eigen::Matrix<double, 8, 3> pulled =
                one.part->stiffness * one.part->overlap * way;
            for (int a = 0; a < 8; ++a)
                force.segment<3>(3 * one.corners[idx(a)]) += pulled.row(a).transpose();
        }
        image.noalias() = step * held;
        force = dt * force - image;
        b.setZero(Eigen::Index(3 * free.size()));
        for (std::size_t n = 0; n < nodes.size(); ++n)
            for (const NodeShare& share : by_free[n])
                b.segment<3>(3 * share.node) +=
                    share.share * force.segment<3>(Eigen::Index(3 * n));
        factor->solve(b, x);
    }

private:
    /// Cells with a node of the region, and those around them.
    static std::vector<char> cells_of(const Lattice& lattice, const FleshRegionShares& of)
    {
        std::vector<char> has_share(lattice.places.size(), 0);
        for (const NodeShare& share : of.shares)
            has_share[idx(share.node)] = 1;
        for (std::size_t n = 0; n < lattice.hanging.size(); ++n)
            for (const NodeShare& parent : lattice.hanging[n])
                has_share[n] |= has_share[idx(parent.node)];
        std::vector<char> is_in(lattice.cells.size(), 0);
        for (int ring = 0; ring < 2; ++ring)
        {
            std::vector<char> touched = has_share;
            for (std::size_t c = 0; c < lattice.cells.size(); ++c)
            {
                const CornerNodes& corners = lattice.cells[c];
                if (std::none_of(corners.begin(), corners.end(),
                                 [&](int node) { return has_share[idx(node)] != 0; }))
                    continue;
                is_in[c] = 1;
                for (const int node : corners)
                    touched[idx(node)] = 1;
            }
            has_share = std::move(touched);
        }
        return is_in;
    }

    void take_free_nodes(const BoundNodes& bound, std::size_t num_nodes)
    {
        free_of_node_.assign(num_nodes, -1);
        for (std::size_t k = 0; k < bound.free.size(); ++k)
            free_of_node_[idx(bound.free[k])] = static_cast<int>(k);
        std::vector<int> bound_of_node(num_nodes, -1);
        for (std::size_t k = 0; k < bound.bound.size(); ++k)
            bound_of_node[idx(bound.bound[k])] = static_cast<int>(k);
        const auto here = [&](int place)
        {
            const auto [found, is_new] =
                free_here_.try_emplace(place, static_cast<int>(free.size()));
            if (is_new)
                free.push_back(place);
            return found->second;
        };
        for (const int node : nodes)
        {
            NodeShares& of_free = by_free.emplace_back();
            NodeShares& of_points = by_points.emplace_back();
            if (const int place = free_of_node_[idx(node)]; place >= 0)
            {
                of_free.push_back({here(place), 1.0});
                continue;
            }
            const std::size_t k = idx(bound_of_node[idx(node)]);
            for (const NodeShare& share : bound.by_free[k])
                of_free.push_back({here(share.node), share.share});
            of_points.assign(bound.by_points[k].begin(), bound.by_points[k].end());
        }
    }

    std::map<int, int> free_here_;
    std::vector<int> free_of_node_; ///< -1: bound
};

BlendedRegions::BlendedRegions(const Lattice& lattice, const BoundNodes& nodes,
                               std::span<const FleshMaterial> materials,
                               std::span<const TubePart> tubes,
                               std::vector<FleshRegionShares> regions, double alpha,
                               double beta)
    : lattice_(lattice), nodes_(nodes), alpha_(alpha), beta_(beta)
{
    VectorXd sums = VectorXd::Zero(Eigen::Index(lattice.places.size()));
    for (const FleshRegionShares& region : regions)
    {
        for (const NodeShare& share : region.shares)
            sums[share.node] += share.share;
        if (!region.shares.empty())
            regions_.push_back(
                std::make_unique<Region>(lattice, nodes, materials, tubes, region));
    }
    for (const int node : nodes.free)
        if (!(std::abs(sums[node] - 1.0) <= kSumsToOne))
            throw std::invalid_argument("shares of a node do not sum to 1");
}

BlendedRegions::~BlendedRegions() = default;
BlendedRegions::BlendedRegions(BlendedRegions&&) noexcept = default;

std::size_t BlendedRegions::size() const
{
    return regions_.size();
}

double BlendedRegions::factor_numbers() const
{
    double sum = 0.0;
    for (const auto& region : regions_)
        if (region->factor)
            sum += region->factor->factor_numbers();
    return sum;
}

bool BlendedRegions::prepare(double dt)
{
    if (is_prepared(dt))
        return true;
    dt_ = -1.0;
    for (const auto& region : regions_)
        if (!region->factorize(dt, alpha_, beta_, spares_))
            return false;
    spares_.clear();
    dt_ = dt;
    return true;
}

void BlendedRegions::take_factors(BlendedRegions& of)
{
    if (of.dt_ > 0.0)
        spares_ = std::move(of.regions_);
    of.regions_.clear();
    of.dt_ = -1.0;
}

std::size_t BlendedRegions::num_taken() const
{
    return static_cast<std::size_t>(std::count_if(regions_.begin(), regions_.end(),
                                                  [](const auto& region)
                                                  { return region->is_taken; }));
}

void BlendedRegions::step(const VectorXd& predicted, const VectorXd& v,
                          const Outside& outside, VectorXd& free_change) const
{
    parallel_for(
        regions_.size(), [&](std::size_t i)
        { regions_[i]->solve(lattice_, predicted, v, outside, dt_, alpha_, beta_); });
    free_change.setZero(Eigen::Index(3 * nodes_.free.size()));
    for (const auto& region : regions_)
    {
        const Matrix3d& R = outside.motions[idx(region->motion)].R;
        for (std::size_t k = 0; k < region->shares.size(); ++k)
        {
            const auto& [here, share] = region->shares[k];
            free_change.segment<3>(3 * region->own_free[k]) +=
                share * (R * region->x.segment<3>(3 * here));
        }
    }
}

} // namespace cellwarp
