// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/field_export.h"

#include <mutex>
#include <new>
#include <thread>
#include <utility>

#include "io/base/error.h"
#include "io/formats/field_file.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

struct FieldExport::State
{
    std::shared_ptr<const GeometryFile> model;
    HandleFile handles;
    SessionSettings settings;
    std::string path;
    Overwrite overwrite;
    std::stop_source stop;

    mutable std::mutex mutex;
    ExportStatus status;

    std::jthread thread; // the last: it ends before what it works on goes

    template <class Change>
    void tell(Change&& change)
    {
        const std::lock_guard lock(mutex);
        change(status);
    }

    void write()
    {
        const StopOnRequest scope(stop.get_token());
        Session session(geometry_of(std::move(model)), std::move(handles),
                        std::move(settings));
        for (std::size_t left = session.num_upcoming(); left > 0; --left)
        {
            session.next_frame(left == 1);
            tell([](ExportStatus& s) { ++s.frames_done; });
        }
        const std::string bytes = field_bytes(session.field_file());
        check_stop();
        write_file(path, bytes, overwrite);
    }

    void fail(const char* before, const char* what) noexcept
    {
        const std::lock_guard lock(mutex);
        status.state = ExportStatus::State::Failed;
        try
        {
            status.error = before;
            status.error += what;
        }
        catch (const std::bad_alloc&)
        {
            status.error.clear();
        }
    }

    void run() noexcept
    {
        try
        {
            write();
            tell([](ExportStatus& s) { s.state = ExportStatus::State::Written; });
        }
        catch (const Stopped&)
        {
            tell([](ExportStatus& s) { s.state = ExportStatus::State::Cancelled; });
        }
        catch (const Error& error)
        {
            fail("", error.what());
        }
        catch (const std::bad_alloc&)
        {
            fail("", "out of memory: fewer cells need less");
        }
        catch (const std::exception& error)
        {
            fail("internal error: ", error.what());
        }
    }
};

FieldExport::FieldExport(std::shared_ptr<const GeometryFile> model, HandleFile handles,
                         SessionSettings settings, std::string path, Overwrite overwrite)
    : state_(std::make_unique<State>())
{
    check_output(path, overwrite);
    State& s = *state_;
    s.status.state = ExportStatus::State::Working;
    s.status.path = path;
    for (const Stage& stage : handles.stages)
        s.status.frames += stage.frames.size();
    s.model = std::move(model);
    s.handles = std::move(handles);
    s.settings = std::move(settings);
    s.settings.keeps_fields = true;
    s.path = std::move(path);
    s.overwrite = overwrite;
    s.thread = std::jthread([&s] { s.run(); });
}

FieldExport::~FieldExport()
{
    cancel();
}

void FieldExport::cancel()
{
    state_->stop.request_stop();
}

ExportStatus FieldExport::status() const
{
    const std::lock_guard lock(state_->mutex);
    return state_->status;
}

} // namespace cellwarp::core
