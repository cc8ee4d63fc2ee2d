// SPDX-License-Identifier: GPL-3.0-or-later
// The program ends every scene in a documented state, whatever it is: 128 of them,
// or as many as CELLWARP_RANDOM_SCENES says. The files of a scene that failed are kept,
// and named.
#include <csignal>
#include <map>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sys/resource.h>

#include "io/formats/geometry_file.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/random_scene.h"
#include "tests/support/sanitized.h"

namespace cellwarp::core
{

namespace
{

using support::RandomScene;

constexpr std::uint32_t kShards = 16;

/// Processor time of one scene, both threads [s]: the median takes a tenth of a second.
constexpr int kSeconds = support::kIsSanitized ? 300 : 20;

void limit_processor_time()
{
    const rlimit limit{kSeconds, kSeconds + 1};
    ::setrlimit(RLIMIT_CPU, &limit);
    const rlimit no_core{0, 0};
    ::setrlimit(RLIMIT_CORE, &no_core);
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
        const std::string fault =
            support::fault_of_samples(scene, read_geometry(out).geometry.samples);
        return fault.empty() ? fault_of_report(result) : fault;
    }
    case 3:
    case 5:
    case 6:
        if (support::num_files(folder) != 2)
            return "an error that leaves something";
        if (!nlohmann::json::parse(result.out, nullptr, false).contains("error"))
            return "an error without an object";
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

void run_scene(std::uint32_t seed, const RandomScene& scene,
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
    const std::string fault = fault_of(scene, result, folder, out);
    EXPECT_EQ(fault, "") << "seed " << seed << ", exit " << result.code << ", files in "
                         << (fault.empty() ? "" : support::kept_copy(folder, seed))
                         << "\n"
                         << scene.describe() << result.err;
}

class RandomScenes : public testing::TestWithParam<std::uint32_t>
{
};

TEST_P(RandomScenes, EndInADocumentedState)
{
    std::map<std::string, int> ends;
    const std::uint32_t count = support::number_of_scenes("CELLWARP_RANDOM_SCENES", 128);
    for (std::uint32_t seed = GetParam(); seed < count; seed += kShards)
        run_scene(seed, support::random_scene(seed), ends);
    for (const auto& [end, count_of_end] : ends)
        RecordProperty(end, std::to_string(count_of_end));
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomScenes, testing::Range(0u, kShards));

} // namespace

} // namespace cellwarp::core
