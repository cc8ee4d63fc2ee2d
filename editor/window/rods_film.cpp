// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/film_source.h"
#include "library/session/memory_limit.h"
#include "library/session/scene_settings.h"
#include "library/time/carried_model.h"

namespace cellwarp::core
{

namespace
{

/// Of the lines of rods.
constexpr int kPlacesOfLine = 65;

class RodsFilm final : public FilmSource
{
public:
    explicit RodsFilm(const FilmScene& of)
        : time_(of.scene.time), simulation_(of.scene.time),
          carried_(geometry_of(of.model), of.handles, settings_for(of), time_.unit,
                   simulation_)
    {
    }

    std::int64_t last() const override
    {
        return simulation_.is_static() ? 1 : simulation_.last_frame();
    }
    double seconds_a_frame() const override
    {
        return time_.dt * static_cast<double>(simulation_.steps_a_frame());
    }
    std::string next() override
    {
        simulation_.next_frame();
        carried_.follow(simulation_, true);
        const SimulationReport report = simulation_.report();
        if (!report.is_converged)
            return report.stop;
        const SolveReport& cells = carried_.session().frames().back().solve;
        return cells.stop == Stop::Converged ? "" : stop_name(cells.stop);
    }
    DeformedSamples deformed() override { return carried_.session().deformed(); }
    std::vector<ShownLine> lines(const WorkFrame& view) const override
    {
        return shown_rods(simulation_, time_.unit, view);
    }

private:
    static SessionSettings settings_for(const FilmScene& of)
    {
        SessionSettings settings = settings_of(of.scene);
        settings.cells.max_memory = default_memory_limit();
        return settings;
    }

    const TimeSettings time_;
    Simulation simulation_;
    CarriedModel carried_;
};

} // namespace

std::vector<ShownLine> shown_rods(const Simulation& simulation, double unit,
                                  const WorkFrame& view)
{
    std::vector<ShownLine> lines;
    for (const SimulatedRod& rod : simulation.rods(kPlacesOfLine))
    {
        ShownLine& line = lines.emplace_back();
        line.name = rod.name;
        for (const Eigen::Vector3d& place : rod.curve)
            line.places.push_back(view.to_work(place / unit));
    }
    return lines;
}

std::unique_ptr<FilmSource> film_of_rods(const FilmScene& scene)
{
    return std::make_unique<RodsFilm>(scene);
}

} // namespace cellwarp::core
