// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp-editor: its command line, and the one place where errors become messages and
// exit codes.
#include <atomic>
#include <csignal>
#include <iostream>
#include <new>
#include <optional>

#include <CLI/CLI.hpp>

#include "editor/process/memory_guard.h"
#include "editor/window/playback.h"
#include "io/base/error.h"
#include "octree/base/parallel.h"

namespace
{

using namespace cellwarp::core;

// The window's library calls exit() when its display goes away.
const MemoryGuard guard
    __attribute__((init_priority(101))) (MemoryGuard::LibraryExit::Anything);

/// The signal that ends the program; 0: none has come.
std::atomic<int> signal_seen{0};

extern "C" void end_at_signal(int signal)
{
    signal_seen = signal;
}

struct EditorFlags
{
    std::string model, script, report;
    int threads = 0;
    double scale = 0.0;
    bool is_light = false;
};

void play_script(const EditorFlags& flags, WindowOptions options)
{
    const std::vector<Statement> statements = read_statements(flags.script);
    options.is_played = true;
    Editor editor(options, true);
    if (!flags.model.empty())
    {
        editor.app().open(flags.model);
        editor.app().finish_opening();
    }
    const PlaybackReport report = play(editor, flags.script, statements);
    if (!flags.report.empty())
        write_file(flags.report, report_text(report), Overwrite::Yes);
}

int run(int argc, char** argv)
{
    CLI::App app("Grab a shape and bend it: select a part and fix it, select another and "
                 "drag it.\n\n"
                 "  cellwarp-editor samples/bar.json\n"
                 "  cellwarp-editor --light dragon.ply\n",
                 "cellwarp-editor");
    app.set_version_flag("--version", "cellwarp-editor " CELLWARP_VERSION);
    EditorFlags flags;
    app.add_option("model", flags.model,
                   "a model or a scene (*.json); none: a page to choose")
        ->option_text("[MODEL|SCENE]");
    app.add_option("--threads", flags.threads,
                   "threads, 0: all; the result is the same for every number")
        ->check(CLI::Range(0, 4096));
    app.add_option("--scale", flags.scale,
                   "pixels of the screen for one of the editor's, 0: as the display says")
        ->check(CLI::Range(0.0, 8.0));
    app.add_flag("--light", flags.is_light, "dark on light");
    CLI::Option* play_option = app.add_option(
        "--play", flags.script, "a file of events to play instead of yours, see below");
    app.add_option("--report", flags.report,
                   "times of the played drags and waits as JSON")
        ->needs(play_option);
    app.footer(statement_help());
    try
    {
        app.parse(argc, argv);
    }
    catch (const CLI::ParseError& error)
    {
        if (error.get_exit_code() == 0)
            return app.exit(error, std::cout, std::cerr);
        std::cerr << "error: " << error.what() << '\n';
        return static_cast<int>(Fault::Usage);
    }
    const ThreadLimit limit(flags.threads);
    WindowOptions options;
    options.scale = flags.scale;
    options.is_dark = !flags.is_light;
    if (!flags.script.empty())
    {
        play_script(flags, options);
        return 0;
    }
    Editor editor(options, true);
    if (!flags.model.empty())
        editor.app().open(flags.model);
    std::signal(SIGINT, end_at_signal);
    std::signal(SIGTERM, end_at_signal);
    // nohup wants it ignored.
    if (std::signal(SIGHUP, end_at_signal) == SIG_IGN)
        std::signal(SIGHUP, SIG_IGN);
    editor.run(signal_seen);
    return signal_seen == 0 ? 0 : 128 + signal_seen;
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
        std::cerr << "error: " << error.what() << '\n';
        return static_cast<int>(error.fault());
    }
    catch (const std::bad_alloc&)
    {
        throw;
    }
    catch (const std::exception& error)
    {
        std::cerr << "error: internal error: " << error.what() << '\n';
        return 1;
    }
}

} // namespace

int main(int argc, char** argv)
{
    return guard.main(run_and_tell, argc, argv);
}
