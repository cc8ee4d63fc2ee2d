// SPDX-License-Identifier: GPL-3.0-or-later
// Joint k has six constraints: the ends of its segments meet (stretch and shear), and
// their rotations agree, 2 Im(q_k^-1 q_k+1) / L = 0 (bending and twist), L the length of
// a segment. With the compliance alpha = (1 / stiffness) / h^2 one Newton step solves
//   (J M^-1 J^T + alpha) lambda = -C,   dx = M^-1 J^T lambda
// from the places that inertia and gravity lead to: blocks of 6 on three diagonals,
// eliminated from one end to the other. Velocities are (x - x_old) / h. [Deul18]
#include "tests/bench/pbd_rod.h"

#include <Eigen/Cholesky>

#include "octree/base/index.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

PbdRod::PbdRod(double length, int segments, double stretch, double bending, double twist,
               double mass, double spin)
    : part_(length / segments)
{
    for (int k = 0; k <= segments; ++k)
    {
        Segment segment;
        segment.x = {(k - 0.5) * part_, 0, 0};
        if (k > 0)
        {
            const double m = mass * part_, across = m * part_ * part_ / 12.0;
            segment.inverse_mass = 1.0 / m;
            segment.inverse_inertia = {1.0 / (spin * part_), 1.0 / across, 1.0 / across};
        }
        segments_.push_back(segment);
    }
    const double stretch_give = part_ / stretch;
    compliance_ << stretch_give, stretch_give, stretch_give, 1.0 / (twist * part_),
        1.0 / (bending * part_), 1.0 / (bending * part_);
    joints_.resize(idx(segments));
    diagonal_.resize(joints_.size());
    side_.resize(joints_.size());
    right_.resize(joints_.size());
}

PbdRod::Matrix6 PbdRod::inverse_mass(const Segment& segment) const
{
    Matrix6 W = Matrix6::Zero();
    W.diagonal().head<3>().setConstant(segment.inverse_mass);
    const Matrix3d R = segment.q.toRotationMatrix();
    W.bottomRightCorner<3, 3>() =
        R * segment.inverse_inertia.asDiagonal() * R.transpose();
    return W;
}

PbdRod::Joint PbdRod::joint(std::size_t k) const
{
    const Segment &a = segments_[k], &b = segments_[k + 1];
    const Matrix3d Ra = a.q.toRotationMatrix();
    const Vector3d to_end = Ra * Vector3d(0.5 * part_, 0, 0),
                   to_begin = b.q * Vector3d(-0.5 * part_, 0, 0);
    const Eigen::Quaterniond p = a.q.conjugate() * b.q;
    Joint out;
    out.C.head<3>() = a.x + to_end - b.x - to_begin;
    out.C.tail<3>() = 2.0 / part_ * p.vec();
    out.by_first.setZero();
    out.by_second.setZero();
    out.by_first.topLeftCorner<3, 3>().setIdentity();
    out.by_first.topRightCorner<3, 3>() = -cross_matrix(to_end);
    out.by_second.topLeftCorner<3, 3>() = -Matrix3d::Identity();
    out.by_second.topRightCorner<3, 3>() = cross_matrix(to_begin);
    const Matrix3d turn =
        (p.w() * Matrix3d::Identity() - cross_matrix(p.vec())) * Ra.transpose() / part_;
    out.by_first.bottomRightCorner<3, 3>() = -turn;
    out.by_second.bottomRightCorner<3, 3>() = turn;
    return out;
}

void PbdRod::step(double h)
{
    std::vector<Segment> old = segments_;
    const auto turned = [](const Eigen::Quaterniond& q, const Vector3d& turn)
    {
        Eigen::Quaterniond out;
        out.coeffs() =
            q.coeffs() +
            0.5 * (Eigen::Quaterniond(0.0, turn.x(), turn.y(), turn.z()) * q).coeffs();
        return out.normalized();
    };
    for (Segment& segment : segments_)
    {
        if (segment.inverse_mass == 0.0)
            continue;
        segment.v += h * gravity;
        segment.x += h * segment.v;
        segment.q = turned(segment.q, h * segment.omega);
    }
    const Vector6 alpha = compliance_ / (h * h);
    for (std::size_t k = 0; k < joints_.size(); ++k)
        joints_[k] = joint(k);
    for (std::size_t k = 0; k < joints_.size(); ++k)
    {
        const Joint& at = joints_[k];
        const Matrix6 Wa = inverse_mass(segments_[k]),
                      Wb = inverse_mass(segments_[k + 1]);
        diagonal_[k] = at.by_first * Wa * at.by_first.transpose() +
                       at.by_second * Wb * at.by_second.transpose();
        // From the clamp to the middle of the first segment it is half as far.
        diagonal_[k].diagonal().head<3>() += alpha.head<3>();
        diagonal_[k].diagonal().tail<3>() += (k == 0 ? 0.5 : 1.0) * alpha.tail<3>();
        if (k + 1 < joints_.size())
            side_[k] = joints_[k + 1].by_first * Wb * at.by_second.transpose();
        right_[k] = -at.C;
    }
    // Block elimination, downwards and back.
    for (std::size_t k = 0; k + 1 < joints_.size(); ++k)
    {
        const Eigen::LLT<Matrix6> factor(diagonal_[k]);
        const Matrix6 share = factor.solve(side_[k].transpose()).transpose();
        diagonal_[k + 1] -= share * side_[k].transpose();
        right_[k + 1] -= share * right_[k];
    }
    for (std::size_t k = joints_.size(); k-- > 0;)
    {
        if (k + 1 < joints_.size())
            right_[k] -= side_[k].transpose() * right_[k + 1];
        right_[k] = diagonal_[k].llt().solve(right_[k]);
    }
    for (std::size_t k = 0; k < segments_.size(); ++k)
    {
        Segment& segment = segments_[k];
        if (segment.inverse_mass == 0.0)
            continue;
        Vector6 pull = Vector6::Zero();
        if (k > 0)
            pull += joints_[k - 1].by_second.transpose() * right_[k - 1];
        if (k < joints_.size())
            pull += joints_[k].by_first.transpose() * right_[k];
        const Vector6 moved = inverse_mass(segment) * pull;
        segment.x += moved.head<3>();
        segment.q = turned(segment.q, moved.tail<3>());
        segment.v = (segment.x - old[k].x) / h;
        const Eigen::Quaterniond change = segment.q * old[k].q.conjugate();
        segment.omega = 2.0 / h * (change.w() < 0.0 ? -1.0 : 1.0) * change.vec();
    }
}

Vector3d PbdRod::tip() const
{
    return segments_.back().x + segments_.back().q * Vector3d(0.5 * part_, 0, 0);
}

void PbdRod::stop()
{
    for (Segment& segment : segments_)
        segment.v = segment.omega = Vector3d::Zero();
}

} // namespace cellwarp::core
