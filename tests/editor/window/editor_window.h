// SPDX-License-Identifier: GPL-3.0-or-later
// The editor on a display of the test's own: played from a file, or started as a user
// does and sent events by xdotool.
#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/editor/window/display.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace cellwarp::core::support
{

void pause(int milliseconds);

class EditorWindow : public testing::Test
{
public:
    InChild on_display() const;
    std::string file(const std::string& name) const { return folder_ / name; }
    const std::string& display() const { return display_.name(); }
    /// A bar along x; its front view shows its length.
    std::string bar() const;
    Result play(const std::string& script,
                const std::vector<std::string>& more = {}) const;

protected:
    void SetUp() override;

    Display display_;
    Folder folder_;
};

/// Number of the key of digit 0 in X; that of 1 follows and so on, 0 itself comes last.
constexpr int kDigit = 9;

/// The editor with a model, in a window of 1400 x 900 pixels at the display's corner,
/// with a state folder that has no journals of earlier ones.
class RunningEditor
{
public:
    struct Place
    {
        int x, y;
    };

    RunningEditor(const EditorWindow& window, const std::string& model,
                  const std::string& layout = "us");
    ~RunningEditor();
    RunningEditor(const RunningEditor&) = delete;
    RunningEditor& operator=(const RunningEditor&) = delete;

    bool is_there() const { return process_ > 0; } ///< false: xdotool is not installed

    /// Keys by their names: "alt+1", "Return".
    void type(const std::vector<std::string>& names) const;
    /// A key by its number, wherever its letter is on the layout.
    void key(int number, const std::vector<std::string>& modifiers = {}) const;
    void click(Place place) const;
    void drag(Place from, Place to) const;
    /// The middle of a tool's button, from 0.
    Place tool(int number) const;
    /// A signal; between SIGSTOP and SIGCONT it does nothing, and finds afterwards what
    /// has come meanwhile.
    void send(int signal) const;
    /// Until the journal has so many edits.
    void wait_for_edits(int count) const;
    /// The same, then ends the editor without a word to it, and gives the records of the
    /// journal: edits as JSON, "at N" after undo and redo.
    std::vector<std::string> edits(int count);
    int wait_for_end();

private:
    void xdotool(const std::vector<std::string>& arguments) const;
    std::string journal() const;

    const EditorWindow& window_;
    std::string program_;
    int process_ = -1;
};

} // namespace cellwarp::core::support
