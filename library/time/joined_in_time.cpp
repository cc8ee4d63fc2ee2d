// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <utility>

#include "library/session/session_json.h"
#include "library/time/in_time.h"
#include "library/time/joined_simulation.h"
#include "library/time/told_in_time.h"

namespace cellwarp::core
{

namespace
{

/// The sum of numbers, or of each of three.
Json sum_of(const Json& a, const Json& b)
{
    if (a.is_number())
        return a.get<double>() + b.get<double>();
    Json sum = Json::array();
    for (std::size_t k = 0; k < a.size(); ++k)
        sum.push_back(a[k].get<double>() + b[k].get<double>());
    return sum;
}

class JoinedInTime final : public InTime
{
public:
    JoinedInTime(const SceneFile& scene, const InTimeOptions& options)
        : request_(read_flesh_request(scene)),
          simulation_(geometry_of(request_.file), request_.scene, request_.cells,
                      options.is_tight, request_.handles),
          deformed_(simulation_.flesh().deformed())
    {
    }

    std::vector<std::string> warnings() const override
    {
        std::vector<std::string> all = request_.warnings;
        for (const std::string& more : simulation_.warnings())
            if (std::find(all.begin(), all.end(), more) == all.end())
                all.push_back(more); // both have read the skeleton's file
        seen_.add_warnings(simulation_.flesh(), all);
        return all;
    }
    bool is_static() const override { return false; }
    std::int64_t last_frame() const override { return simulation_.flesh().last_frame(); }
    double time_of(std::int64_t frame) const override
    {
        return simulation_.flesh().time_of(frame);
    }
    std::int64_t num_steps() const override { return simulation_.flesh().num_steps(); }
    std::int64_t steps_done() const override { return simulation_.flesh().steps_done(); }
    void next_frame(const std::function<void()>& watch, bool wants_samples) override
    {
        simulation_.next_frame(watch);
        is_drawn_ = wants_samples;
        if (wants_samples)
            deformed_ = simulation_.flesh().deformed();
    }

    Told tell(std::int64_t number, bool wants_json) override
    {
        Told told;
        const FleshFrame frame = simulation_.flesh().report();
        const SimulationReport report = simulation_.rods().report();
        seen_.add(frame);
        if (!frame.is_converged)
            told.problems.push_back("the flesh: " + frame.stop);
        if (!report.is_converged)
            told.problems.push_back(problem_of_rods(report));
        if (!wants_json)
            return told;
        // Of the whole: sums; the flesh's own energies stand in "skeleton".
        if (!std::exchange(is_drawn_, true))
            deformed_ = simulation_.flesh().deformed();
        const Json flesh =
            told_of_flesh(number, frame, simulation_.flesh(), deformed_.samples);
        told.json = told_of_rods(number, report, simulation_.rods());
        for (const char* key : {"kinetic", "elastic", "gravity"})
            told.json["energy"][key] =
                sum_of(told.json["energy"][key], flesh["energy"][key]);
        for (const char* key : {"momentum", "angular_momentum", "iterations"})
            told.json[key] = sum_of(told.json[key], flesh[key]);
        told.json["constraint"] = std::max(told.json["constraint"].get<double>(),
                                           flesh["constraint"].get<double>());
        if (report.is_converged)
            told.json["stop"] = flesh["stop"];
        told.json["skeleton"] = flesh["skeleton"];
        told.json["volume"] = flesh["volume"];
        return told;
    }
    void add_to(Json& json) const override
    {
        json["mass"] = simulation_.flesh().body().mass;
        PartCounts parts = parts_of_flesh(simulation_.flesh());
        parts.rods = 1;
        json["unused"] = unused_parts(parts);
    }

    std::shared_ptr<const GeometryFile> model() const override { return request_.file; }
    const DeformedSamples& deformed() const override { return deformed_; }
    std::optional<std::string> bytes_of_rods(const std::string& name, double unit,
                                             const Drawing& drawing) const override
    {
        return bytes_of(simulation_.rods(), name, unit, drawing);
    }
    double unit() const override { return simulation_.flesh().time().unit; }

    FilmFrame seen(int around) const override
    {
        FilmFrame seen = seen_of_flesh(simulation_.flesh(), deformed_.samples);
        Geometry& rods = seen.parts.emplace_back(simulation_.rods().stage(around));
        for (Eigen::Vector3d& x : rods.samples)
            x /= unit();
        return seen;
    }

private:
    FleshRequest request_;
    JoinedSimulation simulation_;
    DeformedSamples deformed_;
    bool is_drawn_ = true; ///< deformed_ is of now
    SeenFlesh seen_;
};

} // namespace

std::unique_ptr<InTime> open_joined_in_time(const SceneFile& scene,
                                            const InTimeOptions& options)
{
    return std::make_unique<JoinedInTime>(scene, options);
}

} // namespace cellwarp::core
