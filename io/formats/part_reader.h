// SPDX-License-Identifier: GPL-3.0-or-later
// A geometry file part by part, so that memory does not grow with it.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "io/base/bytes.h"
#include "io/formats/geometry.h"
#include "io/formats/scanner.h"

namespace cellwarp::core
{

/// Consecutive bytes of a file that hold whole records.
struct FilePart
{
    std::string bytes;
    std::uint64_t start = 0; ///< [byte] in the file
    Geometry geometry;       ///< of these bytes alone; empty while a scanner waits
    /// Has still to scan the bytes, which any thread may do; null: it is done.
    std::unique_ptr<Scanner> scanner;
};

/// Scans the part if that is still to be done.
void scan_part(FilePart& part);

/// Cuts a file into parts. Records that can be counted without being read are left to
/// scan_part(); the others are scanned here, because they depend on those before.
class PartReader
{
public:
    /// \p file stands at its beginning. \p part_bytes: size of a part, about; a longer
    /// record makes it longer, up to kMaxRecordBytes.
    PartReader(InputFile& file, std::string path, std::string format,
               const ReadOptions& options, std::size_t part_bytes);

    /// The next part, in place of \p part, whose memory is used again. False at the end.
    bool next(FilePart& part);
    /// After the last part: the checks of the whole file. \p total tells what the parts
    /// held (see Geometry::samples_before) and takes the warnings.
    void finish(Geometry& total) { scanner_->finish(total); }

private:
    void fill(std::string& bytes, std::size_t count);
    void clear(Geometry& geometry) const;

    InputFile& file_;
    std::string path_, format_;
    std::size_t part_bytes_;
    std::unique_ptr<Scanner> scanner_;
    Geometry read_;     ///< how numbers are stored, and counts; holds no samples
    std::string carry_; ///< read, but not yet part of a whole record
    std::uint64_t start_ = 0;
    bool at_end_ = false, is_done_ = false;
};

/// Longest line or binary record of a file that is read part by part [bytes].
inline constexpr std::size_t kMaxRecordBytes = std::size_t(1) << 24;

} // namespace cellwarp::core
