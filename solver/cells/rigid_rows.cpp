// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/rigid_rows.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Eigenvalues>

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

/// What an unknown of a block does in common axes, a column each.
Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6> columns_of(const BlockPlace& place,
                                                             int size)
{
    Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6> columns =
        Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>::Zero(6, size);
    columns.topLeftCorner<3, 3>() = place.pose.R;
    if (size == 4)
        columns.bottomRightCorner<3, 1>() = place.along;
    else if (size == 6)
        columns.bottomRightCorner<3, 3>() = place.pose.R;
    return columns;
}

/// Directions in which nothing holds a body because none of its members shifts there get
/// a stiffness of their own, so that it can be solved for. Returns onto the others.
Eigen::Matrix3d held_in_idle_directions(Eigen::Ref<Eigen::Matrix3d> linear)
{
    constexpr double kNone = 1e-10; // of the largest
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(linear);
    const double largest = eigen.eigenvalues()[2];
    if (!(largest > 0.0))
    {
        linear.setIdentity();
        return Eigen::Matrix3d::Zero();
    }
    Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
    for (int k = 0; k < 3; ++k)
        if (eigen.eigenvalues()[k] <= kNone * largest)
        {
            const Eigen::Vector3d idle = eigen.eigenvectors().col(k);
            linear += largest * idle * idle.transpose();
            shift -= idle * idle.transpose();
        }
    return shift;
}

} // namespace

RigidRows rows_of(const BlockOperator& matrix, std::span<const BlockPlace> poses)
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
    for_each_body(
        static_cast<int>(sizes.size()),
        [&](std::size_t i)
        {
            Matrix6& D = A.block[idx(A.first[i])];
            D.setIdentity();
            matrix.diagonal_block(static_cast<int>(i),
                                  D.topLeftCorner(sizes[i], sizes[i]));
            if (sizes[i] != 4)
            {
                turn_block(poses[i].pose.R, poses[i].pose.R, D);
                return;
            }
            const auto columns = columns_of(poses[i], 4);
            const double along = D(3, 3);
            D = (columns * D.topLeftCorner<4, 4>() * columns.transpose()).eval();
            D.bottomRightCorner<3, 3>() +=
                along * (Eigen::Matrix3d::Identity() -
                         poses[i].along * poses[i].along.transpose());
        });
    for_each_body(
        static_cast<int>(pairs.size()),
        [&](std::size_t k)
        {
            const int rows = sizes[idx(pairs[k].first)];
            const int columns = sizes[idx(pairs[k].second)];
            Matrix6& block = A.block[idx(places[k].first)];
            block.setZero();
            matrix.pair_block(static_cast<int>(k), block.topLeftCorner(rows, columns));
            const BlockPlace &row = poses[idx(pairs[k].first)],
                             &column = poses[idx(pairs[k].second)];
            if (rows != 4 && columns != 4)
                turn_block(row.pose.R, column.pose.R, block);
            else
                block = (columns_of(row, rows) * block.topLeftCorner(rows, columns) *
                         columns_of(column, columns).transpose())
                            .eval();
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
        next.shift.push_back(Eigen::Matrix3d::Identity());
    }
    return next;
}

RigidRows joined_rows(const RigidRows& A, const RigidBodies& bodies,
                      const Grouping& grouping, RigidBodies& next_bodies)
{
    const std::vector<int>& body = grouping.group_of_node;
    const auto arm = [&](std::size_t i) -> Eigen::Matrix3d
    { return cross_matrix(bodies.centre[i] - next_bodies.centre[idx(body[i])]); };
    // T_i^T A_ij T_j in true unknowns, with T = [I 0; -[arm]x I].
    const auto carried = [&](std::size_t i, std::size_t j, const Matrix6& scaled)
    {
        Matrix6 B = A.scale[i].cwiseInverse().asDiagonal() * scaled *
                    A.scale[j].cwiseInverse().asDiagonal();
        if (!bodies.is_free(i))
            B.bottomRows<3>() = (bodies.shift[i] * B.bottomRows<3>()).eval();
        if (!bodies.is_free(j))
            B.rightCols<3>() = (B.rightCols<3>() * bodies.shift[j]).eval();
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
                      const std::span<const int> members = grouping.members.of(b);
                      if (std::any_of(members.begin(), members.end(),
                                      [&](int i) { return bodies.is_free(idx(i)); }))
                          return;
                      Matrix6& D = row.front().second;
                      next_bodies.shift[b] =
                          held_in_idle_directions(D.bottomRightCorner<3, 3>());
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
