// SPDX-License-Identifier: GPL-3.0-or-later
// States of a session that it can go back to: the newest ones, and ever fewer of the
// older.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "editor/session/frame_report.h"
#include "editor/session/path.h"
#include "editor/session/recutting.h"
#include "editor/session/rig.h"
#include "editor/session/statement_chain.h"
#include "io/geometry.h"

namespace cellwarp
{

/// What a stage starts from.
struct StageRest
{
    std::size_t stage = 0;
    std::uint64_t print = 0; ///< of all statements before the stage
    Patch samples;           ///< at rest [model unit]
    std::shared_ptr<const RestShape> shape;
};

/// A stage before its first frame.
struct StageStart
{
    std::shared_ptr<const StageRest> rest;
    std::shared_ptr<const RegionSet> regions;
    Units units;
    Recutting recutting; ///< that has made its first cells
};

/// The end of a frame, from which the next one follows to the bit.
struct KeptState
{
    std::uint64_t print = 0; ///< of all statements so far
    ScriptPlace place;
    std::shared_ptr<const StageStart> start;
    Octree octree;
    RigState rig;
    std::vector<std::vector<Step>> steps; ///< a region
    SolveReport last_solve;
    std::optional<FrameReport> report; ///< none before the first frame
    std::vector<std::string> warnings;
    std::size_t frames_done = 0;
};

/// At most kMostStates, and of no more memory than \p most_bytes but for the newest two:
/// with all that they hold, once where several of them share it.
class KeptStates
{
public:
    explicit KeptStates(std::size_t most_bytes = std::size_t(256) << 20)
        : most_bytes_(most_bytes)
    {
    }

    void add(KeptState state);
    /// The latest that \p chain passes through; null: none.
    const KeptState* latest_on(const StatementChain& chain) const;
    std::size_t size() const { return states_.size(); }
    /// Of all of them, about [byte].
    std::size_t bytes() const;

private:
    void thin();

    std::size_t most_bytes_;
    std::vector<KeptState> states_; ///< in the order of their places
};

} // namespace cellwarp
