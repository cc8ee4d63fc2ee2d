// SPDX-License-Identifier: GPL-3.0-or-later
// Joints hold places of the material, which are linear in the unknowns: displacements of
// the free nodes. Bones have been eliminated; they, and what follows cells' frames, do
// work that energies do not tell of, so the flesh counts as driven.
#include "solver/joined/flesh_object.h"

#include <algorithm>
#include <cmath>

#include "octree/base/index.h"
#include "solver/linear/rounding.h"

namespace cellwarp::core
{

using Eigen::Vector3d;
using Eigen::VectorXd;

FleshObject::FleshObject(Flesh& flesh, FleshState& state, const Motion& to_scene)
    : flesh_(&flesh), state_(state), to_scene_(to_scene),
      step_(std::make_unique<FleshStep>(flesh)), u_(state.u)
{
    shares_.emplace(flesh.nodes(), flesh.lattice().places.size());
    take_size();
}

void FleshObject::take(Flesh& flesh, std::vector<FleshPoint> points)
{
    flesh_ = &flesh;
    step_ = std::make_unique<FleshStep>(flesh);
    shares_.emplace(flesh.nodes(), flesh.lattice().places.size());
    places_.clear();
    for (FleshPoint& point : points)
        add_place(std::move(point));
    u_ = state_.u;
    take_size();
}

void FleshObject::take_size()
{
    Vector3d low = Vector3d::Constant(INFINITY), high = -low;
    for (const Vector3d& x : flesh_->lattice().places)
    {
        const Vector3d y = to_scene_(x);
        low = low.cwiseMin(y);
        high = high.cwiseMax(y);
    }
    size_ = (high - low).norm();
    extent_ = std::max(size_, low.cwiseAbs().cwiseMax(high.cwiseAbs()).maxCoeff());
}

int FleshObject::add_place(FleshPoint point)
{
    NodeShares free = shares_->of(point.shares).free;
    places_.push_back({std::move(point), std::move(free)});
    return static_cast<int>(places_.size()) - 1;
}

void FleshObject::lead(std::vector<Motion> from, std::vector<Motion> to, double duration)
{
    from_ = std::move(from);
    to_ = std::move(to);
    duration_ = duration;
    done_ = 0.0;
}

Vector3d FleshObject::place(int place, bool of_trial) const
{
    const FleshPoint& point = places_[idx(place)].point;
    return to_scene_(point.place + at_point(point.shares, of_trial ? trial_ : u_));
}

void FleshObject::add_moved(int place, const Vector3d& n, SparseRow& out) const
{
    const Vector3d here = to_scene_.R.transpose() * n;
    for (const NodeShare& share : places_[idx(place)].free)
        for (int c = 0; c < 3; ++c)
            out.emplace_back(3 * share.node + c, share.share * here[c]);
}

void FleshObject::start(double step)
{
    dt_ = step;
    before_ = state_;
    done_ += step;
    const double share = duration_ > 0.0 ? std::min(1.0, done_ / duration_) : 1.0;
    now_ = to_;
    for (std::size_t m = 0; m < now_.size(); ++m)
    {
        now_[m].R = (1.0 - share) * from_[m].R + share * to_[m].R;
        now_[m].t = (1.0 - share) * from_[m].t + share * to_[m].t;
    }
    step_->begin(state_, step, now_, u_);
    first_ = u_;
}

void FleshObject::finish()
{
    state_ = step_->end(u_);
}

void FleshObject::undo()
{
    state_ = before_;
    u_ = state_.u;
    done_ -= dt_;
}

void FleshObject::measure(bool of_trial, Measure& out)
{
    out.value = step_->value(of_trial ? trial_ : u_);
}

double FleshObject::linearise(VectorXd& gradient, Measure&)
{
    return step_->gradient(u_, gradient);
}

double FleshObject::noise_of_forces() const
{
    return 8.0 * kRounding * step_->stiffest() * extent_;
}

double FleshObject::cancelled() const
{
    return 1e-6 * step_->stiffest() * size_ * size_;
}

SaddleSolver::Report FleshObject::factorize(const VectorXd&, int&)
{
    SaddleSolver::Report told;
    told.is_finite = step_->factorize(u_);
    return told;
}

void FleshObject::solve(VectorXd& r, VectorXd&) const
{
    step_->solve(r);
}

void FleshObject::try_step(const VectorXd& step, double length)
{
    step_->move(u_, step, length, trial_);
}

void FleshObject::try_more(const VectorXd& step)
{
    const VectorXd from = trial_;
    step_->move(from, step, 1.0, trial_);
}

} // namespace cellwarp::core
