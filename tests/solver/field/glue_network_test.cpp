// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/glue_network.h"

#include <cmath>
#include <random>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace cellwarp::core
{

using support::random_number;

namespace
{

struct Joint
{
    std::size_t a, b;
};

GlueNetwork solved(const std::vector<double>& resistances,
                   const std::vector<Joint>& joints, std::size_t ground)
{
    GlueNetwork network(resistances);
    for (const Joint& joint : joints)
        network.join(joint.a, joint.b);
    network.solve_for(ground);
    return network;
}

/// Every node joined to some before it, so that all hang together.
std::vector<Joint> random_joints(std::mt19937& rng, std::size_t num_nodes)
{
    std::vector<Joint> joints;
    for (std::size_t i = 1; i < num_nodes; ++i)
    {
        joints.push_back({rng() % i, i});
        for (std::size_t j = 0; j < i; ++j)
            if (j != joints.back().a && rng() % 4 == 0)
                joints.push_back({j, i});
    }
    return joints;
}

} // namespace

TEST(GlueNetwork, of_a_chain_the_resistances_add_up)
{
    GlueNetwork network = solved({0.0, 2.0, 4.0, 1.0}, {{0, 1}, {1, 2}, {2, 3}}, 0);
    EXPECT_EQ(network.resistance_to(0), 0.0);
    EXPECT_NEAR(network.resistance_to(1), 1.0, 1e-11);
    EXPECT_NEAR(network.resistance_to(2), 1.0 + 3.0, 1e-11);
    EXPECT_NEAR(network.resistance_to(3), 1.0 + 3.0 + 2.5, 1e-11);
}

TEST(GlueNetwork, two_ways_share_the_current)
{
    // Around a square: by 1, of resistance 2, and by 2, of resistance 6.
    GlueNetwork network =
        solved({0.0, 2.0, 6.0, 0.0}, {{0, 1}, {1, 3}, {0, 2}, {2, 3}}, 0);
    EXPECT_NEAR(network.resistance_to(3), 1.0 / (1.0 / 2.0 + 1.0 / 6.0), 1e-11);
}

TEST(GlueNetwork, agrees_with_the_inverse_of_its_matrix)
{
    std::mt19937 rng(1);
    for (const std::size_t n : {2u, 5u, 20u, 90u})
    {
        std::vector<double> resistances;
        for (std::size_t i = 0; i < n; ++i)
            resistances.push_back(random_number(rng, 0.1, 3.0));
        const std::vector<Joint> joints = random_joints(rng, n);
        const std::size_t ground = n / 2;
        Eigen::MatrixXd L = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(n),
                                                  static_cast<Eigen::Index>(n));
        for (const Joint& joint : joints)
        {
            const auto a = static_cast<Eigen::Index>(joint.a),
                       b = static_cast<Eigen::Index>(joint.b);
            const double g = 2.0 / (resistances[joint.a] + resistances[joint.b]);
            L(a, a) += g;
            L(b, b) += g;
            L(a, b) -= g;
            L(b, a) -= g;
        }
        const auto g = static_cast<Eigen::Index>(ground);
        L.row(g).setZero();
        L.col(g).setZero();
        L(g, g) = 1.0;
        const Eigen::MatrixXd X = L.inverse();
        GlueNetwork network = solved(resistances, joints, ground);
        for (std::size_t i = 0; i < n; ++i)
            if (i != ground)
            {
                const auto k = static_cast<Eigen::Index>(i);
                EXPECT_NEAR(network.resistance_to(i), X(k, k), 1e-9 * X(k, k));
            }
    }
}

TEST(GlueNetwork, slopes_match_finite_differences)
{
    std::mt19937 rng(2);
    std::vector<double> resistances;
    for (int i = 0; i < 9; ++i)
        resistances.push_back(random_number(rng, 0.1, 3.0));
    const std::vector<Joint> joints = random_joints(rng, 9);
    GlueNetwork network = solved(resistances, joints, 4);
    for (std::size_t node = 0; node < 9; ++node)
    {
        network.resistance_to(node);
        const std::vector<double> slopes(network.slopes().begin(),
                                         network.slopes().end());
        for (std::size_t k = 0; k < 9; ++k)
        {
            const auto moved = [&](double by)
            {
                std::vector<double> other = resistances;
                other[k] += by;
                return solved(other, joints, 4).resistance_to(node);
            };
            EXPECT_NEAR(slopes[k], (moved(1e-5) - moved(-1e-5)) / 2e-5, 1e-7);
        }
    }
}

TEST(GlueNetwork, resistances_of_very_different_sizes_keep_their_digits)
{
    // A strong pair that hangs on a thread, and a node that resists nothing.
    GlueNetwork network =
        solved({0.0, 1e30, 1e-8, 1e-8, 0.0}, {{0, 1}, {1, 2}, {2, 3}, {0, 4}}, 0);
    EXPECT_NEAR(network.resistance_to(3) / 1e30, 1.0, 1e-12);
    EXPECT_LT(network.resistance_to(4), 1e-11);
    EXPECT_NEAR(network.slopes()[1], 0.0, 1e-30);
}

} // namespace cellwarp::core
