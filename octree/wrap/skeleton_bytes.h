// SPDX-License-Identifier: GPL-3.0-or-later
// Surfaces and skeletons between the program that finds these and the others, on one
// machine: numbers as they are in memory.
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

#include "octree/wrap/skeleton.h"

namespace cellwarp::core
{

/// What the program ends with where it finds no memory.
inline constexpr int kSkeletonWithoutMemory = 3;

/// Takes values off the front of bytes; after one that is not there nothing is.
class ByteReader
{
public:
    explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}
    template <class Value>
    Value take()
    {
        Value value{};
        if (bytes_.size() < sizeof value)
            is_good_ = false;
        else
            std::memcpy(&value, bytes_.data(), sizeof value);
        bytes_.remove_prefix(is_good_ ? sizeof value : bytes_.size());
        return value;
    }
    /// A number of items of at least \p size bytes each.
    std::uint64_t count(std::size_t size)
    {
        const auto number = take<std::uint64_t>();
        if (number > bytes_.size() / size)
            is_good_ = false;
        return is_good_ ? number : 0;
    }
    Eigen::Vector3d vector()
    {
        const double x = take<double>(), y = take<double>();
        return {x, y, take<double>()};
    }
    bool is_good() const { return is_good_ && bytes_.empty(); }

private:
    std::string_view bytes_;
    bool is_good_ = true;
};

template <class Value>
void append(std::string& bytes, const Value& value)
{
    bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

inline void append(std::string& bytes, const std::vector<Eigen::Vector3d>& points)
{
    append(bytes, std::uint64_t(points.size()));
    for (const Eigen::Vector3d& x : points)
        for (int k = 0; k < 3; ++k)
            append(bytes, x[k]);
}

inline std::vector<Eigen::Vector3d> take_points(ByteReader& reader)
{
    std::vector<Eigen::Vector3d> points(reader.count(24));
    for (Eigen::Vector3d& x : points)
        x = reader.vector();
    return points;
}

inline std::string bytes_of(const Shape& surface)
{
    std::string bytes;
    append(bytes, surface.samples);
    append(bytes, std::uint64_t(surface.triangles.size()));
    for (const Triangle& triangle : surface.triangles)
        for (const std::uint32_t corner : triangle)
            append(bytes, corner);
    return bytes;
}

inline bool read_bytes(std::string_view bytes, Shape& surface)
{
    ByteReader reader(bytes);
    surface.samples = take_points(reader);
    surface.triangles.resize(reader.count(12));
    for (Triangle& triangle : surface.triangles)
        for (std::uint32_t& corner : triangle)
            corner = reader.take<std::uint32_t>();
    return reader.is_good();
}

inline std::string bytes_of(const CurveSkeleton& skeleton)
{
    std::string bytes;
    append(bytes, skeleton.points);
    for (const std::vector<Eigen::Vector3d>& around : skeleton.around)
        append(bytes, around);
    append(bytes, std::uint64_t(skeleton.edges.size()));
    for (const std::array<int, 2>& edge : skeleton.edges)
        append(bytes, edge);
    return bytes;
}

inline bool read_bytes(std::string_view bytes, CurveSkeleton& skeleton)
{
    ByteReader reader(bytes);
    skeleton.points = take_points(reader);
    for (std::size_t i = 0; i < skeleton.points.size(); ++i)
        skeleton.around.push_back(take_points(reader));
    skeleton.edges.resize(reader.count(8));
    const int count = static_cast<int>(skeleton.points.size());
    bool is_good = true;
    for (std::array<int, 2>& edge : skeleton.edges)
    {
        edge = reader.take<std::array<int, 2>>();
        for (const int end : edge)
            is_good = is_good && end >= 0 && end < count;
    }
    return is_good && reader.is_good();
}

} // namespace cellwarp::core
