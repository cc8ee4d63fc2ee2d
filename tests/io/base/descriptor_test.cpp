// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/descriptor.h"

#include <array>
#include <cerrno>
#include <string>
#include <thread>

#include <fcntl.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "tests/support/files.h"

namespace cellwarp::core
{

namespace
{

bool is_open(int file)
{
    return ::fcntl(file, F_GETFD) >= 0;
}

Descriptor opened(const std::string& path)
{
    return Descriptor(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
}

} // namespace

TEST(Descriptor, closes_its_file_once_and_leaves_what_was_released)
{
    const support::Folder folder;
    int number = -1;
    {
        Descriptor first = opened(folder / "a");
        ASSERT_TRUE(first);
        number = first.get();
        const Descriptor second = std::move(first);
        EXPECT_FALSE(first);
        EXPECT_TRUE(is_open(number));
    }
    EXPECT_FALSE(is_open(number));
    Descriptor file = opened(folder / "a");
    const int old = file.get();
    Descriptor other = opened(folder / "b");
    number = other.get();
    file = std::move(other);
    EXPECT_EQ(file.get(), number);
    other.close();
    EXPECT_FALSE(is_open(old));
    EXPECT_EQ(file.release(), number);
    EXPECT_FALSE(file);
    EXPECT_TRUE(is_open(number));
    EXPECT_TRUE(Descriptor(number).close());
    EXPECT_FALSE(is_open(number));
}

TEST(Descriptor, is_none_where_the_system_gave_none)
{
    const Descriptor none(::open("/none/at/all", O_RDONLY));
    EXPECT_FALSE(none);
    Descriptor gone(::open("/dev/null", O_RDONLY));
    ::close(gone.get());
    EXPECT_FALSE(gone.close());
    EXPECT_EQ(errno, EBADF);
    EXPECT_TRUE(gone.close());
}

TEST(Descriptor, writes_and_reads_all_of_what_a_pipe_takes_in_parts)
{
    std::array<int, 2> ends{};
    ASSERT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0);
    const Descriptor out(ends[0]);
    Descriptor in(ends[1]);
    std::string sent(1000000, 'x');
    for (std::size_t i = 0; i < sent.size(); i += 7)
        sent[i] = static_cast<char>('a' + i % 26);
    std::thread writer(
        [&]
        {
            EXPECT_TRUE(write_all(in.get(), sent));
            in.close();
        });
    std::string got(sent.size() + 10, ' ');
    const std::int64_t count = read_next(out.get(), got.data(), got.size());
    writer.join();
    ASSERT_EQ(count, static_cast<std::int64_t>(sent.size()));
    got.resize(sent.size());
    EXPECT_TRUE(got == sent);
    EXPECT_EQ(read_next(out.get(), got.data(), 1), 0);
}

TEST(Descriptor, reads_and_writes_at_any_place_and_tells_of_failures)
{
    const support::Folder folder;
    const Descriptor file = opened(folder / "a");
    EXPECT_TRUE(write_at(file.get(), 3, "def"));
    EXPECT_TRUE(write_at(file.get(), 0, "abc"));
    std::array<char, 8> bytes{};
    EXPECT_EQ(read_at(file.get(), 2, bytes.data(), bytes.size()), 4);
    EXPECT_EQ(std::string(bytes.data(), 4), "cdef");
    EXPECT_EQ(read_at(file.get(), 9, bytes.data(), bytes.size()), 0);
    EXPECT_EQ(read_at(-1, 0, bytes.data(), bytes.size()), -1);
    EXPECT_EQ(read_next(-1, bytes.data(), bytes.size()), -1);
    EXPECT_FALSE(write_all(-1, "x"));
    EXPECT_FALSE(write_at(-1, 0, "x"));
    EXPECT_EQ(errno, EBADF);
}

} // namespace cellwarp::core
