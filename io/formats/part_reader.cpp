// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/part_reader.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "io/base/error.h"

namespace cellwarp::core
{

void scan_part(FilePart& part)
{
    if (!part.scanner)
        return;
    const std::unique_ptr<Scanner> scanner = std::move(part.scanner);
    if (scanner->scan(part.bytes, part.start, true, part.geometry) != part.bytes.size())
        throw std::logic_error("a part was cut within a record");
}

PartReader::PartReader(InputFile& file, std::string path, std::string format,
                       const ReadOptions& options, std::size_t part_bytes)
    : file_(file), path_(std::move(path)), format_(std::move(format)),
      part_bytes_(std::max<std::size_t>(1, part_bytes)),
      scanner_(make_scanner(path_, format_, file.size(), options))
{
    read_.format = format_;
}

/// Reads on until there are \p count bytes, or the file ends.
void PartReader::fill(std::string& bytes, std::size_t count)
{
    if (at_end_ || bytes.size() >= count)
        return;
    const std::size_t old = bytes.size();
    bytes.resize(count);
    const std::size_t got = file_.read(bytes.data() + old, count - old);
    bytes.resize(old + got);
    at_end_ = bytes.size() < count;
    if (!at_end_ && bytes.back() == '\0')
    {
        // Whether a NUL is the file's last byte makes a difference.
        char next;
        at_end_ = file_.read(&next, 1) == 0;
        if (!at_end_)
            bytes.push_back(next);
    }
    // The byte before tells whether a line ended there.
    const std::size_t first = old > 0 ? old - 1 : 0;
    check_content(path_, format_, std::string_view(bytes).substr(first), start_ + first,
                  at_end_);
}

void PartReader::clear(Geometry& geometry) const
{
    geometry.format = format_;
    geometry.samples.clear();
    geometry.corners.clear();
    geometry.face_ends.clear();
    geometry.lines.clear();
    geometry.directions.clear();
    geometry.direction_samples.clear();
    geometry.corner_directions.clear();
    geometry.corner_direction_starts.clear();
    geometry.corner_direction_lengths.clear();
    geometry.colours.clear();
    geometry.groups.clear();
    geometry.attributes.clear();
    geometry.sample_places.scalars = read_.sample_places.scalars;
    geometry.sample_places.big_endian = read_.sample_places.big_endian;
    geometry.sample_places.clear();
    geometry.direction_places.scalars = read_.direction_places.scalars;
    geometry.direction_places.big_endian = read_.direction_places.big_endian;
    geometry.direction_places.clear();
    geometry.samples_before = read_.samples_before;
    geometry.directions_before = read_.directions_before;
    geometry.num_bad_normals = geometry.num_bad_rotations = geometry.num_missing = 0;
    geometry.tangents.clear();
    geometry.tangent_samples.clear();
    geometry.rotations.clear();
    geometry.rotation_samples.clear();
    geometry.rotation_places.scalars = read_.rotation_places.scalars;
    geometry.rotation_places.big_endian = read_.rotation_places.big_endian;
    geometry.rotation_places.clear();
}

bool PartReader::next(FilePart& part)
{
    if (is_done_)
        return false;
    part.bytes.swap(carry_);
    part.start = start_;
    clear(part.geometry);
    std::size_t taken = 0;
    for (std::size_t wanted = part_bytes_;;)
    {
        fill(part.bytes, wanted);
        part.scanner = scanner_->copy();
        taken = scanner_->skip(part.bytes);
        if (taken > 0)
            break;
        part.scanner.reset();
        taken = scanner_->scan(part.bytes, start_, at_end_, part.geometry);
        is_done_ = at_end_;
        if (taken > 0 || is_done_)
            break;
        const std::size_t size = part.bytes.size();
        if (size >= kMaxRecordBytes)
            throw malformed({path_, 0, "byte " + std::to_string(start_)},
                            "a line or record is longer than 16 MB");
        wanted = std::min(size + std::max(part_bytes_, size / 2), kMaxRecordBytes);
    }
    if (!part.scanner)
    {
        // What is left at the end of a file passes through.
        taken = is_done_ ? part.bytes.size() : taken;
        read_.sample_places.scalars = part.geometry.sample_places.scalars;
        read_.sample_places.big_endian = part.geometry.sample_places.big_endian;
        read_.direction_places.scalars = part.geometry.direction_places.scalars;
        read_.direction_places.big_endian = part.geometry.direction_places.big_endian;
        read_.rotation_places.scalars = part.geometry.rotation_places.scalars;
        read_.rotation_places.big_endian = part.geometry.rotation_places.big_endian;
        read_.samples_before = part.geometry.num_samples();
        read_.directions_before = part.geometry.num_directions();
    }
    carry_.assign(part.bytes, taken, std::string::npos);
    part.bytes.resize(taken);
    start_ += taken;
    return true;
}

} // namespace cellwarp::core
