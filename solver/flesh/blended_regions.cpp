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
#include <optional>
#include <stdexcept>
#include <utility>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/flesh/flesh_forces.h"
#include "solver/flesh/step_matrix.h"
#include "solver/linear/cholesky.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

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

    Lattice lattice;        ///< the cells here, without what hangs
    std::vector<int> nodes; ///< all of the cells here
    std::vector<int> free;  ///< places among all free nodes
    /// Rows of the nodes here, by the free ones here and by the held points.
    SparseRows by_free, by_points;

    std::optional<FleshForces> forces;
    VectorXd masses; ///< of the nodes, for each axis [kg]
    std::optional<StepMatrix> matrix;
    std::unique_ptr<SparseCholesky> factor;
    bool is_taken = false; ///< the factor is that of a spare

    // Scratch.
    mutable VectorXd u, v, force, image, held, b, x;

    Region(const Lattice& whole, const BoundNodes& bound, const SparseRows& all_by_free,
           std::span<const FleshMaterial> materials, std::span<const TubePart> tubes,
           const FleshRegionShares& of)
        : motion(of.motion)
    {
        const std::vector<int> part_here = copy_cells(whole, of);
        std::vector<TubePart> tubes_here;
        for (const TubePart& tube : tubes)
            if (const int part = part_here[idx(tube.part)]; part >= 0)
                tubes_here.emplace_back(tube).part = part;
        const auto place_in = [](const std::vector<int>& ascending, int node)
        {
            const auto found = std::lower_bound(ascending.begin(), ascending.end(), node);
            return found != ascending.end() && *found == node
                       ? static_cast<int>(found - ascending.begin())
                       : -1;
        };
        std::map<int, int> free_here;
        for (const int node : nodes)
        {
            NodeShares row;
            for (const NodeShare& share : all_by_free[idx(node)])
            {
                const auto [found, is_new] =
                    free_here.try_emplace(share.node, static_cast<int>(free.size()));
                if (is_new)
                    free.push_back(share.node);
                row.push_back({found->second, share.share});
            }
            by_free.add(row);
            const int place = place_in(bound.bound, node);
            by_points.add(place < 0 ? std::span<const NodeShare>()
                                    : bound.by_points[idx(place)]);
        }
        for (const NodeShare& share : of.shares)
            if (const auto found = free_here.find(place_in(bound.free, share.node));
                found != free_here.end())
            {
                shares.emplace_back(found->second, share.share);
                own_free.push_back(found->first);
            }
        forces.emplace(lattice, materials, std::move(tubes_here));
        forces->multiply(VectorXd::Ones(Eigen::Index(3 * nodes.size())), {1.0, 0.0, 0.0},
                         masses);
        matrix.emplace(lattice, materials, by_free, free.size());
    }

    /// The matrix of the step as a sum, M + h C + h^2 (K + T).
    static FleshFactors factors(double dt, double alpha, double beta)
    {
        return {1.0 + dt * alpha, dt * dt + dt * beta, dt * dt};
    }

    /// \p spares: regions of another lattice, whose factor serves where the matrix is the
    /// same. False: there is no factor.
    bool factorize(double dt, double alpha, double beta,
                   std::span<const std::unique_ptr<Region>> spares)
    {
        matrix->assemble(*forces, factors(dt, alpha, beta));
        BlockMatrix& A = matrix->blocks();
        is_taken = false;
        for (const std::unique_ptr<Region>& spare : spares)
            if (spare->motion == motion && spare->factor && spare->matrix->blocks() == A)
            {
                factor = std::move(spare->factor);
                is_taken = true;
                return true;
            }
        if (!factor)
            factor = std::make_unique<SparseCholesky>(A);
        // Corners that slivers of material alone hold may leave nothing but rounding of
        // their entries: they get as little as a factor needs.
        const double most = A.norm();
        for (double added = 0.0; added <= kMostAdded;
             added = std::max(kLeastAdded, 100.0 * added))
        {
            for (int node = 0; node < A.num_blocks(); ++node)
                A.diagonal(node).diagonal().array() += added * most;
            if (factor->factorize(A))
                return true;
        }
        return false;
    }

    /// x: what changes in this region's frame, of its free nodes.
    void solve(const VectorXd& predicted, const VectorXd& velocity,
               const Outside& outside, double dt, double alpha, double beta) const
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
            const Vector3d& rest = lattice.places[n];
            u.segment<3>(here) = back * (rest + at(predicted, nodes[n]) - frame.t) - rest;
            v.segment<3>(here) = back * at(velocity, nodes[n]);
            force.segment<3>(here) =
                back * at(outside.loads, nodes[n]) + masses[here] * weight;
            for (const NodeShare& point : by_points[n])
                held.segment<3>(here) +=
                    point.share * (back * at(outside.held, point.node));
        }
        std::vector<Motion> seen; // from the frame
        for (const Motion& bone : outside.motions)
            seen.push_back(inverse(frame) * bone);
        seen[idx(motion)] = Motion();
        forces->forces(u, seen, image);
        force += image;
        if (alpha > 0.0 || beta > 0.0)
        {
            forces->multiply(v, {alpha, beta, 0.0}, image);
            force -= image;
        }
        forces->multiply(held, factors(dt, alpha, beta), image);
        force = dt * force - image;
        b.setZero(Eigen::Index(3 * free.size()));
        for (std::size_t n = 0; n < nodes.size(); ++n)
            for (const NodeShare& share : by_free[n])
                b.segment<3>(3 * share.node) +=
                    share.share * force.segment<3>(Eigen::Index(3 * n));
        factor->solve(b, x);
    }

private:
    /// Cells with a node of the region, and those around them. Returns the number here of
    /// each part; -1: it is not here.
    std::vector<int> copy_cells(const Lattice& whole, const FleshRegionShares& of)
    {
        std::vector<char> has_share(whole.places.size(), 0);
        for (const NodeShare& share : of.shares)
            has_share[idx(share.node)] = 1;
        for (std::size_t n = 0; n < whole.hanging.size(); ++n)
            for (const NodeShare& parent : whole.hanging[n])
                has_share[n] |= has_share[idx(parent.node)];
        std::vector<char> is_in(whole.cells.size(), 0);
        for (int ring = 0; ring < 2; ++ring)
        {
            std::vector<char> touched = has_share;
            for (std::size_t c = 0; c < whole.cells.size(); ++c)
            {
                const CornerNodes& corners = whole.cells[c];
                if (std::none_of(corners.begin(), corners.end(),
                                 [&](int node) { return has_share[idx(node)] != 0; }))
                    continue;
                is_in[c] = 1;
                for (const int node : corners)
                    touched[idx(node)] = 1;
            }
            has_share = std::move(touched);
        }
        lattice.has_boxes = whole.has_boxes;
        std::vector<int> place(whole.places.size(), -1);
        std::vector<int> cell_here(whole.cells.size(), -1);
        for (std::size_t c = 0; c < whole.cells.size(); ++c)
        {
            if (!is_in[c])
                continue;
            cell_here[c] = static_cast<int>(lattice.cells.size());
            CornerNodes& corners = lattice.cells.emplace_back(whole.cells[c]);
            for (int& node : corners)
            {
                int& here = place[idx(node)];
                if (here < 0)
                {
                    here = static_cast<int>(nodes.size());
                    nodes.push_back(node);
                    lattice.places.push_back(whole.places[idx(node)]);
                }
                node = here;
            }
        }
        std::vector<int> part_here(whole.parts.size(), -1);
        for (std::size_t p = 0; p < whole.parts.size(); ++p)
            if (const int cell = cell_here[idx(whole.parts[p].cell)]; cell >= 0)
            {
                part_here[p] = static_cast<int>(lattice.parts.size());
                lattice.parts.emplace_back(whole.parts[p]).cell = cell;
            }
        return part_here;
    }
};

BlendedRegions::BlendedRegions(const Lattice& lattice, const BoundNodes& nodes,
                               std::span<const FleshMaterial> materials,
                               std::span<const TubePart> tubes,
                               std::vector<FleshRegionShares> regions, double alpha,
                               double beta)
    : nodes_(nodes), alpha_(alpha), beta_(beta)
{
    const SparseRows by_free = by_free_of_all(nodes);
    VectorXd sums = VectorXd::Zero(Eigen::Index(lattice.places.size()));
    for (const FleshRegionShares& region : regions)
    {
        for (const NodeShare& share : region.shares)
            sums[share.node] += share.share;
        if (!region.shares.empty())
            regions_.push_back(std::make_unique<Region>(lattice, nodes, by_free,
                                                        materials, tubes, region));
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
    parallel_for(regions_.size(), [&](std::size_t i)
                 { regions_[i]->solve(predicted, v, outside, dt_, alpha_, beta_); });
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

} // namespace cellwarp::core
