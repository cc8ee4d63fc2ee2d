// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/centres.h"

#include <gtest/gtest.h>

#include "solver/field/field.h"
#include "tests/support/held_cells.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::Built;
using support::cell_at;
using support::holding;

namespace
{

std::vector<Pose> at_rest(const Built& bar)
{
    std::vector<Pose> poses;
    for (const Cell& cell : bar.cells.cells)
        poses.push_back(carried(Motion(), cell.centre));
    return poses;
}

std::size_t num_centres(const Built& built, const std::vector<Pose>& poses,
                        const std::vector<Constraint>& constraints)
{
    return fit_field(FieldKind::RbfGlobal, built.cells, poses, constraints, {})
        .parts()
        .num_centres;
}

} // namespace

TEST(CentreChoice, prescribed_corners_are_centres_unless_motions_disagree)
{
    const Built bar = support::bar(2, 2, 4);
    std::vector<Constraint> constraints(bar.cells.size());
    std::vector<Pose> poses = at_rest(bar);
    // Of each cell its centroid; of each free one, all at the surface, a point there,
    // but not of the three next to a prescribed one, which has its corners and, on the
    // three sides where free cells meet it, four edges and a middle; three are shared.
    EXPECT_EQ(num_centres(bar, poses, constraints), 16u + 16u);
    constraints[cell_at(bar, {0.5, 0.5, 0.5})].hold = Hold::Prescribed;
    EXPECT_EQ(num_centres(bar, poses, constraints), 16u + 12u + 8u + 15u - 3u);
    constraints[cell_at(bar, {0.5, 0.5, 1.5})].hold = Hold::Prescribed;
    const std::size_t of_one_motion = num_centres(bar, poses, constraints);
    poses[cell_at(bar, {0.5, 0.5, 1.5})].p.x() += 0.1;
    EXPECT_EQ(num_centres(bar, poses, constraints), of_one_motion - 6u);
}

TEST(CentreChoice, leaves_out_what_different_motions_share_wherever_it_is_moved)
{
    const Built bar = support::bar(2, 1, 3);
    const std::size_t left = cell_at(bar, {0.5, 0.5, 0.5}),
                      right = cell_at(bar, {1.5, 0.5, 0.5});
    std::vector<Constraint> constraints = holding(bar, {left, right});
    constraints[left].insets[side_of(2, true)] = 0.3;
    std::vector<Pose> poses = at_rest(bar);
    const std::size_t of_one_motion = num_centres(bar, poses, constraints);
    poses[right].p.x() += 0.1;
    // Four corners, and of the border the middle of the side's edge between them.
    EXPECT_EQ(num_centres(bar, poses, constraints), of_one_motion - 5u);
}

} // namespace cellwarp::core
