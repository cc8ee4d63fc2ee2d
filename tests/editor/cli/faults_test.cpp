// SPDX-License-Identifier: GPL-3.0-or-later
// Whatever fails in the whole program, libraries included, it ends in a documented state:
// the old output or the new one is there, and nothing else is left behind.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "io/base/error.h"
#include "octree/base/index.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/sanitized.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::BarFiles;
using support::bytes_of;
using support::contains;
using support::Result;

namespace
{

constexpr std::size_t kFew = 24;

/// So many calls of a kind fail one after the other, a run each; of those behind them
/// some. CELLWARP_FAULTS: another number.
std::size_t num_faults(std::size_t few)
{
    const char* const wanted = std::getenv("CELLWARP_FAULTS");
    return wanted ? idx(std::atol(wanted)) : few;
}

constexpr char kRope[] = R"({"cellwarp": 1,
    "rods": [{"name": "rope", "through": [[0,0,0],[1,0,0]], "fixed": [{"at": 0}]}],
    "simulate": {"dt": 0.01, "duration": 0.1}})";

/// Of a command: what it reads and writes is there.
class Faults : public testing::TestWithParam<const char*>
{
protected:
    void SetUp() override
    {
        if (support::kIsSanitized)
            GTEST_SKIP() << "its library must be loaded before all others";
        const std::string command = GetParam();
        input_ = bar_.model;
        out_ = bar_.out;
        if (command == "deform")
            arguments_ = bar_.deform_arguments({"--max-depth", "1", "--json"});
        else if (command == "apply")
        {
            const std::string field = bar_.folder / "bend.cwf";
            ASSERT_EQ(bar_.deform({"--save-field", field}).code, 0);
            arguments_ = {"apply", field, bar_.model, "-o", out_};
        }
        else if (command == "cloud")
        {
            // What its points enclose is found by floods.
            std::string points;
            for (const Eigen::Vector3d& x :
                 support::box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 3).samples)
                points += fmt::format("{} {} {}\n", x.x(), x.y(), x.z());
            input_ = bar_.folder.write("bar.xyz", points);
            out_ = bar_.folder / "out.xyz";
            arguments_ = {"deform", input_,  "--handles", bar_.handles, "-o",
                          out_,     "--gap", "0.02",      "--across",   "8"};
        }
        else if (command == "check" || command == "info")
        {
            out_.clear(); // the answer is what is printed
            arguments_ = {command, bar_.model, "--json"};
            if (command == "check")
                arguments_.insert(arguments_.end(), {"--handles", bar_.handles});
            else
                arguments_.push_back("--extremities");
        }
        else if (command == "render")
        {
            out_ = bar_.folder / "out.png";
            arguments_ = {"render", bar_.model, "-o", out_, "--size", "64x48"};
        }
        else
        {
            input_ = bar_.folder.write("rope.json", kRope);
            arguments_ = {"simulate", input_, "-o", out_};
        }
        arguments_.insert(arguments_.end(), {"--overwrite", "--threads", "2"});
        const int code = support::run(arguments_).code;
        if ((code == static_cast<int>(Fault::Usage) && command == "render") ||
            (code == static_cast<int>(Fault::Unsolvable) && command == "info"))
            GTEST_SKIP() << "this build does without";
        ASSERT_EQ(code, 0);
        if (writes_file())
            std::filesystem::remove(out_);
    }

    bool writes_file() const { return !out_.empty(); }

    /// Runs with one call failing; false where so many are not made.
    bool fails_well(const std::string& kind, std::size_t which,
                    const std::set<int>& codes)
    {
        SCOPED_TRACE(kind + " " + std::to_string(which));
        const std::string told = told_ / "told";
        std::filesystem::remove(told);
        const std::string old = "what was there before";
        if (writes_file())
            std::ofstream(out_) << old;
        const std::size_t files = support::num_files(bar_.folder);
        const Result result =
            support::run(arguments_,
                         [&]
                         {
                             ::setenv("LD_PRELOAD", CELLWARP_FAILING_PROCESS, 1);
                             ::setenv("CELLWARP_FAILS",
                                      (kind + " " + std::to_string(which)).c_str(), 1);
                             ::setenv("CELLWARP_FAILS_FROM", input_.c_str(), 1);
                             ::setenv("CELLWARP_FAILS_TOLD", told.c_str(), 1);
                         });
        const bool has_failed = std::filesystem::exists(told);
        codes_.insert(result.code);
        EXPECT_TRUE(result.code == 0 || (has_failed && codes.contains(result.code)))
            << result.code << "\n"
            << result.err;
        const std::string now = writes_file() ? bytes_of(out_) : result.out;
        if (whole_.empty() && result.code == 0)
            whole_ = now;
        // Renamed is renamed, whatever comes after: then the error tells of the folder.
        // There may be no memory for an object, and no room for it on stdout.
        const bool is_old =
            writes_file() ? now == old : now.empty() || contains(now, "\"error\": {");
        EXPECT_TRUE(now == whole_ || (result.code != 0 && is_old)) << result.err;
        EXPECT_EQ(support::num_files(bar_.folder), files);
        EXPECT_TRUE(result.code == 0 || contains("\n" + result.err, "\nerror: "))
            << result.err;
        return has_failed;
    }

    /// All calls of a kind, or of many the first ones and some; gives the codes seen.
    std::set<int> all_fail_well(const std::string& kind, const std::set<int>& codes,
                                std::size_t few = kFew)
    {
        EXPECT_FALSE(fails_well(kind, 100000000, {})); // what the whole output is
        codes_.clear();
        std::size_t which = 1;
        while (fails_well(kind, which, codes))
            which += which < num_faults(few) ? 1 : 1 + which / 2;
        EXPECT_GT(which, 1u) << "no call was made";
        return codes_;
    }

    BarFiles bar_;
    support::Folder told_;
    std::string input_, out_; ///< the calls that fail come after \c input_ is opened
    std::vector<std::string> arguments_;
    std::string whole_;
    std::set<int> codes_;
};

INSTANTIATE_TEST_SUITE_P(Of, Faults,
                         testing::Values("deform", "cloud", "apply", "check", "info",
                                         "render", "simulate"),
                         [](const auto& of) { return std::string(of.param); });

constexpr int kFile = static_cast<int>(Fault::File);
constexpr int kBudget = static_cast<int>(Fault::Budget);

} // namespace

TEST_P(Faults, of_the_disk_leave_the_old_output_or_the_new_one)
{
    std::vector<const char*> kinds = {"write"};
    if (writes_file())
        kinds.insert(kinds.end(), {"fsync", "rename"});
    for (const char* kind : kinds)
        EXPECT_EQ(all_fail_well(kind, {kFile}).count(kFile), 1u) << kind;
}

TEST_P(Faults, of_opening_files_are_told_as_files_that_cannot_be_opened)
{
    EXPECT_EQ(all_fail_well("open", {kFile}).count(kFile), 1u);
}

TEST_P(Faults, of_threads_are_told_as_too_few_of_them)
{
    if (GetParam() == std::string("simulate") || GetParam() == std::string("info"))
        GTEST_SKIP() << "it is no work for several";
    // Files are read and written without one, if need be, and what is small is drawn so.
    const std::set<int> codes = all_fail_well("thread", {kBudget});
    EXPECT_TRUE(codes.contains(kBudget) || GetParam() != std::string("deform"));
}

TEST_P(Faults, of_memory_are_told_as_too_little_of_it)
{
    // A tree of points printed what it missed, and the program that finds skeletons was
    // started without its streams: answers differed. They come that late.
    const bool is_late =
        GetParam() == std::string("cloud") || GetParam() == std::string("info");
    EXPECT_EQ(all_fail_well("malloc", {kBudget}, is_late ? 300 : kFew).count(kBudget),
              1u);
}

} // namespace cellwarp::core
