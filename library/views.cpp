// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/views.h"

#include <cstring>
#include <string>

#include "io/base/error.h"
#include "io/formats/geometry.h"
#include "library/calls.h"
#include "octree/base/parallel.h"

namespace cellwarp
{

namespace
{

/// So many vectors are not worth a second thread.
constexpr std::size_t kGrain = 1 << 14;

/// Numbers may lie at any address.
template <class Number>
Number number_at(const char* place)
{
    Number number;
    std::memcpy(&number, place, sizeof number);
    return number;
}

template <int size, class Number>
void read_as(const VectorsView<size>& view, std::size_t first,
             std::span<Eigen::Matrix<double, size, 1>> out)
{
    const char* const begin = static_cast<const char*>(view.data) +
                              static_cast<std::ptrdiff_t>(first) * view.stride;
    core::parallel_for(out.size(), kGrain,
                       [&](std::size_t i)
                       {
                           const char* const vector =
                               begin + static_cast<std::ptrdiff_t>(i) * view.stride;
                           for (int k = 0; k < size; ++k)
                               out[i][k] = static_cast<double>(
                                   number_at<Number>(vector + k * view.axis));
                       });
}

template <int size, class Number>
void write_as(std::span<const Eigen::Matrix<double, size, 1>> vectors, std::size_t first,
              const VectorsSpan<size>& out)
{
    // The caller has said by the type that the array may be written.
    char* const begin = static_cast<char*>(const_cast<void*>(out.data)) +
                        static_cast<std::ptrdiff_t>(first) * out.stride;
    core::parallel_for(vectors.size(), kGrain,
                       [&](std::size_t i)
                       {
                           char* const vector =
                               begin + static_cast<std::ptrdiff_t>(i) * out.stride;
                           for (int k = 0; k < size; ++k)
                           {
                               const auto number = static_cast<Number>(vectors[i][k]);
                               std::memcpy(vector + k * out.axis, &number, sizeof number);
                           }
                       });
}

std::string corner_name(std::size_t face, std::size_t corner)
{
    return "faces[" + std::to_string(face) + "][" + std::to_string(corner) + "]";
}

template <class Number>
void read_corners(const FacesView& view, FaceLists& out)
{
    const char* const begin = static_cast<const char*>(view.corners);
    std::size_t face = 0, corner = 0;
    for (std::size_t c = 0; c < out.corners.size(); ++c, ++corner)
    {
        while (c == out.ends[face])
        {
            ++face;
            corner = 0;
        }
        const std::ptrdiff_t at =
            view.corners_a_face == 0
                ? static_cast<std::ptrdiff_t>(c) * view.axis
                : static_cast<std::ptrdiff_t>(face) * view.stride +
                      static_cast<std::ptrdiff_t>(corner) * view.axis;
        const Number index = number_at<Number>(begin + at);
        const auto unsigned_index = static_cast<std::uint64_t>(index);
        if (index < 0 || unsigned_index >= core::kNone)
            throw core::malformed({"", 0, corner_name(face, corner)},
                                  "got " + std::to_string(index) +
                                      ", need the number of a sample");
        out.corners[c] = static_cast<std::uint32_t>(unsigned_index);
    }
}

/// Ends that rise, each face with a corner.
void check_ends(std::span<const std::uint64_t> ends)
{
    for (std::size_t f = 0; f < ends.size(); ++f)
        if (ends[f] <= (f == 0 ? 0 : ends[f - 1]))
            throw core::malformed({"", 0, "faces.ends[" + std::to_string(f) + "]"},
                                  "got " + std::to_string(ends[f]) +
                                      ", need more than the end before it");
}

} // namespace

template <int size>
void check_view(const VectorsView<size>& view, const char* name)
{
    if (view.excess > 0)
        throw wrong_argument(name,
                             "its numbers are no multiple of " + std::to_string(size));
    if (view.count >= core::kNone)
        throw wrong_argument(name, "got " + std::to_string(view.count) +
                                       " vectors, need fewer than 2^32 - 1");
    if (view.count > 0 && !view.data)
        throw wrong_argument(name, "the array is null");
    if (view.scalar != Scalar::Float32 && view.scalar != Scalar::Float64)
        throw wrong_argument(name, "its scalar is neither Float32 nor Float64");
}

template <int size>
void read_vectors(const VectorsView<size>& view, std::size_t first,
                  std::span<Eigen::Matrix<double, size, 1>> out)
{
    if (view.scalar == Scalar::Float32)
        read_as<size, float>(view, first, out);
    else
        read_as<size, double>(view, first, out);
}

template <int size>
void write_vectors(std::span<const Eigen::Matrix<double, size, 1>> vectors,
                   std::size_t first, const VectorsSpan<size>& out)
{
    if (out.scalar == Scalar::Float32)
        write_as<size, float>(vectors, first, out);
    else
        write_as<size, double>(vectors, first, out);
}

template <int size>
std::vector<Eigen::Matrix<double, size, 1>> vectors_of(const VectorsView<size>& view,
                                                       const char* name)
{
    check_view(view, name);
    std::vector<Eigen::Matrix<double, size, 1>> vectors(view.count);
    read_vectors<size>(view, 0, vectors);
    return vectors;
}

FaceLists faces_of(const FacesView& view)
{
    FaceLists out;
    const bool has_ends = view.corners_a_face == 0;
    if (view.count > 0 && !view.corners)
        throw wrong_argument("faces", "the array is null");
    if (has_ends && view.ends.size() != view.count)
        throw wrong_argument("faces.ends", "got " + std::to_string(view.ends.size()) +
                                               ", need one for each of " +
                                               std::to_string(view.count) + " faces");
    constexpr std::size_t kMost = std::size_t(1) << 40; // corners
    if (!has_ends && view.count > kMost / view.corners_a_face)
        throw wrong_argument("faces", "there are too many");
    if (has_ends)
    {
        check_ends(view.ends);
        out.ends.assign(view.ends.begin(), view.ends.end());
        if (!out.ends.empty() && out.ends.back() > kMost)
            throw wrong_argument("faces.ends", "there are too many corners");
    }
    else
    {
        out.ends.resize(view.count);
        for (std::size_t f = 0; f < view.count; ++f)
            out.ends[f] = (f + 1) * view.corners_a_face;
    }
    out.corners.resize(out.ends.empty() ? 0 : out.ends.back());
    switch (view.integer)
    {
    case Integer::Int32:
        read_corners<std::int32_t>(view, out);
        break;
    case Integer::UInt32:
        read_corners<std::uint32_t>(view, out);
        break;
    case Integer::Int64:
        read_corners<std::int64_t>(view, out);
        break;
    case Integer::UInt64:
        read_corners<std::uint64_t>(view, out);
        break;
    default:
        throw wrong_argument("faces", "its integer is of no known type");
    }
    return out;
}

template void check_view<3>(const VectorsView<3>&, const char*);
template void check_view<4>(const VectorsView<4>&, const char*);
template void read_vectors<3>(const VectorsView<3>&, std::size_t,
                              std::span<Eigen::Vector3d>);
template void read_vectors<4>(const VectorsView<4>&, std::size_t,
                              std::span<Eigen::Vector4d>);
template void write_vectors<3>(std::span<const Eigen::Vector3d>, std::size_t,
                               const VectorsSpan<3>&);
template void write_vectors<4>(std::span<const Eigen::Vector4d>, std::size_t,
                               const VectorsSpan<4>&);
template std::vector<Eigen::Vector3d> vectors_of<3>(const VectorsView<3>&, const char*);
template std::vector<Eigen::Vector4d> vectors_of<4>(const VectorsView<4>&, const char*);

} // namespace cellwarp
