// SPDX-License-Identifier: GPL-3.0-or-later
// Bytes that the importer hands to the program that has started it, by `cellwarp-import
// EXTENSION PID`: PID is that program, with which it ends. The file is read from stdin,
// what is found in it is written to stdout.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// What a file holds, or why that cannot be told.
struct Imported
{
    std::string problem;
    std::vector<Eigen::Vector3d> samples, directions;
    std::vector<std::uint32_t> direction_samples, corners;
    std::vector<std::uint64_t> face_ends;
};

/// As bytes, and back; false where they are not whole.
std::string imported_bytes(const Imported& imported);
bool parse_imported(std::string_view bytes, Imported& imported);

} // namespace cellwarp::core
