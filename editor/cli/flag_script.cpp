// SPDX-License-Identifier: GPL-3.0-or-later
// The flags are written as the lines of a handle file, and what is wrong with a line is
// told of its flag.
#include "editor/cli/flag_script.h"

#include <algorithm>
#include <array>
#include <regex>
#include <sstream>

#include <fmt/format.h>

#include "io/error.h"
#include "io/number.h"

namespace cellwarp
{

namespace
{

constexpr const char* kPath = "command line";

/// Without the place in the file that never was: "command line:3: ".
std::string without_place(const std::string& message, std::size_t line)
{
    const std::string place = fmt::format("{}:{}: ", kPath, line);
    return message.starts_with(place) ? message.substr(place.size()) : message;
}

/// What is wrong later is told of a region by its name: there is no file to look into.
HandleFile without_lines(HandleFile handles)
{
    handles.path.clear();
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
            throw Error(Fault::Usage,
                        fmt::format("--fix: takes no name (got {}, need {})",
                                    in_quotes(first), in_quotes(second)));
    for (const std::string& handle : handles_)
        if (const auto [first, second] = first_words(handle);
            is_selector_kind(first) && !is_selector_kind(second))
            throw Error(Fault::Usage,
                        fmt::format("--handle: needs a name before {}, like 'hand {}'",
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
            throw Error(Fault::Usage, flag + ": got several lines, need one");
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
        return without_lines(parse_handles(kPath, text));
    }
    catch (const Error& error)
    {
        if (error.fault() != Fault::Malformed)
            throw;
        const std::string message =
            std::regex_replace(error.what(), std::regex(R"( \(line \d+\))"), "");
        for (std::size_t line = flags.size(); line > 0; --line)
            if (const std::string rest = without_place(message, line); rest != message)
                throw Error(Fault::Usage, flags[line - 1] + ": " + rest);
        throw Error(Fault::Usage, message);
    }
}

} // namespace cellwarp
