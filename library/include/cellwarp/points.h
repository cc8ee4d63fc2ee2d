// SPDX-License-Identifier: GPL-3.0-or-later
// Views of arrays that belong to the caller: places, directions, faces. They describe any
// layout and copy nothing: rows as in NumPy and CGAL, columns as in libigl, floats of a
// vertex buffer, numbers in the middle of a larger structure.
#pragma once

#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <ranges>
#include <span>
#include <type_traits>

namespace cellwarp
{

using Vec3 = std::array<double, 3>;
/// Rows of a matrix that maps a column x to M x; the last row is 0 0 0 1.
using Mat4 = std::array<std::array<double, 4>, 4>;

inline constexpr Mat4 kIdentity = {
    {{{1, 0, 0, 0}}, {{0, 1, 0, 0}}, {{0, 0, 1, 0}}, {{0, 0, 0, 1}}}};

enum class Scalar : std::uint8_t
{
    Float32,
    Float64
};

enum class Integer : std::uint8_t
{
    Int32,
    UInt32,
    Int64,
    UInt64
};

template <class T>
concept Real = std::same_as < std::remove_cv_t<T>,
double > || std::same_as<std::remove_cv_t<T>, float>;

template <class T>
concept Index = std::integral<std::remove_cv_t<T>> &&(sizeof(T) == 4 || sizeof(T) == 8);

template <Real T>
inline constexpr Scalar scalar_of = sizeof(T) == 4 ? Scalar::Float32 : Scalar::Float64;

template <Index T>
inline constexpr Integer
    integer_of = sizeof(T) == 4
                     ? (std::is_signed_v<T> ? Integer::Int32 : Integer::UInt32)
                     : (std::is_signed_v<T> ? Integer::Int64 : Integer::UInt64);

/// Type of x[0] for an element such as std::array or Eigen::Vector3d.
template <class Element>
using NumberOf = std::remove_cvref_t<decltype(std::declval<const Element&>()[0])>;

template <class Range>
using ElementOf = std::ranges::range_value_t<Range>;

/// A contiguous range of numbers, and one of elements that have numbers.
template <class Range>
concept Numbers = std::ranges::contiguous_range<Range> && Real<ElementOf<Range>>;
template <class Range>
concept Vectors = std::ranges::contiguous_range<Range> && requires
{
    requires Real<NumberOf<ElementOf<Range>>>;
};
template <class Range>
concept Structures = std::ranges::contiguous_range<Range> && !Real<ElementOf<Range>>;

/// \p size numbers for each of `count` vectors, to be read. It is valid as long as the
/// array is; calls look at it only while they run. All members may be set directly.
template <int size>
struct VectorsView
{
    const void* data = nullptr;
    std::size_t count = 0; ///< vectors
    Scalar scalar = Scalar::Float64;
    /// From one vector to the next, and from one number of a vector to the next [byte].
    std::ptrdiff_t stride = size * sizeof(double), axis = sizeof(double);
    std::size_t excess = 0; ///< numbers behind the last whole vector: calls refuse them

    VectorsView() = default;
    /// Packed rows: x y z x y z ...
    template <Numbers Range>
    VectorsView(const Range& numbers)
        : data(std::ranges::data(numbers)), count(std::ranges::size(numbers) / size),
          scalar(scalar_of<ElementOf<Range>>), stride(size * sizeof(ElementOf<Range>)),
          axis(sizeof(ElementOf<Range>)), excess(std::ranges::size(numbers) % size)
    {
    }
    /// Elements that begin with their numbers: std::array, Eigen::Vector3d, ...
    template <Vectors Range>
    VectorsView(const Range& vectors)
        : VectorsView(vectors, scalar_of<NumberOf<ElementOf<Range>>>)
    {
    }
    /// Elements that begin with \p size numbers of type \p as, such as the vertices of a
    /// graphics card.
    template <Structures Range>
    VectorsView(const Range& structures, Scalar as)
        : data(std::ranges::data(structures)), count(std::ranges::size(structures)),
          scalar(as), stride(sizeof(ElementOf<Range>)),
          axis(as == Scalar::Float32 ? sizeof(float) : sizeof(double))
    {
        static_assert(sizeof(ElementOf<Range>) >= size * sizeof(float));
    }
    /// Columns, one after the other, as in a column-major matrix of \p n rows.
    template <Real T>
    static VectorsView columns(const T* first, std::size_t n)
    {
        VectorsView view;
        view.data = first;
        view.count = n;
        view.scalar = scalar_of<T>;
        view.stride = sizeof(T);
        view.axis = static_cast<std::ptrdiff_t>(n * sizeof(T));
        return view;
    }
    bool empty() const { return count == 0 && excess == 0; }
};
using PointsView = VectorsView<3>;
using QuaternionsView = VectorsView<4>; ///< w x y z, of any length but 0

/// The same, to be written as well. No two of its numbers may share a byte.
template <int size>
struct VectorsSpan : VectorsView<size>
{
    VectorsSpan() = default;
    template <Numbers Range>
    requires(
        !std::is_const_v<std::remove_reference_t<std::ranges::range_reference_t<Range>>>)
        VectorsSpan(Range&& numbers)
        : VectorsView<size>(numbers)
    {
    }
    template <Vectors Range>
    requires(
        !std::is_const_v<std::remove_reference_t<std::ranges::range_reference_t<Range>>>)
        VectorsSpan(Range&& vectors)
        : VectorsView<size>(vectors)
    {
    }
    template <Structures Range>
    requires(
        !std::is_const_v<std::remove_reference_t<std::ranges::range_reference_t<Range>>>)
        VectorsSpan(Range&& structures, Scalar as)
        : VectorsView<size>(structures, as)
    {
    }
    template <Real T>
    requires(!std::is_const_v<T>) static VectorsSpan columns(T* first, std::size_t n)
    {
        VectorsSpan span;
        static_cast<VectorsView<size>&>(span) = VectorsView<size>::columns(first, n);
        return span;
    }
};
using PointsSpan = VectorsSpan<3>;
using QuaternionsSpan = VectorsSpan<4>;

/// Polygons, each a list of sample numbers from 0, to be read.
struct FacesView
{
    const void* corners = nullptr;
    std::size_t count = 0; ///< faces
    Integer integer = Integer::UInt32;
    std::size_t corners_a_face = 3; ///< 0: faces end where `ends` says
    /// From one face to the next, and from one corner of a face to the next [byte].
    std::ptrdiff_t stride = 3 * sizeof(std::uint32_t), axis = sizeof(std::uint32_t);
    /// With corners_a_face 0: face f has the corners from ends[f - 1] (or 0) up to but
    /// without ends[f].
    std::span<const std::uint64_t> ends = {};

    FacesView() = default;
    /// Elements that are indices and nothing else, as many for each face: std::array of
    /// three or four, Eigen::Vector3i, ...
    template <std::ranges::contiguous_range Range>
    requires Index<NumberOf<ElementOf<Range>>> FacesView(const Range& faces)
        : corners(std::ranges::data(faces)), count(std::ranges::size(faces)),
          integer(integer_of<NumberOf<ElementOf<Range>>>),
          corners_a_face(sizeof(ElementOf<Range>) / sizeof(NumberOf<ElementOf<Range>>)),
          stride(sizeof(ElementOf<Range>)), axis(sizeof(NumberOf<ElementOf<Range>>))
    {
    }
    /// Packed triangles, or faces of \p corners_a_face corners; a rest is left out.
    template <Index T>
    static FacesView packed(std::span<const T> indices, std::size_t corners_a_face = 3)
    {
        FacesView view;
        view.corners = indices.data();
        view.count = corners_a_face == 0 ? 0 : indices.size() / corners_a_face;
        view.integer = integer_of<T>;
        view.corners_a_face = corners_a_face;
        view.stride = static_cast<std::ptrdiff_t>(corners_a_face * sizeof(T));
        view.axis = sizeof(T);
        return view;
    }
    /// A column-major matrix of \p n rows, one a face.
    template <Index T>
    static FacesView columns(const T* first, std::size_t n,
                             std::size_t corners_a_face = 3)
    {
        FacesView view;
        view.corners = first;
        view.count = n;
        view.integer = integer_of<T>;
        view.corners_a_face = corners_a_face;
        view.stride = sizeof(T);
        view.axis = static_cast<std::ptrdiff_t>(n * sizeof(T));
        return view;
    }
    /// Polygons of any numbers of corners.
    template <Index T>
    static FacesView polygons(std::span<const T> indices,
                              std::span<const std::uint64_t> ends)
    {
        FacesView view;
        view.corners = indices.data();
        view.count = ends.size();
        view.integer = integer_of<T>;
        view.corners_a_face = 0;
        view.axis = sizeof(T);
        view.ends = ends;
        return view;
    }
};

} // namespace cellwarp
