// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/editor/document/random_edits.h"

#include <filesystem>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "library/session/session.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

BarDocument::BarDocument(int n)
{
    write_file(model, obj_text(box_shape({0, 0, 0}, {1, 1, 4}, n)), Overwrite::No);
    std::filesystem::create_directory(journals);
}

Document BarDocument::open(bool has_journal) const
{
    return {model, has_journal ? journals : ""};
}

std::vector<Eigen::Vector3d> replayed(const Document& document)
{
    SessionSettings settings;
    settings.cells.across = 12;
    settings.cells.max_depth = 0;
    Session session(geometry_of(document.model()), document.handles(), settings);
    while (session.next_frame(true))
        ;
    return session.deformed().samples;
}

Selection between(const Document& document, double low, double high)
{
    const std::vector<Eigen::Vector3d>& samples = document.model()->geometry.samples;
    Selection selection(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i)
        if (samples[i].z() >= low && samples[i].z() <= high)
            selection.add(i);
    return selection;
}

void hold_ends(Document& document)
{
    document.select(between(document, 0, 0.6), "Select by box");
    document.add_region(Role::Fixed, "foot");
    document.select(between(document, 3.4, 4), "Select by box");
    document.add_region(Role::Handle, "head");
}

std::string contents(const Document& document)
{
    std::string text = handle_text(document.handles()) + scene_text(document.scene());
    for (const auto& [first, last] : document.selection().runs())
        text += std::to_string(first) + "-" + std::to_string(last) + " ";
    for (const EditedRegion& region : document.regions())
        text += region.name + std::to_string(region.samples.size()) + " " +
                std::to_string(region.placement.degrees) + " " +
                std::to_string(region.placement.translation.x()) + " " + region.guide;
    for (const EditedRegion& region : document.regions())
        for (const EditedPoint& point : region.points)
            text += std::to_string(point.place.z()) + " " +
                    std::to_string(point.degrees) + " " +
                    std::to_string(point.parts.place) + "\n";
    return text;
}

namespace
{

/// Of rods, curves and pins on them.
void edit_lines_at_random(Document& document, std::mt19937& rng)
{
    const auto number = [&](double low, double high)
    { return random_number(rng, low, high); };
    std::vector<EditedRegion> lines, pins;
    for (const EditedRegion& region : document.regions())
        if (region.is_spline())
            lines.push_back(region);
        else if (region.role == Role::Pin)
            pins.push_back(region);
    if (lines.empty() || number(0, 1) < 0.2)
    {
        document.add_line(number(0, 1) < 0.7 ? Role::Rod : Role::Curve,
                          {{{0.5, 0.5, 0.4}, {0.5, number(0.4, 0.6), 2}, {0.5, 0.5, 3.6}},
                           false,
                           number(0, 1) < 0.5 ? std::optional(0.2) : std::nullopt});
        return;
    }
    const EditedRegion& line = lines[rng() % lines.size()];
    const std::size_t point = rng() % line.points.size();
    switch (rng() % 6)
    {
    case 0:
        document.release_point(line.name, point, {rng() % 2 == 0, rng() % 2 == 0, true});
        break;
    case 1:
    {
        RodShape shape = shape_of(line);
        shape.points.push_back(shape.points.back() + Eigen::Vector3d(0, 0, 0.2));
        document.set_line(line.name, shape);
        break;
    }
    case 2:
        if (!pins.empty())
            document.put_on(pins[0].name, number(0, 1) < 0.7 ? line.name : "",
                            number(0, 1) < 0.5 ? std::optional(number(0, 1))
                                               : std::nullopt);
        break;
    default:
        document.move_point(
            line.name, point,
            {line.points[point].rest +
                 Eigen::Vector3d(number(-0.2, 0.2), number(-0.2, 0.2), number(-0.1, 0.1)),
             number(0, 1) < 0.5 ? std::optional(number(-60, 60)) : std::nullopt});
    }
}

} // namespace

void edit_at_random(Document& document, std::mt19937& rng)
{
    const auto number = [&](double low, double high)
    { return random_number(rng, low, high); };
    const auto pick = [&]
    {
        return document.regions()[std::uniform_int_distribution<std::size_t>(
            0, document.regions().size() - 1)(rng)];
    };
    const double low = number(0, 3.5);
    switch (std::uniform_int_distribution<int>(0, 12)(rng))
    {
    case 0:
    case 1:
        document.select(between(document, low, low + number(0.2, 1)), "Select by box");
        break;
    case 2:
        if (!document.selection().empty() && document.regions().size() < 6)
            document.add_region(number(0, 1) < 0.5 ? Role::Handle : Role::Stiff);
        break;
    case 3:
        if (document.regions().size() > 2)
            document.remove_region(pick().name);
        break;
    case 4:
    {
        SceneSettings settings = document.settings();
        settings.cells.threshold = number(1e-4, 1e-2);
        document.change_settings(settings);
        break;
    }
    case 5:
        if (!document.regions().empty())
            document.rename_region(pick().name, "name" + std::to_string(rng() % 1000000));
        break;
    case 10:
    case 11:
    case 12:
        try
        {
            edit_lines_at_random(document, rng);
        }
        catch (const Error&)
        {
            // What cannot be now is refused, and nothing has changed.
        }
        break;
    default:
        for (const EditedRegion& region : document.regions())
            if (region.role == Role::Handle)
            {
                RigidMove to = region.placement;
                to.axis = number(0, 1) < 0.5 ? Eigen::Vector3d::UnitY() : to.axis;
                to.degrees += number(-90, 90);
                to.translation.y() = number(-1, 1);
                document.move_region(std::string(region.name), to);
                break;
            }
    }
}

} // namespace cellwarp::core::support
