// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/stored_number.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "io/base/number.h"

namespace cellwarp::core
{

static_assert(std::endian::native == std::endian::little,
              "the byte order of this machine is not handled");

namespace
{

template <class Number>
Number load(const char* bytes, bool big_endian)
{
    char raw[sizeof(Number)];
    std::memcpy(raw, bytes, sizeof raw);
    if (big_endian)
        std::reverse(raw, raw + sizeof raw);
    Number value;
    std::memcpy(&value, raw, sizeof raw);
    return value;
}

template <class Number>
void load(const char* bytes, std::size_t stride, bool big_endian, std::size_t count,
          double* values, std::size_t value_stride)
{
    const auto each = [&](bool is_swapped)
    {
        for (std::size_t i = 0; i < count; ++i)
            values[i * value_stride] =
                static_cast<double>(load<Number>(bytes + i * stride, is_swapped));
    };
    big_endian ? each(true) : each(false); // two loops: neither asks again
}

template <class Number>
void put(Number value, bool big_endian, char* bytes)
{
    std::memcpy(bytes, &value, sizeof value);
    if (big_endian)
        std::reverse(bytes, bytes + sizeof value);
}

template <class Integer>
bool fits(double value)
{
    return value == std::floor(value) &&
           value >= static_cast<double>(std::numeric_limits<Integer>::min()) &&
           value <= static_cast<double>(std::numeric_limits<Integer>::max());
}

template <class Integer>
bool put_rounded(double value, bool big_endian, char* bytes)
{
    const double rounded = std::nearbyint(value);
    if (!fits<Integer>(rounded))
        return false;
    put(static_cast<Integer>(rounded), big_endian, bytes);
    return true;
}

} // namespace

std::size_t stored_size(Scalar type)
{
    switch (type)
    {
    case Scalar::Text:
    case Scalar::TextInt:
    case Scalar::TextReal:
        return 0;
    case Scalar::Int8:
    case Scalar::UInt8:
        return 1;
    case Scalar::Int16:
    case Scalar::UInt16:
        return 2;
    case Scalar::Int32:
    case Scalar::UInt32:
    case Scalar::Float32:
        return 4;
    case Scalar::Float64:
        return 8;
    }
    return 0;
}

double load_stored(const char* bytes, Scalar type, bool big_endian)
{
    switch (type)
    {
    case Scalar::Text:
    case Scalar::TextInt:
    case Scalar::TextReal:
        break;
    case Scalar::Int8:
        return load<std::int8_t>(bytes, big_endian);
    case Scalar::UInt8:
        return load<std::uint8_t>(bytes, big_endian);
    case Scalar::Int16:
        return load<std::int16_t>(bytes, big_endian);
    case Scalar::UInt16:
        return load<std::uint16_t>(bytes, big_endian);
    case Scalar::Int32:
        return load<std::int32_t>(bytes, big_endian);
    case Scalar::UInt32:
        return load<std::uint32_t>(bytes, big_endian);
    case Scalar::Float32:
        return static_cast<double>(load<float>(bytes, big_endian));
    case Scalar::Float64:
        return load<double>(bytes, big_endian);
    }
    return 0.0;
}

void load_stored(const char* bytes, std::size_t stride, Scalar type, bool big_endian,
                 std::size_t count, double* values, std::size_t value_stride)
{
    const auto numbers = [&]<class Number>(Number)
    { load<Number>(bytes, stride, big_endian, count, values, value_stride); };
    switch (type)
    {
    case Scalar::Text:
    case Scalar::TextInt:
    case Scalar::TextReal:
        return;
    case Scalar::Int8:
        return numbers(std::int8_t());
    case Scalar::UInt8:
        return numbers(std::uint8_t());
    case Scalar::Int16:
        return numbers(std::int16_t());
    case Scalar::UInt16:
        return numbers(std::uint16_t());
    case Scalar::Int32:
        return numbers(std::int32_t());
    case Scalar::UInt32:
        return numbers(std::uint32_t());
    case Scalar::Float32:
        return numbers(float());
    case Scalar::Float64:
        return numbers(double());
    }
}

bool fits_stored(Scalar type, double value)
{
    switch (type)
    {
    case Scalar::Int8:
        return fits<std::int8_t>(value);
    case Scalar::UInt8:
        return fits<std::uint8_t>(value);
    case Scalar::Int16:
        return fits<std::int16_t>(value);
    case Scalar::UInt16:
        return fits<std::uint16_t>(value);
    case Scalar::Int32:
        return fits<std::int32_t>(value);
    case Scalar::UInt32:
        return fits<std::uint32_t>(value);
    default:
        return true;
    }
}

bool overwrite_stored(double value, Scalar type, bool big_endian, char* bytes)
{
    switch (type)
    {
    case Scalar::Text:
    case Scalar::TextInt:
    case Scalar::TextReal:
        break;
    case Scalar::Int8:
        return put_rounded<std::int8_t>(value, big_endian, bytes);
    case Scalar::UInt8:
        return put_rounded<std::uint8_t>(value, big_endian, bytes);
    case Scalar::Int16:
        return put_rounded<std::int16_t>(value, big_endian, bytes);
    case Scalar::UInt16:
        return put_rounded<std::uint16_t>(value, big_endian, bytes);
    case Scalar::Int32:
        return put_rounded<std::int32_t>(value, big_endian, bytes);
    case Scalar::UInt32:
        return put_rounded<std::uint32_t>(value, big_endian, bytes);
    case Scalar::Float32:
        put(static_cast<float>(value), big_endian, bytes);
        return std::isfinite(static_cast<float>(value));
    case Scalar::Float64:
        put(value, big_endian, bytes);
        return std::isfinite(value);
    }
    return false;
}

bool store(double value, Scalar type, bool big_endian, std::string& out)
{
    if (type == Scalar::Text)
        append_shortest(value, out);
    else if (type == Scalar::TextInt)
        append_shortest(std::nearbyint(value) + 0.0, out); // no -0
    else if (type == Scalar::TextReal)
    {
        const std::size_t first = out.size();
        append_shortest(value, out);
        if (out.find_first_not_of("-0123456789", first) == std::string::npos)
            out += ".0";
    }
    else
    {
        char bytes[sizeof(double)] = {};
        const bool fits = overwrite_stored(value, type, big_endian, bytes);
        out.append(bytes, stored_size(type));
        return fits;
    }
    return std::isfinite(value);
}

} // namespace cellwarp::core
