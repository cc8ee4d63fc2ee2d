// SPDX-License-Identifier: GPL-3.0-or-later
// What is minimised is Phi(x) = U - F . x, in time with inertia, the viscosity gamma and
// the drags D,
//   1/2 (1 / step^2 + gamma / step) |x - begin|_M^2 + 1/2 |x - begin|_D^2 / step
//   - v . M (x - begin) / step,
// subject to g(x) = 0. Material damping beta adds 1/2 (beta / step) k (e - begin)^2 for
// each strain e. Implicit Euler damps an oscillation of omega by step omega^2 / 2, as a
// material with beta = step does: there beta - step takes the place of beta. The stretch
// force in the second derivatives is the one that the last step predicted, not that of
// the state. Where the pivots show that the matrix is not definite on what the
// constraints leave free, pushing stretch forces count as none, then all curvature is
// left out, then a share of the mass is added.
//
// Constraints that contradict are met in the sense of least squares: of the violations g
// no step removes the part r with L^T r = 0, L their rows; what is solved for is g - r =
// 0.
//
// The parameter of a slide is an unknown behind those of the rod, in the factor right
// behind the control points that are near. Its own second derivative, -Lambda . P'', is
// 0 or of any sign; the rows that hold it make up for that. Where no row of the rod holds
// it, but those of joints do, its diagonal is made larger by what a row would add, and
// the joints take that off again. kStay of that keeps what is held by nothing at its
// place: a curve that runs along the axis that it is on.
#include "solver/rods/rod_object.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "solver/dynamics/contradiction.h"
#include "solver/linear/rounding.h"

namespace cellwarp::core
{

namespace
{

constexpr double kStay = 1e-9;

using Eigen::Vector3d;

} // namespace

RodObject::RodObject(RodModel& model) : model_(model)
{
    size_up();
}

void RodObject::size_up()
{
    const RodModel& model = model_;
    revision_ = model.revision();
    response_.reset();
    const RodLayout& layout = model.rod().layout();
    BandMatrix weight(layout.num_unknowns, layout.half_band);
    model.mass().add_to(weight, 1.0);
    heaviest_ = 0.0;
    for (int j = 0; j < weight.rows(); ++j)
        heaviest_ = std::max(heaviest_, weight.lower(j, j));
    stiffness_ = 0.0;
    for (const RodSpan& span : model.rod().spans())
    {
        const Section section = model.rod().section_at(0.5 * (span.begin + span.end));
        const double L = span.length;
        stiffness_ =
            std::max(stiffness_,
                     section.stretch / L +
                         std::max(section.bending[0], section.bending[1]) / (L * L * L));
    }
    for (const std::unique_ptr<RodTerm>& term : model.terms)
        stiffness_ += term->stiffness();
}

int RodObject::add_place(double s)
{
    places_.push_back({s, -1});
    return static_cast<int>(places_.size()) - 1;
}

int RodObject::add_sliding_place(int slide)
{
    places_.push_back({0.0, slide});
    is_joined_.resize(model_.slides.size(), 0);
    is_joined_[idx(slide)] = 1;
    return static_cast<int>(places_.size()) - 1;
}

void RodObject::bind(RodState& state, Eigen::VectorXd& velocity)
{
    state_ = &state;
    velocity_ = &velocity;
}

void RodObject::aim(RodState& state)
{
    state_ = &state;
    step_ = pull_ = 0.0;
    prepare();
}

void RodObject::start(double step)
{
    step_ = is_midpoint_ ? 0.5 * step : step;
    if (is_midpoint_)
        hold_velocity();
    time_led_ = model_.time_led();
    model_.lead_to(time_led_ + step);
    if (is_midpoint_)
        model_.load_as_at(time_led_ + 0.5 * step); // forces are those of the middle
    pull_ = model_.viscosity / step_ + 1.0 / (step_ * step_);
    gain_ = std::max(model_.damping - (is_midpoint_ ? 0.0 : step_), 0.0) / step_;
    velocity_before_ = *velocity_;
    momentum_ = model_.mass().times(*velocity_) / step_;
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
    {
        Sliding& now = state_->sliding[k];
        now.weight = model_.slides[k].inertia / (step * step);
        now.from = now.s + step * now.speed;
    }
    prepare();
}

void RodObject::prepare()
{
    if (revision_ != model_.revision())
        size_up();
    model_.carry(*state_);
    start_ = *state_;
    model_.damp(*state_, gain_);
    double of_mass = 0.0;
    if (is_moving())
    {
        of_mass = heaviest_ / (step_ * step_);
        for (const RodDrag& drag : model_.drags)
            of_mass += drag.damping / step_;
    }
    extent_ = std::max(size(), state_->x().cwiseAbs().maxCoeff());
    noise_of_forces_ = 8.0 * kRounding * ((1.0 + gain_) * stiffness_ + of_mass) * extent_;
    for (const Sliding& now : state_->sliding)
        noise_of_forces_ += 8.0 * kRounding * std::abs(now.weight * now.s);
    pressed_by_joints_.assign(model_.slides.size(), Vector3d::Zero());
    is_joined_.resize(model_.slides.size(), 0);
}

void RodObject::finish()
{
    model_.damp(*state_, 0.0);
    *velocity_ = (state_->x() - start_->x()) / step_;
    if (!is_midpoint_)
    {
        for (std::size_t k = 0; k < model_.slides.size(); ++k)
            state_->sliding[k].speed =
                (state_->sliding[k].s - start_->sliding[k].s) / step_;
        return;
    }
    *velocity_ = 2.0 * *velocity_ - velocity_before_;
    *state_ = end_of(*state_);
    hold_velocity();
}

/// Brings the velocity onto the constraints, by the mass.
void RodObject::hold_velocity()
{
    if (model_.constraints.empty())
        return;
    const RodModel::Rows rows = model_.rows(*state_);
    if (!response_ || !response_->is_for(rows.rows))
        response_.emplace(model_, rows);
    *velocity_ -= response_->change(response_->along(*velocity_) + rows.rate);
}

void RodObject::undo()
{
    model_.damp(*start_, 0.0);
    *state_ = *start_;
    *velocity_ = velocity_before_;
    model_.lead_to(time_led_);
}

double RodObject::way() const
{
    return (state_->x() - start_->x()).cwiseAbs().maxCoeff();
}

ArticulableObject::Energy RodObject::energy() const
{
    Energy out;
    const double kinetic = model_.mass().kinetic_energy(*velocity_);
    out.sum = kinetic + model_.potential(*state_);
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
        out.sum += 0.5 * model_.slides[k].inertia * state_->sliding[k].speed *
                   state_->sliding[k].speed;
    out.size = kinetic + model_.elastic_energy(*state_);
    return out;
}

double RodObject::own_violation() const
{
    const Eigen::VectorXd violation = model_.violations(*state_);
    return violation.size() > 0 ? violation.cwiseAbs().maxCoeff() : 0.0;
}

// Joints.

double RodObject::parameter(int place, const RodState& at) const
{
    const Place& of = places_[idx(place)];
    return of.slide < 0 ? of.s : at.sliding[idx(of.slide)].s;
}

bool RodObject::is_held(int place) const
{
    const int slide = places_[idx(place)].slide;
    return slide < 0 || state_->sliding[idx(slide)].mode != Sliding::Mode::Gone;
}

Vector3d RodObject::place(int place, bool of_trial) const
{
    const RodState& at = state(of_trial);
    return at.at(sliding_values(model_.rod().basis(), parameter(place, at))).place;
}

Eigen::Matrix3d RodObject::frame(int place, bool of_trial) const
{
    const RodState& at = state(of_trial);
    return at.frame(parameter(place, at));
}

void RodObject::add_moved(int place, const Vector3d& n, SparseRow& out) const
{
    const Rod& rod = model_.rod();
    const BasisValues values = sliding_values(rod.basis(), parameter(place, *state_));
    for (int j = 0; j < values.count; ++j)
        for (int c = 0; c < 3; ++c)
            out.emplace_back(rod.layout().control[idx(values.control[idx(j)])] + c,
                             values.value[0][idx(j)] * n[c]);
    const int slide = places_[idx(place)].slide;
    if (slide >= 0 && state_->sliding[idx(slide)].is_free())
        out.emplace_back(rod.layout().num_unknowns + slide,
                         n.dot(state_->at(values).first));
}

void RodObject::add_turned(int place, const Vector3d& axis, SparseRow& out) const
{
    const SparseRow turned = turn_at(*state_, parameter(place, *state_), axis);
    out.insert(out.end(), turned.begin(), turned.end());
}

void RodObject::forget_presses()
{
    pressed_by_joints_.assign(model_.slides.size(), Vector3d::Zero());
}

void RodObject::press(int place, const Vector3d& force)
{
    if (const int slide = places_[idx(place)].slide; slide >= 0)
        pressed_by_joints_[idx(slide)] += force;
}

std::vector<SlidePress> RodObject::pressed(const Eigen::VectorXd& lambda) const
{
    std::vector<SlidePress> out = model_.pressed(*state_, lambda);
    for (std::size_t k = 0; k < out.size(); ++k)
        out[k].force += pressed_by_joints_[k];
    return out;
}

// One solve.

void RodObject::begin()
{
    for (const std::unique_ptr<RodTerm>& term : model_.terms)
        term->predict(*state_, nullptr);
    has_contradiction_ = false;
    couples_ = model_.has_couples() ? model_.couples(*state_) : Eigen::VectorXd();
}

RodState RodObject::end_of(const RodState& at) const
{
    RodState end = *start_;
    end.move_to(2.0 * at.x() - start_->x());
    return end;
}

void RodObject::measure(bool of_trial, Measure& out)
{
    const RodState& at = state(of_trial);
    out.value = model_.step_potential(at) + model_.sliding_energy(at);
    Eigen::VectorXd& held = of_trial ? held_there_ : held_here_;
    if (is_moving())
    {
        const Eigen::VectorXd way = at.x() - start_->x();
        held = pull_ * model_.mass().times(way);
        model_.add_drag_forces(way / step_, held);
        out.value += 0.5 * way.dot(held) - momentum_.dot(way);
    }
    // Couples have no potential: their work on the way to a place is taken by the ends of
    // the way.
    out.work = of_trial && couples_.size() > 0
                   ? 0.5 * (couples_ + model_.couples(at)).dot(at.x() - state_->x())
                   : 0.0;
    out.violation.resize(0);
    if (model_.is_free())
        return;
    out.violation = is_midpoint() ? model_.violations(end_of(at)) : model_.violations(at);
    if (has_contradiction_)
        out.violation -= contradiction_;
}

double RodObject::linearise(Eigen::VectorXd& gradient, Measure& here)
{
    rows_ = is_midpoint() ? model_.rows(end_of(*state_)) : model_.rows(*state_);
    here.violation = rows_.violation;
    if (couples_.size() > 0)
        couples_ = model_.couples(*state_);
    model_.gradient(*state_, gradient);
    double at_work = gradient.cwiseAbs().maxCoeff();
    if (is_moving())
    {
        const Eigen::VectorXd held = held_here_ - momentum_;
        at_work = std::max(at_work, held.cwiseAbs().maxCoeff());
        gradient += held;
    }
    const Eigen::Index of_rod = gradient.size();
    if (model_.slides.empty())
        return at_work;
    gradient.conservativeResize(num_unknowns());
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
        gradient[of_rod + static_cast<Eigen::Index>(k)] =
            sliding_pull(state_->sliding[k]);
    return at_work;
}

void RodObject::add_own_forces(const Eigen::VectorXd& lambda, double scale,
                               Eigen::VectorXd& out) const
{
    add_forces(rows_.rows, lambda, scale, out);
}

double RodObject::cancelled() const
{
    double sum = 1e-6 * (1.0 + gain_) * stiffness_ * size() * size();
    for (const Sliding& now : state_->sliding)
        sum += std::abs(now.weight * now.s * (now.s - now.from));
    for (const std::unique_ptr<RodTerm>& term : model_.terms)
        sum += term->cancelled();
    return sum;
}

void RodObject::take_off_contradiction(Measure& here)
{
    has_contradiction_ = true;
    contradiction_ = contradiction(rows_.rows, rows_.violation);
    here.violation = rows_.violation - contradiction_;
}

std::vector<SingleUnknown> RodObject::sliding_unknowns(const Eigen::VectorXd& lambda)
{
    std::vector<SingleUnknown> out;
    added_.clear();
    const std::vector<SlidePress> press = pressed(lambda);
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
    {
        const Sliding& now = state_->sliding[k];
        SingleUnknown& one =
            out.emplace_back(sliding_unknown(*state_, now, press[k].force));
        if (!now.is_free())
            continue;
        // As stiff as the control points that are near.
        double near = 0.0;
        for (const auto& [unknown, value] : one.column)
            near = std::max(near, std::abs(matrix_.lower(unknown, unknown)));
        const double speed =
            state_->at(sliding_values(model_.rod().basis(), now.s)).first.norm();
        const double stiffness = near * speed * speed;
        one.diagonal += kStay * stiffness;
        if (is_joined_[k])
        {
            one.diagonal += stiffness;
            added_.push_back(
                {model_.rod().layout().num_unknowns + static_cast<int>(k), stiffness});
        }
    }
    return out;
}

void RodObject::add_touches()
{
    for (const RodTouch& touch : touches_)
        for (int i = 0; i < touch.count; ++i)
            for (int j = 0; j < touch.count; ++j)
            {
                const int row = touch.unknown[idx(i)], column = touch.unknown[idx(j)];
                const double both = touch.share[idx(i)] * touch.share[idx(j)];
                for (int a = 0; a < 3; ++a)
                    for (int b = 0; b < 3; ++b)
                        if (row + a >= column + b)
                            matrix_.lower(row + a, column + b) +=
                                both * touch.stiffness(a, b);
            }
}

SaddleSolver::Report RodObject::factorize(const Eigen::VectorXd& lambda, int& level)
{
    SaddleSolver::Report told;
    double stiffness = 0.0;
    for (;; ++level)
    {
        const RodHessian how = level == 0   ? RodHessian::Exact
                               : level == 1 ? RodHessian::Tensed
                                            : RodHessian::Definite;
        model_.hessian(*state_, how, matrix_);
        if (is_moving())
        {
            model_.mass().add_to(matrix_, pull_);
            model_.add_drags(1.0 / step_, matrix_);
        }
        add_touches();
        if (level > 2)
        {
            // Held by nothing: as little weight as makes it definite.
            if (stiffness == 0.0)
                for (int j = 0; j < matrix_.rows(); ++j)
                    stiffness = std::max(stiffness, std::abs(matrix_.lower(j, j)));
            const double share = 1e-12 * std::pow(100.0, level - 3);
            model_.mass().add_to(matrix_, share * stiffness / heaviest_);
        }
        const Eigen::VectorXd forces =
            level < 2 ? lambda : Eigen::VectorXd::Zero(lambda.size());
        told = saddle_.factorize(matrix_, rows_.rows, rows_.groups,
                                 sliding_unknowns(forces));
        if (!told.is_finite || told.num_negative == 0 || level >= kMostLevel)
            return told;
    }
}

void RodObject::solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const
{
    // Constraints are of a step twice as long.
    if (is_midpoint())
        g *= 0.5;
    saddle_.solve(r, g);
}

double RodObject::stiffness_of(int unknown) const
{
    return unknown < matrix_.rows() ? matrix_.lower(unknown, unknown) : 0.0;
}

/// Of all tangents; a place that slides over a whole span turns by kTurn.
double RodObject::turn(const Eigen::VectorXd& step) const
{
    const Rod& rod = model_.rod();
    double turn = 0.0;
    for (std::size_t e = 0; e < rod.spans().size(); ++e)
        for (int p = 0; p < rod.num_places(); ++p)
        {
            Vector3d change = Vector3d::Zero();
            for (int j = 0; j < rod.order(); ++j)
                change += rod.first(e, p)[j] *
                          step.segment<3>(rod.layout().control[idx(rod.controls(e)[j])]);
            const auto& [u, t, l] = state_->velocity(e, p);
            turn = std::max(turn, (change - t.dot(change) * t).norm() / l);
        }
    const int of_rod = rod.layout().num_unknowns;
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
    {
        const int span = rod.basis().span_of(state_->sliding[k].s);
        turn = std::max(turn, kTurn * std::abs(step[of_rod + static_cast<int>(k)]) /
                                  rod.basis().spans()[idx(span)].length());
    }
    return turn;
}

void RodObject::try_step(const Eigen::VectorXd& step, double length)
{
    trial_ = *state_;
    trial_->move(step, length);
}

void RodObject::try_more(const Eigen::VectorXd& step)
{
    trial_->move(step);
}

void RodObject::add_correction(const Eigen::VectorXd& part, Eigen::VectorXd& out) const
{
    for (const std::unique_ptr<RodTerm>& term : model_.terms)
        term->add_correction(*state_, *trial_, part, out);
}

void RodObject::accept(const Eigen::VectorXd* step)
{
    for (const std::unique_ptr<RodTerm>& term : model_.terms)
    {
        if (step)
            term->predict(*state_, step);
        else
            term->predict(*trial_, nullptr);
    }
    std::swap(*state_, *trial_);
    std::swap(held_here_, held_there_);
}

ArticulableObject::Again RodObject::again(const Eigen::VectorXd& lambda, bool is_last)
{
    Again out = Again::No;
    if (model_.slides.empty())
        return out;
    const std::vector<SlidePress> press = pressed(lambda);
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
        out = std::max(out, check_slide(model_.slides[k], *state_, press[k], is_last,
                                        start_->sliding[k], state_->sliding[k]));
    // What closed gaps press apart with comes last.
    constexpr double kPassed = 1e-10; // of the size
    const auto touches_now = [&](std::size_t k)
    { return state_->touches[k] && model_.ends(*state_, model_.gaps[k]); };
    Eigen::Index row = lambda.size();
    for (std::size_t k = 0; k < model_.gaps.size(); ++k)
        row -= touches_now(k);
    for (std::size_t k = 0; k < model_.gaps.size(); ++k)
    {
        const bool touches = touches_now(k);
        const bool pulls = touches && lambda[row++] < 0.0;
        const bool is_passed =
            !touches && model_.room(*state_, model_.gaps[k]) < -kPassed * size();
        if (!is_passed && (!pulls || is_last))
            continue;
        start_->touches[k] = is_passed;
        out = Again::FromBegin;
    }
    return out;
}

/// Something slides past an end of the curve by half a span.
bool RodObject::is_beyond() const
{
    const SplineBasis& basis = model_.rod().basis();
    const double room = 0.5 * basis.spans().front().length();
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
    {
        const RodSlide& slide = model_.slides[k];
        const Sliding& now = state_->sliding[k];
        // Behind a cut there is another piece.
        if (now.is_free() && !slide.is_endless &&
            (now.s < slide.begin - (slide.has_cut_behind ? 0.0 : room) ||
             now.s > slide.end + (slide.has_cut_ahead ? 0.0 : room)))
            return true;
    }
    return false;
}

void RodObject::go_back()
{
    // Without time there is no way that was gone: what has come near stays near.
    if (is_moving())
        *state_ = *start_;
    else
    {
        state_->sliding = start_->sliding;
        state_->touches = start_->touches;
    }
}

} // namespace cellwarp::core
