// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/large_heap.h"

#include <algorithm>
#include <cstdint>

#include <sys/mman.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kPage = 4096;                      // [byte]
constexpr std::size_t kLargePage = std::size_t{2} << 20; // [byte]
/// So much is asked of the system at once. Pages that nobody touches cost nothing.
constexpr std::size_t kBlock = std::size_t{32} << 20;
/// The heap keeps at most so much free memory [byte].
constexpr std::size_t kMostKept = std::size_t{4} << 20;

constexpr std::size_t rounded_up(std::size_t bytes, std::size_t to)
{
    return (bytes + to - 1) / to * to;
}

/// Large pages' worth of memory that begins at one; null: there is none.
char* map_block(std::size_t size)
{
    void* const got = ::mmap(nullptr, size + kLargePage, PROT_READ | PROT_WRITE,
                             MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (got == MAP_FAILED)
        return nullptr;
    char* const begin = static_cast<char*>(got);
    const std::size_t before =
        rounded_up(reinterpret_cast<std::uintptr_t>(begin), kLargePage) -
        reinterpret_cast<std::uintptr_t>(begin);
    if (before > 0)
        ::munmap(begin, before);
    if (before < kLargePage)
        ::munmap(begin + before + size, kLargePage - before);
#ifdef MADV_HUGEPAGE
    ::madvise(begin + before, size, MADV_HUGEPAGE); // else the pages are small ones
#endif
    return begin + before;
}

} // namespace

constinit LargeHeap large_heap;

void release_freed_memory() noexcept
{
#ifdef __GLIBC__
    ::malloc_trim(0);
#endif
    large_heap.release();
}

void* LargeHeap::take(std::size_t bytes) noexcept
{
    if (bytes > SIZE_MAX / 2)
        return nullptr;
    const std::size_t size = rounded_up(bytes, kPage);
    const std::lock_guard lock(mutex_);
    if (count_ + 2 > kMostExtents)
        return nullptr;
    Extent* found = fitting(size);
    if (!found && grow(size))
        found = fitting(size);
    if (!found)
        return nullptr;
    // Memory that was used before is mostly at the beginning.
    const std::size_t kept = std::min(found->kept, size);
    if (found->size > size)
        insert(static_cast<std::size_t>(found - extents_.data()) + 1,
               {found->begin + size, found->size - size, true, found->kept - kept});
    *found = {found->begin, size, false, 0};
    kept_ -= kept;
    in_use_ += size;
    return found->begin;
}

bool LargeHeap::give_back(void* array) noexcept
{
    if (!array || reinterpret_cast<std::uintptr_t>(array) % kPage != 0)
        return false;
    const std::lock_guard lock(mutex_);
    Extent* const end = extents_.data() + count_;
    Extent* const found =
        std::lower_bound(extents_.data(), end, static_cast<char*>(array),
                         [](const Extent& extent, const char* at)
                         { return std::less<>()(extent.begin, at); });
    if (found == end || found->begin != array || found->is_free)
        return false;
    found->is_free = true;
    found->kept = found->size;
    in_use_ -= found->size;
    kept_ += found->size;
    auto at = static_cast<std::size_t>(found - extents_.data());
    join_with_next(at);
    if (at > 0 && join_with_next(at - 1))
        --at;
    if (kept_ > kMostKept)
        release(extents_[at]);
    return true;
}

void LargeHeap::release() noexcept
{
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < count_; ++i)
        if (extents_[i].kept > 0)
            release(extents_[i]);
}

std::size_t LargeHeap::in_use() const noexcept
{
    const std::lock_guard lock(mutex_);
    return in_use_;
}

std::size_t LargeHeap::kept() const noexcept
{
    const std::lock_guard lock(mutex_);
    return kept_;
}

/// The smallest free extent that is large enough.
LargeHeap::Extent* LargeHeap::fitting(std::size_t size) noexcept
{
    Extent* best = nullptr;
    for (std::size_t i = 0; i < count_; ++i)
        if (Extent& extent = extents_[i];
            extent.is_free && extent.size >= size && (!best || extent.size < best->size))
            best = &extent;
    return best;
}

bool LargeHeap::grow(std::size_t size) noexcept
{
    std::size_t got = std::max(kBlock, rounded_up(size, kLargePage));
    char* begin = map_block(got);
    if (!begin && got > rounded_up(size, kLargePage))
    {
        got = rounded_up(size, kLargePage);
        begin = map_block(got);
    }
    if (!begin)
        return false;
    std::size_t at = 0;
    while (at < count_ && std::less<>()(extents_[at].begin, begin))
        ++at;
    insert(at, {begin, got, true, 0});
    join_with_next(at);
    if (at > 0)
        join_with_next(at - 1);
    return true;
}

void LargeHeap::insert(std::size_t at, const Extent& extent) noexcept
{
    std::move_backward(extents_.data() + at, extents_.data() + count_,
                       extents_.data() + count_ + 1);
    extents_[at] = extent;
    ++count_;
}

/// If both are free, and nothing is between them.
bool LargeHeap::join_with_next(std::size_t at) noexcept
{
    if (at + 1 >= count_)
        return false;
    Extent& one = extents_[at];
    const Extent& next = extents_[at + 1];
    if (!one.is_free || !next.is_free || one.end() != next.begin)
        return false;
    one.size += next.size;
    one.kept += next.kept;
    std::move(extents_.data() + at + 2, extents_.data() + count_,
              extents_.data() + at + 1);
    --count_;
    return true;
}

/// The large pages within it: of one that is used in part nothing can be returned.
void LargeHeap::release(Extent& extent) noexcept
{
    const std::size_t before =
        rounded_up(reinterpret_cast<std::uintptr_t>(extent.begin), kLargePage) -
        reinterpret_cast<std::uintptr_t>(extent.begin);
    if (before < extent.size)
        if (const std::size_t size = (extent.size - before) / kLargePage * kLargePage;
            size > 0)
            ::madvise(extent.begin + before, size, MADV_DONTNEED);
    kept_ -= extent.kept;
    extent.kept = 0;
}

} // namespace cellwarp::core
