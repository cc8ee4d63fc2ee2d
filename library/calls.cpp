// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/calls.h"

#include <algorithm>
#include <chrono>
#include <new>
#include <system_error>

#include "io/base/error.h"

namespace cellwarp
{

namespace
{

constexpr auto kBetweenShows = std::chrono::milliseconds(20);

Error public_error(const core::Error& error)
{
    return Error(static_cast<Fault>(error.fault()), error.message(),
                 {error.file(), error.line(), error.field()});
}

} // namespace

Watcher::Watcher(const Control& control)
    : control_(control), next_show_(core::Clock::now() + kBetweenShows)
{
    if (control.stop.stop_possible() || control.watch)
        scope_.emplace(*this);
}

void Watcher::begin(const char* phase, double share)
{
    progress_.phase = phase;
    set_share(share);
    core::check_stop();
}

void Watcher::set_share(double share)
{
    progress_.share = std::clamp(share, progress_.share, 1.0);
}

void Watcher::show()
{
    if (control_.watch && !is_showing_ && core::Clock::now() >= next_show_)
        call_watch();
    if (has_failed_)
        throw core::Stopped();
}

void Watcher::finish()
{
    if (!control_.watch)
        return;
    progress_.share = 1.0;
    call_watch();
    if (has_failed_)
        throw core::Stopped();
}

/// Exceptions of the caller must not pass through loops of other libraries: they are kept
/// until the work has ended.
void Watcher::call_watch() noexcept
{
    is_showing_ = true;
    try
    {
        control_.watch(progress_);
    }
    catch (...)
    {
        failure_ = std::current_exception();
        has_failed_ = true;
    }
    is_showing_ = false;
    next_show_ = core::Clock::now() + kBetweenShows;
}

bool Watcher::is_to_end()
{
    // All but the flag is of the thread of the call.
    if (std::this_thread::get_id() == thread_ && control_.watch && !has_failed_ &&
        !is_showing_ && core::Clock::now() >= next_show_)
        call_watch();
    return has_failed_ || control_.stop.stop_requested();
}

void Watcher::rethrow() const
{
    if (has_failed_)
        std::rethrow_exception(failure_);
    try
    {
        throw;
    }
    catch (const Error&)
    {
        throw;
    }
    catch (const core::Error& error)
    {
        throw public_error(error);
    }
    catch (const core::Stopped&)
    {
        throw Error(Fault::Stopped, "stopped");
    }
    catch (const std::bad_alloc&)
    {
        throw;
    }
    catch (const std::system_error& error)
    {
        if (error.code() == std::errc::resource_unavailable_try_again)
            throw Error(Fault::Budget, std::string("no more threads: ") + error.what());
        throw Error(Fault::File, error.what());
    }
    catch (const std::exception& error)
    {
        throw Error(Fault::Internal, std::string("internal error: ") + error.what());
    }
}

OneThread::OneThread(std::atomic_flag& busy) : busy_(busy)
{
    if (busy_.test_and_set(std::memory_order_acquire))
        throw Error(Fault::Usage, "another call of this object has not ended");
}

OneThread::~OneThread()
{
    busy_.clear(std::memory_order_release);
}

Error wrong_argument(const std::string& field, const std::string& what)
{
    return Error(Fault::Usage, what, {"", 0, field});
}

} // namespace cellwarp
