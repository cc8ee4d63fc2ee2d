// SPDX-License-Identifier: GPL-3.0-or-later
// The source's rules for a cell beside those of the program: theory-skeleton 3, 4, 12.
#include "tests/support/random.h"

#include <random>

#include <Eigen/SparseCholesky>
#include <gtest/gtest.h>

#include "solver/flesh/large_strain.h"
#include "tests/support/flesh.h"
#include "tests/support/source_rules.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

struct Cantilever
{
    double tip = 0.0, frequency = 0.0;
};

/// 10 x 1 x 1, held at one end, unit shear at the other; its lowest frequency by inverse
/// iteration.
Cantilever by_tetrahedra(int across, double poisson, int halvings)
{
    using Sparse = Eigen::SparseMatrix<double>;
    const Lattice lattice = support::bar_lattice(across);
    const support::CellMatrices cell =
        support::tetrahedral(lattice, 0, {1.0, poisson, 1.0}, halvings);
    std::vector<int> number(lattice.places.size(), -1);
    int count = 0;
    for (std::size_t n = 0; n < number.size(); ++n)
        if (lattice.places[n].x() > 1e-9)
            number[n] = count++;
    std::vector<Eigen::Triplet<double>> stiff, heavy;
    for (const CornerNodes& corners : lattice.cells)
        for (int a = 0; a < 8; ++a)
            for (int b = 0; b < 8; ++b)
            {
                const int i = number[idx(corners[idx(a)])],
                          j = number[idx(corners[idx(b)])];
                for (int c = 0; i >= 0 && j >= 0 && c < 3; ++c)
                {
                    heavy.emplace_back(3 * i + c, 3 * j + c, cell.mass(a, b));
                    for (int d = 0; d < 3; ++d)
                        stiff.emplace_back(3 * i + c, 3 * j + d,
                                           cell.stiffness(3 * a + c, 3 * b + d));
                }
            }
    Sparse K(3 * count, 3 * count), M(3 * count, 3 * count);
    K.setFromTriplets(stiff.begin(), stiff.end());
    M.setFromTriplets(heavy.begin(), heavy.end());
    const VectorXd load = support::load_on_end(lattice, 10.0, {0, 0, 1});
    VectorXd b(3 * count);
    for (std::size_t n = 0; n < number.size(); ++n)
        if (number[n] >= 0)
            b.segment<3>(3 * number[n]) = load.segment<3>(Eigen::Index(3 * n));
    const Eigen::SimplicialLDLT<Sparse> factor(K);
    Cantilever out;
    VectorXd x = factor.solve(b);
    out.tip = b.dot(x);
    for (int k = 0; k < 30; ++k)
    {
        x /= std::sqrt(x.dot(M * x));
        out.frequency = std::sqrt(x.dot(K * x));
        x = factor.solve(M * x);
    }
    return out;
}

PartVector random_corners(std::mt19937& rng, double size)
{
    PartVector u;
    for (double& x : u)
        x = support::random_number(rng, -size, size);
    return u;
}

/// Energy and forces of St. Venant-Kirchhoff by the integrals: (4.5) of theory-skeleton.
StrainEnergy by_integrals(const support::PrecomputedIntegrals& of,
                          const FleshMaterial& material, const PartVector& corners)
{
    const double lambda = material.lambda(), mu = material.shear();
    const auto u = [&](int a) -> Vector3d { return corners.segment<3>(3 * a); };
    StrainEnergy out;
    for (int c = 0; c < 8; ++c)
    {
        Vector3d one = Vector3d::Zero(), two = one, three = one;
        for (int a = 0; a < 8; ++a)
        {
            one += (lambda * of.of_two(c, a) +
                    mu * of.of_two(a, c).trace() * Matrix3d::Identity() +
                    mu * of.of_two(a, c)) *
                   u(a);
            for (int b = 0; b < 8; ++b)
            {
                const double dot = u(a).dot(u(b));
                two += dot *
                       (0.5 * lambda * of.of_three(c, a, b) + mu * of.of_three(a, b, c));
                two += (lambda * of.of_three(a, b, c) + mu * of.of_three(c, a, b) +
                        mu * of.of_three(b, a, c))
                           .dot(u(a)) *
                       u(b);
                for (int d = 0; d < 8; ++d)
                    three += dot *
                             (0.5 * lambda * of.of_four(a, b, d, c) +
                              mu * of.of_four(a, d, b, c)) *
                             u(d);
            }
        }
        out.gradient.segment<3>(3 * c) = one + two + three;
        out.energy += u(c).dot(one / 2.0 + two / 3.0 + three / 4.0);
    }
    return out;
}

/// The same by direct quadrature at the integrals' points.
StrainEnergy by_points(const support::PrecomputedIntegrals& of,
                       const FleshMaterial& material, const PartVector& corners)
{
    StrainEnergy out;
    const Eigen::Map<const Eigen::Matrix<double, 3, 8>> u(corners.data());
    for (std::size_t p = 0; p < of.slopes.size(); ++p)
    {
        const Matrix3d F = Matrix3d::Identity() + u * of.slopes[p].transpose();
        const Matrix3d e = 0.5 * (F.transpose() * F - Matrix3d::Identity());
        const Matrix3d stress = material.lambda() * e.trace() * Matrix3d::Identity() +
                                2.0 * material.shear() * e;
        out.energy += of.weights[p] * 0.5 * (stress.cwiseProduct(e)).sum();
        Eigen::Map<Eigen::Matrix<double, 3, 8>>(out.gradient.data()) +=
            of.weights[p] * F * stress * of.slopes[p];
    }
    return out;
}

} // namespace

TEST(SourceRules, tetrahedra_are_as_much_too_stiff_as_known)
{
    const std::array<double, 4> poisson = {0.0, 0.3, 0.45, 0.499};
    const std::array<std::array<double, 4>, 3> whole = {
        {{1793.333, 1632.150, 856.119, 56.381},
         {3065.714, 2910.612, 2021.014, 130.941},
         {3731.958, 3651.814, 3169.868, 401.618}}};
    const std::array<std::array<double, 4>, 2> halved = {
        {{2384.444, 2251.793, 1486.088, 112.527},
         {3431.200, 3331.812, 2695.667, 330.138}}};
    for (std::size_t k = 0; k < 4; ++k)
    {
        for (int level = 0; level < 3; ++level)
            EXPECT_NEAR(by_tetrahedra(1 << level, poisson[k], 0).tip,
                        whole[idx(level)][k], 6e-4)
                << level << " " << k;
        for (int level = 0; level < 2; ++level)
            EXPECT_NEAR(by_tetrahedra(1 << level, poisson[k], 1).tip,
                        halved[idx(level)][k], 6e-4)
                << level << " " << k;
    }
    EXPECT_NEAR(by_tetrahedra(1, 0.0, 0).frequency, .015084, 6e-7);
    EXPECT_NEAR(by_tetrahedra(1, 0.3, 0).frequency, .015806, 6e-7);
    EXPECT_NEAR(by_tetrahedra(2, 0.3, 0).frequency, .011869, 6e-7);
    EXPECT_NEAR(by_tetrahedra(1, 0.0, 1).frequency, .013091, 6e-7);
}

TEST(SourceRules, tetrahedra_have_the_mass_and_keep_affine_maps)
{
    const Lattice lattice = support::bar_lattice(2, 1);
    const FleshMaterial material{3.0, 0.3, 2.0};
    for (const int halvings : {0, 1, 2})
    {
        const support::CellMatrices cell =
            support::tetrahedral(lattice, 0, material, halvings);
        EXPECT_NEAR(cell.mass.sum(), 2.0 * 0.125, 1e-14);
        // Even strain: the energy is that of the plain cell.
        Matrix3d strain;
        strain << 0.1, 0.02, 0.0, 0.02, -0.05, 0.01, 0.0, 0.01, 0.03;
        PartVector u;
        for (int a = 0; a < 8; ++a)
            u.segment<3>(3 * a) = strain * lattice.places[idx(lattice.cells[0][idx(a)])];
        const PartMatrix plain =
            stiffness_of(points_of(lattice, lattice.parts[0]), material, false);
        EXPECT_NEAR(u.dot(cell.stiffness * u), u.dot(plain * u), 1e-14);
    }
}

TEST(SourceRules, integrals_taken_once_give_the_forces_of_direct_quadrature)
{
    std::mt19937 rng(11);
    const FleshMaterial material{2.0, 0.35, 1.0};
    const double edge = 0.7;
    const support::PrecomputedIntegrals integrals(edge);
    for (int a = 0; a < 8; ++a)
        for (int b = 0; b < 8; ++b)
            EXPECT_LT(
                (integrals.of_two(b, a) - integrals.of_two(a, b).transpose()).norm(),
                1e-15);
    for (int trial = 0; trial < 5; ++trial)
    {
        const PartVector u = random_corners(rng, 0.2);
        const StrainEnergy once = by_integrals(integrals, material, u),
                           direct = by_points(integrals, material, u);
        EXPECT_NEAR(once.energy, direct.energy, 1e-13 * direct.energy);
        EXPECT_LT((once.gradient - direct.gradient).norm(),
                  1e-13 * direct.gradient.norm());
    }
}

TEST(SourceRules, two_points_along_an_axis_are_the_programs_rule_and_nearly_exact)
{
    std::mt19937 rng(12);
    const FleshMaterial material{2.0, 0.35, 1.0};
    const Lattice lattice = support::bar_lattice(1, 1);
    PartPoints points = points_of(lattice, lattice.parts[0]);
    for (Eigen::Matrix3d& modes : points.modes)
        modes.setZero(); // the source has none
    const support::PrecomputedIntegrals two(1.0, 2), three(1.0, 3);
    double most = 0.0;
    for (int trial = 0; trial < 20; ++trial)
    {
        const PartVector u = random_corners(rng, 0.3);
        const StrainEnergy ours = strain_energy(points, material,
                                                StrainLaw::StVenantKirchhoff, u),
                           same = by_points(two, material, u),
                           exact = by_points(three, material, u);
        EXPECT_LT((ours.gradient - same.gradient).norm(), 1e-13 * same.gradient.norm());
        most = std::max(most,
                        (ours.gradient - exact.gradient).norm() / exact.gradient.norm());
    }
    // What is left are warps that three points alone see.
    EXPECT_GT(most, 0.01);
    EXPECT_LT(most, 0.5);
    // Integrals of cubes go by their edge: A by its first power, C by none, D by its
    // inverse.
    const support::PrecomputedIntegrals half(0.5);
    EXPECT_LT((half.of_two(1, 6) - 0.5 * three.of_two(1, 6)).norm(), 1e-15);
    EXPECT_LT((half.of_three(1, 6, 3) - three.of_three(1, 6, 3)).norm(), 1e-15);
    EXPECT_NEAR(half.of_four(1, 6, 3, 2), 2.0 * three.of_four(1, 6, 3, 2), 1e-15);
}

} // namespace cellwarp::core
