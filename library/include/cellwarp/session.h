// SPDX-License-Identifier: GPL-3.0-or-later
// An edit frame by frame, whose statements may change on the way: for animations, undo
// and editors.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <cellwarp/deform.h>
#include <cellwarp/field.h>

namespace cellwarp
{

/// Boxes of cells.
struct Cells
{
    /// Eight corners for each cell, three numbers each [model unit]. Corner k lies at the
    /// upper end of axis a if bit a of k is set.
    std::vector<double> corners;
    std::vector<std::int32_t> regions; ///< number in Edit::regions(); -1: none
    std::vector<std::int32_t> depths;  ///< splits below the coarsest cells
};

/// One thread at a time; several sessions may work at once. Results are those of a new
/// session with the same arguments, to the bit, whatever came before.
class CELLWARP_API Session
{
public:
    /// Makes the first cells and checks the statements against the model. Throws as
    /// deform() does.
    Session(Model model, Edit edit, Settings settings = {}, const Control& control = {});
    Session(Session&&) noexcept;
    Session& operator=(Session&&) noexcept;
    ~Session();

    const Model& model() const;
    const Edit& edit() const;
    const Settings& settings() const;

    /// Solves the next frame; false: none is left. \p wants_samples: the samples move
    /// too, at the cost of a field. Throws as deform() does; the session is then as
    /// before.
    bool next(bool wants_samples = true, const Control& control = {});
    std::optional<std::int64_t> upcoming() const; ///< frame that next() solves
    std::size_t num_upcoming() const;
    /// Changes the statements: frames that both edits have in common are not solved
    /// again. Throws as the constructor does; the session then has no frame to solve
    /// until the next set_edit().
    void set_edit(Edit edit, const Control& control = {});

    /// After the last frame that wanted samples; before, at rest.
    Deformed deformed() const;
    /// Of the frames up to here, one each.
    const std::vector<FrameReport>& frames() const;
    const std::vector<std::string>& warnings() const;
    std::vector<RodReport> rods() const;
    std::vector<PosedJoint> joints() const;
    /// Middle of the glue around each region at rest [model unit], which About::Border
    /// turns about; regions without glue are left out.
    std::map<std::string, Vec3> borders() const;
    /// The map of space of all commits and the last frame. Throws Fault::Usage unless
    /// that frame wanted samples.
    Field field() const;
    Cells cells() const; ///< after the last frame

private:
    friend struct Access;
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp
