// SPDX-License-Identifier: GPL-3.0-or-later
// The paper's own method, part by part.
#include "solver/cells/departures.h"

#include <cmath>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "solver/cells/glue.h"
#include "solver/cells/refinement.h"
#include "solver/field/field.h"
#include "tests/support/energy_checks.h"
#include "tests/support/held_body.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::random_pose;

namespace
{

Departures without(bool Departures::*departure)
{
    Departures departures;
    departures.*departure = false;
    return departures;
}

/// int over the box of |T_a - T_b|^2, by two Gauss points an axis: exact for affine maps.
double integral(const Cell& over, const Cell& cell_a, const Pose& a, const Cell& cell_b,
                const Pose& b)
{
    double sum = 0.0;
    for (int k = 0; k < 8; ++k)
    {
        const Eigen::Vector3d x =
            over.centre +
            over.edge / (2.0 * std::sqrt(3.0)) *
                Eigen::Vector3d(k & 1 ? 1 : -1, k & 2 ? 1 : -1, k & 4 ? 1 : -1);
        sum += over.volume / 8.0 *
               (image(a, cell_a.centre, x) - image(b, cell_b.centre, x)).squaredNorm();
    }
    return sum;
}

} // namespace

TEST(Departures, without_glue_in_the_face_it_is_the_papers_integral_over_both_cells)
{
    const Cells cells = support::bar(2, 2, 3).cells;
    const Glue glue = build_glue(cells, {}, {}, without(&Departures::glue_in_face));
    std::mt19937 rng(4);
    for (std::size_t f = 0; f < cells.faces.size(); ++f)
    {
        SCOPED_TRACE(f);
        const Face& face = cells.faces[f];
        const Cell& a = cells.cells[idx(face.a)];
        const Cell& b = cells.cells[idx(face.b)];
        const Pose pose_a = random_pose(rng, 2.0), pose_b = random_pose(rng, 2.0);
        const double expected =
            face.area / face.distance / (a.volume + b.volume) *
            (integral(a, a, pose_a, b, pose_b) + integral(b, a, pose_a, b, pose_b));
        EXPECT_NEAR(glue_energy(glue.faces[f], pose_a, pose_b), expected,
                    1e-12 * expected);
    }
}

TEST(Departures, the_papers_glue_has_the_derivatives_of_its_energy)
{
    const Cells cells = support::bar(1, 1, 2).cells;
    const Glue glue = build_glue(cells, {}, {}, kBotsch07);
    const GlueFace& face = glue.faces.at(0);
    std::mt19937 rng(5);
    for (int trial = 0; trial < 10; ++trial)
    {
        SCOPED_TRACE(trial);
        const Pose a = random_pose(rng, 1.0), b = random_pose(rng, 1.0);
        const Eigen::Matrix<double, 12, 1> gradient = glue_gradient(face, a, b);
        constexpr double kStep = 1e-5;
        for (int k = 0; k < 12; ++k)
        {
            double ends[2];
            for (const int side : {0, 1})
            {
                Eigen::Matrix<double, 12, 1> t = Eigen::Matrix<double, 12, 1>::Zero();
                t[k] = side ? kStep : -kStep;
                // Of first order both ways to step are one.
                ends[side] = glue_energy(face, shape_matched(a, t.head<6>()),
                                         shape_matched(b, t.tail<6>()));
            }
            EXPECT_NEAR(gradient[k], (ends[1] - ends[0]) / (2 * kStep),
                        1e-7 * (1.0 + gradient.norm()));
        }
    }
}

TEST(Departures, a_shape_matched_step_turns_as_a_rigid_one_and_shifts_by_v)
{
    std::mt19937 rng(6);
    const Pose pose = random_pose(rng, 1.0);
    Twist twist;
    twist << 0.4, -0.3, 0.2, 1.0, 2.0, 3.0;
    const Pose matched = shape_matched(pose, twist);
    EXPECT_EQ(matched.R, moved(pose, twist).R);
    EXPECT_EQ(matched.p, pose.p + twist.tail<3>());
    EXPECT_GT((moved(pose, twist).p - matched.p).norm(), 0.1);
}

TEST(Departures, pair_gaps_are_the_roots_of_the_mean_squared_distance)
{
    const Cells cells = support::bar(1, 1, 3).cells;
    const Glue glue = build_glue(cells, {}, {}, kBotsch07);
    std::vector<Pose> poses;
    for (const Cell& cell : cells.cells)
        poses.push_back({Eigen::Matrix3d::Identity(), cell.centre});
    // The last cell is shifted as a whole: the distance is the shift everywhere.
    std::size_t last = 0;
    for (std::size_t c = 0; c < cells.size(); ++c)
        if (cells.cells[c].centre.z() > cells.cells[last].centre.z())
            last = c;
    poses[last].p += Eigen::Vector3d(0.3, 0.0, 0.4);
    const std::vector<double> gaps = pair_gaps(cells, glue, poses);
    int num_open = 0;
    for (const double gap : gaps)
    {
        num_open += gap > 0;
        EXPECT_TRUE(gap == 0.0 || std::abs(gap - 0.5) < 1e-12);
    }
    EXPECT_EQ(num_open, 2);
}

TEST(Departures, the_papers_field_goes_through_the_centres_and_nothing_else)
{
    const support::Built bar = support::bar(2, 2, 4);
    const std::vector<Constraint> constraints(bar.cells.size());
    std::vector<Pose> poses;
    for (const Cell& cell : bar.cells.cells)
        poses.push_back(
            {Eigen::Matrix3d::Identity(),
             cell.centre + Eigen::Vector3d(0.1 * cell.centre.z() * cell.centre.z(),
                                           std::sin(cell.centre.x()), 0.0)});
    const Field field =
        fit_field(FieldKind::RbfCentres, bar.cells, poses, constraints, {});
    EXPECT_EQ(field.parts().num_centres, bar.cells.size());
    for (std::size_t c = 0; c < bar.cells.size(); ++c)
    {
        const Eigen::Vector3d& x = bar.cells.cells[c].anchor;
        EXPECT_LT((field.value(x, static_cast<int>(c)).displacement -
                   (poses[c].p - bar.cells.cells[c].centre))
                      .norm(),
                  1e-9);
    }
}

} // namespace cellwarp::core
