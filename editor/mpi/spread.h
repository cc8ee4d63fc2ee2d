// SPDX-License-Identifier: GPL-3.0-or-later
// One huge binary PLY moved by several processes, each a share of its bytes.
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "io/base/bytes.h"
#include "io/formats/ply.h"
#include "library/session/deformation.h"

namespace cellwarp::core
{

/// A PLY whose vertices can be found without being read.
class SpreadPly
{
public:
    /// Throws Fault::Usage if it is another PLY; otherwise as read_geometry() does.
    explicit SpreadPly(const std::string& path);

    std::uint64_t num_vertices() const { return vertices_.count; }
    std::uint64_t num_bad_normals() const { return num_bad_normals_; }
    std::uint64_t num_bad_rotations() const { return num_bad_rotations_; }
    std::uint64_t num_missing() const { return num_missing_; }
    /// Writes share \p i of \p count to \p output, at the same places: its vertices
    /// moved, and of all other bytes as large a part. Memory does not grow with it.
    void write_share(std::uint64_t i, std::uint64_t count, const Deformation& deformation,
                     RangeFile& output);

private:
    void move(std::uint64_t first, std::uint64_t end, const Deformation& deformation,
              RangeFile& output);
    void copy(std::uint64_t start, std::uint64_t end, RangeFile& output) const;
    std::string read(std::uint64_t start, std::uint64_t count) const;

    std::string path_;
    InputFile input_;
    PlyScanner scanner_;
    Geometry none_; ///< how numbers are stored
    PlyScanner::Vertices vertices_;
    std::uint64_t num_bad_normals_ = 0, num_bad_rotations_ = 0, num_missing_ = 0;
};

/// Part \p i of \p count of [begin, end).
std::pair<std::uint64_t, std::uint64_t> share_of(std::uint64_t begin, std::uint64_t end,
                                                 std::uint64_t i, std::uint64_t count);

} // namespace cellwarp::core
