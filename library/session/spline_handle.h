// SPDX-License-Identifier: GPL-3.0-or-later
// Rods and curves of an edit session: how they lie at rest, what holds them, and where
// that takes them. A rod finds its least energy; a curve goes where its points are put.
//
// All of it is in rest coordinates [work]: the motion of a rod as a whole comes after it,
// so that a rod moved as a whole moves to the last digit as any other region does.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "io/scene/handle_file.h"
#include "library/session/line_bending.h"
#include "octree/base/rigid_motion.h"
#include "solver/cells/constraints.h"

namespace cellwarp::core
{

class RodState;
struct RodConstraint;
struct Spline;

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

/// At rest. Immutable.
class SplineHandle
{
public:
    virtual ~SplineHandle() = default;

    virtual bool is_rod() const = 0;
    virtual double radius() const = 0; ///< of the tube
    virtual std::size_t num_points() const = 0;
    /// Of a point of the statement.
    virtual double parameter_of_point(std::size_t point) const = 0;
    virtual double parameter_of_share(double share) const = 0;
    virtual double share_of_parameter(double s) const = 0;
    virtual bool is_closed() const = 0;
    /// Whether a point is on the curve: inner control points are not.
    virtual bool has_frame_at(std::size_t point) const = 0;
    virtual double begin() const = 0;
    virtual double end() const = 0;
    /// Of the place nearest to \p x, not beyond an end.
    virtual double nearest(const Eigen::Vector3d& x) const = 0;
    /// Straight pieces that follow it closely.
    virtual const std::vector<Eigen::Vector3d>& polyline() const = 0;
    /// The corners of the polyline.
    virtual const std::vector<LineStation>& stations() const = 0;
    /// What holds it until something is said: both ends of a rod, all of a curve.
    virtual SplineHolds rest_holds() const = 0;
    virtual std::shared_ptr<const SplineState> rest() const = 0;

    /// To where \p holds take it, from \p from on; \p tries_all: also by slower ways.
    /// Nothing: it found no rest.
    virtual std::shared_ptr<const SplineState>
    moved(const SplineState& from, const SplineHolds& holds, bool tries_all) const = 0;

    /// How stiff a rod is against the cells; 0: it only leads them. Of one that pushes
    /// back moved() gives a guess, from which it is solved for together with the cells.
    /// Times its energy of YI = 1 [work^4]. [theory-rods (35)]
    virtual double stiffness() const = 0;
    /// What holds it at \p state; of a twist without a tangent, as seen from \p now.
    /// \p is_alone: nothing else holds the body: it stays as it is at \p now in the
    /// rigid motions that are free.
    virtual std::vector<RodConstraint>
    constraints(const SplineState& state, const RodState& now, bool is_alone) const = 0;
    /// Held as at \p from it has come to \p now, where its constraints pull it with
    /// \p multipliers.
    virtual std::shared_ptr<const SplineState>
    solved(const SplineState& from, const RodState& now,
           const Eigen::VectorXd& multipliers) const = 0;
};

/// As few places of a line as a rod through them needs to follow it.
std::vector<Eigen::Vector3d> points_for_rod(std::span<const Eigen::Vector3d> line,
                                            double tolerance);

/// \p points [work]; \p radius of its tube [work]. Throws std::invalid_argument for a
/// line without length.
std::shared_ptr<const SplineHandle>
make_spline_handle(const SplineStatement& statement,
                   std::span<const Eigen::Vector3d> points, bool is_rod, double radius);

/// A line that nothing here bends: its states come from elsewhere (led_rod.h). \p rest
/// [work], without points to hold.
std::shared_ptr<const SplineHandle> make_led_handle(const Spline& rest, double radius);

} // namespace cellwarp::core
