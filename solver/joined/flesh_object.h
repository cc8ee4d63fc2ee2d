// SPDX-License-Identifier: GPL-3.0-or-later
// Flesh that joints hold: points of its material are places, which rods, bodies and nets
// are joined to. [Capell02], [Lenoir04]
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "solver/dynamics/articulable_object.h"
#include "solver/flesh/flesh.h"
#include "solver/flesh/flesh_step.h"
#include "solver/flesh/step_rows.h"

namespace cellwarp::core
{

class FleshObject final : public ArticulableObject
{
public:
    /// \p flesh and \p state must outlive it. \p to_scene: from the axes of the flesh to
    /// those of what it is joined to. Throws what FleshStep throws.
    FleshObject(Flesh& flesh, FleshState& state, const Motion& to_scene);

    /// Another lattice of the same flesh, whose state is that now; \p points: its places,
    /// in the order of add_place().
    void take(Flesh& flesh, std::vector<FleshPoint> points);

    /// A number for a point; without a free node in it the point is held by bones.
    int add_place(FleshPoint point);

    /// Where bones and held points are \p duration [s] from now; in shorter steps they
    /// are on the straight way there. \p from: where they are.
    void lead(std::vector<Motion> from, std::vector<Motion> to, double duration);

    int num_unknowns() const override { return static_cast<int>(3 * step_->num_free()); }
    double size() const override { return size_; }
    double extent() const override { return extent_; }
    Eigen::Vector3d place(int place, bool of_trial) const override;
    void add_moved(int place, const Eigen::Vector3d& n, SparseRow& out) const override;
    void measure(bool of_trial, Measure& out) override;
    double linearise(Eigen::VectorXd& gradient, Measure& here) override;
    double noise_of_forces() const override;
    double cancelled() const override;
    SaddleSolver::Report factorize(const Eigen::VectorXd& lambda, int& level) override;
    void solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const override;
    double stiffness_of(int unknown) const override { return step_->diagonal(unknown); }
    double turn(const Eigen::VectorXd& step) const override { return step_->turn(step); }
    void try_step(const Eigen::VectorXd& step, double length) override;
    void try_more(const Eigen::VectorXd& step) override;
    void accept(const Eigen::VectorXd*) override { u_ = trial_; }
    void go_back() override { u_ = first_; }
    void start(double step) override;
    void finish() override;
    void undo() override;
    double way() const override { return (u_ - before_.u).cwiseAbs().maxCoeff(); }
    /// Nothing is told of it: it counts as driven.
    Energy energy() const override { return {}; }
    bool is_driven() const override { return true; }
    void rest() override { state_.v.setZero(); }

private:
    void take_size();

    Flesh* flesh_;
    FleshState& state_;
    Motion to_scene_;
    std::unique_ptr<FleshStep> step_;
    std::optional<FreeShares> shares_;
    struct Place
    {
        FleshPoint point;
        NodeShares free;
    };
    std::vector<Place> places_;
    double size_ = 0.0, extent_ = 0.0;

    std::vector<Motion> from_, to_, now_;
    double duration_ = 0.0, done_ = 0.0, dt_ = 0.0; ///< [s]

    // One step.
    FleshState before_;
    Eigen::VectorXd first_, u_, trial_;
};

} // namespace cellwarp::core
