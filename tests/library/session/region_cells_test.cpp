// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/region_cells.h"

#include <cmath>

#include <gtest/gtest.h>

#include "library/session/cell_system.h"
#include "octree/base/index.h"
#include "tests/support/rest_model.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

/// In cells of a quarter, ten voxels each.
CellSettings quarters()
{
    CellSettings cells;
    cells.across = 16;
    cells.gap = std::sqrt(6.0) * 0.025 / std::sqrt(18.0);
    return cells;
}

/// A bar of 1 x 1 x 4.
struct Bar : support::RestModel
{
    std::shared_ptr<const Body> body;

    explicit Bar(const std::string& statements)
        : RestModel(support::box_shape({0, 0, 0}, {1, 1, 4}, 8), statements, quarters()),
          body(std::make_shared<const Body>(build_body(rest, settings)))
    {
    }
    /// Of the faces at the regions' borders, in edges of a cell.
    std::vector<double> border_lengths() const
    {
        const std::vector<int> owner =
            prescribing_regions(*regions, regions->shares(*body), body->cells);
        std::vector<double> lengths;
        for (const BorderGlue& border : border_glue(*body, *regions, owner))
        {
            const Face& face = body->cells.faces[idx(border.face)];
            EXPECT_NE(owner[idx(face.a)] >= 0, owner[idx(face.b)] >= 0);
            lengths.push_back(border.length / body->cells.cells[0].edge);
        }
        return lengths;
    }
};

} // namespace

TEST(RegionCells, glue_at_a_border_begins_where_the_region_ends)
{
    // Where the foot ends, and how far that is from the middle of the first free cell.
    const std::pair<double, double> cases[] = {
        {0.250, 0.5}, // between cells
        {0.200, 0.7}, // within the last cell of the foot
        {0.325, 0.2}, // within the first free cell
        {0.350, 0.1}  // nearly at its middle
    };
    for (const auto& [end, wanted] : cases)
    {
        SCOPED_TRACE(end);
        const Bar bar("fixed foot box -1 -1 -1 2 2 " + std::to_string(end + 1e-6) + "\n");
        const std::vector<double> lengths = bar.border_lengths();
        ASSERT_EQ(lengths.size(), 16u);
        for (const double length : lengths)
            EXPECT_NEAR(length, wanted, 1e-9);
    }
}

TEST(RegionCells, glue_at_a_pin_of_one_place_is_as_elsewhere)
{
    EXPECT_TRUE(Bar("pin corner sphere 1 1 4 0.01\n").border_lengths().empty());
}

TEST(RegionCells, glue_at_a_pin_of_several_places_begins_where_it_ends)
{
    for (const char* role : {"pin", "handle"})
        EXPECT_EQ(
            Bar(std::string(role) + " foot box -1 -1 -1 2 2 0.200001\n").border_lengths(),
            Bar("fixed foot box -1 -1 -1 2 2 0.200001\n").border_lengths());
}

TEST(RegionCells, a_cell_knows_how_far_within_it_its_region_ends)
{
    // Beyond the cell's side it is as if the region ended there.
    const std::pair<double, double> cases[] = {{0.250, 0.0}, {0.200, 0.2}, {0.325, 0.0}};
    for (const auto& [end, wanted] : cases)
        for (const char* role : {"fixed", "pin", "handle"})
        {
            SCOPED_TRACE(::testing::Message() << role << " " << end);
            const Bar bar(std::string(role) + " foot box -1 -1 -1 2 2 " +
                          std::to_string(end + 1e-6) + "\n");
            const CellSystem system(bar.body, bar.regions, {});
            const double edge = bar.body->cells.cells[0].edge;
            int held = 0;
            for (const Constraint& constraint : system.constraints())
            {
                held += constraint.is_of_rigid_region();
                for (std::size_t side = 0; side < 6; ++side)
                {
                    const bool is_border =
                        constraint.is_of_rigid_region() && side == side_of(2, true);
                    EXPECT_NEAR(constraint.insets[side] / edge, is_border ? wanted : 0.0,
                                1e-9);
                }
            }
            EXPECT_EQ(held, 16);
        }
}

TEST(RegionCells, a_bar_pulled_by_regions_that_end_inside_cells_stretches_evenly_between)
{
    const double foot = 0.3, head = 3.8;
    const Bar bar("fixed foot box -1 -1 -1 2 2 0.300001\n"
                  "handle head box -1 -1 3.799999 2 2 5\n");
    CellSystem system(bar.body, bar.regions, {});
    Motion pull;
    const double scale = system.rest().frame.diagonal() / std::sqrt(18.0);
    pull.t.z() = 0.7 * scale;
    system.move_regions(std::vector<Motion>{{}, pull});
    system.carry_others();
    SolveOptions tight;
    tight.gradient_tolerance = 1e-12;
    ASSERT_EQ(system.solve(tight).stop, Stop::Converged);
    for (std::size_t c = 0; c < system.poses().size(); ++c)
    {
        if (system.region_of_cell()[c] >= 0)
            continue;
        const Cell& cell = bar.body->cells.cells[c];
        const double wanted =
            pull.t.z() * (cell.anchor.z() / scale - foot) / (head - foot);
        EXPECT_NEAR(system.poses()[c].p.z() - cell.centre.z(), wanted, 1e-9 * scale);
        EXPECT_LT((system.poses()[c].R - Eigen::Matrix3d::Identity()).norm(), 1e-9);
    }
    // The release field stretches up to where the head ends, a fifth of the way into its
    // cells, but begins smoothly there: it is half as far from the truth as one that is
    // rigid up to the side of the cells (0.014 of the pull).
    const Field field = fit_field(FieldKind::Rbf, bar.body->cells, system.poses(),
                                  system.constraints(), {});
    const VoxelGrid& grid = system.rest().material.grid;
    for (const double z : {3.0, 3.4, 3.6, 3.7, 3.76, 3.8})
    {
        const Eigen::Vector3d x = system.rest().frame.to_work({0.5, 0.5, z});
        const Eigen::Vector3d wanted(0, 0, pull.t.z() * (z - foot) / (head - foot));
        const int own = bar.body->pieces.at(grid, grid.locate(x));
        EXPECT_LT((field.value(x, own).displacement - wanted).norm(), 0.008 * pull.t.z())
            << z;
    }
}

} // namespace cellwarp::core
