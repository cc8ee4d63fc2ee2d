// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/meshopt_view.h"

#include <cstring>
#include <vector>

#include <meshoptimizer.h>

namespace cellwarp::core
{

namespace
{

/// The most bytes that one byte can stand for: 256 equal bytes take 16 times two bits.
/// Triangles and indices take a byte or more each.
constexpr std::uint64_t kMostOfByte = 64;

} // namespace

std::string MeshoptView::fault() const
{
    const std::string got = "byteStride: got " + std::to_string(stride) + ", need ";
    if (mode != Mode::Attributes)
    {
        if (stride != 2 && stride != 4)
            return got + "2 or 4 for indices";
        if (filter != Filter::None)
            return "filter: indices have none";
        if (mode == Mode::Triangles && count % 3 != 0)
            return "count: got " + std::to_string(count) + ", need a multiple of 3";
        return {};
    }
    if (stride == 0 || stride > 256 || stride % 4 != 0)
        return got + "a multiple of 4 up to 256";
    if (filter == Filter::Octahedral && stride != 4 && stride != 8)
        return got + "4 or 8 for its filter";
    if (filter == Filter::Quaternion && stride != 8)
        return got + "8 for its filter";
    return {};
}

bool MeshoptView::may_come_from(std::uint64_t bytes) const
{
    return count <= kMostOfByte * bytes / stride;
}

bool unpack_meshopt(std::string_view bytes, const MeshoptView& view, char* out)
{
    const std::size_t count = static_cast<std::size_t>(view.count),
                      stride = static_cast<std::size_t>(view.stride);
    // The library writes words.
    std::vector<std::uint32_t> words((count * stride + 3) / 4);
    if (count == 0)
        return true;
    const auto* const from = reinterpret_cast<const unsigned char*>(bytes.data());
    using Mode = MeshoptView::Mode;
    int fault = 0;
    if (view.mode == Mode::Attributes)
        fault =
            meshopt_decodeVertexBuffer(words.data(), count, stride, from, bytes.size());
    else if (view.mode == Mode::Triangles)
        fault =
            meshopt_decodeIndexBuffer(words.data(), count, stride, from, bytes.size());
    else
        fault =
            meshopt_decodeIndexSequence(words.data(), count, stride, from, bytes.size());
    if (fault != 0)
        return false;
    switch (view.filter)
    {
    case MeshoptView::Filter::None:
        break;
    case MeshoptView::Filter::Octahedral:
        meshopt_decodeFilterOct(words.data(), count, stride);
        break;
    case MeshoptView::Filter::Quaternion:
        meshopt_decodeFilterQuat(words.data(), count, stride);
        break;
    case MeshoptView::Filter::Exponential:
        meshopt_decodeFilterExp(words.data(), count, stride);
        break;
    }
    std::memcpy(out, words.data(), count * stride);
    return true;
}

} // namespace cellwarp::core
