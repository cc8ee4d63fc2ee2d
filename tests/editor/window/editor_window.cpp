// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/editor/window/editor_window.h"

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "io/journal/journal.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

void pause(int milliseconds)
{
    std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
}

void EditorWindow::SetUp()
{
    if (display_.name().empty())
        GTEST_SKIP() << "Xvfb is not installed";
}

InChild EditorWindow::on_display() const
{
    return [this]
    {
        ::setenv("DISPLAY", display_.name().c_str(), 1);
        ::unsetenv("WAYLAND_DISPLAY");
        ::setenv("XDG_STATE_HOME", folder_.path().c_str(), 1);
        // The driver of the display leaks, and is unloaded before a sanitizer looks.
        ::setenv("ASAN_OPTIONS", "detect_leaks=0", 1);
    };
}

std::string EditorWindow::bar() const
{
    return folder_.write("bar.obj",
                         obj_text(box_shape({-2, -0.4, -0.4}, {2, 0.4, 0.4}, 12)));
}

Result EditorWindow::play(const std::string& script,
                          const std::vector<std::string>& more) const
{
    const std::string path = folder_.write("script", script);
    std::vector<std::string> arguments = {"--play", path};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_program(CELLWARP_EDITOR_BINARY, arguments, on_display());
}

RunningEditor::RunningEditor(const EditorWindow& window, const std::string& model,
                             const std::string& layout)
    : window_(window), program_(installed("xdotool"))
{
    if (program_.empty())
        return;
    std::filesystem::remove_all(window.file("cellwarp"));
    if (const std::string chooser = installed("setxkbmap"); !chooser.empty())
        run_program(chooser, {"-display", window.display(), layout});
    process_ = ::fork();
    if (process_ == 0)
    {
        window.on_display()();
        ::execl(CELLWARP_EDITOR_BINARY, "cellwarp-editor", model.c_str(), nullptr);
        ::_exit(99);
    }
    xdotool(
        {"search", "--sync", "--name", std::filesystem::path(model).filename().string()});
}

RunningEditor::~RunningEditor()
{
    if (process_ <= 0)
        return;
    ::kill(process_, SIGKILL);
    wait_for(process_);
}

void RunningEditor::xdotool(const std::vector<std::string>& arguments) const
{
    const Result result = run_program(program_, arguments, window_.on_display());
    EXPECT_EQ(result.code, 0) << arguments.front() << ": " << result.err;
}

void RunningEditor::type(const std::vector<std::string>& names) const
{
    for (const std::string& name : names)
        xdotool({"key", name});
}

void RunningEditor::key(int number, const std::vector<std::string>& modifiers) const
{
    std::vector<std::string> words;
    for (const std::string& modifier : modifiers)
        words.insert(words.end(), {"keydown", modifier});
    words.insert(words.end(), {"key", std::to_string(number)});
    for (const std::string& modifier : modifiers)
        words.insert(words.end(), {"keyup", modifier});
    xdotool(words);
}

void RunningEditor::click(Place place) const
{
    xdotool(
        {"mousemove", std::to_string(place.x), std::to_string(place.y), "click", "1"});
}

void RunningEditor::drag(Place from, Place to) const
{
    std::vector<std::string> words;
    const auto move_to = [&](int x, int y) {
        words.insert(words.end(), {"mousemove", std::to_string(x), std::to_string(y)});
    };
    move_to(from.x, from.y);
    words.insert(words.end(), {"mousedown", "1"});
    // By two sides: a lasso encloses something, too.
    move_to(to.x, from.y);
    move_to(to.x, to.y);
    words.insert(words.end(), {"mouseup", "1"});
    xdotool(words);
}

RunningEditor::Place RunningEditor::tool(int number) const
{
    return {27, 54 + 51 * number};
}

void RunningEditor::send(int signal) const
{
    ::kill(process_, signal);
}

std::string RunningEditor::journal() const
{
    std::error_code none;
    for (const auto& entry :
         std::filesystem::directory_iterator(window_.file("cellwarp/journals"), none))
        return entry.path().string();
    return "";
}

void RunningEditor::wait_for_edits(int count) const
{
    const auto num_there = [&]
    {
        const std::string path = journal();
        const std::string bytes = path.empty() ? "" : bytes_of(path);
        int found = 0;
        for (std::size_t at = 0; (at = bytes.find("\"name\":", at)) != bytes.npos; ++at)
            ++found;
        return found;
    };
    for (int k = 0; k < 300 && num_there() < count; ++k)
        pause(100);
}

std::vector<std::string> RunningEditor::edits(int count)
{
    wait_for_edits(count);
    pause(300); // one too many would come now
    ::kill(process_, SIGKILL);
    wait_for(process_);
    process_ = -1;
    std::vector<std::string> records;
    if (journal().empty())
        return records;
    JournalContents contents;
    const Journal left = Journal::open(journal(), contents);
    for (const std::uint64_t start : contents.starts)
        records.push_back(left.read(start));
    return records;
}

int RunningEditor::wait_for_end()
{
    const auto has_ended = [&]
    {
        siginfo_t info = {};
        return ::waitid(P_PID, static_cast<id_t>(process_), &info,
                        WEXITED | WNOHANG | WNOWAIT) == 0 &&
               info.si_pid == process_;
    };
    for (int k = 0; k < 100 && !has_ended(); ++k)
        pause(200);
    ::kill(process_, SIGKILL);
    return wait_for(std::exchange(process_, -1));
}

} // namespace cellwarp::core::support
