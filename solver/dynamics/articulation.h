// SPDX-License-Identifier: GPL-3.0-or-later
// Objects and the joints between them, as one minimum: each object keeps a factor of its
// own, joints are a dense system of as many unknowns as they have rows. [Lenoir04]
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "solver/dynamics/articulable_object.h"
#include "solver/dynamics/coupling.h"
#include "solver/dynamics/motion_stop.h"
#include "solver/dynamics/wrench.h"
#include "solver/linear/band_matrix.h"

namespace cellwarp::core
{

struct Joint
{
    enum class Kind
    {
        Point,   ///< both places are one; 3 rows
        Frame,   ///< frame of the second = frame of the first * frame; 3 rows
        Distance ///< of the places; 1 row
    };
    Kind kind = Kind::Point;
    std::array<int, 2> object = {}, place = {}; ///< an object may be joined to itself
    Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
    double distance = 0.0; ///< [m]
};

class Articulation
{
public:
    /// The objects must outlive it.
    explicit Articulation(std::vector<ArticulableObject*> objects,
                          std::vector<Joint> joints = {}, Coupling* coupling = nullptr);

    /// Brings all objects to their common minimum.
    MotionReport solve(const MotionOptions& options);

    /// Multipliers of an object's own rows, and of the joints' rows [N, N m].
    const Eigen::VectorXd& multipliers(int object) const { return lambda_[idx(object)]; }
    const Eigen::VectorXd& joint_multipliers() const { return joint_lambda_; }
    /// The force and couple of each joint on its first object, about that object's place;
    /// empty before the first solve.
    std::vector<Wrench> joint_wrenches() const;
    /// Whether rows are violated, by the states.
    bool is_pulled() const;
    /// What rounding makes of energies, as in the last solve [J].
    double rounding() const { return rounding_; }

private:
    class Run;
    bool is_held(const Joint& joint) const;
    bool is_beyond() const;
    Eigen::VectorXd joint_violations(bool of_trial) const;

    std::vector<ArticulableObject*> objects_;
    std::vector<Joint> joints_;
    Coupling* coupling_;
    std::vector<Eigen::VectorXd> lambda_;
    Eigen::VectorXd joint_lambda_;
    double rounding_ = 0.0;
};

} // namespace cellwarp::core
