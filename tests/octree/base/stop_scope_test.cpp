// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/stop_scope.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "tests/support/counted_stop.h"

namespace cellwarp::core
{

TEST(StopScope, a_loop_on_all_threads_ends_when_another_thread_asks)
{
    std::stop_source source;
    std::atomic<int> num_done = 0;
    const StopOnRequest scope(source.get_token());
    EXPECT_THROW(parallel_for(100000,
                              [&](int)
                              {
                                  if (++num_done == 50)
                                      source.request_stop();
                                  std::this_thread::sleep_for(
                                      std::chrono::microseconds(10));
                              }),
                 Stopped);
    EXPECT_LT(num_done, 50000);
    EXPECT_TRUE(is_stop_requested());
}

TEST(StopScope, a_loop_that_is_not_stopped_does_all_of_it_once)
{
    const support::CountedStop scope(INT64_MAX);
    for (const std::size_t count : {0u, 1u, 63u, 64u, 65u, 1000u, 12345u})
        for (const std::size_t grain : {1u, 7u, 64u, 5000u})
        {
            std::vector<std::atomic<int>> calls(count);
            std::atomic<bool> is_empty = false;
            parallel_ranges(count, grain,
                            [&](std::size_t begin, std::size_t end)
                            {
                                is_empty = is_empty || begin >= end;
                                for (std::size_t i = begin; i < end; ++i)
                                    ++calls[i];
                            });
            for (const std::atomic<int>& of : calls)
                ASSERT_EQ(of, 1) << count << " " << grain;
            EXPECT_FALSE(is_empty);
        }
    EXPECT_GT(scope.num_looks(), 0);
}

TEST(StopScope, a_loop_inside_a_loop_ends_with_the_outer_one_on_every_thread)
{
    std::stop_source source;
    std::atomic<int> num_done = 0;
    const StopOnRequest scope(source.get_token());
    EXPECT_THROW(parallel_for(64,
                              [&](int)
                              {
                                  parallel_for(1000,
                                               [&](int)
                                               {
                                                   if (++num_done == 100)
                                                       source.request_stop();
                                                   check_stop();
                                               });
                              }),
                 Stopped);
    EXPECT_LT(num_done, 2000);
}

TEST(StopScope, scopes_nest_and_end_with_their_block)
{
    std::stop_source outer, inner;
    const StopOnRequest all(outer.get_token());
    {
        const StopOnRequest some(inner.get_token());
        EXPECT_NO_THROW(check_stop());
        inner.request_stop();
        EXPECT_THROW(check_stop(), Stopped);
    }
    EXPECT_NO_THROW(check_stop());
    EXPECT_FALSE(is_stop_requested());
    outer.request_stop();
    const StopAtTime later(Clock::time_point::max());
    EXPECT_THROW(check_stop(), Stopped);
}

TEST(StopScope, a_point_in_time_ends_the_work)
{
    const StopAtTime scope(time_after(Clock::now(), 0.02));
    EXPECT_NO_THROW(check_stop());
    const auto wait = [](int)
    { std::this_thread::sleep_for(std::chrono::milliseconds(1)); };
    EXPECT_THROW(parallel_for(100000, wait), Stopped);
    EXPECT_EQ(time_after(Clock::now(), 1e300), Clock::time_point::max());
}

TEST(StopScope, a_deferral_hides_the_scopes_around_it_but_says_that_the_end_is_wanted)
{
    std::stop_source source;
    source.request_stop();
    const StopOnRequest scope(source.get_token());
    std::atomic<int> num_done = 0;
    {
        const StopDeferral deferral;
        parallel_for(1000,
                     [&](int)
                     {
                         ++num_done;
                         if (!is_stop_requested()) // on every thread
                             throw std::logic_error("not asked");
                     });
        const StopOnRequest own(source.get_token());
        EXPECT_THROW(check_stop(), Stopped);
    }
    EXPECT_EQ(num_done, 1000);
    EXPECT_THROW(check_stop(), Stopped);
}

TEST(StopScope, threads_stop_independently)
{
    std::stop_source source;
    source.request_stop();
    std::atomic<bool> was_stopped = false, was_asked = false;
    std::atomic<bool> has_ended = false;
    std::thread stopped(
        [&]
        {
            const StopOnRequest scope(source.get_token());
            while (!has_ended)
                try
                {
                    parallel_for(1000, [](int) {});
                }
                catch (const Stopped&)
                {
                    was_stopped = true;
                }
        });
    std::thread other(
        [&]
        {
            for (int round = 0; round < 200; ++round)
                parallel_for(1000,
                             [&](int) { was_asked = was_asked || is_stop_requested(); });
            has_ended = true;
        });
    other.join();
    stopped.join();
    EXPECT_TRUE(was_stopped);
    EXPECT_FALSE(was_asked);
}

} // namespace cellwarp::core
