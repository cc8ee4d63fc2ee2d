// SPDX-License-Identifier: GPL-3.0-or-later
// The packed data come last of all, because their size stands before them: they wait in
// a second temporary file.
#include "io/formats/pcd_stream.h"

#include <algorithm>
#include <utility>

#include "io/base/error.h"
#include "io/base/lzf.h"
#include "io/base/lzf_unpacker.h"
#include "io/formats/packed.h"
#include "io/formats/pcd.h"
#include "io/formats/stored_number.h"
#include "io/formats/stream_ranges.h"

namespace cellwarp::core
{

namespace
{

using Column = PcdScanner::Column;

/// Longest header, and what comes with it.
constexpr std::uint64_t kHeadBytes = (std::uint64_t(1) << 20) + 3;

/// Some points on their way.
struct Points
{
    Geometry geometry;
    std::vector<std::string> numbers; ///< of each column
    std::vector<Eigen::Vector3d> samples, directions;
    bool changes = false, is_too_far = false;
};

class PackedPcdStream
{
public:
    PackedPcdStream(const std::string& input, const std::string& output,
                    OutputSet& outputs, const StreamOptions& options,
                    const StreamWork& work)
        : path_(input), options_(options), work_(work), input_(input),
          output_(outputs.add(output)), body_(spill_folder(output)),
          packed_(spill_folder(output)), scanner_(input, input_.size())
    {
    }
    StreamReport run();

private:
    void read_head();
    bool unpack();
    bool move();
    void move_points(Points& points, std::uint64_t first) const;
    bool pack();
    void copy(std::uint64_t start, std::uint64_t end);
    void put(std::string_view bytes);
    void show(double share, std::uint64_t done, std::uint64_t of) const;

    std::string path_;
    const StreamOptions& options_;
    const StreamWork& work_;
    InputFile input_;
    OutputFile& output_;
    SpillFile body_, packed_;
    PcdScanner scanner_;
    Geometry none_;  ///< how numbers are stored
    Geometry total_; ///< counts; holds no samples
    std::vector<Column> columns_;
    std::uint64_t points_at_once_ = 1;
    PcdScanner::PackedSizes sizes_;
    std::uint64_t start_ = 0; ///< of the sizes [byte]
    bool changes_ = false;
    StreamReport report_;
};

void PackedPcdStream::read_head()
{
    const auto head_at = [&](std::uint64_t start, std::uint64_t count)
    {
        std::string bytes(
            static_cast<std::size_t>(std::min(count, input_.size() - start)), '\0');
        input_.read_at(start, bytes.data(), bytes.size());
        return bytes;
    };
    start_ = scanner_.read_header(head_at(0, kHeadBytes), none_);
    sizes_ = scanner_.packed_sizes(head_at(start_, kPackedSizesBytes), start_);
    columns_ = scanner_.columns();
    std::uint64_t bytes = 0;
    for (const Column& column : columns_)
        bytes += column.size;
    points_at_once_ = std::max<std::uint64_t>(1, options_.part_bytes / bytes);
}

/// Reads the whole file once, from its beginning to its end.
bool PackedPcdStream::unpack()
{
    const std::uint64_t first = start_ + kPackedSizesBytes, end = first + sizes_.packed;
    LzfUnpacker unpacker(sizes_.unpacked);
    bool is_sound = true;
    std::string made;
    const auto read = [&](std::uint64_t, char* bytes, std::size_t count)
    { input_.read(bytes, count); };
    for_each_piece(0, first, read, [](std::string_view) {});
    std::uint64_t done = 0;
    for_each_piece(first, end, read,
                   [&](std::string_view piece)
                   {
                       if (!is_sound || work_.stop.stop_requested())
                           return;
                       is_sound = unpacker.take(piece, made);
                       body_.append(made.data(), made.size());
                       show(0.0, done += piece.size(), sizes_.packed);
                   });
    if (work_.stop.stop_requested())
        return false;
    if (!is_sound || !unpacker.is_complete())
        throw malformed({path_, 0, "byte " + std::to_string(first)},
                        "the packed data cannot be unpacked");
    for_each_piece(end, input_.size(), read, [](std::string_view) {});
    return true;
}

void PackedPcdStream::move_points(Points& points, std::uint64_t first) const
{
    const std::uint64_t count = std::min(points_at_once_, scanner_.num_points() - first);
    points.geometry = none_;
    points.changes = points.is_too_far = false;
    points.numbers.resize(columns_.size());
    for (std::size_t c = 0; c < columns_.size(); ++c)
    {
        points.numbers[c].resize(static_cast<std::size_t>(count * columns_[c].size));
        body_.read(columns_[c].start + first * columns_[c].size, points.numbers[c].data(),
                   points.numbers[c].size());
    }
    PcdScanner scanner = scanner_;
    scanner.scan_columns(first, count, points.numbers, points.geometry);
    const Geometry& geometry = points.geometry;
    try
    {
        check_magnitude(path_, geometry);
    }
    catch (const Error&)
    {
        points.is_too_far = true;
        return;
    }
    points.samples = geometry.samples;
    points.directions = geometry.directions;
    work_.move({points.samples, geometry.direction_samples, points.directions});
    std::vector<bool> changes(columns_.size(), false);
    const auto put = [&](std::uint64_t start, const std::string& stored)
    {
        const std::size_t c = static_cast<std::size_t>(
            std::upper_bound(columns_.begin(), columns_.end(), start,
                             [](std::uint64_t place, const Column& column)
                             { return place < column.start; }) -
            columns_.begin() - 1);
        const std::uint64_t at = start - columns_[c].start - first * columns_[c].size;
        std::string& numbers = points.numbers[c];
        if (numbers.compare(at, stored.size(), stored) == 0)
            return;
        numbers.replace(at, stored.size(), stored);
        changes[c] = points.changes = true;
    };
    for_each_change(geometry.sample_places, numbers_of(geometry.samples),
                    numbers_of(points.samples), path_, put);
    for_each_change(geometry.direction_places, numbers_of(geometry.directions),
                    numbers_of(points.directions), path_, put);
    for (std::size_t c = 0; c < columns_.size(); ++c)
        if (changes[c])
            body_.overwrite(columns_[c].start + first * columns_[c].size,
                            points.numbers[c].data(), points.numbers[c].size());
}

bool PackedPcdStream::move()
{
    const std::uint64_t ranges =
        (scanner_.num_points() + points_at_once_ - 1) / points_at_once_;
    return run_ranges<Points>(
        ranges, options_.parts_at_once, work_,
        [&](Points& points, std::uint64_t i)
        { move_points(points, i * points_at_once_); },
        [&](Points& points, std::uint64_t i)
        {
            points.geometry.samples_before = total_.samples_before;
            if (points.is_too_far)
                check_magnitude(path_, points.geometry);
            total_.samples_before += points.geometry.samples.size();
            total_.num_bad_normals += points.geometry.num_bad_normals;
            total_.num_missing += points.geometry.num_missing;
            changes_ = changes_ || points.changes;
            show(0.25, i + 1, ranges);
        });
}

bool PackedPcdStream::pack()
{
    const std::uint64_t size = body_.size();
    return run_ranges<std::string>(
        (size + kPackedBlockBytes - 1) / kPackedBlockBytes, options_.parts_at_once, work_,
        [&](std::string& block, std::uint64_t i)
        {
            const std::uint64_t first = i * kPackedBlockBytes;
            block.resize(static_cast<std::size_t>(
                std::min<std::uint64_t>(kPackedBlockBytes, size - first)));
            body_.read(first, block.data(), block.size());
            block = *lzf_packed(block);
        },
        [&](const std::string& block, std::uint64_t i)
        {
            packed_.append(block.data(), block.size());
            show(0.5, (i + 1) * kPackedBlockBytes, size + kPackedBlockBytes);
        });
}

void PackedPcdStream::put(std::string_view bytes)
{
    output_.write(bytes);
    report_.bytes += bytes.size();
}

void PackedPcdStream::copy(std::uint64_t start, std::uint64_t end)
{
    for_each_piece(
        start, end,
        [&](std::uint64_t at, char* bytes, std::size_t count)
        { input_.read_at(at, bytes, count); },
        [&](std::string_view piece) { put(piece); });
}

void PackedPcdStream::show(double share, std::uint64_t done, std::uint64_t of) const
{
    if (work_.progress)
        work_.progress(share +
                       0.25 * static_cast<double>(done) / static_cast<double>(of));
}

StreamReport PackedPcdStream::run()
{
    read_head();
    if (work_.stop.stop_requested() || !unpack() || !move() || (changes_ && !pack()))
    {
        report_.is_stopped = true;
        return std::move(report_);
    }
    const std::uint64_t end = start_ + kPackedSizesBytes + sizes_.packed;
    scanner_.end_columns(input_.size() - end);
    scanner_.finish(total_);
    if (changes_)
    {
        if (packed_.size() > 0xffffffffu)
            throw too_large_to_pack(path_);
        copy(0, start_);
        std::string sizes;
        store(static_cast<double>(packed_.size()), Scalar::UInt32, false, sizes);
        store(static_cast<double>(body_.size()), Scalar::UInt32, false, sizes);
        put(sizes);
        for_each_piece(
            0, packed_.size(),
            [&](std::uint64_t at, char* bytes, std::size_t count)
            { packed_.read(at, bytes, count); },
            [&](std::string_view piece) { put(piece); });
        copy(end, input_.size());
    }
    else
        copy(0, input_.size());
    input_.check_unchanged();
    report_.samples = total_.samples_before;
    report_.warnings = std::move(total_.warnings);
    return std::move(report_);
}

} // namespace

StreamReport stream_packed_pcd(const std::string& input, const std::string& output,
                               OutputSet& outputs, const StreamOptions& options,
                               const StreamWork& work)
{
    return PackedPcdStream(input, output, outputs, options, work).run();
}

} // namespace cellwarp::core
