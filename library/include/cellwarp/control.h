// SPDX-License-Identifier: GPL-3.0-or-later
// Watching and stopping a call that takes long: the same for every call.
#pragma once

#include <cstddef>
#include <functional>
#include <stop_token>
#include <string>

namespace cellwarp
{

struct Progress
{
    /// Work that is under way: "read", "cells", "solve", "samples", "run", "write".
    std::string phase;
    std::size_t done = 0, all = 0; ///< frames, places or runs; all is 0: not known
    double share = 0.0;            ///< of the whole call, from 0 to 1; never falls
    int iteration = 0;             ///< of the solve
    double gradient = 1.0;         ///< relative; 1: not known yet
    double energy = 0.0;           ///< of the cells [work unit^3]
};

/// Both members are optional.
struct Control
{
    /// A request ends the call with Fault::Stopped, in every phase, within about 50 ms;
    /// only single calls of other libraries take longer (docs/limits.md).
    std::stop_token stop = {};
    /// Called in the thread that made the call, at most every 20 ms. An exception that it
    /// throws ends the call and comes out of it unchanged.
    std::function<void(const Progress&)> watch = {};
};

} // namespace cellwarp
