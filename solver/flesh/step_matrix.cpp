// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/step_matrix.h"

#include <algorithm>
#include <map>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;

constexpr std::size_t kPartGrain = 64; ///< parts

/// The same numbers for each axis.
void add_alike(const Eigen::Matrix<double, 8, 8>& of_corners, PartMatrix& A)
{
    for (int axis = 0; axis < 3; ++axis)
        A(Eigen::seqN(axis, 8, 3), Eigen::seqN(axis, 8, 3)) += of_corners;
}

} // namespace

StepMatrix::StepMatrix(const Lattice& lattice, std::span<const FleshMaterial> materials,
                       const SparseRows& by_free, std::size_t num_free)
{
    std::vector<std::pair<int, int>> pairs;
    for (const LatticePart& of : lattice.parts)
    {
        const PartPoints points = points_of(lattice, of);
        const FleshMaterial& material = materials[idx(of.material)];
        Part& part = parts_.emplace_back();
        part.cell = of.cell;
        part.stiffness = stiffness_of(points, material);
        part.mass = mass_of(points, material.density);
        std::map<int, std::array<double, 8>> shares;
        for (std::size_t a = 0; a < 8; ++a)
            for (const NodeShare& share : by_free[idx(lattice.cells[idx(of.cell)][a])])
                shares[share.node][a] = share.share;
        for (const auto& [node, of_corners] : shares)
        {
            for (const int column : part.free)
                pairs.emplace_back(node, column);
            part.free.push_back(node);
            part.shares.push_back(of_corners);
        }
    }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    blocks_ = BlockMatrix(std::vector<int>(num_free, 3), std::move(pairs));
    for (Part& part : parts_)
        for (const int row : part.free)
            for (const int column : part.free)
                part.blocks.push_back(row >= column ? blocks_.find(row, column) : -1);
}

void StepMatrix::assemble(const FleshForces& forces, const FleshFactors& factors)
{
    std::vector<PartMatrix> matrices(parts_.size());
    parallel_for(matrices.size(), kPartGrain,
                 [&](std::size_t p)
                 {
                     const Part& part = parts_[p];
                     const PartMatrix& K =
                         forces.has_law() ? forces.hessians()[p] : part.stiffness;
                     const Matrix3d& R = forces.frames()[idx(part.cell)];
                     for (int a = 0; a < 24; a += 3)
                         for (int b = 0; b < 24; b += 3)
                             matrices[p].block<3, 3>(a, b) = factors.stiffness * R *
                                                             K.block<3, 3>(a, b) *
                                                             R.transpose();
                     add_alike(factors.mass * part.mass, matrices[p]);
                 });
    for (const TubePart& tube : forces.tubes())
        add_alike(factors.tube * tube.stiffness * tube.overlap, matrices[idx(tube.part)]);
    blocks_.set_zero();
    for (std::size_t p = 0; p < matrices.size(); ++p)
        add(parts_[p], matrices[p]);
}

void StepMatrix::add(const Part& part, const PartMatrix& A)
{
    const std::size_t count = part.free.size();
    for (std::size_t i = 0; i < count; ++i)
    {
        Eigen::Matrix<double, 3, 24> row = Eigen::Matrix<double, 3, 24>::Zero();
        for (int a = 0; a < 8; ++a)
            if (const double share = part.shares[i][idx(a)]; share != 0.0)
                row += share * A.middleRows<3>(3 * a);
        for (std::size_t j = 0; j < count; ++j)
        {
            const int block = part.blocks[count * i + j];
            if (block < 0)
                continue;
            Matrix3d sum = Matrix3d::Zero();
            for (int b = 0; b < 8; ++b)
                if (const double share = part.shares[j][idx(b)]; share != 0.0)
                    sum += share * row.middleCols<3>(3 * b);
            blocks_.block(block) += sum;
        }
    }
}

} // namespace cellwarp::core
