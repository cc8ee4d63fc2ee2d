// SPDX-License-Identifier: GPL-3.0-or-later
// The settings of a scene, listed once: what reads, writes, compares, checks or asks for
// them goes through visit_settings().
#pragma once

#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>

namespace cellwarp::core
{

/// What a scene says; what it leaves out stays empty and takes its default.
struct SceneSettings
{
    struct Cells
    {
        std::optional<std::string> fill, loose;
        std::optional<std::int64_t> across, max_depth;
        std::optional<double> threshold, gap, thickness;
        std::optional<bool> join, flat, contact;
        std::optional<std::int64_t> max_cells;
        bool operator==(const Cells&) const = default;
    };
    struct Field
    {
        std::optional<std::string> drag, release;
        bool operator==(const Field&) const = default;
    };
    std::optional<std::string> energy;
    Cells cells;
    Field field;
    bool operator==(const SceneSettings&) const = default;
};

/// Values that a setting may have: both ends, or one of some words.
template <class Number>
struct Between
{
    Number low, high;
};
struct OneOf
{
    std::initializer_list<const char*> words;

    bool has(const std::string& text) const
    {
        for (const char* word : words)
            if (text == word)
                return true;
        return false;
    }
};

struct YesOrNo
{
};

/// Calls visit(section, key, allowed, value...) for every setting, with its value in each
/// of \p settings. The section is "" for those that stand in none.
template <class Visit, class... Settings>
void visit_settings(Visit&& visit, Settings&... settings)
{
    using Whole = Between<std::int64_t>;
    using Real = Between<double>;
    visit("", "energy", OneOf{{"cellwarp", "botsch07"}}, settings.energy...);
    visit("cells", "fill", OneOf{{"solid", "shell", "closed"}}, settings.cells.fill...);
    visit("cells", "across", Whole{1, 1 << 20}, settings.cells.across...);
    visit("cells", "max_depth", Whole{0, 20}, settings.cells.max_depth...);
    visit("cells", "threshold", Real{0.0, 1e300}, settings.cells.threshold...);
    visit("cells", "gap", Real{1e-6, 1.0}, settings.cells.gap...);
    visit("cells", "thickness", Real{1e-6, 1.0}, settings.cells.thickness...);
    visit("cells", "loose", OneOf{{"follow", "stay"}}, settings.cells.loose...);
    visit("cells", "join", YesOrNo{}, settings.cells.join...);
    visit("cells", "flat", YesOrNo{}, settings.cells.flat...);
    visit("cells", "contact", YesOrNo{}, settings.cells.contact...);
    visit("cells", "max_cells", Whole{1, std::int64_t(1) << 31},
          settings.cells.max_cells...);
    visit("field", "drag", OneOf{{"blend", "closest4"}}, settings.field.drag...);
    visit("field", "release", OneOf{{"rbf", "rbf-global", "blend"}},
          settings.field.release...);
}

} // namespace cellwarp::core
