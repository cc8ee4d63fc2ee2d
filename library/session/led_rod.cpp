// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/led_rod.h"

#include <algorithm>
#include <utility>

#include "library/session/handle_trajectory.h"

namespace cellwarp::core
{

namespace
{

/// How the frames turn, at the stations of the rod.
std::vector<Eigen::Matrix3d> turns_of(const SplineHandle& rod, const SplineState& state)
{
    std::vector<Eigen::Matrix3d> turns;
    for (const LineStation& station : rod.stations())
        turns.push_back(state.carry(station.parameter).R);
    return turns;
}

LineBending bending(const SplineHandle& rod, const SplineState& from,
                    const SplineState& to)
{
    return {turns_of(rod, from), turns_of(rod, to)};
}

/// Each place goes straight to where it is to be, its frame along the rod's bend.
class OnTheWay final : public LedState
{
public:
    OnTheWay(const SplineHandle& rod, std::shared_ptr<const SplineState> from,
             std::shared_ptr<const SplineState> to, double t)
        : rod_(rod), rest_(rod.rest()), from_(std::move(from)), to_(std::move(to)), t_(t),
          turns_(bending(rod, *from_, *to_).at(t))
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
        // From the last station before, by what both states bend from there on.
        const std::vector<LineStation>& stations = rod_.stations();
        const auto next = std::upper_bound(stations.begin() + 1, stations.end(), s,
                                           [](double at, const LineStation& station)
                                           { return at < station.parameter; });
        const std::size_t last = static_cast<std::size_t>(next - stations.begin()) - 1;
        const double near = stations[last].parameter;
        const Eigen::Vector3d bend =
            mixed(rotation_vector(from_->carry(near).R.transpose() * a.R),
                  rotation_vector(to_->carry(near).R.transpose() * b.R));
        const double angle = bend.norm();
        Motion motion;
        motion.R = turns_[last];
        if (angle > 0.0)
            motion.R = motion.R * rotation_about(bend / angle, angle);
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

    const SplineHandle& rod_;
    std::shared_ptr<const SplineState> rest_, from_, to_;
    double t_;
    std::vector<Eigen::Matrix3d> turns_; ///< of the stations
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
    const std::vector<double> turns = bending(rod, from, to).turns();
    const double turn = *std::max_element(turns.begin(), turns.end());
    double way = 0.0;
    for (const LineStation& station : rod.stations())
        way = std::max(
            way,
            (to.at(station.parameter).place - from.at(station.parameter).place).norm());
    return parts_of_way(turn, size > 0 ? way / size : 0.0);
}

} // namespace cellwarp::core
