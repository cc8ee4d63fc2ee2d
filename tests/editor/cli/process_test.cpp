// SPDX-License-Identifier: GPL-3.0-or-later
// What the system does to the program: signals, closed streams, full disks, other
// writers, limits, locales. Nothing is lost and nothing half-written stays.
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <random>

#include <fcntl.h>
#include <linux/capability.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/sanitized.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::BarFiles;
using support::bytes_of;
using support::contains;
using support::num_files;
using support::Result;
using support::run;

namespace
{

void limit(__rlimit_resource resource, rlim_t value)
{
    const struct rlimit both = {value, value};
    ::setrlimit(resource, &both);
}

} // namespace

TEST(Process, a_full_disk_keeps_the_old_output)
{
    const BarFiles files;
    files.folder.write("out.obj", "old");
    const Result result =
        files.deform({"--overwrite"}, [] { limit(RLIMIT_FSIZE, 1000); });
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "out.obj: cannot write: "));
    EXPECT_EQ(bytes_of(files.out), "old");
    EXPECT_EQ(num_files(files.folder), 3u);
}

TEST(Process, a_full_stdout_is_a_file_error)
{
    const BarFiles files;
    const auto into_full = [] { ::dup2(::open("/dev/full", O_WRONLY), 1); };
    EXPECT_EQ(run({"info", files.model, "--json"}, into_full).code, 4);
    EXPECT_EQ(run({"info", files.model}, into_full).code, 4);
    EXPECT_EQ(run({"check", files.model}, into_full).code, 4);
    EXPECT_EQ(run({"--help"}, into_full).code, 4);
    EXPECT_EQ(run({"deform", files.model, "-o", "-"}, into_full).code, 4);
}

TEST(Process, an_interrupt_ends_at_once_and_leaves_nothing)
{
    const BarFiles files;
    for (const auto& [signal, code] :
         {std::pair(SIGINT, 130), {SIGTERM, 143}, {SIGHUP, 129}})
    {
        const pid_t child = support::start(files.deform_arguments({}, "64"));
        support::wait_until_caught(child, signal);
        ::usleep(100000);
        ::kill(child, signal);
        EXPECT_EQ(support::wait_for(child), code);
        EXPECT_EQ(num_files(files.folder), 2u);
    }
}

TEST(Process, kill_at_any_moment_leaves_the_old_or_the_new_output)
{
    const BarFiles files;
    ASSERT_EQ(files.deform().code, 0);
    const std::string whole = bytes_of(files.out);
    std::mt19937 rng(1);
    const char* const wanted = std::getenv("CELLWARP_KILLS");
    for (int trial = 0; trial < (wanted ? std::atoi(wanted) : 12); ++trial)
    {
        files.folder.write("out.obj", "old");
        const pid_t child = support::start(files.deform_arguments({"--overwrite"}));
        ::usleep(static_cast<useconds_t>(rng() % 300000));
        ::kill(child, SIGKILL);
        support::wait_for(child);
        const std::string left = bytes_of(files.out);
        EXPECT_TRUE(left == "old" || left == whole);
    }
}

TEST(Process, two_writers_of_one_output_never_mix)
{
    const BarFiles files;
    const std::string other = files.folder.write(
        "other.handles", "cellwarp-handles 1\nfixed foot box -1 -1 -1 1 1 0.3\n"
                         "handle head box -1 -1 3.7 1 1 5\n"
                         "frame 1\nmove head rotate 0 0 1 -45\n");
    const std::vector<std::string> first = files.deform_arguments({"--overwrite"});
    std::vector<std::string> second = first;
    second[3] = other;
    ASSERT_EQ(run(first).code, 0);
    const std::string a = bytes_of(files.out);
    ASSERT_EQ(run(second).code, 0);
    const std::string b = bytes_of(files.out);
    ASSERT_NE(a, b);
    for (int trial = 0; trial < 4; ++trial)
    {
        const pid_t one = support::start(first), two = support::start(second);
        EXPECT_EQ(support::wait_for(one), 0);
        EXPECT_EQ(support::wait_for(two), 0);
        const std::string left = bytes_of(files.out);
        EXPECT_TRUE(left == a || left == b);
    }
    EXPECT_EQ(num_files(files.folder), 4u);
}

TEST(Process, without_open_streams_the_output_is_the_same)
{
    const BarFiles files;
    ASSERT_EQ(files.deform().code, 0);
    const std::string whole = bytes_of(files.out);
    EXPECT_EQ(files
                  .deform({"--overwrite"},
                          []
                          {
                              for (const int file : {0, 1, 2})
                                  ::close(file);
                          })
                  .code,
              0);
    EXPECT_EQ(bytes_of(files.out), whole);
    EXPECT_EQ(num_files(files.folder), 3u);
}

TEST(Process, a_reader_that_goes_away_is_an_error_and_no_signal)
{
    const BarFiles files;
    const auto into_broken_pipe = []
    {
        int ends[2];
        if (::pipe(ends) == 0)
            ::close(ends[0]);
        ::dup2(ends[1], 1);
    };
    const Result result = run({"deform", files.model, "-o", "-"}, into_broken_pipe);
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "stdout: cannot write"));
    // The report is one of the outputs: without a reader there is none of them.
    EXPECT_EQ(files.deform({"--json"}, into_broken_pipe).code, 4);
    EXPECT_FALSE(std::filesystem::exists(files.out));
}

TEST(Process, a_run_whose_second_output_fails_leaves_no_first_one)
{
    const BarFiles files;
    const std::string field = files.folder / "bar.cwf", scene = files.folder / "s.json",
                      picture = files.folder / "out.png", bones = files.folder / "b.tgf";
    ASSERT_EQ(files.deform({"--save-field", field}).code, 0);
    const auto bytes = std::filesystem::file_size(files.out),
               field_bytes = std::filesystem::file_size(field);
    ASSERT_GT(field_bytes, bytes);
    std::filesystem::remove(files.out);
    const std::string other = files.folder / "other.cwf";
    const std::size_t before = num_files(files.folder);
    const auto on_small_disk = [&]
    { limit(RLIMIT_FSIZE, bytes + (field_bytes - bytes) / 2); };
    Result result = files.deform({"--save-field", other}, on_small_disk);
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "other.cwf: cannot write"));
    EXPECT_EQ(num_files(files.folder), before);
    // A report on stdout is an output, too.
    const auto into_full = [] { ::dup2(::open("/dev/full", O_WRONLY), 1); };
    for (const std::vector<std::string>& arguments :
         std::vector<std::vector<std::string>>{
             files.deform_arguments({"--json"}),
             {"apply", field, files.model, "-o", files.out, "--json"},
             {"render", files.model, "-o", picture, "--size", "40x40", "--json"},
             {"skeleton", files.model, "-o", bones, "--json"}})
    {
        if (!support::can_run(arguments[0]))
            continue;
        result = run(arguments, into_full);
        EXPECT_EQ(result.code, 4) << arguments[0] << result.err;
        EXPECT_TRUE(contains(result.err, "stdout: cannot write")) << arguments[0];
        EXPECT_EQ(num_files(files.folder), before) << arguments[0];
    }
    files.folder.write("out.obj", "old");
    EXPECT_EQ(files.deform({"--json", "--overwrite"}, into_full).code, 4);
    EXPECT_EQ(bytes_of(files.out), "old");
}

TEST(Process, a_hangup_that_the_shell_ignores_stays_ignored)
{
    const BarFiles files;
    const std::string sent = files.folder.write("sent", "");
    const Result result =
        run(files.deform_arguments({}, "32"),
            [&]
            {
                ::signal(SIGHUP, SIG_IGN);
                const pid_t program = ::getpid();
                if (::fork() != 0)
                    return;
                // Again and again until the program has ended: never to another process.
                const int count = ::open(sent.c_str(), O_WRONLY | O_APPEND);
                for (; ::getppid() == program; ::usleep(2000))
                    if (::kill(program, SIGHUP) == 0 && ::write(count, ".", 1) != 1)
                        break;
                ::_exit(0);
            });
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_GT(bytes_of(sent).size(), 10u);
}

TEST(Process, only_regular_files_are_read)
{
    const BarFiles files;
    const std::string pipe = files.folder / "pipe.obj";
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    std::filesystem::create_symlink("/dev/zero", files.folder / "zero.obj");
    std::filesystem::create_symlink("/proc/self/mem", files.folder / "mem.obj");
    for (const char* name : {"pipe.obj", "zero.obj", "mem.obj"})
        EXPECT_EQ(run({"info", files.folder / name}).code, 4) << name;
}

TEST(Process, permissions_hold_and_are_named)
{
    // The superuser may do all; without these two it is held as anybody is.
    const auto held = []
    {
        ::prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0);
        ::prctl(PR_CAPBSET_DROP, CAP_DAC_READ_SEARCH, 0, 0, 0);
    };
    const BarFiles files;
    std::filesystem::create_directory(files.folder / "locked");
    ::chmod((files.folder / "locked").c_str(), 0555);
    std::vector<std::string> arguments = files.deform_arguments();
    arguments[5] = files.folder / "locked/out.obj";
    Result result = run(arguments, held);
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "locked: Permission denied"));
    files.folder.write("out.obj", "old");
    ::chmod(files.out.c_str(), 0444);
    result = files.deform({"--overwrite"}, held);
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "out.obj: cannot write: Permission denied"));
    EXPECT_EQ(bytes_of(files.out), "old");
    ::chmod(files.model.c_str(), 0);
    result = run({"info", files.model}, held);
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "bar.obj: cannot open: Permission denied"));
}

TEST(Process, new_outputs_have_the_rights_that_the_mask_leaves)
{
    for (const mode_t mask : {0027u, 0000u, 0077u})
    {
        const BarFiles files;
        ASSERT_EQ(files.deform({}, [mask] { ::umask(mask); }).code, 0);
        struct stat status;
        ASSERT_EQ(::stat(files.out.c_str(), &status), 0);
        EXPECT_EQ(status.st_mode & 0777, 0666 & ~mask);
    }
}

TEST(Process, a_path_that_leads_nowhere_is_a_file_error_with_the_reason)
{
    const BarFiles files;
    const std::string field = files.folder / "bar.cwf";
    ASSERT_EQ(files.deform({"--save-field", field}).code, 0);
    const std::string loop = files.folder / "loop.obj", loops = files.folder / "loops";
    std::filesystem::create_symlink("loop.obj", loop);
    std::filesystem::create_symlink("loops", loops);
    std::filesystem::create_directory(files.folder / "locked");
    ::chmod((files.folder / "locked").c_str(), 0);
    const auto held = []
    {
        ::prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0);
        ::prctl(PR_CAPBSET_DROP, CAP_DAC_READ_SEARCH, 0, 0, 0);
    };
    const std::string out = files.folder / "new.obj", folder = files.folder / "report";
    for (const auto& [path, reason] :
         {std::pair(loop, "Too many levels of symbolic links"),
          {loops + "/a.obj", "Too many levels of symbolic links"},
          {files.folder / (std::string(300, 'n') + ".obj"), "File name too long"},
          {files.folder / (std::string(5000, 'n') + ".obj"), "File name too long"},
          {files.folder / "locked/a.obj", "Permission denied"}})
    {
        const std::string scene =
            files.folder.write("bad.json", R"({"cellwarp": 1, "model": ")" + path +
                                               R"(", "handles": "bar.handles"})");
        for (const std::vector<std::string>& arguments :
             std::vector<std::vector<std::string>>{
                 {"info", path},
                 {"info", files.model, path},
                 {"check", scene},
                 {"deform", path, "--handles", files.handles, "-o", out},
                 {"deform", files.model, "--handles", path, "-o", out},
                 {"deform", files.model, "--handles", files.handles, "-o", path},
                 {"deform", scene, "-o", out},
                 {"apply", field, path, "-o", out},
                 {"apply", path, files.model, "-o", out},
                 {"apply", field, files.model, "-o", path},
                 {"apply", field, files.model, files.handles, "-o", path},
                 {"apply", field, files.model, "-o", path + "/"},
                 {"apply", field, "--list", path, "-o", folder + "/"},
                 {"apply", field, path, "-o", folder + "/"},
                 {"sweep", scene, "-o", folder},
                 {"sweep", files.model, "--handles", files.handles, "-o", path},
                 {"sweep", files.model, "--handles", files.handles, "-o", folder,
                  "--against", path}})
        {
            const Result result = run(arguments, held);
            EXPECT_EQ(result.code, 4) << arguments[0] << " " << path.substr(0, 300);
            EXPECT_TRUE(contains(result.err, reason)) << result.err;
            EXPECT_FALSE(std::filesystem::exists(out));
        }
        std::filesystem::remove_all(folder);
    }
}

TEST(Process, output_over_input_needs_leave_and_then_works)
{
    const BarFiles files;
    ASSERT_EQ(files.deform().code, 0);
    const std::string whole = bytes_of(files.out), before = bytes_of(files.model);
    std::vector<std::string> arguments = files.deform_arguments();
    arguments[5] = files.model;
    EXPECT_EQ(run(arguments).code, 4);
    EXPECT_EQ(bytes_of(files.model), before);
    const std::string twin = files.folder / "twin.obj";
    std::filesystem::create_hard_link(files.model, twin);
    arguments.push_back("--overwrite");
    EXPECT_EQ(run(arguments).code, 0);
    EXPECT_EQ(bytes_of(files.model), whole);
    // A second name of the old content keeps the old content.
    EXPECT_EQ(bytes_of(twin), before);
}

TEST(Process, an_output_that_is_no_file_is_refused_before_any_work)
{
    const BarFiles files;
    std::filesystem::create_symlink("/dev/full", files.folder / "full.obj");
    std::filesystem::create_directory(files.folder / "folder.obj");
    for (const char* name : {"full.obj", "folder.obj"})
    {
        std::vector<std::string> arguments = files.deform_arguments({"--overwrite"});
        arguments[5] = files.folder / name;
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 4) << name;
        EXPECT_TRUE(contains(result.err, name));
    }
}

TEST(Process, the_environment_changes_no_byte)
{
    const BarFiles files;
    ASSERT_EQ(files.deform().code, 0);
    const std::string whole = bytes_of(files.out);
    const Result result = files.deform({"--overwrite", "--json"},
                                       []
                                       {
                                           ::setenv("LC_ALL", "de_DE.UTF-8", 1);
                                           ::setenv("LANG", "de_DE.UTF-8", 1);
                                           ::setenv("TZ", "Pacific/Chatham", 1);
                                           ::unsetenv("HOME");
                                           ::unsetenv("DISPLAY");
                                           ::unsetenv("PATH");
                                       });
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_TRUE(nlohmann::json::accept(result.out));
    EXPECT_EQ(bytes_of(files.out), whole);
}

TEST(Process, too_little_memory_ends_in_exit_5_and_leaves_nothing)
{
    if (support::kIsSanitized)
        GTEST_SKIP() << "a sanitizer needs terabytes of address space";
    const BarFiles files;
    // Address space: the program's libraries alone need some 250 MB of it.
    bool ran_out = false, was_enough = false;
    for (const rlim_t megabytes : {300, 310, 320, 330, 340, 350, 360, 370, 380,  390,
                                   400, 420, 440, 460, 480, 500, 600, 800, 1200, 4000})
    {
        const Result result = run(files.deform_arguments({"--overwrite"}, "32"),
                                  [&] { limit(RLIMIT_AS, megabytes << 20); });
        EXPECT_TRUE(result.code == 0 || result.code == 5)
            << megabytes << " MB: " << result.code << result.err;
        ran_out = ran_out || result.code == 5;
        was_enough = was_enough || result.code == 0;
        EXPECT_EQ(num_files(files.folder), was_enough ? 3u : 2u);
    }
    EXPECT_TRUE(ran_out && was_enough);
}

} // namespace cellwarp::core
