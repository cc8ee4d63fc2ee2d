// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/bytes.h"

#include <atomic>
#include <csignal>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include <limits.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

TEST(Bytes, reads_a_file_whole)
{
    const support::Folder folder;
    const std::string content("a\0b\n", 4);
    EXPECT_EQ(read_file(folder.write("x", content)), content);
    EXPECT_EQ(read_file(folder.write("empty", "")), "");
}

TEST(Bytes, says_why_a_file_cannot_be_read)
{
    const support::Folder folder;
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { read_file(folder / "none"); }),
                         "No such file"));
    EXPECT_TRUE(
        contains(error_of(Fault::File, [&] { read_file(folder.path().string()); }),
                 "is a directory"));
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { read_file("/dev/zero"); }),
                         "no regular file"));
    ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { read_file(folder / "pipe"); }),
                         "no regular file"));
    const std::string large = folder.write("large", "");
    std::filesystem::resize_file(large, kMaxFileBytes + 1); // takes no room
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { read_file(large); }),
                         "large: is larger than 4 GiB"));
}

TEST(Bytes, a_file_that_changes_while_it_is_read_is_one_snapshot_or_an_error)
{
    // The kernel's own files hold more than the size that they tell.
    EXPECT_TRUE(contains(error_of(Fault::File, [] { read_file("/proc/self/status"); }),
                         "changed while it was read"));
    const support::Folder folder;
    constexpr std::size_t kShort = 300000, kLong = 900000;
    const std::string path = folder.write("x", std::string(kLong, 'x'));
    std::atomic<bool> is_done = false;
    std::thread writer(
        [&]
        {
            while (!is_done)
                for (const std::size_t size : {kShort, kLong})
                    std::filesystem::resize_file(path, size);
        });
    std::size_t whole = 0;
    for (int tries = 0; tries < 2000; ++tries)
        try
        {
            const std::size_t size = read_file(path).size();
            EXPECT_TRUE(size == kShort || size == kLong) << size;
            ++whole;
        }
        catch (const Error& error)
        {
            EXPECT_EQ(error.fault(), Fault::File);
            EXPECT_TRUE(contains(error.what(), "changed while it was read"));
        }
    is_done = true;
    writer.join();
    EXPECT_LT(whole, 2000u);
}

TEST(Bytes, a_place_that_was_cut_off_is_told)
{
    const support::Folder folder;
    const std::string path = folder.write("a", "0123456789");
    const InputFile file(path);
    std::filesystem::resize_file(path, 4);
    char bytes[4];
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { file.read_at(2, bytes, 4); }),
                         "changed while it was read"));
}

TEST(Bytes, a_file_that_is_replaced_while_it_is_read_is_the_old_one_or_the_new_one)
{
    const support::Folder folder;
    const std::string a(400000, 'a'), b(700000, 'b');
    const std::string path = folder.write("x", a);
    std::atomic<bool> is_done = false;
    std::thread writer(
        [&]
        {
            for (int turn = 0; !is_done; ++turn)
            {
                AtomicFile file(path, Overwrite::Yes);
                file.write(turn % 2 ? a : b);
                file.commit();
            }
        });
    for (int tries = 0; tries < 300; ++tries)
    {
        const std::string bytes = read_file(path);
        EXPECT_TRUE(bytes == a || bytes == b);
    }
    is_done = true;
    writer.join();
}

TEST(Bytes, an_existing_output_needs_leave)
{
    const support::Folder folder;
    const std::string path = folder.write("x", "old");
    EXPECT_TRUE(
        contains(error_of(Fault::File, [&] { write_file(path, "new", Overwrite::No); }),
                 "exists"));
    EXPECT_EQ(support::bytes_of(path), "old");
    write_file(path, "new", Overwrite::Yes);
    EXPECT_EQ(support::bytes_of(path), "new");
}

TEST(Bytes, an_output_that_is_not_committed_leaves_nothing)
{
    const support::Folder folder;
    const std::string path = folder.write("x", "old");
    {
        AtomicFile file(path, Overwrite::Yes);
        file.write("half");
    }
    EXPECT_EQ(support::bytes_of(path), "old");
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(Bytes, a_signal_handler_can_remove_what_is_unfinished)
{
    const support::Folder folder;
    AtomicFile file(folder / "x", Overwrite::No);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
    remove_unfinished_outputs();
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 0);
}

TEST(Bytes, what_a_killed_run_left_is_removed_by_the_next_that_writes_there)
{
    const support::Folder folder;
    const auto temporaries = [&]
    {
        std::size_t count = 0;
        for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
            count += entry.path().filename().string().starts_with(".cellwarp-save-");
        return count;
    };
    // One is killed, the other one waits for the end of a pipe.
    int killed_pipe[2], alive_pipe[2];
    ASSERT_EQ(::pipe(killed_pipe), 0);
    ASSERT_EQ(::pipe(alive_pipe), 0);
    const auto start = [&](const char* name, const int* pipe)
    {
        const pid_t child = ::fork();
        if (child == 0)
        {
            ::close(pipe[1]);
            {
                AtomicFile file(folder / name, Overwrite::No);
                file.write(name);
                char none;
                if (::read(pipe[0], &none, 1) == 0)
                    file.commit();
            }
            ::_exit(0);
        }
        return child;
    };
    const pid_t killed = start("killed", killed_pipe);
    const pid_t alive = start("alive", alive_pipe);
    while (temporaries() < 2)
        ::usleep(1000);
    ::usleep(100000);
    ::kill(killed, SIGKILL);
    ::waitpid(killed, nullptr, 0);
    EXPECT_EQ(temporaries(), 2u);
    folder.write(".cellwarp-save-", "of the user");
    folder.write(".cellwarp-save-a-note", "of the user");
    std::filesystem::create_directory(folder / ".cellwarp-save-folder");

    write_file(folder / "next", "next", Overwrite::No);
    EXPECT_EQ(temporaries(), 4u);
    ::close(alive_pipe[1]);
    int status = 0;
    ::waitpid(alive, &status, 0);
    EXPECT_EQ(status, 0);
    EXPECT_EQ(support::bytes_of(folder / "alive"), "alive");
    EXPECT_EQ(temporaries(), 3u);
    EXPECT_FALSE(std::filesystem::exists(folder / "killed"));
}

namespace
{

/// A process that runs \p before, waits until it is told to go on and runs \p after.
class Other
{
public:
    template <class Before, class After>
    Other(Before before, After after)
    {
        int ready[2], go[2];
        EXPECT_EQ(::pipe(ready), 0);
        EXPECT_EQ(::pipe(go), 0);
        process_ = ::fork();
        if (process_ == 0)
        {
            ::close(go[1]);
            char none = 0;
            try
            {
                before();
                bool is_well = ::write(ready[1], ".", 1) == 1;
                is_well = ::read(go[0], &none, 1) == 0 && is_well;
                after();
                ::_exit(is_well ? 0 : 1);
            }
            catch (const Error&)
            {
                ::_exit(2);
            }
        }
        ::close(ready[1]);
        ::close(go[0]);
        char none = 0;
        EXPECT_EQ(::read(ready[0], &none, 1), 1);
        ::close(ready[0]);
        go_ = go[1];
    }
    /// Its exit code.
    int go_on()
    {
        ::close(go_);
        int status = 0;
        ::waitpid(process_, &status, 0);
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }

private:
    pid_t process_ = 0;
    int go_ = -1;
};

} // namespace

TEST(Bytes, the_replaced_file_is_not_swept_while_it_may_be_put_back)
{
    const support::Folder folder;
    const std::string path = folder.write("x", "old");
    std::optional<AtomicFile> file;
    Other other(
        [&]
        {
            file.emplace(path, Overwrite::Yes);
            file->write("new");
            file->finish();
            file->try_put_in_place();
        },
        [&] { file->take_back(); });
    EXPECT_EQ(support::bytes_of(path), "new");
    write_file(folder / "next", "next", Overwrite::No);
    EXPECT_EQ(other.go_on(), 0);
    EXPECT_EQ(support::bytes_of(path), "old");
}

TEST(Bytes, a_file_that_another_program_has_put_there_since_is_not_taken_back)
{
    for (const bool replaces : {false, true})
    {
        const support::Folder folder;
        const std::string path = folder / "x";
        if (replaces)
            folder.write("x", "old");
        AtomicFile file(path, Overwrite::Yes);
        file.write("new");
        file.finish();
        EXPECT_TRUE(file.try_put_in_place());
        std::filesystem::rename(folder.write("y", "theirs"), path);
        file.take_back();
        EXPECT_EQ(support::bytes_of(path), "theirs");
        EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}),
                  1);
    }
}

TEST(Bytes, many_finished_files_are_not_swept_either)
{
    constexpr int kFiles = 150;
    const support::Folder folder;
    const auto name = [&](int i) { return folder / ("file-" + std::to_string(i)); };
    std::vector<std::unique_ptr<AtomicFile>> files;
    Other other(
        [&]
        {
            for (int i = 0; i < kFiles; ++i)
            {
                files.push_back(std::make_unique<AtomicFile>(name(i), Overwrite::No));
                files.back()->finish();
            }
        },
        [&]
        {
            for (const std::unique_ptr<AtomicFile>& file : files)
                file->commit();
        });
    write_file(folder / "next", "next", Overwrite::No);
    EXPECT_EQ(other.go_on(), 0);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}),
              kFiles + 1);
}

TEST(Bytes, a_signal_handler_can_remove_any_number_of_files)
{
    constexpr int kFiles = 150;
    const support::Folder folder;
    std::vector<std::unique_ptr<AtomicFile>> files;
    for (int i = 0; i < kFiles; ++i)
        files.push_back(
            std::make_unique<AtomicFile>(folder / std::to_string(i), Overwrite::No));
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}),
              kFiles);
    remove_unfinished_outputs();
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 0);
}

TEST(Bytes, a_link_stays_and_its_target_is_replaced)
{
    const support::Folder folder;
    const std::string target = folder.write("target", "old"), link = folder / "link";
    std::filesystem::create_symlink("target", link);
    write_file(link, "new", Overwrite::Yes);
    EXPECT_TRUE(std::filesystem::is_symlink(link));
    EXPECT_EQ(support::bytes_of(target), "new");
}

TEST(Bytes, keeps_the_mode_of_the_file_it_replaces)
{
    const support::Folder folder;
    const std::string path = folder.write("x", "old");
    ::chmod(path.c_str(), 0640);
    write_file(path, "new", Overwrite::Yes);
    struct stat status
    {
    };
    ASSERT_EQ(::stat(path.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 07777, 0640u);
}

TEST(Bytes, bits_that_let_a_program_run_as_its_owner_do_not_go_on_to_another_file)
{
    const support::Folder folder;
    const std::string path = folder.write("x", "old");
    ASSERT_EQ(::chmod(path.c_str(), 07755), 0);
    write_file(path, "new", Overwrite::Yes);
    struct stat status
    {
    };
    ASSERT_EQ(::stat(path.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 07777, 0755u);
}

TEST(Bytes, outputs_that_cannot_be_written_fail_before_any_work)
{
    const support::Folder folder;
    const std::string file = folder.write("file", "");
    EXPECT_TRUE(contains(
        error_of(Fault::File, [&] { check_output(folder / "none/x", Overwrite::No); }),
        "No such file"));
    const auto refused = [](const std::string& path)
    { return error_of(Fault::File, [&] { check_output(path, Overwrite::Yes); }); };
    EXPECT_TRUE(contains(refused(file + "/x"), "file/x: cannot write: Not a directory"));
    EXPECT_TRUE(contains(refused(folder.path().string()), "is a directory"));
    EXPECT_TRUE(contains(refused("/dev/full"), "/dev/full: is no regular file"));
    EXPECT_TRUE(contains(refused(""), "an output needs a name"));
    std::filesystem::create_symlink("loop.obj", folder / "loop.obj");
    EXPECT_TRUE(contains(refused(folder / "loop.obj"), "Too many levels of symbolic"));
    EXPECT_TRUE(contains(refused(folder / std::string(300, 'n')), "File name too long"));
    EXPECT_TRUE(contains(refused(std::string(5000, 'n')), "File name too long"));
}

TEST(Bytes, what_goes_wrong_while_writing_is_named_and_leaves_nothing)
{
    const support::Folder folder;
    // A name that fits where the temporary's name beside it does not.
    std::filesystem::path deep = folder.path();
    while (deep.native().size() + 201 < PATH_MAX - 10)
        deep /= std::string(200, 'd');
    deep /= std::string(PATH_MAX - 10 - deep.native().size() - 1, 'd');
    std::filesystem::create_directories(deep);
    EXPECT_TRUE(contains(
        error_of(Fault::File, [&] { write_file(deep / "x.obj", "new", Overwrite::No); }),
        "x.obj: cannot create a file beside it: File name too long"));
    EXPECT_TRUE(std::filesystem::is_empty(deep));

    const std::string target = folder / "x";
    AtomicFile made(target, Overwrite::No), replaced(target, Overwrite::Yes);
    std::filesystem::create_directory(target);
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { made.commit(); }),
                         "x: is a directory, need a file"));
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { replaced.commit(); }),
                         "x: cannot put it in place: Is a directory"));
    std::filesystem::remove(target);

    struct rlimit before
    {
    };
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto on_signal = ::signal(SIGXFSZ, SIG_IGN);
    const struct rlimit small = {1000, before.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &small);
    const std::string full = error_of(
        Fault::File, [&] { write_file(target, std::string(2000, 'x'), Overwrite::No); });
    ::setrlimit(RLIMIT_FSIZE, &before);
    ::signal(SIGXFSZ, on_signal);
    EXPECT_TRUE(contains(full, "x: cannot write: File too large"));
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(Bytes, a_name_of_250_bytes_can_be_saved)
{
    const support::Folder folder;
    const std::string path = folder / (std::string(246, 'n') + ".obj");
    write_file(path, "x", Overwrite::No);
    EXPECT_EQ(support::bytes_of(path), "x");
}

} // namespace cellwarp::core
