// SPDX-License-Identifier: GPL-3.0-or-later
// The command line: subcommands, signals, and the one place where errors become
// messages and exit codes.
#include <algorithm>
#include <csignal>
#include <new>
#include <optional>
#include <sstream>
#include <system_error>

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>

#include "editor/cli/command.h"
#include "editor/session/memory_guard.h"
#include "io/error.h"
#include "io/near_word.h"
#include "io/number.h"
#include "io/text.h"
#include "octree/base/parallel.h"

namespace
{

using namespace cellwarp;

/// Outputs appear by a rename, so ending at once loses nothing.
extern "C" void end_at_signal(int signal)
{
    remove_unfinished_outputs();
    ::_exit(128 + signal);
}

const MemoryGuard guard
    __attribute__((init_priority(101))) (MemoryGuard::LibraryExit::NoMemory);

void prepare_process()
{
    // Descriptors 0 to 2 must be open, or an output file could become one of them.
    while (true)
    {
        const int file = ::open("/dev/null", O_RDWR);
        if (file < 0 || file > 2)
        {
            if (file > 2)
                ::close(file);
            break;
        }
    }
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGINT, end_at_signal);
    std::signal(SIGTERM, end_at_signal);
}

bool has_subcommand(const CLI::App& app, const std::string& name)
{
    const std::vector<const CLI::App*> all = app.get_subcommands({});
    return std::any_of(all.begin(), all.end(),
                       [&](const CLI::App* command)
                       { return command->get_name() == name; });
}

/// " (did you mean ...?)", where something is near.
std::string did_you_mean(const std::string& near)
{
    return near.empty() ? "" : " (did you mean " + near + "?)";
}

std::string near_command(const CLI::App& app, const std::string& given)
{
    std::vector<std::string> names;
    for (const CLI::App* command : app.get_subcommands({}))
        names.push_back(command->get_name());
    return did_you_mean(nearest_word(given, names));
}

/// Of an argument that the command does not have.
std::string near_argument(const CLI::App& app, const std::string& given)
{
    if (extension_of(given) == "handles" && !given.starts_with("-"))
        return did_you_mean("--handles " + given);
    std::vector<std::string> names;
    for (const CLI::App* of :
         {static_cast<const CLI::App*>(&app),
          static_cast<const CLI::App*>(
              app.get_subcommands().empty() ? nullptr : app.get_subcommands()[0])})
        for (const CLI::Option* option :
             of ? of->get_options() : std::vector<const CLI::Option*>())
            for (const std::string& word : option->get_lnames())
                names.push_back("--" + word);
    return did_you_mean(nearest_word(given.substr(0, given.find('=')), names));
}

/// What a number that cannot be read should have been: "--across: got 1e9, need an
/// integer". Empty for all other errors.
std::string wrong_number(const CLI::App& app, const std::string& message)
{
    const std::string begin = "Could not convert: ", between = " = ";
    const std::size_t end = message.find(between);
    if (!message.starts_with(begin) || end == std::string::npos)
        return "";
    const std::string name = message.substr(begin.size(), end - begin.size());
    for (const CLI::App* of : app.get_subcommands())
        if (const CLI::Option* option = of->get_option_no_throw(name))
            return name + ": got " + message.substr(end + between.size()) + ", need " +
                   (option->get_type_name().starts_with("INT") ? "an integer"
                                                               : "a number");
    return "";
}

int run(int argc, char** argv)
{
    CLI::App app(
        "Bend any shape: fix one part, grab another, move it; the rest follows like "
        "an elastic body.\n\n"
        "  cellwarp deform samples/bar.json -o bent.obj\n"
        "  cellwarp render bent.obj -o bent.png\n",
        "cellwarp");
    app.set_version_flag("--version", "cellwarp " CELLWARP_VERSION);
    app.require_subcommand(1);
    CommonFlags common;
    int exit_code = 0;
    std::optional<ThreadLimit> limit;
    app.fallthrough();
    app.add_option("--threads", common.threads,
                   "threads, 0: all; the result is the same for every number")
        ->check(CLI::Range(0, 4096));
    app.add_flag("--quiet", common.is_quiet, "no warnings, no progress");
    app.add_flag("--json", common.is_json, "one JSON object on stdout");
    app.add_flag("--overwrite", common.overwrites, "replace an existing output");
    app.parse_complete_callback([&] { limit.emplace(common.threads); });
    add_deform(app, common, exit_code);
    add_apply(app, common, exit_code);
    add_info(app, common, exit_code);
    add_check(app, common, exit_code);
    add_sweep(app, common, exit_code);
    add_edit(app, common);
    add_features(app, common, exit_code);
    for (CLI::App* command : app.get_subcommands({}))
        command->footer(
            command->get_footer() +
            "Flags of all commands: --json, --overwrite, --quiet and --threads N "
            "(cellwarp --help).");
    if (argc > 1 && argv[1][0] != '-' && !has_subcommand(app, argv[1]))
        throw Error(Fault::Usage, "unknown command " + in_quotes(argv[1]) +
                                      near_command(app, argv[1]) +
                                      "; cellwarp --help lists the commands");
    try
    {
        app.parse(argc, argv);
    }
    catch (const CLI::ParseError& error)
    {
        if (error.get_exit_code() == 0)
        {
            std::ostringstream text;
            app.exit(error, text, text);
            write_file("-", text.str(), Overwrite::No);
            return 0;
        }
        const std::string number = wrong_number(app, error.what());
        std::string near;
        if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError))
            for (const std::string& given : app.remaining(true))
                near += near_argument(app, given);
        say(fmt::format("error: {}{}\n", number.empty() ? error.what() : number, near));
        return static_cast<int>(Fault::Usage);
    }
    return exit_code;
}

/// Errors as messages and exit codes; what lacks memory for that, too, comes out.
int run_and_tell(int argc, char** argv)
{
    try
    {
        return run(argc, argv);
    }
    catch (const Error& error)
    {
        say(fmt::format("error: {}\n", error.what()));
        return static_cast<int>(error.fault());
    }
    catch (const std::bad_alloc&)
    {
        throw;
    }
    catch (const std::system_error& error)
    {
        const bool has_no_threads =
            error.code() == std::errc::resource_unavailable_try_again;
        say(fmt::format(
            "error: {}{}\n",
            has_no_threads ? "no more threads: " : "internal error: ", error.what()));
        return has_no_threads ? static_cast<int>(Fault::Budget) : 1;
    }
    catch (const std::exception& error)
    {
        say(fmt::format("error: internal error: {}\n", error.what()));
        return 1;
    }
}

} // namespace

int main(int argc, char** argv)
{
    prepare_process();
    return guard.main(run_and_tell, argc, argv);
}
