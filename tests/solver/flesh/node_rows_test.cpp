// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/node_rows.h"

#include <random>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

class Dense final : public LinearOperator
{
public:
    explicit Dense(MatrixXd A) : A_(std::move(A)) {}
    void multiply(const VectorXd& x, VectorXd& y) const override { y = A_ * x; }

private:
    MatrixXd A_;
};

class Diagonal final : public Preconditioner
{
public:
    explicit Diagonal(const VectorXd& d) : d_(d) {}
    void apply(const VectorXd& r, VectorXd& z) override { z = r.cwiseQuotient(d_); }

private:
    VectorXd d_;
};

constexpr int kNodes = 12;

struct System
{
    MatrixXd A = MatrixXd::Zero(3 * kNodes, 3 * kNodes);
    VectorXd b = VectorXd::Zero(3 * kNodes), scale = VectorXd::Zero(kNodes);
    std::vector<NodeRow> rows;

    explicit System(unsigned seed)
    {
        std::mt19937 rng(seed);
        const auto number = [&] { return support::random_number(rng, -1, 1); };
        for (double& a : A.reshaped())
            a = number();
        A = (A * A.transpose()).eval();
        A.diagonal().array() += 3.0;
        for (double& x : b)
            x = number();
        for (int n = 0; n < kNodes; ++n)
            scale[n] = 3.0 / A.diagonal().segment<3>(3 * n).sum();
        for (int k = 0; k < 7; ++k)
        {
            NodeRow row;
            row.shares = {{k, 0.3 + 0.1 * k}, {k + 1, 0.5}, {(5 * k + 3) % kNodes, 0.2}};
            row.shares = gathered(row.shares);
            row.direction = Vector3d(number(), number(), number()).normalized();
            row.value = number();
            rows.push_back(row);
        }
    }
    MatrixXd J() const
    {
        MatrixXd out = MatrixXd::Zero(Eigen::Index(rows.size()), 3 * kNodes);
        for (std::size_t k = 0; k < rows.size(); ++k)
            for (const NodeShare& share : rows[k].shares)
                out.block<1, 3>(Eigen::Index(k), 3 * share.node) +=
                    share.share * rows[k].direction.transpose();
        return out;
    }
};

} // namespace

TEST(NodeRows, solutions_are_those_of_the_whole_system)
{
    for (unsigned seed = 1; seed < 6; ++seed)
    {
        const System system(seed);
        const MatrixXd J = system.J();
        const Eigen::Index n = 3 * kNodes, m = J.rows();
        MatrixXd whole = MatrixXd::Zero(n + m, n + m);
        whole.topLeftCorner(n, n) = system.A;
        whole.bottomLeftCorner(m, n) = J;
        whole.topRightCorner(n, m) = -J.transpose();
        NodeRows rows(system.rows, system.scale);
        VectorXd right(n + m);
        right << system.b, rows.values();
        const VectorXd expected = whole.partialPivLu().solve(right);
        const Dense A(system.A);
        Diagonal B(system.A.diagonal());
        ConjugateGradients cg(n);
        VectorXd x, l;
        rows.solve(A, B, system.b, {1e-13, 500}, cg, x, l);
        EXPECT_LT((x - expected.head(n)).norm(), 1e-11 * expected.norm());
        EXPECT_LT((l - expected.tail(m)).norm(), 1e-10 * expected.norm());
        EXPECT_LT((rows.times(x) - rows.values()).norm(), 1e-13);
    }
}

TEST(NodeRows, rows_told_twice_are_met)
{
    System system(9);
    system.rows.push_back(system.rows[2]);
    system.rows.push_back(system.rows[4]);
    NodeRows rows(system.rows, system.scale);
    const Dense A(system.A);
    Diagonal B(system.A.diagonal());
    ConjugateGradients cg(3 * kNodes);
    VectorXd x, l, once, l_once;
    rows.solve(A, B, system.b, {1e-12, 500}, cg, x, l);
    NodeRows without(System(9).rows, system.scale);
    without.solve(A, B, system.b, {1e-12, 500}, cg, once, l_once);
    EXPECT_LT((x - once).norm(), 1e-8);
    EXPECT_NEAR(l[2] + l[7], l_once[2], 1e-6);
    // None at all is a plain system.
    NodeRows none({}, system.scale);
    none.solve(A, B, system.b, {1e-12, 500}, cg, x, l);
    EXPECT_LT((system.A * x - system.b).norm(), 1e-10);
    EXPECT_EQ(l.size(), 0);
}

TEST(NodeRows, a_correction_moves_only_what_rows_see)
{
    const System system(3);
    const NodeRows rows(system.rows, system.scale);
    VectorXd x = system.b;
    rows.correct(x);
    EXPECT_LT((rows.times(x) - rows.values()).norm(), 1e-8);
    // The change is a sum of rows, each node by its scale.
    VectorXd change = x - system.b;
    for (int n = 0; n < kNodes; ++n)
        change.segment<3>(3 * n) /= system.scale[n];
    const MatrixXd Jt = system.J().transpose();
    const VectorXd l = Jt.fullPivLu().solve(change);
    EXPECT_LT((Jt * l - change).norm(), 1e-9 * change.norm());
    EXPECT_THROW(NodeRows({{{}, Vector3d::UnitX(), 1.0}}, system.scale),
                 std::invalid_argument);
}

} // namespace cellwarp::core
