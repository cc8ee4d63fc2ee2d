// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/rigid_rows.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp
{

namespace
{

/// Scales rows and columns to a mean diagonal of 1, angular and linear apart.
void scale_rows(RigidRows& A)
{
    A.scale.resize(idx(A.count()));
    const auto scale_of = [](double trace)
    { return trace > 0 && std::isfinite(trace) ? 1.0 / std::sqrt(trace / 3.0) : 1.0; };
    for_each_body(A.count(),
                  [&](std::size_t i)
                  {
                      const Matrix6& D = A.block[A.diagonal(i)];
                      A.scale[i].head<3>().setConstant(
                          scale_of(D.topLeftCorner<3, 3>().trace()));
                      A.scale[i].tail<3>().setConstant(
                          scale_of(D.bottomRightCorner<3, 3>().trace()));
                  });
    for_each_body(A.count(),
                  [&](std::size_t i)
                  {
                      for (std::size_t k = A.begin(i); k < A.end(i); ++k)
                          A.block[k] = A.scale[i].asDiagonal() * A.block[k] *
                                       A.scale[idx(A.column[k])].asDiagonal();
                  });
}

/// Turns a block of the finest level into common axes.
void turn_block(const Eigen::Matrix3d& row, const Eigen::Matrix3d& column, Matrix6& block)
{
    for (const int i : {0, 3})
        for (const int j : {0, 3})
            block.block<3, 3>(i, j) =
                row * block.block<3, 3>(i, j).eval() * column.transpose();
}

} // namespace

RigidRows rows_of(const BlockOperator& matrix, std::span<const Pose> poses)
{
    const std::span<const int> sizes = matrix.block_sizes();
    const std::span<const std::pair<int, int>> pairs = matrix.pairs();
    RigidRows A;
    std::vector<int> count(sizes.size(), 1);
    for (const auto& [row, column] : pairs)
    {
        ++count[idx(row)];
        ++count[idx(column)];
    }
    A.first.push_back(0);
    for (const int n : count)
        A.first.push_back(A.first.back() + n);
    A.column.resize(idx(A.first.back()));
    A.block.resize(A.column.size());
    // Next free place of each row; the diagonal comes first.
    std::vector<int> next(A.first.begin(), A.first.end() - 1);
    for (std::size_t i = 0; i < sizes.size(); ++i)
        A.column[idx(next[i]++)] = static_cast<int>(i);
    std::vector<std::pair<int, int>> places;
    for (const auto& [row, column] : pairs)
    {
        const int at_row = next[idx(row)]++;
        const int at_column = next[idx(column)]++;
        A.column[idx(at_row)] = column;
        A.column[idx(at_column)] = row;
        places.emplace_back(at_row, at_column);
    }
    for_each_body(static_cast<int>(sizes.size()),
                  [&](std::size_t i)
                  {
                      Matrix6& D = A.block[idx(A.first[i])];
                      D.setIdentity();
                      matrix.diagonal_block(static_cast<int>(i),
                                            D.topLeftCorner(sizes[i], sizes[i]));
                      turn_block(poses[i].R, poses[i].R, D);
                  });
    for_each_body(static_cast<int>(pairs.size()),
                  [&](std::size_t k)
                  {
                      const int rows = sizes[idx(pairs[k].first)];
                      const int columns = sizes[idx(pairs[k].second)];
                      Matrix6& block = A.block[idx(places[k].first)];
                      block.setZero();
                      matrix.pair_block(static_cast<int>(k),
                                        block.topLeftCorner(rows, columns));
                      turn_block(poses[idx(pairs[k].first)].R,
                                 poses[idx(pairs[k].second)].R, block);
                      A.block[idx(places[k].second)] = block.transpose();
                  });
    scale_rows(A);
    return A;
}

RigidBodies joined_bodies(const RigidBodies& bodies, const Members& members)
{
    RigidBodies next;
    for (std::size_t b = 0; b < members.size(); ++b)
    {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (const int i : members.of(b))
            sum += bodies.centre[idx(i)];
        next.centre.push_back(sum / static_cast<double>(members.of(b).size()));
        next.shifts.push_back(true);
    }
    return next;
}

RigidRows joined_rows(const RigidRows& A, const RigidBodies& bodies,
                      const Grouping& grouping, const RigidBodies& next_bodies)
{
    const std::vector<int>& body = grouping.group_of_node;
    const auto arm = [&](std::size_t i) -> Eigen::Matrix3d
    { return cross_matrix(bodies.centre[i] - next_bodies.centre[idx(body[i])]); };
    // T_i^T A_ij T_j in true unknowns, with T = [I 0; -[arm]x I].
    const auto carried = [&](std::size_t i, std::size_t j, const Matrix6& scaled)
    {
        Matrix6 B = A.scale[i].cwiseInverse().asDiagonal() * scaled *
                    A.scale[j].cwiseInverse().asDiagonal();
        if (!bodies.shifts[i])
            B.bottomRows<3>().setZero();
        if (!bodies.shifts[j])
            B.rightCols<3>().setZero();
        B.leftCols<3>() -= B.rightCols<3>() * arm(j);
        B.topRows<3>() += arm(i) * B.bottomRows<3>();
        return B;
    };
    const std::size_t count = grouping.members.size();
    std::vector<std::vector<std::pair<int, Matrix6>>> sums(count);
    for_each_body(static_cast<int>(count),
                  [&](std::size_t b)
                  {
                      std::vector<std::pair<int, Matrix6>>& row = sums[b];
                      row.emplace_back(static_cast<int>(b), Matrix6::Zero());
                      for (const int member : grouping.members.of(b))
                      {
                          const std::size_t i = idx(member);
                          for (std::size_t k = A.begin(i); k < A.end(i); ++k)
                          {
                              const std::size_t j = idx(A.column[k]);
                              auto found = std::find_if(row.begin(), row.end(),
                                                        [&](const auto& entry) {
                                                            return entry.first == body[j];
                                                        });
                              if (found == row.end())
                                  found = row.insert(found, {body[j], Matrix6::Zero()});
                              found->second += carried(i, j, A.block[k]);
                          }
                      }
                      // A body of one cell that only turns has nothing to shift.
                      Matrix6& D = row.front().second;
                      if (D.bottomRightCorner<3, 3>().trace() == 0.0)
                          D.bottomRightCorner<3, 3>().setIdentity();
                  });
    RigidRows next;
    std::size_t num_blocks = 0;
    for (const std::vector<std::pair<int, Matrix6>>& row : sums)
        num_blocks += row.size();
    next.column.reserve(num_blocks);
    next.block.reserve(num_blocks);
    next.first.push_back(0);
    for (const std::vector<std::pair<int, Matrix6>>& row : sums)
    {
        for (const auto& [column, block] : row)
        {
            next.column.push_back(column);
            next.block.push_back(block);
        }
        next.first.push_back(static_cast<int>(next.column.size()));
    }
    scale_rows(next);
    return next;
}

} // namespace cellwarp
