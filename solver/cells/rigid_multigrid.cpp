// SPDX-License-Identifier: GPL-3.0-or-later
// Levels. The cells in a block of 2 x 2 x 2 that hang together become one body of the
// next level, which moves them rigidly: with e = (omega, v) of the body about its centre
// C,
//   T_i e = (omega, v + omega x (c_i - C)),      A_C = sum T_i^T A_ij T_j
// A_C has the form of glue between the bodies and the same rigid null space, so it goes
// on like that until few bodies are left, which are solved for exactly.
//
// Correction. Groups are rigid, so a level can be strained only between its bodies. Take
// cells of edge h under the strain e: each of their faces opens by e h. Of bodies of edge
// 2 h every second face opens, by 2 e h: half as many faces with four times the energy
// each, twice the energy in all. So a level thinks the body twice as stiff as the level
// below does, and its correction comes out too small by up to 2. It is multiplied by
// kOvercorrection: at 115,000 cells conjugate gradients take 12 steps with 1.7 and 24
// with 1.
//
// Smoothing. Two steps of Chebyshev's iteration on D^-1 A. A is a sum of squares |J_a x_a
// - J_b x_b|^2 <= 2 |J_a x_a|^2 + 2 |J_b x_b|^2, so its largest eigenvalue is at most 2
// on every level, and nothing has to be estimated. The same before and after the
// correction, the cycle is symmetric; and it is positive definite whatever
// kOvercorrection is, being the sum of a positive definite smoother and a positive
// semi-definite correction.
//
// Scale. Angular and linear rows and rows of stiff and soft parts differ by many orders;
// every level is scaled to a unit diagonal, so that single precision holds it.
#include "solver/cells/rigid_multigrid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>

#include <Eigen/Cholesky>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/rigid_motion.h"
#include "solver/linear/block_matrix.h"
#include "solver/linear/cholesky.h"

namespace cellwarp
{

namespace
{

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double kOvercorrection = 1.7;

/// The eigenvalues that a smoothing damps most. Lower ones are left to the correction.
constexpr float kLargest = 2.0f, kSmallest = kLargest / 6.0f;

/// Bodies that are coupled by less than this share of what holds each of them are not
/// joined: a soft neighbour would stiffen with a stiff one. Across a border from plain to
/// 1e8 times as stiff material, whose glue is the geometric mean, the share is 0.01 to
/// 0.02.
constexpr double kWeak = 0.03;

/// So few bodies are solved for exactly; also when a level has hardly fewer bodies than
/// the one before.
constexpr int kFew = 48;
constexpr double kStalled = 0.7;

/// Loops over fewer bodies are not worth a second thread.
constexpr std::size_t kGrain = 128;

constexpr std::size_t kBlockBytes = 36 * sizeof(float);

/// Six numbers in one register's width. What stands in the last two lanes means nothing.
constexpr int kWide = 8;
using Wide = float __attribute__((vector_size(kWide * sizeof(float))));

template <class Body>
void for_each(int count, Body&& body)
{
    parallel_for(idx(count), kGrain, body);
}

/// 6 x 6 blocks in a row, by columns. A column is loaded in full width: its last lanes
/// are the next column's first numbers, which are finite and go nowhere.
class Blocks
{
public:
    explicit Blocks(std::size_t count) : numbers_(36 * count + (kWide - 6), 0.0f) {}

    std::size_t size() const { return numbers_.size() / 36; }
    void set(std::size_t at, const Matrix6& A)
    {
        Eigen::Map<Eigen::Matrix<float, 6, 6>>(numbers_.data() + 36 * at) =
            A.cast<float>();
    }
    /// y += A x
    void add_product(std::size_t at, const Wide& x, Wide& y) const
    {
        for (int k = 0; k < 6; ++k)
        {
            Wide own;
            std::memcpy(&own, column(at, k), sizeof own);
            y += own * x[k];
        }
    }
    /// y -= A x
    void subtract_product(std::size_t at, const Wide& x, Wide& y) const
    {
        for (int k = 0; k < 6; ++k)
        {
            Wide own;
            std::memcpy(&own, column(at, k), sizeof own);
            y -= own * x[k];
        }
    }

private:
    const float* column(std::size_t at, int k) const
    {
        return numbers_.data() + 36 * at + 6 * k;
    }

    std::vector<float> numbers_;
};

/// The inverse of a positive definite block; what rounding made singular is held a
/// little.
Matrix6 inverse_of(const Matrix6& D)
{
    for (double ridge = 0.0; ridge < 1.0; ridge = std::max(1e-12, 10.0 * ridge))
    {
        const Eigen::LLT<Matrix6> factor(D + ridge * Matrix6::Identity());
        if (factor.info() == Eigen::Success)
            return factor.solve(Matrix6::Identity());
    }
    return Matrix6::Identity();
}

/// A level while it is built: rows of blocks in double precision, diagonal included.
struct Rows : Links
{
    std::vector<Matrix6> block;
    std::vector<Vector6> scale; ///< of each row: the true unknowns are scale times these

    std::size_t diagonal(std::size_t row) const
    {
        std::size_t k = begin(row);
        while (column[k] != static_cast<int>(row))
            ++k;
        return k;
    }
};

/// The bodies of a level.
struct Bodies
{
    std::vector<Eigen::Vector3d> centre;
    std::vector<bool> shifts; ///< false: it turns about a point and does nothing else
};

/// Scales rows and columns to a mean diagonal of 1, angular and linear apart.
void scale_rows(Rows& A)
{
    A.scale.resize(idx(A.count()));
    const auto scale_of = [](double trace)
    { return trace > 0 && std::isfinite(trace) ? 1.0 / std::sqrt(trace / 3.0) : 1.0; };
    for_each(A.count(),
             [&](std::size_t i)
             {
                 const Matrix6& D = A.block[A.diagonal(i)];
                 A.scale[i].head<3>().setConstant(
                     scale_of(D.topLeftCorner<3, 3>().trace()));
                 A.scale[i].tail<3>().setConstant(
                     scale_of(D.bottomRightCorner<3, 3>().trace()));
             });
    for_each(A.count(),
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

/// The rows of the finest level, in common axes. A block of 3 gets three more unknowns
/// that do nothing.
Rows rows_of(const BlockOperator& matrix, std::span<const Pose> poses)
{
    const std::span<const int> sizes = matrix.block_sizes();
    const std::span<const std::pair<int, int>> pairs = matrix.pairs();
    Rows A;
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
    for_each(static_cast<int>(sizes.size()),
             [&](std::size_t i)
             {
                 Matrix6& D = A.block[idx(A.first[i])];
                 D.setIdentity();
                 matrix.diagonal_block(static_cast<int>(i),
                                       D.topLeftCorner(sizes[i], sizes[i]));
                 turn_block(poses[i].R, poses[i].R, D);
             });
    for_each(static_cast<int>(pairs.size()),
             [&](std::size_t k)
             {
                 const int rows = sizes[idx(pairs[k].first)];
                 const int columns = sizes[idx(pairs[k].second)];
                 Matrix6& block = A.block[idx(places[k].first)];
                 block.setZero();
                 matrix.pair_block(static_cast<int>(k),
                                   block.topLeftCorner(rows, columns));
                 turn_block(poses[idx(pairs[k].first)].R, poses[idx(pairs[k].second)].R,
                            block);
                 A.block[idx(places[k].second)] = block.transpose();
             });
    scale_rows(A);
    return A;
}

Bodies joined_bodies(const Bodies& bodies, const Members& members)
{
    Bodies next;
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

/// How a row follows the body above, in the scaled unknowns of both.
struct Transfer
{
    float turn = 1.0f, shift = 1.0f;
    std::array<float, 3> arm = {}; ///< shift += turn of the body x arm
};

struct Level
{
    // Rows without the diagonal.
    Links links;
    Blocks block, diagonal, inverse;
    // To the next level.
    Grouping grouping;
    std::vector<Transfer> transfer;
    // Scratch of a cycle.
    std::vector<Wide> right, x, r, d, d2;

    explicit Level(const Rows& A);
    int count() const { return links.count(); }

    /// sum -= A x, one row
    void subtract_row(std::size_t i, const std::vector<Wide>& at, Wide& sum) const
    {
        diagonal.subtract_product(i, at[i], sum);
        for (std::size_t k = links.begin(i); k < links.end(i); ++k)
            block.subtract_product(k, at[idx(links.column[k])], sum);
    }
    void before(Level& next);
    void after(const Level& next);
};

Level::Level(const Rows& A)
    : block(A.column.size() - idx(A.count())), diagonal(idx(A.count())),
      inverse(idx(A.count()))
{
    const std::size_t n = idx(A.count());
    links.first.push_back(0);
    for (std::size_t i = 0; i < n; ++i)
    {
        for (std::size_t k = A.begin(i); k < A.end(i); ++k)
            if (A.column[k] != static_cast<int>(i))
            {
                block.set(links.column.size(), A.block[k]);
                links.column.push_back(A.column[k]);
            }
        links.first.push_back(static_cast<int>(links.column.size()));
    }
    for_each(A.count(),
             [&](std::size_t i)
             {
                 const Matrix6& D = A.block[A.diagonal(i)];
                 diagonal.set(i, D);
                 inverse.set(i, inverse_of(D));
             });
    for (std::vector<Wide>* v : {&right, &x, &r, &d, &d2})
        v->assign(n, Wide{});
}

constexpr float kCentre = 0.5f * (kLargest + kSmallest);
constexpr float kRadius = 0.5f * (kLargest - kSmallest);
constexpr float kFirst = 1.0f / kCentre;
/// Second step of the Chebyshev iteration: d2 = kKeep d + kGain D^-1 r.
constexpr float kRho = 1.0f / (2.0f * kCentre / kRadius - kRadius / kCentre);
constexpr float kKeep = kRho * kRadius / kCentre, kGain = 2.0f * kRho / kRadius;

/// From x = 0: smooths, and sends what is left to the bodies above.
void Level::before(Level& next)
{
    for_each(count(),
             [&](std::size_t i)
             {
                 Wide z{};
                 inverse.add_product(i, right[i], z);
                 d[i] = kFirst * z;
             });
    for_each(count(),
             [&](std::size_t i)
             {
                 r[i] = right[i];
                 subtract_row(i, d, r[i]);
                 Wide z{};
                 inverse.add_product(i, r[i], z);
                 d2[i] = kKeep * d[i] + kGain * z;
                 x[i] = d[i] + d2[i];
             });
    for_each(next.count(),
             [&](std::size_t b)
             {
                 Wide sum{};
                 for (const int member : grouping.members.of(b))
                 {
                     const std::size_t i = idx(member);
                     Wide left = r[i];
                     subtract_row(i, d2, left);
                     const Transfer& t = transfer[i];
                     // arm x force
                     const Wide turned = {t.arm[1] * left[5] - t.arm[2] * left[4],
                                          t.arm[2] * left[3] - t.arm[0] * left[5],
                                          t.arm[0] * left[4] - t.arm[1] * left[3]};
                     const Wide factor = {t.turn,  t.turn,  t.turn,
                                          t.shift, t.shift, t.shift};
                     sum += factor * left + turned;
                 }
                 next.right[b] = sum;
             });
}

/// Takes the correction of the bodies above, and smooths again.
void Level::after(const Level& next)
{
    for_each(count(),
             [&](std::size_t i)
             {
                 const Wide& e = next.x[idx(grouping.group_of_node[i])];
                 const Transfer& t = transfer[i];
                 const Wide factor = {t.turn, t.turn, t.turn, t.shift, t.shift, t.shift};
                 const Wide carried = {0.0f,
                                       0.0f,
                                       0.0f,
                                       e[1] * t.arm[2] - e[2] * t.arm[1],
                                       e[2] * t.arm[0] - e[0] * t.arm[2],
                                       e[0] * t.arm[1] - e[1] * t.arm[0]};
                 x[i] += factor * e + carried;
             });
    for_each(count(),
             [&](std::size_t i)
             {
                 r[i] = right[i];
                 subtract_row(i, x, r[i]);
                 Wide z{};
                 inverse.add_product(i, r[i], z);
                 d[i] = kFirst * z;
             });
    for_each(count(),
             [&](std::size_t i)
             {
                 Wide left = r[i], z{};
                 subtract_row(i, d, left);
                 inverse.add_product(i, left, z);
                 x[i] += (1.0f + kKeep) * d[i] + kGain * z;
             });
}

/// A_C of all bodies; scaled.
Rows joined_rows(const Rows& A, const Bodies& bodies, const Grouping& grouping,
                 const Bodies& next_bodies)
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
    for_each(static_cast<int>(count),
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
                                                   [&](const auto& entry)
                                                   { return entry.first == body[j]; });
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
    Rows next;
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

std::vector<Transfer> transfers_of(const Rows& A, const Bodies& bodies,
                                   const Grouping& grouping, const Rows& next,
                                   const Bodies& next_bodies)
{
    // The same factor on both ways keeps the cycle symmetric, and the same for all bodies
    // lets several move as one. Where most rows wait for others there is little to make
    // up.
    const bool is_joined = 2 * grouping.members.size() < bodies.centre.size();
    const double over = is_joined ? std::sqrt(kOvercorrection) : 1.0;
    std::vector<Transfer> transfers(bodies.centre.size());
    for (std::size_t i = 0; i < transfers.size(); ++i)
    {
        const std::size_t b = idx(grouping.group_of_node[i]);
        const double turn = over * next.scale[b][0], shift = over * next.scale[b][3];
        const Eigen::Vector3d arm =
            (bodies.centre[i] - next_bodies.centre[b]) * (turn / A.scale[i][3]);
        Transfer& t = transfers[i];
        t.turn = static_cast<float>(turn / A.scale[i][0]);
        t.shift = 0.0f;
        if (!bodies.shifts[i])
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
    std::vector<int> sizes, first;     ///< of the unknowns
    std::vector<Vector6> scale;        ///< of the finest level
    std::vector<Eigen::Matrix3d> axes; ///< of each unknown, when this was made
    std::vector<Level> levels;
    // The coarsest level, solved for exactly.
    BlockMatrix matrix;
    std::optional<SparseCholesky> solver;
    bool is_solved = false;
    Eigen::VectorXd right, solution;

    void factorize(const Rows& A);
    void solve_coarsest();
};

void RigidMultigrid::Levels::factorize(const Rows& A)
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
    Level& level = levels.back();
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
                               std::span<const Pose> poses)
    : levels_(std::make_unique<Levels>())
{
    Levels& own = *levels_;
    own.sizes.assign(matrix.block_sizes().begin(), matrix.block_sizes().end());
    own.first.push_back(0);
    for (const int size : own.sizes)
        own.first.push_back(own.first.back() + size);
    if (own.sizes.empty())
        return;
    Rows A = rows_of(matrix, poses);
    for (const Pose& pose : poses)
        own.axes.push_back(pose.R);
    own.scale = A.scale;
    Bodies bodies;
    for (std::size_t i = 0; i < places.size(); ++i)
    {
        bodies.centre.push_back(poses[i].p);
        bodies.shifts.push_back(own.sizes[i] == 6);
    }
    OctreeBlocks blocks(places);
    for (;;)
    {
        Level& level = own.levels.emplace_back(A);
        if (A.count() <= kFew)
            break;
        const bool is_waiting = blocks.is_mixed();
        level.grouping = blocks.join(A, [&](std::size_t, std::size_t k)
                                     { return A.block[k].norm() > kWeak; });
        const double left = static_cast<double>(level.grouping.members.size());
        if (!is_waiting && left > kStalled * A.count())
            break;
        Bodies next_bodies = joined_bodies(bodies, level.grouping.members);
        Rows next = joined_rows(A, bodies, level.grouping, next_bodies);
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
    Level& finest = own.levels.front();
    for_each(finest.count(),
             [&](std::size_t i)
             {
                 for (int k = 0; k < own.sizes[i]; k += 3)
                 {
                     const Eigen::Vector3d part = own.axes[i] *
                                                  r.segment<3>(own.first[i] + k) *
                                                  (own.scale[i][k] / largest);
                     for (int axis = 0; axis < 3; ++axis)
                         finest.right[i][k + axis] = static_cast<float>(part[axis]);
                 }
             });
    for (std::size_t l = 0; l + 1 < own.levels.size(); ++l)
        own.levels[l].before(own.levels[l + 1]);
    own.solve_coarsest();
    for (std::size_t l = own.levels.size() - 1; l-- > 0;)
        own.levels[l].after(own.levels[l + 1]);
    for_each(finest.count(),
             [&](std::size_t i)
             {
                 for (int k = 0; k < own.sizes[i]; k += 3)
                 {
                     Eigen::Vector3d part;
                     for (int axis = 0; axis < 3; ++axis)
                         part[axis] = finest.x[i][k + axis];
                     z.segment<3>(own.first[i] + k) =
                         own.axes[i].transpose() * part * (largest * own.scale[i][k]);
                 }
             });
}

std::vector<int> RigidMultigrid::sizes() const
{
    std::vector<int> sizes;
    for (const Level& level : levels_->levels)
        sizes.push_back(level.count());
    return sizes;
}

double RigidMultigrid::bytes() const
{
    double bytes = levels_->solver ? 8.0 * levels_->solver->factor_numbers() : 0.0;
    for (const Level& level : levels_->levels)
        bytes += static_cast<double>(
            kBlockBytes * (level.block.size() + 2 * level.diagonal.size()) +
            sizeof(int) * (level.links.column.size() + 4 * level.transfer.size()) +
            sizeof(Transfer) * level.transfer.size() + 5 * sizeof(Wide) * level.x.size());
    return bytes;
}

double RigidMultigrid::memory_estimate(std::size_t cells, std::size_t faces)
{
    // Blocks in single and in double precision. In solids the coarser levels add a
    // seventh, in rods and where cells differ in size as much again; and vectors grow by
    // doubling.
    constexpr double kLevels = 2.5;
    const double blocks = 2.0 * static_cast<double>(faces) + static_cast<double>(cells);
    return kLevels * (kBlockBytes + sizeof(Matrix6) + sizeof(int)) * blocks;
}

} // namespace cellwarp
