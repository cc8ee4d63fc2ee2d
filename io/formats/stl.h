// SPDX-License-Identifier: GPL-3.0-or-later
// STL, ascii and binary. Samples are the corners of the facets, in file order.
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

class StlScanner
{
public:
    /// \p file_bytes: size of the whole file. A file of just the size that its
    /// binary count asks for is binary, also if it starts with "solid".
    StlScanner(std::string file, std::uint64_t file_bytes)
        : file_(std::move(file)), file_bytes_(file_bytes)
    {
    }

    /// A part's last facet is whole.
    std::size_t scan(std::string_view part, std::uint64_t start, bool is_last,
                     Geometry& out);
    std::size_t skip(std::string_view part);
    void finish(Geometry& out);

private:
    enum class Kind
    {
        Unknown,
        Ascii,
        Binary
    };

    void begin(std::string_view part, Geometry& out);
    void statement(std::string_view line, std::uint64_t start, Geometry& out);
    void numbers(Tokens& tokens, bool is_normal, Geometry& out);
    /// The next \p count facets of a binary file, which begin at byte \p start.
    void facets(const char* records, std::size_t count, std::uint64_t start,
                Geometry& out);
    /// Keeps the normal of the facet that begins with the next sample; false if it is
    /// none.
    static bool add_normal(const Eigen::Vector3d& normal, Geometry& out);

    std::string file_;
    std::uint64_t file_bytes_;
    Kind kind_ = Kind::Unknown;
    std::uint64_t count_ = 0, facet_ = 0;
    std::int64_t lines_ = 0;
    int corners_ = 0; ///< of the ascii facet being read
    bool in_facet_ = false;
    std::uint64_t trailing_ = 0; ///< [bytes] after the last facet
    std::string expected_;       ///< ascii keywords that may come next, blank separated
};

/// The normals of the facets once their corners are at \p samples: unit length times
/// the old length, on the old side. One for each direction of \p geometry; a facet
/// that does not move or has no area keeps its normal.
std::vector<Eigen::Vector3d> facet_normals(const Geometry& geometry,
                                           const std::vector<Eigen::Vector3d>& samples);

} // namespace cellwarp::core
