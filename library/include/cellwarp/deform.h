// SPDX-License-Identifier: GPL-3.0-or-later
// One edit from beginning to end: a model and statements in, places out.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <cellwarp/control.h>
#include <cellwarp/edit.h>
#include <cellwarp/export.h>
#include <cellwarp/model.h>
#include <cellwarp/report.h>
#include <cellwarp/settings.h>

namespace cellwarp
{

/// The samples of a model, deformed. Cheap to copy, never changes, and outlives the
/// session that made it.
class CELLWARP_API Deformed
{
public:
    /// Three numbers for each sample of the model, in their order [model unit].
    std::span<const double> samples() const;
    /// Three numbers for each normal of the model, of unit length: one for each sample,
    /// or one for each corner, as they were given. With a model that was read: one for
    /// each pair of a normal and a sample that the file uses, in their order.
    std::span<const double> normals() const;
    std::span<const double> tangents() const;
    std::span<const double> rotations() const; ///< four numbers each, w x y z

private:
    friend struct Access;
    struct Data;
    explicit Deformed(std::shared_ptr<const Data> data);
    std::shared_ptr<const Data> data_;
};

struct Result
{
    Deformed deformed; ///< after the last frame
    std::vector<FrameReport> frames;
    std::vector<RodReport> rods;    ///< after the last frame
    std::vector<PosedJoint> joints; ///< of the skeleton, after the last frame
    std::vector<std::string> warnings;

    /// Whether all frames have converged. A result that has not is one all the same, and
    /// a warning has the reason.
    CELLWARP_API bool is_converged() const;
};

/// Solves all frames of \p edit, one after the other. The result is a function of model,
/// edit and settings alone, to the bit, for every number of threads; `cellwarp deform`
/// writes the same. Throws Fault::Usage for settings out of range, Fault::Malformed for
/// statements that do not fit the model, Fault::Budget, Fault::Unsolvable,
/// Fault::Stopped.
CELLWARP_API Result deform(const Model& model, const Edit& edit,
                           const Settings& settings = {}, const Control& control = {});

/// Nothing unless every edge of the mesh has exactly two, opposite faces.
CELLWARP_API std::optional<Volume> volume_of(const Model& model,
                                             const Deformed& deformed);
/// Nothing for clouds, in a build without "cgal", and for triangles that are too crammed
/// to count.
CELLWARP_API std::optional<SelfIntersections>
self_intersections_of(const Model& model, const Deformed& deformed,
                      const Control& control = {});

enum class Overwrite
{
    No, ///< a file that is there is Fault::File
    Yes
};
/// Writes a model with its samples in place, complete or not at all. A model that was
/// read keeps its file's other bytes if \p path has the file's extension; else, and for a
/// model made in memory, the file is plain geometry: .obj, .ply, .off, .stl or .xyz.
/// Throws Fault::Usage, Fault::File, Fault::Malformed for values that the file's numbers
/// cannot hold.
CELLWARP_API void write(const std::string& path, const Model& model,
                        const Deformed& deformed, Overwrite overwrite = Overwrite::No);
/// The same of a model as it is.
CELLWARP_API void write(const std::string& path, const Model& model,
                        Overwrite overwrite = Overwrite::No);

} // namespace cellwarp
