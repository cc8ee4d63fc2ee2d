// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/worker.h"

#include <atomic>
#include <semaphore>
#include <vector>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

/// Gives out the square of what it is asked for, each time when it is let.
struct Squares
{
    std::vector<int> begun; ///< in alone()
    std::counting_semaphore<> may_go{0}, has_begun{0}, is_done{0};
    Worker<int, int> worker;

    Squares()
    {
        worker.start(
            [this]
            {
                int number = 0;
                while (worker.next(number, [&](int asked) { begun.push_back(asked); }))
                {
                    has_begun.release();
                    may_go.acquire();
                    int square = number * number;
                    worker.alone([&] { worker.give(square); });
                    is_done.release();
                }
            });
    }
    /// -1: there is none that was not taken.
    int taken()
    {
        int result = -1;
        worker.take([&](int& newest) { result = newest; });
        return result;
    }
};

} // namespace

TEST(Worker, works_on_the_newest_request_alone)
{
    Squares squares;
    squares.worker.ask(2);
    squares.has_begun.acquire();
    EXPECT_EQ(squares.taken(), -1);
    for (const int number : {3, 4, 5})
        squares.worker.ask(number);
    squares.worker.alone(
        [&]
        {
            EXPECT_TRUE(squares.worker.is_working());
            EXPECT_TRUE(squares.worker.is_asked());
        });
    squares.may_go.release();
    squares.has_begun.acquire();
    EXPECT_EQ(squares.taken(), 4);
    EXPECT_EQ(squares.taken(), -1);
    squares.may_go.release();
    squares.is_done.acquire();
    squares.is_done.acquire();
    EXPECT_EQ(squares.taken(), 25);
    squares.worker.end();
    EXPECT_EQ(squares.begun, (std::vector{2, 5}));
}

TEST(Worker, gives_out_the_newest_result_alone)
{
    Squares squares;
    for (const int number : {2, 3})
    {
        squares.worker.ask(number);
        squares.has_begun.acquire();
        squares.may_go.release();
        squares.is_done.acquire();
    }
    EXPECT_EQ(squares.taken(), 9);
    EXPECT_EQ(squares.taken(), -1);
}

TEST(Worker, ends_with_what_is_under_way_and_begins_nothing_more)
{
    Squares squares;
    squares.worker.ask(2);
    squares.has_begun.acquire();
    squares.worker.ask(3);
    squares.may_go.release(2);
    squares.worker.end();
    squares.worker.end();                // once more does no harm
    EXPECT_LE(squares.begun.size(), 2u); // the end may come after 3 has begun
    EXPECT_EQ(squares.taken(), squares.begun.size() == 2 ? 9 : 4);
    squares.worker.ask(4);
    EXPECT_LE(squares.begun.size(), 2u);
}

TEST(Worker, forgets_a_request_that_has_not_begun)
{
    Squares squares;
    squares.worker.ask(2);
    squares.has_begun.acquire();
    squares.worker.ask(3);
    squares.worker.alone([&] { squares.worker.forget_request(); });
    squares.may_go.release();
    squares.is_done.acquire();
    squares.worker.end();
    EXPECT_EQ(squares.begun, std::vector{2});
}

TEST(Worker, wakes_for_a_request_for_the_end_and_for_a_point_in_time)
{
    Worker<int, int> worker;
    std::atomic<int> woken{0};
    std::counting_semaphore<> wakes{0};
    worker.start(
        [&]
        {
            for (int request = 0; !worker.is_ending();)
            {
                worker.wait(woken == 0 ? Clock::now() + std::chrono::milliseconds(1)
                                       : Clock::time_point::max());
                worker.take_request(request);
                ++woken;
                wakes.release();
            }
        });
    wakes.acquire(); // nobody has asked
    EXPECT_EQ(woken, 1);
    worker.ask(7);
    wakes.acquire();
    EXPECT_EQ(woken, 2);
    worker.end();
    EXPECT_LE(woken, 3); // the end may come before it waits again
}

} // namespace cellwarp::core
