// SPDX-License-Identifier: GPL-3.0-or-later
// The frame around each call of the interface: it stops and shows progress as the caller
// asks, works with the threads that the caller allows, and throws only what is
// documented.
#pragma once

#include <atomic>
#include <exception>
#include <optional>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>

#include <cellwarp/control.h>
#include <cellwarp/error.h>

#include "octree/base/clock.h"
#include "octree/base/stop_scope.h"
#include "octree/base/thread_share.h"

namespace cellwarp
{

/// Progress of one call, shown to the caller whenever work looks at its stop scope.
class Watcher
{
public:
    explicit Watcher(const Control& control);

    /// Begins a phase; \p share of the call that is done by then.
    void begin(const char* phase, double share);
    Progress& progress() { return progress_; }
    /// The share never falls.
    void set_share(double share);
    /// Shows the progress if it is time to.
    void show();
    /// The end of a call that has succeeded.
    void finish();
    /// Throws the error of the interface for the exception that is being handled.
    [[noreturn]] void rethrow() const;

private:
    /// Asked by the loops of all threads whether they are to end.
    class Scope final : public core::StopScope
    {
    public:
        explicit Scope(Watcher& watcher) : watcher_(watcher) {}

    private:
        bool is_met() const override { return watcher_.is_to_end(); }

        Watcher& watcher_;
    };

    bool is_to_end();
    void call_watch() noexcept;

    const Control& control_;
    const std::thread::id thread_ = std::this_thread::get_id();
    Progress progress_;
    core::Clock::time_point next_show_;
    bool is_showing_ = false;
    std::atomic_bool has_failed_ = false;
    std::exception_ptr failure_; ///< thrown by the caller's watch
    std::optional<Scope> scope_;
};

/// Calls work(watcher) in the frame.
template <class Work>
auto run_call(const Control& control, int threads, Work&& work)
{
    using Value = std::invoke_result_t<Work, Watcher&>;
    Watcher watcher(control);
    try
    {
        if constexpr (std::is_void_v<Value>)
        {
            core::with_threads(threads, [&] { work(watcher); });
            watcher.finish();
        }
        else
        {
            std::optional<Value> result;
            core::with_threads(threads, [&] { result.emplace(work(watcher)); });
            watcher.finish();
            return std::move(*result);
        }
    }
    catch (...)
    {
        watcher.rethrow();
    }
}

/// The same for a call that takes no time.
template <class Work>
auto run_call(Work&& work)
{
    return run_call({}, 0, [&](Watcher&) { return work(); });
}

/// Refuses a second thread that calls an object meanwhile: Fault::Usage.
class OneThread
{
public:
    explicit OneThread(std::atomic_flag& busy);
    ~OneThread();
    OneThread(const OneThread&) = delete;
    OneThread& operator=(const OneThread&) = delete;

private:
    std::atomic_flag& busy_;
};

/// The error for an argument of a call.
Error wrong_argument(const std::string& field, const std::string& what);

} // namespace cellwarp
