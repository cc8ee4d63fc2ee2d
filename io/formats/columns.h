// SPDX-License-Identifier: GPL-3.0-or-later
// Points as text in columns: XYZ, PTS, CSV, TXT and ASC.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/base/error.h"
#include "io/base/text.h"
#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// One point a line, as many columns on each. Which column is what is told by
/// \p columns, else by a line of names, else x y z come first. Of six columns without
/// names the last three are a normal if that of each of the first 1,000 points has length
/// 1 and none is written as three whole numbers from 0 to 255, which are a colour; points
/// count that begin within 1 MB of the first. Columns that are no position or normal may
/// hold anything. Each scan of a PTS starts with its number of points; another file may
/// have that number before its first point.
class ColumnsScanner
{
public:
    /// \p columns: names separated by commas, like "x,y,z,intensity,r,g,b"; x, y, z,
    /// nx, ny, nz, r, g, b (or red, green, blue) mean something. May be empty.
    /// Throws Fault::Usage if they lack x, y or z.
    ColumnsScanner(std::string file, const std::string& format,
                   const std::string& columns);

    std::size_t scan(std::string_view part, std::uint64_t start, bool is_last,
                     Geometry& out);
    std::size_t skip(std::string_view part);
    void finish(Geometry& out);

private:
    /// Reads a line into row_; false if it holds no point.
    bool is_point(std::string_view text, std::uint64_t start);
    /// Whether columns 4 to 6 are normals; nothing if it takes more of the file.
    std::optional<bool> find_normals(std::string_view part, std::uint64_t start,
                                     bool is_last) const;
    void split(std::string_view text, std::uint64_t start);
    void choose_separator(std::string_view text);
    bool take_names(const std::vector<std::string>& names);
    void point(Geometry& out);

    std::string file_;
    bool is_pts_, is_csv_;
    char separator_ = 0; ///< 0: not known yet; ' ': blanks and tabs
    bool has_names_ = false, is_first_ = true, has_points_ = false;
    std::vector<std::string> names_; ///< of the columns, where they are known
    int role_column_[9] = {-1, -1, -1, -1, -1, -1, -1, -1, -1};
    std::size_t num_columns_ = 0; ///< 0: not known yet
    bool has_unit_normals_ = false;
    std::int64_t lines_ = 0;
    std::int64_t promised_ = -1;  ///< points; -1: no number was read
    std::int64_t count_line_ = 0; ///< of the first number of points
    std::vector<Token> row_;      ///< the fields of the line being read
};

} // namespace cellwarp::core
