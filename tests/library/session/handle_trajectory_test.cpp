// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/handle_trajectory.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

Units plain_units()
{
    Units units;
    units.box = {{0, 0, 0}, {1, 1, 1}};
    return units;
}

std::vector<MoveStep> steps(const std::string& operations,
                            const Units& units = plain_units())
{
    const HandleFile file = parse_handles(
        "h", "cellwarp-handles 1\nhandle h all\nframe 1\nmove h " + operations + "\n");
    std::vector<std::string> warnings;
    return steps_of(file.stages[0].frames[0].moves[0], units,
                    {{0.5, 0.5, 0.5}, {0.25, 0.5, 0.5}, {0, 0, 0}}, "h", warnings);
}

constexpr double kDegree = std::numbers::pi / 180.0;

} // namespace

TEST(HandleTrajectory, operations_apply_in_the_order_written)
{
    const Motion motion = motion_of(steps("rotate 0 0 1 90 about 0 0 0 translate 1 0 0"));
    EXPECT_LT((motion({1, 0, 0}) - Eigen::Vector3d(1, 1, 0)).norm(), 1e-15);
    const Motion other = motion_of(steps("translate 1 0 0 rotate 0 0 1 90 about 0 0 0"));
    EXPECT_LT((other({1, 0, 0}) - Eigen::Vector3d(0, 2, 0)).norm(), 1e-15);
    // Without "about": the centre that is given, of the region's rest samples.
    EXPECT_LT((motion_of(steps("rotate 0 0 1 180"))({0.5, 0.5, 7}) -
               Eigen::Vector3d(0.5, 0.5, 7))
                  .norm(),
              1e-15);
}

TEST(HandleTrajectory, several_turns_are_wound)
{
    const HandleTrajectory path({}, steps("rotate 0 0 1 540 about 0 0 0"));
    EXPECT_EQ(path.num_parts({-1, -1, 0}, {1, 1, 0}, 1e9), 12);
    const Motion third = path.at(1.0 / 3.0); // 180 degrees
    EXPECT_LT((third({1, 0, 0}) - Eigen::Vector3d(-1, 0, 0)).norm(), 1e-12);
    EXPECT_LT((path.at(1.0)({1, 0, 0}) - Eigen::Vector3d(-1, 0, 0)).norm(), 1e-12);
    EXPECT_EQ(HandleTrajectory({}, steps("rotate 0 0 1 23040 about 0 0 0"))
                  .num_parts({0, 0, 0}, {0, 0, 0}, 1),
              64);
}

TEST(HandleTrajectory, the_same_operations_continue_from_the_last_frame)
{
    const HandleTrajectory path(steps("rotate 0 0 1 350 about 0 0 0"),
                                steps("rotate 0 0 1 370 about 0 0 0"));
    EXPECT_LT((path.at(0.5)({1, 0, 0}) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
    EXPECT_EQ(path.num_parts({0, 0, 0}, {0, 0, 0}, 1), 1);
}

TEST(HandleTrajectory, other_operations_go_along_one_screw)
{
    // A quarter turn about an axis through (1, 0): halfway is an eighth turn about it.
    const HandleTrajectory path(steps("translate 0 0 0"),
                                steps("rotate 0 0 1 90 about 1 0 0 translate 0 0 2"));
    const Motion half = path.at(0.5);
    EXPECT_LT((half({1, 0, 0}) - Eigen::Vector3d(1, 0, 1)).norm(), 1e-12);
    EXPECT_LT((half({2, 0, 0}) -
               Eigen::Vector3d(1 + std::cos(45 * kDegree), std::sin(45 * kDegree), 1))
                  .norm(),
              1e-12);
    EXPECT_LT((path.at(0.0)({2, 0, 0}) - Eigen::Vector3d(2, 0, 0)).norm(), 1e-12);
}

TEST(HandleTrajectory, parts_keep_to_45_degrees_and_a_quarter_diagonal)
{
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    EXPECT_EQ(HandleTrajectory({}, steps("rotate 0 0 1 45")).num_parts(zero, zero, 1e9),
              1);
    EXPECT_EQ(HandleTrajectory({}, steps("rotate 0 0 1 46")).num_parts(zero, zero, 1e9),
              2);
    EXPECT_EQ(HandleTrajectory({}, steps("translate 1 0 0")).num_parts(zero, zero, 1.0),
              4);
    EXPECT_EQ(
        HandleTrajectory({}, steps("translate 1000 0 0")).num_parts(zero, zero, 1.0), 64);
    EXPECT_EQ(HandleTrajectory({}, {}).num_parts(zero, zero, 1.0), 1);
}

TEST(HandleTrajectory, half_a_turn_by_matrix_is_deterministic)
{
    for (const double sign : {1.0, -1.0})
    {
        Units units = plain_units();
        const std::string matrix = sign > 0
                                       ? "matrix -1 0 0 0 0 -1 0 0 0 0 1 0 0 0 0 1"
                                       : "matrix -1 -0 0 0 -0 -1 0 0 0 0 1 0 0 0 0 1";
        const Motion half = HandleTrajectory({}, steps(matrix, units)).at(0.5);
        EXPECT_LT((half({1, 0, 0}) - Eigen::Vector3d(0, 1, 0)).norm(), 1e-9);
    }
}

TEST(HandleTrajectory, half_a_turn_by_matrix_can_go_the_other_way_round)
{
    const HandleTrajectory path({}, steps("matrix -1 0 0 0 0 -1 0 4 0 0 1 2 0 0 0 1"));
    ASSERT_TRUE(path.half_turn());
    const HandleTrajectory other = path.reversed();
    ASSERT_TRUE(other.half_turn());
    // About the axis through (0, 2), with half of the shift along it.
    EXPECT_LT((path.at(0.5)({1, 2, 0}) - Eigen::Vector3d(0, 3, 1)).norm(), 1e-12);
    EXPECT_LT((other.at(0.5)({1, 2, 0}) - Eigen::Vector3d(0, 1, 1)).norm(), 1e-12);
    EXPECT_EQ(path.at(1.0).R, other.at(1.0).R);
    EXPECT_EQ(path.at(1.0).t, other.at(1.0).t);
    EXPECT_LT((other.reversed().at(0.3).R - path.at(0.3).R).norm(), 1e-15);
    // An axis and an angle say which way, and so does any other angle.
    EXPECT_FALSE(HandleTrajectory({}, steps("rotate 0 0 1 180")).half_turn());
    EXPECT_FALSE(HandleTrajectory({}, steps("matrix 0 -1 0 0 1 0 0 0 0 0 1 0 0 0 0 1"))
                     .half_turn());
    // From other operations it is the way between the two that counts.
    EXPECT_TRUE(HandleTrajectory(steps("rotate 0 0 1 90"),
                                 steps("matrix 0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1"))
                    .half_turn());
}

TEST(HandleTrajectory, only_rigid_matrices_are_taken)
{
    const auto refused = [](const std::string& matrix)
    { return error_of(Fault::Malformed, [&] { steps("matrix " + matrix); }); };
    EXPECT_TRUE(contains(refused("-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"), "mirror"));
    EXPECT_TRUE(contains(refused("0 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"), "singular"));
    EXPECT_TRUE(contains(refused("1.1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"), "0.1"));
    EXPECT_TRUE(contains(refused("1 0.5 0 0 0 1 0 0 0 0 1 0 0 0 0 1"), "no rotation"));
    std::vector<std::string> warnings;
    const HandleFile file =
        parse_handles("h", "cellwarp-handles 1\nhandle h all\nframe 1\nmove h "
                           "matrix 1.00001 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n");
    const std::vector<MoveStep> nearly =
        steps_of(file.stages[0].frames[0].moves[0], plain_units(),
                 {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}}, "h", warnings);
    EXPECT_EQ(warnings.size(), 1u);
    EXPECT_LT((std::get<Motion>(nearly[0]).R - Eigen::Matrix3d::Identity()).norm(),
              1e-12);
}

TEST(HandleTrajectory, relative_units_are_the_box)
{
    Units units;
    units.is_relative = true;
    units.box = {{10, 20, 30}, {12, 24, 30}};
    EXPECT_EQ(units.point({0.5, 0.5, 0.5}), Eigen::Vector3d(11, 22, 30));
    EXPECT_EQ(units.vector({0.5, 0.5, 0.5}), Eigen::Vector3d(1, 2, 0));
    // A matrix moves relative coordinates: it turns about the box's lower corner.
    const Motion turn =
        motion_of(steps("matrix 0 -1 0 0.5  1 0 0 0  0 0 1 0  0 0 0 1", units));
    EXPECT_LT((turn({10, 20, 30}) - Eigen::Vector3d(11, 20, 30)).norm(), 1e-12);
}

TEST(HandleTrajectory, a_move_that_numbers_cannot_hold_names_its_line)
{
    Units units;
    units.is_relative = true;
    units.box = {{0, 0, 0}, {10, 10, 10}};
    for (const std::string move :
         {"translate 1e308 0 0", "rotate 0 0 1 9 about 0 1e308 0"})
        EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { steps(move, units); }),
                             "h:4: h: moves beyond what numbers can hold"))
            << move;
}

TEST(WorkFrame, is_an_exact_power_of_two)
{
    const ModelBox box{{-3, 100, 7}, {5, 103, 7.5}};
    const WorkFrame frame = automatic_frame(box);
    EXPECT_EQ(frame.exponent, -4);
    EXPECT_EQ(frame.to_work({5, 103, 7.5}), Eigen::Vector3d(0.5, 3.0 / 16, 0.5 / 16));
    EXPECT_EQ(frame.to_model(frame.to_work({1, 101, 7.25})),
              Eigen::Vector3d(1, 101, 7.25));
    for (const double scale : {1e-150, 1e-30, 1e30, 1e100})
    {
        const WorkFrame extreme = automatic_frame({box.low * scale, box.high * scale});
        EXPECT_GT(extreme.diagonal(), 0.5);
        EXPECT_LT(extreme.diagonal(), 2.0);
    }
}

TEST(WorkFrame, a_given_frame_must_be_a_rotation)
{
    FrameBox box;
    box.axes = {{{0, 1, 0}, {-1, 0, 0}, {0, 0, 1}}};
    box.size = {1, 1, 1};
    EXPECT_EQ(given_frame(box, "s").to_work({0, 1, 0}), Eigen::Vector3d(0.5, 0, 0));
    box.axes = {{{0, 1, 0}, {1, 0, 0}, {0, 0, 1}}};
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, [&] { given_frame(box, "s"); }), "axes"));
    box.axes = {{{1, 0, 0}, {0, 2, 0}, {0, 0, 1}}};
    error_of(Fault::Malformed, [&] { given_frame(box, "s"); });
}

} // namespace cellwarp::core
