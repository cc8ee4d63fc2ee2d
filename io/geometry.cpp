// SPDX-License-Identifier: GPL-3.0-or-later
// Which scanner reads which extension, and the one writer: a copy of the bytes
// with the numbers that changed replaced.
#include "io/geometry.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <memory>

#include "io/error.h"
#include "io/gltf.h"
#include "io/import/import.h"
#include "io/number.h"
#include "io/obj.h"
#include "io/packed.h"
#include "io/pcd.h"
#include "io/scanner.h"
#include "io/stl.h"
#include "io/stored_number.h"
#include "io/text.h"

namespace cellwarp
{

namespace
{

constexpr std::string_view kFormats[] = {"obj", "ply", "stl", "off", "pcd",  "xyz",
                                         "pts", "csv", "txt", "asc", "gltf", "glb"};

/// Largest coordinate: beyond it squares overflow.
constexpr double kMaxCoordinate = 1e150;

/// One number to replace.
struct Edit
{
    std::uint64_t start;
    Scalar scalar;
    bool big_endian;
    double value;
};

/// Numbers of a list of vectors in the order of their places. Vectors stand one
/// after the other; within one the components may stand in any order (PLY).
class EditStream
{
public:
    EditStream(const ByteOffsets& places, std::span<const double> before,
               std::span<const double> after)
        : places_(places), before_(before), after_(after)
    {
        load();
    }
    bool is_done() const { return first_ == after_.size(); }
    std::uint64_t start() const { return places_.starts[first_ + order_[next_]]; }
    bool changes() const
    {
        return before_[first_ + order_[next_]] != after_[first_ + order_[next_]];
    }
    Edit edit() const
    {
        return {start(), places_.scalars[order_[next_]], places_.big_endian,
                after_[first_ + order_[next_]]};
    }
    void advance()
    {
        if (++next_ == places_.length)
        {
            next_ = 0;
            first_ += places_.length;
            load();
        }
    }

private:
    void load()
    {
        if (is_done())
            return;
        const std::uint64_t* starts = &places_.starts[first_];
        if (std::is_sorted(
                order_.begin(), order_.begin() + static_cast<long>(places_.length),
                [&](std::size_t a, std::size_t b) { return starts[a] < starts[b]; }))
            return; // as in the last vector
        std::sort(order_.begin(), order_.begin() + static_cast<long>(places_.length),
                  [&](std::size_t a, std::size_t b) { return starts[a] < starts[b]; });
    }

    const ByteOffsets& places_;
    std::span<const double> before_, after_;
    std::array<std::size_t, 4> order_ = {0, 1, 2, 3};
    std::size_t first_ = 0; ///< number of the vector
    std::size_t next_ = 0;  ///< in order_
};

/// Length of the number or index at \p start: what none of the formats has in one
/// ends it.
std::size_t token_length(std::string_view bytes, std::uint64_t start)
{
    static constexpr std::string_view ends = "\n\r\\/,;\"";
    std::size_t end = start;
    while (end < bytes.size() && !is_blank(bytes[end]) &&
           ends.find(bytes[end]) == std::string_view::npos)
        ++end;
    return end - start;
}

} // namespace

bool is_geometry_format(std::string_view extension)
{
    return std::find(std::begin(kFormats), std::end(kFormats), extension) !=
           std::end(kFormats);
}

Error unknown_format(const std::string& path)
{
    std::string known;
    for (const std::string_view format : kFormats)
        known += (known.empty() ? "" : ", ") + std::string(format);
    return Error(
        Fault::Usage,
        at({path, 0, ""}, "the extension is no known format (need " + known + ")"));
}

std::string extension_of(const std::string& path)
{
    std::string extension = std::filesystem::path(path).extension().string();
    if (!extension.empty())
        extension.erase(0, 1);
    return lower_case(extension);
}

GeometryFile scan_geometry(std::string path, std::string bytes,
                           const ReadOptions& options)
{
    GeometryFile file{std::move(path), std::move(bytes), {}};
    const std::string extension = extension_of(file.path);
    file.geometry.format = extension;
    if (!is_geometry_format(extension))
        throw unknown_format(file.path);
    check_content(file.path, extension, file.bytes, 0);
    if (extension == "gltf" || extension == "glb")
        scan_gltf(file);
    else
    {
        const std::unique_ptr<Scanner> scanner =
            make_scanner(file.path, extension, file.bytes.size(), options);
        scanner->scan(file.bytes, 0, true, file.geometry);
        scanner->finish(file.geometry);
    }
    check_magnitude(file.path, file.geometry);
    return file;
}

GeometryFile read_geometry(const std::string& path, const ReadOptions& options)
{
    // Why a path leads nowhere is told where it is opened.
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        throw Error(Fault::File, at({path, 0, ""}, "is a directory, need a file"));
    const std::string extension = extension_of(path);
    if (is_geometry_format(extension))
        return scan_geometry(path, read_file(path), options);
    if (!is_import_format(extension))
        throw unknown_format(path);
    GeometryFile file{path, {}, {}};
    file.geometry = import_geometry(path, read_file(path));
    check_magnitude(file.path, file.geometry);
    return file;
}

std::vector<DirectionUse> direction_uses(const Geometry& geometry)
{
    std::vector<DirectionUse> uses;
    if (geometry.format == "stl")
        return uses; // its normals follow from its corners
    for (std::size_t i = 0; i < geometry.direction_samples.size(); ++i)
        uses.push_back({static_cast<std::uint32_t>(i), geometry.direction_samples[i]});
    for (std::size_t c = 0; c < geometry.corner_directions.size(); ++c)
        if (geometry.corner_directions[c] != kNone)
            uses.push_back({geometry.corner_directions[c], geometry.corners[c]});
    const auto key = [](const DirectionUse& use)
    { return std::pair(use.direction, use.sample); };
    std::sort(uses.begin(), uses.end(),
              [&](const DirectionUse& a, const DirectionUse& b)
              { return key(a) < key(b); });
    uses.erase(std::unique(uses.begin(), uses.end(),
                           [&](const DirectionUse& a, const DirectionUse& b)
                           { return key(a) == key(b); }),
               uses.end());
    return uses;
}

void check_magnitude(const std::string& path, const Geometry& geometry)
{
    const std::vector<std::uint64_t>& starts = geometry.sample_places.starts;
    for (std::size_t i = 0; i < geometry.samples.size(); ++i)
        if (!(geometry.samples[i].cwiseAbs().maxCoeff() <= kMaxCoordinate))
            throw malformed({path, 0,
                             "sample " + std::to_string(geometry.samples_before + i) +
                                 (3 * i < starts.size()
                                      ? " (byte " + std::to_string(starts[3 * i]) + ")"
                                      : "")},
                            "is beyond 1e150");
}

std::string patched(const GeometryFile& file, const DeformedSamples& patch,
                    std::size_t* num_split)
{
    const Geometry& geometry = file.geometry;
    if (num_split)
        *num_split = 0;
    if (file.gltf)
        return patched_gltf(file, patch, {}).bytes;
    if (!geometry.unpacked.empty())
        return patched_pcd(file, patch);
    const std::vector<DirectionUse> uses = direction_uses(geometry);
    ObjSplit split;
    if (!geometry.corner_directions.empty())
        split = split_directions(geometry, uses, patch.directions, file.bytes);
    else if (geometry.format == "stl")
        split.directions = facet_normals(geometry, patch.samples);
    else
    {
        split.directions = geometry.directions;
        for (std::size_t use = 0; use < uses.size(); ++use)
            split.directions[uses[use].direction] = patch.directions[use];
    }
    if (num_split)
        *num_split = split.num_lines;
    std::string out;
    out.reserve(file.bytes.size() + split.lines.size() + file.bytes.size() / 8);
    append_patched(file.path, file.bytes, 0, geometry,
                   {patch.samples, split.directions, patch.tangents, patch.rotations,
                    split.index_starts, split.new_indices},
                   out);
    out.append(split.lines);
    return out;
}

void append_patched(const std::string& path, std::string_view bytes, std::uint64_t start,
                    const Geometry& geometry, const PartPatch& patch, std::string& out)
{
    std::uint64_t copied = start;
    const auto replace =
        [&](std::uint64_t place, std::size_t length, std::string_view text)
    {
        out.append(bytes.substr(copied - start, place - copied));
        out.append(text);
        copied = place + length;
    };
    std::string text;
    const auto apply = [&](const Edit& edit)
    {
        text.clear();
        if (!store(edit.value, edit.scalar, edit.big_endian, text))
            throw does_not_fit(path, edit.start, edit.value);
        const std::size_t size = stored_size(edit.scalar);
        replace(edit.start, size > 0 ? size : token_length(bytes, edit.start - start),
                text);
    };
    std::array<EditStream, 4> streams = {
        EditStream(geometry.sample_places, numbers_of(geometry.samples),
                   numbers_of(patch.samples)),
        EditStream(geometry.direction_places, numbers_of(geometry.directions),
                   numbers_of(patch.directions)),
        EditStream(geometry.tangent_places, numbers_of(geometry.tangents),
                   numbers_of(patch.tangents)),
        EditStream(geometry.rotation_places, numbers_of(geometry.rotations),
                   numbers_of(patch.rotations))};
    std::size_t index = 0;
    constexpr std::uint64_t kEnd = ~std::uint64_t(0);
    for (;;)
    {
        const auto start_of = [](const EditStream& stream)
        { return stream.is_done() ? kEnd : stream.start(); };
        EditStream& stream =
            *std::min_element(streams.begin(), streams.end(),
                              [&](const EditStream& a, const EditStream& b)
                              { return start_of(a) < start_of(b); });
        const std::uint64_t i =
            index == patch.index_starts.size() ? kEnd : patch.index_starts[index];
        const std::uint64_t first = std::min(start_of(stream), i);
        if (first == kEnd)
            break;
        if (first == i)
        {
            replace(i, token_length(bytes, i - start),
                    std::to_string(patch.new_indices[index]));
            ++index;
            continue;
        }
        if (stream.changes())
            apply(stream.edit());
        stream.advance();
    }
    out.append(bytes.substr(copied - start));
}

} // namespace cellwarp
