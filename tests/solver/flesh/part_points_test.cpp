// SPDX-License-Identifier: GPL-3.0-or-later
// known-answers 8: the cantilever and the beams of MacNeal and Harder.
#include "solver/flesh/part_points.h"

#include <array>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SparseCholesky>
#include <gtest/gtest.h>

#include "tests/support/flesh.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;

/// Solves for the displacements of the nodes that are not held, by one sparse factor.
VectorXd solved(const Lattice& lattice, const FleshMaterial& material, bool has_modes,
                const std::function<bool(const Vector3d&)>& is_held, const VectorXd& load,
                const VectorXd& held_at)
{
    std::vector<Eigen::Triplet<double>> entries;
    VectorXd b = load;
    const auto held = [&](int node) { return is_held(lattice.places[idx(node)]); };
    for (const LatticePart& part : lattice.parts)
    {
        const PartMatrix K = stiffness_of(points_of(lattice, part), material, has_modes);
        const CornerNodes& nodes = lattice.cells[idx(part.cell)];
        for (int r = 0; r < 24; ++r)
            for (int c = 0; c < 24; ++c)
            {
                const int row = nodes[idx(r / 3)], column = nodes[idx(c / 3)];
                if (held(row))
                    continue;
                if (held(column))
                    b[3 * row + r % 3] -= K(r, c) * held_at[3 * column + c % 3];
                else
                    entries.emplace_back(3 * row + r % 3, 3 * column + c % 3, K(r, c));
            }
    }
    for (int n = 0; n < static_cast<int>(lattice.places.size()); ++n)
        if (held(n))
            for (int c = 0; c < 3; ++c)
            {
                entries.emplace_back(3 * n + c, 3 * n + c, 1.0);
                b[3 * n + c] = held_at[3 * n + c];
            }
    Eigen::SparseMatrix<double> A(load.size(), load.size());
    A.setFromTriplets(entries.begin(), entries.end());
    return Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(A).solve(b);
}

double tip(int across, double poisson, bool has_modes)
{
    const Lattice lattice = support::bar_lattice(across);
    const VectorXd load = support::load_on_end(lattice, 10.0, {0, 0, 1});
    return load.dot(solved(
        lattice, {1.0, poisson, 1.0}, has_modes,
        [](const Vector3d& x) { return x.x() < 1e-9; }, load,
        VectorXd::Zero(load.size())));
}

} // namespace

TEST(PartPoints, plain_cells_give_the_known_tips_of_a_cantilever)
{
    const std::array<double, 4> poisson = {0.0, 0.3, 0.45, 0.499};
    const std::array<std::array<double, 4>, 3> tips = {
        {{2680.000, 2591.190, 2071.670, 948.272},
         {3573.333, 3503.158, 3056.976, 1705.071},
         {3900.808, 3859.437, 3640.888, 2369.481}}};
    for (int row = 0; row < 3; ++row)
        for (std::size_t k = 0; k < 4; ++k)
            EXPECT_NEAR(tip(1 << row, poisson[k], false), tips[idx(row)][k], 6e-4);
}

TEST(PartPoints, modes_give_the_known_tips_of_a_cantilever)
{
    const std::array<double, 4> poisson = {0.0, 0.3, 0.45, 0.499};
    const std::array<std::array<double, 4>, 3> tips = {
        {{4010.000, 3972.639, 3880.111, 3372.636},
         {4017.500, 3977.258, 3891.963, 3661.574},
         {4022.177, 3992.435, 3937.183, 3875.030}}};
    for (int row = 0; row < 3; ++row)
        for (std::size_t k = 0; k < 4; ++k)
            EXPECT_NEAR(tip(1 << row, poisson[k], true), tips[idx(row)][k], 6e-4);
}

TEST(PartPoints, thin_bricks_bend_as_the_beam_of_macneal_and_harder)
{
    const Lattice lattice =
        support::grid_lattice({{{0, 1, 2, 3, 4, 5, 6}, {0, 0.2}, {0, 0.1}}});
    const FleshMaterial material{1e7, 0.3, 1.0};
    const std::array<double, 3> theory = {3e-5, 0.1081, 0.4321};
    const std::array<double, 3> plain = {.9856, .0929, .0252},
                                modes = {.9876, .9782, .9729};
    for (int axis = 0; axis < 3; ++axis)
        for (const bool has_modes : {false, true})
        {
            const VectorXd load =
                support::load_on_end(lattice, 6.0, Vector3d::Unit(axis));
            const double u = load.dot(solved(
                lattice, material, has_modes,
                [](const Vector3d& x) { return x.x() < 1e-9; }, load,
                VectorXd::Zero(load.size())));
            EXPECT_NEAR(u / theory[idx(axis)], (has_modes ? modes : plain)[idx(axis)],
                        6e-5)
                << axis << has_modes;
        }
}

TEST(PartPoints, a_distorted_cube_passes_the_patch_test)
{
    const std::array<Vector3d, 8> inner = {
        Vector3d{.249, .342, .192}, {.826, .288, .288}, {.273, .750, .230},
        {.850, .649, .263},         {.320, .186, .643}, {.677, .305, .683},
        {.165, .745, .702},         {.788, .693, .644}};
    std::vector<Vector3d> places;
    for (int k = 0; k < 8; ++k)
        places.emplace_back(k & 1, k >> 1 & 1, k >> 2 & 1);
    places.insert(places.end(), inner.begin(), inner.end());
    std::vector<CornerNodes> cells = {{8, 9, 10, 11, 12, 13, 14, 15}};
    for (int axis = 0; axis < 3; ++axis)
        for (int side = 0; side < 2; ++side)
        {
            // The cell between a side of the cube and the same side of the inner one.
            CornerNodes& cell = cells.emplace_back();
            for (int k = 0; k < 8; ++k)
            {
                const bool is_far = k >> axis & 1;
                const int corner = (k & ~(1 << axis)) | side << axis;
                cell[idx(k)] = is_far == (side == 1) ? corner : corner + 8;
            }
        }
    const std::vector<int> material(cells.size(), 0);
    const Lattice lattice = drawn_lattice(places, cells, material);
    Eigen::Matrix3d G;
    G << 2, 1, 1, 1, 2, 1, 1, 1, 2;
    G *= 0.5e-3;
    const VectorXd exact =
        support::field_of(lattice, [&](const Vector3d& x) -> Vector3d { return G * x; });
    for (const bool has_modes : {false, true})
    {
        const VectorXd u = solved(
            lattice, {1e6, 0.25, 1.0}, has_modes,
            [](const Vector3d& x)
            { return ((x.array() == 0.0) || (x.array() == 1.0)).any(); },
            VectorXd::Zero(exact.size()), exact);
        EXPECT_LT((u - exact).cwiseAbs().maxCoeff(), 1e-15);
    }
}

TEST(PartPoints, have_the_mass_the_centre_and_the_inertia_of_what_they_stand_for)
{
    const support::Built body = support::built(support::l_prism(), 7, 1);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 0.5);
    bool is_cut = false;
    for (const LatticePart& part : lattice.parts)
    {
        const PartPoints points = points_of(lattice, part);
        const Vector3d low = lattice.places[idx(lattice.cells[idx(part.cell)][0])];
        double volume = 0.0;
        Vector3d first = Vector3d::Zero();
        Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
        for (std::size_t k = 0; k < 8; ++k)
        {
            const Vector3d x = low + lattice.edge(part.cell) * points.local[k];
            volume += points.weight[k];
            first += points.weight[k] * x;
            second +=
                points.weight[k] * (x - part.centre) * (x - part.centre).transpose();
        }
        EXPECT_NEAR(volume, part.volume, 1e-14);
        EXPECT_LT((first / volume - part.centre).norm(), 1e-13);
        EXPECT_LT((second / volume - part.second_moment).norm(), 1e-13);
        is_cut = is_cut || part.volume < 0.9 * std::pow(lattice.edge(part.cell), 3);
    }
    EXPECT_TRUE(is_cut);
}

TEST(PartPoints, stiffness_is_positive_and_lets_rigid_motions_go)
{
    const support::Built body = support::built(support::l_prism(), 7, 1);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    for (const LatticePart& part : lattice.parts)
    {
        const PartMatrix K = stiffness_of(points_of(lattice, part), {1.0, 0.4, 1.0});
        const Eigen::SelfAdjointEigenSolver<PartMatrix> eigen(K);
        EXPECT_GT(eigen.eigenvalues().minCoeff(),
                  -1e-13 * eigen.eigenvalues().maxCoeff());
        Eigen::Matrix<double, 24, 1> turn;
        for (int a = 0; a < 8; ++a)
            turn.segment<3>(3 * a) = Vector3d(1, 2, 3).cross(
                lattice.places[idx(lattice.cells[idx(part.cell)][idx(a)])]);
        EXPECT_LT((K * turn).norm(), 1e-12 * K.norm() * turn.norm());
    }
}

/// What of a cube of edge 1 lies below a plane; its moments from a fine grid of points.
Lattice cut_cube(const Vector3d& normal, double offset)
{
    Lattice lattice = support::bar_lattice(1, 1);
    LatticePart& part = lattice.parts.front();
    constexpr int kAcross = 24;
    double count = 0.0;
    Vector3d sum = Vector3d::Zero();
    Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
    for (int i = 0; i < kAcross * kAcross * kAcross; ++i)
    {
        const Vector3d x =
            (Vector3d(i % kAcross, i / kAcross % kAcross, i / kAcross / kAcross) +
             Vector3d::Constant(0.5)) /
            kAcross;
        if (normal.dot(x - Vector3d::Constant(0.5)) > offset)
            continue;
        count += 1.0;
        sum += x;
        squares += x * x.transpose();
    }
    part.volume = count / (kAcross * kAcross * kAcross);
    part.centre = sum / count;
    part.second_moment = squares / count - part.centre * part.centre.transpose();
    return lattice;
}

TEST(PartPoints, modes_let_no_warp_of_a_cut_cell_go_free)
{
    std::mt19937 rng(11);
    for (int trial = 0; trial < 200; ++trial)
    {
        const Vector3d normal = support::random_vector(rng, 1.0).normalized();
        const Lattice lattice = cut_cube(normal, support::random_number(rng, -0.3, 0.5));
        const PartPoints points = points_of(lattice, lattice.parts.front());
        const PartMatrix plain = stiffness_of(points, {1.0, 0.3, 1.0}, false);
        const PartMatrix K = stiffness_of(points, {1.0, 0.3, 1.0});
        // of fields that cost plain cells something
        const Eigen::SelfAdjointEigenSolver<PartMatrix> eigen(plain);
        const double largest = eigen.eigenvalues().maxCoeff();
        Eigen::MatrixXd fields(24, 24);
        int count = 0;
        for (int i = 0; i < 24; ++i)
            if (eigen.eigenvalues()[i] > 1e-9 * largest)
                fields.col(count++) =
                    eigen.eigenvectors().col(i) / std::sqrt(eigen.eigenvalues()[i]);
        const Eigen::MatrixXd f = fields.leftCols(count);
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> costs(f.transpose() * K * f);
        EXPECT_GT(costs.eigenvalues().minCoeff(), 0.1) << normal.transpose();
    }
}

} // namespace cellwarp::core
