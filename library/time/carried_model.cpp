// SPDX-License-Identifier: GPL-3.0-or-later
// A carrier is seen in three units: its own places in metres from the scene's origin,
// the model's, and the work frame of the session.
#include "library/time/carried_model.h"

#include <algorithm>
#include <map>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "io/base/error.h"
#include "library/session/led_rod.h"
#include "library/time/rod_part.h"

namespace cellwarp::core
{

/// A carrier as it was at the start.
struct CarriedModel::Start
{
    RodState state;
    Eigen::Vector3d origin; ///< [m]
    double unit;            ///< [m]

    Eigen::Vector3d to_model(const Eigen::Vector3d& place) const
    {
        return (origin + place) / unit;
    }
};

namespace
{

/// A carrier as it was at one time.
template <class Start>
class Carrier final : public LedState
{
public:
    Carrier(std::shared_ptr<const Start> start, const WorkFrame& frame, RodState now)
        : start_(std::move(start)), frame_(frame), now_(std::move(now))
    {
    }

    RailPlace at(double s) const override
    {
        const CurvePoint point = now_.at(s);
        return {frame_.to_work(start_->to_model(point.place)),
                frame_.vector_to_work(point.first / start_->unit),
                frame_.vector_to_work(point.second / start_->unit)};
    }
    Motion carry(double s) const override
    {
        const Eigen::Matrix3d turn =
            frame_.rotation_to_work(now_.frame(s) * start_->state.frame(s).transpose());
        Motion motion;
        motion.R = Eigen::Quaterniond(turn).normalized().toRotationMatrix();
        motion.t = at(s).place -
                   motion.R * frame_.to_work(start_->to_model(start_->state.at(s).place));
        return motion;
    }
    double length() const override
    {
        return ArcLength(now_.curve()).total() / start_->unit /
               frame_.length_to_model(1.0);
    }

private:
    std::shared_ptr<const Start> start_;
    WorkFrame frame_;
    RodState now_;
};

/// A frame for each of the simulation's, with the moves of those that stand in the file.
HandleFile in_time(HandleFile handles, const ObjectSimulation& simulation)
{
    if (handles.stages.size() > 1)
        throw malformed({handles.path, 0, "commit"},
                        "rods carry the model: there is no new rest under way");
    if (handles.stages.empty())
        handles.stages.emplace_back();
    Stage& stage = handles.stages.front();
    std::map<std::int64_t, FrameStatement> told;
    for (FrameStatement& frame : stage.frames)
        told.emplace(frame.number, std::move(frame));
    stage.frames.clear();
    // Frame 0 is the start, where nothing has moved; an equilibrium has no other.
    const std::int64_t first = simulation.is_static() ? 0 : 1,
                       last = simulation.is_static() ? 0 : simulation.last_frame();
    for (std::int64_t number = first; number <= last; ++number)
    {
        auto found = told.extract(number);
        stage.frames.push_back(found ? std::move(found.mapped())
                                     : FrameStatement{number, {}, 0});
    }
    if (!told.empty())
        throw malformed({handles.path, told.begin()->second.line, "frame"},
                        fmt::format("got {}, this simulation moves things in frames {} "
                                    "to {}",
                                    told.begin()->first, first, last));
    return handles;
}

} // namespace

std::vector<std::shared_ptr<const CarriedModel::Start>>
CarriedModel::starts_of(const ObjectSimulation& simulation, double unit)
{
    std::vector<std::shared_ptr<const Start>> starts;
    for (const RodPart* const rod : simulation.carriers())
        starts.push_back(
            std::make_shared<const Start>(Start{rod->state, rod->origin(), unit}));
    return starts;
}

SessionSettings
CarriedModel::with_rods(SessionSettings settings, const ObjectSimulation& simulation,
                        const std::vector<std::shared_ptr<const Start>>& starts)
{
    const std::vector<const RodPart*> carriers = simulation.carriers();
    for (std::size_t k = 0; k < carriers.size(); ++k)
    {
        const auto at_rest =
            [start = starts[k], radius = carriers[k]->radius()](const WorkFrame& frame)
        {
            Spline rest = start->state.curve();
            for (Eigen::Vector3d& control : rest.controls)
                control = frame.to_work(start->to_model(control));
            return std::make_shared<const SplineHandle>(
                rest, radius / start->unit / frame.length_to_model(1.0));
        };
        settings.led_rods.push_back({carriers[k]->name(), at_rest});
    }
    return settings;
}

CarriedModel::CarriedModel(std::shared_ptr<const Geometry> geometry, HandleFile handles,
                           SessionSettings settings, double unit,
                           const ObjectSimulation& simulation)
    : starts_(starts_of(simulation, unit)),
      session_(std::move(geometry), in_time(std::move(handles), simulation),
               with_rods(std::move(settings), simulation, starts_))
{
}

CarriedModel::~CarriedModel() = default;

void CarriedModel::follow(const ObjectSimulation& simulation, bool wants_samples)
{
    const WorkFrame& frame = session_.system()->rest().frame;
    const std::vector<const RodPart*> carriers = simulation.carriers();
    std::vector<std::shared_ptr<const SplineState>> states;
    for (std::size_t k = 0; k < carriers.size(); ++k)
        states.push_back(std::make_shared<const Carrier<Start>>(starts_[k], frame,
                                                                carriers[k]->state));
    session_.lead(std::move(states));
    session_.next_frame(wants_samples);
}

} // namespace cellwarp::core
