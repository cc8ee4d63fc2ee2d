// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/output_set.h"

#include <cstdio>
#include <filesystem>

#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "io/formats/geometry_output.h"
#include "tests/support/failing_calls.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::error_of;
using support::FailingCalls;
using support::Folder;
using support::LackingCalls;
using support::num_files;

TEST(OutputSet, all_files_get_their_names_together_and_only_when_they_are_committed)
{
    const Folder folder;
    const std::string first = folder / "first", second = folder.write("second", "old");
    {
        OutputSet outputs(Overwrite::Yes);
        outputs.write(first, "new one");
        outputs.add(second).write("new two");
        outputs.finish();
        EXPECT_FALSE(std::filesystem::exists(first));
        EXPECT_EQ(bytes_of(second), "old");
    }
    EXPECT_EQ(num_files(folder), 1u);
    OutputSet outputs(Overwrite::Yes);
    outputs.write(first, "new one");
    outputs.write(second, "new two");
    outputs.commit();
    EXPECT_EQ(bytes_of(first), "new one");
    EXPECT_EQ(bytes_of(second), "new two");
    EXPECT_EQ(num_files(folder), 2u);
}

TEST(OutputSet, one_that_cannot_have_its_name_takes_the_others_back)
{
    for (const bool replaces : {false, true})
    {
        const Folder folder;
        const std::string first = folder / "first", second = folder / "second",
                          third = folder / "third";
        if (replaces)
            folder.write("first", "old");
        OutputSet outputs(replaces ? Overwrite::Yes : Overwrite::No);
        outputs.write(first, "new one");
        outputs.write(second, "new two");
        outputs.write(third, "new three");
        std::filesystem::create_directory(third);
        EXPECT_TRUE(
            contains(error_of(Fault::File, [&] { outputs.commit(); }), "third: "));
        EXPECT_EQ(std::filesystem::exists(first), replaces);
        if (replaces)
        {
            EXPECT_EQ(bytes_of(first), "old");
        }
        EXPECT_FALSE(std::filesystem::exists(second));
        EXPECT_EQ(num_files(folder), replaces ? 2u : 1u);
    }
}

TEST(OutputSet, on_a_disk_that_fails_once_all_are_old_or_all_are_new)
{
    const Folder folder;
    const std::string first = folder / "first", second = folder / "second";
    int errors = 0;
    for (int number = 1;; ++number)
    {
        SCOPED_TRACE(number);
        folder.write("first", "old one");
        folder.write("second", "old two");
        bool is_done = false, was_reached = false;
        {
            const FailingCalls failing(number, FailingCalls::How::Once);
            try
            {
                OutputSet outputs(Overwrite::Yes);
                outputs.write(first, "new one");
                outputs.write(second, "new two");
                outputs.commit();
                is_done = true;
            }
            catch (const Error& error)
            {
                EXPECT_EQ(error.fault(), Fault::File);
                ++errors;
            }
            was_reached = FailingCalls::was_reached();
        }
        EXPECT_EQ(bytes_of(first), is_done ? "new one" : "old one");
        EXPECT_EQ(bytes_of(second), is_done ? "new two" : "old two");
        if (!was_reached)
            break;
    }
    EXPECT_GE(errors, 13);
}

TEST(OutputSet, stdout_says_that_all_is_well_only_where_it_is)
{
    const Folder folder;
    const std::string first = folder / "first", second = folder / "second",
                      told = folder.write("told", "");
    int errors = 0;
    for (const int num_old : {0, 1, 2})
        for (int number = 1;; ++number)
        {
            SCOPED_TRACE(testing::Message() << num_old << " old, call " << number);
            std::filesystem::remove(first);
            std::filesystem::remove(second);
            if (num_old > 0)
                folder.write("first", "old one");
            if (num_old > 1)
                folder.write("second", "old two");
            std::fflush(stdout);
            const int before = ::dup(1), into = ::open(told.c_str(), O_WRONLY | O_TRUNC);
            ::dup2(into, 1);
            ::close(into);
            bool is_done = false, was_reached = false;
            {
                const FailingCalls failing(number, FailingCalls::How::Once);
                try
                {
                    OutputSet outputs(Overwrite::Yes);
                    outputs.write(first, "new one");
                    outputs.write(second, "new two");
                    outputs.write("-", "all is well");
                    outputs.commit();
                    is_done = true;
                }
                catch (const Error&)
                {
                    ++errors;
                }
                was_reached = FailingCalls::was_reached();
            }
            ::dup2(before, 1);
            ::close(before);
            EXPECT_EQ(bytes_of(told), is_done ? "all is well" : "");
            EXPECT_EQ(is_done, bytes_of(first) == "new one");
            EXPECT_EQ(is_done, bytes_of(second) == "new two");
            if (!was_reached)
                break;
        }
    EXPECT_GE(errors, 30);
}

TEST(OutputSet, has_more_files_than_a_process_may_have_open)
{
    constexpr int kFiles = 400;
    const Folder folder;
    const auto name = [](int i) { return "file-" + std::to_string(i); };
    struct rlimit before
    {
    };
    ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
    const struct rlimit few = {256, before.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &few), 0);
    for (const char* content : {"first", "second"}) // new, then exchanged
    {
        OutputSet outputs(Overwrite::Yes);
        std::string said;
        try
        {
            for (int i = 0; i < kFiles; ++i)
                outputs.write(folder / name(i), content);
            outputs.commit();
        }
        catch (const Error& error)
        {
            said = error.what();
        }
        EXPECT_EQ(said, "");
        EXPECT_EQ(num_files(folder), std::size_t(kFiles));
        EXPECT_EQ(bytes_of(folder / name(kFiles - 1)), content);
    }
    ::setrlimit(RLIMIT_NOFILE, &before);
}

TEST(OutputSet, a_file_that_appears_meanwhile_stays_without_leave_to_overwrite)
{
    for (const LackingCalls::Lacks lacks :
         {LackingCalls::Lacks::Nothing, LackingCalls::Lacks::FlagsOfRename,
          LackingCalls::Lacks::SecondNames})
    {
        const Folder folder;
        const std::string path = folder / "x", other = folder / "y";
        const LackingCalls lacking(lacks);
        OutputSet outputs(Overwrite::No);
        outputs.write(other, "other");
        outputs.write(path, "ours");
        folder.write("x", "theirs");
        EXPECT_TRUE(contains(error_of(Fault::File, [&] { outputs.commit(); }),
                             "x: exists already (use --overwrite to replace it)"));
        EXPECT_EQ(bytes_of(path), "theirs");
        EXPECT_EQ(num_files(folder), 1u);
        // And without anything in the way all is as ever.
        write_file(other, "other", Overwrite::No);
        write_file(other, "another", Overwrite::Yes);
        EXPECT_EQ(bytes_of(other), "another");
        EXPECT_EQ(num_files(folder), 2u);
    }
}

TEST(OutputSet, a_buffer_beside_a_gltf_does_not_appear_without_the_gltf)
{
    const Folder folder;
    std::filesystem::create_directory(folder / "in");
    folder.write("in/b.bin", std::string(36, '\0'));
    const GeometryFile model = read_geometry(folder.write(
        "in/a.gltf",
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],)"
        R"("meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
        R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",)"
        R"("min":[0,0,0],"max":[0,0,0]}],"bufferViews":[{"buffer":0,"byteLength":36}],)"
        R"("buffers":[{"uri":"b.bin","byteLength":36}]})"));
    const DeformedSamples moved{{{1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, {}, {}, {}};
    const std::string out = folder / "out.gltf";
    {
        OutputSet outputs(Overwrite::No);
        write_geometry(out, model, moved, outputs);
        EXPECT_EQ(num_files(folder), 3u); // the folder and two temporaries
        std::filesystem::create_directory(out);
        EXPECT_TRUE(contains(error_of(Fault::File, [&] { outputs.commit(); }),
                             "out.gltf: is a directory"));
    }
    EXPECT_EQ(num_files(folder), 2u);
    std::filesystem::remove(out);
    write_geometry(out, model, moved, Overwrite::No);
    EXPECT_EQ(num_files(folder), 3u);
    EXPECT_EQ(read_geometry(out).geometry.samples, moved.samples);
}

} // namespace cellwarp::core
