// SPDX-License-Identifier: GPL-3.0-or-later
// Smoothing. Two steps of Chebyshev's iteration on D^-1 A. A is a sum of squares |J_a x_a
// - J_b x_b|^2 <= 2 |J_a x_a|^2 + 2 |J_b x_b|^2, so its largest eigenvalue is at most 2
// on every level, and nothing has to be estimated. The same before and after the
// correction, the cycle is symmetric; and it is positive definite whatever
// kOvercorrection is, being the sum of a positive definite smoother and a positive
// semi-definite correction.
//
// Where cells differ in size most bodies of the first levels are cells that wait for the
// small ones to grow to their size. Unless they are neighbours of smaller ones, or on
// rods, they are not smoothed before: what a level does for them is to pass their
// residual on. The cycle stays positive definite: what the smoothing of a level leaves
// out is a body of the next.
#include "solver/cells/smoothed_level.h"

#include <algorithm>

#include <Eigen/Cholesky>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// The eigenvalues that a smoothing damps most. Lower ones are left to the correction.
constexpr float kLargest = 2.0f, kSmallest = kLargest / 6.0f;

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

/// Blocks of the lower triangle between \p bodies: body(row, column, block), rows and
/// columns counted among them. \p number: of each body of the level, or -1.
template <class Body>
void for_lower(const RigidRows& A, const std::vector<int>& bodies,
               const std::vector<int>& number, Body&& body)
{
    for (std::size_t i = 0; i < bodies.size(); ++i)
        for (std::size_t k = A.begin(idx(bodies[i])); k < A.end(idx(bodies[i])); ++k)
            if (const int j = number[idx(A.column[k])];
                j >= 0 && j <= static_cast<int>(i))
                body(static_cast<int>(i), j, A.block(k));
}

BlockMatrix matrix_of(const RigidRows& A, const std::vector<int>& bodies)
{
    std::vector<int> number(idx(A.count()), -1);
    for (std::size_t i = 0; i < bodies.size(); ++i)
        number[idx(bodies[i])] = static_cast<int>(i);
    std::vector<std::pair<int, int>> pairs;
    for_lower(A, bodies, number,
              [&](int row, int column, const Matrix6&)
              {
                  if (column < row)
                      pairs.emplace_back(row, column);
              });
    BlockMatrix matrix(std::vector<int>(bodies.size(), 6), pairs);
    for_lower(A, bodies, number,
              [&](int row, int column, const Matrix6& block)
              {
                  if (column < row)
                      matrix.block(matrix.find(row, column)) = block;
                  else
                      matrix.diagonal(row) = block;
              });
    return matrix;
}

} // namespace

ExactBodies::ExactBodies(const RigidRows& A, std::vector<int> bodies)
    : bodies_(std::move(bodies)), matrix_(matrix_of(A, bodies_)), solver_(matrix_)
{
    is_solved_ = solver_.factorize(matrix_);
    for (double ridge = 1e-12; !is_solved_ && ridge < 1.0; ridge *= 100.0)
    {
        for (int i = 0; i < matrix_.num_blocks(); ++i)
            matrix_.diagonal(i).diagonal().array() += ridge;
        is_solved_ = solver_.factorize(matrix_);
    }
    right_.setZero(matrix_.rows());
    solution_ = right_;
}

void ExactBodies::solve(const std::vector<WideVector>& right, std::vector<WideVector>& x)
{
    for (std::size_t i = 0; i < bodies_.size(); ++i)
        right_.segment<6>(6 * static_cast<Eigen::Index>(i)) =
            right[idx(bodies_[i])].numbers();
    if (is_solved_)
        solver_.solve(right_, solution_);
    for (std::size_t i = 0; i < bodies_.size(); ++i)
        x[idx(bodies_[i])] =
            WideVector::of(solution_.segment<6>(6 * static_cast<Eigen::Index>(i)));
}

SmoothedLevel::SmoothedLevel(const RigidRows& A, std::span<const char> is_on_rod,
                             const std::function<bool(std::size_t)>& is_waiting)
{
    const std::size_t n = idx(A.count());
    // Of each row, whether one of its columns, the diagonal included, has the property.
    const auto any_of = [&](const auto& has)
    {
        std::vector<char> found(n, 0);
        for (std::size_t i = 0; i < n; ++i)
            for (std::size_t k = A.begin(i); k < A.end(i) && !found[i]; ++k)
                found[i] = has(idx(A.column[k]));
        return found;
    };
    std::vector<char> is_smoothed = any_of([&](std::size_t i) { return !is_waiting(i); });
    for (std::size_t i = 0; i < n; ++i)
    {
        is_smoothed[i] |= is_on_rod[i];
        if (is_smoothed[i])
            smoothed.push_back(static_cast<int>(i));
    }
    const std::vector<char> has_row =
        any_of([&](std::size_t i) { return is_smoothed[i] != 0; });
    links.first.push_back(0);
    for (std::size_t i = 0; i < n; ++i)
    {
        if (has_row[i])
            links.column.insert(links.column.end(), A.column.begin() + A.first[i],
                                A.column.begin() + A.first[i + 1]);
        links.first.push_back(static_cast<int>(links.column.size()));
    }
    glue.resize(links.column.size());
    for_each_body(A.count(),
                  [&](std::size_t i)
                  {
                      for (std::size_t k = links.begin(i); k < links.end(i); ++k)
                          glue[k] = WideGlue(A.glue[A.begin(i) + k - links.begin(i)]);
                  });
    list_rests(A);
    inverse = WideBlocks(smoothed.size());
    for_each_smoothed([&](std::size_t k, std::size_t i)
                      { inverse.set(k, inverse_of(A.block(A.diagonal(i)))); });
    for (std::vector<WideVector>* v : {&right, &x, &d})
        v->assign(n, WideVector{});
    std::vector<int> found;
    for (std::size_t i = 0; i < n; ++i)
        if (is_on_rod[i])
            found.push_back(static_cast<int>(i));
    if (found.empty())
        return;
    rods.emplace(A, std::move(found));
    on_rods.assign(n, WideVector{});
    without_rods.assign(n, WideVector{});
}

void SmoothedLevel::list_rests(const RigidRows& A)
{
    std::vector<std::size_t> found;
    rest_links.first.push_back(0);
    for (std::size_t i = 0; i < idx(A.count()); ++i)
    {
        const bool has_row = links.begin(i) < links.end(i);
        for (std::size_t k = A.begin(i); has_row && k < A.end(i); ++k)
            if (A.rest[k])
            {
                found.push_back(k);
                rest_links.column.push_back(A.column[k]);
            }
        rest_links.first.push_back(static_cast<int>(found.size()));
    }
    if (found.empty())
        rest_links = {{0}, {}};
    rest = WideBlocks(found.size());
    for (std::size_t k = 0; k < found.size(); ++k)
        rest.set(k, *A.rest[found[k]]);
}

constexpr float kCentre = 0.5f * (kLargest + kSmallest);
constexpr float kRadius = 0.5f * (kLargest - kSmallest);
constexpr float kFirst = 1.0f / kCentre;
/// Second step of the Chebyshev iteration: d2 = kKeep d + kGain D^-1 r.
constexpr float kRho = 1.0f / (2.0f * kCentre / kRadius - kRadius / kCentre);
constexpr float kKeep = kRho * kRadius / kCentre, kGain = 2.0f * kRho / kRadius;

void SmoothedLevel::before(SmoothedLevel& next)
{
    std::fill(x.begin(), x.end(), WideVector{});
    for_each_smoothed([&](std::size_t k, std::size_t i)
                      { d[i] = kFirst * inverse.product(k, right[i]); });
    for_rods(right, [&](std::size_t i, const WideVector& z) { d[i] = kFirst * z; });
    for_each_smoothed(
        [&](std::size_t k, std::size_t i)
        {
            const WideVector left = right[i] - row_product(i, d);
            x[i] = (1.0f + kKeep) * d[i] + kGain * inverse.product(k, left);
            if (rods)
                without_rods[i] = left;
        });
    for_rods(without_rods, [&](std::size_t i, const WideVector& z)
             { x[i] = (1.0f + kKeep) * d[i] + kGain * z; });
    for_each_body(next.count(),
                  [&](std::size_t b)
                  {
                      WideVector sum;
                      for (const int member : grouping.members.of(b))
                      {
                          const std::size_t i = idx(member);
                          const WideVector left = right[i] - row_product(i, x);
                          const LevelTransfer& t = transfer[i];
                          sum.turn += t.turn * left.turn + cross(t.arm, left.shift);
                          sum.shift += t.shift * left.shift;
                      }
                      next.right[b] = sum;
                  });
}

void SmoothedLevel::after(const SmoothedLevel& next)
{
    for_each_body(count(),
                  [&](std::size_t i)
                  {
                      const WideVector& e = next.x[idx(grouping.group_of_node[i])];
                      const LevelTransfer& t = transfer[i];
                      x[i].turn += t.turn * e.turn;
                      x[i].shift += t.shift * e.shift + cross(e.turn, t.arm);
                  });
    for_each_smoothed(
        [&](std::size_t k, std::size_t i)
        {
            right[i] -= row_product(i, x);
            d[i] = kFirst * inverse.product(k, right[i]);
        });
    for_rods(right, [&](std::size_t i, const WideVector& z) { d[i] = kFirst * z; });
    for_each_smoothed(
        [&](std::size_t k, std::size_t i)
        {
            right[i] -= row_product(i, d);
            const WideVector d2 = kGain * inverse.product(k, right[i]);
            x[i] += (1.0f + kKeep) * d[i] + d2;
            if (rods)
                without_rods[i] = d2;
        });
    for_rods(right, [&](std::size_t i, const WideVector& z)
             { x[i] += kGain * z - without_rods[i]; });
}

} // namespace cellwarp::core
