// SPDX-License-Identifier: GPL-3.0-or-later
// The flags are written as the lines of a handle file, and what is wrong with a line is
// told of its flag.
#include "editor/cli/flag_script.h"

#include <algorithm>
#include <array>
#include <sstream>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

/// What is wrong later is told of a region by its name: there is no file to look into.
HandleFile without_lines(HandleFile handles)
{
    for (Stage& stage : handles.stages)
    {
        for (RegionStatement& region : stage.regions)
            region.line = 0;
        for (FrameStatement& frame : stage.frames)
        {
            frame.line = 0;
            for (Move& move : frame.moves)
                move.line = 0;
        }
    }
    return handles;
}

std::array<std::string, 2> first_words(const std::string& text)
{
    std::istringstream words(text);
    std::array<std::string, 2> first;
    words >> first[0] >> first[1];
    return first;
}

bool is_selector_kind(const std::string& word)
{
    return std::find(kSelectorWords.begin(), kSelectorWords.end(), word) !=
           kSelectorWords.end();
}

} // namespace

void FlagScript::add_to(CLI::App& app)
{
    const auto add = [&](const char* flag, std::vector<std::string>& to, const char* what)
    { app.add_option(flag, to, what)->allow_extra_args(false); };
    add("--fix", fixes_,
        "SELECTOR: fixes a part, like --fix 'box 0 0 0  1 0.1 1'; repeatable");
    add("--handle", handles_, "NAME SELECTOR: a part to grab; repeatable");
    add("--move", moves_,
        "NAME MOVE: like --move 'head rotate 0 1 0 45 about border'; repeatable, all "
        "in one frame. Selectors and moves are those of handle files (docs/scenes.md)");
    app.add_flag(
        "--relative", is_relative_,
        "numbers of --fix, --handle and --move are in the model's box, 0 to 1; radii "
        "are shares of its diagonal");
}

void FlagScript::check_names() const
{
    for (const std::string& fix : fixes_)
        if (const auto [first, second] = first_words(fix);
            !is_selector_kind(first) && is_selector_kind(second))
            throw wrong_flag("--fix", fmt::format("takes no name (got {}, need {})",
                                                  in_quotes(first), in_quotes(second)));
    for (const std::string& handle : handles_)
        if (const auto [first, second] = first_words(handle);
            is_selector_kind(first) && !is_selector_kind(second))
            throw wrong_flag("--handle",
                             fmt::format("needs a name before {}, like 'hand {}'",
                                         in_quotes(first), handle));
}

HandleFile FlagScript::handles() const
{
    std::vector<std::string> flags = {""}; // of each line
    std::string text = "cellwarp-handles 1\n";
    const auto add =
        [&](const std::string& flag, const std::string& begin, const std::string& rest)
    {
        if (rest.find_first_of("\n\r") != std::string::npos)
            throw wrong_flag(flag, "got several lines, need one");
        flags.push_back(flag);
        text += begin + rest + "\n";
    };
    if (is_relative_)
        add("--relative", "units relative", "");
    for (const std::string& fix : fixes_)
        add("--fix", "fixed --fix ", fix);
    for (const std::string& handle : handles_)
        add("--handle", "handle ", handle);
    if (!moves_.empty())
        add("--move", "frame 1", "");
    for (const std::string& move : moves_)
        add("--move", "move ", move);
    check_names();
    try
    {
        return without_lines(parse_handles("", text));
    }
    catch (const Error& error)
    {
        const std::size_t line = static_cast<std::size_t>(error.line());
        if (error.fault() != Fault::Malformed || line == 0)
            throw;
        throw wrong_flag(flags[line - 1], at({"", 0, error.field()}, error.message()));
    }
}

} // namespace cellwarp::core
