// SPDX-License-Identifier: GPL-3.0-or-later
// A scene in time as the editor plays it: frames made in the background, the same as
// those of `cellwarp simulate`.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "editor/document/editing.h"
#include "library/time/simulation.h"

namespace cellwarp::core
{

/// What is played of a document's values, with the memory that the machine has.
SimulationInput played_input(std::shared_ptr<const GeometryFile> model,
                             const HandleFile& handles, const SceneFile& scene);

class Film
{
public:
    /// Whether a document has something to play: rods that carry its model, or flesh.
    static bool is_in(const Document& document);

    /// Words for the poses that are played if these may differ from the edited ones: the
    /// flesh of a scene follows the keys of its file. Empty: the edited ones are played.
    static std::string poses_of(const Document& document);

    /// Begins to make the frames of a document as it is now. \pre is_in()
    explicit Film(const Editing& editing);
    /// Ends as soon as the step under way allows.
    ~Film();
    Film(const Film&) = delete;
    Film& operator=(const Film&) = delete;

    std::int64_t num_made() const; ///< frames that can be shown, from 0 on
    std::int64_t last() const;     ///< of all; -1: not known yet
    double seconds_a_frame() const;
    bool is_working() const;
    /// Why no more frames come, or what is wrong with those there are; empty: nothing.
    std::string error() const;
    /// The shape of a frame as it is seen. \pre frame < num_made()
    std::shared_ptr<const ShownShape> shape(std::int64_t frame) const;
    /// The samples that `cellwarp simulate` writes of it. \pre frame < num_made()
    std::shared_ptr<const DeformedSamples> deformed(std::int64_t frame) const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
