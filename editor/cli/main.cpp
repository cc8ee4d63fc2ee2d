// SPDX-License-Identifier: GPL-3.0-or-later
// The command line: subcommands, signals, and the one place where errors become
// messages and exit codes.
#include <algorithm>
#include <array>
#include <csignal>
#include <iterator>
#include <new>
#include <optional>
#include <sstream>
#include <system_error>

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "editor/cli/command.h"
#include "editor/cli/help.h"
#include "editor/process/memory_guard.h"
#include "io/base/error.h"
#include "io/base/near_word.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "library/session/json.h"
#include "octree/base/parallel.h"

namespace
{

using namespace cellwarp::core;

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
    // A model may have more files beside it than a shell allows to be open.
    constexpr rlim_t kEnoughFiles = 1 << 16;
    struct rlimit files
    {
    };
    if (::getrlimit(RLIMIT_NOFILE, &files) == 0 && files.rlim_cur < kEnoughFiles)
    {
        files.rlim_cur = std::min(files.rlim_max, kEnoughFiles);
        ::setrlimit(RLIMIT_NOFILE, &files);
    }
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGINT, end_at_signal);
    std::signal(SIGTERM, end_at_signal);
    // Closed terminal; stays ignored under nohup.
    if (std::signal(SIGHUP, end_at_signal) == SIG_IGN)
        std::signal(SIGHUP, SIG_IGN);
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

/// An error of a message that may begin with the flag that it is about.
Error with_flag(const std::string& message)
{
    const std::size_t end = message.find(": ");
    if (!message.starts_with("-") || end == std::string::npos || message.find(' ') < end)
        return Error(Fault::Usage, message);
    return wrong_flag(message.substr(0, end), message.substr(end + 2));
}

/// The words of a command line in their order.
std::string joined(const std::vector<std::string>& words)
{
    std::string text;
    for (const std::string& word : words)
        text += (text.empty() ? "" : " ") + word;
    return text;
}

/// Hint to quote the value of --fix, --handle or --move.
std::string quote_hint(const std::vector<std::string>& words, const std::string& extra)
{
    constexpr std::array<std::string_view, 3> kWithBlanks = {"--fix", "--handle",
                                                             "--move"};
    const auto flag = std::find_if(
        std::make_reverse_iterator(std::find(words.begin(), words.end(), extra)),
        words.rend(), [](const std::string& word) { return word.starts_with("--"); });
    if (flag == words.rend() ||
        std::find(kWithBlanks.begin(), kWithBlanks.end(), *flag) == kWithBlanks.end())
        return "";
    const auto first = flag.base();
    const auto last =
        std::find_if(first, words.end(),
                     [](const std::string& word)
                     { return word.starts_with('-') && !parse_double(word); });
    return fmt::format(" (quote what {} takes: {} '{}')", *flag, *flag,
                       joined({first, last}));
}

/// Unexpected arguments, in the order given.
std::string extras_text(const CLI::App& app, const std::vector<std::string>& words)
{
    const std::vector<std::string> extras = app.remaining(true);
    std::string near;
    for (const std::string& extra : extras)
        near += near_argument(app, extra);
    if (near.empty() && !extras.empty())
        near = quote_hint(words, extras.front());
    return (extras.size() == 1 ? "The following argument was not expected: "
                               : "The following arguments were not expected: ") +
           joined(extras) + near;
}

/// "help deform" is "deform --help".
std::vector<std::string> with_help_as_flag(std::vector<std::string> words)
{
    if (!words.empty() && words[0] == "help")
    {
        words.erase(words.begin());
        words.push_back("--help");
    }
    return words;
}

/// The parser's error in this program's words.
Error usage_error(const CLI::App& app, const std::vector<std::string>& words,
                  const CLI::ParseError& error)
{
    const std::string message = error.what();
    if (error.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError))
        return Error(Fault::Usage, extras_text(app, words));
    if (const std::string number = wrong_number(app, message); !number.empty())
        return with_flag(number);
    // "--output: 1 required TEXT missing"
    constexpr std::string_view kRequired = ": 1 required ", kMissing = " missing";
    if (const std::size_t at = message.find(kRequired);
        at != std::string::npos && message.ends_with(kMissing))
        return wrong_flag(
            message.substr(0, at),
            "needs a value (" +
                message.substr(at + kRequired.size(),
                               message.size() - at - kRequired.size() - kMissing.size()) +
                ")");
    return with_flag(message);
}

void print_help(CLI::App& app, const CLI::ParseError& error)
{
    std::ostringstream text;
    app.exit(error, text, text);
    write_file("-", text.str(), Overwrite::No);
}

int run(const std::vector<std::string>& words)
{
    CLI::App app(
        "Bend any shape: fix one part, grab another, move it; the rest follows like "
        "an elastic body.\n\n"
        "  cellwarp deform samples/bar.json -o bent.obj\n"
        "  cellwarp render bent.obj -o bent.png\n",
        "cellwarp");
    app.formatter(help_formatter());
    app.set_version_flag("-V,--version", "cellwarp " CELLWARP_VERSION);
    app.require_subcommand(1);
    app.footer("cellwarp help COMMAND tells more about one.");
    CommonFlags common;
    int exit_code = 0;
    std::optional<ThreadLimit> limit;
    app.fallthrough();
    app.add_option("--threads", common.threads,
                   "threads, 0: all; the result is the same for every number")
        ->check(CLI::Range(0, 4096));
    app.add_flag("-q,--quiet", common.is_quiet, "no warnings, no progress");
    app.add_flag("--json", common.is_json, "one JSON object on stdout");
    app.add_flag("--overwrite", common.overwrites, "replace an existing output");
    app.parse_complete_callback([&] { limit.emplace(common.threads); });
    add_deform(app, common, exit_code);
    add_apply(app, common, exit_code);
    add_info(app, common, exit_code);
    add_check(app, common, exit_code);
    add_sweep(app, common, exit_code);
    add_edit(app, common);
    add_render(app, common, exit_code);
    add_simulate(app, common, exit_code);
    add_skeleton(app, common, exit_code);
    for (CLI::App* command : app.get_subcommands({}))
        command->footer(
            command->get_footer() +
            "Flags of all commands: --json, --overwrite, --quiet and --threads N "
            "(cellwarp --help).");
    if (words.empty())
    {
        say(app.help());
        return static_cast<int>(Fault::Usage);
    }
    if (!words[0].starts_with('-') && !has_subcommand(app, words[0]))
        throw Error(Fault::Usage, "unknown command " + in_quotes(words[0]) +
                                      near_command(app, words[0]) +
                                      "; cellwarp --help lists the commands");
    try
    {
        app.parse(std::vector<std::string>(words.rbegin(), words.rend()));
    }
    catch (const CLI::ParseError& error)
    {
        if (error.get_exit_code() == 0)
        {
            print_help(app, error);
            return 0;
        }
        throw usage_error(app, words, error);
    }
    return exit_code;
}

/// With --json an error is an object on stdout, unless something is there already. That
/// it cannot be written there is no other error.
void print_error(const Json& error)
{
    if (has_written_to_stdout())
        return;
    try
    {
        write_file("-", json_text({{"error", error}}), Overwrite::Yes);
    }
    catch (const Error&)
    {
    }
}

int report_error(const Error& error, bool is_json)
{
    say(fmt::format("error: {}\n", error.what()));
    if (is_json)
        print_error(error_json(error));
    return static_cast<int>(error.fault());
}

int report_bug(const std::string& what, bool is_json)
{
    const std::string message = "internal error: " + what;
    say(fmt::format("error: {}\n", message));
    if (is_json)
        print_error(error_json("internal", message));
    return 1;
}

/// Whether a word is --json, also with a value: --json=true.
bool asks_for_json(const std::string& word)
{
    constexpr std::string_view kWithValue = "--json=";
    if (!word.starts_with(kWithValue))
        return word == "--json";
    const std::string value = lower_case(word.substr(kWithValue.size()));
    return value != "false" && value != "off" && value != "no" && value != "0";
}

/// Errors as messages and exit codes; what lacks memory for that, too, comes out.
int run_and_report(int argc, char** argv)
{
    const std::vector<std::string> words = with_help_as_flag(
        std::vector<std::string>(argv + std::min(argc, 1), argv + argc));
    const auto end = std::find(words.begin(), words.end(), "--");
    const bool is_json = std::any_of(words.begin(), end, asks_for_json);
    try
    {
        return run(words);
    }
    catch (const Error& error)
    {
        return report_error(error, is_json);
    }
    catch (const std::bad_alloc&)
    {
        throw;
    }
    catch (const std::system_error& error)
    {
        if (error.code() == std::errc::resource_unavailable_try_again)
            return report_error(
                Error(Fault::Budget, std::string("no more threads: ") + error.what()),
                is_json);
        return report_bug(error.what(), is_json);
    }
    catch (const std::exception& error)
    {
        return report_bug(error.what(), is_json);
    }
}

} // namespace

int main(int argc, char** argv)
{
    prepare_process();
    return guard.main(run_and_report, argc, argv);
}
