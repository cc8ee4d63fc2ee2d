// SPDX-License-Identifier: GPL-3.0-or-later
// Every file is made, read and replaced on a disk that fails at each call in turn: what
// was there before is whole, and the error tells the reason.
#include <filesystem>
#include <vector>

#include <gtest/gtest.h>

#include "io/base/bytes.h"
#include "io/base/spill.h"
#include "io/journal/journal.h"
#include "tests/support/failing_calls.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::Folder;
using support::with_each_call_failing;

TEST(FailingDisk, an_output_is_the_old_one_or_the_new_one)
{
    const Folder folder;
    const std::string path = folder / "out.obj";
    const std::string old = "the old one", now(300000, 'n');
    const int errors = with_each_call_failing(
        [&] { folder.write("out.obj", old); },
        [&] { write_file(path, now, Overwrite::Yes); },
        [&](bool is_done) { EXPECT_TRUE(bytes_of(path) == (is_done ? now : old)); });
    EXPECT_GE(errors, 10);
}

TEST(FailingDisk, a_file_is_read_whole_or_not_at_all)
{
    const Folder folder;
    const std::string bytes(100000, 'b'), path = folder.write("in.obj", bytes);
    std::string got;
    const int errors = with_each_call_failing(
        [&] { got.clear(); },
        [&]
        {
            InputFile file(path);
            std::string first(10, '\0'), second(10, '\0');
            file.read(first.data(), first.size());
            file.rewind();
            file.read_at(5, second.data(), second.size());
            got = read_file(path);
        },
        [&](bool is_done) { EXPECT_EQ(got.size(), is_done ? bytes.size() : 0u); });
    EXPECT_GE(errors, 12);
}

TEST(FailingDisk, stdin_that_cannot_be_read_is_told)
{
    const support::FailingCalls failing(1, support::FailingCalls::How::Once);
    EXPECT_TRUE(support::contains(
        support::error_of(Fault::File, [] { const InputFile file("-"); }),
        "cannot read"));
}

TEST(FailingDisk, ranges_of_a_file_are_all_written_or_the_error_is_told)
{
    const Folder folder;
    const std::string path = folder / "ranges";
    const int errors =
        with_each_call_failing([&] { folder.write("ranges", "0123456789"); },
                               [&]
                               {
                                   RangeFile file(path, "ranges");
                                   file.write_at(2, "ab");
                                   file.sync();
                               },
                               [&](bool is_done)
                               {
                                   if (is_done)
                                   {
                                       EXPECT_EQ(bytes_of(path), "01ab456789");
                                   }
                               });
    EXPECT_EQ(errors, 6);
}

TEST(FailingDisk, records_on_a_temporary_file_come_back_sorted_or_not_at_all)
{
    const Folder folder;
    std::vector<int> got;
    const int errors =
        with_each_call_failing([&] { got.clear(); },
                               [&]
                               {
                                   SpillSorter<int> sorter(folder.path().string(), 100);
                                   for (int k = 0; k < 250; ++k)
                                       sorter.push(k * 37 % 250);
                                   SpillSorter<int>::Sorted sorted = sorter.sorted();
                                   int next = 0;
                                   while (sorted.next(next))
                                       got.push_back(next);
                               },
                               [&](bool is_done)
                               {
                                   if (!is_done)
                                       return;
                                   ASSERT_EQ(got.size(), 250u);
                                   for (int k = 0; k < 250; ++k)
                                       EXPECT_EQ(got[static_cast<std::size_t>(k)], k);
                               });
    EXPECT_GE(errors, 12);
}

TEST(FailingDisk, a_journal_keeps_every_record_that_was_taken)
{
    const Folder folder;
    const std::string path = folder / "a.journal", other = folder / "b.journal";
    std::vector<std::string> taken;
    const int errors = with_each_call_failing(
        [&]
        {
            std::filesystem::remove(path);
            std::filesystem::remove(other);
            taken.clear();
        },
        [&]
        {
            Journal journal = Journal::create(path, "header");
            for (const std::size_t size : {10u, 20000u, 30u})
            {
                const std::string payload(size, 'p');
                const std::uint64_t start = journal.append(payload);
                taken.push_back(payload);
                EXPECT_EQ(journal.read(start), payload);
            }
            journal.sync();
            journal.move_to(other);
        },
        [&](bool)
        {
            const std::string& there = std::filesystem::exists(other) ? other : path;
            if (taken.empty())
                return;
            JournalContents contents;
            const Journal journal = Journal::open(there, contents);
            ASSERT_EQ(contents.starts.size(), taken.size());
            for (std::size_t k = 0; k < taken.size(); ++k)
                EXPECT_EQ(journal.read(contents.starts[k]), taken[k]);
        });
    EXPECT_GE(errors, 20);
}

TEST(FailingDisk, a_journal_is_opened_cut_and_kept_aside_without_loss)
{
    const Folder folder;
    const std::string path = folder / "a.journal";
    std::string whole;
    {
        Journal journal = Journal::create(path, "header");
        journal.append(std::string(9000, 'a'));
        whole = bytes_of(path);
    }
    const int errors = with_each_call_failing(
        [&]
        {
            for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
                std::filesystem::remove(entry.path());
            folder.write("a.journal", whole + "cut");
        },
        [&]
        {
            {
                JournalContents contents;
                Journal journal = Journal::open(path, contents);
                EXPECT_EQ(contents.starts.size(), 1u);
                journal.append("more");
                journal.sync();
            }
            Journal::check_free(path);
            Journal::keep_aside(path);
        },
        [&](bool is_done)
        {
            const std::string there =
                is_done || !std::filesystem::exists(path) ? path + ".kept" : path;
            // The holder's number is another one.
            EXPECT_TRUE(bytes_of(there).substr(16, whole.size() - 16) ==
                        whole.substr(16));
        });
    EXPECT_GE(errors, 20);
}

TEST(FailingDisk, what_a_failed_record_left_goes_before_the_next_one_comes)
{
    const Folder folder;
    const std::string path = folder / "a.journal";
    Journal journal = Journal::create(path, "header");
    journal.append("one");
    for (int attempt = 0; attempt < 2; ++attempt)
    {
        // The second finds that what the first left cannot be cut off either.
        const support::FailingCalls failing(1, support::FailingCalls::How::Onward);
        EXPECT_TRUE(support::contains(
            support::error_of(Fault::File, [&] { journal.append("lost"); }),
            "cannot write"));
    }
    journal.append("two");
    journal.sync();
    EXPECT_EQ(journal.read(bytes_of(path).size() - 16 - 3), "two");
}

TEST(FailingDisk, a_journal_that_cannot_be_removed_says_so)
{
    const Folder folder;
    const std::string path = folder / "a.journal";
    Journal journal = Journal::create(path, "header");
    const support::FailingCalls failing(1, support::FailingCalls::How::Once);
    EXPECT_TRUE(support::contains(
        support::error_of(Fault::File, [&] { journal.remove(); }), "cannot remove"));
}

} // namespace cellwarp::core
