// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/large_block.h"

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

namespace cellwarp
{

namespace
{

struct Free
{
    void operator()(void* block) const { std::free(block); }
};
using Block = std::unique_ptr<void, Free>;

/// The flags that the system has for the memory at an address ("hg": large pages are
/// asked for); empty if it does not tell.
std::string flags_at(const void* address)
{
    const auto wanted = reinterpret_cast<std::uintptr_t>(address);
    std::ifstream file("/proc/self/smaps");
    bool is_there = false;
    for (std::string line; std::getline(file, line);)
    {
        std::uintptr_t low = 0, high = 0;
        char dash = 0;
        std::istringstream words(line);
        if (words >> std::hex >> low >> dash >> high && dash == '-')
            is_there = low <= wanted && wanted < high;
        else if (is_there && line.starts_with("VmFlags:"))
            return line + " ";
    }
    return "";
}

} // namespace

TEST(LargeBlock, of_many_bytes_asks_for_large_pages)
{
    const std::size_t bytes = 2 * kLargeBlock + 12345;
    const Block block(allocate_block(bytes));
    ASSERT_NE(block.get(), nullptr);
    std::memset(block.get(), 1, bytes);
    const std::string flags = flags_at(block.get());
    if (flags.empty() || !std::ifstream("/sys/kernel/mm/transparent_hugepage/enabled"))
        GTEST_SKIP() << "the system has no large pages, or does not tell";
    EXPECT_NE(flags.find(" hg "), std::string::npos) << flags;
}

TEST(LargeBlock, of_few_bytes_is_an_ordinary_one)
{
    for (const std::size_t bytes : {std::size_t(0), std::size_t(1), kLargeBlock - 1})
    {
        const Block block(allocate_block(bytes));
        ASSERT_NE(block.get(), nullptr);
        std::memset(block.get(), 1, bytes);
        EXPECT_EQ(flags_at(block.get()).find(" hg "), std::string::npos);
    }
}

TEST(LargeBlock, that_no_memory_is_large_enough_for_is_none)
{
    // The compiler is not to see that it is too much.
    volatile std::size_t most = std::numeric_limits<std::size_t>::max();
    EXPECT_EQ(allocate_block(most), nullptr);
    EXPECT_EQ(allocate_block(most / 2), nullptr);
}

} // namespace cellwarp
