// SPDX-License-Identifier: GPL-3.0-or-later
// Smoothing. Two steps of Chebyshev's iteration on D^-1 A. A is a sum of squares |J_a x_a
// - J_b x_b|^2 <= 2 |J_a x_a|^2 + 2 |J_b x_b|^2, so its largest eigenvalue is at most 2
// on every level, and nothing has to be estimated. The same before and after the
// correction, the cycle is symmetric; and it is positive definite whatever
// kOvercorrection is, being the sum of a positive definite smoother and a positive
// semi-definite correction.
#include "solver/cells/smoothed_level.h"

#include <algorithm>

#include <Eigen/Cholesky>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp
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

} // namespace

SmoothedLevel::SmoothedLevel(const RigidRows& A)
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
    for_each_body(A.count(),
                  [&](std::size_t i)
                  {
                      const Matrix6& D = A.block[A.diagonal(i)];
                      diagonal.set(i, D);
                      inverse.set(i, inverse_of(D));
                  });
    for (std::vector<WideVector>* v : {&right, &x, &r, &d, &d2})
        v->assign(n, WideVector{});
}

constexpr float kCentre = 0.5f * (kLargest + kSmallest);
constexpr float kRadius = 0.5f * (kLargest - kSmallest);
constexpr float kFirst = 1.0f / kCentre;
/// Second step of the Chebyshev iteration: d2 = kKeep d + kGain D^-1 r.
constexpr float kRho = 1.0f / (2.0f * kCentre / kRadius - kRadius / kCentre);
constexpr float kKeep = kRho * kRadius / kCentre, kGain = 2.0f * kRho / kRadius;

void SmoothedLevel::before(SmoothedLevel& next)
{
    for_each_body(count(),
                  [&](std::size_t i)
                  {
                      WideVector z{};
                      inverse.add_product(i, right[i], z);
                      d[i] = kFirst * z;
                  });
    for_each_body(count(),
                  [&](std::size_t i)
                  {
                      r[i] = right[i];
                      subtract_row(i, d, r[i]);
                      WideVector z{};
                      inverse.add_product(i, r[i], z);
                      d2[i] = kKeep * d[i] + kGain * z;
                      x[i] = d[i] + d2[i];
                  });
    for_each_body(next.count(),
                  [&](std::size_t b)
                  {
                      WideVector sum{};
                      for (const int member : grouping.members.of(b))
                      {
                          const std::size_t i = idx(member);
                          WideVector left = r[i];
                          subtract_row(i, d2, left);
                          const LevelTransfer& t = transfer[i];
                          // arm x force
                          const WideVector turned = {
                              t.arm[1] * left[5] - t.arm[2] * left[4],
                              t.arm[2] * left[3] - t.arm[0] * left[5],
                              t.arm[0] * left[4] - t.arm[1] * left[3]};
                          const WideVector factor = {t.turn,  t.turn,  t.turn,
                                                     t.shift, t.shift, t.shift};
                          sum += factor * left + turned;
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
                      const WideVector factor = {t.turn,  t.turn,  t.turn,
                                                 t.shift, t.shift, t.shift};
                      const WideVector carried = {0.0f,
                                                  0.0f,
                                                  0.0f,
                                                  e[1] * t.arm[2] - e[2] * t.arm[1],
                                                  e[2] * t.arm[0] - e[0] * t.arm[2],
                                                  e[0] * t.arm[1] - e[1] * t.arm[0]};
                      x[i] += factor * e + carried;
                  });
    for_each_body(count(),
                  [&](std::size_t i)
                  {
                      r[i] = right[i];
                      subtract_row(i, x, r[i]);
                      WideVector z{};
                      inverse.add_product(i, r[i], z);
                      d[i] = kFirst * z;
                  });
    for_each_body(count(),
                  [&](std::size_t i)
                  {
                      WideVector left = r[i], z{};
                      subtract_row(i, d, left);
                      inverse.add_product(i, left, z);
                      x[i] += (1.0f + kKeep) * d[i] + kGain * z;
                  });
}

} // namespace cellwarp
