// SPDX-License-Identifier: GPL-3.0-or-later
// Object File Format: OFF, with texture coordinates (ST), colours (C) and normals (N)
// before it in any order. A stream of tokens: a record may break over lines.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/base/error.h"
#include "io/base/text.h"
#include "io/formats/geometry.h"

namespace cellwarp::core
{

class OffScanner
{
public:
    OffScanner(std::string file, std::uint64_t file_bytes)
        : file_(std::move(file)), file_bytes_(file_bytes)
    {
    }

    std::size_t scan(std::string_view part, std::uint64_t start, bool is_last,
                     Geometry& out);
    void finish(Geometry& out);

private:
    enum class Expect
    {
        Magic,
        Counts,
        Vertices,
        Faces,
        End
    };

    void line(std::string_view text, std::uint64_t start, Geometry& out);
    void magic(std::string_view& text, std::uint64_t& start);
    void counts(Tokens& tokens);
    bool vertex_token(const Token& token, Geometry& out);
    void vertex_with_colours_first(Tokens& tokens, Geometry& out);
    void add_number(const Token& token);
    void keep_vertex(Geometry& out);
    bool face_token(const Token& token, Geometry& out);
    static std::size_t comment_start(std::string_view line);
    void advance();
    Where here() const;

    std::string file_;
    std::uint64_t file_bytes_;
    std::int64_t lines_ = 0;
    Expect expect_ = Expect::Magic;
    bool has_normals_ = false, has_colours_ = false, has_texture_ = false;
    bool colours_first_ = false;       ///< before the normals, as MeshLab writes them
    std::vector<std::int64_t> counts_; ///< that were read
    std::uint64_t num_vertices_ = 0, num_faces_ = 0, record_ = 0;
    std::uint64_t whole_end_ = 0;  ///< [byte] where the last whole vertex ended
    std::int64_t whole_lines_ = 0; ///< lines that ended until there
    std::vector<Token> numbers_;   ///< of the vertex being read
    std::vector<double> values_;
    std::int64_t corners_left_ = -1; ///< of the face being read; -1: count awaited
    bool is_face_ = false;           ///< and not a point or a line
};

} // namespace cellwarp::core
