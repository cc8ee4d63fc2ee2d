// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/journal/journal.h"

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <random>

#include <fcntl.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::error_of;
using support::Folder;

namespace
{

constexpr std::size_t kFileHead = 24, kRecordHead = 16; ///< [bytes]

/// A payload that tells its number, of a length that tells nothing.
std::string payload_of(std::uint64_t number)
{
    std::mt19937 rng(static_cast<unsigned>(number));
    std::string text = std::to_string(number) + ":";
    for (std::size_t left = rng() % 60; left > 0; --left)
        text += static_cast<char>(rng());
    return text;
}

std::vector<std::uint64_t> fill(const std::string& path, std::uint64_t count,
                                const std::string& header = "about bar.obj")
{
    std::vector<std::uint64_t> starts;
    Journal journal = Journal::create(path, header);
    for (std::uint64_t number = 1; number <= count; ++number)
        starts.push_back(journal.append(payload_of(number)));
    return starts;
}

/// How many records are there when it is opened, each of them as it was appended.
std::size_t num_recovered(const std::string& path, std::size_t* num_warnings = nullptr)
{
    JournalContents contents;
    const Journal journal = Journal::open(path, contents);
    EXPECT_EQ(contents.header, "about bar.obj");
    for (std::size_t i = 0; i < contents.starts.size(); ++i)
        EXPECT_EQ(journal.read(contents.starts[i]), payload_of(i + 1));
    if (num_warnings)
        *num_warnings = contents.warnings.size();
    return contents.starts.size();
}

std::string refused(const std::string& path)
{
    return error_of(Fault::Malformed, [&] { num_recovered(path); });
}

/// Runs an action in another process; its exit code.
template <class Action>
int in_child(Action&& action)
{
    const pid_t child = ::fork();
    if (child == 0)
    {
        int code = 99;
        try
        {
            code = action();
        }
        catch (...)
        {
        }
        ::_exit(code);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

} // namespace

TEST(Journal, refuses_what_is_too_long_for_it)
{
    const Folder folder;
    const char byte = 0;
    const std::string_view too_long(&byte, (std::size_t(1) << 32)); // never read
    EXPECT_TRUE(
        contains(error_of(Fault::File, [&] { Journal::create(folder / "a", too_long); }),
                 "is too long for a journal"));
    Journal journal = Journal::create(folder / "a", "header");
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { journal.append(too_long); }),
                         "a record is too long for a journal"));
}

TEST(Journal, gives_back_what_was_appended_also_after_it_was_opened_again)
{
    const Folder folder;
    const std::string path = folder / "j";
    const std::vector<std::uint64_t> starts = fill(path, 20);
    JournalContents contents;
    {
        Journal journal = Journal::open(path, contents);
        EXPECT_EQ(journal.path(), path);
        EXPECT_EQ(contents.starts, starts);
        EXPECT_TRUE(contents.warnings.empty());
        EXPECT_EQ(journal.read(journal.append(payload_of(21))), payload_of(21));
        const std::uint64_t empty = journal.append("");
        EXPECT_EQ(journal.read(empty), "");
        const std::string large(10'000'000, 'x');
        const std::uint64_t last = journal.append(large);
        EXPECT_EQ(journal.read(last), large);
        journal.sync();
        EXPECT_EQ(journal.read(starts[7]), payload_of(8));
    }
    const Journal journal = Journal::open(path, contents);
    ASSERT_EQ(contents.starts.size(), 23u);
    EXPECT_EQ(journal.read(contents.starts[20]), payload_of(21));
    EXPECT_EQ(journal.read(contents.starts[22]).size(), 10'000'000u);
}

TEST(Journal, a_new_one_stands_instead_of_the_old_one)
{
    const Folder folder;
    const std::string path = folder / "j";
    fill(path, 20);
    fill(path, 2);
    EXPECT_EQ(num_recovered(path), 2u);
    fill(path, 0);
    EXPECT_EQ(num_recovered(path), 0u);
}

TEST(Journal, cut_at_any_byte_keeps_all_whole_records)
{
    const Folder folder;
    const std::string path = folder / "j";
    const std::vector<std::uint64_t> starts = fill(path, 6);
    const std::string whole = bytes_of(path);
    for (std::size_t size = 0; size <= whole.size(); ++size)
    {
        SCOPED_TRACE(size);
        folder.write("j", whole.substr(0, size));
        if (size < starts[0])
        {
            EXPECT_FALSE(refused(path).empty());
            continue;
        }
        std::size_t kept = 0;
        bool is_cut = true;
        for (std::size_t i = 0; i < starts.size(); ++i)
        {
            const std::size_t end =
                i + 1 < starts.size() ? std::size_t(starts[i + 1]) : whole.size();
            kept += end <= size ? 1 : 0;
            is_cut = is_cut && end != size;
        }
        is_cut = is_cut && size != starts[0];
        std::size_t num_warnings = 0;
        EXPECT_EQ(num_recovered(path, &num_warnings), kept);
        EXPECT_EQ(num_warnings, is_cut ? 1u : 0u);
        if (size % 4 != 0)
            continue; // each waits for the disk
        // The rest is gone: what comes next follows the whole records.
        JournalContents contents;
        Journal::open(path, contents).append(payload_of(kept + 1));
        EXPECT_EQ(num_recovered(path), kept + 1);
    }
    folder.write("j", whole.substr(0, whole.size() - 1));
    JournalContents contents;
    Journal::open(path, contents);
    ASSERT_EQ(contents.warnings.size(), 1u);
    EXPECT_TRUE(contains(contents.warnings[0], "5 whole records are kept"));
}

TEST(Journal, every_flipped_byte_is_found_and_its_record_named)
{
    const Folder folder;
    const std::string path = folder / "j";
    const std::vector<std::uint64_t> starts = fill(path, 5);
    const std::string whole = bytes_of(path);
    std::mt19937 rng(71);
    for (std::size_t i = 0; i < whole.size(); ++i)
        for (const unsigned bits : {1u, 0x80u, 0xffu, 1u + unsigned(rng() % 255)})
        {
            SCOPED_TRACE(std::to_string(i) + " ^ " + std::to_string(bits));
            std::string altered = whole;
            altered[i] = static_cast<char>(static_cast<unsigned>(altered[i]) ^ bits);
            folder.write("j", altered);
            if (i >= 12 && i < 16) // who had it open last
            {
                EXPECT_EQ(num_recovered(path), 5u);
                continue;
            }
            const std::string message = refused(path);
            std::size_t number = 0;
            while (number < starts.size() && starts[number] <= i)
                ++number;
            const std::string field =
                number == 0 ? "" : "record " + std::to_string(number) + " (";
            EXPECT_TRUE(contains(message, field)) << message;
            EXPECT_EQ(bytes_of(path), altered);
        }
}

TEST(Journal, is_kept_aside_where_a_file_has_one_name_only)
{
    const Folder folder;
    const std::string path = folder / "j";
    folder.write("j.kept", "somebody's");
    fill(path, 3);
    const std::string whole = bytes_of(path);
    const pid_t child = ::fork();
    if (child == 0)
    {
        // As on file systems without hard links.
        sock_filter program[] = {
            BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
            BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_link, 1, 0),
            BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_linkat, 0, 1),
            BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | EPERM),
            BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)};
        const sock_fprog filter{sizeof program / sizeof program[0], program};
        if (::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 ||
            ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) != 0)
            ::_exit(77);
        try
        {
            ::_exit(Journal::keep_aside(path) == path + ".kept2" ? 0 : 1);
        }
        catch (const Error&)
        {
            ::_exit(2);
        }
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFEXITED(status));
    if (WEXITSTATUS(status) == 77)
        GTEST_SKIP() << "this system takes no filter of its calls";
    EXPECT_EQ(WEXITSTATUS(status), 0);
    EXPECT_EQ(bytes_of(path + ".kept2"), whole);
    EXPECT_EQ(bytes_of(path + ".kept"), "somebody's");
    EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(Journal, blocks_that_were_never_written_are_a_cut)
{
    const Folder folder;
    const std::string path = folder / "j";
    std::vector<std::uint64_t> starts;
    {
        Journal journal = Journal::create(path, "about bar.obj");
        for (int i = 0; i < 4; ++i)
            starts.push_back(journal.append(std::string(3000, 'x')));
    }
    const std::string whole = bytes_of(path);
    const auto num_kept = [&](std::size_t zeros, std::size_t size)
    {
        std::string bytes = whole;
        std::fill(bytes.begin() + static_cast<std::ptrdiff_t>(zeros), bytes.end(), '\0');
        bytes.resize(size, '\0');
        folder.write("j", bytes);
        JournalContents contents;
        Journal::open(path, contents);
        EXPECT_EQ(contents.warnings.size(), 1u);
        return contents.starts.size();
    };
    EXPECT_EQ(num_kept(whole.size(), whole.size() + 5000), 4u);
    EXPECT_EQ(num_kept(whole.size(), whole.size() + 20), 4u);
    EXPECT_EQ(num_kept(starts[3], whole.size()), 3u);
    EXPECT_EQ(num_kept(8192, whole.size()), 2u);
    EXPECT_EQ(num_kept(starts[1] + 100, whole.size() + 10), 1u);
    // A zero inside a block was written.
    std::string bytes = whole;
    bytes.back() = '\0';
    folder.write("j", bytes);
    EXPECT_TRUE(contains(error_of(Fault::Malformed,
                                  [&]
                                  {
                                      JournalContents contents;
                                      Journal::open(path, contents);
                                  }),
                         "record 4 (byte"));
}

TEST(Journal, records_in_another_order_are_altered)
{
    const Folder folder;
    const std::string path = folder / "j";
    const std::vector<std::uint64_t> starts = fill(path, 4);
    std::string bytes = bytes_of(path);
    bytes.erase(starts[1], starts[2] - starts[1]);
    folder.write("j", bytes);
    EXPECT_TRUE(contains(refused(path), "record 2 (byte"));
}

TEST(Journal, says_what_is_no_journal_or_a_newer_one)
{
    const Folder folder;
    const std::string path = folder.write("j", "");
    EXPECT_TRUE(contains(refused(path), "j: the file is empty"));
    folder.write("j", "cellwarp-handles 1\n and more of it to be long enough");
    EXPECT_TRUE(contains(refused(path), "no journal of cellwarp"));
    fill(path, 2);
    std::string bytes = bytes_of(path);
    bytes[8] = 2;
    folder.write("j", bytes);
    EXPECT_TRUE(contains(refused(path), "made by version 2"));
    JournalContents contents;
    EXPECT_TRUE(
        contains(error_of(Fault::File, [&] { Journal::open(folder / "none", contents); }),
                 "none: cannot open: No such file"));
    EXPECT_TRUE(contains(
        error_of(Fault::File, [&] { Journal::create(folder / "no/folder", ""); }),
        "No such file"));
    ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
    EXPECT_TRUE(
        contains(error_of(Fault::File, [&] { Journal::open(folder / "pipe", contents); }),
                 "no regular file"));
}

TEST(Journal, a_length_that_lies_takes_no_memory)
{
    const Folder folder;
    const std::string path = folder / "j";
    fill(path, 2);
    std::string bytes = bytes_of(path);
    const std::uint32_t length = 0xfffffff0u;
    std::string head = bytes;
    std::memcpy(head.data() + 16, &length, sizeof length);
    folder.write("j", head);
    EXPECT_TRUE(contains(refused(path), "header: was cut or altered"));
    std::memcpy(bytes.data() + kFileHead + 13, &length, sizeof length);
    folder.write("j", bytes);
    EXPECT_TRUE(contains(refused(path), "record 1 (byte 37)"));
}

TEST(Journal, hostile_lengths_take_no_quadratic_time)
{
    const Folder folder;
    const std::string path = folder / "j";
    fill(path, 0);
    std::string bytes = bytes_of(path);
    // Each of them looks like the next record and like a long one.
    for (std::uint32_t i = 0; i < 100000; ++i)
    {
        const std::uint64_t number = i == 0 ? 1 : 2;
        const std::uint32_t length = i == 0 ? 1u << 30 : (100000 - i) * 16 - 16;
        bytes.append(reinterpret_cast<const char*>(&length), 4).append("sum.");
        bytes.append(reinterpret_cast<const char*>(&number), 8);
    }
    folder.write("j", bytes);
    EXPECT_TRUE(contains(refused(path), "record 1 (byte 37)"));
}

TEST(Journal, a_hundred_thousand_records_take_no_time)
{
    const Folder folder;
    const std::string path = folder / "j";
    const std::clock_t start = std::clock(); // of the processor: disks may be busy
    fill(path, 100000);
    EXPECT_EQ(num_recovered(path), 100000u);
    EXPECT_LT(double(std::clock() - start) / CLOCKS_PER_SEC, 20.0); // 1 s without a rush
}

TEST(Journal, another_process_is_told_who_has_it)
{
    const Folder folder;
    const std::string path = folder / "j";
    JournalContents contents;
    const auto is_told = [&]
    {
        const std::string who = "in use by PID " + std::to_string(::getppid());
        const std::string opened = error_of(Fault::File,
                                            [&]
                                            {
                                                JournalContents ignored;
                                                Journal::open(path, ignored);
                                            });
        const std::string created =
            error_of(Fault::File, [&] { Journal::create(path, "mine"); });
        return contains(opened, who) && contains(created, who) ? 0 : 1;
    };
    {
        Journal journal = Journal::create(path, "about bar.obj");
        journal.append(payload_of(1));
        EXPECT_EQ(in_child(is_told), 0);
    }
    ASSERT_EQ(in_child(
                  [&]
                  {
                      fill(path, 2);
                      return 0;
                  }),
              0);
    Journal journal = Journal::open(path, contents);
    EXPECT_EQ(contents.starts.size(), 2u);
    EXPECT_EQ(in_child(is_told), 0);
    // Moved, it stays locked; replaced by another one, it is free.
    Journal moved = std::move(journal);
    EXPECT_EQ(in_child(is_told), 0);
    moved = Journal::create("", "");
    EXPECT_EQ(num_recovered(path), 2u);
}

TEST(Journal, a_kill_at_any_moment_loses_nothing_that_was_appended)
{
    const Folder folder;
    const std::string path = folder / "j";
    std::mt19937 rng(8);
    std::size_t most = 0;
    for (int trial = 0; trial < 50; ++trial)
    {
        SCOPED_TRACE(trial);
        int reports[2];
        ASSERT_EQ(::pipe(reports), 0);
        const pid_t child = ::fork();
        if (child == 0)
        {
            Journal journal = Journal::create(path, "about bar.obj");
            for (std::uint64_t number = 1;; ++number)
            {
                journal.append(payload_of(number));
                if (::write(reports[1], "x", 1) != 1)
                    ::_exit(1);
            }
        }
        ::close(reports[1]);
        char byte = 0;
        ASSERT_EQ(::read(reports[0], &byte, 1), 1); // it has begun
        ::usleep(static_cast<useconds_t>(rng() % 20000));
        std::size_t num_reported = 1;
        ASSERT_EQ(::fcntl(reports[0], F_SETFL, O_NONBLOCK), 0);
        ::kill(child, SIGKILL);
        int status = 0;
        ::waitpid(child, &status, 0);
        ASSERT_EQ(status & 0x7f, SIGKILL);
        char many[4096];
        for (ssize_t got; (got = ::read(reports[0], many, sizeof many)) > 0;)
            num_reported += static_cast<std::size_t>(got);
        ::close(reports[0]);
        const std::size_t recovered = num_recovered(path);
        EXPECT_GE(recovered, num_reported);
        EXPECT_LE(recovered, num_reported + 1);
        most = std::max(most, recovered);
    }
    EXPECT_GT(most, 10u);
}

TEST(Journal, a_full_disk_refuses_a_record_and_keeps_the_others)
{
    const Folder folder;
    const std::string path = folder / "j";
    const int code = in_child(
        [&]
        {
            std::signal(SIGXFSZ, SIG_IGN);
            const struct rlimit limit = {10000, RLIM_INFINITY};
            ::setrlimit(RLIMIT_FSIZE, &limit);
            Journal journal = Journal::create(path, "about bar.obj");
            std::vector<std::uint64_t> starts;
            std::string message;
            try
            {
                for (std::uint64_t number = 1; number < 10000; ++number)
                    starts.push_back(journal.append(payload_of(number)));
            }
            catch (const Error& error)
            {
                message = error.what();
            }
            if (!contains(message, "j: cannot write: File too large"))
                return 1;
            for (std::size_t i = 0; i < starts.size(); ++i)
                if (journal.read(starts[i]) != payload_of(i + 1))
                    return 2;
            struct stat status
            {
            };
            ::stat(path.c_str(), &status);
            if (static_cast<std::size_t>(status.st_size) !=
                starts.back() + kRecordHead + payload_of(starts.size()).size())
                return 4;
            // With room again it goes on where it was.
            const struct rlimit more = {RLIM_INFINITY, RLIM_INFINITY};
            ::setrlimit(RLIMIT_FSIZE, &more);
            for (int i = 0; i < 3; ++i)
            {
                starts.push_back(journal.append(payload_of(starts.size() + 1)));
                if (journal.read(starts.back()) != payload_of(starts.size()))
                    return 3;
            }
            return 0;
        });
    EXPECT_EQ(code, 0);
    std::size_t num_warnings = 0;
    EXPECT_GT(num_recovered(path, &num_warnings), 100u);
    EXPECT_EQ(num_warnings, 0u);
}

TEST(Journal, no_room_for_its_header_leaves_no_file)
{
    const Folder folder;
    const int code = in_child(
        [&]
        {
            std::signal(SIGXFSZ, SIG_IGN);
            const struct rlimit limit = {20, RLIM_INFINITY};
            ::setrlimit(RLIMIT_FSIZE, &limit);
            error_of(Fault::File, [&] { Journal::create(folder / "j", "about"); });
            return ::access((folder / "j").c_str(), F_OK) == 0 ? 1 : 0;
        });
    EXPECT_EQ(code, 0);
}

TEST(Journal, without_a_name_it_goes_with_the_process)
{
    Journal journal = Journal::create("", "text");
    EXPECT_EQ(journal.path(), "");
    std::vector<std::uint64_t> starts;
    for (std::uint64_t number = 1; number <= 100; ++number)
        starts.push_back(journal.append(payload_of(number)));
    journal.sync();
    for (std::size_t i = 0; i < starts.size(); ++i)
        EXPECT_EQ(journal.read(starts[i]), payload_of(i + 1));
}

TEST(Journal, reads_only_what_it_holds)
{
    const Folder folder;
    const std::string path = folder / "j";
    Journal journal = Journal::create(path, "about bar.obj");
    const std::uint64_t start = journal.append(payload_of(1));
    const auto refuses = [&](std::uint64_t at)
    { return error_of(Fault::Malformed, [&] { journal.read(at); }); };
    EXPECT_TRUE(contains(refuses(0), "there is none"));
    EXPECT_TRUE(contains(refuses(~std::uint64_t(0)), "there is none"));
    EXPECT_TRUE(contains(refuses(start + 1), "record at byte"));
    std::string bytes = bytes_of(path);
    bytes[start + kRecordHead] ^= 1;
    folder.write("j", bytes);
    EXPECT_TRUE(contains(refuses(start), "was altered"));
    folder.write("j", bytes.substr(0, start + kRecordHead));
    EXPECT_TRUE(contains(refuses(start), "was altered"));
}

TEST(Journal, removed_it_is_gone_and_takes_nothing_more)
{
    const Folder folder;
    const std::string path = folder / "j";
    Journal journal = Journal::create(path, "about bar.obj");
    journal.append(payload_of(1));
    journal.remove();
    EXPECT_NE(::access(path.c_str(), F_OK), 0);
    EXPECT_TRUE(
        contains(error_of(Fault::File, [&] { journal.append("x"); }), "was removed"));
    journal.remove();
    // Another process may begin anew at once.
    EXPECT_EQ(in_child(
                  [&]
                  {
                      fill(path, 3);
                      return 0;
                  }),
              0);
    EXPECT_EQ(num_recovered(path), 3u);
}

} // namespace cellwarp::core
