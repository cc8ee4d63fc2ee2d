// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/memory_limit.h"

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

constexpr double kMegabyte = 1024.0 * 1024.0;

/// Files as the system has them: 1000 MB are available.
struct System
{
    support::Folder folder;

    explicit System(const std::string& cgroup)
    {
        std::filesystem::create_directories(folder / "proc/self");
        folder.write("proc/meminfo",
                     "MemTotal:  9999999 kB\nMemAvailable:   1024000 kB\n");
        folder.write("proc/self/cgroup", cgroup);
        folder.write("proc/self/mountinfo", "");
    }
    /// Where groups are to be seen; \p root is the group that stands at the top.
    void mount(const std::string& root, const std::string& type,
               const std::string& options, const std::string& other_lines = "")
    {
        folder.write("proc/self/mountinfo",
                     other_lines + "35 24 0:30 " + root + " " + (folder / "groups") +
                         " rw,nosuid shared:9 - " + type + " cgroup " + options + "\n");
    }
    /// A file of a group; what a group has and what it may take in megabytes.
    void set(const std::string& name, const std::string& text)
    {
        const std::filesystem::path path = folder / ("groups/" + name);
        std::filesystem::create_directories(path.parent_path());
        folder.write("groups/" + name, text + "\n");
    }
    void set(const std::string& name, int megabytes)
    {
        set(name, std::to_string(static_cast<std::int64_t>(megabytes * kMegabyte)));
    }
    double limit() const { return default_memory_limit(folder / "proc") / kMegabyte; }
};

} // namespace

TEST(MemoryLimit, is_a_share_of_what_is_available)
{
    const System system("");
    EXPECT_DOUBLE_EQ(system.limit(), 700.0);
    EXPECT_EQ(default_memory_limit(system.folder / "none"), 0.0);
    EXPECT_GT(default_memory_limit(), 0.0);
    // What the process has already is its own: 25,600 pages of 4 kB.
    system.folder.write("proc/self/statm", "99999 25600 1 1 0 1 0\n");
    EXPECT_DOUBLE_EQ(system.limit(),
                     700.0 + resident_memory(system.folder / "proc") / kMegabyte);
    EXPECT_GE(resident_memory(system.folder / "proc"), 100.0 * kMegabyte);
}

TEST(MemoryLimit, stands_against_files_that_take_more_when_they_are_read)
{
    const support::Folder folder;
    const std::string file = folder.write("big.obj", std::string(10'000'000, '#'));
    const double now = resident_memory();
    EXPECT_NO_THROW(check_memory_of_file(file, 0.0));
    EXPECT_NO_THROW(check_memory_of_file(file, now + 1e8));
    EXPECT_NO_THROW(check_memory_of_file(folder / "none.obj", 1.0));
    EXPECT_TRUE(support::contains(
        support::error_of(Fault::Budget, [&] { check_memory_of_file(file, 2e7); }),
        "a file of 10 MB needs about"));
    // Text in columns takes less.
    std::filesystem::rename(file, folder / "big.xyz");
    EXPECT_NO_THROW(check_memory_of_file(folder / "big.xyz", now + 3e7));
}

TEST(MemoryLimit, counts_the_values_of_json_but_not_what_stands_in_quotes)
{
    // As measured, text and all: nodes take 13 times their text, empty lists 26 times.
    std::string nodes = "[", lists = "[";
    while (nodes.size() < 4'000'000)
        nodes += R"({"translation":[1,2,3],"name":"n1234567"},)";
    while (lists.size() < 4'000'000)
        lists += "[],";
    const std::string text = "\"" + std::string(4'000'000, ',') + R"(\",[,:")";
    const support::Folder folder;
    const auto is_refused = [](const std::string& file, double more)
    {
        memory_with(0.0, 1.0); // what was freed is given back
        try
        {
            check_memory_of_file(file, resident_memory() + more);
        }
        catch (const Error& error)
        {
            EXPECT_EQ(error.fault(), Fault::Budget);
            return true;
        }
        return false;
    };
    for (const auto& [json, takes] :
         {std::pair(nodes, 12.5), std::pair(lists, 25.0), std::pair(text, 1.8)})
        for (const bool is_binary : {false, true})
        {
            std::string file = json;
            if (is_binary)
            {
                const std::uint32_t head[] = {0x46546c67, 2, 0,
                                              static_cast<std::uint32_t>(json.size()),
                                              0x4e4f534a};
                file.insert(0, reinterpret_cast<const char*>(head), sizeof head);
                file.append(1'000'000, '['); // of the buffer
            }
            const std::string path =
                folder.write(is_binary ? "big.glb" : "big.gltf", file);
            EXPECT_TRUE(is_refused(path, takes * 4e6)) << json.substr(0, 10);
            EXPECT_FALSE(is_refused(path, 1.6 * takes * 4e6 + 3e6)) << json.substr(0, 10);
        }
}

TEST(MemoryLimit, follows_the_groups_of_version_2)
{
    System system("0::/slice/job/step\n");
    system.mount("/", "cgroup2", "rw,nsdelegate",
                 "22 1 8:1 / / rw - ext4 /dev/sda1 rw\n");
    system.set("slice/job/step/memory.max", "max");
    EXPECT_DOUBLE_EQ(system.limit(), 700.0);
    // An ancestor's counts, and a sister's does not.
    system.set("slice/memory.max", 500);
    system.set("slice/other/memory.max", 10);
    EXPECT_DOUBLE_EQ(system.limit(), 350.0);
    system.set("slice/job/step/memory.max", 400);
    EXPECT_DOUBLE_EQ(system.limit(), 280.0);
    // What others in the group have is gone, but for files that can be read again.
    system.set("slice/memory.current", 350);
    EXPECT_NEAR(system.limit(), 105.0, 1e-9);
    system.set("slice/memory.stat",
               "anon 1\ninactive_file " + std::to_string(100 * 1024 * 1024) +
                   "\nactive_file " + std::to_string(150 * 1024 * 1024));
    EXPECT_NEAR(system.limit(), 280.0, 1e-9);
    // Nothing left is not the same as no limit.
    system.set("slice/memory.current", 2000);
    EXPECT_GT(system.limit(), 0.0);
    EXPECT_LT(system.limit(), 1e-3);
    system.set("slice/memory.current", 0);
    system.set("slice/memory.max", 5000);
    system.set("slice/job/step/memory.max", 5000);
    EXPECT_DOUBLE_EQ(system.limit(), 700.0);
}

TEST(MemoryLimit, follows_the_groups_of_version_1)
{
    System system("12:pids:/job\n5:cpu,memory:/job/step\n0::/\n");
    system.mount("/", "cgroup", "rw,memory");
    system.set("job/step/memory.limit_in_bytes", "9223372036854771712");
    EXPECT_DOUBLE_EQ(system.limit(), 700.0);
    system.set("job/memory.limit_in_bytes", 300);
    EXPECT_DOUBLE_EQ(system.limit(), 210.0);
    system.set("job/memory.usage_in_bytes", 200);
    system.set("job/memory.stat", "total_inactive_file " + std::to_string(100 << 20));
    EXPECT_NEAR(system.limit(), 140.0, 1e-9);
    // Another hierarchy at the same place tells nothing about memory.
    system.mount("/", "cgroup", "rw,pids");
    EXPECT_DOUBLE_EQ(system.limit(), 700.0);
}

TEST(MemoryLimit, is_found_where_a_container_sees_a_part_of_its_groups)
{
    for (const std::string path : {"/docker/abc", "/", "/../../elsewhere"})
    {
        System system("0::" + path + "\n");
        system.mount("/docker/abc", "cgroup2", "rw");
        system.set("memory.max", 200);
        EXPECT_DOUBLE_EQ(system.limit(), 140.0) << path;
    }
}

TEST(MemoryLimit, survives_files_that_are_not_what_they_should_be)
{
    System system("\n:\n0:\nx\n0::\n");
    system.mount("/", "cgroup2", "rw", "\n- - -\n1 2 3 4\n1 2 3 / \\0 - cgroup2 a b\n");
    system.set("memory.max", "many");
    EXPECT_DOUBLE_EQ(system.limit(), 700.0);
}

} // namespace cellwarp::core
