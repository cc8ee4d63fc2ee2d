// SPDX-License-Identifier: GPL-3.0-or-later
// Pins that move as one rigid body, alone or with a handle, take all along rigidly.
#include "library/session/session.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "io/base/number.h"
#include "io/formats/geometry_file.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

const Shape kBar = support::box_shape({0, 0, 0}, {4, 1, 1}, 4);

std::string text_of(const Eigen::Vector3d& x)
{
    return " " + shortest(x[0]) + " " + shortest(x[1]) + " " + shortest(x[2]);
}

/// Pins of samples that \p motion takes along, and what else the file has.
std::string pins_text(const std::vector<std::size_t>& samples, const Motion& motion,
                      const std::string& regions = "", const std::string& moves = "")
{
    std::string text = "cellwarp-handles 1\n" + regions, of_frame = "frame 1\n" + moves;
    for (const std::size_t i : samples)
    {
        const Eigen::Vector3d& x = kBar.samples[i];
        const std::string name = "p" + std::to_string(i);
        text += "pin " + name + " indices " + std::to_string(i) + "\n";
        of_frame += "move " + name + " translate" + text_of(motion(x) - x) + "\n";
    }
    return text + of_frame;
}

std::vector<std::size_t> some_samples(std::size_t count, unsigned seed)
{
    std::vector<std::size_t> samples; // off the end, which a handle may hold
    for (std::size_t i = 0; i < kBar.samples.size(); ++i)
        if (kBar.samples[i].x() < 3.5)
            samples.push_back(i);
    std::shuffle(samples.begin(), samples.end(), std::mt19937(seed));
    samples.resize(count);
    return samples;
}

/// To 1e-9 of the diagonal all samples go where \p motion takes them, at no energy.
void expect_rigid(const std::string& handles, const Motion& motion)
{
    SessionSettings settings;
    settings.cells.across = 24;
    Session session(scan_geometry("model.obj", support::obj_text(kBar)).geometry,
                    parse_handles("h.handles", handles), settings);
    while (session.next_frame(true))
        ;
    double worst = 0.0;
    for (std::size_t i = 0; i < kBar.samples.size(); ++i)
        worst = std::max(
            worst, (session.deformed().samples[i] - motion(kBar.samples[i])).norm());
    EXPECT_LT(worst, 1e-9 * std::sqrt(18.0));
    EXPECT_LT(session.frames().back().solve.energy_after, 1e-20);
    EXPECT_EQ(session.frames().back().solve.stop, Stop::Converged);
}

Motion turn_about_the_middle(double degrees, const Eigen::Vector3d& axis)
{
    const Eigen::Matrix3d R =
        rotation_about(axis.normalized(), degrees * std::numbers::pi / 180.0);
    const Eigen::Vector3d middle(2.0, 0.5, 0.5);
    return {R, middle - R * middle};
}

} // namespace

TEST(Pins, that_move_rigidly_alone_take_all_along)
{
    for (const std::size_t count : {3u, 20u, 50u})
        for (const double degrees : {30.0, 70.0, 150.0})
        {
            SCOPED_TRACE(std::to_string(count) + " pins by " + std::to_string(degrees));
            const Motion motion = turn_about_the_middle(degrees, {1, 1, 0});
            expect_rigid(pins_text(some_samples(count, 2), motion), motion);
        }
}

TEST(Pins, that_shift_alone_shift_all)
{
    const Motion motion{Eigen::Matrix3d::Identity(), {0.5, -1.0, 2.0}};
    for (const std::size_t count : {1u, 2u, 20u})
        expect_rigid(pins_text(some_samples(count, 3), motion), motion);
}

TEST(Pins, that_move_with_a_handle_take_all_along)
{
    const Motion motion = turn_about_the_middle(70, {0, 0, 1});
    expect_rigid(pins_text(some_samples(12, 4), motion,
                           "handle end box 3.9 -1 -1 5 2 2\n",
                           "move end rotate 0 0 1 70 about 2 0.5 0.5\n"),
                 motion);
}

} // namespace cellwarp::core
