// SPDX-License-Identifier: GPL-3.0-or-later
// Edits as values: what changed, both ways, small enough to keep every one of them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "editor/document/selection.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_settings.h"

namespace cellwarp::core
{

/// Samples that are selected where they were not, and the other way round.
struct Toggled
{
    std::vector<SampleRun> runs;
};

/// One region of the current stage: there before, there afterwards.
struct RegionChange
{
    std::size_t index = 0; ///< of its first statement in the stage
    std::vector<RegionStatement> before, after;
};

/// All names of a region of the current stage.
struct Renamed
{
    std::string before, after;
};

/// Frames at the end of the current stage.
struct FramesAdded
{
    std::vector<FrameStatement> frames;
};

/// A commit, and the regions after it.
struct StageAdded
{
    std::vector<RegionStatement> regions;
};

/// All that pins of the current stage stay on.
struct OnsChange
{
    std::vector<OnStatement> before, after;
};

struct SettingsChange
{
    SceneSettings before, after;
};

using Change = std::variant<Toggled, RegionChange, Renamed, FramesAdded, StageAdded,
                            OnsChange, SettingsChange>;

/// One step of undo.
struct Edit
{
    std::string name; ///< what the history list says: "Move head"
    std::vector<Change> changes;
};

/// What edits work on.
struct Edited
{
    HandleFile handles; ///< at least one stage
    SceneSettings settings;
    Selection selection;
};

void apply(const Edit& edit, Edited& edited);
void take_back(const Edit& edit, Edited& edited);

/// As one line of JSON, and back. Throws Fault::Malformed; \p where names the record.
std::string edit_text(const Edit& edit);
Edit parse_edit(std::string_view text, const std::string& where);

} // namespace cellwarp::core
