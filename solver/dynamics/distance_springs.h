// SPDX-License-Identifier: GPL-3.0-or-later
// Springs between places that are sums of points: of a net, of a spline, of the world.
// distance_springs.cpp has the derivation.
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// Shares of points, each by the first of its three unknowns, ascending.
using PointShares = std::vector<std::pair<int, double>>;

/// The sum of the points [m].
Eigen::Vector3d along(const PointShares& shares, const Eigen::VectorXd& x);
/// Adds what \p force on that sum is on the unknowns.
void pull(const PointShares& shares, const Eigen::Vector3d& force, Eigen::VectorXd& out);
/// The way from one sum to another.
PointShares way_between(const PointShares& from, const PointShares& to);

struct DistanceSpring
{
    PointShares way;                      ///< its shares sum to 0, or to 1 with `from`
    double stiffness = 0.0, length = 0.0; ///< [N/m], [m]
    Eigen::Vector3d from = Eigen::Vector3d::Zero(); ///< a point of the world [m]
};

class DistanceSprings
{
public:
    void add(DistanceSpring spring);
    void clear() { springs_.clear(); }
    void set_stiffness(std::size_t spring, double stiffness); ///< [N/m]
    double stiffest() const;                                  ///< [N/m]

    double energy(const Eigen::VectorXd& x) const; ///< [J]
    /// In the steps that follow a spring of stiffness k loses gain k / 2 times the square
    /// of how much longer it is than at \p begin; with \p gain 0 it does not.
    void damp(const Eigen::VectorXd& begin, double gain);
    /// The energy and what the step has lost, but for a constant [J].
    double step_energy(const Eigen::VectorXd& x) const;
    /// Adds the gradient of step_energy(). Returns the largest force [N].
    double add_gradient(const Eigen::VectorXd& x, Eigen::VectorXd& out) const;

    /// The part of the second derivatives that is taken: springs that push have a
    /// negative part across.
    enum class Curvature
    {
        Exact,
        WithoutPushes
    };
    /// \p each(first unknown of row, of column, block): the lower triangle of the second
    /// derivatives of step_energy(), diagonal blocks whole.
    template <class Each>
    void for_each_block(const Eigen::VectorXd& x, Curvature how, const Each& each) const
    {
        for (const Spring& spring : springs_)
        {
            const Eigen::Matrix3d B = second_derivatives(spring, x, how);
            for (const auto& [row, of_row] : spring.way)
                for (const auto& [column, of_column] : spring.way)
                    if (row >= column)
                        each(row, column, Eigen::Matrix3d(of_row * of_column * B));
        }
    }

    /// The next second derivatives are those of the forces that \p step from \p x leads
    /// to, to first order; null: of the state itself.
    void predict(const Eigen::VectorXd& x, const Eigen::VectorXd* step);
    /// Adds the forces that take back what \p step, from \p before to \p after, has
    /// stretched to second order.
    void add_correction(const Eigen::VectorXd& before, const Eigen::VectorXd& after,
                        const Eigen::VectorXd& step, Eigen::VectorXd& out) const;
    /// The largest turn of a spring by \p step [rad].
    double turn(const Eigen::VectorXd& x, const Eigen::VectorXd& step) const;

private:
    struct Spring : DistanceSpring
    {
        double hard = 0.0, rest = 0.0; ///< stiffness and length of a step
        double force = 0.0;            ///< as predicted [N]
    };
    static Eigen::Vector3d way(const Spring& spring, const Eigen::VectorXd& x)
    {
        return along(spring.way, x) - spring.from;
    }
    double energy_with(const Eigen::VectorXd& x, double Spring::*stiffness,
                       double Spring::*length) const;
    Eigen::Matrix3d second_derivatives(const Spring& spring, const Eigen::VectorXd& x,
                                       Curvature how) const;

    std::vector<Spring> springs_;
    bool is_predicted_ = false;
};

} // namespace cellwarp::core
