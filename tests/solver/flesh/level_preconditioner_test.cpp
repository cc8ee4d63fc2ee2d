// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/level_preconditioner.h"

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "solver/flesh/flesh.h"
#include "solver/flesh/flesh_forces.h"
#include "tests/support/flesh.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;

/// Steps of conjugate gradients, on average, of a bar that swings; z^2 = 130.
double cg_steps(int across, bool has_levels)
{
    const Lattice lattice = support::bar_lattice(across, 3);
    const double dt = 1.0 / 120, edge = 1.0 / across;
    FleshSettings settings;
    settings.gravity = {0, 0, -9.81};
    settings.tolerance = 1e-4;
    settings.has_levels = has_levels;
    Flesh flesh(
        lattice, {{130.0 * 1000 * edge * edge / (dt * dt), 0.4, 1000}},
        support::held_nodes(lattice, [](const Vector3d& x) { return x.x() < 1e-9; }), {},
        settings);
    FleshState state = flesh.rest();
    int steps = 0;
    for (int k = 0; k < 10; ++k)
        steps += flesh.step(state, dt, std::vector<Motion>(1)).cg_steps;
    return steps / 10.0;
}

} // namespace

TEST(LevelPreconditioner, is_symmetric_and_positive)
{
    const support::Built body = support::built_mixed(support::l_prism(), 7, 1, 6);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    const std::vector<FleshMaterial> materials = {{1e4, 0.4, 1000}};
    FleshForces forces(lattice, materials, {});
    const BoundNodes nodes =
        bind_nodes(lattice.hanging, support::held_nodes(lattice, [](const Vector3d& x)
                                                        { return x.x() < 0.2; }));
    for (const bool has_levels : {false, true})
    {
        LevelPreconditioner B(lattice, nodes, forces.mean_blocks({1.0, 1e-3, 0.0}),
                              has_levels);
        EXPECT_EQ(B.num_levels() > 1, has_levels);
        std::mt19937 rng(4);
        const Eigen::Index size = Eigen::Index(3 * nodes.free.size());
        for (int trial = 0; trial < 10; ++trial)
        {
            VectorXd a(size), b(size), Ba, Bb;
            for (double& x : a)
                x = support::random_number(rng, -1, 1);
            for (double& x : b)
                x = support::random_number(rng, -1, 1);
            B.apply(a, Ba);
            B.apply(b, Bb);
            EXPECT_NEAR(a.dot(Bb) / b.dot(Ba), 1.0, 1e-10);
            EXPECT_GT(a.dot(Ba), 0.0);
        }
    }
}

TEST(LevelPreconditioner, steps_hardly_grow_with_the_nodes)
{
    // Jacobi takes twice as many steps for cells of half the edge.
    const double coarse = cg_steps(4, true), fine = cg_steps(8, true);
    EXPECT_LT(fine, 1.3 * coarse);
    EXPECT_LT(fine, 0.5 * cg_steps(8, false));
}

TEST(LevelPreconditioner, gives_the_same_bits_for_any_number_of_threads)
{
    const Lattice lattice = support::bar_lattice(6, 6);
    const std::vector<FleshMaterial> materials = {{1e4, 0.4, 1000}};
    FleshForces forces(lattice, materials, {});
    const BoundNodes nodes = bind_nodes(lattice.hanging, {});
    LevelPreconditioner B(lattice, nodes, forces.mean_blocks({1.0, 1e-3, 0.0}), true);
    std::mt19937 rng(4);
    const VectorXd r = support::random_field(lattice, rng, 1.0);
    VectorXd one, two;
    {
        const ThreadLimit limit(1);
        B.apply(r, one);
    }
    B.apply(r, two);
    EXPECT_EQ(one, two);
}

} // namespace cellwarp::core
