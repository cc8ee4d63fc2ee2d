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
#include "io/number.h"
#include "io/obj.h"
#include "io/scanner.h"
#include "io/stl.h"
#include "io/stored_number.h"
#include "io/text.h"

namespace cellwarp
{

namespace
{

constexpr std::string_view kFormats[] = {"obj", "ply", "stl", "off", "xyz",
                                         "pts", "csv", "txt", "asc"};

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
    EditStream(const Places& places, std::span<const Eigen::Vector3d> before,
               std::span<const Eigen::Vector3d> after)
        : places_(places), before_(before), after_(after)
    {
        load();
    }
    bool is_done() const { return vector_ == after_.size(); }
    std::uint64_t start() const { return places_.starts[3 * vector_ + order_[next_]]; }
    bool changes() const
    {
        const Eigen::Index k = static_cast<Eigen::Index>(order_[next_]);
        return before_[vector_][k] != after_[vector_][k];
    }
    Edit edit() const
    {
        return {start(), places_.scalars[order_[next_]], places_.big_endian,
                after_[vector_][static_cast<Eigen::Index>(order_[next_])]};
    }
    void advance()
    {
        if (++next_ == 3)
        {
            next_ = 0;
            ++vector_;
            load();
        }
    }

private:
    void load()
    {
        if (is_done())
            return;
        const std::uint64_t* starts = &places_.starts[3 * vector_];
        if (starts[order_[0]] < starts[order_[1]] &&
            starts[order_[1]] < starts[order_[2]])
            return; // as in the last vector
        std::sort(order_.begin(), order_.end(),
                  [&](std::size_t a, std::size_t b) { return starts[a] < starts[b]; });
    }

    const Places& places_;
    std::span<const Eigen::Vector3d> before_, after_;
    std::array<std::size_t, 3> order_ = {0, 1, 2};
    std::size_t vector_ = 0, next_ = 0;
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
    const std::unique_ptr<Scanner> scanner =
        make_scanner(file.path, extension, file.bytes.size(), options);
    scanner->scan(file.bytes, 0, true, file.geometry);
    scanner->finish(file.geometry);
    check_magnitude(file.path, file.geometry);
    return file;
}

GeometryFile read_geometry(const std::string& path, const ReadOptions& options)
{
    if (std::filesystem::is_directory(path))
        throw Error(Fault::File, at({path, 0, ""}, "is a directory, need a file"));
    if (!is_geometry_format(extension_of(path)))
        throw unknown_format(path);
    return scan_geometry(path, read_file(path), options);
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
    for (std::size_t i = 0; i < geometry.samples.size(); ++i)
        if (!(geometry.samples[i].cwiseAbs().maxCoeff() <= kMaxCoordinate))
            throw malformed(
                {path, 0,
                 "sample " + std::to_string(geometry.samples_before + i) + " (byte " +
                     std::to_string(geometry.sample_places.starts[3 * i]) + ")"},
                "is beyond 1e150");
}

std::string patched(const GeometryFile& file, const Patch& patch, std::size_t* num_split)
{
    const Geometry& geometry = file.geometry;
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
    append_patched(
        file.path, file.bytes, 0, geometry,
        {patch.samples, split.directions, split.index_starts, split.new_indices}, out);
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
            throw malformed(
                {path, 0, "byte " + std::to_string(edit.start)},
                "the deformed value does not fit the type it is stored in (got " +
                    shortest(edit.value) + ")");
        const std::size_t size = stored_size(edit.scalar);
        replace(edit.start, size > 0 ? size : token_length(bytes, edit.start - start),
                text);
    };
    EditStream samples(geometry.sample_places, geometry.samples, patch.samples);
    EditStream directions(geometry.direction_places, geometry.directions,
                          patch.directions);
    std::size_t index = 0;
    constexpr std::uint64_t kEnd = ~std::uint64_t(0);
    for (;;)
    {
        const std::uint64_t s = samples.is_done() ? kEnd : samples.start();
        const std::uint64_t d = directions.is_done() ? kEnd : directions.start();
        const std::uint64_t i =
            index == patch.index_starts.size() ? kEnd : patch.index_starts[index];
        const std::uint64_t first = std::min({s, d, i});
        if (first == kEnd)
            break;
        if (first == i)
        {
            replace(i, token_length(bytes, i - start),
                    std::to_string(patch.new_indices[index]));
            ++index;
            continue;
        }
        EditStream& stream = first == s ? samples : directions;
        if (stream.changes())
            apply(stream.edit());
        stream.advance();
    }
    out.append(bytes.substr(copied - start));
}

} // namespace cellwarp
