// SPDX-License-Identifier: GPL-3.0-or-later
// Shapes and edits in memory, and errors, for tests of the interface: no room is behind
// them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <cellwarp/cellwarp.h>
#include <gtest/gtest.h>

namespace cellwarp::support
{

/// A closed bar of quads, 1 x 1 x 5, cut into \p across parts along its short sides and
/// five times as many along the long one.
struct Bar
{
    std::vector<std::array<double, 3>> samples;
    std::vector<std::array<std::uint32_t, 4>> faces;

    explicit Bar(int across = 4);
    operator ShapeView() const
    {
        ShapeView shape;
        shape.samples = samples;
        shape.faces = faces;
        return shape;
    }
};

/// The lower end is held, the upper one turned by \p degrees.
Edit bend(double degrees = 45.0);

/// Cells that are soon made.
Settings coarse();

/// Runs the action, expects an Error of this fault, and gives its text.
template <class Action>
std::string error_of(Fault fault, Action&& action)
{
    try
    {
        action();
    }
    catch (const Error& error)
    {
        EXPECT_STREQ(fault_name(error.fault()), fault_name(fault)) << error.what();
        return error.what();
    }
    ADD_FAILURE() << "no error was thrown";
    return {};
}

inline bool contains(const std::string& text, const std::string& part)
{
    return text.find(part) != std::string::npos;
}

inline std::vector<double> numbers(std::span<const double> of)
{
    return {of.begin(), of.end()};
}

} // namespace cellwarp::support
