// SPDX-License-Identifier: GPL-3.0-or-later
// The shape that an edit bends: samples, and faces if it has any. A value that is cheap
// to copy and never changes; any number of sessions, fields and threads may share one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <cellwarp/control.h>
#include <cellwarp/export.h>
#include <cellwarp/points.h>

namespace cellwarp
{

/// A shape in the caller's memory.
struct ShapeView
{
    /// Places [model unit]; finite, within 1e150. Order and number are kept: result i is
    /// sample i. Samples may coincide, and belong to no face.
    PointsView samples;
    /// Polygons; none: the shape is a cloud. Meshes may be open, have loose triangles,
    /// several parts, faces that touch, and edges of more than two faces.
    FacesView faces = {};
    /// Normals that turn with the shape: one for each sample, or one for each corner.
    PointsView normals = {}, corner_normals = {};
    PointsView tangents = {};       ///< one for each sample
    QuaternionsView rotations = {}; ///< one for each sample, as Gaussian splats have
    /// Lines from sample to sample, as a flat drawing has.
    std::span<const std::array<std::uint32_t, 2>> lines = {};
    /// Ranges of faces with a name for Selector::group(): the first one, and the one
    /// behind the last.
    struct Group
    {
        std::string name;
        std::size_t first_face = 0, end_face = 0;
    };
    std::vector<Group> groups = {};
};

struct Box
{
    Vec3 low{}, high{};
};

struct ReadSettings
{
    /// Meaning of the columns of text without a header, such as "x y z nx ny nz"; empty:
    /// it is guessed (docs/formats.md).
    std::string columns = {};
    /// Limit of the process [byte]; 0: 70 % of the memory that is free; infinity: none.
    double max_memory = 0.0;
};

class CELLWARP_API Model
{
public:
    /// Copies the arrays: 24 bytes a sample, 4 a corner. Throws Fault::Usage for arrays
    /// whose counts do not fit together, and Fault::Malformed with the first wrong number
    /// as its field: "samples[7][1]", "faces[17][2]".
    explicit Model(const ShapeView& shape);
    /// Reads a geometry file (docs/formats.md). Throws Fault::Usage for an extension that
    /// is not known, Fault::File, Fault::Malformed, Fault::Budget, Fault::Stopped.
    static Model read(const std::string& path, const ReadSettings& settings = {},
                      const Control& control = {});

    std::size_t num_samples() const;
    std::size_t num_faces() const;
    /// Three numbers for each sample, in their order; valid as long as the model.
    std::span<const double> samples() const;
    std::span<const std::uint32_t> corners() const; ///< of the faces, one after another
    std::vector<std::uint64_t> face_ends() const;   ///< see FacesView::ends
    /// Normals that a result has, see Deformed::normals().
    std::size_t num_normals() const;
    Box box() const;          ///< of the samples [model unit]
    double diagonal() const;  ///< of the box; lengths of settings are shares of it
    std::string path() const; ///< empty: made in memory
    const std::vector<std::string>& warnings() const; ///< of reading the file

private:
    friend struct Access;
    struct Data;
    explicit Model(std::shared_ptr<const Data> data);
    std::shared_ptr<const Data> data_;
};

/// Boxes around the ends of limbs, the largest first, in shares of Model::box(); at most
/// \p most. Throws Fault::Unsolvable for a shape without limbs, Fault::Stopped.
CELLWARP_API std::vector<Box> extremities_of(const Model& model, std::size_t most = 12,
                                             const Control& control = {});

} // namespace cellwarp
