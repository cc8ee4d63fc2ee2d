// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/editor_app.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <filesystem>
#include <new>
#include <utility>

#include "editor/window/film.h"
#include "io/base/error.h"
#include "octree/base/clock.h"

namespace cellwarp::core
{

namespace
{

/// How long a notice stays [s]; errors longer.
constexpr double kNoticeSeconds = 6.0;
constexpr double kErrorSeconds = 20.0;

std::string name_of(const std::string& path)
{
    return std::filesystem::path(path).filename().string();
}

} // namespace

double seconds_now()
{
    return seconds_since({});
}

EditorApp::EditorApp(bool keeps_journals)
    : recent(keeps_journals ? state_folder() : ""),
      journal_folder_(keeps_journals ? state_folder() : "")
{
    if (!journal_folder_.empty())
    {
        journal_folder_ += "/journals";
        std::error_code failure;
        std::filesystem::create_directories(journal_folder_, failure);
        if (failure)
            journal_folder_.clear();
    }
}

void EditorApp::open(const std::string& path)
{
    if (is_opening())
        return say(Place::Window, "Another file is being read");
    notice_.reset();
    opening_path_ = path;
    // What is open takes no edits from here on: they would be lost unasked.
    if (opened_ != nullptr)
        opened_->hand.focus_lost();
    // The journal of what is open is locked for it; the same file is opened again only
    // when it is free.
    if (opened_ != nullptr && (is_same_path(document().path(), path) ||
                               (!document().scene_path().empty() &&
                                is_same_path(document().scene_path(), path))))
        close();
    opening_ = std::async(std::launch::async, [path, folder = journal_folder_]
                          { return Document(path, folder); });
}

void EditorApp::finish_opening()
{
    if (!is_opening())
        return;
    take_document(opening_.get());
}

void EditorApp::take_document(Document document)
{
    close();
    opened_ = std::make_unique<OpenedDocument>(std::move(document));
    opened_->hand.look_as(opened_->editing.document().last_view());
    asks_to_recover = opened_->editing.document().num_recoverable() > 0;
    recent.add(opening_path_);
    const std::vector<std::string>& warnings = opened_->editing.document().warnings();
    if (!warnings.empty())
        say(Place::Window, warnings.front());
    else if (!opened_->editing.document().is_saved() && !asks_to_recover)
        say(Place::Window, "Goes on with edits of the last session, which are not saved");
}

void EditorApp::close()
{
    if (opened_ == nullptr)
        return;
    attempt(Place::Window, [&] { document().close(opened_->hand.camera().text()); });
    opened_.reset();
    is_exporting_ = false;
    asks_to_recover = false;
    asks_to_overwrite.clear();
}

void EditorApp::end_session()
{
    if (opened_ == nullptr)
        return;
    stop_playing();
    opened_->hand.focus_lost();
    attempt(Place::Window,
            [&]
            {
                Document& ended = document();
                try
                {
                    if (!ended.is_saved() && !ended.scene_path().empty())
                        ended.save(ended.scene_path());
                }
                catch (const Error&)
                {
                    // The journal has the edits.
                }
                ended.close(opened_->hand.camera().text(), Unsaved::Keep);
            });
    opened_.reset();
}

void EditorApp::ask_to_open(const std::string& path)
{
    next_path = path;
    leaving = Leaving::ToOpen;
    if (opened_ == nullptr || document().is_saved())
        leave(false);
}

void EditorApp::ask_to_close()
{
    leaving = Leaving::ToClose;
    if (opened_ == nullptr || document().is_saved())
        leave(false);
}

void EditorApp::ask_to_quit()
{
    leaving = Leaving::ToQuit;
    if (opened_ == nullptr || document().is_saved())
        leave(false);
}

void EditorApp::leave(bool saves)
{
    if (saves)
    {
        leaves_when_saved = true;
        save();
        if (choosing || !asks_to_overwrite.empty())
            return; // save() has to ask first
        leaves_when_saved = false;
        if (!document().is_saved())
        {
            stay(); // the notice says why
            return;
        }
    }
    const Leaving to = leaving;
    leaving = Leaving::No;
    if (to == Leaving::ToOpen)
        open(next_path);
    if (to == Leaving::ToClose)
        close();
    if (to == Leaving::ToQuit)
    {
        close();
        wants_to_quit = true;
    }
}

bool EditorApp::update()
{
    bool is_new = false;
    if (is_opening() &&
        opening_.wait_for(std::chrono::seconds(0)) == std::future_status::ready)
    {
        const std::string path = opening_path_;
        std::error_code unknown;
        // A file that cannot be read now may be read another time.
        if (!attempt(Place::Window, [&] { finish_opening(); }) &&
            !std::filesystem::exists(path, unknown) && !unknown)
            recent.forget(path);
        is_new = true;
    }
    if (opened_ != nullptr)
    {
        guard([&] { is_new = opened_->editing.update() || is_new; });
        guard([&] { is_new = follow_film() || is_new; });
        guard([&] { is_new = follow_live() || is_new; });
        guard([&] { opened_->hand.update(); });
        tell_of_export();
    }
    if (notice_ && seconds_now() > notice_->until)
    {
        notice_.reset();
        is_new = true;
    }
    return is_new;
}

bool EditorApp::is_idle() const
{
    if (is_opening())
        return false;
    if (opened_ == nullptr)
        return true;
    const SolveStatus::State state = opened_->editing.status().state;
    return (state == SolveStatus::State::Idle || state == SolveStatus::State::Failed) &&
           !opened_->editing.drag_status().is_dragging && !is_exporting_ &&
           !opened_->editing.is_drawing() && !(opened_->film && !opened_->film_stands) &&
           !opened_->live;
}

void EditorApp::choose_export(Choosing what)
{
    if (opened_ == nullptr)
        return;
    const std::string why = what == Choosing::ExportModel
                                ? opened_->editing.why_no_export()
                                : opened_->editing.why_no_field_export();
    if (!why.empty())
        return say(Place::Window, "Cannot be exported now: " + why, true);
    if (opened_->film && opened_->editing.shows_film())
        show_film_frame(opened_->film_frame, true);
    choosing = what;
}

void EditorApp::export_field(const std::string& path, Overwrite overwrite)
{
    opened_->editing.export_field(path, overwrite);
    is_exporting_ = true;
}

void EditorApp::tell_of_export()
{
    const ExportStatus status = opened_->editing.export_status();
    if (!is_exporting_ || status.state == ExportStatus::State::Working)
        return;
    is_exporting_ = false;
    if (status.state == ExportStatus::State::Written)
        say(Place::Window, "Written: " + status.path);
    else if (status.state == ExportStatus::State::Cancelled)
        say(Place::Window, "Cancelled: " + status.path + " is not written");
    else
        say(Place::Window, status.error, true);
}

bool EditorApp::attempt(Place place, const std::function<void()>& command)
{
    if (!guard(command, place))
        return false;
    if (notice_ && notice_->is_error && notice_->place == place)
        notice_.reset();
    return true;
}

bool EditorApp::guard(const std::function<void()>& work, Place place)
{
    try
    {
        work();
        return true;
    }
    catch (const Error& error)
    {
        say(place, error.what(), true);
    }
    catch (const std::bad_alloc&)
    {
        say(place, "out of memory", true);
    }
    catch (const std::exception& error)
    {
        say(place, std::string("internal error: ") + error.what(), true);
    }
    return false;
}

void EditorApp::say(Place place, const std::string& text, bool is_error)
{
    notice_ = Notice{text, place, is_error,
                     seconds_now() + (is_error ? kErrorSeconds : kNoticeSeconds)};
}

const Notice* EditorApp::notice(Place place) const
{
    return notice_ && notice_->place == place ? &*notice_ : nullptr;
}

void EditorApp::save()
{
    if (opened_ == nullptr)
        return;
    if (document().scene_path().empty())
    {
        choosing = Choosing::SaveAs;
        return;
    }
    const auto save_or_ask = [&]
    {
        try
        {
            document().save(document().scene_path());
        }
        catch (const ChangedOnDisk& error)
        {
            asks_to_overwrite = error.what();
        }
    };
    if (attempt(Place::Window, save_or_ask) && asks_to_overwrite.empty())
        say(Place::Window, "Saved " + name_of(document().scene_path()));
}

void EditorApp::overwrite()
{
    asks_to_overwrite.clear();
    const bool leaves = std::exchange(leaves_when_saved, false);
    const std::string path = document().scene_path();
    if (!attempt(Place::Window, [&] { document().save(path, Overwrite::Yes); }))
        return stay(); // the notice says why
    say(Place::Window, "Saved " + name_of(path));
    if (leaves)
        leave(false);
}

void EditorApp::save_elsewhere()
{
    asks_to_overwrite.clear();
    choosing = Choosing::SaveAs;
}

void EditorApp::cancel_save()
{
    asks_to_overwrite.clear();
    leaves_when_saved = false;
    stay();
}

bool EditorApp::takes_edits() const
{
    return opened_ != nullptr && !is_opening() && !opened_->hand.is_busy();
}

void EditorApp::play()
{
    if (!takes_edits() || !Film::is_in(document()))
        return;
    opened_->film = std::make_unique<Film>(opened_->editing);
    opened_->film_begin = seconds_now();
    opened_->film_frame = -1;
    opened_->film_stands = opened_->film_told = false;
}

void EditorApp::stop_playing()
{
    if (!opened_ || (!opened_->film && !opened_->live))
        return;
    opened_->hand.set_puller(nullptr);
    opened_->editing.show_instead(nullptr);
    opened_->film.reset();
    opened_->live.reset();
}

bool EditorApp::can_live() const
{
    if (!opened_)
        return false;
    const SceneFile& scene = std::as_const(opened_->editing).document().scene();
    return scene.has_flesh() && !scene.time.has_objects();
}

void EditorApp::live()
{
    if (!can_live() || !takes_edits())
        return;
    opened_->live = std::make_unique<LiveFlesh>(opened_->editing);
    opened_->hand.set_puller(opened_->live.get());
}

bool EditorApp::follow_live()
{
    OpenedDocument& o = *opened_;
    if (!o.live)
        return false;
    if (const std::string error = o.live->error(); !error.empty())
    {
        say(Place::Window, "live: " + error, true);
        stop_playing();
        return true;
    }
    const std::shared_ptr<const ShownShape> newest = o.live->newest();
    if (!newest || newest == o.live_shown)
        return false;
    o.live_shown = newest;
    o.editing.show_instead(newest);
    return true;
}

void EditorApp::show_film_frame(std::int64_t frame, bool stands)
{
    OpenedDocument& o = *opened_;
    o.film_frame = frame;
    o.film_stands = stands;
    o.film_begin = seconds_now() - static_cast<double>(frame) * o.film->seconds_a_frame();
    o.editing.show_instead(o.film->shape(frame), o.film->deformed(frame));
}

/// The frame whose time it is; where it is not made yet, the last one that is, and time
/// waits for it. At its end it begins anew.
bool EditorApp::follow_film()
{
    OpenedDocument& o = *opened_;
    if (!o.film)
        return false;
    if (const std::string error = o.film->error();
        !error.empty() && !std::exchange(o.film_told, true))
        say(Place::Window, "play: " + error, true);
    const std::int64_t made = o.film->num_made();
    if (made == 0)
    {
        if (!o.film->is_working())
            stop_playing();
        return true;
    }
    if (o.film_stands)
        return false;
    const double now = seconds_now();
    auto frame =
        static_cast<std::int64_t>((now - o.film_begin) / o.film->seconds_a_frame());
    if (frame >= made && o.film->is_working())
    {
        frame = made - 1;
        o.film_begin = now - static_cast<double>(frame) * o.film->seconds_a_frame();
    }
    else if (frame >= made)
    {
        frame = 0;
        o.film_begin = now;
    }
    if (frame == o.film_frame)
        return false;
    o.film_frame = frame;
    o.editing.show_instead(o.film->shape(frame), o.film->deformed(frame));
    return true;
}

void EditorApp::undo()
{
    if (takes_edits() && document().can_undo())
        attempt(Place::Window, [&] { document().undo(); });
}

void EditorApp::redo()
{
    if (takes_edits() && document().can_redo())
        attempt(Place::Window, [&] { document().redo(); });
}

std::string EditorApp::title() const
{
    if (opened_ == nullptr)
        return "cellwarp";
    const Document& document = opened_->editing.document();
    const std::string& path =
        document.scene_path().empty() ? document.path() : document.scene_path();
    return (document.is_saved() ? "" : "● ") + name_of(path) + " — cellwarp";
}

} // namespace cellwarp::core
