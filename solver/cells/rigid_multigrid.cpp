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
// vector in these levels like any other, of which only the part along tau counts. A
// control point of a rod takes the shift v + omega x (q - C), an angle of it tau . omega
// of the turn; what holds make of the others counts as zero.
//
// Rods. Their stiffness along themselves, and the fourth derivatives of their bending,
// are no work for a smoother of single bodies: its bound holds for energies of two bodies
// at a time. All bodies of a level that have a part of a rod in them are therefore solved
// for together wherever the others are smoothed. They are few.
//
// Correction. Groups are rigid, so a level can be strained only between its bodies. Take
// cells of edge h under the strain e: each of their faces opens by e h. Of bodies of edge
// 2 h every second face opens, by 2 e h: half as many faces with four times the energy
// each, twice the energy in all. So a level thinks the body twice as stiff as the level
// below does, and its correction comes out too small by up to 2. It is multiplied by
// kOvercorrection: at 115,000 cells conjugate gradients take 12 steps with 1.7 and 24
// with 1.
//
// Blocks. Of the 36 numbers of a block of glue 16 differ (glue_block.h), between groups
// as between cells: T_i^T A_ij T_j leaves the shifts' part a multiple of I and the mixed
// ones cross products. A cycle takes as long as it takes to read the blocks, so they are
// kept like that; what contacts, curves, rods and planes make of a block is kept beside
// it.
//
// Scale. Angular and linear rows and rows of stiff and soft parts differ by many orders;
// every level is scaled to a unit diagonal, so that single precision holds it.
#include "solver/cells/rigid_multigrid.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "octree/base/index.h"
#include "octree/base/rigid_motion.h"
#include "solver/cells/rigid_rows.h"
#include "solver/cells/smoothed_level.h"

namespace cellwarp::core
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
constexpr int kFewBodies = 48;
constexpr double kStalled = 0.7;

/// A body that shifts by no more of what its group shifts only turns.
constexpr double kNoShift = 1e-9;

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
        if (!bodies.is_free(i) &&
            bodies.own_limit(i).bottomRightCorner<3, 3>().isZero(kNoShift))
            continue;
        t.shift = static_cast<float>(shift / A.scale[i][3]);
        t.arm = four_of(arm);
    }
    return transfers;
}

} // namespace

struct RigidMultigrid::Levels
{
    explicit Levels(std::span<const UnknownBody> of) : bodies(of.begin(), of.end()) {}

    std::vector<UnknownBody> bodies;
    std::vector<Eigen::Index> first; ///< unknown of each body
    std::vector<Vector6> scale;      ///< of the finest level
    std::vector<SmoothedLevel> levels;
    std::optional<ExactBodies> coarsest;

    /// use(unknown, its direction, 0 or 3: whether it turns or shifts) for each of a
    /// body's unknowns.
    template <class Use>
    void for_unknowns(std::size_t i, Use&& use) const
    {
        const UnknownBody& body = bodies[i];
        for (int k = 0; k < body.turns; ++k)
            use(first[i] + k, body.turn.col(k), 0);
        for (int k = 0; k < body.shifts; ++k)
            use(first[i] + body.turns + k, body.shift.col(k), 3);
    }
    /// Of the residuals, as scaled.
    double largest(const Eigen::VectorXd& r)
    {
        parallel_for(
            largest_.size(),
            [&](std::size_t part)
            {
                double most = 0.0;
                const std::size_t begin = part * kBodiesAtOnce;
                const std::size_t end = std::min(begin + kBodiesAtOnce, bodies.size());
                for (std::size_t i = begin; i < end; ++i)
                    for_unknowns(
                        i, [&](Eigen::Index at, const auto&, int half)
                        { most = std::max(most, std::abs(r[at] * scale[i][half])); });
                largest_[part] = most;
            });
        return *std::max_element(largest_.begin(), largest_.end());
    }

private:
    static constexpr std::size_t kBodiesAtOnce = 1024; ///< of one thread
    std::vector<double> largest_ = std::vector<double>(
        std::max<std::size_t>(1, (bodies.size() + kBodiesAtOnce - 1) / kBodiesAtOnce));
};

RigidMultigrid::RigidMultigrid(const BlockOperator& matrix,
                               std::span<const UnknownBody> bodies)
    : levels_(std::make_unique<Levels>(bodies))
{
    Levels& own = *levels_;
    if (bodies.empty())
        return;
    std::vector<Eigen::Index> first_of_block = {0};
    for (const int size : matrix.block_sizes())
        first_of_block.push_back(first_of_block.back() + size);
    std::vector<GridPlace> places;
    for (const UnknownBody& body : bodies)
    {
        own.first.push_back(first_of_block[idx(body.block)] + body.first);
        places.push_back(body.grid);
    }
    RigidRows A = rows_of(matrix, bodies);
    own.scale = A.scale;
    RigidBodies level_bodies = finest_bodies(bodies);
    OctreeBlocks blocks(places);
    for (;;)
    {
        SmoothedLevel& level = own.levels.emplace_back(
            A, level_bodies.is_on_rod,
            [&](std::size_t body) { return blocks.is_waiting(body); });
        if (A.count() <= kFewBodies)
            break;
        const bool is_waiting = blocks.is_mixed();
        level.grouping = blocks.join(A, [&](std::size_t, std::size_t k)
                                     { return A.block(k).norm() > kWeak; });
        const double left = static_cast<double>(level.grouping.members.size());
        if (!is_waiting && left > kStalled * A.count())
            break;
        RigidBodies next_bodies = joined_bodies(level_bodies, level.grouping.members);
        RigidRows next = joined_rows(A, level_bodies, level.grouping, next_bodies);
        level.transfer = transfers_of(A, level_bodies, level.grouping, next, next_bodies);
        A = std::move(next);
        level_bodies = std::move(next_bodies);
    }
    std::vector<int> all(idx(A.count()));
    std::iota(all.begin(), all.end(), 0);
    own.coarsest.emplace(A, std::move(all));
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
    const double largest = own.largest(r);
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
            Vector6 sum = Vector6::Zero();
            own.for_unknowns(
                i, [&](Eigen::Index at, const auto& axis, int half)
                { sum.segment<3>(half) += r[at] * own.scale[i][half] / largest * axis; });
            finest.right[i] = WideVector::of(sum);
        });
    for (std::size_t l = 0; l + 1 < own.levels.size(); ++l)
        own.levels[l].before(own.levels[l + 1]);
    own.coarsest->solve(own.levels.back().right, own.levels.back().x);
    for (std::size_t l = own.levels.size() - 1; l-- > 0;)
        own.levels[l].after(own.levels[l + 1]);
    for_each_body(finest.count(),
                  [&](std::size_t i)
                  {
                      const Vector6 x = finest.x[i].numbers();
                      own.for_unknowns(i,
                                       [&](Eigen::Index at, const auto& axis, int half) {
                                           z[at] = axis.dot(x.template segment<3>(half)) *
                                                   largest * own.scale[i][half];
                                       });
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
    double bytes = levels_->coarsest ? 8.0 * levels_->coarsest->factor_numbers() : 0.0;
    for (const SmoothedLevel& level : levels_->levels)
        bytes += static_cast<double>(
                     sizeof(WideGlue) * level.glue.size() +
                     WideBlocks::kBytes * (level.rest.size() + level.inverse.size()) +
                     sizeof(int) *
                         (level.links.column.size() + level.smoothed.size() +
                          level.rest_links.column.size() + 4 * level.transfer.size()) +
                     sizeof(LevelTransfer) * level.transfer.size() +
                     3 * sizeof(WideVector) * level.x.size() +
                     2 * sizeof(WideVector) * level.on_rods.size()) +
                 (level.rods ? 8.0 * level.rods->factor_numbers() : 0.0);
    return bytes;
}

double RigidMultigrid::memory_estimate(std::size_t cells, std::size_t faces, bool is_flat)
{
    // Blocks in single and in double precision. In solids the coarser levels add a
    // seventh, in rods and where cells differ in size as much again; and vectors grow by
    // doubling. What cells that stay in a plane cannot do leaves blocks of another form
    // than glue's.
    constexpr double kLevels = 2.5;
    const double blocks = 2.0 * static_cast<double>(faces) + static_cast<double>(cells);
    const double of_block = sizeof(WideGlue) + sizeof(GlueBlock) + sizeof(void*) +
                            2 * sizeof(int) +
                            (is_flat ? WideBlocks::kBytes + sizeof(Matrix6) : 0);
    const double of_cell = WideBlocks::kBytes + 3 * sizeof(WideVector) +
                           sizeof(LevelTransfer) + sizeof(UnknownBody);
    return kLevels * (of_block * blocks + of_cell * static_cast<double>(cells));
}

} // namespace cellwarp::core
