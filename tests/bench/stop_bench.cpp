// SPDX-License-Identifier: GPL-3.0-or-later
// stop_bench [--signals N] [--seed N] [--threshold X] [--looks] MODEL HANDLES...: plays
// an edit N times, asks for its end after a random share of the time that the whole
// takes, and prints how long it goes on after that [ms]. With --looks no end is asked
// for: how often each thread looks whether one is, and the longest that it worked without
// looking [ms of CPU].
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <time.h>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/formats/geometry_file.h"
#include "io/scene/handle_file.h"
#include "library/session/scene_settings.h"
#include "library/session/session.h"
#include "octree/base/stop_scope.h"

namespace
{

using namespace cellwarp::core;

struct Edit
{
    std::string name;
    std::shared_ptr<const Geometry> geometry;
    HandleFile handles;
    SessionSettings settings;
};

void play(const Edit& edit)
{
    Session session(edit.geometry, edit.handles, edit.settings);
    while (session.next_frame(true))
        ;
}

/// How long the edit goes on after it was asked to end [ms]; negative: it was over.
double goes_on_for(const Edit& edit, double after)
{
    std::stop_source source;
    Clock::time_point asked = Clock::time_point::max();
    std::jthread asking(
        [&](const std::stop_token& is_over)
        {
            const Clock::time_point at = time_after(Clock::now(), after);
            while (Clock::now() < at && !is_over.stop_requested())
                std::this_thread::sleep_until(
                    std::min(at, time_after(Clock::now(), 0.01)));
            asked = Clock::now();
            source.request_stop();
        });
    bool is_stopped = false;
    Clock::time_point end;
    try
    {
        const StopOnRequest scope(source.get_token());
        play(edit);
    }
    catch (const Stopped&)
    {
        is_stopped = true;
    }
    end = Clock::now();
    asking.request_stop();
    asking.join();
    return is_stopped ? 1e3 * std::chrono::duration<double>(end - asked).count() : -1.0;
}

/// CPU time of this thread [ms].
double thread_ms()
{
    timespec now{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return 1e3 * static_cast<double>(now.tv_sec) +
           1e-6 * static_cast<double>(now.tv_nsec);
}

/// Measures the work between looks.
class Looks final : public StopScope
{
public:
    std::int64_t count() const { return count_; }
    double longest() const { return longest_; }

private:
    bool is_met() const override
    {
        thread_local double last = thread_ms();
        const double now = thread_ms();
        const std::lock_guard lock(mutex_);
        ++count_;
        longest_ = std::max(longest_, now - last);
        last = now;
        return false;
    }

    mutable std::mutex mutex_;
    mutable std::int64_t count_ = 0;
    mutable double longest_ = 0.0;
};

double whole_seconds(const Edit& edit)
{
    const Clock::time_point start = Clock::now();
    play(edit);
    return seconds_since(start);
}

} // namespace

int main(int argc, char** argv)
try
{
    int signals = 50;
    std::uint32_t seed = 1;
    bool counts_looks = false;
    double threshold = kUsualThreshold;
    std::vector<std::string> files;
    for (int i = 1; i < argc; ++i)
    {
        const std::string word = argv[i];
        if (word == "--looks")
            counts_looks = true;
        else if (word.starts_with("--") && i + 1 < argc)
        {
            const double value = std::atof(argv[++i]);
            if (word == "--signals")
                signals = static_cast<int>(value);
            else if (word == "--seed")
                seed = static_cast<std::uint32_t>(value);
            else if (word == "--threshold")
                threshold = value;
        }
        else
            files.push_back(word);
    }
    if (files.empty() || files.size() % 2 != 0)
        throw Error(Fault::Usage,
                    "usage: stop_bench [--signals N] [--seed N] [--threshold "
                    "X] [--looks] MODEL HANDLES...");
    for (std::size_t f = 0; f < files.size(); f += 2)
    {
        Edit edit{
            files[f],
            geometry_of(std::make_shared<const GeometryFile>(read_geometry(files[f]))),
            read_handles(files[f + 1]), settings_of(SceneFile())};
        edit.settings.cells.threshold = threshold;
        if (counts_looks)
        {
            const Looks looks;
            play(edit);
            fmt::print("{}: {} looks, the longest work without one {:.1f} ms\n",
                       edit.name, looks.count(), looks.longest());
            continue;
        }
        const double whole = whole_seconds(edit);
        std::mt19937 rng(seed);
        std::uniform_real_distribution<double> share(0.0, 1.0);
        std::vector<double> ms;
        int num_over = 0;
        while (static_cast<int>(ms.size()) < signals)
        {
            const double found = goes_on_for(edit, whole * share(rng));
            if (found >= 0.0)
                ms.push_back(found);
            else if (++num_over > signals)
                throw std::runtime_error("the edit is always over first");
        }
        std::sort(ms.begin(), ms.end());
        fmt::print("{}: {:.2f} s, {} stops, median {:.1f} ms, largest {:.1f} ms\n",
                   edit.name, whole, ms.size(), ms[ms.size() / 2], ms.back());
        std::fflush(stdout);
    }
    return 0;
}
catch (const std::exception& error)
{
    fmt::print(stderr, "error: {}\n", error.what());
    return 1;
}
