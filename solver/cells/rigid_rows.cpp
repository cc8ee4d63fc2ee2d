// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/rigid_rows.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// [a]x [b]x
Eigen::Matrix3d cross_twice(const Eigen::Vector3d& a, const Eigen::Vector3d& b)
{
    return b * a.transpose() - a.dot(b) * Eigen::Matrix3d::Identity();
}

/// Scales rows and columns to a mean diagonal of 1, angular and linear apart.
void scale_rows(RigidRows& A)
{
    A.scale.resize(idx(A.count()));
    const auto scale_of = [](double trace)
    { return trace > 0 && std::isfinite(trace) ? 1.0 / std::sqrt(trace / 3.0) : 1.0; };
    for_each_body(A.count(),
                  [&](std::size_t i)
                  {
                      const Matrix6 D = A.block(A.diagonal(i));
                      A.scale[i].head<3>().setConstant(
                          scale_of(D.topLeftCorner<3, 3>().trace()));
                      A.scale[i].tail<3>().setConstant(
                          scale_of(D.bottomRightCorner<3, 3>().trace()));
                  });
    for_each_body(A.count(),
                  [&](std::size_t i)
                  {
                      for (std::size_t k = A.begin(i); k < A.end(i); ++k)
                      {
                          const Vector6& of_row = A.scale[i];
                          const Vector6& of_column = A.scale[idx(A.column[k])];
                          A.glue[k] = A.glue[k].scaled(of_row, of_column);
                          if (A.rest[k])
                              *A.rest[k] = of_row.asDiagonal() * *A.rest[k] *
                                           of_column.asDiagonal();
                      }
                  });
}

using Block = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 6, 6>;

/// A block of the unknowns of two bodies in common axes.
Matrix6 in_common_axes(const UnknownBody& row, const UnknownBody& column,
                       const Block& block)
{
    Matrix6 padded = Matrix6::Zero();
    padded.topLeftCorner(row.turns, column.turns) =
        block.topLeftCorner(row.turns, column.turns);
    padded.block(0, 3, row.turns, column.shifts) =
        block.topRightCorner(row.turns, column.shifts);
    padded.block(3, 0, row.shifts, column.turns) =
        block.bottomLeftCorner(row.shifts, column.turns);
    padded.block(3, 3, row.shifts, column.shifts) =
        block.bottomRightCorner(row.shifts, column.shifts);
    for (const int i : {0, 3})
        for (const int j : {0, 3})
            padded.block<3, 3>(i, j) = (i == 0 ? row.turn : row.shift) *
                                       padded.block<3, 3>(i, j).eval() *
                                       (j == 0 ? column.turn : column.shift).transpose();
    return padded;
}

/// Gives directions that no unknown leads to the mean stiffness of the others.
void hold_idle(const Eigen::Matrix3d& axes, int count, Eigen::Ref<Eigen::Matrix3d> D)
{
    const Eigen::Matrix3d led = axes * axes.transpose();
    const double directions = led.trace();
    if (count == 3 && directions > 2.5)
        return;
    const double mean = directions > 0.5 ? D.trace() / directions : 0.0;
    D += (mean > 0.0 ? mean : 1.0) * (Eigen::Matrix3d::Identity() - led);
}

/// Motions of a body with which nothing changes because none of its members can make them
/// get a stiffness of their own, so that it can be solved for. Returns onto the others.
Matrix6 held_in_idle_motions(Matrix6& D)
{
    constexpr double kNone = 1e-10; // of the largest
    Vector6 scale;
    for (const int half : {0, 3})
    {
        const double trace = D.block<3, 3>(half, half).trace();
        scale.segment<3>(half).setConstant(trace > 0.0 ? std::sqrt(3.0 / trace) : 1.0);
    }
    const Matrix6 scaled = scale.asDiagonal() * D * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(scaled);
    const double largest = eigen.eigenvalues()[5];
    int idle = 0;
    while (idle < 6 && !(eigen.eigenvalues()[idle] > kNone * largest))
        ++idle;
    if (idle == 0)
        return Matrix6::Identity();
    const auto motions = eigen.eigenvectors().leftCols(idle);
    const Matrix6 held = motions * motions.transpose();
    D += (largest > 0.0 ? largest : 1.0) *
         (scale.cwiseInverse().asDiagonal() * held * scale.cwiseInverse().asDiagonal());
    const Eigen::HouseholderQR<Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>> qr(
        scale.asDiagonal() * motions);
    const Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6> Q =
        qr.householderQ() *
        Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>::Identity(6, idle);
    return Matrix6::Identity() - Q * Q.transpose();
}

} // namespace

void RigidRows::make_blocks()
{
    glue.resize(column.size());
    rest.resize(column.size());
}

Matrix6 RigidRows::block(std::size_t at) const
{
    Matrix6 sum = glue[at].matrix();
    if (rest[at])
        sum += *rest[at];
    return sum;
}

void RigidRows::set_block(std::size_t at, const Matrix6& block)
{
    glue[at] = GlueBlock::zero();
    rest[at].reset();
    add_block(at, block);
}

void RigidRows::add_block(std::size_t at, const Matrix6& block)
{
    if (const std::optional<GlueBlock> as = as_glue(block))
        glue[at] += *as;
    else if (rest[at])
        *rest[at] += block;
    else
        rest[at] = std::make_unique<Matrix6>(block);
}

RigidBodies finest_bodies(std::span<const UnknownBody> bodies)
{
    RigidBodies all;
    for (const UnknownBody& body : bodies)
    {
        const bool is_limited = body.turns < 3 || body.shifts < 3;
        all.add(body.centre, body.is_on_rod, is_limited);
        if (!is_limited)
            continue;
        Matrix6& limit = all.limits.back();
        limit.topLeftCorner<3, 3>() = body.turn * body.turn.transpose();
        limit.bottomRightCorner<3, 3>() = body.shift * body.shift.transpose();
    }
    return all;
}

RigidRows rows_of(const BlockOperator& matrix, std::span<const UnknownBody> bodies)
{
    // Most blocks are of one body; those of rods are of many.
    const std::size_t num_blocks = matrix.block_sizes().size();
    std::vector<int> first_body(num_blocks + 1, 0);
    for (const UnknownBody& body : bodies)
        ++first_body[idx(body.block) + 1];
    for (std::size_t b = 0; b < num_blocks; ++b)
        first_body[b + 1] += first_body[b];
    const auto is_one_body = [&](int block)
    { return first_body[idx(block) + 1] - first_body[idx(block)] == 1; };
    struct Link
    {
        int row, column;
        int source; ///< a pair of the matrix, or a block that has been read: -1 - number
    };
    std::vector<Link> links;
    std::vector<Matrix6> read;
    std::vector<Matrix6> diagonals; // of those of many
    const auto part_of = [&](const Eigen::MatrixXd& whole, int i, int j) -> Block
    {
        const UnknownBody &row = bodies[idx(i)], &column = bodies[idx(j)];
        return whole.block(row.first, column.first, row.turns + row.shifts,
                           column.turns + column.shifts);
    };
    const auto read_link = [&](const Eigen::MatrixXd& whole, int i, int j)
    {
        const Block block = part_of(whole, i, j);
        if (block.isZero(0))
            return;
        links.push_back({i, j, -1 - static_cast<int>(read.size())});
        read.push_back(in_common_axes(bodies[idx(i)], bodies[idx(j)], block));
    };
    const std::span<const std::pair<int, int>> pairs = matrix.pairs();
    const std::span<const int> sizes = matrix.block_sizes();
    for (std::size_t k = 0; k < pairs.size(); ++k)
    {
        const auto& [row, column] = pairs[k];
        if (is_one_body(row) && is_one_body(column))
        {
            links.push_back(
                {first_body[idx(row)], first_body[idx(column)], static_cast<int>(k)});
            continue;
        }
        Eigen::MatrixXd whole =
            Eigen::MatrixXd::Zero(sizes[idx(row)], sizes[idx(column)]);
        matrix.pair_block(static_cast<int>(k), whole);
        for (int i = first_body[idx(row)]; i < first_body[idx(row) + 1]; ++i)
            for (int j = first_body[idx(column)]; j < first_body[idx(column) + 1]; ++j)
                read_link(whole, i, j);
    }
    for (std::size_t b = 0; b < num_blocks; ++b)
    {
        if (is_one_body(static_cast<int>(b)))
            continue;
        Eigen::MatrixXd whole(sizes[b], sizes[b]);
        matrix.diagonal_block(static_cast<int>(b), whole);
        diagonals.resize(bodies.size());
        for (int i = first_body[b]; i < first_body[b + 1]; ++i)
        {
            diagonals[idx(i)] =
                in_common_axes(bodies[idx(i)], bodies[idx(i)], part_of(whole, i, i));
            for (int j = first_body[b]; j < i; ++j)
                read_link(whole, i, j);
        }
    }
    RigidRows A;
    std::vector<int> count(bodies.size(), 1);
    for (const Link& link : links)
    {
        ++count[idx(link.row)];
        ++count[idx(link.column)];
    }
    A.first.push_back(0);
    for (const int n : count)
        A.first.push_back(A.first.back() + n);
    A.column.resize(idx(A.first.back()));
    A.make_blocks();
    // Next free place of each row; the diagonal comes first.
    std::vector<int> next(A.first.begin(), A.first.end() - 1);
    for (std::size_t i = 0; i < bodies.size(); ++i)
        A.column[idx(next[i]++)] = static_cast<int>(i);
    std::vector<std::pair<int, int>> places;
    for (const Link& link : links)
    {
        const int at_row = next[idx(link.row)]++;
        const int at_column = next[idx(link.column)]++;
        A.column[idx(at_row)] = link.column;
        A.column[idx(at_column)] = link.row;
        places.emplace_back(at_row, at_column);
    }
    for_each_body(static_cast<int>(bodies.size()),
                  [&](std::size_t i)
                  {
                      const UnknownBody& body = bodies[i];
                      Matrix6 D;
                      if (!is_one_body(body.block))
                          D = diagonals[i];
                      else
                      {
                          Block block(sizes[idx(body.block)], sizes[idx(body.block)]);
                          matrix.diagonal_block(body.block, block);
                          D = in_common_axes(body, body, block);
                      }
                      hold_idle(body.turn, body.turns, D.topLeftCorner<3, 3>());
                      hold_idle(body.shift, body.shifts, D.bottomRightCorner<3, 3>());
                      A.set_block(A.begin(i), D);
                  });
    for_each_body(static_cast<int>(links.size()),
                  [&](std::size_t k)
                  {
                      const Link& link = links[k];
                      Matrix6 block;
                      if (link.source < 0)
                          block = read[idx(-1 - link.source)];
                      else
                      {
                          const auto& [row, column] = pairs[idx(link.source)];
                          Block own = Block::Zero(sizes[idx(row)], sizes[idx(column)]);
                          matrix.pair_block(link.source, own);
                          block = in_common_axes(bodies[idx(link.row)],
                                                 bodies[idx(link.column)], own);
                      }
                      A.set_block(idx(places[k].first), block);
                      A.set_block(idx(places[k].second), block.transpose());
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
        const std::span<const int> own = members.of(b);
        next.add(sum / static_cast<double>(own.size()),
                 std::any_of(own.begin(), own.end(),
                             [&](int i) { return bodies.is_on_rod[idx(i)]; }),
                 std::none_of(own.begin(), own.end(),
                              [&](int i) { return bodies.is_free(idx(i)); }));
    }
    return next;
}

RigidRows joined_rows(const RigidRows& A, const RigidBodies& bodies,
                      const Grouping& grouping, RigidBodies& next_bodies)
{
    const std::vector<int>& body = grouping.group_of_node;
    const auto arm = [&](std::size_t i) -> Eigen::Vector3d
    { return bodies.centre[i] - next_bodies.centre[idx(body[i])]; };
    // T_i^T A_ij T_j in true unknowns, with T = [I 0; -[arm]x I].
    const auto carry_glue =
        [&](std::size_t i, std::size_t j, const GlueBlock& scaled_glue)
    {
        GlueBlock B =
            scaled_glue.scaled(A.scale[i].cwiseInverse(), A.scale[j].cwiseInverse());
        B.turn -= cross_twice(B.row_arm, arm(j));
        B.column_arm -= B.shift * arm(j);
        B.turn += cross_twice(arm(i), B.column_arm);
        B.row_arm += B.shift * arm(i);
        return B;
    };
    const auto carry = [&](std::size_t i, std::size_t j, const Matrix6& scaled_block)
    {
        Matrix6 B = A.scale[i].cwiseInverse().asDiagonal() * scaled_block *
                    A.scale[j].cwiseInverse().asDiagonal();
        if (!bodies.is_free(i))
            B = (bodies.own_limit(i) * B).eval();
        if (!bodies.is_free(j))
            B = (B * bodies.own_limit(j)).eval();
        B.leftCols<3>() -= B.rightCols<3>() * cross_matrix(arm(j));
        B.topRows<3>() += cross_matrix(arm(i)) * B.bottomRows<3>();
        return B;
    };
    // Which blocks there are is found first: then they lie where they stay.
    const int count = static_cast<int>(grouping.members.size());
    std::vector<std::vector<int>> columns(idx(count)); // its own first
    for_each_body(count,
                  [&](std::size_t b)
                  {
                      std::vector<int>& own = columns[b];
                      own.push_back(static_cast<int>(b));
                      for (const int i : grouping.members.of(b))
                          for (std::size_t k = A.begin(idx(i)); k < A.end(idx(i)); ++k)
                              if (const int column = body[idx(A.column[k])];
                                  std::find(own.begin(), own.end(), column) == own.end())
                                  own.push_back(column);
                  });
    RigidRows next;
    next.first.push_back(0);
    for (const std::vector<int>& own : columns)
    {
        next.column.insert(next.column.end(), own.begin(), own.end());
        next.first.push_back(static_cast<int>(next.column.size()));
    }
    next.make_blocks();
    for_each_body(count,
                  [&](std::size_t b)
                  {
                      const std::size_t first = next.begin(b);
                      std::fill(next.glue.begin() + next.first[b],
                                next.glue.begin() + next.first[b + 1], GlueBlock::zero());
                      for (const int member : grouping.members.of(b))
                      {
                          const std::size_t i = idx(member);
                          for (std::size_t k = A.begin(i); k < A.end(i); ++k)
                          {
                              const std::size_t j = idx(A.column[k]);
                              std::size_t at = first;
                              while (next.column[at] != body[j])
                                  ++at;
                              if (!bodies.is_free(i) || !bodies.is_free(j))
                              {
                                  next.add_block(at, carry(i, j, A.block(k)));
                                  continue;
                              }
                              next.glue[at] += carry_glue(i, j, A.glue[k]);
                              if (A.rest[k])
                                  next.add_block(at, carry(i, j, *A.rest[k]));
                          }
                      }
                      if (next_bodies.is_free(b))
                          return;
                      Matrix6 D = next.block(first);
                      next_bodies.own_limit(b) = held_in_idle_motions(D);
                      next.set_block(first, D);
                  });
    scale_rows(next);
    return next;
}

} // namespace cellwarp::core
