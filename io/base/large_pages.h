// SPDX-License-Identifier: GPL-3.0-or-later
// Memory for long lists, in pages of megabytes: a large model is read mostly in the time
// that the system takes to hand over small ones.
#pragma once

#include <cstddef>
#include <vector>

namespace cellwarp::core
{

/// Asks the system for large pages from \p begin on, where it has them and it is worth
/// while. Contents stay.
void prefer_large_pages(void* begin, std::size_t bytes);

/// As list.reserve(count), in large pages.
template <class Value>
void reserve_large(std::vector<Value>& list, std::size_t count)
{
    list.reserve(count);
    prefer_large_pages(list.data(), list.capacity() * sizeof(Value));
}

} // namespace cellwarp::core
