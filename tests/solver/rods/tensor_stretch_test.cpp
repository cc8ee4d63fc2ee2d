// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/tensor_stretch.h"

#include <numbers>

#include <gtest/gtest.h>

#include "tests/support/rods.h"

namespace cellwarp::core
{

TEST(PackedTensor, has_a_place_for_every_quadruple_and_no_more)
{
    // Cubics: 20 n - 45.
    for (const int n : {4, 5, 20})
        EXPECT_EQ(PackedTensor(n, 4, false).size(), idx(20 * n - 45));
    EXPECT_EQ(PackedTensor(9, 4, true).size(), 180u);
    for (const int order : {3, 4, 6})
    {
        constexpr int n = 9;
        PackedTensor tensor(n, order, false);
        std::size_t count = 0;
        for (int i = 0; i < n; ++i)
            for (int j = i; j < std::min(i + order, n); ++j)
                for (int k = j; k < std::min(i + order, n); ++k)
                    for (int l = k; l < std::min(i + order, n); ++l)
                    {
                        EXPECT_EQ(tensor.at(i, j, k, l), 0.0); // not met before
                        tensor.at(i, j, k, l) = 1.0;
                        ++count;
                    }
        EXPECT_EQ(tensor.size(), count);
    }
}

TEST(TensorStretch, derivatives_are_those_of_differences)
{
    for (const int degree : {1, 2, 3, 5})
        for (const bool is_closed : {false, true})
        {
            SCOPED_TRACE(testing::Message() << degree << is_closed);
            const Rod rod = support::crooked_rod({is_closed, true, true, degree}, {});
            support::expect_derivatives(*tensor_stretch(rod), rod);
        }
}

TEST(TensorStretch, is_zero_at_rest_and_turns_along)
{
    const Rod rod = support::crooked_rod({false, true, true, 3}, {});
    const std::unique_ptr<RodTerm> term = tensor_stretch(rod);
    RodState state(rod);
    EXPECT_NEAR(term->value(state), 0.0, 1e-12);
    Eigen::VectorXd turned = state.x();
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(1.0, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    for (const int first : rod.layout().control)
        turned.segment<3>(first) = R * state.x().segment<3>(first);
    state.move_to(turned);
    EXPECT_NEAR(term->value(state), 0.0, 1e-12);
}

TEST(TensorStretch, of_an_even_stretch_is_that_of_the_green_strain)
{
    const double YA = 7.0, L = 3.0;
    const Rod rod = support::straight_rod(L, 5, support::section_of(YA, 1.0, 1.0));
    const std::unique_ptr<RodTerm> term = tensor_stretch(rod);
    for (const double times : {0.5, 1.0, 1.7})
    {
        RodState state(rod);
        state.move_to(times * state.x());
        const double eps = 0.5 * (times * times - 1.0);
        EXPECT_NEAR(term->value(state), 0.5 * YA * L * eps * eps, 1e-12);
    }
}

TEST(TensorStretch, follows_a_section_that_varies)
{
    const std::vector<Eigen::Vector3d> ends = {{0, 0, 0}, {1, 0, 0}};
    const Rod rod(spline_through(ends, false, 6),
                  [](double share) { return support::section_of(1.0 + share, 1.0, 1.0); },
                  {});
    RodState state(rod);
    state.move_to(2.0 * state.x());
    EXPECT_NEAR(tensor_stretch(rod)->value(state), 0.5 * 1.5 * 1.5 * 1.5, 1e-12);
}

} // namespace cellwarp::core
