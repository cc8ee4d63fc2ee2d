// SPDX-License-Identifier: GPL-3.0-or-later
// Wavefront OBJ. Positions, normals, faces, lines and groups are read; every other
// statement passes through.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "io/base/text.h"
#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Reads an OBJ part by part. A face may come before its vertices: whether they are
/// there is told at the end.
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
    friend void
    for_each_obj_statement(std::string_view text,
                           const std::function<void(std::string_view)>& visit);

    void statement(std::string_view line, std::uint64_t start, std::int64_t number,
                   Geometry& out);
    void vertex(Tokens& tokens, std::int64_t line, Geometry& out);
    void normal(Tokens& tokens, std::int64_t line, Geometry& out);
    void face(Tokens& tokens, std::int64_t line, Geometry& out);
    void drawn_line(Tokens& tokens, std::int64_t line, Geometry& out);
    void close_groups(Geometry& out);

    /// The largest of the indices that pointed past what was read so far.
    struct Forward
    {
        std::int64_t index = -1, line = 0;
        const char* field = "face index";
    };
    /// The number of what an index means, from 0. An index counts from 1, or, negative,
    /// back from what was \p read so far. \p line, \p field: where it stands.
    std::uint32_t resolve(std::int64_t index, std::int64_t read, std::int64_t line,
                          const char* field, Forward& forward) const;
    std::uint32_t normal_of(std::int64_t index, std::int64_t read, std::int64_t line);

    std::string file_;
    std::function<void(std::string_view)> visit_; ///< gets all statements; none: read
    std::string joined_;                          ///< a statement continued over lines
    std::int64_t lines_ = 0;
    std::int64_t num_texture_ = 0;
    Forward forward_vertex_, forward_normal_;
    Forward lacking_normal_ = {0, 0}; ///< as the face has it; line 0: none
    std::vector<std::string> open_groups_;
    std::string object_;
    std::size_t groups_first_face_ = 0;
    std::size_t num_unknown_ = 0;
};

/// Calls \p visit with each statement of a whole OBJ, its continued lines joined.
void for_each_obj_statement(std::string_view text,
                            const std::function<void(std::string_view)>& visit);

/// Gives every use of a direction its statement: the first use of a direction keeps the
/// file's own, every other one joins the first statement that is near enough or opens
/// a new one at the end of the file. Near enough is what the file's digits do not tell
/// apart: an exporter gave one rounded statement to directions that differed by as much.
class DirectionSplitter
{
public:
    /// \p decimals: as Geometry::direction_decimals.
    DirectionSplitter(std::size_t num_directions, int decimals, std::string line_end);

    /// Uses come sorted, as from direction_uses(), each with what it needs. Returns the
    /// 1-based index of its statement; a new one is appended to \p lines.
    std::uint32_t index(const DirectionUse& use, const Eigen::Vector3d& value,
                        std::string& lines);
    std::size_t num_lines() const { return num_lines_; }

private:
    struct Statement
    {
        Eigen::Vector3d value;
        std::uint32_t index;
    };
    using Box = std::array<std::int64_t, 3>;
    struct BoxHash
    {
        std::size_t operator()(const Box& box) const;
    };
    const Statement* near(const Eigen::Vector3d& value) const;
    void keep(const Statement& statement);
    Box box_of(const Eigen::Vector3d& value) const;

    std::size_t num_directions_, num_lines_ = 0;
    std::string line_end_;
    double same_;       ///< uses closer than this share one [of the direction's length]
    double edge_ = 0.0; ///< of the boxes that statements are kept in; 0: too few of them
    std::unordered_map<Box, std::vector<std::uint32_t>, BoxHash> boxes_;
    std::uint32_t direction_ = kNone;   ///< of the last use
    std::vector<Statement> statements_; ///< of that direction
};

/// New vn lines and index changes where the uses of a direction part company.
struct ObjSplit
{
    std::string lines; ///< to append to the file
    std::size_t num_lines = 0;
    std::vector<IndexEdit> indices;          ///< in the order of the file
    std::vector<Eigen::Vector3d> directions; ///< of the original vn statements
};

/// Decides which vn must be split. \p uses and \p values as in DeformedSamples.
ObjSplit split_directions(const Geometry& geometry, const std::vector<DirectionUse>& uses,
                          const std::vector<Eigen::Vector3d>& values,
                          std::string_view bytes);

} // namespace cellwarp::core
