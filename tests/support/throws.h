// SPDX-License-Identifier: GPL-3.0-or-later
// The error that an action ends in: its fault and its text.
#pragma once

#include <string>

#include <gtest/gtest.h>

#include "io/base/error.h"

namespace cellwarp::core::support
{

/// Runs the action, expects an Error of this fault, gives its message.
template <class Action>
std::string error_of(Fault fault, Action&& action)
{
    try
    {
        action();
    }
    catch (const Error& error)
    {
        EXPECT_EQ(static_cast<int>(error.fault()), static_cast<int>(fault))
            << error.what();
        return error.what();
    }
    ADD_FAILURE() << "no error was thrown";
    return {};
}

inline bool contains(const std::string& text, const std::string& part)
{
    return text.find(part) != std::string::npos;
}

} // namespace cellwarp::core::support
