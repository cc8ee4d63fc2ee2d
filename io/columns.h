// SPDX-License-Identifier: GPL-3.0-or-later
// Points as text in columns: XYZ, PTS, CSV, TXT and ASC.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/error.h"
#include "io/geometry.h"
#include "io/text.h"

namespace cellwarp
{

/// One point a line, as many columns on each. Which column is what is told by
/// \p columns, else by a line of names, else x y z come first (and of six columns
/// the last three are a normal if the first line's has length 1). Columns that are
/// no position or normal may hold anything. A PTS starts with its number of points.
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
    void line(std::string_view text, std::uint64_t start, Geometry& out);
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
    std::int64_t lines_ = 0, promised_ = -1;
    std::vector<Token> row_; ///< the fields of the line being read
};

} // namespace cellwarp
