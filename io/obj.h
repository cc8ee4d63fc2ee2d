// SPDX-License-Identifier: GPL-3.0-or-later
// Wavefront OBJ. Positions, normals, faces and groups are read; every other
// statement passes through.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/geometry.h"
#include "io/text.h"

namespace cellwarp
{

/// Reads an OBJ part by part. Face indices are kept as they stand until the end,
/// because a face may come before its vertices.
class ObjScanner
{
public:
    explicit ObjScanner(std::string file) : file_(std::move(file)) {}

    /// Reads the complete statements of \p part, which starts at byte \p start of
    /// the file, into \p out. Returns how many bytes they take.
    std::size_t scan(std::string_view part, std::uint64_t start, bool is_last,
                     Geometry& out);
    /// Checks what only the whole file can tell.
    void finish(Geometry& out);

private:
    void statement(std::string_view line, std::uint64_t start, std::int64_t number,
                   Geometry& out);
    void vertex(Tokens& tokens, std::int64_t line, Geometry& out);
    void normal(Tokens& tokens, std::int64_t line, Geometry& out);
    void face(Tokens& tokens, std::int64_t line, Geometry& out);
    void close_groups(Geometry& out);

    struct Forward ///< an index that pointed past what was read so far
    {
        std::int64_t index, line;
        char kind;
    };
    std::string file_;
    std::string joined_; ///< a statement continued over lines
    std::int64_t lines_ = 0;
    std::int64_t num_texture_ = 0;
    std::vector<Forward> forward_;
    std::vector<std::string> open_groups_;
    std::string object_;
    std::size_t groups_first_face_ = 0;
    std::size_t num_unknown_ = 0;
};

/// New vn lines and index changes where the uses of a direction part company.
struct ObjSplit
{
    std::string lines; ///< to append to the file
    std::size_t num_lines = 0;
    std::vector<std::uint64_t> index_starts; ///< [byte] of the indices to replace
    std::vector<std::uint32_t> new_indices;  ///< 1-based
    std::vector<Eigen::Vector3d> directions; ///< of the original vn statements
};

/// Decides which vn must be split. \p uses and \p values as in Patch.
ObjSplit split_directions(const Geometry& geometry, const std::vector<DirectionUse>& uses,
                          const std::vector<Eigen::Vector3d>& values,
                          std::string_view bytes);

} // namespace cellwarp
