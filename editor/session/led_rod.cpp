// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/led_rod.h"

#include <algorithm>
#include <utility>

#include <Eigen/Geometry>

#include "editor/session/handle_trajectory.h"

namespace cellwarp
{

namespace
{

/// Places of a rod at which two of its states are compared.
constexpr int kPlacesOfRod = 33;

/// Each place goes straight to where it is to be, its frame by the shortest turn.
class OnTheWay final : public LedState
{
public:
    OnTheWay(const SplineHandle& rod, std::shared_ptr<const SplineState> from,
             std::shared_ptr<const SplineState> to, double t)
        : rest_(rod.rest()), from_(std::move(from)), to_(std::move(to)), t_(t)
    {
    }

    RailPlace at(double s) const override
    {
        const RailPlace a = from_->at(s), b = to_->at(s);
        return {mixed(a.place, b.place), mixed(a.first, b.first),
                mixed(a.second, b.second)};
    }
    Motion carry(double s) const override
    {
        const Motion a = from_->carry(s), b = to_->carry(s);
        const Eigen::Vector3d place = rest_->at(s).place;
        Motion motion;
        motion.R = Eigen::Quaterniond(a.R)
                       .slerp(t_, Eigen::Quaterniond(b.R))
                       .normalized()
                       .toRotationMatrix();
        motion.t = mixed(a(place), b(place)) - motion.R * place;
        return motion;
    }
    double length() const override
    {
        return (1.0 - t_) * from_->length() + t_ * to_->length();
    }

private:
    Eigen::Vector3d mixed(const Eigen::Vector3d& a, const Eigen::Vector3d& b) const
    {
        return (1.0 - t_) * a + t_ * b;
    }

    std::shared_ptr<const SplineState> rest_, from_, to_;
    double t_;
};

} // namespace

std::shared_ptr<const SplineState> on_the_way(const SplineHandle& rod,
                                              std::shared_ptr<const SplineState> from,
                                              std::shared_ptr<const SplineState> to,
                                              double t)
{
    if (t >= 1.0)
        return to;
    return std::make_shared<const OnTheWay>(rod, std::move(from), std::move(to), t);
}

int parts_between(const SplineHandle& rod, const SplineState& from, const SplineState& to,
                  double size)
{
    double turn = 0.0, way = 0.0;
    for (int k = 0; k < kPlacesOfRod; ++k)
    {
        const double s = rod.begin() + (rod.end() - rod.begin()) *
                                           (static_cast<double>(k) / (kPlacesOfRod - 1));
        const Motion a = from.carry(s), b = to.carry(s);
        turn = std::max(turn, Eigen::AngleAxisd(a.R.transpose() * b.R).angle());
        way = std::max(way, (to.at(s).place - from.at(s).place).norm());
    }
    return parts_of_way(turn, size > 0 ? way / size : 0.0);
}

} // namespace cellwarp
