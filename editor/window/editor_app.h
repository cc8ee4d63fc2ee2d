// SPDX-License-Identifier: GPL-3.0-or-later
// What stands in the window: the opened document with the hand on it, what the user wants
// to see, and the questions that are open. Panels read it and call its commands; errors
// are caught here, in one place.
#pragma once

#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "editor/document/editing.h"
#include "editor/tools/interaction.h"
#include "editor/window/canvas.h"
#include "editor/window/film.h"
#include "editor/window/frame_times.h"
#include "editor/window/layout.h"
#include "editor/window/live_flesh.h"
#include "editor/window/places.h"

namespace cellwarp::core
{

/// The part of the window that a message concerns.
enum class Place
{
    Window,
    Regions,
    Cells,
    Field,
    Solver
};

/// What a command had to say.
struct Notice
{
    std::string text;
    Place place = Place::Window;
    bool is_error = false;
    double until = 0.0; ///< [s] of seconds_now()
};

/// Seconds of a clock that only goes forwards.
double seconds_now();

struct OpenedDocument
{
    explicit OpenedDocument(Document document)
        : editing(std::move(document)), hand(editing)
    {
    }
    Editing editing;
    Interaction hand;
    std::unique_ptr<Film> film; ///< that is played; null: none
    double film_begin = 0.0;    ///< [s] of seconds_now(), of its frame 0
    std::int64_t film_frame = 0;
    bool film_stands = false;                          ///< at that frame
    bool film_told = false;                            ///< what is wrong with it
    std::unique_ptr<LiveFlesh> live;                   ///< flesh in real time; null: none
    std::shared_ptr<const ShownShape> live_shown = {}; ///< of it, last
};

/// What a file is chosen for.
enum class Choosing
{
    Open,
    SaveAs,
    ExportModel,
    ExportField
};

/// What waits for the answer whether changes are to be saved.
enum class Leaving
{
    No,
    ToOpen, ///< another file: next_path
    ToClose,
    ToQuit
};

class EditorApp
{
public:
    /// \p keeps_journals: also the list of recent files
    explicit EditorApp(bool keeps_journals);

    /// Begins to read a file; it is there when update() has seen the end. What is open
    /// stays until then.
    void open(const std::string& path);
    /// The same, after the question about unsaved changes.
    void ask_to_open(const std::string& path);
    void ask_to_close();
    void ask_to_quit();
    /// Goes on with what waited for the question; may save first.
    void leave(bool saves);
    void stay() { leaving = Leaving::No; }

    /// Once a frame, before anything is drawn. True if there is something new to see.
    bool update();
    /// Reads nothing and solves nothing.
    bool is_idle() const;
    /// Waits until a file that is being read is there. Throws Error.
    void finish_opening();
    bool is_opening() const { return opening_.valid(); }
    const std::string& opening_path() const { return opening_path_; }

    OpenedDocument* opened() { return opened_.get(); }
    const OpenedDocument* opened() const { return opened_.get(); }
    Document& document() { return opened_->editing.document(); }

    /// There is a document, nothing of it is in the hand, and no other file is being
    /// read.
    bool takes_edits() const;

    /// Ends the document's journal, saved or not.
    void close();
    /// The same where nobody can be asked any more: the document's own scene is saved if
    /// that is possible without a question, and else the next time goes on with the
    /// edits.
    void end_session();

    /// Runs a command; an error becomes a notice at \p place. False: it did not happen.
    bool attempt(Place place, const std::function<void()>& command);
    /// Runs what happens by itself, time and again: what it throws becomes a notice, and
    /// an older one stays.
    bool guard(const std::function<void()>& work, Place place = Place::Window);
    void say(Place place, const std::string& text, bool is_error = false);
    const Notice* notice(Place place) const; ///< null: none

    void save(); ///< or asks where to, or whether to overwrite another program's changes
    /// The answers to that: overwrite, save under another name, neither.
    void overwrite();
    void save_elsewhere();
    void cancel_save();
    /// Asks for a file to write what is seen, or its field, into; a film is held at its
    /// frame. Where it cannot be written a notice says why.
    void choose_export(Choosing what);
    /// Begins to write the document's field; its end becomes a notice. Throws Error.
    void export_field(const std::string& path, Overwrite overwrite);
    /// Plays the scene in time, from its start; or goes back to what is edited.
    void play();
    void stop_playing(); ///< what is live, too
    /// Whether the flesh of the document's scene can follow in real time.
    bool can_live() const;
    /// Flesh follows its bones from now on, in real time; they can be taken by the hand.
    void live();
    /// To a frame that is made; \p stands: and stays there.
    void show_film_frame(std::int64_t frame, bool stands);
    void undo();
    void redo();
    std::string title() const;

    ViewOptions view;
    PanelWish panel;
    FrameTimes frame_times;
    RecentFiles recent;
    std::optional<Choosing> choosing; ///< a file is asked for
    Leaving leaving = Leaving::No;
    std::string next_path;
    bool asks_to_recover = false;
    std::string asks_to_overwrite; ///< what another program has changed; empty: nothing
    bool shows_keys = false;
    bool wants_to_quit = false;
    /// A file was saved by the question's answer: then go on with what waited.
    bool leaves_when_saved = false;

private:
    void take_document(Document document);
    void tell_of_export();
    bool follow_film();
    bool follow_live();

    std::string journal_folder_;
    std::unique_ptr<OpenedDocument> opened_;
    std::future<Document> opening_;
    std::string opening_path_;
    std::optional<Notice> notice_;
    bool is_exporting_ = false; ///< and has not told its end
};

} // namespace cellwarp::core
