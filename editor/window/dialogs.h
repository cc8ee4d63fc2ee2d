// SPDX-License-Identifier: GPL-3.0-or-later
// Windows over everything that want an answer: a file, what to do with changes, whether
// to recover. The answers are commands of the app.
#pragma once

#include <string>
#include <vector>

#include "editor/window/editor_app.h"

namespace cellwarp::core
{

/// Lists a folder and lets a path be typed.
class FileDialog
{
public:
    /// Shows itself while the app is choosing.
    void show(EditorApp& app);

private:
    struct Entry
    {
        std::string name;
        bool is_folder = false;
    };

    void begin(EditorApp& app, Choosing choosing);
    void list_folder();
    void show_entries(Choosing choosing);
    bool show_name();
    std::string next_name(int step) const;
    std::string chosen() const;
    /// The file that would be replaced; empty: none.
    std::string in_the_way(Choosing choosing) const;
    void take(EditorApp& app, Choosing choosing, Overwrite overwrite);

    std::optional<Choosing> shown_;
    std::string folder_, listed_, name_;
    std::vector<Entry> entries_;
    std::string failure_;         ///< why the folder cannot be listed
    bool is_taken_ = false;       ///< by a double click, or Enter on an entry
    bool wants_keyboard_ = false; ///< the name, in the next frame
    bool is_stepped_ = false;     ///< the arrows have chosen another entry
    bool saves_poses_ = false;    ///< alone, see SavedPart
};

/// "Save the changes?", "Recover the last session?"
void show_questions(EditorApp& app);

} // namespace cellwarp::core
