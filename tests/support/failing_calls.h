// SPDX-License-Identifier: GPL-3.0-or-later
// A disk that fails: calls of the system that the program makes end with "Input/output
// error" from a place on that a test chooses. The linker sends them through here
// (tests/CMakeLists.txt).
#pragma once

#include <gtest/gtest.h>

#include "io/base/error.h"

namespace cellwarp::core::support
{

/// While it lives, calls that open, read, write, rename or remove files, or start
/// processes, are counted; of all threads.
class FailingCalls
{
public:
    enum class How
    {
        Once,  ///< only that one fails
        Onward ///< that one and all after it
    };
    /// \p number from 1.
    FailingCalls(int number, How how);
    ~FailingCalls();
    FailingCalls(const FailingCalls&) = delete;
    FailingCalls& operator=(const FailingCalls&) = delete;
    /// Whether so many calls were made.
    static bool was_reached();
};

/// A file system without what not all have, while it lives.
class LackingCalls
{
public:
    enum class Lacks
    {
        Nothing,
        FlagsOfRename, ///< to replace nothing, or to exchange
        SecondNames    ///< nor has a file several names
    };
    explicit LackingCalls(Lacks lacks);
    ~LackingCalls();
    LackingCalls(const LackingCalls&) = delete;
    LackingCalls& operator=(const LackingCalls&) = delete;
};

/// Repeats prepare(), then work() with its first call failing, then the second, and so on
/// until there are no more; once with this one alone, and once with all after it too. It
/// must end well or with Fault::File; then check(whether it ended well). Gives how often
/// it ended in the error.
template <class Prepare, class Work, class Check>
int with_each_call_failing(Prepare&& prepare, Work&& work, Check&& check)
{
    int errors = 0;
    for (const FailingCalls::How how :
         {FailingCalls::How::Once, FailingCalls::How::Onward})
        for (int number = 1;; ++number)
        {
            SCOPED_TRACE(testing::Message()
                         << "call " << number
                         << (how == FailingCalls::How::Onward ? " and all after" : ""));
            prepare();
            bool is_done = false, was_reached = false;
            {
                const FailingCalls failing(number, how);
                try
                {
                    work();
                    is_done = true;
                }
                catch (const Error& error)
                {
                    EXPECT_EQ(error.fault(), Fault::File) << error.what();
                    ++errors;
                }
                was_reached = FailingCalls::was_reached();
            }
            check(is_done);
            if (!was_reached)
            {
                EXPECT_TRUE(is_done);
                break;
            }
        }
    return errors;
}

} // namespace cellwarp::core::support
