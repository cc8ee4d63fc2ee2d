// SPDX-License-Identifier: GPL-3.0-or-later
// A rod as an object that can be joined to others.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "solver/dynamics/articulable_object.h"
#include "solver/rods/rod_model.h"
#include "solver/rods/rod_response.h"

namespace cellwarp::core
{

/// A stiffness at a place of a rod, from outside.
struct RodTouch
{
    int count = 0;
    std::array<int, kMaxOrder> unknown = {}; ///< first of control points
    std::array<double, kMaxOrder> share = {};
    Eigen::Matrix3d stiffness = Eigen::Matrix3d::Zero(); ///< [N/m]
};

class RodObject : public ArticulableObject
{
public:
    /// The model must outlive it.
    explicit RodObject(RodModel& model);

    /// Numbers for joints: a parameter of the curve, or what slides.
    int add_place(double s);
    int add_sliding_place(int slide);

    /// What solves and steps move; it must outlive them.
    void bind(RodState& state, Eigen::VectorXd& velocity);
    /// Steps by the midpoint rule instead of implicit Euler: the state of a solve is half
    /// a step ahead, constraints are of a whole step. Nothing may slide.
    void step_by_midpoint() { is_midpoint_ = true; }
    const RodState& state(bool of_trial) const { return of_trial ? *trial_ : *state_; }
    /// What the next factors have beside the rod's own second derivatives.
    void set_touches(const std::vector<RodTouch>& touches) { touches_ = touches; }
    /// The next solve is for the equilibrium of \p state.
    void aim(RodState& state);

    int num_unknowns() const override { return model_.num_unknowns(); }
    double size() const override { return model_.rod().arc_length().total(); }
    double extent() const override { return extent_; }
    bool is_held(int place) const override;
    Eigen::Vector3d place(int place, bool of_trial) const override;
    Eigen::Matrix3d frame(int place, bool of_trial) const override;
    void add_moved(int place, const Eigen::Vector3d& n, SparseRow& out) const override;
    void add_turned(int place, const Eigen::Vector3d& axis,
                    SparseRow& out) const override;
    void forget_presses() override;
    void press(int place, const Eigen::Vector3d& force) override;
    void begin() override;
    void measure(bool of_trial, Measure& out) override;
    double linearise(Eigen::VectorXd& gradient, Measure& here) override;
    void add_own_forces(const Eigen::VectorXd& lambda, double scale,
                        Eigen::VectorXd& out) const override;
    double noise_of_forces() const override { return noise_of_forces_; }
    double cancelled() const override;
    SaddleSolver::Report factorize(const Eigen::VectorXd& lambda, int& level) override;
    void take_off_contradiction(Measure& here) override;
    void solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const override;
    double stiffness_of(int unknown) const override;
    std::span<const Added> added() const override { return added_; }
    double turn(const Eigen::VectorXd& step) const override;
    void try_step(const Eigen::VectorXd& step, double length) override;
    void try_more(const Eigen::VectorXd& step) override;
    void add_correction(const Eigen::VectorXd& part, Eigen::VectorXd& out) const override;
    void accept(const Eigen::VectorXd* step) override;
    Again again(const Eigen::VectorXd& lambda, bool is_last) override;
    bool is_beyond() const override;
    void go_back() override;
    double own_violation() const override;
    void start(double step) override;
    void finish() override;
    void undo() override;
    double way() const override;
    Energy energy() const override;
    bool is_driven() const override { return model_.has_couples() || model_.is_led(); }
    void rest() override { velocity_->setZero(); }

private:
    struct Place
    {
        double s;
        int slide; ///< -1: at s
    };
    bool is_moving() const { return step_ > 0.0; }
    bool is_midpoint() const { return is_moving() && is_midpoint_; }
    void prepare();
    void size_up();
    void hold_velocity();
    void add_touches();
    RodState end_of(const RodState& at) const;
    double parameter(int place, const RodState& at) const;
    std::vector<SlidePress> pressed(const Eigen::VectorXd& lambda) const;
    std::vector<SingleUnknown> sliding_unknowns(const Eigen::VectorXd& lambda);

    RodModel& model_;
    int revision_ = 0;
    double stiffness_ = 0.0; ///< YA / L + YI / L^3 of the stiffest [N/m]
    double heaviest_ = 0.0;  ///< entry of the mass [kg]
    std::vector<Place> places_;
    std::vector<char> is_joined_; ///< slides that joints hold

    // One step. M (x - begin - step * velocity) / step^2 holds the rod back, and (gamma M
    // + D) (x - begin) / step, with the viscosity and the drags of the model.
    RodState* state_ = nullptr;
    Eigen::VectorXd* velocity_ = nullptr;
    bool is_midpoint_ = false;
    double step_ = 0.0;     ///< 0: of an equilibrium; of the midpoint rule half [s]
    double time_led_ = 0.0; ///< of the model at the begin [s]
    double gain_ = 0.0;     ///< of material damping in the step
    Eigen::VectorXd velocity_before_;
    std::optional<RodResponse> response_; ///< of the midpoint rule
    double pull_ = 0.0;                   ///< of the mass, in second derivatives [1/s^2]
    double noise_of_forces_ = 0.0, extent_ = 0.0;
    Eigen::VectorXd momentum_; ///< M v / step [N]
    std::optional<RodState> start_, trial_;
    bool has_contradiction_ = false;
    Eigen::VectorXd contradiction_; ///< the part of violations that is not solved for

    // One iteration.
    RodModel::Rows rows_;
    Eigen::VectorXd couples_;
    Eigen::VectorXd held_here_, held_there_; ///< by inertia, viscosity and drags [N]
    std::vector<Eigen::Vector3d> pressed_by_joints_; ///< of slides
    std::vector<Added> added_;
    std::vector<RodTouch> touches_;
    BandMatrix matrix_;
    SaddleSolver saddle_;
};

} // namespace cellwarp::core
