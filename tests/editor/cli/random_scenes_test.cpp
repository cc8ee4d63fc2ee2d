// SPDX-License-Identifier: GPL-3.0-or-later
// Every scene ends in a documented state, whatever it is: hundreds of them, or as many as
// CELLWARP_RANDOM_SCENES says, and small ones, each run twice, as many as
// CELLWARP_SMALL_SCENES says. The files of a scene that failed are kept, and named.
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sys/resource.h>

#include "io/bytes.h"
#include "io/geometry.h"
#include "io/geometry_file.h"
#include "tests/support/program.h"
#include "tests/support/random_scene.h"
#include "tests/support/sanitized.h"

namespace cellwarp
{

namespace
{

using support::RandomScene;

constexpr std::uint32_t kShards = 16;

/// Processor time of one scene, both threads [s]: the median takes a tenth of a second.
constexpr int kSeconds = support::kIsSanitized ? 300 : 20;

/// Where a sample may end beside its target: of the larger of diagonal and travel.
constexpr double kPlace = 2e-9;

std::uint32_t number_of(const char* name, std::uint32_t otherwise)
{
    const char* const text = std::getenv(name);
    return text ? static_cast<std::uint32_t>(std::strtoul(text, nullptr, 10)) : otherwise;
}

std::string kept_copy(const support::Folder& folder, std::uint32_t seed)
{
    const std::filesystem::path to =
        std::filesystem::path(testing::TempDir()) / ("scene-" + std::to_string(seed));
    std::filesystem::remove_all(to);
    std::filesystem::copy(folder.path(), to);
    return to.string();
}

void limit_processor_time()
{
    const rlimit limit{kSeconds, kSeconds + 1};
    ::setrlimit(RLIMIT_CPU, &limit);
    const rlimit no_core{0, 0};
    ::setrlimit(RLIMIT_CORE, &no_core);
}

/// What is wrong with the samples that a region holds; empty: nothing.
std::string fault_of_samples(const RandomScene& scene, const std::string& path)
{
    const std::vector<Eigen::Vector3d> samples = read_geometry(path).geometry.samples;
    if (samples.size() != scene.samples.size())
        return "lost samples";
    double farthest = 0.0;
    for (const Eigen::Vector3d& x : scene.samples)
        farthest = std::max(farthest, x.stableNorm());
    const double size = scene.diagonal * std::max(1.0, scene.travel);
    for (const Eigen::Vector3d& x : samples)
        if (!x.allFinite())
            return "samples nowhere";
    double worst = 0.0;
    for (const std::vector<RandomScene::Target>& ends : scene.ends)
        for (const RandomScene::Target& end : ends)
            worst = std::max(worst, (samples[end.sample] - end.place).stableNorm());
    return worst <= kPlace * size + 1e-15 * farthest
               ? ""
               : "handle samples in the wrong place, by " +
                     std::to_string(worst / scene.diagonal) + " diagonals";
}

std::string fault_of_report(const support::Result& result)
{
    const nlohmann::json json = nlohmann::json::parse(result.out);
    for (const nlohmann::json& frame : json["frames"])
    {
        if (result.code == 0 && frame["stop"] != "converged")
            return "exit 0 without a solution";
        if (result.code == 0 && frame["handle_residual"] > 1e-9)
            return "exit 0 with samples left behind";
        // Smaller cells may have more; so may what had no iterations left to be solved.
        if (frame["stop"] == "converged" && frame["recuts"] == 0 &&
            frame["energy_after"].get<double>() >
                1.0000001 * frame["energy_before"].get<double>() + 1e-30)
            return "the energy rose";
    }
    return "";
}

std::string fault_of(const RandomScene& scene, const support::Result& result,
                     const support::Folder& folder, const std::string& out)
{
    switch (result.code)
    {
    case 0:
    case 7:
    {
        const std::string fault = fault_of_samples(scene, out);
        return fault.empty() ? fault_of_report(result) : fault;
    }
    case 3:
    case 5:
    case 6:
        if (!result.out.empty() || support::num_files(folder) != 2)
            return "an error that leaves something";
        if (result.err.find("error: ") == std::string::npos)
            return "an error without a message";
        if (result.err.find("finite numbers") != std::string::npos)
            return "a scene of finite numbers has no solution in them";
        return "";
    case 128 + SIGXCPU:
        return "not done in time";
    default:
        return "no documented exit code";
    }
}

/// \p runs_again: on as many threads as there are, for the same bytes.
void run_scene(std::uint32_t seed, const RandomScene& scene, bool runs_again,
               std::map<std::string, int>& ends)
{
    const support::Folder folder;
    const std::string model = folder.write(scene.model_name, scene.model_text);
    const std::string handles = folder.write("scene.handles", scene.handles_text);
    const std::string out = folder / ("out-" + scene.model_name);
    std::vector<std::string> arguments = {"deform", model, "--handles", handles,
                                          "-o",     out,   "--json"};
    arguments.insert(arguments.end(), scene.arguments.begin(), scene.arguments.end());
    const support::Result result = support::run(arguments, limit_processor_time);
    ++ends["exit_" + std::to_string(result.code) +
           (result.code == 7 && !scene.is_limited ? "_without_limit" : "")];
    std::string fault = fault_of(scene, result, folder, out);
    if (runs_again && fault.empty())
    {
        const bool is_written = std::filesystem::exists(out);
        const std::string first = is_written ? read_file(out) : result.err;
        arguments.back() = "0"; // the threads
        arguments.push_back("--overwrite");
        const support::Result again = support::run(arguments, limit_processor_time);
        if (again.code != result.code ||
            first != (is_written ? read_file(out) : again.err))
            fault = "another run ends otherwise";
    }
    EXPECT_EQ(fault, "") << "seed " << seed << ", exit " << result.code << ", files in "
                         << (fault.empty() ? "" : kept_copy(folder, seed)) << "\n"
                         << scene.describe() << result.err;
}

class RandomScenes : public testing::TestWithParam<std::uint32_t>
{
};

TEST_P(RandomScenes, EndInADocumentedState)
{
    std::map<std::string, int> ends;
    const std::uint32_t count = number_of("CELLWARP_RANDOM_SCENES", 192);
    for (std::uint32_t seed = GetParam(); seed < count; seed += kShards)
        run_scene(seed, support::random_scene(seed), false, ends);
    for (const auto& [end, count_of_end] : ends)
        RecordProperty(end, std::to_string(count_of_end));
}

TEST_P(RandomScenes, OfSmallSizeEndSoTwice)
{
    std::map<std::string, int> ends;
    const std::uint32_t count = number_of("CELLWARP_SMALL_SCENES", 160);
    for (std::uint32_t seed = GetParam(); seed < count; seed += kShards)
        run_scene(seed, support::small_random_scene(seed), true, ends);
    for (const auto& [end, count_of_end] : ends)
        RecordProperty(end, std::to_string(count_of_end));
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomScenes, testing::Range(0u, kShards));

} // namespace

} // namespace cellwarp
