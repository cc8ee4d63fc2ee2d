// SPDX-License-Identifier: GPL-3.0-or-later
// A model with a deformation in place, as files: the model's own format, patched, or
// plain geometry of another where that can only be read, or another is asked for.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "io/base/bytes.h"
#include "io/base/output_set.h"
#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Whether a model may be written in another format than its own, as plain geometry.
enum class Conversion
{
    Never,
    IfAsked, ///< with --convert, which is not there
    Yes
};

/// Throws Fault::Usage unless a model of \p format may be written under this name.
void check_output_format(const std::string& output, const std::string& format,
                         Conversion conversion = Conversion::Never);

/// Whether write_geometry() writes it anew: it can only be read, or the name asks for
/// another format.
bool is_written_plain(const std::string& output, const std::string& format);

/// Of what the model's samples and faces carry, what is not in a file of this name: plain
/// geometry, or a mesh that moves (.glb). Nothing is missing in a cache of points (.pc2,
/// .mdd), which belongs to the model. \p has_texture: texture coordinates were found.
std::vector<std::string> left_out(const std::string& output, const Geometry& geometry,
                                  bool has_texture);

/// The same as a warning; empty: nothing is.
std::string left_out_note(const std::string& output, const Geometry& geometry,
                          bool has_texture);

/// Throws what write_geometry() would throw, before any work is done for it; also for
/// files that it writes beside \p output.
void check_geometry_output(const std::string& output, const GeometryFile& model,
                           Overwrite overwrite);

/// Adds \p model with \p patch in place to \p outputs, which the caller commits: what
/// stands beside it first, then the file. Gives the number of normals that were split,
/// see patched().
std::size_t write_geometry(const std::string& output, const GeometryFile& model,
                           const DeformedSamples& patch, OutputSet& outputs);
/// The same, committed.
std::size_t write_geometry(const std::string& output, const GeometryFile& model,
                           const DeformedSamples& patch, Overwrite overwrite);

} // namespace cellwarp::core
