// SPDX-License-Identifier: GPL-3.0-or-later
// Several processes move one file as one process does.
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>

#include <sys/wait.h>

#include <gtest/gtest.h>

#include "io/formats/stored_number.h"
#include "tests/support/fields.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::Folder;

namespace
{

/// An element before the vertices, faces after them; one normal is not finite.
std::string mesh(bool big_endian, int count)
{
    std::mt19937 rng(11);
    std::string bytes =
        std::string("ply\nformat binary_") + (big_endian ? "big" : "little") +
        "_endian 1.0\nelement first 3\nproperty short a\nelement vertex " +
        std::to_string(count) +
        "\nproperty double x\nproperty float y\nproperty float z\n"
        "property uchar kind\nproperty float nx\nproperty float ny\n"
        "property float nz\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n";
    const auto put = [&](double value, Scalar type)
    { EXPECT_TRUE(store(value, type, big_endian, bytes)); };
    for (const int i : {1, 2, 3})
        put(i, Scalar::Int16);
    for (int i = 0; i < count; ++i)
    {
        put(1e-3 * (rng() % 1000), Scalar::Float64);
        put(1e-3 * (rng() % 1000), Scalar::Float32);
        put(4e-3 * (rng() % 1000), Scalar::Float32);
        put(i % 200, Scalar::UInt8);
        for (const double n : {0.0, 0.6})
            put(n, Scalar::Float32);
        if (i == 5)
            bytes += big_endian ? std::string("\x7f\xc0\0\0", 4)
                                : std::string("\0\0\xc0\x7f", 4);
        else
            put(0.8, Scalar::Float32);
    }
    put(3, Scalar::UInt8);
    for (const int i : {0, 1, 2})
        put(i, Scalar::Int32);
    return bytes + "tail";
}

struct Spread
{
    Folder folder;
    std::string field =
        folder.write("twist.cwf", support::twisted_bar_field(FieldKind::Blend));

    /// The exit code; what it says is in the file err.
    int run(const std::string& input, const std::string& output, int processes,
            const std::string& more = "") const
    {
        const std::string command =
            std::string(CELLWARP_MPIEXEC) + " -n " + std::to_string(processes) +
            " --oversubscribe --allow-run-as-root " CELLWARP_MPI_BINARY " " + field +
            " " + input + " -o " + output + " " + more + " > /dev/null 2> " +
            (folder / "err");
        return WEXITSTATUS(std::system(command.c_str()));
    }
    std::string err() const { return bytes_of(folder / "err"); }
};

} // namespace

TEST(Mpi, processes_write_what_one_writes)
{
    const Spread spread;
    for (const bool big_endian : {false, true})
        // Fewer vertices than processes, and more than are in memory at once.
        for (const int count : {2, 10001, 300000})
        {
            if (count == 2 && big_endian)
                continue;
            const std::string input =
                spread.folder.write("a.ply", mesh(big_endian, count + 1));
            ASSERT_EQ(support::run({"apply", spread.field, input, "-o",
                                    spread.folder / "b.ply", "--overwrite"})
                          .code,
                      0);
            for (const int processes : {2, 3})
            {
                ASSERT_EQ(spread.run(input, spread.folder / "c.ply", processes,
                                     "--overwrite --threads 1"),
                          0)
                    << spread.err();
                EXPECT_TRUE(bytes_of(spread.folder / "b.ply") ==
                            bytes_of(spread.folder / "c.ply"))
                    << count << " vertices, " << processes << " processes";
                EXPECT_EQ(contains(spread.err(), "1 normals are not finite"), count > 2);
            }
        }
}

TEST(Mpi, an_error_on_any_process_ends_all_of_them)
{
    const Spread spread;
    const std::string good = mesh(false, 1000), out = spread.folder / "out.ply";
    std::string bad = good;
    const std::size_t last = bad.size() - 4 - 13 - 29;
    bad.replace(last, 8, std::string("\0\0\0\0\0\0\xf0\x7f", 8));
    const std::string a = spread.folder.write("a.ply", good),
                      b = spread.folder.write("b.ply", bad),
                      c = spread.folder.write("c.ply", good.substr(0, good.size() / 2)),
                      text = spread.folder.write(
                          "t.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty "
                                   "float x\nproperty float y\nproperty float z\n"
                                   "end_header\n0 0 0\n"),
                      xyz = spread.folder.write("p.xyz", "0 0 0\n");
    EXPECT_EQ(spread.run(b, out, 2), 3);
    EXPECT_TRUE(contains(spread.err(), "vertex 999 (byte " + std::to_string(last) +
                                           "): x: is not finite"));
    EXPECT_EQ(spread.run(c, out, 2), 3);
    EXPECT_EQ(spread.run(text, out, 2), 2);
    EXPECT_TRUE(contains(spread.err(), "cannot be spread"));
    EXPECT_EQ(spread.run(xyz, out, 2), 2);
    EXPECT_EQ(spread.run(a, out, 2, "--what"), 2);
    EXPECT_EQ(spread.run(spread.folder / "no.ply", out, 2), 4);
    EXPECT_EQ(spread.run(a, spread.folder / "b.ply", 2), 4);
    EXPECT_TRUE(contains(spread.err(), "exists already"));
    EXPECT_FALSE(std::filesystem::exists(out));
    // The field, five inputs and what was said last.
    EXPECT_EQ(support::num_files(spread.folder), 7u);
}

} // namespace cellwarp::core
