// SPDX-License-Identifier: GPL-3.0-or-later
// Implicit Euler of all points x = p + R X of the body: with Jd = int X X^T dm, p' and
// R' the velocities, and ahead = p + step p', R + step R', what is minimised is
//   1/2 m |p - ahead|^2 / step^2 - m g . p - tr(R Jd ahead_R^T) / step^2 .
// With S = R Jd ahead_R^T / step^2 and a turn exp[theta] R, its gradient is
//   -(S_12 - S_21, S_20 - S_02, S_01 - S_10)
// and its second derivatives tr(S) 1 - sym(S). R' = (R - R_before) / step is kept as a
// matrix: so a step never adds energy. A joint that presses with f at the arm q adds
// (f . q) 1 - sym(f q^T).
#include "solver/dynamics/rigid_body.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "solver/linear/rounding.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d symmetric(const Matrix3d& A)
{
    return 0.5 * (A + A.transpose());
}

Matrix3d turn_of(const Vector3d& theta)
{
    const double angle = theta.norm();
    return angle > 0.0 ? rotation_about(theta / angle, angle) : Matrix3d::Identity();
}

/// w with tr([e]x S) = e . w.
Vector3d twist_of(const Matrix3d& S)
{
    return {S(1, 2) - S(2, 1), S(2, 0) - S(0, 2), S(0, 1) - S(1, 0)};
}

} // namespace

RigidBody::RigidBody(double mass, const Vector3d& inertia) : mass_(mass)
{
    const double sum = 0.5 * inertia.sum();
    spread_ = Vector3d::Constant(sum) - inertia;
    if (!(mass > 0.0) || !(inertia.minCoeff() > 0.0) || spread_.minCoeff() < -1e-12 * sum)
        throw std::invalid_argument(
            "no body has this inertia: each must be above 0 and at most the sum of the "
            "other two");
    spread_ = spread_.cwiseMax(0.0);
    size_ = std::sqrt(12.0 * spread_.maxCoeff() / mass);
}

void RigidBody::lead(const Matrix3d& R, const Vector3d& p, double duration)
{
    is_led_ = true;
    goal_.R = R;
    goal_.p = p;
    left_ = duration;
}

bool RigidBody::is_driven() const
{
    return is_led_ && left_ > 0.0 && (goal_.p != state.p || goal_.R != state.R);
}

Vector3d RigidBody::angular_velocity() const
{
    return 0.5 * -twist_of(state.turning * state.R.transpose());
}

double RigidBody::kinetic() const
{
    if (is_led_)
        return 0.0;
    return 0.5 * mass_ * state.velocity.squaredNorm() +
           0.5 *
               (state.turning * spread_.asDiagonal() * state.turning.transpose()).trace();
}

Vector3d RigidBody::angular_momentum() const
{
    // int x cross x' dm
    return mass_ * state.p.cross(state.velocity) -
           twist_of(state.turning * spread_.asDiagonal() * state.R.transpose());
}

int RigidBody::add_place(const Vector3d& point)
{
    places_.push_back(point);
    size_ = std::max(size_, point.norm());
    return static_cast<int>(places_.size()) - 1;
}

Vector3d RigidBody::place(int place, bool of_trial) const
{
    const RigidBodyState& at = of_trial ? trial_ : state;
    return at.p + at.R * places_[idx(place)];
}

Matrix3d RigidBody::frame(int, bool of_trial) const
{
    return of_trial ? trial_.R : state.R;
}

void RigidBody::add_moved(int place, const Vector3d& n, SparseRow& out) const
{
    if (is_led_)
        return;
    const Vector3d about = (state.R * places_[idx(place)]).cross(n);
    for (int c = 0; c < 3; ++c)
        out.emplace_back(c, n[c]);
    for (int c = 0; c < 3; ++c)
        out.emplace_back(3 + c, about[c]);
}

void RigidBody::add_turned(int, const Vector3d& axis, SparseRow& out) const
{
    if (is_led_)
        return;
    for (int c = 0; c < 3; ++c)
        out.emplace_back(3 + c, axis[c]);
}

void RigidBody::forget_presses()
{
    pressed_.setZero();
    largest_press_ = 0.0;
}

void RigidBody::press(int place, const Vector3d& force)
{
    pressed_ += force * (state.R * places_[idx(place)]).transpose();
    largest_press_ = std::max(largest_press_, force.norm());
}

/// S
Matrix3d RigidBody::pulled(const RigidBodyState& at) const
{
    return at.R * spread_.asDiagonal() * ahead_R_.transpose() / (step_ * step_);
}

void RigidBody::measure(bool of_trial, Measure& out)
{
    const RigidBodyState& at = of_trial ? trial_ : state;
    // From where the step began, so that little cancels.
    out.value =
        0.5 * mass_ * (at.p - ahead_p_).squaredNorm() / (step_ * step_) -
        mass_ * gravity.dot(at.p) +
        0.5 *
            ((at.R - ahead_R_) * spread_.asDiagonal() * (at.R - ahead_R_).transpose())
                .trace() /
            (step_ * step_);
    if (is_led_)
        out.value = 0.0;
}

double RigidBody::linearise(Eigen::VectorXd& gradient, Measure&)
{
    gradient.setZero(6);
    if (is_led_)
        return 0.0;
    gradient.head<3>() = mass_ * ((state.p - ahead_p_) / (step_ * step_) - gravity);
    gradient.tail<3>() = -twist_of(pulled(state));
    return std::max(gradient.cwiseAbs().maxCoeff(), mass_ * gravity.norm());
}

double RigidBody::noise_of_forces() const
{
    return 8.0 * kRounding *
           ((mass_ * extent() + spread_.maxCoeff()) / (step_ * step_) +
            largest_press_ * size_);
}

double RigidBody::cancelled() const
{
    return is_led_ ? 0.0 : mass_ * gravity.norm() * extent();
}

SaddleSolver::Report RigidBody::factorize(const Eigen::VectorXd&, int& level)
{
    SaddleSolver::Report told;
    for (;; ++level)
    {
        const Matrix3d S = level < 2 ? pulled(state)
                                     : Matrix3d(state.R * spread_.asDiagonal() *
                                                state.R.transpose() / (step_ * step_));
        turns_ = S.trace() * Matrix3d::Identity() - symmetric(S);
        if (level == 0)
            turns_ += pressed_.trace() * Matrix3d::Identity() - symmetric(pressed_);
        if (level > 2)
            turns_ += std::pow(10.0, level - 3) * turns_.trace() * Matrix3d::Identity();
        told.is_finite = turns_.allFinite();
        const Eigen::LLT<Matrix3d> factor(turns_);
        if (!told.is_finite || factor.info() == Eigen::Success || level >= kMostLevel)
        {
            told.num_negative = factor.info() != Eigen::Success;
            turns_inverse_ = turns_.inverse();
            return told;
        }
    }
}

void RigidBody::solve(Eigen::VectorXd& r, Eigen::VectorXd&) const
{
    if (is_led_)
    {
        r.setZero();
        return;
    }
    r.head<3>() *= step_ * step_ / mass_;
    const Vector3d turn = turns_inverse_ * r.tail<3>();
    r.tail<3>() = turn;
}

double RigidBody::stiffness_of(int unknown) const
{
    return unknown < 3 ? mass_ / (step_ * step_) : turns_(unknown - 3, unknown - 3);
}

double RigidBody::turn(const Eigen::VectorXd& step) const
{
    return step.tail<3>().norm();
}

void RigidBody::try_step(const Eigen::VectorXd& step, double length)
{
    trial_ = state;
    try_more(length * step);
}

void RigidBody::try_more(const Eigen::VectorXd& step)
{
    trial_.p += step.head<3>();
    trial_.R = turn_of(step.tail<3>()) * trial_.R;
}

void RigidBody::start(double step)
{
    step_ = step;
    start_ = state;
    left_before_ = left_;
    if (is_led_)
    {
        const double share = left_ > step ? step / left_ : 1.0;
        if (share == 1.0)
            state.R = goal_.R;
        else
            state.R =
                turn_of(share * rotation_vector(goal_.R * state.R.transpose())) * state.R;
        state.p += share * (goal_.p - state.p);
        ahead_R_ = state.R;
        ahead_p_ = state.p;
        return;
    }
    ahead_p_ = state.p + step * state.velocity;
    ahead_R_ = state.R + step * state.turning;
}

void RigidBody::finish()
{
    // Many small turns leave rounding in the rotation.
    Eigen::Quaterniond turned(state.R);
    state.R = turned.normalized().toRotationMatrix();
    left_ = std::max(left_ - step_, 0.0);
    state.velocity = (state.p - start_.p) / step_;
    state.turning = (state.R - start_.R) / step_;
}

/// Of a solve that begins anew what is led stays where the step leads it.
void RigidBody::go_back()
{
    if (!is_led_)
        state = start_;
}

void RigidBody::undo()
{
    left_ = left_before_;
    state = start_;
}

ArticulableObject::Energy RigidBody::energy() const
{
    if (is_led_)
        return {};
    const double kinetic_now = kinetic();
    return {kinetic_now - mass_ * gravity.dot(state.p), kinetic_now};
}

void RigidBody::rest()
{
    state.velocity.setZero();
    state.turning.setZero();
}

} // namespace cellwarp::core
