// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/rods_json.h"

#include <fmt/format.h>

namespace cellwarp::core
{

namespace
{

Json vector_json(const Eigen::Vector3d& v)
{
    return {v.x(), v.y(), v.z()};
}

} // namespace

Json rods_json(const std::vector<RodReport>& rods)
{
    Json json = Json::array();
    for (const RodReport& rod : rods)
    {
        Json points = Json::array(), forces = Json::array(), held = Json::array();
        for (std::size_t k = 0; k < rod.points.size(); ++k)
        {
            points.push_back(vector_json(rod.points[k]));
            forces.push_back(vector_json(rod.forces[k]));
            Json parts = Json::array();
            if (rod.holds[k].place)
                parts.push_back("place");
            if (rod.holds[k].tangent)
                parts.push_back("tangent");
            if (rod.holds[k].twist)
                parts.push_back("twist");
            held.push_back(parts);
        }
        Json pins = Json::array();
        for (const RodReport::Pin& pin : rod.pins)
            pins.push_back({{"name", pin.name},
                            {"at", pin.at},
                            {"slides", pin.slides},
                            {"force", vector_json(pin.force)}});
        json.push_back({{"name", rod.name},
                        {"kind", rod.is_rod ? "rod" : "curve"},
                        {"cells", rod.cells},
                        {"length", rod.length},
                        {"radius", rod.radius},
                        {"stiffness", rod.stiffness},
                        {"energy", rod.energy},
                        {"points", points},
                        {"held", held},
                        {"forces", forces},
                        {"pins", pins}});
    }
    return json;
}

std::string rods_text(const std::vector<RodReport>& rods)
{
    std::string text;
    for (const RodReport& rod : rods)
    {
        text +=
            rod.is_rod
                ? fmt::format(
                      "  rod {}: {:.4g} long, radius {:.4g}, carries {} cells{}, through",
                      rod.name, rod.length, rod.radius, rod.cells,
                      rod.stiffness > 0.0
                          ? fmt::format(", pushes back with stiffness {:.4g}",
                                        rod.stiffness)
                          : std::string())
                : fmt::format("  curve {}: {:.4g} long, through", rod.name, rod.length);
        for (const Eigen::Vector3d& point : rod.points)
            text +=
                fmt::format("  {:.5g} {:.5g} {:.5g}", point.x(), point.y(), point.z());
        text += "\n";
        for (const RodReport::Pin& pin : rod.pins)
            text +=
                fmt::format("    {} {} {:.4g}\n", pin.name,
                            pin.slides ? "slides on it, from" : "is on it at", pin.at);
    }
    return text;
}

} // namespace cellwarp::core
