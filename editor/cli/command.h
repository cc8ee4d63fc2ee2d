// SPDX-License-Identifier: GPL-3.0-or-later
// All subcommands, and what they share: common flags, messages, exit codes.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "io/base/bytes.h"

namespace CLI
{
class App;
}

namespace cellwarp::core
{

class Error;

/// Flags that every subcommand has.
struct CommonFlags
{
    int threads = 0;
    bool is_quiet = false;
    bool is_json = false;
    bool overwrites = false;

    Overwrite overwrite() const { return overwrites ? Overwrite::Yes : Overwrite::No; }
};

/// A subcommand: its flags are added to the app, its run() gives the exit code.
void add_deform(CLI::App& app, CommonFlags& common, int& exit_code);
void add_apply(CLI::App& app, CommonFlags& common, int& exit_code);
void add_info(CLI::App& app, CommonFlags& common, int& exit_code);
void add_check(CLI::App& app, CommonFlags& common, int& exit_code);
void add_sweep(CLI::App& app, CommonFlags& common, int& exit_code);
void add_simulate(CLI::App& app, CommonFlags& common, int& exit_code);
/// Without an exit code: the editor's own takes its place.
void add_edit(CLI::App& app, CommonFlags& common);
/// Adds nothing in a build without pictures (no_render.cpp).
void add_render(CLI::App& app, CommonFlags& common, int& exit_code);
void add_skeleton(CLI::App& app, CommonFlags& common, int& exit_code);

/// Exit code: some frame did not converge.
inline constexpr int kNotConverged = 7;

/// Adds --max-memory.
void add_max_memory(CLI::App& app, std::optional<std::string>& max_memory);
/// The limit of --max-memory [byte]; default_memory_limit() without the flag. Throws
/// Fault::Usage.
double memory_limit(const std::optional<std::string>& max_memory);

/// Adds --columns.
void add_columns(CLI::App& app, std::string& columns);

/// Output of --json: one object, with the program's version before its own keys. Text
/// that is no UTF-8, as names of files may be, has marks in its place.
std::string json_text(const nlohmann::ordered_json& json);

/// The keys of an error, null for what it does not know: "fault", "file", "line",
/// "field", "message".
nlohmann::ordered_json error_json(const Error& error);
/// The same for an error without a place.
nlohmann::ordered_json error_json(const std::string& fault, const std::string& message);

/// Throws Fault::Usage if the output is stdout, which --json needs.
void check_stdout(const std::string& output, const CommonFlags& common);

/// "warning: ..." on stderr, unless quiet.
void print_warnings(const std::vector<std::string>& warnings, const CommonFlags& common);

/// Onto stderr; that it cannot be written there is no failure.
void say(const std::string& text);

} // namespace cellwarp::core
