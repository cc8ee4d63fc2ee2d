// SPDX-License-Identifier: GPL-3.0-or-later
// Rods that are solved for together with the cells that they carry.
// rod_unknowns.cpp has the derivation.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "octree/base/rigid_motion.h"
#include "solver/cells/cell_state.h"
#include "solver/cells/unknown_body.h"
#include "solver/coupled/rod_motion.h"
#include "solver/minimize/state.h"
#include "solver/rods/length_correction.h"
#include "solver/rods/rod.h"
#include "solver/rods/rod_constraint.h"

namespace cellwarp::core
{

/// A cell that follows the frame of a rod.
struct CarriedCell
{
    int cell = 0;
    double s = 0.0;         ///< parameter of the rod
    Eigen::Vector3d centre; ///< at rest
};

/// A rod and what it carries, at rest; all of it outlives what is made from it.
struct CoupledRod
{
    const RodState* rest = nullptr;
    double stiffness = 1.0; ///< of its energy, beside that of the glue
    std::vector<CarriedCell> cells;
};

/// How a carried cell moves with the control points and angles around it.
struct CarriedTwist
{
    /// Of a span: its control points and the angles of both ends.
    static constexpr int kMost = 3 * kMaxOrder + 2;
    std::vector<int> steps; ///< which, among those of all rods
    /// The twist in world axes, a column a step.
    Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, kMost> by_steps;
};

/// Control points and angles of rods, a block a rod. Each step places the cells that they
/// carry, whose poses the state of the cells takes for given.
class RodUnknowns final : public State
{
public:
    /// \p cells must outlive it; its unknowns stand before these. All rods are at rest,
    /// held by nothing.
    RodUnknowns(CellState& cells, std::vector<CoupledRod> rods);

    /// A rod from here on: it is at \p state, then moved as a whole. \p holds, whose rows
    /// \p state fulfils, stay fulfilled to first order in the unknowns.
    void set(std::size_t rod, const RodState& state, const Motion& motion,
             std::span<const RodConstraint> holds);

    /// Whether a rod stays where it is while the others and the cells are solved for.
    void lead(std::size_t rod, bool it_leads);
    bool leads(std::size_t rod) const { return leads_[rod]; }

    std::size_t size() const { return rods_.size(); }
    const CoupledRod& rod(std::size_t rod) const { return rods_[rod]; }
    const RodState& state(std::size_t rod) const { return now_[rod]; }
    const Motion& motion(std::size_t rod) const { return motions_[rod]; }
    /// The first unknown of a rod among those of all rods; the last: how many.
    int first(std::size_t rod) const { return first_[rod]; }
    int num_unknowns() const { return first_.back(); }
    /// Whether the last step from the base turned or stretched a part of a rod so much
    /// that it may have come to another minimum, with a loop or a turn more.
    bool is_too_far() const { return is_too_far_; }
    /// What each of its holds pulls the rod with where \p gradient, by the control points
    /// and angles, is left: as many numbers as each has rows.
    Eigen::VectorXd multipliers(std::size_t rod, const Eigen::VectorXd& gradient) const;

    /// Steps of control points and angles by the unknowns: a column an unknown, zero for
    /// one that the holds have taken, and for all of a rod that leads.
    const Eigen::SparseMatrix<double>& steps() const;
    bool is_taken(int unknown) const { return is_taken_[idx(unknown)]; }
    /// Of the carried cells, in the order of the rods, at the current state.
    const std::vector<CarriedTwist>& twists() const;

    void add_bodies(std::span<const GridPlace> places,
                    std::vector<UnknownBody>& out) const;
    /// Whether holds have taken other unknowns since the last add_bodies().
    bool has_other_bodies() const { return has_other_bodies_; }

    std::span<const int> block_sizes() const override { return sizes_; }
    void move(const Eigen::VectorXd& step, double length) override;
    void settle() override;
    double largest_move() const override;

private:
    std::vector<Eigen::Matrix3d> axes(std::size_t rod) const;
    Eigen::MatrixXd rows_by_unknowns(std::size_t rod,
                                     const std::vector<Eigen::Matrix3d>& axes) const;
    void choose_taken(std::size_t rod);
    void mark_taken(std::size_t rod);
    void find_twist(std::size_t rod, const CarriedCell& cell, CarriedTwist& out) const;

    CellState& cells_;
    std::vector<CoupledRod> rods_;
    std::vector<int> sizes_, first_;
    int num_carried_ = 0;
    /// Of each rod: where each control point counts most.
    std::vector<std::vector<double>> parameters_;
    std::vector<std::vector<RodConstraint>> holds_;
    /// Of each rod: rows of the holds that do not follow from others, and the unknowns
    /// that they take.
    std::vector<std::vector<int>> chosen_rows_, taken_;
    std::vector<RodState> now_, base_;
    std::vector<Motion> motions_;
    std::vector<char> leads_;    ///< a rod
    std::vector<char> is_taken_; ///< an unknown, by holds or because its rod leads
    mutable Eigen::SparseMatrix<double> steps_;
    mutable bool has_steps_ = false; ///< of the base, as held now
    mutable std::vector<CarriedTwist> twists_;
    mutable bool has_twists_ = false;       ///< of the current state
    std::vector<LengthCorrection> lengths_; ///< of the rods, from the base on
    Eigen::VectorXd moved_, part_;          ///< scratch
    bool is_too_far_ = false;
    mutable bool has_other_bodies_ = false;
};

} // namespace cellwarp::core
