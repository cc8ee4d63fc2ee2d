// SPDX-License-Identifier: GPL-3.0-or-later
// Memory for large arrays, in large pages where the system has them on request. A fresh
// page costs as much as filling 4 kB several times, on virtual machines many times; one
// of 2 MB costs little more than one of 4 kB.
#pragma once

#include <array>
#include <cstddef>
#include <mutex>

namespace cellwarp::core
{

/// Arrays lie side by side in blocks of many large pages, so that only the ends of a
/// block are pages that nobody uses. What is given back is taken again first; beyond a
/// few megabytes it goes back to the system. Safe for many threads. Never frees its
/// blocks, takes no other memory, and needs no destructor: it serves operator new.
class LargeHeap
{
public:
    /// Those of a small edit, too: two heaps of about the same arrays would take more
    /// memory than one [byte].
    static constexpr std::size_t kSmallest = std::size_t{128} << 10;

    constexpr LargeHeap() = default;
    LargeHeap(const LargeHeap&) = delete;
    LargeHeap& operator=(const LargeHeap&) = delete;

    /// Memory that begins at a page, its contents anything; null where the system has
    /// none, or the heap more arrays than it can count. \pre bytes > 0
    void* take(std::size_t bytes) noexcept;
    /// False, and nothing is done, if \p array is not from take().
    bool give_back(void* array) noexcept;
    /// Returns to the system all that is free.
    void release() noexcept;

    std::size_t in_use() const noexcept; ///< [byte], in whole pages
    std::size_t kept() const noexcept;   ///< free, but not returned to the system [byte]

private:
    /// Bytes that are all in use or all free. They follow each other by their addresses.
    struct Extent
    {
        char* begin;
        std::size_t size;
        bool is_free;
        std::size_t kept; ///< of a free one, what may still be with us [byte]
        char* end() const { return begin + size; }
    };
    static constexpr std::size_t kMostExtents = 4096;

    Extent* fitting(std::size_t size) noexcept;
    bool grow(std::size_t size) noexcept;
    void insert(std::size_t at, const Extent& extent) noexcept;
    bool join_with_next(std::size_t at) noexcept;
    void release(Extent& extent) noexcept;

    mutable std::mutex mutex_;
    std::array<Extent, kMostExtents> extents_{};
    std::size_t count_ = 0;
    std::size_t in_use_ = 0, kept_ = 0;
};

/// The one that operator new of our programs takes large arrays from (large_arrays.cpp).
extern LargeHeap large_heap;

/// Returns to the system what the C library and large_heap hold of freed memory.
void release_freed_memory() noexcept;

} // namespace cellwarp::core
