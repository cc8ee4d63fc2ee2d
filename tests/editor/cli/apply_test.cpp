// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp apply: one file or many, from the outside.
#include <csignal>
#include <cstring>
#include <fstream>

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/base/lzf.h"
#include "io/formats/geometry_file.h"
#include "library/session/deformation.h"
#include "library/stream/apply.h"
#include "library/stream/manifest.h"
#include "octree/base/index.h"
#include "tests/support/fields.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/sanitized.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::Folder;
using support::num_files;
using support::Result;
using support::run;

namespace
{

/// The same for all tests: a session makes it once.
const std::string& field_bytes_of_a_bar()
{
    static const std::string bytes = support::twisted_bar_field(FieldKind::Blend);
    return bytes;
}

/// A field, and points as text.
struct Files
{
    Folder folder;
    std::string field = folder.write("twist.cwf", field_bytes_of_a_bar());

    std::string points(const std::string& name, int count = 50) const
    {
        std::string text;
        for (int i = 0; i < count; ++i)
            text += std::to_string(0.1 * i) + " 1 " + std::to_string(0.02 * i) + "\n";
        return folder.write(name, text);
    }
    Result apply(const std::vector<std::string>& more,
                 const support::InChild& in_child = {}) const
    {
        std::vector<std::string> arguments = {"apply", field};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return run(arguments, in_child);
    }
    std::string out(const std::string& name = "") const
    {
        return folder / ("out/" + name);
    }
};

std::size_t num_lines(const std::string& text)
{
    return idx(std::count(text.begin(), text.end(), '\n'));
}

std::string word(std::size_t value)
{
    const std::uint32_t word = static_cast<std::uint32_t>(value);
    return std::string(reinterpret_cast<const char*>(&word), sizeof word);
}

/// What stands before the numbers of a binary file.
std::string head_of(const std::string& format, std::size_t count)
{
    const std::string n = std::to_string(count);
    if (format == "ply")
        return "ply\nformat binary_little_endian 1.0\nelement vertex " + n +
               "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    if (format == "pcd")
        return "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH " + n +
               "\nDATA binary_compressed\n";
    const std::string bytes = std::to_string(12 * count);
    std::string json =
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":0}]}],
        "accessors":[{"bufferView":0,"componentType":5126,"type":"VEC3","count":)" +
        n + R"(}],"bufferViews":[{"buffer":0,"byteLength":)" + bytes +
        R"(}],"buffers":[{"byteLength":)" + bytes + "}]}";
    json.resize((json.size() + 3) / 4 * 4, ' ');
    return "glTF" + word(2) + word(28 + json.size() + 12 * count) + word(json.size()) +
           "JSON" + json + word(12 * count) + std::string("BIN\0", 4);
}

/// A flat lattice: text (xyz), a PLY, a compressed PCD or a GLB.
void write_points(const std::string& path, std::size_t count, const std::string& format)
{
    std::ofstream file(path, std::ios::binary);
    const auto place = [](std::size_t i, std::size_t k)
    { return k == 2 ? 0.5f : static_cast<float>(k == 0 ? i % 1000 : i / 1000) * 0.001f; };
    if (format != "xyz")
        file << head_of(format, count);
    if (format == "pcd")
    {
        std::string packed;
        for (std::size_t k = 0; k < 3; ++k)
        {
            std::vector<float> column;
            for (std::size_t i = 0; i < count; ++i)
                column.push_back(place(i, k));
            packed +=
                *lzf_packed({reinterpret_cast<const char*>(column.data()), 4 * count});
        }
        file << word(packed.size()) << word(12 * count) << packed;
        return;
    }
    for (std::size_t i = 0; i < count; ++i)
    {
        const float x[3] = {place(i, 0), place(i, 1), place(i, 2)};
        if (format != "xyz")
            file.write(reinterpret_cast<const char*>(x), sizeof x);
        else
            file << x[0] << ' ' << x[1] << ' ' << x[2] << '\n';
    }
}

} // namespace

TEST(Apply, moves_a_file_as_the_field_says)
{
    const Files files;
    const std::string input = files.folder.write("a.xyz", "1 0 0\n1 0 1\n0 2 -1 keep\n");
    const std::string csv = files.folder.write("a.csv", "1;0;0;a\n1;0;1;b\n");
    const Result result = files.apply({files.folder.write("p.xyz", "0.5 1 2\n3 1.5 0\n"),
                                       "-o", files.folder / "q.xyz", "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const GeometryFile moved = read_geometry(files.folder / "q.xyz");
    std::vector<Eigen::Vector3d> wanted = {{0.5, 1, 2}, {3, 1.5, 0}};
    Deformation(read_field(files.field), files.field).carry({wanted});
    EXPECT_EQ(moved.geometry.samples, wanted);
    // What is held keeps its bytes.
    EXPECT_TRUE(bytes_of(files.folder / "q.xyz").starts_with("0.5 1 2\n"));
    EXPECT_GT((moved.geometry.samples[1] - Eigen::Vector3d(3, 1.5, 0)).norm(), 0.1);
    const nlohmann::json json = nlohmann::json::parse(result.out);
    EXPECT_EQ(json["samples"], 2);
    EXPECT_EQ(json["chain_length"], 1);
    for (const char* key : {"seconds", "points_per_second", "peak_rss_mb", "warnings"})
        EXPECT_TRUE(json.contains(key)) << key;
    // Which columns are what can be told.
    EXPECT_EQ(
        files.apply({csv, "-o", files.folder / "b.csv", "--columns", "z,x,y,q"}).code, 0);
    EXPECT_TRUE(contains(bytes_of(files.folder / "b.csv"), ";a\n"));
    // A row of another length is no point.
    EXPECT_EQ(files.apply({input, "-o", files.folder / "b.xyz"}).code, 3);
    EXPECT_FALSE(std::filesystem::exists(files.folder / "b.xyz"));
}

TEST(Apply, points_outside_the_box_of_the_fields_model_get_a_warning)
{
    const Files files;
    const std::string far = files.folder.write("far.xyz", "0.5 1 2\n300 1 0\n0 -80 0\n");
    const Result result = files.apply({far, "-o", files.folder / "q.xyz", "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const std::string told = far + ": 2 of 3 points lie outside the box of the model";
    EXPECT_TRUE(contains(result.err, told)) << result.err;
    const nlohmann::json json = nlohmann::json::parse(result.out);
    ASSERT_EQ(json["warnings"].size(), 1u);
    EXPECT_TRUE(contains(json["warnings"][0].get<std::string>(), told));
    const std::string near = files.folder.write("near.xyz", "0.5 1 2\n1 0.5 0.5\n");
    EXPECT_FALSE(contains(files.apply({near, "-o", files.folder / "r.xyz"}).err, "lie"));
    // The normals of an OBJ are turned where its points are, which are no more for that.
    const std::string obj =
        files.folder.write("far.obj", "v 300 0 0\nv 301 0 0\nv 300 1 0\nv 0.5 1 2\n"
                                      "vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 2//1 4//1\n");
    EXPECT_TRUE(contains(files.apply({obj, "-o", files.folder / "q.obj"}).err,
                         obj + ": 3 of 4 points lie outside the box of the model"));
}

TEST(Apply, outputs_that_cannot_be_are_told_before_any_work)
{
    const Files files;
    const std::string input = files.points("a.xyz");
    const auto told = [&](const std::vector<std::string>& more, int code)
    {
        const Result result = files.apply(more);
        EXPECT_EQ(result.code, code) << result.err;
        return result.err;
    };
    std::filesystem::create_directories(files.folder / "out");
    EXPECT_TRUE(
        contains(told({"-", "-o", files.out()}, 2), "stdin has no name for a file"));
    EXPECT_TRUE(contains(told({input, "-o", files.folder.path().string() + "/"}, 2),
                         "its output would be the file itself"));
    files.folder.write("file", "no folder");
    EXPECT_TRUE(
        contains(told({input, "-o", files.folder / "file/deep/"}, 4), "cannot make it"));
    EXPECT_TRUE(
        contains(told({input, "-o", files.folder / "b.xyz", "--max-memory", "25.01"}, 5),
                 "the field needs about"));
    EXPECT_EQ(num_files(files.folder), 4u);
}

TEST(Apply, compressed_points_come_from_a_file_alone)
{
    const Files files;
    const std::string input = files.folder / "a.pcd";
    write_points(input, 10, "pcd");
    const Result result = files.apply({"-", "--format", "pcd", "-o", "-"}, [&]
                                      { ::dup2(::open(input.c_str(), O_RDONLY), 0); });
    EXPECT_EQ(result.code, 2);
    EXPECT_TRUE(contains(result.err, "need a file, not stdin")) << result.err;
}

TEST(Apply, streams_from_stdin_to_stdout)
{
    const Files files;
    const std::string input = files.points("a.xyz");
    ASSERT_EQ(files.apply({input, "-o", files.folder / "b.xyz"}).code, 0);
    const auto from = [](const std::string& path)
    { return [path] { ::dup2(::open(path.c_str(), O_RDONLY), 0); }; };
    const Result result = files.apply({"-", "--format", "xyz", "-o", "-"}, from(input));
    EXPECT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(result.out, bytes_of(files.folder / "b.xyz"));
    EXPECT_EQ(files.apply({"-", "-o", "-"}, from(input)).code, 2);
    EXPECT_EQ(
        files.apply({"-", "--format", "xyz", "-o", "-", "--json"}, from(input)).code, 2);
    // Normals of faces need two readings.
    const std::string mesh = files.folder.write(
        "m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 1\nvn 0 0 1\nf 1//1 2//1 3//1\n");
    const Result twice =
        files.apply({"-", "--format", "obj", "-o", files.folder / "n.obj"}, from(mesh));
    EXPECT_EQ(twice.code, 2);
    EXPECT_TRUE(contains(twice.err, "need a file, not stdin"));
    EXPECT_FALSE(std::filesystem::exists(files.folder / "n.obj"));
    EXPECT_EQ(files.apply({mesh, "-o", files.folder / "n.obj"}).code, 0);
}

TEST(Apply, what_cannot_be_is_told_before_any_work)
{
    const Files files;
    const std::string a = files.points("a.xyz"), b = files.points("b.xyz");
    std::filesystem::create_directory(files.folder / "other");
    const std::string twin = files.points("other/a.xyz");
    EXPECT_EQ(files.apply({a, "-o", files.folder / "a.ply"}).code, 2);
    EXPECT_EQ(files.apply({a, b, "-o", files.folder / "c.xyz"}).code, 2);
    for (const char* output : {"c.xyz", "new/"})
        EXPECT_EQ(files.apply({"-o", files.folder / output}).code, 2);
    EXPECT_EQ(files.apply({a, "-o", files.folder / "c.xyz", "--resume"}).code, 2);
    EXPECT_EQ(files.apply({a, "-o", files.folder / "c.xyz", "--format", "doc"}).code, 2);
    for (const char* shard : {"0/2", "3/2", "1", "a/b", "1/0"})
        EXPECT_EQ(files.apply({a, "-o", files.out(), "--shard", shard}).code, 2) << shard;
    const Result same = files.apply({a, twin, "-o", files.out()});
    EXPECT_EQ(same.code, 2);
    EXPECT_TRUE(contains(same.err, "another input has this name"));
    EXPECT_FALSE(std::filesystem::exists(files.out()));
    EXPECT_EQ(files.apply({a, "-o", files.folder / "b.xyz"}).code, 4);
    EXPECT_EQ(files.apply({files.folder / "no.xyz", "-o", files.folder / "c.xyz"}).code,
              4);
    EXPECT_EQ(run({"apply", a, a, "-o", files.folder / "c.xyz"}).code, 3);
    EXPECT_EQ(
        run({"apply", files.folder / "no.cwf", a, "-o", files.folder / "c.xyz"}).code, 4);
}

TEST(Apply, shards_together_are_the_whole)
{
    const Files files;
    std::vector<std::string> all;
    for (int i = 0; i < 5; ++i)
        all.push_back(files.points("p" + std::to_string(i) + ".xyz", 20 + i));
    const auto with = [&](std::vector<std::string> more)
    {
        std::vector<std::string> arguments = all;
        arguments.insert(arguments.end(), more.begin(), more.end());
        return files.apply(arguments);
    };
    ASSERT_EQ(with({"-o", files.folder / "whole/"}).code, 0);
    for (const char* shard : {"1/3", "2/3", "3/3"})
        EXPECT_EQ(with({"-o", files.out(), "--shard", shard}).code, 0);
    for (const std::string& path : all)
    {
        const std::string name = std::filesystem::path(path).filename();
        EXPECT_EQ(bytes_of(files.out(name)), bytes_of(files.folder / ("whole/" + name)));
    }
    EXPECT_EQ(num_lines(bytes_of(files.out("cellwarp-manifest-2-of-3.tsv"))), 5u);
    // A shard that has no file has nothing to do.
    EXPECT_EQ(with({"-o", files.folder / "many/", "--shard", "7/9"}).code, 0);
    EXPECT_EQ(num_files(Folder()), 0u);
}

TEST(Apply, one_bad_file_does_not_end_a_batch)
{
    const Files files;
    const std::string a = files.points("a.xyz"), c = files.points("c.xyz"),
                      bad = files.folder.write("b.xyz", "1 2\n"),
                      gone = files.folder / "gone.xyz";
    const Result result = files.apply({a, bad, c, gone, "-o", files.out()});
    EXPECT_EQ(result.code, 3);
    EXPECT_TRUE(contains(result.err, "b.xyz:1: point: got 2 columns"));
    EXPECT_TRUE(contains(result.err, "gone.xyz: cannot open"));
    EXPECT_TRUE(contains(result.err, "2 of 4 files failed"));
    EXPECT_EQ(num_files(files.folder), 5u);
    EXPECT_TRUE(std::filesystem::exists(files.out("c.xyz")));
    EXPECT_FALSE(std::filesystem::exists(files.out("b.xyz")));
    const std::string manifest = bytes_of(files.out("cellwarp-manifest.tsv"));
    EXPECT_TRUE(contains(manifest, bad + "\tfailed\t"));
    EXPECT_TRUE(contains(manifest, c + "\tdone\t50\t"));
    // File errors alone are exit 4; the first failure may end it all.
    EXPECT_EQ(files.apply({gone, "-o", files.folder / "o2/"}).code, 4);
    const Result fast =
        files.apply({bad, a, c, "-o", files.folder / "o3/", "--fail-fast", "--json"});
    EXPECT_EQ(fast.code, 3);
    // It is told of each file, as ever.
    const nlohmann::json told = nlohmann::json::parse(fast.out);
    EXPECT_EQ(told["files"][0]["status"], "failed");
    EXPECT_EQ(told["files"][1]["status"], "not begun");
    EXPECT_TRUE(contains(fast.err, "2 were not begun"));
    EXPECT_FALSE(std::filesystem::exists(files.folder / "o3/a.xyz"));
}

TEST(Apply, a_file_that_is_stopped_midway_is_not_called_one_that_was_not_begun)
{
    const Files files;
    const std::string large = files.points("large.xyz", 200000),
                      next = files.points("next.xyz");
    std::filesystem::create_directory(files.folder / "out");
    std::stop_source stop;
    ApplySettings settings;
    settings.threads = 1;
    settings.stop = stop.get_token();
    settings.watch = [&](double, const std::string&) { stop.request_stop(); };
    const std::vector<FileReport> reports =
        apply_to_batch(Deformation(read_field(files.field), files.field),
                       {{large, files.out("large.xyz")}, {next, files.out("next.xyz")}},
                       files.out("m.tsv"), settings);
    EXPECT_EQ(reports[0].status, FileStatus::Stopped);
    EXPECT_EQ(reports[1].status, FileStatus::Left);
    const std::string manifest = bytes_of(files.out("m.tsv"));
    EXPECT_TRUE(contains(manifest, large + "\tstarted\t"));
    EXPECT_FALSE(contains(manifest, next));
    EXPECT_FALSE(std::filesystem::exists(files.out("large.xyz")));
}

TEST(Apply, resume_does_what_is_not_done)
{
    const Files files;
    const std::string a = files.points("a.xyz"), b = files.points("b.xyz", 30);
    const std::vector<std::string> arguments = {a,           b,          "-o",
                                                files.out(), "--resume", "--json"};
    const auto statuses = [&]
    {
        const Result result = files.apply(arguments);
        EXPECT_EQ(result.code, 0) << result.err;
        const nlohmann::json json = nlohmann::json::parse(result.out);
        std::string all;
        for (const nlohmann::json& file : json["files"])
            all += file["status"].get<std::string>() + " ";
        return all;
    };
    EXPECT_EQ(statuses(), "done done ");
    EXPECT_EQ(statuses(), "skipped skipped ");
    files.points("b.xyz", 31);
    EXPECT_EQ(statuses(), "skipped done ");
    std::filesystem::remove(files.out("a.xyz"));
    EXPECT_EQ(statuses(), "done skipped ");
    // Killed after the output and before its line: the output is ours.
    const std::string manifest = bytes_of(files.out("cellwarp-manifest.tsv"));
    files.folder.write("out/cellwarp-manifest.tsv",
                       manifest.substr(0, manifest.rfind('\n', manifest.size() - 2) + 9));
    EXPECT_EQ(statuses(), "done skipped ");
    EXPECT_EQ(statuses(), "skipped skipped ");
    // Another field is other work.
    files.folder.write("twist.cwf", support::twisted_bar_field(FieldKind::Closest4));
    EXPECT_EQ(statuses(), "done done ");
    // Without the manifest nobody knows whose the outputs are.
    std::filesystem::remove(files.out("cellwarp-manifest.tsv"));
    EXPECT_EQ(files.apply(arguments).code, 4);
    // A killed batch without --resume starts over, if it may.
    EXPECT_EQ(files.apply({a, b, "-o", files.out()}).code, 4);
    EXPECT_EQ(files.apply({a, b, "-o", files.out(), "--overwrite"}).code, 0);
}

TEST(Apply, a_manifest_keeps_names_that_are_hard_and_forgets_torn_lines)
{
    const Folder folder;
    const std::string path = folder / "m.tsv";
    ManifestLine line;
    line.input = "a\tb\\\n";
    line.status = "done";
    line.samples = 7;
    line.output_bytes = 9;
    line.mark = {1, 2, "f"};
    line.message = "x\ty";
    {
        Manifest manifest(path);
        manifest.add(line);
    }
    const std::string whole = bytes_of(path);
    const std::size_t head = whole.find('\n') + 1;
    for (std::size_t length = 0; length <= whole.size(); ++length)
    {
        folder.write("m.tsv", whole.substr(0, length));
        Manifest manifest(path);
        const ManifestLine* const found = manifest.find(line.input);
        ASSERT_EQ(found != nullptr, length == whole.size());
        if (found)
        {
            EXPECT_TRUE(found->mark == line.mark && found->message == line.message);
            EXPECT_TRUE(found->samples == 7 && found->output_bytes == 9);
        }
        EXPECT_EQ(bytes_of(path).size(), length == whole.size() ? length : head);
    }
}

TEST(Apply, files_at_once_and_threads_change_no_byte)
{
    const Files files;
    std::vector<std::string> arguments;
    std::string list;
    // Long enough for many parts.
    for (int i = 0; i < 3; ++i)
        list += files.points("p" + std::to_string(i) + ".xyz", 200000) + "\n";
    arguments = {"--list", files.folder.write("list.txt", list), "-o"};
    const auto with = [&](const std::string& out, std::vector<std::string> more)
    {
        std::vector<std::string> all = arguments;
        all.push_back(files.folder / out);
        all.insert(all.end(), more.begin(), more.end());
        return files.apply(all).code;
    };
    EXPECT_EQ(with("one/", {"--threads", "1"}), 0);
    EXPECT_EQ(with("two/", {"--jobs", "4"}), 0);
    EXPECT_EQ(with("six/", {"--threads", "6", "--jobs", "2"}), 0);
    for (int i = 0; i < 3; ++i)
    {
        const std::string name = "p" + std::to_string(i) + ".xyz";
        const std::string one = bytes_of(files.folder / ("one/" + name));
        EXPECT_TRUE(one == bytes_of(files.folder / ("two/" + name)));
        EXPECT_TRUE(one == bytes_of(files.folder / ("six/" + name)));
    }
}

TEST(Apply, memory_does_not_grow_with_the_input)
{
    if (support::kIsSanitized)
        GTEST_SKIP() << "a sanitizer keeps memory that was given back";
    const Files files;
    for (const std::string format : {"ply", "xyz", "pcd", "glb"})
    {
        const auto peak_of = [&](std::size_t samples)
        {
            const std::string name = "p" + std::to_string(samples) + "." + format;
            const Result result =
                files.apply({files.folder / name, "-o", files.folder / ("o" + name),
                             "--json", "--overwrite", "--threads", "2"});
            EXPECT_EQ(result.code, 0) << result.err;
            const nlohmann::json json = nlohmann::json::parse(result.out);
            EXPECT_EQ(json["samples"], samples);
            return json["peak_rss_mb"].get<double>();
        };
        // Where the last part ends moves the peak by a buffer: of two short runs the
        // higher one counts. All that is kept for points to come is there in both.
        const auto short_peak = [&]
        { return std::max(peak_of(1500000), peak_of(2000000)); };
        for (const std::size_t samples : {1500000, 2000000, 4000000})
            write_points(files.folder / ("p" + std::to_string(samples) + "." + format),
                         samples, format);
        double of_few = short_peak(), of_many = peak_of(4000000);
        // On a busy machine a thread may come too late for the short run: its own buffers
        // are then of the long one alone, in some runs. What grows does so in all.
        for (int again = 0; again < 4 && !(of_many < 1.1 * of_few); ++again)
        {
            of_few = std::max(of_few, short_peak());
            of_many = std::min(of_many, peak_of(4000000));
        }
        // What is there of both; 2 M samples more would take 48 MB in positions alone.
        EXPECT_LT(of_many, 1.1 * of_few) << format << ": " << of_few << " MB";
    }
}

TEST(Apply, an_interrupt_ends_at_once_and_leaves_nothing)
{
    const Files files;
    write_points(files.folder / "p.xyz", 3000000, "xyz");
    for (const auto& [signal, code] : {std::pair(SIGINT, 130), {SIGTERM, 143}})
    {
        const pid_t child = support::start(
            {"apply", files.field, files.folder / "p.xyz", "-o", files.folder / "q.xyz"});
        support::wait_until_caught(child, signal);
        ::usleep(200000);
        ::kill(child, signal);
        EXPECT_EQ(support::wait_for(child), code);
        EXPECT_EQ(num_files(files.folder), 2u);
    }
}

TEST(Apply, a_full_disk_keeps_the_old_output)
{
    const Files files;
    const std::string input = files.points("a.xyz", 5000);
    files.folder.write("b.xyz", "old");
    const Result result =
        files.apply({input, "-o", files.folder / "b.xyz", "--overwrite"},
                    []
                    {
                        const struct rlimit limit = {1000, 1000};
                        ::setrlimit(RLIMIT_FSIZE, &limit);
                    });
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "b.xyz: cannot write"));
    EXPECT_EQ(bytes_of(files.folder / "b.xyz"), "old");
    EXPECT_EQ(num_files(files.folder), 3u);
}

TEST(Apply, memory_has_a_limit_that_changes_no_byte)
{
    const Files files;
    const std::string input = files.points("points.xyz", 200000);
    const std::string a = files.folder / "a.xyz", b = files.folder / "b.xyz";
    ASSERT_EQ(files.apply({input, "-o", a, "--threads", "16"}).code, 0);
    const Result small =
        files.apply({input, "-o", b, "--threads", "16", "--max-memory", "90M", "--json"});
    EXPECT_EQ(small.code, 0) << small.err;
    if (!support::kIsSanitized)
    {
        EXPECT_LT(nlohmann::json::parse(small.out)["peak_rss_mb"].get<double>(), 90.0);
    }
    EXPECT_EQ(bytes_of(a), bytes_of(b));

    const std::size_t before = num_files(files.folder);
    for (const char* limit : {"1", "1M", "26M"})
    {
        const Result result =
            files.apply({input, "-o", files.folder / "c.xyz", "--max-memory", limit});
        EXPECT_EQ(result.code, 5) << limit << result.err;
        EXPECT_TRUE(contains(result.err, "need")) << result.err;
        EXPECT_EQ(files.apply({input, "-o", files.out(), "--max-memory", limit}).code, 5);
    }
    const Result wrong =
        files.apply({input, "-o", files.folder / "c.xyz", "--max-memory", "lots"});
    EXPECT_EQ(wrong.code, 2);
    EXPECT_TRUE(contains(wrong.err, "--max-memory: got 'lots'"));
    EXPECT_EQ(num_files(files.folder), before);
}

} // namespace cellwarp::core
