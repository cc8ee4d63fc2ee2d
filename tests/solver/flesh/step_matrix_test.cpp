// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/step_matrix.h"

#include <gtest/gtest.h>

#include "solver/flesh/bound_nodes.h"
#include "tests/support/flesh.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using Eigen::Vector3d;
using Eigen::VectorXd;

TEST(FleshStepMatrix, is_the_product_of_all_nodes_by_the_free_ones)
{
    std::mt19937 rng(14);
    const support::Built body = support::built_mixed(support::l_prism(), 7, 1, 6);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    const std::vector<FleshMaterial> materials = {{1e4, 0.4, 1000}};
    const BoundNodes nodes =
        bind_nodes(lattice.hanging, support::held_nodes(lattice, [](const Vector3d& x)
                                                        { return x.x() < 0.2; }));
    const TubePart tube{0, 0, Eigen::Matrix<double, 8, 8>::Identity() * 0.1, 3e4};
    FleshForces forces(lattice, materials, {tube});
    forces.follow(support::random_field(lattice, rng, 0.05));
    const FleshFactors factors{0.3, 0.02, 0.01};
    const SparseRows by_free = by_free_of_all(nodes);
    StepMatrix matrix(lattice, materials, by_free, nodes.free.size());
    matrix.assemble(forces, factors);
    VectorXd x(Eigen::Index(3 * nodes.free.size()));
    for (double& number : x)
        number = support::random_number(rng, -1, 1);
    VectorXd all = VectorXd::Zero(Eigen::Index(3 * lattice.places.size())), image;
    for (std::size_t n = 0; n < by_free.size(); ++n)
        all.segment<3>(Eigen::Index(3 * n)) = at_point(by_free[n], x);
    forces.multiply(all, factors, image);
    VectorXd wanted = VectorXd::Zero(x.size());
    for (std::size_t n = 0; n < by_free.size(); ++n)
        for (const NodeShare& share : by_free[n])
            wanted.segment<3>(3 * share.node) +=
                share.share * image.segment<3>(Eigen::Index(3 * n));
    EXPECT_LT((matrix.blocks().multiply(x) - wanted).norm(), 1e-12 * wanted.norm());
}

} // namespace cellwarp::core
