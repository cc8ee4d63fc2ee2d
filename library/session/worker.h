// SPDX-License-Identifier: GPL-3.0-or-later
// A thread beside the one that draws: it is asked for something, of which only the newest
// counts, and gives out the newest that it has made.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "octree/base/clock.h"

namespace cellwarp::core
{

/// What the thread does is given to start(), and takes its requests by next() or wait().
/// Everything that both sides use is used in alone(). After start() nothing is allocated
/// but by the values themselves.
template <class Request, class Result>
class Worker
{
public:
    Worker() = default;
    ~Worker() { end(); }
    Worker(const Worker&) = delete;
    Worker& operator=(const Worker&) = delete;

    /// Calls \p work in the thread, once. It must not throw, and what it uses must
    /// outlive end().
    void start(std::function<void()> work) { thread_ = std::jthread(std::move(work)); }

    /// Calls \p use while nobody else uses what is shared. Of this class \p use may call
    /// what stands under "In alone()" and nothing else.
    template <class Use>
    decltype(auto) alone(Use&& use) const
    {
        const std::lock_guard lock(mutex_);
        return use();
    }

    // Of the other side.

    /// Asks for this; a request that has not begun is dropped. \p before(request) is
    /// called in alone().
    template <class Before>
    void ask(Request request, Before&& before)
    {
        {
            const std::lock_guard lock(mutex_);
            before(std::as_const(request));
            asked_ = std::move(request);
        }
        wake_.notify_all();
    }
    void ask(Request request)
    {
        ask(std::move(request), [](const Request&) {});
    }
    /// If there is a result that was not taken: calls \p use(result) in alone(). Returns
    /// whether there was one.
    template <class Use>
    bool take(Use&& use)
    {
        const std::lock_guard lock(mutex_);
        if (!std::exchange(has_result_, false))
            return false;
        use(result_);
        return true;
    }
    /// Asks the thread to end, and waits for it. \p before() is called in alone(): the
    /// thread begins nothing after it.
    template <class Before>
    void end(Before&& before)
    {
        {
            const std::lock_guard lock(mutex_);
            before();
            is_ending_ = true;
        }
        wake_.notify_all();
        if (thread_.joinable())
            thread_.join();
    }
    void end()
    {
        end([] {});
    }

    // In alone().

    bool is_asked() const { return asked_.has_value(); }
    bool has_result() const { return has_result_; } ///< that was not taken
    /// Whether a request has begun, and the next one not.
    bool is_working() const { return is_working_; }
    void forget_request() { asked_.reset(); }
    /// The result for the other side; swaps, so that buffers serve on.
    void give(Result& result)
    {
        std::swap(result_, result);
        has_result_ = true;
    }

    // Of the thread.

    /// Waits for the next request; false at the end. \p begin is called in alone().
    template <class Begin>
    bool next(Request& request, Begin&& begin)
    {
        std::unique_lock lock(mutex_);
        is_working_ = false;
        wake_.wait(lock, [&] { return is_ending_ || asked_; });
        if (is_ending_)
            return false;
        request = std::move(*asked_);
        asked_.reset();
        is_working_ = true;
        begin(request);
        return true;
    }
    bool is_ending() const
    {
        return alone([&] { return is_ending_; });
    }
    /// The request, if there is one.
    bool take_request(Request& request)
    {
        const std::lock_guard lock(mutex_);
        if (!asked_)
            return false;
        request = std::move(*asked_);
        asked_.reset();
        return true;
    }
    /// For a request, the end or a point in time.
    void wait(Clock::time_point until = Clock::time_point::max())
    {
        std::unique_lock lock(mutex_);
        const auto is_awake = [&] { return is_ending_ || asked_; };
        if (until == Clock::time_point::max())
            wake_.wait(lock, is_awake);
        else
            wake_.wait_until(lock, until, is_awake);
    }

private:
    mutable std::mutex mutex_;
    std::condition_variable wake_;
    std::optional<Request> asked_;
    Result result_{};
    bool has_result_ = false, is_working_ = false, is_ending_ = false;
    std::jthread thread_;
};

} // namespace cellwarp::core
