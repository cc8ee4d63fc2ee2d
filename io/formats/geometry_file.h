// SPDX-License-Identifier: GPL-3.0-or-later
// Geometry files of any format, whole. Saving patches the numbers that changed; every
// other byte of the file passes through untouched.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "io/base/error.h"
#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// The formats that can be read and written, by lower-case extension.
bool is_geometry_format(std::string_view extension);

/// The error for a path whose extension is no geometry format.
Error unknown_format(const std::string& path);

/// Reads and checks the file whole. Throws Fault::File or Fault::Malformed; an
/// unknown extension is Fault::Usage.
GeometryFile read_geometry(const std::string& path, const ReadOptions& options = {});

/// The same for bytes that are already in memory; \p path names them.
GeometryFile scan_geometry(std::string path, std::string bytes,
                           const ReadOptions& options = {});

/// The file's bytes with \p patch in place. A number whose value does not change
/// keeps its bytes. Where the uses of one OBJ direction end more than 1e-6 apart
/// it is split: new vn lines at the end, and only those corners' index changes.
/// Throws Fault::Malformed if a value does not fit its stored type.
std::string patched(const GeometryFile& file, const DeformedSamples& patch);

/// Takes bytes in their order.
using BytesSink = std::function<void(std::string_view)>;

/// Hands patched() to \p write in pieces of about \p bytes_at_once bytes (packed formats
/// in one). Gives the number of OBJ directions that were split.
std::size_t write_patched(const GeometryFile& file, const DeformedSamples& patch,
                          const BytesSink& write,
                          std::uint64_t bytes_at_once = std::uint64_t(1) << 20);

} // namespace cellwarp::core
