// SPDX-License-Identifier: GPL-3.0-or-later
// Ends work before it is done: on request of another thread, or at a point in time. The
// caller opens a scope on the stack, and what it calls throws Stopped:
//     const StopOnRequest scope(token);
//     session.next_frame(true);
// A scope covers its own thread and the parts that parallel loops run on other threads.
// Loops look at it (parallel.h); long serial code calls check_stop(). Scopes nest: each
// also ends at the condition of the outer ones. Threads do not share scopes, so several
// pieces of work in one process stop independently.
#pragma once

#include <exception>
#include <stop_token>

#include "octree/base/clock.h"

namespace cellwarp::core
{

/// The work was asked to end. What it changes is left as after any other exception.
class Stopped final : public std::exception
{
public:
    const char* what() const noexcept override { return "stopped"; }
};

/// A condition at which the work in a scope ends. \pre destroyed in the thread that made
/// it, in reverse order, as variables on the stack are
class StopScope
{
public:
    StopScope(const StopScope&) = delete;
    StopScope& operator=(const StopScope&) = delete;

    /// The innermost scope of this thread; null: there is none.
    static const StopScope* current();
    /// Throws Stopped if its condition or that of an outer scope is met. Conditions
    /// outside of a StopDeferral do not count.
    void check() const;

    /// Runs the part of a loop on another thread in the scope of the loop.
    class Entered
    {
    public:
        explicit Entered(const StopScope* scope);
        ~Entered();
        Entered(const Entered&) = delete;
        Entered& operator=(const Entered&) = delete;

    private:
        const StopScope* const before_;
    };

protected:
    StopScope();
    ~StopScope();

private:
    friend bool is_stop_requested();
    /// Called from all threads of the work.
    virtual bool is_met() const = 0;
    virtual bool is_deferral() const { return false; }

    const StopScope* const outer_;
};

/// Throws Stopped if a scope of this thread asks for it.
void check_stop();

/// check_stop() once in \p every calls: for serial loops of small steps.
class SparseStopCheck
{
public:
    explicit SparseStopCheck(unsigned every) : every_(every) {}
    void operator()()
    {
        if (++calls_ < every_)
            return;
        calls_ = 0;
        check_stop();
    }

private:
    const unsigned every_;
    unsigned calls_ = 0;
};

/// Whether the work is to end, also inside a StopDeferral. For code that ends in a state
/// of its own instead of throwing.
bool is_stop_requested();

/// Ends the work when another thread asks for it.
class StopOnRequest final : public StopScope
{
public:
    explicit StopOnRequest(std::stop_token stop) : stop_(std::move(stop)) {}

private:
    bool is_met() const override { return stop_.stop_requested(); }

    const std::stop_token stop_;
};

/// Ends the work at a point in time.
class StopAtTime final : public StopScope
{
public:
    explicit StopAtTime(Clock::time_point deadline) : deadline_(deadline) {}

private:
    bool is_met() const override { return Clock::now() > deadline_; }

    const Clock::time_point deadline_;
};

/// Inside it outer scopes do not make anything throw: for work that must be finished, or
/// that asks is_stop_requested() itself.
class StopDeferral final : public StopScope
{
private:
    bool is_met() const override { return false; }
    bool is_deferral() const override { return true; }
};

} // namespace cellwarp::core
