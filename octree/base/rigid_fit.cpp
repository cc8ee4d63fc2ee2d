// SPDX-License-Identifier: GPL-3.0-or-later
// With the places about their centroids, f_i and t_i, the best rotation has the largest
//   sum t_i . R f_i = trace(R H),  H = sum f_i t_i^T = U S V^T  [Kabsch76]:
// R = V D U^T, where D turns the last axis over if R would mirror. Of places in a line H
// tells the first axis alone, and U and V have the others as it happens: there R is the
// least turn that takes the first axis of U to that of V.
#include "octree/base/rigid_fit.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Places in a line, or at one place, have singular values below this share of the
/// largest one, or of what their distances allow.
constexpr double kNone = 1e-8;

/// A rotation this near to the identity is it, but for rounding.
constexpr double kNoTurn = 1e-14;

/// Centroids, and H about them.
struct Moments
{
    Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = from;
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    double largest = 0.0; ///< no singular value is larger
    bool is_still = true;

    Moments(std::span<const Eigen::Vector3d> before,
            std::span<const Eigen::Vector3d> after)
    {
        const double count = std::max<double>(1.0, static_cast<double>(before.size()));
        for (std::size_t i = 0; i < before.size(); ++i)
        {
            from += before[i] / count;
            to += after[i] / count;
            is_still = is_still && before[i] == after[i];
        }
        double of_from = 0.0, of_to = 0.0;
        for (std::size_t i = 0; i < before.size(); ++i)
        {
            H += (before[i] - from) * (after[i] - to).transpose();
            of_from += (before[i] - from).squaredNorm();
            of_to += (after[i] - to).squaredNorm();
        }
        largest = std::sqrt(of_from * of_to);
    }

    Motion motion(const Eigen::Matrix3d& R) const
    {
        if ((R - Eigen::Matrix3d::Identity()).norm() < kNoTurn)
            return {Eigen::Matrix3d::Identity(), to - from};
        return {R, to - R * from};
    }
};

Eigen::Matrix3d best_rotation(const Moments& moments)
{
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moments.H, Eigen::ComputeFullU |
                                                               Eigen::ComputeFullV);
    const Eigen::Vector3d& s = svd.singularValues();
    const Eigen::Matrix3d &U = svd.matrixU(), &V = svd.matrixV();
    if (!(s[0] > kNone * moments.largest))
        return Eigen::Matrix3d::Identity();
    if (!(s[1] > kNone * s[0]))
        return Eigen::Quaterniond::FromTwoVectors(U.col(0), V.col(0)).toRotationMatrix();
    Eigen::Vector3d D = Eigen::Vector3d::Ones();
    D[2] = (V * U.transpose()).determinant() < 0.0 ? -1.0 : 1.0;
    return V * D.asDiagonal() * U.transpose();
}

} // namespace

Motion rigid_fit(std::span<const Eigen::Vector3d> from,
                 std::span<const Eigen::Vector3d> to)
{
    const Moments moments(from, to);
    return moments.is_still ? Motion() : moments.motion(best_rotation(moments));
}

Motion rigid_fit_about(const Eigen::Vector3d& axis, std::span<const Eigen::Vector3d> from,
                       std::span<const Eigen::Vector3d> to)
{
    const Moments moments(from, to);
    if (moments.is_still)
        return {};
    const Eigen::Matrix3d& H = moments.H;
    const Eigen::Vector3d turned(H(1, 2) - H(2, 1), H(2, 0) - H(0, 2), H(0, 1) - H(1, 0));
    const double sine = axis.dot(turned), cosine = H.trace() - axis.dot(H * axis);
    if (!(std::hypot(sine, cosine) > kNone * moments.largest))
        return moments.motion(Eigen::Matrix3d::Identity());
    return moments.motion(rotation_about(axis, std::atan2(sine, cosine)));
}

} // namespace cellwarp::core
