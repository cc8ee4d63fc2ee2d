// SPDX-License-Identifier: GPL-3.0-or-later
// Each part gives numbers for its corners into a place of its own; then each node sums
// what its places hold, in their order.
#include "solver/flesh/flesh_forces.h"

#include <algorithm>
#include <type_traits>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "octree/base/nearest_rotation.h"
#include "octree/base/parallel.h"
#include "solver/flesh/part_points.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::size_t kRowsOfBlock = 24;

/// The numbers of a part's corners, a column each.
template <class Vector>
auto by_corners(Vector& of)
{
    using Matrix =
        std::conditional_t<std::is_const_v<Vector>, const Eigen::Matrix<double, 3, 8>,
                           Eigen::Matrix<double, 3, 8>>;
    return Eigen::Map<Matrix>(of.data());
}

/// Blocks and nodes that are worth a thread of their own.
constexpr std::size_t kGrainOfBlocks = 16, kGrainOfNodes = 1024;

/// The rotation of a polar decomposition, by Newton's method where the matrix turns
/// nothing inside out [Higham86], else by singular vectors.
Matrix3d rotation_of(const Matrix3d& F)
{
    // Relative to the determinant of the rotation of the same norm, which is sqrt(3).
    constexpr double kFlat = 1e-2, kClose = 1e-14;
    constexpr int kSteps = 20;
    const double scale = F.norm() / std::sqrt(3.0);
    if (!(F.determinant() > kFlat * scale * scale * scale))
        return nearest_rotation(F);
    Matrix3d R = F;
    for (int step = 0; step < kSteps; ++step)
    {
        Matrix3d cofactor;
        cofactor << R.col(1).cross(R.col(2)), R.col(2).cross(R.col(0)),
            R.col(0).cross(R.col(1));
        const Matrix3d next = 0.5 * (R + cofactor / R.col(0).dot(cofactor.col(0)));
        const double change = (next - R).squaredNorm();
        R = next;
        if (change < kClose)
            break; // it converges quadratically: the next step would change nothing
    }
    return R;
}

/// The lower triangle, row by row.
template <class Matrix>
void add_triangle(const Matrix& of, std::size_t lane, PartRow* rows)
{
    for (Eigen::Index r = 0; r < of.rows(); ++r)
        for (Eigen::Index c = 0; c <= r; ++c)
            (rows++)->lane[lane] += of(r, c);
}

void set_part(PartBlock& block, std::size_t lane, const PartPoints& points,
              const FleshMaterial& material)
{
    Vector3d centre = Vector3d::Zero();
    for (const Vector3d& x : points.local)
        centre += x / 8.0;
    for (std::size_t c = 0; c < 3; ++c)
        block.centre[c].lane[lane] = centre[Eigen::Index(c)] - 0.5;
    for (int i = 0; i < 3; ++i)
    {
        const Vector3d spread = 0.5 * (points.local[idx(1 << i)] - points.local[0]);
        for (int c = 0; c < 3; ++c)
            block.spread[idx(3 * i + c)].lane[lane] = spread[c];
    }
    block.inverse_edge.lane[lane] = points.inverse[0](0, 0);
    block.weight.lane[lane] = points.weight[0];
    const Eigen::Matrix<double, 9, 9> solve =
        8.0 * points.weight[0] * mode_solve(points, material);
    add_triangle(solve, lane, block.mode_solve);
    add_triangle(mass_of(points, material.density), lane, block.mass);
}

/// All lanes of a block, the last ones filled up with the first.
void fill_up(PartBlock& block, std::size_t used)
{
    PartRow* const rows = reinterpret_cast<PartRow*>(&block);
    for (std::size_t r = 0; r < sizeof(PartBlock) / sizeof(PartRow); ++r)
        for (std::size_t l = used; l < kPartLanes; ++l)
            rows[r].lane[l] = rows[r].lane[0];
}

std::vector<PartBlock> blocks_of(const Lattice& lattice,
                                 std::span<const FleshMaterial> materials)
{
    std::vector<PartBlock> blocks((lattice.parts.size() + kPartLanes - 1) / kPartLanes);
    const auto set = [&](std::size_t p)
    {
        const LatticePart& part = lattice.parts[p];
        const FleshMaterial& material = materials[idx(part.material)];
        const PartPoints points = points_of(lattice, part);
        PartBlock& block = blocks[p / kPartLanes];
        const std::size_t lane = p % kPartLanes;
        block.lambda.lane[lane] = material.lambda();
        block.shear.lane[lane] = material.shear();
        const Vector3d middle = cell_point(lattice, part.cell, Vector3d::Constant(0.5));
        for (std::size_t a = 0; a < 8; ++a)
        {
            const Vector3d x =
                lattice.places[idx(lattice.cells[idx(part.cell)][a])] - middle;
            for (std::size_t c = 0; c < 3; ++c)
                block.rest[3 * a + c].lane[lane] = x[Eigen::Index(c)];
        }
        set_part(block, lane, points, material);
    };
    parallel_for(lattice.parts.size(), kGrainOfBlocks * kPartLanes, set);
    if (!blocks.empty() && lattice.parts.size() % kPartLanes != 0)
        fill_up(blocks.back(), lattice.parts.size() % kPartLanes);
    return blocks;
}

} // namespace

FleshForces::FleshForces(const Lattice& lattice, std::span<const FleshMaterial> materials,
                         std::vector<TubePart> tubes)
    : FleshForces(lattice, materials, std::move(tubes), instruction_sets().back())
{
}

FleshForces::FleshForces(const Lattice& lattice, std::span<const FleshMaterial> materials,
                         std::vector<TubePart> tubes, InstructionSet set)
    : lattice_(lattice), kernels_(part_kernels(set)), num_nodes_(lattice.places.size()),
      materials_(materials.begin(), materials.end()), tubes_(std::move(tubes))
{
    if (lattice.has_boxes)
        blocks_ = blocks_of(lattice, materials);
    else
        for (const LatticePart& part : lattice.parts)
        {
            const FleshMaterial& material = materials[idx(part.material)];
            const PartPoints points = points_of(lattice, part);
            hessians_.push_back(stiffness_of(points, material));
            DrawnPart& drawn = drawn_.emplace_back();
            drawn.mass = mass_of(points, material.density);
            drawn.tube.setZero();
            drawn.slopes.setZero();
            for (int k = 0; k < 8; ++k)
                drawn.slopes += points.weight[idx(k)] * points.slopes(k);
        }
    const std::size_t num_parts = lattice.parts.size();
    num_blocks_ = (num_parts + kPartLanes - 1) / kPartLanes;
    nodes_.resize(8 * kPartLanes * num_blocks_);
    std::vector<double> volume(lattice.cells.size(), 0.0);
    for (const LatticePart& part : lattice.parts)
        volume[idx(part.cell)] += part.volume;
    std::vector<std::vector<std::uint32_t>> of_node(num_nodes_);
    for (std::size_t p = 0; p < kPartLanes * num_blocks_; ++p)
    {
        const std::size_t block = p / kPartLanes, lane = p % kPartLanes;
        const bool is_real = p < num_parts;
        const LatticePart& part = lattice.parts[is_real ? p : block * kPartLanes];
        cell_of_part_.push_back(part.cell);
        share_of_cell_.push_back(is_real ? 1.0 / volume[idx(part.cell)] : 0.0);
        for (std::size_t a = 0; a < 8; ++a)
        {
            const int node = lattice.cells[idx(part.cell)][a];
            nodes_[(8 * block + a) * kPartLanes + lane] = node;
            if (is_real)
                of_node[idx(node)].push_back(static_cast<std::uint32_t>(
                    (kRowsOfBlock * block + 3 * a) * kPartLanes + lane));
        }
    }
    tube_rows_.resize(blocks_.size());
    for (const TubePart& tube : tubes_)
    {
        const Eigen::Matrix<double, 8, 8> T = tube.stiffness * tube.overlap;
        const std::size_t p = idx(tube.part);
        if (!drawn_.empty())
        {
            drawn_[p].tube += T;
            continue;
        }
        std::vector<PartRow>& rows = tube_rows_[p / kPartLanes];
        rows.resize(kCornerPairs);
        add_triangle(T, p % kPartLanes, rows.data());
    }
    given_.resize(kRowsOfBlock * num_blocks_);
    first_of_node_.push_back(0);
    for (const std::vector<std::uint32_t>& offsets : of_node)
    {
        offsets_.insert(offsets_.end(), offsets.begin(), offsets.end());
        first_of_node_.push_back(offsets_.size());
    }
    frames_.assign(lattice.cells.size(), Matrix3d::Identity());
    frame_rows_.resize(9 * num_blocks_);
    stand_still();
}

/// \p how: what all blocks have.
void FleshForces::run_blocks(const PartRun& how, void (*kernel)(const PartRun&)) const
{
    parallel_for(blocks_.size(), kGrainOfBlocks,
                 [&](std::size_t b)
                 {
                     PartRun run = how;
                     run.block = &blocks_[b];
                     run.nodes = &nodes_[8 * kPartLanes * b];
                     run.frames = &frame_rows_[9 * b];
                     run.tubes = tube_rows_[b].empty() ? nullptr : tube_rows_[b].data();
                     run.out = &given_[kRowsOfBlock * b];
                     kernel(run);
                 });
}

void FleshForces::stand_still()
{
    std::fill(frames_.begin(), frames_.end(), Matrix3d::Identity());
    for (std::size_t b = 0; b < num_blocks_; ++b)
        for (std::size_t i = 0; i < 9; ++i)
            std::fill_n(frame_rows_[9 * b + i].lane, kPartLanes, i % 4 == 0 ? 1.0 : 0.0);
}

void FleshForces::mean_deformations(const VectorXd& u, std::vector<Matrix3d>& out) const
{
    PartRun run;
    run.values = u.data();
    run_blocks(run, kernels_.gradients);
    out.assign(frames_.size(), Matrix3d::Identity());
    for (std::size_t p = 0; p < lattice_.parts.size(); ++p)
    {
        Matrix3d& F = out[idx(cell_of_part_[p])];
        if (!drawn_.empty())
        {
            const PartVector values = corners(u, p);
            F += share_of_cell_[p] * by_corners(values) * drawn_[p].slopes.transpose();
            continue;
        }
        const PartRow* const rows = &given_[kRowsOfBlock * (p / kPartLanes)];
        for (int i = 0; i < 9; ++i)
            F(i) += share_of_cell_[p] * rows[i].lane[p % kPartLanes];
    }
}

PartVector FleshForces::corners(const VectorXd& x, std::size_t part) const
{
    PartVector out;
    const CornerNodes& nodes = lattice_.cells[idx(cell_of_part_[part])];
    for (int a = 0; a < 8; ++a)
        out.segment<3>(3 * a) = x.segment<3>(3 * nodes[idx(a)]);
    return out;
}

/// R H R^T times values of a part's corners.
PartVector FleshForces::product(const PartVector& values, std::size_t part) const
{
    const Matrix3d& R = frames_[idx(cell_of_part_[part])];
    PartVector turned, out;
    by_corners(turned) = R.transpose() * by_corners(values);
    turned = (hessians_[part] * turned).eval();
    by_corners(out) = R * by_corners(turned);
    return out;
}

/// What a part gives its corners, into its place.
void FleshForces::give(const PartVector& forces, std::size_t part, bool adds) const
{
    PartRow* const rows = &given_[kRowsOfBlock * (part / kPartLanes)];
    for (int r = 0; r < 24; ++r)
    {
        double& lane = rows[r].lane[part % kPartLanes];
        lane = adds ? lane + forces[r] : forces[r];
    }
}

void FleshForces::take_law(StrainLaw law)
{
    law_ = law;
    points_.clear();
    for (const LatticePart& part : lattice_.parts)
        points_.push_back(points_of(lattice_, part));
}

std::size_t FleshForces::num_inverted(const VectorXd& u) const
{
    std::size_t count = 0;
    for (std::size_t p = 0; law_ && p < points_.size(); ++p)
        count += least_volume(points_[p], corners(u, p)) <= 0.0;
    return count;
}

void FleshForces::follow(const VectorXd& u)
{
    if (law_)
    {
        hessians_.resize(lattice_.parts.size());
        parallel_for(hessians_.size(), kGrainOfBlocks,
                     [&](std::size_t p)
                     {
                         hessians_[p] = strain_hessian(
                             points_[p], materials_[idx(lattice_.parts[p].material)],
                             *law_, corners(u, p), Filter::Yes);
                     });
        return;
    }
    mean_deformations(u, frames_);
    parallel_for(frames_.size(), kGrainOfNodes / 8,
                 [&](std::size_t c) { frames_[c] = rotation_of(frames_[c]); });
    for (std::size_t p = 0; p < cell_of_part_.size(); ++p)
        for (int i = 0; i < 9; ++i)
            frame_rows_[9 * (p / kPartLanes) + idx(i)].lane[p % kPartLanes] =
                frames_[idx(cell_of_part_[p])](i);
}

/// Of the corners of a tube's cell, from where they are to where the bone has them.
PartVector FleshForces::way_to_bone(const TubePart& tube, const VectorXd& u,
                                    std::span<const Motion> motions) const
{
    const CornerNodes& nodes = lattice_.cells[idx(cell_of_part_[idx(tube.part)])];
    const Motion& T = motions[idx(tube.motion)];
    PartVector way;
    for (int a = 0; a < 8; ++a)
    {
        const Vector3d& x = lattice_.places[idx(nodes[idx(a)])];
        way.segment<3>(3 * a) = T(x) - x - u.segment<3>(3 * nodes[idx(a)]);
    }
    return way;
}

void FleshForces::gather(VectorXd& out) const
{
    out.resize(Eigen::Index(3 * num_nodes_));
    const double* const given = given_.front().lane;
    parallel_for(num_nodes_, kGrainOfNodes,
                 [&](std::size_t n)
                 {
                     double x = 0.0, y = 0.0, z = 0.0;
                     for (std::size_t k = first_of_node_[n]; k < first_of_node_[n + 1];
                          ++k)
                     {
                         const double* const at = given + offsets_[k];
                         x += at[0];
                         y += at[kPartLanes];
                         z += at[2 * kPartLanes];
                     }
                     double* const sum = out.data() + 3 * n;
                     sum[0] = x;
                     sum[1] = y;
                     sum[2] = z;
                 });
}

void FleshForces::multiply(const VectorXd& x, const FleshFactors& factors,
                           VectorXd& y) const
{
    PartRun run;
    run.values = x.data();
    run.mass = factors.mass;
    run.stiffness = law_ ? 0.0 : factors.stiffness;
    run.tube = factors.tube;
    run_blocks(run, kernels_.product);
    if (!drawn_.empty() || (law_ && factors.stiffness != 0.0))
        parallel_for(lattice_.parts.size(), kGrainOfBlocks * kPartLanes,
                     [&](std::size_t p)
                     {
                         const PartVector v = corners(x, p);
                         PartVector sum = PartVector::Zero();
                         if (factors.stiffness != 0.0)
                             sum = factors.stiffness * product(v, p);
                         if (!drawn_.empty())
                             by_corners(sum) +=
                                 by_corners(v) * (factors.mass * drawn_[p].mass +
                                                  factors.tube * drawn_[p].tube);
                         give(sum, p, drawn_.empty());
                     });
    gather(y);
}

/// Elastic forces of small strain, times \p factor, into the parts' places.
void FleshForces::pull_to_rest(const VectorXd& u, double factor) const
{
    PartRun run;
    run.values = u.data();
    run.stiffness = factor;
    run.from_rest = true;
    run_blocks(run, kernels_.product);
    parallel_for(drawn_.size(), kGrainOfBlocks * kPartLanes,
                 [&](std::size_t p)
                 {
                     // Forces sum to zero: rest may be seen from the first corner.
                     const CornerNodes& nodes = lattice_.cells[idx(cell_of_part_[p])];
                     const Matrix3d& R = frames_[idx(cell_of_part_[p])];
                     PartVector way = corners(u, p);
                     for (std::size_t a = 0; a < 8; ++a)
                     {
                         const Vector3d x = lattice_.places[idx(nodes[a])] -
                                            lattice_.places[idx(nodes[0])];
                         way.segment<3>(Eigen::Index(3 * a)) += x - R * x;
                     }
                     give(factor * product(way, p), p, false);
                 });
}

void FleshForces::forces(const VectorXd& u, std::span<const Motion> motions,
                         VectorXd& out) const
{
    if (law_)
        parallel_for(lattice_.parts.size(), kGrainOfBlocks,
                     [&](std::size_t p)
                     {
                         give(-strain_energy(points_[p],
                                             materials_[idx(lattice_.parts[p].material)],
                                             *law_, corners(u, p))
                                   .gradient,
                              p, false);
                     });
    else
        pull_to_rest(u, -1.0);
    for (const TubePart& tube : tubes_)
    {
        PartVector pull = way_to_bone(tube, u, motions);
        by_corners(pull) *= tube.stiffness * tube.overlap;
        give(pull, idx(tube.part), true);
    }
    gather(out);
}

double FleshForces::elastic_energy(const VectorXd& u) const
{
    if (law_)
    {
        double energy = 0.0;
        for (std::size_t p = 0; p < lattice_.parts.size(); ++p)
            energy +=
                strain_energy(points_[p], materials_[idx(lattice_.parts[p].material)],
                              *law_, corners(u, p))
                    .energy;
        return energy;
    }
    // 1/2 z^T K z, z = R^T (X + u) - X: the force times what the corners went from R X.
    pull_to_rest(u, 1.0);
    double energy = 0.0;
    for (std::size_t p = 0; p < lattice_.parts.size(); ++p)
    {
        const std::size_t lane = p % kPartLanes;
        const PartRow* const rows = &given_[kRowsOfBlock * (p / kPartLanes)];
        const int cell = cell_of_part_[p];
        const CornerNodes& nodes = lattice_.cells[idx(cell)];
        const Matrix3d& R = frames_[idx(cell)];
        const Vector3d& first = lattice_.places[idx(nodes[0])];
        for (std::size_t a = 0; a < 8; ++a)
        {
            // Forces of a cell sum to zero: any point may be taken off.
            const Vector3d x = lattice_.places[idx(nodes[a])] - first;
            const Vector3d went =
                x + u.segment<3>(3 * nodes[a]) - u.segment<3>(3 * nodes[0]) - R * x;
            energy += 0.5 * (went.x() * rows[3 * a].lane[lane] +
                             went.y() * rows[3 * a + 1].lane[lane] +
                             went.z() * rows[3 * a + 2].lane[lane]);
        }
    }
    return energy;
}

double FleshForces::tube_energy(const VectorXd& u, std::span<const Motion> motions) const
{
    double energy = 0.0;
    for (const TubePart& tube : tubes_)
    {
        const PartVector way = way_to_bone(tube, u, motions);
        energy += 0.5 * tube.stiffness *
                  (by_corners(way) * tube.overlap).cwiseProduct(by_corners(way)).sum();
    }
    return energy;
}

std::vector<Eigen::Matrix<double, 8, 8>>
FleshForces::mean_blocks(const FleshFactors& factors) const
{
    std::vector<Eigen::Matrix<double, 8, 8>> out(lattice_.parts.size());
    parallel_for(out.size(), kGrainOfBlocks,
                 [&](std::size_t p)
                 {
                     const LatticePart& part = lattice_.parts[p];
                     const FleshMaterial& material = materials_[idx(part.material)];
                     const PartPoints points = points_of(lattice_, part);
                     const PartMatrix K = stiffness_of(points, material);
                     out[p] = factors.mass * mass_of(points, material.density);
                     for (int a = 0; a < 8; ++a)
                         for (int b = 0; b < 8; ++b)
                             out[p](a, b) += factors.stiffness *
                                             K.block<3, 3>(3 * a, 3 * b).trace() / 3.0;
                 });
    for (const TubePart& tube : tubes_)
        out[idx(tube.part)] += factors.tube * tube.stiffness * tube.overlap;
    return out;
}

} // namespace cellwarp::core
