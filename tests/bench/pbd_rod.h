// SPDX-License-Identifier: GPL-3.0-or-later
// A peer for rods: a chain of rigid segments whose joints are position-based constraints
// with compliance, all solved at once in each step. pbd_rod.cpp has the method. [Deul18]
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cellwarp::core
{

class PbdRod
{
public:
    /// Along x from the origin, clamped there: one more segment, before it, is held. A
    /// round section of these stiffnesses. \p mass: a length, \p spin: of rotation about
    /// the segment's axis, a length.
    PbdRod(double length, int segments, double stretch, double bending, double twist,
           double mass, double spin);

    Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
    void step(double h);
    /// All segments stand still: steps with this between them lead to rest.
    void stop();
    Eigen::Vector3d tip() const;

private:
    using Vector6 = Eigen::Matrix<double, 6, 1>;
    using Matrix6 = Eigen::Matrix<double, 6, 6>;
    struct Segment
    {
        Eigen::Vector3d x, v = Eigen::Vector3d::Zero(), omega = Eigen::Vector3d::Zero();
        Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
        double inverse_mass = 0.0;
        Eigen::Vector3d inverse_inertia = Eigen::Vector3d::Zero(); ///< in its own axes
    };
    /// Between segments k and k + 1.
    struct Joint
    {
        Vector6 C;
        Matrix6 by_first, by_second; ///< derivatives by (x, turn) of both
    };
    Joint joint(std::size_t k) const;
    Matrix6 inverse_mass(const Segment& segment) const;

    double part_; ///< length of a segment [m]
    Vector6 compliance_;
    std::vector<Segment> segments_;
    std::vector<Joint> joints_;
    std::vector<Matrix6> diagonal_, side_; ///< of the block tridiagonal system
    std::vector<Vector6> right_;
};

} // namespace cellwarp::core
