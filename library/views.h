// SPDX-License-Identifier: GPL-3.0-or-later
// Arrays of the caller, read and written through their views.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include <cellwarp/points.h>

namespace cellwarp
{

/// Throws Fault::Usage, with \p name as field, for a view that shows no array: without
/// data, or with numbers behind the last vector.
template <int size>
void check_view(const VectorsView<size>& view, const char* name);

/// Vectors from \p first on, as many as \p out has. \pre check_view()
template <int size>
void read_vectors(const VectorsView<size>& view, std::size_t first,
                  std::span<Eigen::Matrix<double, size, 1>> out);

/// The other way.
template <int size>
void write_vectors(std::span<const Eigen::Matrix<double, size, 1>> vectors,
                   std::size_t first, const VectorsSpan<size>& out);

/// All of them.
template <int size>
std::vector<Eigen::Matrix<double, size, 1>> vectors_of(const VectorsView<size>& view,
                                                       const char* name);

/// Corners of all faces, and the end of each face among them.
struct FaceLists
{
    std::vector<std::uint32_t> corners;
    std::vector<std::uint64_t> ends;
};

/// Throws Fault::Usage for a view that shows no array, Fault::Malformed for an index that
/// no sample can have.
FaceLists faces_of(const FacesView& view);

} // namespace cellwarp
