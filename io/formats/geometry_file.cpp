// SPDX-License-Identifier: GPL-3.0-or-later
// Which scanner reads which extension, and who writes it.
#include "io/formats/geometry_file.h"

#include <algorithm>
#include <filesystem>
#include <future>
#include <memory>
#include <utility>
#include <vector>

#include "io/base/bytes.h"
#include "io/base/text.h"
#include "io/formats/gltf.h"
#include "io/formats/obj.h"
#include "io/formats/part_patch.h"
#include "io/formats/pcd.h"
#include "io/formats/scanner.h"
#include "io/formats/stl.h"
#include "io/import/import.h"

namespace cellwarp::core
{

namespace
{

constexpr std::string_view kFormats[] = {"obj", "ply", "stl", "off", "pcd",  "xyz",
                                         "pts", "csv", "txt", "asc", "gltf", "glb"};

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
    return Error(Fault::Usage,
                 at({path.empty() ? "''" : path, 0, ""},
                    "the extension is no known format (need " + known +
                        "; only to read: dae, fbx, 3ds, blend, x and others)"));
}

GeometryFile scan_geometry(std::string path, std::string bytes,
                           const ReadOptions& options)
{
    GeometryFile file{std::move(path), std::move(bytes), {}};
    const std::string extension = extension_of(file.path);
    file.geometry.format = extension;
    if (!is_geometry_format(extension))
        throw unknown_format(file.path);
    check_content(file.path, extension, file.bytes, 0, true);
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

std::string patched(const GeometryFile& file, const DeformedSamples& patch)
{
    std::string out;
    out.reserve(file.bytes.size() + file.bytes.size() / 8);
    write_patched(file, patch, [&](std::string_view bytes) { out.append(bytes); });
    return out;
}

std::size_t write_patched(const GeometryFile& file, const DeformedSamples& patch,
                          const BytesSink& write, std::uint64_t bytes_at_once)
{
    const Geometry& geometry = file.geometry;
    if (file.gltf || !geometry.unpacked.empty())
    {
        write(file.gltf ? patched_gltf(file, patch, {}).bytes : patched_pcd(file, patch));
        return 0;
    }
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
    const PatchedBytes bytes(file.path, file.bytes, 0, geometry,
                             {patch.samples, split.directions, patch.tangents,
                              patch.rotations, split.indices});
    const std::vector<std::uint64_t> cuts = bytes.cuts(bytes_at_once);
    std::string ready, next;
    for (std::size_t k = 1; k <= cuts.size(); ++k)
    {
        // While one range is written, the next one's numbers become text. Where there is
        // no thread left, that waits for get().
        std::future<void> text;
        next.clear();
        if (k < cuts.size())
            text = std::async(std::launch::async | std::launch::deferred,
                              [&, k] { bytes.append_to(next, cuts[k - 1], cuts[k]); });
        if (!ready.empty())
            write(ready);
        if (text.valid())
            text.get();
        ready.swap(next);
    }
    const std::string_view tail = bytes.tail();
    const std::string_view lines_end =
        split.lines.empty() ? tail : without_end_mark(tail, file.bytes.size());
    write(lines_end);
    write(split.lines);
    write(tail.substr(lines_end.size()));
    return split.num_lines;
}

} // namespace cellwarp::core
