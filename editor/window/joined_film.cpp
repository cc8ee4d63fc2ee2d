// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/film_source.h"
#include "library/session/memory_limit.h"
#include "library/session/scene_settings.h"
#include "library/time/joined_simulation.h"

namespace cellwarp::core
{

namespace
{

class JoinedFilm final : public FilmSource
{
public:
    explicit JoinedFilm(const FilmScene& of)
        : simulation_(geometry_of(of.model), of.scene, cells_for(of), false, of.handles)
    {
    }

    std::int64_t last() const override { return simulation_.flesh().last_frame(); }
    double seconds_a_frame() const override
    {
        const FleshSimulation& flesh = simulation_.flesh();
        return flesh.time().dt * static_cast<double>(flesh.steps_a_frame());
    }
    std::string next() override
    {
        simulation_.next_frame();
        const FleshFrame frame = simulation_.flesh().report();
        const SimulationReport report = simulation_.rods().report();
        return !report.is_converged ? report.stop : frame.is_converged ? "" : frame.stop;
    }
    DeformedSamples deformed() override { return simulation_.flesh().deformed(); }
    std::vector<ShownLine> lines(const WorkFrame& view) const override
    {
        std::vector<ShownLine> lines = shown_joints(simulation_.flesh().joints(), view);
        for (ShownLine& line :
             shown_rods(simulation_.rods(), simulation_.flesh().time().unit, view))
            lines.push_back(std::move(line));
        return lines;
    }

private:
    static CellSettings cells_for(const FilmScene& of)
    {
        CellSettings cells = settings_of(of.scene).cells;
        cells.max_memory = default_memory_limit();
        return cells;
    }

    JoinedSimulation simulation_;
};

} // namespace

std::unique_ptr<FilmSource> film_of_joined(const FilmScene& scene)
{
    return std::make_unique<JoinedFilm>(scene);
}

} // namespace cellwarp::core
