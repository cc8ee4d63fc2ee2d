// SPDX-License-Identifier: GPL-3.0-or-later
// What a rod is held by: scalar rows g(x) = 0, each with a multiplier. [Lenoir04]
#pragma once

#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/rods/rod.h"

namespace cellwarp::core
{

enum class HoldKind
{
    Point,              ///< P = point; 3 rows
    Plane,              ///< n . (P - point) = 0, n = direction
    Axis,               ///< the two directions across `direction`; 2 rows
    Tangent,            ///< along direction; 2 rows
    CurvatureVector,    ///< P'' = direction; 3 rows
    GeometricCurvature, ///< (u x w) / (l^2 sigma) = direction across the tangent; 2 rows
    TwistAngle,         ///< m_1 towards direction, as far as the tangent lets it; 1 row
    Spin, ///< m_1 at the angle `spin` from direction, which goes with the tangent; 1 row
    Frame ///< material frame = frame; 3 rows
};

struct RodConstraint
{
    HoldKind hold = HoldKind::Point;
    double s = 0.0; ///< parameter of the curve
    Eigen::Vector3d point = Eigen::Vector3d::Zero();
    Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
    Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
    /// Spin only: the unit tangent that direction is across. The shortest turn from it to
    /// the tangent of the state carries direction along.
    Eigen::Vector3d tangent = Eigen::Vector3d::UnitX();
    double spin = 0.0; ///< [rad]
    /// How point [m/s], direction [rad/s] and spin [rad/s] move, of all kinds up to Spin.
    Eigen::Vector3d point_speed = Eigen::Vector3d::Zero();
    Eigen::Vector3d turning = Eigen::Vector3d::Zero();
    double spin_speed = 0.0;
    /// The control point that a Point holds instead of a place of the curve; -1: none. Of
    /// rods whose knots do not change.
    int control = -1;
    /// The slide of the model (slide.h) whose place takes that of `s`; -1: none. Of
    /// Point, Plane and Axis.
    int slide = -1;
    bool is_off = false; ///< for now it holds nothing: it has no rows
};

/// The direction of a Spin goes on from the tangent of a state, where it has come to.
void carry(RodConstraint& constraint, const RodState& state);

/// Directions in which a constraint on a place holds it: of Point, Plane and Axis.
std::vector<Eigen::Vector3d> held_directions(const RodConstraint& constraint);

int num_rows(HoldKind hold);
/// Those that it has at a state.
int num_rows(const RodConstraint& constraint, const RodState& state);

/// One row: how it changes with the unknowns, and by how much it is violated. Of places
/// [m]; of directions without unit; of angles [rad].
struct ConstraintRow
{
    std::vector<std::pair<int, double>> entries; ///< (unknown, derivative), ascending
    double violation = 0.0;
    double rate = 0.0; ///< of the violation, by what moves the constraint [1/s]
};

/// The basis where a constraint holds, kept from state to state.
struct HeldBasis
{
    double s = 0.0;
    int control = -1;
    BasisValues at;

    HeldBasis(const RodConstraint& constraint, const SplineBasis& basis);
    /// Of what slides.
    explicit HeldBasis(const BasisValues& values) : at(values) {}
};

/// The rows of a constraint at a state; without entries the violations alone. What a
/// tangent or a frame differs by must be below 90 degrees. \p basis is of the
/// constraint's places. What slides freely has its unknown behind those of the rod; what
/// was released, or is off, has no rows.
std::vector<ConstraintRow> rows_of(const RodConstraint& constraint, const RodState& state,
                                   const HeldBasis& basis, bool with_entries = true);

/// For each row the second derivative of its violation by time, where the state moves
/// evenly with \p velocity and the constraint as it does.
std::vector<double> convective(const RodConstraint& constraint, const RodState& state,
                               const Eigen::VectorXd& velocity);

/// How the material at \p s spins about its tangent with the unknowns: dphi.
std::vector<std::pair<int, double>> spin_at(const RodState& state, double s);

/// axis . (turn of the material frame at \p s), by the unknowns.
std::vector<std::pair<int, double>> turn_at(const RodState& state, double s,
                                            const Eigen::Vector3d& axis);

} // namespace cellwarp::core
