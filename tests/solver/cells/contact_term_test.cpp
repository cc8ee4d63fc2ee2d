// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/contact_term.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/energy_checks.h"
#include "tests/support/held_body.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::HeldBody;
using support::random_number;
using support::random_vector;

namespace
{

/// A bar of which one end is given and one cell of the other is pinned.
HeldBody body()
{
    HeldBody body(support::bar(3, 2, 2).cells);
    body.prescribe([](const Cell& cell) { return cell.centre.x() < 1.0; });
    body.pin(body.cells.size() - 1, body.cells.cells.back().centre);
    return body;
}

std::vector<CellContact> random_contacts(std::size_t num_cells, std::mt19937& rng)
{
    std::uniform_int_distribution<int> any(0, static_cast<int>(num_cells) - 1);
    std::vector<CellContact> contacts;
    while (contacts.size() < 60)
    {
        CellContact contact;
        contact.a = any(rng);
        contact.b = any(rng);
        if (contact.a == contact.b)
            continue;
        contact.point = random_vector(rng, 0.5);
        contact.place = random_vector(rng, 0.5);
        contact.outward = random_vector(rng, 1.0).normalized();
        contact.stiffness = random_number(rng, 0.5, 2.0);
        contacts.push_back(contact);
    }
    return contacts;
}

} // namespace

TEST(ContactTerm, costs_the_square_of_the_depth_and_nothing_before_the_plane)
{
    CellContact contact;
    contact.b = 1;
    contact.point = {0.5, 0, 0};
    contact.place = {-0.5, 0, 0};
    contact.outward = {-1, 0, 0};
    contact.stiffness = 3.0;
    const Pose a{Eigen::Matrix3d::Identity(), {0, 0, 0}};
    for (const double distance : {1.2, 1.0, 0.9})
    {
        const Pose b{Eigen::Matrix3d::Identity(), {distance, 0.3, 0}};
        EXPECT_NEAR(contact_gap(contact, a, b), distance - 1.0, 1e-15);
        EXPECT_NEAR(contact_energy(contact, a, b),
                    distance < 1.0 ? 3.0 * (distance - 1.0) * (distance - 1.0) : 0.0,
                    1e-15);
        // Moved together nothing changes.
        const Motion motion{rotation_about(Eigen::Vector3d(1, 2, 2) / 3.0, 0.7),
                            {1, 2, 3}};
        EXPECT_NEAR(contact_gap(contact, {motion.R * a.R, motion(a.p)},
                                {motion.R * b.R, motion(b.p)}),
                    distance - 1.0, 1e-14);
    }
}

TEST(ContactTerm, has_the_derivatives_of_its_value_at_random_states)
{
    std::mt19937 rng(11);
    HeldBody of = body();
    of.components = find_components(of.cells, of.constraints);
    for (int run = 0; run < 3; ++run)
    {
        CellState state(of.cells, of.constraints);
        std::vector<Pose> poses = of.rest();
        for (Pose& pose : poses)
            pose = {support::random_rotation(rng), pose.p + random_vector(rng, 0.5)};
        poses.back() = held_at_pin(poses.back(), of.constraints.back(),
                                   of.cells.cells.back().centre);
        state.set_poses(poses);
        ContactTerm term(state, random_contacts(of.cells.size(), rng));
        Energy energy({&state}, {&term});
        support::check_structure(energy);
        support::check_gradient(energy);
        support::check_blocks(energy, kGaussNewton);
        support::check_gauss_newton(energy);
    }
}

TEST(ContactTerm, near_its_planes_has_the_curvature_of_the_squared_gaps)
{
    // J^T J is all of it there, for what it leaves out has the depth as a factor.
    constexpr double kDepth = 0.01;
    std::mt19937 rng(12);
    HeldBody of = body();
    CellState state(of.cells, of.constraints);
    std::vector<CellContact> contacts = random_contacts(of.cells.size(), rng);
    for (CellContact& contact : contacts)
        contact.place += (kDepth + contact_gap(contact, state.pose(contact.a),
                                               state.pose(contact.b))) *
                         contact.outward;
    ContactTerm term(state, contacts);
    Energy energy({&state}, {&term});
    energy.linearise(kExact);
    for (int run = 0; run < 10; ++run)
    {
        Eigen::VectorXd x(energy.num_unknowns()), product(energy.num_unknowns());
        for (double& value : x)
            value = random_number(rng, -1.0, 1.0);
        product.setZero();
        energy.multiply(x, product);
        const double wanted = support::curvature_by_values(energy, x, x);
        EXPECT_NEAR(x.dot(product), wanted, 0.05 * std::abs(wanted));
    }
}

TEST(ContactTerm, of_cells_whose_poses_are_given_is_nothing)
{
    HeldBody of = body();
    const CellState state(of.cells, of.constraints);
    std::vector<int> given;
    for (int cell = 0; cell < state.num_cells(); ++cell)
        if (state.unknown_of_cell(cell) == UnknownCell::None)
            given.push_back(cell);
    ASSERT_GE(given.size(), 2u);
    CellContact contact;
    contact.a = given[0];
    contact.b = given[1];
    contact.point = contact.place = Eigen::Vector3d::Zero();
    contact.outward = (state.pose(contact.b).p - state.pose(contact.a).p).normalized();
    contact.stiffness = 1.0;
    ASSERT_GT(contact_energy(contact, state.pose(contact.a), state.pose(contact.b)), 0.0);
    const ContactTerm term(state, std::vector<CellContact>{contact});
    EXPECT_TRUE(term.pairs().empty());
    EXPECT_EQ(term.value(), 0.0);
}

TEST(ContactTerm, of_a_group_is_its_leaders)
{
    std::mt19937 rng(13);
    HeldBody of(support::bar(3, 2, 2).cells);
    of.prescribe([](const Cell& cell) { return cell.centre.x() < 1.0; });
    std::vector<std::size_t> members;
    for (std::size_t c = 0; c < of.cells.size(); ++c)
        if (of.cells.cells[c].centre.x() > 2.0)
            members.push_back(c);
    of.group(members, {2.5, 1.0, 1.0});
    CellState state(of.cells, of.constraints);
    CellContact contact;
    contact.a = static_cast<int>(members.front());
    for (int cell = 0; cell < state.num_cells(); ++cell)
        if (state.unknown_of_cell(cell) != UnknownCell::None && cell != contact.a)
            contact.b = cell;
    contact.point = random_vector(rng, 0.5);
    contact.place = random_vector(rng, 0.5);
    contact.outward = (state.pose(contact.b).p - state.pose(contact.a).p).normalized();
    contact.stiffness = 1.0;
    ContactTerm term(state, std::vector<CellContact>{contact});
    Energy energy({&state}, {&term});
    ASSERT_GT(term.value(), 0.0);
    support::check_structure(energy);
    support::check_gradient(energy);
    support::check_blocks(energy, kGaussNewton);
}

} // namespace cellwarp::core
