// SPDX-License-Identifier: GPL-3.0-or-later
// The settings of a scene in one table: keys of the file, flags, fields of the window and
// the documentation are made from it. A new setting is a member of SceneSettings and a
// line of visit_settings().
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

namespace cellwarp::core
{

/// Values that a scene states; those that it leaves out are empty and get their defaults.
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

/// Names and explanations of a setting, the same wherever it stands.
struct SettingText
{
    const char* section; ///< of the scene file; "": none
    const char* key;
    const char* label;     ///< in the window
    const char* help;      ///< what it is or does, without a stop
    const char* unit = ""; ///< of which it is a share
    /// The values in the window, in the order of OneOf; yes and no.
    std::array<const char*, 4> names = {};
    const char* help_of_no = ""; ///< of the flag --no-KEY; "": there is none
    bool has_flag = true;

    std::string flag(const char* before = "--") const; ///< "--max-depth"
    std::string help_with_unit() const;                ///< "... [of the diagonal]"
};

/// The value where a scene states none.
template <class Value>
struct Usual
{
    std::optional<Value> value; ///< nothing: it depends on the model, see text
    const char* text = "";      ///< behind the value: when it is another one

    std::string in_words() const; ///< "0.002; 0.01 with botsch07"
};

/// Defaults that other rooms need by name, too.
inline constexpr std::int64_t kUsualDepth = 2;
/// From the curves of `sweep`: there the error of the samples is worth the seconds.
inline constexpr double kUsualThreshold = 2e-3;
/// The same where gaps between cells are the error, as with botsch07: they are larger.
inline constexpr double kUsualGap = 1e-2;

/// Calls visit(text, allowed, usual, value...) for every setting, with its value in each
/// of \p settings.
template <class Visit, class... Settings>
void visit_settings(Visit&& visit, Settings&... settings)
{
    using Text = SettingText;
    using Whole = Between<std::int64_t>;
    using Real = Between<double>;
    using Word = Usual<std::string>;
    visit(Text{"", "energy", "Energy",
               "cellwarp, or botsch07: the paper's own method as a whole, its fields and "
               "solver among it"},
          OneOf{{"cellwarp", "botsch07"}}, Word{"cellwarp"}, settings.energy...);
    visit(
        Text{.section = "cells",
             .key = "fill",
             .label = "Fill",
             .help =
                 "solid, shell, or closed: solid, with lids over all openings of a mesh",
             .names = {"Solid", "Shell", "Solid, openings closed"}},
        OneOf{{"solid", "shell", "closed"}}, Word{"solid", "narrow openings are closed"},
        settings.cells.fill...);
    visit(
        Text{"cells", "across", "Across", "coarsest cells along the longest side"},
        Whole{1, 1 << 20},
        Usual<std::int64_t>{std::nullopt, "so many that there are 1,000 to 2,500 cells"},
        settings.cells.across...);
    visit(Text{"cells", "max_depth", "Depth",
               "splits below the coarsest cells, at the most"},
          Whole{0, 20}, Usual<std::int64_t>{kUsualDepth}, settings.cells.max_depth...);
    visit(Text{"cells", "threshold", "Threshold",
               "cells whose error is larger are split; 0: all, down to the largest depth",
               "diagonal"},
          Real{0.0, 1e300}, Usual<double>{kUsualThreshold, "0.01 with botsch07"},
          settings.cells.threshold...);
    visit(Text{"cells", "gap", "Gap", "parts farther apart than this are never glued",
               "diagonal"},
          Real{1e-6, 1.0}, Usual<double>{0.008}, settings.cells.gap...);
    visit(Text{"cells", "thickness", "Thickness",
               "thickness of shells and open sheets; solids ignore it", "diagonal"},
          Real{1e-6, 1.0}, Usual<double>{0.01}, settings.cells.thickness...);
    visit(Text{.section = "cells",
               .key = "loose",
               .label = "Loose parts",
               .help = "follow or stay: a part that no region holds goes with the part "
                       "nearest to it, or keeps its place",
               .names = {"Follow", "Stay"}},
          OneOf{{"follow", "stay"}}, Word{"follow", "stay with botsch07"},
          settings.cells.loose...);
    visit(
        Text{"cells", "join", "Join parts that touch",
             "closed parts of a mesh that touch or overlap at rest are one material, not "
             "each its own"},
        YesOrNo{}, Usual<bool>{false}, settings.cells.join...);
    visit(
        Text{.section = "cells",
             .key = "flat",
             .label = "A flat model bends",
             .help = "all samples lie in a plane and all moves keep it: cells have three "
                     "unknowns, and nothing leaves the plane",
             .names = {"In its plane", "In space"},
             .help_of_no = "a flat model bends in space, like a sheet of paper"},
        YesOrNo{},
        Usual<bool>{std::nullopt, "where the samples lie in a plane that the first frame "
                                  "that moves something keeps; not with botsch07"},
        settings.cells.flat...);
    visit(
        Text{"cells", "contact", "Contact",
             "parts that come to touch do not pass through each other: the cells of one "
             "stay out of those of the other"},
        YesOrNo{}, Usual<bool>{false}, settings.cells.contact...);
    visit(Text{"cells", "max_cells", "Most cells",
               "most cells; the worst are split first until there are so many"},
          Whole{1, std::int64_t(1) << 31}, Usual<std::int64_t>{200000},
          settings.cells.max_cells...);
    visit(Text{.section = "field",
               .key = "drag",
               .label = "Dragged",
               .help =
                   "field while a region is dragged: a blend of near cells, or of the "
                   "four closest ones",
               .names = {"Blend of near cells", "Four closest cells"},
               .has_flag = false},
          OneOf{{"blend", "closest4"}}, Word{"blend", "closest4 with botsch07"},
          settings.field.drag...);
    visit(Text{.section = "field",
               .key = "release",
               .label = "Released",
               .help =
                   "field of the result: smooth by local fits, by one global fit, or the "
                   "field of drags",
               .names = {"Smooth, local fits", "Smooth, one global fit",
                         "Blend of closest cells"},
               .has_flag = false},
          OneOf{{"rbf", "rbf-global", "blend"}},
          Word{"rbf", "one fit to the cells' centres with botsch07"},
          settings.field.release...);
}

/// With defaults where \p settings have no value and the model does not decide.
SceneSettings with_usual_values(SceneSettings settings);

/// Throws Fault::Usage with the key ("cells.gap") of the first value that is not allowed.
void check_settings(const SceneSettings& settings);

/// The table of the documentation, in Markdown.
std::string settings_table();

} // namespace cellwarp::core
