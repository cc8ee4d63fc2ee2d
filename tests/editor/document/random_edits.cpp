// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/editor/document/random_edits.h"

#include <filesystem>

#include "io/bytes.h"

namespace cellwarp::support
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
                std::to_string(region.placement.translation.x()) + "\n";
    return text;
}

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
    switch (std::uniform_int_distribution<int>(0, 9)(rng))
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
    default:
        for (const EditedRegion& region : document.regions())
            if (region.role == Role::Handle)
            {
                Placement to = region.placement;
                to.axis = number(0, 1) < 0.5 ? Eigen::Vector3d::UnitY() : to.axis;
                to.degrees += number(-90, 90);
                to.translation.y() = number(-1, 1);
                document.move_region(std::string(region.name), to);
                break;
            }
    }
}

} // namespace cellwarp::support
