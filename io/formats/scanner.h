// SPDX-License-Identifier: GPL-3.0-or-later
// The scanner of any geometry format, seen as one: for whole files and for parts.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Reads a file of one format from its beginning to its end, in one part or in many.
class Scanner
{
public:
    virtual ~Scanner() = default;

    /// Reads the complete records of \p part, which starts at byte \p start of the
    /// file, into \p out. Returns how many bytes they take; with 0 nothing has changed
    /// and more of the file is needed.
    virtual std::size_t scan(std::string_view part, std::uint64_t start, bool is_last,
                             Geometry& out) = 0;
    /// Goes past the complete records of \p part, at less cost than by reading them,
    /// and returns how many bytes they take; a copy made before can scan them at any
    /// time. 0 where only scan() can tell.
    virtual std::size_t skip(std::string_view part) = 0;
    /// Checks what only the whole file can tell.
    virtual void finish(Geometry& out) = 0;
    virtual std::unique_ptr<Scanner> copy() const = 0;
};

/// The scanner of the format (a lower-case extension, see is_geometry_format()) for
/// the file \p path. \p file_bytes may be kUnknownBytes.
std::unique_ptr<Scanner> make_scanner(const std::string& path, const std::string& format,
                                      std::uint64_t file_bytes,
                                      const ReadOptions& options);

/// Throws Fault::Malformed if the file is empty or of another kind, as far as the part
/// that starts at byte \p start shows it. \p is_last: the file ends with the part.
void check_content(const std::string& path, const std::string& format,
                   std::string_view part, std::uint64_t start, bool is_last = false);

} // namespace cellwarp::core
