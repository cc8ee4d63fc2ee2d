// SPDX-License-Identifier: GPL-3.0-or-later
// How far two handle files say the same: a fingerprint of each statement with all that
// stand before it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "io/scene/handle_file.h"

namespace cellwarp::core
{

/// A place in a handle file: so many frames of this stage are done.
struct ScriptPlace
{
    std::size_t stage = 0, frame = 0;
    auto operator<=>(const ScriptPlace&) const = default;
};

/// Fingerprints of 64 bits: equal ones mean equal statements. Where lines stand does not
/// count.
class ScriptFingerprint
{
public:
    ScriptFingerprint() = default;
    explicit ScriptFingerprint(const HandleFile& handles);

    /// before() of a file's first stage.
    static std::uint64_t before_first(bool is_relative);
    /// before() of the stage after one: of that stage alone once its own is known.
    static std::uint64_t before_next(std::uint64_t before, const Stage& stage);

    std::size_t num_stages() const { return stages_.size(); }
    /// Of what comes before a stage: its rest shape follows from it.
    std::uint64_t before(std::size_t stage) const { return stages_[stage].before; }
    /// Of everything up to a place, the regions of its stage included.
    std::uint64_t up_to(const ScriptPlace& place) const
    {
        return stages_[place.stage].after[place.frame];
    }
    bool has(const ScriptPlace& place) const
    {
        return place.stage < stages_.size() &&
               place.frame < stages_[place.stage].after.size();
    }

private:
    struct StageFingerprints
    {
        std::uint64_t before = 0;
        std::vector<std::uint64_t> after; ///< of the regions, then of each frame
    };
    std::vector<StageFingerprints> stages_;
};

} // namespace cellwarp::core
