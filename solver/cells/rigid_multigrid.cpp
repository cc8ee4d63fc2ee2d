// SPDX-License-Identifier: GPL-3.0-or-later
// Levels. The cells in a block of 2 x 2 x 2 that hang together become one body of the
// next level, which moves them rigidly: with e = (omega, v) of the body about its centre
// C,
//   T_i e = (omega, v + omega x (c_i - C)),      A_C = sum T_i^T A_ij T_j
// A_C has the form of glue between the bodies and the same rigid null space, so it goes
// on like that until few bodies are left, which are solved for exactly.
//
// What turns about a point only takes part in the turn. What slides along a curve, at P
// in the direction tau, takes tau . (v + omega x (P - C)) of the shift: its shift is a
// vector in these levels like any other, of which only the part along tau counts.
//
// Correction. Groups are rigid, so a level can be strained only between its bodies. Take
// cells of edge h under the strain e: each of their faces opens by e h. Of bodies of edge
// 2 h every second face opens, by 2 e h: half as many faces with four times the energy
// each, twice the energy in all. So a level thinks the body twice as stiff as the level
// below does, and its correction comes out too small by up to 2. It is multiplied by
// kOvercorrection: at 115,000 cells conjugate gradients take 12 steps with 1.7 and 24
// with 1.
//
// Scale. Angular and linear rows and rows of stiff and soft parts differ by many orders;
// every level is scaled to a unit diagonal, so that single precision holds it.
#include "solver/cells/rigid_multigrid.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "octree/base/index.h"
#include "octree/base/rigid_motion.h"
#include "solver/cells/rigid_rows.h"
#include "solver/cells/smoothed_level.h"
#include "solver/linear/block_matrix.h"
#include "solver/linear/cholesky.h"

namespace cellwarp
{

namespace
{

constexpr double kOvercorrection = 1.7;

/// Bodies that are coupled by less than this share of what holds each of them are
/// not joined: a soft neighbour would stiffen with a stiff one. Across a border from
/// plain to 1e8 times as stiff material, whose glue is the geometric mean, the share is
/// 0.01 to 0.02.
constexpr double kWeak = 0.03;

/// So few bodies are solved for exactly; also when a level has hardly fewer bodies than
/// the one before.
constexpr int kFew = 48;
constexpr double kStalled = 0.7;

std::vector<LevelTransfer> transfers_of(const RigidRows& A, const RigidBodies& bodies,
                                        const Grouping& grouping, const RigidRows& next,
                                        const RigidBodies& next_bodies)
{
    // The same factor on both ways keeps the cycle symmetric, and the same for all bodies
    // lets several move as one. Where most rows wait for others there is little to make
    // up.
    const bool is_joined = 2 * grouping.members.size() < bodies.centre.size();
    const double over = is_joined ? std::sqrt(kOvercorrection) : 1.0;
    std::vector<LevelTransfer> transfers(bodies.centre.size());
    for (std::size_t i = 0; i < transfers.size(); ++i)
    {
        const std::size_t b = idx(grouping.group_of_node[i]);
        const double turn = over * next.scale[b][0], shift = over * next.scale[b][3];
        const Eigen::Vector3d arm =
            (bodies.centre[i] - next_bodies.centre[b]) * (turn / A.scale[i][3]);
        LevelTransfer& t = transfers[i];
        t.turn = static_cast<float>(turn / A.scale[i][0]);
        t.shift = 0.0f;
        if (bodies.shift[i].isZero(0))
            continue;
        t.shift = static_cast<float>(shift / A.scale[i][3]);
        for (int k = 0; k < 3; ++k)
            t.arm[idx(k)] = static_cast<float>(arm[k]);
    }
    return transfers;
}

} // namespace

struct RigidMultigrid::Levels
{
    std::vector<int> sizes, first;      ///< of the unknowns
    std::vector<Vector6> scale;         ///< of the finest level
    std::vector<Eigen::Matrix3d> axes;  ///< of each unknown, when this was made
    std::vector<Eigen::Vector3d> along; ///< of each unknown that slides, then
    std::vector<SmoothedLevel> levels;
    // The coarsest level, solved for exactly.
    BlockMatrix matrix;
    std::optional<SparseCholesky> solver;
    bool is_solved = false;
    Eigen::VectorXd right, solution;

    void factorize(const RigidRows& A);
    void solve_coarsest();
};

void RigidMultigrid::Levels::factorize(const RigidRows& A)
{
    const std::vector<int> six(idx(A.count()), 6);
    const auto for_lower = [&](auto&& body)
    {
        for (std::size_t i = 0; i < six.size(); ++i)
            for (std::size_t k = A.begin(i); k < A.end(i); ++k)
                if (A.column[k] <= static_cast<int>(i))
                    body(static_cast<int>(i), A.column[k], A.block[k]);
    };
    std::vector<std::pair<int, int>> pairs;
    for_lower(
        [&](int row, int column, const Matrix6&)
        {
            if (column < row)
                pairs.emplace_back(row, column);
        });
    matrix = BlockMatrix(six, pairs);
    for_lower([&](int row, int column, const Matrix6& block)
              { matrix.block(matrix.find(row, column)) = block; });
    solver.emplace(matrix);
    is_solved = solver->factorize(matrix);
    // What rounding made indefinite is held a little.
    for (double ridge = 1e-12; !is_solved && ridge < 1.0; ridge *= 100.0)
    {
        for (int i = 0; i < A.count(); ++i)
            matrix.diagonal(i).diagonal().array() += ridge;
        is_solved = solver->factorize(matrix);
    }
    right.resize(matrix.rows());
}

void RigidMultigrid::Levels::solve_coarsest()
{
    SmoothedLevel& level = levels.back();
    for (int i = 0; i < level.count(); ++i)
        for (int k = 0; k < 6; ++k)
            right[6 * i + k] = level.right[idx(i)][k];
    if (is_solved)
        solver->solve(right, solution);
    else
        solution.setZero(right.size());
    for (int i = 0; i < level.count(); ++i)
        for (int k = 0; k < 6; ++k)
            level.x[idx(i)][k] = static_cast<float>(solution[6 * i + k]);
}

RigidMultigrid::RigidMultigrid(const BlockOperator& matrix,
                               std::span<const GridPlace> places,
                               std::span<const BlockPlace> poses)
    : levels_(std::make_unique<Levels>())
{
    Levels& own = *levels_;
    own.sizes.assign(matrix.block_sizes().begin(), matrix.block_sizes().end());
    own.first.push_back(0);
    for (const int size : own.sizes)
        own.first.push_back(own.first.back() + size);
    if (own.sizes.empty())
        return;
    RigidRows A = rows_of(matrix, poses);
    for (const BlockPlace& place : poses)
    {
        own.axes.push_back(place.pose.R);
        own.along.push_back(place.along);
    }
    own.scale = A.scale;
    RigidBodies bodies;
    for (std::size_t i = 0; i < places.size(); ++i)
    {
        bodies.centre.push_back(poses[i].pose.p);
        const Eigen::Vector3d& along = poses[i].along;
        bodies.shift.push_back(own.sizes[i] == 6   ? Eigen::Matrix3d::Identity().eval()
                               : own.sizes[i] == 3 ? Eigen::Matrix3d::Zero().eval()
                                                   : (along * along.transpose()).eval());
    }
    OctreeBlocks blocks(places);
    for (;;)
    {
        SmoothedLevel& level = own.levels.emplace_back(A);
        if (A.count() <= kFew)
            break;
        const bool is_waiting = blocks.is_mixed();
        level.grouping = blocks.join(A, [&](std::size_t, std::size_t k)
                                     { return A.block[k].norm() > kWeak; });
        const double left = static_cast<double>(level.grouping.members.size());
        if (!is_waiting && left > kStalled * A.count())
            break;
        RigidBodies next_bodies = joined_bodies(bodies, level.grouping.members);
        RigidRows next = joined_rows(A, bodies, level.grouping, next_bodies);
        level.transfer = transfers_of(A, bodies, level.grouping, next, next_bodies);
        A = std::move(next);
        bodies = std::move(next_bodies);
    }
    own.factorize(A);
}

RigidMultigrid::~RigidMultigrid() = default;
RigidMultigrid::RigidMultigrid(RigidMultigrid&&) noexcept = default;
RigidMultigrid& RigidMultigrid::operator=(RigidMultigrid&&) noexcept = default;

void RigidMultigrid::apply(const Eigen::VectorXd& r, Eigen::VectorXd& z)
{
    Levels& own = *levels_;
    z.resize(r.size());
    if (own.levels.empty())
        return;
    // Residuals come in any size: the cycle is given one of about 1.
    double largest = 0.0;
    for (std::size_t i = 0; i < own.sizes.size(); ++i)
        for (int k = 0; k < own.sizes[i]; ++k)
            largest = std::max(largest, std::abs(r[own.first[i] + k] * own.scale[i][k]));
    if (!(largest > 0.0) || !std::isfinite(largest))
    {
        z = r;
        return;
    }
    SmoothedLevel& finest = own.levels.front();
    for_each_body(
        finest.count(),
        [&](std::size_t i)
        {
            const bool slides = own.sizes[i] == 4;
            for (int k = 0; k < own.sizes[i]; k += 3)
            {
                const double scale = own.scale[i][k] / largest;
                const Eigen::Vector3d part =
                    slides && k == 3
                        ? Eigen::Vector3d(own.along[i] * (r[own.first[i] + 3] * scale))
                        : Eigen::Vector3d(own.axes[i] * r.segment<3>(own.first[i] + k) *
                                          scale);
                for (int axis = 0; axis < 3; ++axis)
                    finest.right[i][k + axis] = static_cast<float>(part[axis]);
            }
        });
    for (std::size_t l = 0; l + 1 < own.levels.size(); ++l)
        own.levels[l].before(own.levels[l + 1]);
    own.solve_coarsest();
    for (std::size_t l = own.levels.size() - 1; l-- > 0;)
        own.levels[l].after(own.levels[l + 1]);
    for_each_body(finest.count(),
                  [&](std::size_t i)
                  {
                      for (int k = 0; k < own.sizes[i]; k += 3)
                      {
                          Eigen::Vector3d part;
                          for (int axis = 0; axis < 3; ++axis)
                              part[axis] = finest.x[i][k + axis];
                          const double scale = largest * own.scale[i][k];
                          if (own.sizes[i] == 4 && k == 3)
                              z[own.first[i] + 3] = own.along[i].dot(part) * scale;
                          else
                              z.segment<3>(own.first[i] + k) =
                                  own.axes[i].transpose() * part * scale;
                      }
                  });
}

std::vector<int> RigidMultigrid::sizes() const
{
    std::vector<int> sizes;
    for (const SmoothedLevel& level : levels_->levels)
        sizes.push_back(level.count());
    return sizes;
}

double RigidMultigrid::bytes() const
{
    double bytes = levels_->solver ? 8.0 * levels_->solver->factor_numbers() : 0.0;
    for (const SmoothedLevel& level : levels_->levels)
        bytes += static_cast<double>(
            kBlockBytes * (level.block.size() + 2 * level.diagonal.size()) +
            sizeof(int) * (level.links.column.size() + 4 * level.transfer.size()) +
            sizeof(LevelTransfer) * level.transfer.size() +
            5 * sizeof(WideVector) * level.x.size());
    return bytes;
}

double RigidMultigrid::memory_estimate(std::size_t cells, std::size_t faces)
{
    // WideBlocks in single and in double precision. In solids the coarser levels add a
    // seventh, in rods and where cells differ in size as much again; and vectors grow by
    // doubling.
    constexpr double kLevels = 2.5;
    const double blocks = 2.0 * static_cast<double>(faces) + static_cast<double>(cells);
    return kLevels * (kBlockBytes + sizeof(Matrix6) + sizeof(int)) * blocks;
}

} // namespace cellwarp
