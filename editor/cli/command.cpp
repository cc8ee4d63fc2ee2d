// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/command.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "library/session/json.h"
#include "library/session/memory_limit.h"

namespace cellwarp::core
{

namespace
{

/// "200M", "1.5 GB", "2GiB" or plain bytes.
double parse_bytes(const std::string& text)
{
    const std::size_t unit =
        std::min(text.find_first_of("kKmMgGtTbB"), text.size()); // no number has these
    const std::string before = text.substr(0, unit);
    const std::optional<double> number =
        parse_double(before.substr(0, before.find_last_not_of(' ') + 1));
    double factor = 1.0;
    std::string rest = lower_case(text.substr(unit));
    constexpr std::string_view kPrefixes = "kmgt";
    if (const std::size_t power = kPrefixes.find(rest.empty() ? 'b' : rest[0]);
        power != std::string_view::npos)
    {
        rest.erase(0, 1);
        factor = std::pow(rest.starts_with('i') ? 1024.0 : 1000.0,
                          static_cast<double>(power) + 1.0);
        if (rest == "ib")
            rest = "b";
    }
    if (!number || !(*number > 0) || !std::isfinite(*number) ||
        !(rest.empty() || rest == "b"))
        throw wrong_flag("--max-memory",
                         "got " + in_quotes(text) +
                             ", need bytes like 500000000, 500M, 2GB or 2GiB");
    return *number * factor;
}

} // namespace

void add_max_memory(CLI::App& app, std::optional<std::string>& max_memory)
{
    app.add_option(
        "--max-memory", max_memory,
        "of the whole process in bytes, like 500M, 2GB or 2GiB (default: 70 % of what "
        "is free, in the process's control groups too)");
}

double memory_limit(const std::optional<std::string>& max_memory)
{
    return max_memory ? parse_bytes(*max_memory) : default_memory_limit();
}

void add_columns(CLI::App& app, std::string& columns)
{
    app.add_option("--columns", columns,
                   "of text in columns, like x,y,z,intensity,r,g,b: which is what "
                   "(default: a line of names, else x y z first)");
}

std::string json_text(const Json& json)
{
    Json all = {{"version", CELLWARP_VERSION}};
    all.update(json);
    return all.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

namespace
{

Json error_object(const std::string& fault, const Remark& remark)
{
    const auto known = [](const std::string& text)
    { return text.empty() ? Json() : Json(text); };
    const std::int64_t line = remark.where.line;
    return {{"fault", fault},
            {"file", known(remark.where.file)},
            {"line", line > 0 ? Json(line) : Json()},
            {"field", known(remark.where.field)},
            {"message", remark.what}};
}

} // namespace

Json error_json(const Error& error)
{
    const auto name = [&]
    {
        switch (error.fault())
        {
        case Fault::Usage:
            return "usage";
        case Fault::Malformed:
            return "malformed";
        case Fault::File:
            return "file";
        case Fault::Budget:
            return "budget";
        case Fault::Unsolvable:
            return "unsolvable";
        }
        return "";
    };
    return error_object(name(),
                        at({error.file(), error.line(), error.field()}, error.message()));
}

Json error_json(const std::string& fault, const std::string& message)
{
    return error_object(fault, at({}, message));
}

void check_stdout(const std::string& output, const CommonFlags& common)
{
    if (output == "-" && common.is_json)
        throw wrong_flag("--output", "- and --json both need stdout");
}

void say(const std::string& text)
{
    std::fputs(text.c_str(), stderr);
}

void print_warnings(const std::vector<std::string>& warnings, const CommonFlags& common)
{
    if (!common.is_quiet)
        for (const std::string& warning : warnings)
            say(fmt::format("warning: {}\n", warning));
}

} // namespace cellwarp::core
