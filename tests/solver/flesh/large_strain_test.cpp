// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/large_strain.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/flesh.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

constexpr std::array kLaws = {StrainLaw::StVenantKirchhoff, StrainLaw::NeoHookean};
const FleshMaterial kFlesh = {2.0, 0.4, 1.0};

/// Parts of boxes that the surface cuts, and of cells with no right angle.
struct Parts
{
    Lattice boxes, bent;

    Parts()
    {
        const support::Built body = support::built(support::l_prism(), 7, 0);
        boxes = octree_lattice(body.octree, body.cells, 1.0);
        bent = support::grid_lattice({{{0, 1, 2}, {0, 1}, {0, 1}}});
        std::mt19937 rng(5);
        for (Vector3d& x : bent.places)
            x += support::random_vector(rng, 0.1);
    }
    std::vector<PartPoints> points() const
    {
        std::vector<PartPoints> out;
        for (const std::size_t p : {std::size_t(0), boxes.parts.size() / 2})
            out.push_back(points_of(boxes, boxes.parts[p]));
        out.push_back(points_of(bent, bent.parts[1]));
        return out;
    }
};

PartVector random_displacement(std::mt19937& rng, double size)
{
    PartVector u;
    for (double& x : u)
        x = support::random_number(rng, -size, size);
    return u;
}

} // namespace

TEST(LargeStrain, is_zero_for_rigid_motions_and_the_linear_law_for_small_strain)
{
    const Parts parts;
    std::mt19937 rng(2);
    const Lattice& lattice = parts.boxes;
    const LatticePart& part = lattice.parts[lattice.parts.size() / 2];
    const PartPoints points = points_of(lattice, part);
    const Motion T{support::random_rotation(rng), support::random_vector(rng, 2.0)};
    PartVector rigid, even;
    for (int a = 0; a < 8; ++a)
    {
        const Vector3d& x = lattice.places[idx(lattice.cells[idx(part.cell)][idx(a)])];
        rigid.segment<3>(3 * a) = T(x) - x;
        even.segment<3>(3 * a) = 1e-5 * Vector3d(x.y(), x.x() + x.z(), 0.3 * x.z());
    }
    for (const StrainLaw law : kLaws)
    {
        const StrainEnergy turned = strain_energy(points, kFlesh, law, rigid);
        EXPECT_NEAR(turned.energy, 0.0, 1e-14);
        EXPECT_LT(turned.gradient.norm(), 1e-13);
        const StrainEnergy small = strain_energy(points, kFlesh, law, even);
        const double linear = 0.5 * even.dot(stiffness_of(points, kFlesh) * even);
        EXPECT_NEAR(small.energy / linear, 1.0, 1e-3);
    }
}

TEST(LargeStrain, at_rest_all_laws_have_the_stiffness_of_the_linear_one)
{
    const Parts parts;
    PartPoints plain = parts.points().front();
    for (Eigen::Matrix3d& modes : plain.modes)
        modes.setZero();
    for (const StrainLaw law : kLaws)
        for (const double poisson : {0.0, 0.4, 0.499})
            for (const Filter filter : {Filter::No, Filter::Yes})
            {
                const FleshMaterial material{2.0, poisson, 1.0};
                const auto at_rest = [&](const PartPoints& points) {
                    return strain_hessian(points, material, law, PartVector::Zero(),
                                          filter);
                };
                for (const PartPoints& points : parts.points())
                {
                    const PartMatrix K = stiffness_of(points, material);
                    EXPECT_LT((at_rest(points) - K).norm(), 1e-10 * K.norm()) << poisson;
                }
                const PartMatrix K = stiffness_of(plain, material, false);
                EXPECT_LT((at_rest(plain) - K).norm(), 1e-12 * K.norm()) << poisson;
            }
}

TEST(LargeStrain, a_cell_that_bends_costs_what_bends_it_and_no_shear)
{
    // A cube that is bent about y, its sides free to follow: 1/2 E I kappa^2.
    const Lattice lattice = support::bar_lattice(1, 1);
    const PartPoints points = points_of(lattice, lattice.parts[0]);
    const double bend = 1e-4;
    for (const StrainLaw law : kLaws)
        for (const double poisson : {0.0, 0.3, 0.45, 0.499})
        {
            PartVector u = PartVector::Zero();
            for (int a = 0; a < 8; ++a)
            {
                u[3 * a] = bend * sign_of(a, 0) * sign_of(a, 2) * 0.25;
                u[3 * a + 1] = -poisson * bend * sign_of(a, 1) * sign_of(a, 2) * 0.25;
            }
            EXPECT_NEAR(strain_energy(points, {1.0, poisson, 1.0}, law, u).energy /
                            (0.5 / 12.0 * bend * bend),
                        1.0, 1e-5)
                << poisson;
        }
}

TEST(LargeStrain, forces_and_hessians_match_finite_differences)
{
    const Parts parts;
    std::mt19937 rng(3);
    for (const StrainLaw law : kLaws)
        for (const PartPoints& points : parts.points())
            for (int trial = 0; trial < 5; ++trial)
            {
                const PartVector u = random_displacement(rng, 0.1);
                const StrainEnergy at = strain_energy(points, kFlesh, law, u);
                ASSERT_GT(at.gradient.norm(), 1e-3);
                const PartMatrix H = strain_hessian(points, kFlesh, law, u, Filter::No);
                const PartVector way = random_displacement(rng, 1.0);
                const double h = 1e-5;
                const StrainEnergy up = strain_energy(points, kFlesh, law, u + h * way),
                                   down = strain_energy(points, kFlesh, law, u - h * way);
                EXPECT_NEAR((up.energy - down.energy) / (2.0 * h), at.gradient.dot(way),
                            1e-8 * at.gradient.norm() * way.norm());
                EXPECT_LT(((up.gradient - down.gradient) / (2.0 * h) - H * way).norm(),
                          1e-8 * (H * way).norm());
            }
}

TEST(LargeStrain, filtered_hessians_are_positive_and_the_same_where_nothing_is_negative)
{
    const Parts parts;
    std::mt19937 rng(4);
    for (const StrainLaw law : kLaws)
        for (const PartPoints& points : parts.points())
        {
            bool was_negative = false;
            for (int trial = 0; trial < 30; ++trial)
            {
                const PartVector u = random_displacement(rng, 0.6);
                const auto least = [&](Filter filter)
                {
                    const PartMatrix H = strain_hessian(points, kFlesh, law, u, filter);
                    const Eigen::SelfAdjointEigenSolver<PartMatrix> eigen(H);
                    return eigen.eigenvalues().minCoeff() /
                           eigen.eigenvalues().maxCoeff();
                };
                EXPECT_GT(least(Filter::Yes), -1e-13);
                was_negative = was_negative || least(Filter::No) < -1e-6;
            }
            EXPECT_TRUE(was_negative);
            const PartVector rest = PartVector::Zero();
            const PartMatrix H = strain_hessian(points, kFlesh, law, rest, Filter::No);
            EXPECT_LT((strain_hessian(points, kFlesh, law, rest, Filter::Yes) - H).norm(),
                      1e-12 * H.norm());
        }
}

TEST(LargeStrain, pressed_st_venant_kirchhoff_pushes_back_less_and_less)
{
    // Its uniaxial stress peaks at a stretch of 0.577.
    const Lattice lattice = support::bar_lattice(1, 1);
    const PartPoints points = points_of(lattice, lattice.parts[0]);
    const FleshMaterial material{1.0, 0.0, 1.0};
    const auto push = [&](StrainLaw law, double stretch)
    {
        PartVector u = PartVector::Zero();
        for (int a = 0; a < 8; ++a)
            if (a & 1)
                u[3 * a] = stretch - 1.0;
        double force = 0.0;
        const StrainEnergy at = strain_energy(points, material, law, u);
        for (int a = 0; a < 8; ++a)
            if (a & 1)
                force -= at.gradient[3 * a];
        EXPECT_NEAR(least_volume(points, u), stretch, 1e-12);
        return force;
    };
    EXPECT_GT(push(StrainLaw::StVenantKirchhoff, 0.577),
              push(StrainLaw::StVenantKirchhoff, 0.6));
    EXPECT_GT(push(StrainLaw::StVenantKirchhoff, 0.577),
              push(StrainLaw::StVenantKirchhoff, 0.55));
    EXPECT_GT(push(StrainLaw::NeoHookean, 0.3), push(StrainLaw::NeoHookean, 0.5));
}

} // namespace cellwarp::core
