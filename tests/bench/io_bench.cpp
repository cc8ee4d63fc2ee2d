// SPDX-License-Identifier: GPL-3.0-or-later
// Reading and writing each format beside `cat` of the same file. The files are made
// here, CELLWARP_BENCH_MB large (default 100), in the system's temporary folder.
#include <cstdlib>
#include <cstring>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "io/base/bytes.h"
#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "tests/support/files.h"

namespace
{

using namespace cellwarp::core;

std::size_t wanted_bytes()
{
    const char* text = std::getenv("CELLWARP_BENCH_MB");
    return static_cast<std::size_t>(text ? std::atof(text) : 100.0) * 1000000;
}

template <class Number>
void put(std::string& bytes, Number number)
{
    char raw[sizeof number];
    std::memcpy(raw, &number, sizeof number);
    bytes.append(raw, sizeof number);
}

/// A point of a wavy strip, four columns wide.
Eigen::Vector3d point(std::size_t i)
{
    const double along = 1e-3 * static_cast<double>(i / 4);
    return {along, 0.37 * static_cast<double>(i % 4), std::sin(along)};
}

/// Two triangles for each vertex but the first ones: as a mesh has them.
std::size_t num_vertices(std::size_t bytes_a_vertex)
{
    return wanted_bytes() / bytes_a_vertex;
}

std::string obj()
{
    const std::size_t n = num_vertices(66);
    std::string text;
    for (std::size_t i = 0; i < n; ++i)
    {
        const Eigen::Vector3d p = point(i);
        text += fmt::format("v {:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
    }
    for (std::size_t i = 4; i < n; ++i)
        text += fmt::format("f {} {} {}\nf {} {} {}\n", i - 3, i - 2, i + 1, i - 1, i - 2,
                            i + 1);
    return text;
}

std::string off()
{
    const std::size_t n = num_vertices(66);
    std::string text = fmt::format("OFF\n{} {} 0\n", n, 2 * (n - 4));
    for (std::size_t i = 0; i < n; ++i)
    {
        const Eigen::Vector3d p = point(i);
        text += fmt::format("{:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
    }
    for (std::size_t i = 4; i < n; ++i)
        text += fmt::format("3 {} {} {}\n3 {} {} {}\n", i - 4, i - 3, i, i - 2, i - 3, i);
    return text;
}

std::string ply(bool is_binary)
{
    const std::size_t n = num_vertices(is_binary ? 38 : 66);
    std::string text =
        fmt::format("ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nproperty "
                    "float y\nproperty float z\nelement face {}\nproperty list uchar int "
                    "vertex_indices\nend_header\n",
                    is_binary ? "binary_little_endian" : "ascii", n, 2 * (n - 4));
    for (std::size_t i = 0; i < n; ++i)
    {
        const Eigen::Vector3d p = point(i);
        if (is_binary)
            for (const double x : p)
                put(text, static_cast<float>(x));
        else
            text += fmt::format("{:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
    }
    for (std::size_t i = 4; i < n; ++i)
        for (const auto& corners : {std::array{i - 4, i - 3, i}, {i - 2, i - 3, i}})
        {
            if (!is_binary)
            {
                text += fmt::format("3 {} {} {}\n", corners[0], corners[1], corners[2]);
                continue;
            }
            text += '\3';
            for (const std::size_t corner : corners)
                put(text, static_cast<std::int32_t>(corner));
        }
    return text;
}

std::string stl(bool is_binary)
{
    const std::size_t n = wanted_bytes() / (is_binary ? 50 : 180);
    std::string text = is_binary ? std::string(80, ' ') : "solid strip\n";
    if (is_binary)
        put(text, static_cast<std::uint32_t>(n));
    for (std::size_t i = 0; i < n; ++i)
    {
        if (is_binary)
        {
            for (const float x : {0.0f, 0.0f, 1.0f})
                put(text, x);
            for (const std::size_t corner : {i, i + 1, i + 4})
                for (const double x : point(corner))
                    put(text, static_cast<float>(x));
            put(text, std::uint16_t(0));
            continue;
        }
        text += "facet normal 0 0 1\n outer loop\n";
        for (const std::size_t corner : {i, i + 1, i + 4})
        {
            const Eigen::Vector3d p = point(corner);
            text += fmt::format("  vertex {:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
        }
        text += " endloop\nendfacet\n";
    }
    return is_binary ? text : text + "endsolid\n";
}

std::string xyz()
{
    std::string text;
    for (std::size_t i = 0; text.size() < wanted_bytes(); ++i)
    {
        const Eigen::Vector3d p = point(i);
        text += fmt::format("{:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
    }
    return text;
}

struct Format
{
    const char* name;
    std::string (*make)();
};
const Format kFormats[] = {
    {"strip.obj", obj},
    {"strip.off", off},
    {"ascii.ply", [] { return ply(false); }},
    {"binary.ply", [] { return ply(true); }},
    {"ascii.stl", [] { return stl(false); }},
    {"binary.stl", [] { return stl(true); }},
    {"strip.xyz", xyz},
};

/// The file of one format, made once and kept while its benchmarks run.
struct Input
{
    support::Folder folder;
    std::string path, out;
    std::size_t bytes = 0;

    explicit Input(const Format& format)
    {
        const std::string content = format.make();
        bytes = content.size();
        path = folder.write(format.name, content);
        out = folder / (std::string("out-") + format.name);
    }
};

const Input& input(const Format& format)
{
    static std::unique_ptr<Input> current;
    static const Format* of = nullptr;
    if (of != &format)
    {
        current.reset();
        current = std::make_unique<Input>(format);
        of = &format;
    }
    return *current;
}

void count(benchmark::State& state, std::size_t bytes)
{
    state.SetBytesProcessed(state.iterations() * static_cast<std::int64_t>(bytes));
}

void cat(benchmark::State& state, const Format& format)
{
    const Input& file = input(format);
    const std::string command = fmt::format("cat {} > {}", file.path, file.out);
    for (auto _ : state)
        if (std::system(command.c_str()) != 0)
            state.SkipWithError("cat failed");
    count(state, file.bytes);
}

void read(benchmark::State& state, const Format& format)
{
    const Input& file = input(format);
    for (auto _ : state)
        benchmark::DoNotOptimize(read_geometry(file.path));
    count(state, file.bytes);
}

/// Every position changes, so every number is written anew.
void write(benchmark::State& state, const Format& format)
{
    const Input& file = input(format);
    const GeometryFile model = read_geometry(file.path);
    DeformedSamples patch;
    patch.samples = model.geometry.samples;
    for (Eigen::Vector3d& x : patch.samples)
        x += Eigen::Vector3d(0.123456, 0.1, -0.2);
    for (auto _ : state)
        write_file(file.out, patched(model, patch), Overwrite::Yes);
    count(state, file.bytes);
}

} // namespace

int main(int argc, char** argv)
{
    benchmark::Initialize(&argc, argv);
    for (const Format& format : kFormats)
        for (const auto& [name, run] :
             {std::pair("cat", &cat), {"read", &read}, {"write", &write}})
            benchmark::RegisterBenchmark(fmt::format("{}/{}", format.name, name).c_str(),
                                         [&format, run = run](benchmark::State& state)
                                         { run(state, format); })
                ->UseRealTime()
                ->Iterations(3)
                ->Unit(benchmark::kMillisecond);
    benchmark::RunSpecifiedBenchmarks();
}
