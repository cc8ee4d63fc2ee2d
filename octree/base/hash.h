// SPDX-License-Identifier: GPL-3.0-or-later
// A number of 64 bits for any bytes. The only file behind it is hash.cpp; nothing else
// knows the library.
#pragma once

#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace cellwarp::core
{

/// The same on every machine with this order of bytes. \p seed: what came before.
std::uint64_t hash_of(const void* bytes, std::size_t count, std::uint64_t seed = 0);

/// Of a number; different ones have different hashes, and 0 has 0.
constexpr std::uint64_t hash_of(std::uint64_t x)
{
    x = (x ^ x >> 31) * 0x9e3779b97f4a7c15u;
    x = (x ^ x >> 29) * 0xbf58476d1ce4e5b9u;
    return x ^ x >> 32;
}

/// Of a place; a zero of either sign is one.
std::uint64_t hash_of(const Eigen::Vector3d& x);

} // namespace cellwarp::core
