// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/glue.h"

#include <cmath>
#include <set>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::random_pose;
using support::random_vector;
using Vector12 = Eigen::Matrix<double, 12, 1>;
using Matrix12 = Eigen::Matrix<double, 12, 12>;

namespace
{

/// Second moments of the face of two_cells(): 2 x 1.5.
constexpr double kLong = 4.0 / 12.0, kShort = 2.25 / 12.0;

/// Two boxes of different size that share a face.
Cells two_cells()
{
    Cells cells;
    cells.cells.resize(2);
    const Eigen::Vector3d sizes[2] = {{1, 2, 1.5}, {0.5, 2, 1.5}};
    cells.cells[0].centre = {0.5, 0, 0};
    cells.cells[1].centre = {1.25, 0, 0};
    for (std::size_t i = 0; i < 2; ++i)
    {
        cells.cells[i].volume = sizes[i].prod();
        cells.cells[i].second_moment = (sizes[i].cwiseAbs2() / 12.0).asDiagonal();
    }
    Face face;
    face.b = 1;
    face.area = 3.0;
    face.centre = {1, 0.1, 0};
    face.distance = 0.75;
    face.turning = Eigen::Vector3d(kShort, kShort, kLong).asDiagonal();
    cells.faces.push_back(face);
    return cells;
}

GlueFace one_face()
{
    return build_glue(two_cells(), {}).faces[0];
}

/// The same two boxes full of a thin sheet that lies askew in them.
GlueFace sheet_face()
{
    Cells cells = two_cells();
    const Eigen::Vector3d n = Eigen::Vector3d(0.3, -0.5, 0.8).normalized();
    cells.faces[0].turning =
        0.0025 / 12.0 * Eigen::Matrix3d::Identity() + 0.3 * n * n.transpose();
    cells.faces[0].sheet_share = 1.0;
    cells.cells[0].middle = {0.4, 0.1, 0.2};
    cells.cells[1].middle = {1.2, 0, 0.1};
    return build_glue(cells, {}).faces[0];
}

/// Rows and columns 0..5 belong to a, 6..11 to b.
Matrix12 glue_hessian(const GlueFace& face, const Pose& a, const Pose& b,
                      Curvature curvature)
{
    Matrix12 H;
    H.topLeftCorner<6, 6>() = glue_diagonal_a(face, a, b, curvature).matrix();
    H.bottomRightCorner<6, 6>() = glue_diagonal_b(face, a, b, curvature).matrix();
    H.topRightCorner<6, 6>() = glue_coupling(face, a, b).matrix();
    H.bottomLeftCorner<6, 6>() = H.topRightCorner<6, 6>().transpose();
    return H;
}

/// Two levels of splits in the middle of a block, corners of small cells included.
Cells cells_of_three_sizes()
{
    const Shape shape = support::box_shape({0, 0, 0}, {6, 6, 6});
    const GridShape grid = grid_shape({6, 6, 6}, 6, 2, 0.0);
    const Material material =
        find_material(shape, bounding_surface(shape), grid, Fill::Solid);
    const MaterialTest test = material_test(material.grid);
    Octree octree(grid, test);
    for (const int level : {0, 1})
    {
        std::vector<LeafNumber> inside;
        for (std::size_t i = 0; i < octree.leaves().size(); ++i)
        {
            const Eigen::Vector3i at = octree.leaves()[i].corner;
            if (octree.leaves()[i].level == level && at.minCoeff() >= 8 + 2 * level &&
                (at.array() < Eigen::Array3i(16, 14, 12)).all())
                inside.push_back(LeafNumber(i));
        }
        octree = octree.split(inside, test);
    }
    return build_cells(material.grid, octree, find_pieces(material.grid, octree));
}

/// What constant strain F = R U, agreeing with the cells in their anchors, leaves.
struct Unbalanced
{
    double force = 0.0, moment = 0.0; ///< left on a cell, over the largest of a face
    int num_cells = 0;
};
template <class Inside>
Unbalanced unbalanced(const Cells& cells, const Eigen::Matrix3d& U,
                      const Eigen::Matrix3d& R, Inside&& inside)
{
    const Glue glue = build_glue(cells, {});
    std::vector<Pose> poses;
    for (const Cell& cell : cells.cells)
        poses.push_back({R, R * (U * cell.anchor + cell.centre - cell.anchor)});
    std::vector<Twist> sums(cells.size(), Twist::Zero());
    double largest = 0.0;
    for (const GlueFace& face : glue.faces)
    {
        const std::size_t a = idx(face.a);
        const std::size_t b = idx(face.b);
        const Vector12 force = glue_gradient(face, poses[a], poses[b]);
        sums[a] += force.head<6>();
        sums[b] += force.tail<6>();
        largest = std::max(largest, force.norm());
    }
    Unbalanced left;
    for (std::size_t i = 0; i < cells.size(); ++i)
        if (inside(cells.cells[i]))
        {
            ++left.num_cells;
            left.moment = std::max(left.moment, sums[i].head<3>().norm() / largest);
            left.force = std::max(left.force, sums[i].tail<3>().norm() / largest);
        }
    return left;
}

Pose twisted(const Pose& pose, const Eigen::Matrix<double, 6, 1>& twist)
{
    return moved(pose, twist);
}

} // namespace

TEST(Glue, bending_of_a_face_counts_about_the_axes_in_its_sheet_alone)
{
    const Cells cells = two_cells();
    constexpr double kBending = 0.37;
    // It turns hardest about z.
    const GlueFace plain = one_face();
    const GlueFace bent = build_glue(cells, {}, {}, {}, std::vector{kBending}).faces[0];
    const Pose a{Eigen::Matrix3d::Identity(), cells.cells[0].centre};
    const Pose b{Eigen::Matrix3d::Identity(), cells.cells[1].centre};
    std::mt19937 rng(11);
    for (int i = 0; i < 20; ++i)
    {
        const Eigen::Vector3d axis = random_vector(rng, 1.0).normalized();
        const double angle = 0.1 + 0.1 * i;
        Pose turned = b;
        turned.R = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
        EXPECT_NEAR(glue_energy(bent, a, turned) - glue_energy(plain, a, turned),
                    plain.stiffness * 4.0 * std::pow(std::sin(angle / 2), 2) * kBending *
                        (1.0 - axis.z() * axis.z()),
                    1e-12);
        Pose moved = b;
        moved.p += random_vector(rng, 1.0);
        EXPECT_NEAR(glue_energy(bent, a, moved), glue_energy(plain, a, moved), 1e-12);
    }
}

TEST(Glue, is_zero_for_a_common_rigid_motion_and_only_then)
{
    std::mt19937 rng(1);
    const Cells cells = two_cells();
    const GlueFace face = one_face();
    for (int trial = 0; trial < 20; ++trial)
    {
        const Motion motion{support::random_rotation(rng), random_vector(rng, 2.0)};
        const Pose a = carried(motion, cells.cells[0].centre);
        const Pose b = carried(motion, cells.cells[1].centre);
        EXPECT_LT(glue_energy(face, a, b), 1e-26);
        EXPECT_LT(glue_gradient(face, a, b).norm(), 1e-12);
        Twist turn = Twist::Zero();
        turn.head<3>() = 0.1 * random_vector(rng, 1.0);
        EXPECT_GT(glue_energy(face, moved(a, turn), b), 1e-6);
    }
}

TEST(Glue, is_the_gap_and_what_the_turn_opens_by_any_angle)
{
    std::mt19937 rng(2);
    for (const GlueFace& face : {one_face(), sheet_face()})
        for (int trial = 0; trial < 20; ++trial)
        {
            const Pose a = random_pose(rng, 1.0);
            const Eigen::Vector3d axis = random_vector(rng, 1.0).normalized();
            const double angle = support::random_number(rng, -3.0, 3.0);
            const Eigen::Vector3d gap = random_vector(rng, 1.0);
            // b is turned about an axis that stands in a, about the place, and shifted.
            Pose b{a.R * rotation_about(axis, angle), a.p + a.R * face.reach_a + gap};
            b.p -= b.R * face.reach_b;
            const Eigen::Matrix3d M =
                face.moment.trace() * Eigen::Matrix3d::Identity() - face.moment;
            const double wanted =
                4.0 * (gap.squaredNorm() +
                       4.0 * std::pow(std::sin(0.5 * angle), 2) * axis.dot(M * axis));
            EXPECT_NEAR(glue_energy(face, a, b), wanted, 1e-12 * wanted);
        }
}

TEST(Glue, turns_as_its_cross_section_says)
{
    const GlueFace face = one_face();
    const Eigen::Matrix3d M =
        face.moment.trace() * Eigen::Matrix3d::Identity() - face.moment;
    EXPECT_LT((M - two_cells().faces[0].turning).norm(), 1e-15);
}

TEST(Glue, is_no_hinge_however_small_its_cross_section)
{
    Cells cells = two_cells();
    cells.faces[0].turning.setZero();
    const GlueFace face = build_glue(cells, {}).faces[0];
    const Pose a{Eigen::Matrix3d::Identity(), cells.cells[0].centre};
    const Pose b{Eigen::Matrix3d::Identity(), cells.cells[1].centre};
    const Eigen::SelfAdjointEigenSolver<Matrix12> eigen(glue_hessian(face, a, b, kExact));
    EXPECT_LT(eigen.eigenvalues()[5], 1e-12);
    EXPECT_GT(eigen.eigenvalues()[6], 1e-6);
}

TEST(Glue, of_a_sheet_acts_half_way_between_what_the_cells_have_of_it)
{
    const Cells cells = two_cells();
    const GlueFace face = sheet_face();
    EXPECT_LT(
        (cells.cells[0].centre + face.reach_a - Eigen::Vector3d(0.8, 0.05, 0.15)).norm(),
        1e-15);
    EXPECT_LT(
        (cells.cells[1].centre + face.reach_b - Eigen::Vector3d(0.8, 0.05, 0.15)).norm(),
        1e-15);
}

TEST(Glue, of_a_pure_shift_is_weight_times_its_square)
{
    const Cells cells = two_cells();
    const Pose a{Eigen::Matrix3d::Identity(), cells.cells[0].centre};
    Pose b{Eigen::Matrix3d::Identity(), cells.cells[1].centre};
    b.p += Eigen::Vector3d(0.3, 0, 0.4);
    EXPECT_NEAR(glue_energy(one_face(), a, b), 4.0 * 0.25, 1e-14);
}

TEST(Glue, gradient_and_hessian_match_finite_differences)
{
    std::mt19937 rng(3);
    for (int trial = 0; trial < 20; ++trial)
    {
        SCOPED_TRACE(trial);
        const GlueFace face = trial % 2 ? sheet_face() : one_face();
        const Pose a = random_pose(rng, 1.0), b = random_pose(rng, 1.0);
        const auto energy = [&](const Vector12& t)
        { return glue_energy(face, twisted(a, t.head<6>()), twisted(b, t.tail<6>())); };
        const Vector12 gradient = glue_gradient(face, a, b);
        const Matrix12 hessian = glue_hessian(face, a, b, kExact);
        ASSERT_GT(gradient.norm(), 1e-3);
        const double h = 1e-4;
        for (int i = 0; i < 12; ++i)
        {
            const Vector12 ei = h * Vector12::Unit(i);
            const double slope = (energy(ei) - energy(-ei)) / (2 * h);
            EXPECT_NEAR(gradient[i], slope, 1e-6 * gradient.norm());
            for (int j = 0; j <= i; ++j)
            {
                const Vector12 ej = h * Vector12::Unit(j);
                // A projected twist is a second-order path for each cell's own
                // rotation, so that mixed differences give the Hessian.
                const double second = (energy(ei + ej) - energy(ei - ej) -
                                       energy(ej - ei) + energy(-ei - ej)) /
                                      (4 * h * h);
                EXPECT_NEAR(hessian(i, j), second, 1e-5 * hessian.norm());
            }
        }
        EXPECT_LT((hessian - hessian.transpose()).norm(), 1e-12);
    }
}

TEST(Glue, gauss_newton_block_is_semi_definite_with_the_rigid_null_space)
{
    std::mt19937 rng(4);
    const GlueFace face = one_face();
    for (int trial = 0; trial < 40; ++trial)
    {
        const GlueFace either = trial % 2 ? sheet_face() : face;
        const Pose a = random_pose(rng, 1.0), b = random_pose(rng, 1.0);
        const Matrix12 H = glue_hessian(either, a, b, kGaussNewton);
        const Eigen::SelfAdjointEigenSolver<Matrix12> eigen(H);
        EXPECT_GT(eigen.eigenvalues()[0], -1e-12 * eigen.eigenvalues()[11]);
    }
    const Cells cells = two_cells();
    const Pose a{Eigen::Matrix3d::Identity(), cells.cells[0].centre};
    const Pose b{Eigen::Matrix3d::Identity(), cells.cells[1].centre};
    const Matrix12 H = glue_hessian(face, a, b, kGaussNewton);
    const Eigen::SelfAdjointEigenSolver<Matrix12> eigen(H);
    EXPECT_LT(eigen.eigenvalues()[5], 1e-12);
    EXPECT_GT(eigen.eigenvalues()[6], 1e-3);
    for (int k = 0; k < 3; ++k)
    {
        // Translation, and rotation about the origin: v = omega x c.
        Vector12 shift = Vector12::Zero(), turn = Vector12::Zero();
        shift[3 + k] = shift[9 + k] = 1.0;
        const Eigen::Vector3d omega = Eigen::Vector3d::Unit(k);
        turn.segment<3>(0) = turn.segment<3>(6) = omega;
        turn.segment<3>(3) = cross_matrix(omega) * a.p;
        turn.segment<3>(9) = cross_matrix(omega) * b.p;
        EXPECT_LT((H * shift).norm(), 1e-12);
        EXPECT_LT((H * turn).norm(), 1e-12);
    }
}

TEST(Glue, at_rest_exact_and_gauss_newton_agree)
{
    const Cells cells = two_cells();
    const Pose a{Eigen::Matrix3d::Identity(), cells.cells[0].centre};
    const Pose b{Eigen::Matrix3d::Identity(), cells.cells[1].centre};
    for (const GlueFace& face : {one_face(), sheet_face()})
        EXPECT_LT(
            (glue_hessian(face, a, b, kExact) - glue_hessian(face, a, b, kGaussNewton))
                .norm(),
            1e-12);
}

TEST(Glue, is_as_stiff_as_the_geometric_mean_of_its_cells)
{
    const Cells cells = two_cells();
    const double plain = build_glue(cells, {}).faces[0].stiffness;
    EXPECT_EQ(build_glue(cells, std::vector<double>{20, 20}).faces[0].stiffness,
              20 * plain);
    // Without a jump where a factor goes through 1.
    for (const double soft : {0.9999, 1.0, 1.0001})
        EXPECT_NEAR(build_glue(cells, std::vector<double>{soft, 1e8}).faces[0].stiffness,
                    1e4 * std::sqrt(soft) * plain, 1e-6 * plain);
    EXPECT_NEAR(build_glue(cells, std::vector<double>{4, 9}).faces[0].stiffness,
                6 * plain, 1e-12);
}

TEST(Glue, stretches_over_the_length_that_is_given)
{
    const Cells cells = two_cells();
    const double plain = build_glue(cells, {}).faces[0].stiffness;
    EXPECT_NEAR(
        build_glue(cells, {}, std::vector<BorderGlue>{{0, 0.25}}).faces[0].stiffness,
        3 * plain, 1e-12);
}

TEST(Glue, balances_cells_that_the_surface_cuts_under_constant_strain)
{
    const support::Built bar =
        support::built(support::box_shape({0, 0, 0}, {4, 1.3, 0.9}), 8, 0);
    Eigen::Matrix3d stretch = Eigen::Matrix3d::Identity(); // no traction on the sides
    stretch(0, 0) = 1.2;
    std::mt19937 rng(7);
    const Unbalanced left =
        unbalanced(bar.cells, stretch, support::random_rotation(rng),
                   [](const Cell& cell)
                   { return cell.box_centre.x() > 0.5 && cell.box_centre.x() < 3.5; });
    EXPECT_GT(left.num_cells, 20);
    EXPECT_LT(left.force, 1e-12);
    EXPECT_LT(left.moment, 1e-12);
}

TEST(Glue, balances_cells_of_different_sizes_under_constant_strain)
{
    const Cells cells = cells_of_three_sizes();
    std::mt19937 rng(8);
    const Eigen::Matrix3d R = support::random_rotation(rng);
    const auto is_inside = [](const Cell& cell)
    { return cell.box_centre.minCoeff() > 1.1 && cell.box_centre.maxCoeff() < 4.9; };
    std::set<double> sizes;
    for (const Cell& cell : cells.cells)
        sizes.insert(cell.edge);
    EXPECT_EQ(sizes.size(), 3u);
    Eigen::Matrix3d stretch = Eigen::Vector3d(1.2, 0.9, 1.1).asDiagonal();
    const Unbalanced stretched = unbalanced(cells, stretch, R, is_inside);
    EXPECT_GT(stretched.num_cells, 100);
    EXPECT_LT(stretched.force, 1e-12);
    EXPECT_LT(stretched.moment, 1e-12);
    stretch << 1.2, 0.1, -0.05, 0.1, 0.9, 0.2, -0.05, 0.2, 1.1;
    const Unbalanced sheared = unbalanced(cells, stretch, R, is_inside);
    EXPECT_LT(sheared.force, 1e-12);
    EXPECT_LT(sheared.moment, 0.06); // the force is 0.19 where nothing is taken over
}

TEST(Glue, of_a_stiff_body_is_a_multiple_of_a_plain_ones_also_between_sizes)
{
    const Cells cells = cells_of_three_sizes();
    const Glue plain = build_glue(cells, {});
    const Glue stiff = build_glue(cells, std::vector<double>(cells.size(), 1e3));
    for (std::size_t f = 0; f < plain.faces.size(); ++f)
    {
        EXPECT_NEAR(stiff.faces[f].stiffness, 1e3 * plain.faces[f].stiffness,
                    1e-9 * stiff.faces[f].stiffness);
        EXPECT_LT((stiff.faces[f].reach_a - plain.faces[f].reach_a).norm(), 1e-12);
    }
}

TEST(Glue, a_stiff_neighbour_of_another_size_moves_no_face_beyond_its_cells)
{
    const Cells cells = cells_of_three_sizes();
    for (const double factor : {20.0, 1e10})
    {
        std::vector<double> factors;
        for (const Cell& cell : cells.cells)
            factors.push_back(cell.edge > 0.9 ? factor : 1.0);
        const Glue glue = build_glue(cells, factors);
        for (std::size_t f = 0; f < cells.faces.size(); ++f)
        {
            const Cell& a = cells.cells[idx(cells.faces[f].a)];
            const Cell& b = cells.cells[idx(cells.faces[f].b)];
            const Eigen::Vector3d moved =
                a.centre + glue.faces[f].reach_a - cells.faces[f].centre;
            EXPECT_LT(moved.norm(), 1.7 * std::min(a.edge, b.edge));
            EXPECT_GT(glue.faces[f].stiffness, 0.0);
        }
    }
}

TEST(Glue, energy_of_a_stretched_bar_converges_to_the_continuum)
{
    // Uniform stretch by e along the axis: the limit is int |grad phi - R|^2 = e^2 V,
    // reached by every mesh of equal cubes but for the missing half pair at each end.
    double last = 0.0;
    for (const int n : {4, 8, 16})
    {
        const support::Built bar =
            support::built(support::box_shape({0, 0, 0}, {4, 1, 1}), 4 * n / 4 * 4, 0);
        const Glue glue = build_glue(bar.cells, {});
        std::vector<Pose> poses;
        for (const Cell& cell : bar.cells.cells)
        {
            poses.push_back({Eigen::Matrix3d::Identity(), cell.centre});
            poses.back().p.x() *= 1.1;
        }
        last = glue_energy(glue, poses) / (0.01 * 4.0);
        EXPECT_NEAR(last, 1.0, 1.5 / n);
    }
    EXPECT_NEAR(last, 1.0, 0.05);
}

} // namespace cellwarp::core
