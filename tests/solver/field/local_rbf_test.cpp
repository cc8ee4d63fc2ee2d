// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/local_rbf.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "octree/notches.h"
#include "solver/field/field.h"
#include "tests/support/bodies.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// The comb of tests/support, whose teeth lie in voxels that touch, in cells of a third.
struct Comb
{
    Material material = find_material(support::comb(), bounding_surface(support::comb()),
                                      grid_shape({4, 1, 1}, 12, 0, 0.0), Fill::Solid);
    Notches notches =
        find_notches(support::comb(), bounding_surface(support::comb()), material.grid);
    Octree octree = Octree(material.grid.shape(), material_test(material.grid));
    Pieces pieces = find_pieces(material.grid, octree, notches);
    Cells cells = build_cells(material.grid, octree, pieces, {}, {}, notches);

    /// The upper tooth turns up about its root by an angle [rad] that grows to its end.
    std::vector<Pose> opened(double angle) const
    {
        std::vector<Pose> poses;
        for (const Cell& cell : cells.cells)
        {
            const bool is_upper = cell.centre.y() > 0.5 && cell.centre.x() > 2.0;
            const Eigen::Matrix3d R = rotation_about(
                Vector3d::UnitZ(),
                is_upper ? angle * std::min(1.0, cell.centre.x() - 2.0) : 0.0);
            const Vector3d root(2.0, 0.5, 0.5);
            poses.push_back({R, root + R * (cell.centre - root)});
        }
        return poses;
    }
    Field field(FieldKind kind, double angle) const
    {
        return fit_field(kind, cells, opened(angle),
                         std::vector<Constraint>(cells.size()), {});
    }
    int cell_at(const Vector3d& x) const
    {
        return pieces.at(material.grid, material.grid.locate(x));
    }
};

bool has_blended(const Field& field)
{
    const std::vector<Membership>& all = field.parts().local->clusters().memberships;
    return std::ranges::any_of(all, [](const Membership& membership)
                               { return membership.cluster == LocalRbf::kBlended; });
}

} // namespace

TEST(LocalRbf, cells_on_both_sides_of_a_slit_are_pairs_that_nothing_glues)
{
    const Comb comb;
    const std::vector<std::array<int, 2>> pairs = unglued_pairs(comb.cells);
    EXPECT_GT(pairs.size(), 10u);
    for (const std::array<int, 2>& pair : pairs)
    {
        const Cell& a = comb.cells.cells[std::size_t(pair[0])];
        const Cell& b = comb.cells.cells[std::size_t(pair[1])];
        EXPECT_LT(pair[0], pair[1]);
        EXPECT_GT(std::min(a.centre.x(), b.centre.x()), 1.9);
        EXPECT_LT((a.centre.y() - 0.5) * (b.centre.y() - 0.5), 0.0);
    }
    EXPECT_TRUE(unglued_pairs(support::bar(3, 3, 6).cells).empty());
    EXPECT_TRUE(
        unglued_pairs(support::built_mixed(support::l_prism(), 8, 2, 1).cells).empty());
}

TEST(LocalRbf, gives_way_to_the_blend_where_a_notch_opens)
{
    const Comb comb;
    EXPECT_FALSE(has_blended(comb.field(FieldKind::Rbf, 0.0)));
    const Field rbf = comb.field(FieldKind::Rbf, 1.0);
    const Field blend = comb.field(FieldKind::Blend, 1.0);
    ASSERT_TRUE(has_blended(rbf));
    // Along both walls of the slit, from its root out.
    double largest = 0.0;
    for (const double y : {0.44, 0.56})
        for (double x = 2.005; x < 3.0; x += 0.011) // off the sides of cells
        {
            const Vector3d at(x, y, 0.37);
            const int own = comb.cell_at(at);
            const FieldValue value = rbf.value(at, own);
            largest = std::max(
                largest, (value.displacement - blend.value(at, own).displacement).norm());
            // The slopes are those of the displacements.
            const double h = 1e-6;
            for (int k = 0; k < 3; ++k)
            {
                const Vector3d step = h * Vector3d::Unit(k);
                const Vector3d slope = (rbf.value(at + step, own).displacement -
                                        rbf.value(at - step, own).displacement) /
                                       (2 * h);
                EXPECT_LT((slope - value.gradient.col(k)).norm(), 1e-5) << x;
            }
            // Both ways to ask give the same bits.
            const std::vector<Vector3d> one = {at};
            const std::vector<int> of = {own};
            EXPECT_EQ(rbf.displacements(one, of)[0], value.displacement);
        }
    EXPECT_LT(largest, 0.06);
    // Far from the slit it is an RBF as ever.
    for (const Membership& membership : rbf.parts().local->clusters().of_cell(0))
        EXPECT_NE(membership.cluster, LocalRbf::kBlended);
}

} // namespace cellwarp::core
