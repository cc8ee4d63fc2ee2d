// SPDX-License-Identifier: GPL-3.0-or-later
// One frame of the quick field on a bar of 2,000 cells, its ends held, beside a plain
// loop that reads and writes as many bytes. Samples fill the bar; CELLWARP_BENCH_SAMPLES
// is how many there are at the most (default 10,000,000).
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <memory>

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/field/sample_blend.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace
{

using namespace cellwarp::core;

constexpr double kSide = 9.0, kLength = 25.0;

std::size_t most_samples()
{
    const char* text = std::getenv("CELLWARP_BENCH_SAMPLES");
    return static_cast<std::size_t>(text ? std::atof(text) : 1e7);
}

/// The bar, twisted between its ends.
struct Bar
{
    support::Built built = support::bar(static_cast<int>(kSide), static_cast<int>(kSide),
                                        static_cast<int>(kLength));
    std::vector<Constraint> constraints{built.cells.size()};
    std::vector<Pose> poses;
    std::vector<Motion> motions{Motion(), about_axis(kLength)};

    Bar()
    {
        for (const Cell& cell : built.cells.cells)
        {
            const double z = cell.centre.z();
            const double turned_z = end(z) == 0 ? 0.0 : end(z) == 1 ? kLength : z;
            poses.push_back(carried(about_axis(turned_z), cell.centre));
        }
        for (std::size_t c = 0; c < poses.size(); ++c)
            if (end(built.cells.cells[c].centre.z()) >= 0)
                constraints[c].hold = Hold::Prescribed;
    }
    /// Which end holds material at a height; -1: none.
    static int end(double z) { return z < 2.0 ? 0 : z > kLength - 2.0 ? 1 : -1; }
    static Motion about_axis(double z)
    {
        const Eigen::Vector3d axis(0.5 * kSide, 0.5 * kSide, 0);
        const Eigen::Matrix3d R =
            rotation_about(Eigen::Vector3d::UnitZ(), 2.3 * z / kLength);
        return {R, axis - R * axis};
    }
};

/// A frame's samples and tables, made once and kept while its benchmarks run.
struct Input
{
    Bar bar;
    std::vector<Eigen::Vector3d> places;
    std::vector<int> cells;
    std::vector<SampleNormal> normals;
    std::vector<RegionFade> fades;
    std::vector<FadedRegion> regions;
    std::unique_ptr<SampleBlend> blend;

    Input(std::size_t count, bool has_normals)
    {
        std::mt19937 rng(1);
        const VoxelGrid& grid = bar.built.material.grid;
        std::vector<RegionFade::Node> nodes[2];
        for (std::size_t i = 0; i < count; ++i)
        {
            const Eigen::Vector3d x(support::random_number(rng, 0, kSide),
                                    support::random_number(rng, 0, kSide),
                                    support::random_number(rng, 0, kLength));
            places.push_back(x);
            cells.push_back(bar.built.pieces.at(grid, grid.locate(x)));
            if (Bar::end(x.z()) >= 0)
                nodes[Bar::end(x.z())].push_back({x, cells.back()});
            if (has_normals)
                normals.push_back({static_cast<std::uint32_t>(i),
                                   support::random_vector(rng, 1.0).normalized()});
        }
        for (const std::vector<RegionFade::Node>& of_end : nodes)
            fades.emplace_back(bar.built.cells, of_end, std::span<RegionFade::Node>());
        for (std::size_t r = 0; r < fades.size(); ++r)
        {
            regions.push_back({&fades[r], false, {}});
            for (std::size_t c = 0; c < bar.poses.size(); ++c)
                if (Bar::end(bar.built.cells.cells[c].centre.z()) == static_cast<int>(r))
                    regions[r].cells.push_back(static_cast<int>(c));
        }
        build(true);
    }
    /// The tables, with the ends' regions or free of them.
    void build(bool has_regions)
    {
        blend = std::make_unique<SampleBlend>(
            FieldKind::Blend, bar.built.cells, SampleSet{places, cells, normals},
            bar.constraints,
            has_regions ? std::span<const FadedRegion>(regions)
                        : std::span<const FadedRegion>());
        has_motions = has_regions;
    }
    bool has_motions = false;
    std::span<const Motion> motions() const
    {
        return has_motions ? std::span<const Motion>(bar.motions)
                           : std::span<const Motion>();
    }
};

struct Choice
{
    std::size_t count = 0;
    bool has_normals = false, has_regions = false;
};

Input& input(const Choice& choice)
{
    static std::unique_ptr<Input> current;
    static Choice of;
    if (!current || of.count != choice.count || of.has_normals != choice.has_normals)
    {
        current.reset();
        current = std::make_unique<Input>(choice.count, choice.has_normals);
        of = choice;
        of.has_regions = true;
    }
    if (of.has_regions != choice.has_regions)
        current->build(choice.has_regions);
    of.has_regions = choice.has_regions;
    return *current;
}

/// Seconds of one call: the shortest of some.
template <class Call>
double shortest(const Call& call)
{
    double least = INFINITY;
    const Clock::time_point begin = Clock::now();
    while (Clock::now() - begin < std::chrono::milliseconds(300))
    {
        const Clock::time_point start = Clock::now();
        call();
        least = std::min(least, seconds_since(start));
    }
    return least;
}

/// Sums of what is read, so many that as much is written as wanted.
class PlainLoop
{
public:
    PlainLoop(std::size_t bytes_read, std::size_t bytes_written)
        : in_(bytes_read / sizeof(float), 1.0f), out_(bytes_written / sizeof(float)),
          columns_((in_.size() + out_.size() - 1) / out_.size())
    {
        in_.resize(columns_ * out_.size(), 1.0f);
    }
    void operator()()
    {
        constexpr std::size_t kBlock = 48;
        parallel_ranges(out_.size() / kBlock, 64,
                        [&](std::size_t begin, std::size_t end)
                        {
                            for (std::size_t b = begin; b < end; ++b)
                            {
                                const float* in = &in_[b * kBlock * columns_];
                                float sums[kBlock] = {};
                                for (std::size_t c = 0; c < columns_; ++c)
                                    for (std::size_t l = 0; l < kBlock; ++l)
                                        sums[l] += in[c * kBlock + l];
                                std::copy_n(sums, kBlock, &out_[b * kBlock]);
                            }
                        });
    }
    std::size_t bytes() const { return (in_.size() + out_.size()) * sizeof(float); }

private:
    std::vector<float> in_, out_;
    std::size_t columns_; ///< numbers read for each that is written
};

void build(benchmark::State& state, const Choice& choice)
{
    Input& in = input(choice);
    for (auto _ : state)
        in.build(choice.has_regions);
}

void frame(benchmark::State& state, const Choice& choice, InstructionSet set, int threads)
{
    const ThreadLimit limit(threads);
    Input& in = input(choice);
    in.blend->use(set);
    const auto apply = [&] { in.blend->apply(in.bar.poses, in.motions()); };
    for (auto _ : state)
        apply();
    const double bytes =
        static_cast<double>(in.blend->bytes_read() + in.blend->bytes_written());
    PlainLoop plain(in.blend->bytes_read(), in.blend->bytes_written());
    const double blend_rate = bytes / shortest(apply);
    const double plain_rate =
        static_cast<double>(plain.bytes()) / shortest([&] { plain(); });
    state.counters["bytes_a_sample"] = bytes / static_cast<double>(choice.count);
    state.counters["GB/s"] = 1e-9 * blend_rate;
    state.counters["plain_GB/s"] = 1e-9 * plain_rate;
    state.counters["times_slower"] = plain_rate / blend_rate;
}

const char* name_of(InstructionSet set)
{
    return set == InstructionSet::Avx512 ? "avx512"
           : set == InstructionSet::Avx2 ? "avx2"
                                         : "plain";
}

} // namespace

int main(int argc, char** argv)
{
    benchmark::Initialize(&argc, argv);
    for (std::size_t count = 10000; count <= most_samples(); count *= 10)
        for (const bool has_normals : {false, true})
            for (const bool has_regions : {false, true})
            {
                const Choice choice{count, has_normals, has_regions};
                const std::string name =
                    fmt::format("{}{}{}", count, has_normals ? "/normals" : "/places",
                                has_regions ? "/regions" : "");
                benchmark::RegisterBenchmark((name + "/build").c_str(),
                                             [choice](benchmark::State& state)
                                             { build(state, choice); })
                    ->UseRealTime()
                    ->Unit(benchmark::kMillisecond);
                for (const InstructionSet set : instruction_sets())
                    for (const int threads : {1, 0})
                        benchmark::RegisterBenchmark(
                            fmt::format("{}/{}/{}", name, name_of(set),
                                        threads ? "1_thread" : "all_threads")
                                .c_str(),
                            [=](benchmark::State& state)
                            { frame(state, choice, set, threads); })
                            ->UseRealTime()
                            ->Unit(benchmark::kMillisecond);
            }
    benchmark::RunSpecifiedBenchmarks();
}
