// SPDX-License-Identifier: GPL-3.0-or-later
// With N a diagonal near A^-1, W = J N J^T is as sparse as rows share nodes, and
//   P = I - N J^T W^-1 J
// takes from any x what the rows see of it: J P = 0. The x that meets them is
// x0 + P y, x0 = N J^T W^-1 values, and what is left is P^T A P y = P^T (b - A x0), which
// conjugate gradients solve as they are, preconditioned by P B P^T [Gould01]: residuals
// stay such that no row feels them, so the forces of the rows, which no step makes
// smaller, do not hide how far the solution is. l is what the rows feel of A x - b.
#include "solver/flesh/node_rows.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;

/// Of W's diagonal: rows that others tell have a factor still.
constexpr double kRidge = 1e-10;

/// Digits that a projected right side keeps, relative to what it was.
constexpr double kDigits = 1e-12;

/// x less what the rows see of it: P x.
void project(const NodeRows& rows, VectorXd& x)
{
    rows.add_transposed(-rows.weighed(rows.times(x)), true, x);
}

/// P^T r.
void project_forces(const NodeRows& rows, VectorXd& r)
{
    rows.add_transposed(-rows.weighed(rows.felt(r)), false, r);
}

class ProjectedOperator final : public LinearOperator
{
public:
    ProjectedOperator(const LinearOperator& A, const NodeRows& rows) : A_(A), rows_(rows)
    {
    }
    void multiply(const VectorXd& x, VectorXd& y) const override
    {
        projected_ = x;
        project(rows_, projected_);
        A_.multiply(projected_, y);
        project_forces(rows_, y);
    }

private:
    const LinearOperator& A_;
    const NodeRows& rows_;
    mutable VectorXd projected_;
};

class ProjectedPreconditioner final : public Preconditioner
{
public:
    ProjectedPreconditioner(Preconditioner& B, const NodeRows& rows) : B_(B), rows_(rows)
    {
    }
    void apply(const VectorXd& r, VectorXd& z) override
    {
        projected_ = r;
        project_forces(rows_, projected_);
        B_.apply(projected_, z);
        project(rows_, z);
    }

private:
    Preconditioner& B_;
    const NodeRows& rows_;
    VectorXd projected_;
};

Vector3d across(const Vector3d& normal, const Vector3d& way)
{
    return way - normal.dot(way) * normal;
}

} // namespace

Vector3d NodeBrake::force(const VectorXd& x) const
{
    return -factor * across(normal, at_point(shares, x) + base);
}

void BrakedOperator::multiply(const VectorXd& x, VectorXd& y) const
{
    A_.multiply(x, y);
    for (const NodeBrake& brake : brakes_)
    {
        const Vector3d force =
            brake.factor * across(brake.normal, at_point(brake.shares, x));
        for (const NodeShare& share : brake.shares)
            y.segment<3>(3 * share.node) += share.share * force;
    }
}

NodeRows::NodeRows(std::vector<NodeRow> rows, const VectorXd& scale)
    : rows_(std::move(rows)), scale_(scale)
{
    if (rows_.empty())
        return;
    std::vector<std::vector<std::pair<int, double>>> rows_of_node(
        static_cast<std::size_t>(scale.size()));
    std::vector<Eigen::Triplet<double>> entries, ridge;
    for (std::size_t k = 0; k < rows_.size(); ++k)
    {
        double own = 0.0;
        for (const NodeShare& share : rows_[k].shares)
        {
            own += share.share * share.share * scale[share.node];
            std::vector<std::pair<int, double>>& others = rows_of_node[idx(share.node)];
            others.emplace_back(static_cast<int>(k), share.share);
            for (const auto& [other, of] : others)
                entries.emplace_back(
                    static_cast<int>(k), other,
                    share.share * of * scale[share.node] *
                        rows_[k].direction.dot(rows_[idx(other)].direction));
        }
        if (!(own > 0.0))
            throw std::invalid_argument("a row needs a free node");
        ridge.emplace_back(static_cast<int>(k), static_cast<int>(k), kRidge * own);
    }
    const Eigen::Index size = Eigen::Index(rows_.size());
    seen_.resize(size, size);
    seen_.setFromTriplets(entries.begin(), entries.end());
    Eigen::SparseMatrix<double> more(size, size);
    more.setFromTriplets(ridge.begin(), ridge.end());
    factor_.compute(seen_ + more);
    if (factor_.info() != Eigen::Success)
        throw std::invalid_argument("rows without a factor");
}

VectorXd NodeRows::times(const VectorXd& x) const
{
    VectorXd out(Eigen::Index(rows_.size()));
    for (std::size_t k = 0; k < rows_.size(); ++k)
        out[Eigen::Index(k)] = rows_[k].direction.dot(at_point(rows_[k].shares, x));
    return out;
}

VectorXd NodeRows::felt(const VectorXd& r) const
{
    VectorXd out(Eigen::Index(rows_.size()));
    for (std::size_t k = 0; k < rows_.size(); ++k)
    {
        Vector3d sum = Vector3d::Zero();
        for (const NodeShare& share : rows_[k].shares)
            sum += share.share * scale_[share.node] * r.segment<3>(3 * share.node);
        out[Eigen::Index(k)] = rows_[k].direction.dot(sum);
    }
    return out;
}

void NodeRows::add_transposed(const VectorXd& l, bool scaled, VectorXd& y) const
{
    for (std::size_t k = 0; k < rows_.size(); ++k)
        for (const NodeShare& share : rows_[k].shares)
            y.segment<3>(3 * share.node) += l[Eigen::Index(k)] * share.share *
                                            (scaled ? scale_[share.node] : 1.0) *
                                            rows_[k].direction;
}

VectorXd NodeRows::values() const
{
    VectorXd out(Eigen::Index(rows_.size()));
    for (std::size_t k = 0; k < rows_.size(); ++k)
        out[Eigen::Index(k)] = rows_[k].value;
    return out;
}

VectorXd NodeRows::weighed(const VectorXd& y) const
{
    // Once more for what the ridge has left.
    VectorXd x = factor_.solve(y);
    x += factor_.solve(y - seen_.selfadjointView<Eigen::Lower>() * x);
    return x;
}

void NodeRows::correct(VectorXd& x) const
{
    add_transposed(weighed(values() - times(x)), true, x);
}

LinearReport NodeRows::solve(const LinearOperator& A, Preconditioner& B,
                             const VectorXd& b, const LinearLimits& limits,
                             ConjugateGradients& cg, VectorXd& x, VectorXd& l)
{
    l.resize(Eigen::Index(rows_.size()));
    if (rows_.empty())
        return cg.solve(A, B, b, limits, x);
    VectorXd start = VectorXd::Zero(b.size()), image(b.size());
    correct(start);
    A.multiply(start, image);
    VectorXd left = b - image;
    project_forces(*this, left);
    const ProjectedOperator inside(A, *this);
    ProjectedPreconditioner near(B, *this);
    // Where the rows take nearly all of b, what is left has no more digits than b.
    LinearLimits within = limits;
    if (const double size = left.norm(); size > 0.0)
        within.tolerance =
            std::max(within.tolerance, std::min(1.0, kDigits * b.norm() / size));
    LinearReport report = cg.solve(inside, near, left, within, x);
    if (within.tolerance > limits.tolerance && report.residual <= within.tolerance)
        report.residual = limits.tolerance;
    project(*this, x);
    x += start;
    // Rows that others tell are met to the ridge only: once more.
    correct(x);
    A.multiply(x, image);
    l = weighed(felt(image - b));
    return report;
}

} // namespace cellwarp::core
