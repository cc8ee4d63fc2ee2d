// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/large_heap.h"

#include <cstring>
#include <memory>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "library/session/memory_limit.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kMegabyte = std::size_t{1} << 20;

/// An array whose bytes all are one number, which is looked at in the end.
struct Filled
{
    char* bytes;
    std::size_t size;
    char value;

    bool is_whole() const
    {
        return bytes[0] == value && std::memcmp(bytes, bytes + 1, size - 1) == 0;
    }
};

Filled filled(LargeHeap& heap, std::size_t size, char value)
{
    char* const bytes = static_cast<char*>(heap.take(size));
    EXPECT_TRUE(bytes);
    std::memset(bytes, value, size);
    return {bytes, size, value};
}

} // namespace

TEST(LargeHeap, keeps_arrays_apart)
{
    const auto heap = std::make_unique<LargeHeap>();
    std::mt19937 rng(5);
    std::vector<Filled> arrays;
    std::size_t in_use = 0;
    for (int step = 0; step < 300; ++step)
    {
        if (arrays.size() > 12 || (!arrays.empty() && rng() % 3 == 0))
        {
            std::swap(arrays[rng() % arrays.size()], arrays.back());
            EXPECT_TRUE(arrays.back().is_whole()) << step;
            EXPECT_TRUE(heap->give_back(arrays.back().bytes));
            in_use -= (arrays.back().size + 4095) / 4096 * 4096;
            arrays.pop_back();
        }
        else
        {
            const std::size_t size =
                1 + rng() % (rng() % 4 == 0 ? 9 : 2) * kMegabyte + rng() % kMegabyte;
            arrays.push_back(filled(*heap, size, static_cast<char>(step)));
            in_use += (size + 4095) / 4096 * 4096;
        }
        EXPECT_EQ(heap->in_use(), in_use);
        EXPECT_LE(heap->kept(), 4 * kMegabyte);
    }
    for (const Filled& array : arrays)
    {
        EXPECT_TRUE(array.is_whole());
        EXPECT_TRUE(heap->give_back(array.bytes));
    }
    heap->release();
    EXPECT_EQ(heap->in_use() + heap->kept(), 0u);
}

TEST(LargeHeap, gives_again_what_it_got_back)
{
    const auto heap = std::make_unique<LargeHeap>();
    void* const first = heap->take(3 * kMegabyte);
    void* const second = heap->take(5 * kMegabyte);
    EXPECT_TRUE(heap->give_back(first));
    EXPECT_EQ(heap->take(2 * kMegabyte), first);
    EXPECT_TRUE(heap->give_back(first));
    EXPECT_TRUE(heap->give_back(second));
    EXPECT_EQ(heap->take(8 * kMegabyte), first);
    EXPECT_TRUE(heap->give_back(first));
}

TEST(LargeHeap, returns_to_the_system_what_is_free)
{
    const auto heap = std::make_unique<LargeHeap>();
    const double before = resident_memory();
    const Filled large = filled(*heap, 100 * kMegabyte, 1);
    EXPECT_GT(resident_memory(), before + 99e6);
    EXPECT_TRUE(heap->give_back(large.bytes));
    EXPECT_LT(resident_memory(), before + 20e6);
    const Filled again = filled(*heap, 3 * kMegabyte, 2);
    EXPECT_TRUE(heap->give_back(again.bytes));
    EXPECT_GT(heap->kept(), 0u);
    heap->release();
    EXPECT_EQ(heap->kept(), 0u);
}

TEST(LargeHeap, knows_what_is_not_its_own)
{
    const auto heap = std::make_unique<LargeHeap>();
    EXPECT_FALSE(heap->give_back(nullptr));
    int number = 0;
    EXPECT_FALSE(heap->give_back(&number));
    char* const array = static_cast<char*>(heap->take(kMegabyte));
    EXPECT_FALSE(heap->give_back(array + 4096));
    EXPECT_TRUE(heap->give_back(array));
    EXPECT_FALSE(heap->give_back(array));
    EXPECT_FALSE(heap->take(SIZE_MAX - 5));
    EXPECT_FALSE(heap->take(std::size_t{1} << 60));
}

TEST(LargeHeap, serves_many_threads)
{
    const auto heap = std::make_unique<LargeHeap>();
    std::vector<std::thread> threads;
    for (int t = 0; t < 4; ++t)
        threads.emplace_back(
            [&heap, t]
            {
                for (int k = 0; k < 50; ++k)
                {
                    const Filled array =
                        filled(*heap, kMegabyte + static_cast<std::size_t>(k + t) * 10000,
                               static_cast<char>(4 * k + t));
                    EXPECT_TRUE(array.is_whole());
                    EXPECT_TRUE(heap->give_back(array.bytes));
                }
            });
    for (std::thread& thread : threads)
        thread.join();
    EXPECT_EQ(heap->in_use(), 0u);
}

} // namespace cellwarp::core
