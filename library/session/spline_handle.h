// SPDX-License-Identifier: GPL-3.0-or-later
// Rods and curves of an edit session: how they lie at rest, what holds them, and where
// that takes them. A rod finds its least energy; a curve goes where its points are put.
//
// All of it is in rest coordinates [work]: the motion of a rod as a whole comes after it,
// so that a rod moved as a whole moves to the last digit as any other region does.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "io/scene/handle_file.h"
#include "library/session/line_bending.h"
#include "octree/base/rigid_motion.h"
#include "solver/cells/constraints.h"
#include "solver/rods/rod.h"
#include "solver/rods/rod_constraint.h"
#include "solver/rods/spline.h"

namespace cellwarp::core
{

class RodModel;

/// What one point of the statement is held by. Without tangent a direction is that of
/// rest.
struct SplineHold
{
    HoldParts parts;
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    Eigen::Vector3d tangent = Eigen::Vector3d::Zero(); ///< unit
    double turn = 0.0;                                 ///< about the tangent [rad]
    bool is_told = false; ///< the tangent; else it is of rest
    /// The rotation that carries the frame of rest to a held tangent, before the turn. It
    /// follows from all holds, see held_line().
    Eigen::Matrix3d carried = Eigen::Matrix3d::Identity();

    bool operator==(const SplineHold&) const = default;
};

/// One a point.
using SplineHolds = std::vector<SplineHold>;

/// Where a rod or curve is. Immutable.
class SplineState
{
public:
    virtual ~SplineState() = default;
    virtual RailPlace at(double s) const = 0;
    /// The motion of space that its frame has made at \p s, from rest; exactly the
    /// identity at rest. theory-rods (36).
    virtual Motion carry(double s) const = 0;
    /// Of stretch, bending and twist of a rod, of its stiffness or, where it only leads,
    /// of stiffness 1: of a round rod of the tube's radius in a body whose energy is that
    /// of the cells [work^3].
    virtual double energy() const = 0;
    virtual double length() const = 0; ///< [work]
    /// What holds each point pulls the rod with, in the same units [work^2].
    virtual std::vector<Eigen::Vector3d> forces() const = 0;
    /// Where the points of the statement are.
    virtual std::vector<Eigen::Vector3d> points() const = 0;
    /// Frame at a point: columns two directions across, tangent.
    virtual Eigen::Matrix3d frame_at_point(std::size_t point) const = 0;
    /// By how much it is turned about the tangent there, against the frame that is
    /// carried along the line without twist, see frame_anchor(); whole turns count [rad].
    virtual double turn_at_point(std::size_t point) const = 0;
    /// Whether it is to the last bit where another state of the same spline is, whatever
    /// holds them.
    virtual bool is_at(const SplineState& other) const { return this == &other; }
    /// Null for a rod that is led.
    virtual const RodState* rod() const { return nullptr; }
};

/// At rest. Immutable; its states refer to it.
class SplineHandle
{
public:
    /// \p points [work]; \p radius of its tube [work]. Throws std::invalid_argument for a
    /// line without length.
    SplineHandle(const SplineStatement& statement,
                 std::span<const Eigen::Vector3d> points, bool is_rod, double radius);
    /// A line that nothing here bends: its states come from elsewhere (led_rod.h). \p
    /// rest [work], without points to hold.
    SplineHandle(const Spline& rest, double radius);
    SplineHandle(const SplineHandle&) = delete;
    SplineHandle& operator=(const SplineHandle&) = delete;

    bool is_rod() const { return is_rod_; }
    double radius() const { return radius_; } ///< of the tube
    std::size_t num_points() const { return points_.size(); }
    /// Of a point of the statement.
    double parameter_of_point(std::size_t point) const { return at_points_[point]; }
    double parameter_of_share(double share) const
    {
        return rod_.arc_length().parameter(share);
    }
    double share_of_parameter(double s) const
    {
        return rod_.arc_length().at(s) / rod_.arc_length().total();
    }
    bool is_closed() const { return rod_.basis().is_closed(); }
    /// Whether a point is on the curve: inner control points are not.
    bool has_frame_at(std::size_t point) const
    {
        return !by_controls_ ||
               (!is_closed() && (point == 0 || point + 1 == num_points()));
    }
    double begin() const { return rod_.basis().begin(); }
    double end() const { return rod_.basis().end(); }
    /// Of the place nearest to \p x, not beyond an end.
    double nearest(const Eigen::Vector3d& x) const;
    /// Straight pieces that follow it closely.
    const std::vector<Eigen::Vector3d>& polyline() const { return polyline_; }
    /// The corners of the polyline.
    const std::vector<LineStation>& stations() const { return stations_; }
    /// What holds it until something is said: both ends of a rod, all of a curve.
    SplineHolds rest_holds() const;
    std::shared_ptr<const SplineState> rest() const { return rest_state_; }

    /// To where \p holds take it, from \p from on; \p tries_all: also by slower ways.
    /// Nothing: it found no rest.
    std::shared_ptr<const SplineState>
    moved(const SplineState& from, const SplineHolds& holds, bool tries_all) const;

    /// How stiff a rod is against the cells; 0: it only leads them. Of one that pushes
    /// back moved() gives a guess, from which it is solved for together with the cells.
    /// Times its energy of YI = 1 [work^4]. [theory-rods (35)]
    double stiffness() const { return stiffness_; }
    /// What holds it at \p state; of a twist without a tangent, as seen from \p now.
    /// \p is_alone: nothing else holds the body: it stays as it is at \p now in the
    /// rigid motions that are free.
    std::vector<RodConstraint> constraints(const SplineState& state, const RodState& now,
                                           bool is_alone) const;
    /// Held as at \p from it has come to \p now, where its constraints pull it with
    /// \p multipliers.
    std::shared_ptr<const SplineState> solved(const SplineState& from,
                                              const RodState& now,
                                              const Eigen::VectorXd& multipliers) const;

private:
    class State;
    std::function<Section(double)> section_of(const Spline& spline) const;
    void start();
    void add_place(double s);
    double turn_at(const RodState& now, std::size_t point, std::size_t anchor) const;
    double nearest_on_curve(const Eigen::Vector3d& x) const;
    double polished(double s, double reach, const Eigen::Vector3d& x) const;
    std::vector<RodConstraint> constraints(const RodState& now,
                                           const SplineHolds& holds) const;
    void hold_what_is_free(const RodState& now, const SplineHolds& holds,
                           std::vector<RodConstraint>& out) const;
    bool finds_rest(RodModel& model, const RodState& before, RodState& state) const;
    std::shared_ptr<const SplineState> led(const SplineHolds& holds) const;
    std::vector<Eigen::Vector3d> forces(const SplineHolds& holds,
                                        const Eigen::VectorXd& multipliers) const;
    std::shared_ptr<const SplineState> pushed(const State& from, const RodState& lead,
                                              const SplineHolds& holds) const;
    double energy_of(const RodState& state) const;
    bool is_kept(const RodState& now, const SplineHolds& holds) const;

    bool is_rod_, by_controls_;
    double radius_;
    double scale_ = 1.0;     ///< of its energy of YI = 1
    double stiffness_ = 0.0; ///< the same of one that pushes back
    std::vector<Eigen::Vector3d> points_;
    std::vector<double> at_points_; ///< parameters
    Rod rod_;
    RodState rest_;
    std::vector<Eigen::Vector3d> polyline_;
    std::vector<LineStation> stations_; ///< of the polyline
    Eigen::MatrixXd follow_; ///< of a curve through points: control points by points
    std::shared_ptr<const SplineState> rest_state_;
};

} // namespace cellwarp::core
