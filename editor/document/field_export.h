// SPDX-License-Identifier: GPL-3.0-or-later
// The field of a whole document, written behind the user's back: all of its frames are
// solved again for it.
#pragma once

#include <cstddef>
#include <memory>
#include <string>

#include "io/base/bytes.h"
#include "library/session/session.h"

namespace cellwarp::core
{

/// How far a field is.
struct ExportStatus
{
    enum class State
    {
        None, ///< none was asked for
        Working,
        Written,
        Cancelled, ///< nothing is written
        Failed     ///< see error
    };
    State state = State::None;
    std::string path;
    std::size_t frames_done = 0, frames = 0;
    std::string error;
};

class FieldExport
{
public:
    /// Begins in a thread of its own. \p settings: those of the document, whose frames
    /// \p handles has, at least one. Throws what check_output() throws.
    FieldExport(std::shared_ptr<const GeometryFile> model, HandleFile handles,
                SessionSettings settings, std::string path, Overwrite overwrite);
    /// Cancels; waits for the call in flight.
    ~FieldExport();
    FieldExport(const FieldExport&) = delete;
    FieldExport& operator=(const FieldExport&) = delete;

    void cancel();
    ExportStatus status() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
