// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/drag.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <thread>

#include "tests/support/interface.h"

namespace cellwarp
{

using support::Bar;
using support::bend;
using support::coarse;
using support::contains;
using support::error_of;
using support::numbers;

namespace
{

Mat4 shifted(double by)
{
    Mat4 motion = kIdentity;
    motion[0][3] = by;
    return motion;
}

} // namespace

TEST(Drag, leads_the_handle_where_it_is_asked_to)
{
    const Bar bar;
    std::optional<Session> session;
    session.emplace(Model(bar), bend(0.0), coarse());
    session->next();
    Drag drag(*session);
    session.reset(); // it is not needed any more
    drag.move("head", shifted(0.5));
    DragFrame frame;
    for (int k = 0; k < 50 && frame.stop != Stop::Converged; ++k)
        frame = drag.frame();
    EXPECT_EQ(frame.stop, Stop::Converged);
    EXPECT_GT(frame.cells, 0u);
    std::vector<float> floats(3 * bar.samples.size());
    std::vector<double> doubles(floats.size()), normals(floats.size());
    drag.copy_samples(floats);
    drag.copy_samples(doubles);
    drag.copy_normals(normals);
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
    {
        if (bar.samples[i][2] >= 4.5)
        {
            EXPECT_NEAR(doubles[3 * i] - bar.samples[i][0], 0.5, 1e-5);
        }
        if (bar.samples[i][2] <= 0.5)
        {
            EXPECT_NEAR(doubles[3 * i], bar.samples[i][0], 1e-5);
        }
        EXPECT_EQ(floats[3 * i], static_cast<float>(doubles[3 * i]));
        EXPECT_NEAR(std::hypot(normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]),
                    1.0, 1e-5);
    }
}

TEST(Drag, gives_its_moves_for_the_exact_result)
{
    const Model model{Bar()};
    Session session(model, bend(0.0), coarse());
    session.next();
    Drag drag(session);
    EXPECT_TRUE(drag.moves().empty());
    drag.move("head", shifted(0.5));
    ASSERT_EQ(drag.moves().size(), 1u);
    Edit edit = bend(0.0);
    edit.frame(2).move(drag.moves()[0].first, {drag.moves()[0].second});
    session.set_edit(edit);
    session.next();
    const Bar bar;
    const std::vector<double> moved = numbers(session.deformed().samples());
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
        if (bar.samples[i][2] >= 4.5)
        {
            EXPECT_NEAR(moved[3 * i] - bar.samples[i][0], 0.5, 1e-9);
        }
}

TEST(Drag, refuses_what_it_cannot_move)
{
    Session session(Model(Bar()), bend(), coarse());
    Drag drag(session);
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, [&] { drag.move("none", kIdentity); }), "none"));
    error_of(Fault::Usage, [&] { drag.move("foot", kIdentity); });
    Mat4 motion = kIdentity;
    motion[0][0] = 2.0;
    error_of(Fault::Usage, [&] { drag.move("head", motion); });
    motion[0][0] = std::numeric_limits<double>::quiet_NaN();
    error_of(Fault::Usage, [&] { drag.move("head", motion); });
    error_of(Fault::Usage, [&] { drag.frame(0); });
    std::vector<double> few(6);
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, [&] { drag.copy_samples(few); }), "got 2"));
}

TEST(Drag, takes_smaller_cells_when_they_are_there)
{
    Settings settings;
    settings.cells.across = 8;
    settings.cells.threshold = 1e-4;
    Session session(Model(Bar()), bend(0.0), settings);
    session.next();
    Drag drag(session);
    drag.move("head", shifted(2.0));
    const std::size_t before = drag.frame(10).cells;
    drag.refine();
    std::size_t after = before;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (after == before && std::chrono::steady_clock::now() < end)
        after = drag.frame().cells;
    EXPECT_GT(after, before);
}

TEST(Drag, may_end_while_cells_are_made)
{
    Settings settings;
    settings.cells.threshold = 1e-5;
    Session session(Model(Bar()), bend(), settings);
    Drag drag(session);
    drag.move("head", shifted(1.0));
    drag.frame();
    drag.refine();
    SUCCEED();
}

} // namespace cellwarp
