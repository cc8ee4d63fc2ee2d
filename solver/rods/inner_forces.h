// SPDX-License-Identifier: GPL-3.0-or-later
// Forces and moments in the sections of a rod. inner_forces.cpp has the derivation.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "solver/rods/rod.h"

namespace cellwarp::core
{

/// The action of the part ahead of a section on the part behind it; ahead is where the
/// parameter grows.
struct SectionForces
{
    double tension = 0.0;                             ///< along the tangent [N]
    Eigen::Vector3d shear = Eigen::Vector3d::Zero();  ///< across it [N]
    Eigen::Vector3d moment = Eigen::Vector3d::Zero(); ///< bending and twisting [N m]
    double torque = 0.0;                              ///< the twisting part of it [N m]
};

/// The section forces of a state, by the energy of exact strains.
class InnerForces
{
public:
    explicit InnerForces(const RodState& state);

    /// In a span, at a parameter of it, both ends included.
    SectionForces in(std::size_t span, double s) const;

private:
    /// Values along one piece, at lengths at rest [m], linear between them and beyond.
    template <class Value>
    struct Samples
    {
        std::vector<double> at;
        std::vector<Value> value;
        void add(double length, const Value& one);
        Value operator()(double length) const;
    };
    struct Piece
    {
        Samples<double> tension, torque;
        Samples<Eigen::Vector3d> bending, slope; ///< slope: of the moment [N m / m]
    };

    void join_at_seam();

    const RodState& state_;
    std::vector<Piece> pieces_;
    std::vector<std::size_t> piece_of_span_;
};

} // namespace cellwarp::core
