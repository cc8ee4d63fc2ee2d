// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/mpi/spread.h"

#include <algorithm>
#include <optional>

#include "io/base/error.h"
#include "io/formats/geometry.h"
#include "io/formats/part_patch.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Vertices that are in memory at once [bytes of the file].
constexpr std::uint64_t kPartBytes = std::uint64_t(1) << 22;
/// Longest header, and what may stand before it.
constexpr std::uint64_t kHeadBytes = (std::uint64_t(1) << 20) + 3;

} // namespace

SpreadPly::SpreadPly(const std::string& path)
    : path_(path), input_(path), scanner_(path, input_.size())
{
    const std::optional<PlyScanner::Vertices> found =
        scanner_.find_vertices(read(0, std::min(kHeadBytes, input_.size())), none_);
    if (!found)
        throw Error(Fault::Usage,
                    at({path, 0, ""}, "cannot be spread: its vertices must be binary and "
                                      "of one size, and no lists before them"));
    vertices_ = *found;
}

std::string SpreadPly::read(std::uint64_t start, std::uint64_t count) const
{
    std::string bytes(idx(count), '\0');
    input_.read_at(start, bytes.data(), bytes.size());
    return bytes;
}

void SpreadPly::write_share(std::uint64_t i, std::uint64_t count,
                            const Deformation& deformation, RangeFile& output)
{
    const std::uint64_t end = vertices_.start + vertices_.count * vertices_.bytes;
    for (const auto& [first, last] :
         {std::pair<std::uint64_t, std::uint64_t>(0, vertices_.start),
          {end, input_.size()}})
    {
        const auto [from, to] = share_of(first, last, i, count);
        copy(from, to, output);
    }
    const auto [from, to] = share_of(0, vertices_.count, i, count);
    move(from, to, deformation, output);
    input_.check_unchanged();
    output.sync();
}

void SpreadPly::copy(std::uint64_t start, std::uint64_t end, RangeFile& output) const
{
    for (; start < end; start += std::min(kPartBytes, end - start))
        output.write_at(start, read(start, std::min(kPartBytes, end - start)));
}

void SpreadPly::move(std::uint64_t first, std::uint64_t end,
                     const Deformation& deformation, RangeFile& output)
{
    const std::uint64_t at_once =
        std::max<std::uint64_t>(1, kPartBytes / vertices_.bytes);
    std::string moved;
    for (std::uint64_t i = first; i < end; i += std::min(at_once, end - i))
    {
        const std::uint64_t start = vertices_.start + i * vertices_.bytes;
        const std::string bytes =
            read(start, std::min(at_once, end - i) * vertices_.bytes);
        Geometry geometry = none_;
        geometry.samples_before = i;
        scanner_.seek_vertex(i);
        scanner_.scan(bytes, start, false, geometry);
        check_magnitude(path_, geometry);
        num_bad_normals_ += geometry.num_bad_normals;
        num_bad_rotations_ += geometry.num_bad_rotations;
        num_missing_ += geometry.num_missing;
        std::vector<Eigen::Vector3d> samples = geometry.samples,
                                     directions = geometry.directions;
        std::vector<Eigen::Vector4d> rotations = geometry.rotations;
        deformation.carry({samples,
                           {geometry.direction_samples, directions},
                           {},
                           {geometry.rotation_samples, rotations}});
        moved.clear();
        PatchedBytes(path_, bytes, start, geometry,
                     {samples, directions, {}, rotations, {}})
            .append_to(moved);
        output.write_at(start, moved);
    }
}

std::pair<std::uint64_t, std::uint64_t> share_of(std::uint64_t begin, std::uint64_t end,
                                                 std::uint64_t i, std::uint64_t count)
{
    const std::uint64_t each = (end - begin) / count, rest = (end - begin) % count;
    const auto start = [&](std::uint64_t k)
    { return begin + k * each + std::min(k, rest); };
    return {start(i), start(i + 1)};
}

} // namespace cellwarp::core
