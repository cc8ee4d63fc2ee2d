// SPDX-License-Identifier: GPL-3.0-or-later
// The records of a journal's file: their layout, and which of them are whole.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cellwarp::core
{

/// What stands before each payload.
struct RecordHead
{
    std::uint32_t length, checksum;
    std::uint64_t number;
};
static_assert(sizeof(RecordHead) == 16);

/// Longest payload [bytes].
inline constexpr std::uint64_t kMaxPayload = std::uint64_t(1) << 30;

/// A value as it lies in memory and in the file.
template <class Value>
std::string_view bytes_of(const Value& value)
{
    return {reinterpret_cast<const char*>(&value), sizeof value};
}

/// Of a record's length and number; its payload is added to it.
std::uint32_t checksum_of_head(std::uint32_t length, std::uint64_t number);

struct WholeRecords
{
    std::vector<std::uint64_t> starts; ///< [byte]
    std::uint64_t end = 0;             ///< of the last one [byte]
};

/// The records from byte \p first on, up to where the file of \p size bytes was cut.
/// Throws Fault::Malformed with the number of one that was altered, Fault::File.
WholeRecords whole_records(const std::string& path, int file, std::uint64_t first,
                           std::uint64_t size);

} // namespace cellwarp::core
