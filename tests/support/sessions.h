// SPDX-License-Identifier: GPL-3.0-or-later
// Sessions played to their end.
#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "library/session/session.h"
#include "tests/support/scripts.h"

namespace cellwarp::core::support
{

/// \p depth: splits below the coarsest cells, by a threshold that small shapes reach.
inline SessionSettings settings(int across, int depth = 0)
{
    SessionSettings s;
    s.cells.across = across;
    s.cells.max_depth = depth;
    if (depth > 0)
        s.cells.threshold = 2e-4;
    return s;
}

/// All frames, each of which converges.
inline Session played(const Shape& shape, const std::string& text,
                      const SessionSettings& s)
{
    Session session(model(shape), handles(text), s);
    while (session.next_frame(true))
        EXPECT_EQ(session.frames().back().solve.stop, Stop::Converged);
    return session;
}

inline double largest_difference(const std::vector<Eigen::Vector3d>& a,
                                 const std::vector<Eigen::Vector3d>& b)
{
    double largest = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i)
        largest = std::max(largest, (a[i] - b[i]).norm());
    return largest;
}

} // namespace cellwarp::core::support
