// SPDX-License-Identifier: GPL-3.0-or-later
// With e = P - point, d = |e| and n = e / d:
//   U = 1/2 k (d - L)^2,   dU = k (d - L) n,   d2U = k [n n^T + (1 - L / d) (I - n n^T)]
// A spring of no length has d2U = k I. Where d = 0 and L > 0 there is no direction: it
// neither pulls nor pushes there.
#include "solver/rods/point_springs.h"

#include <algorithm>
#include <utility>

namespace cellwarp
{

namespace
{

class PointSprings final : public RodTerm
{
public:
    PointSprings(const Rod& rod, std::vector<PointSpring> springs) : rod_(rod)
    {
        for (PointSpring& spring : springs)
        {
            BasisValues values = rod.basis().values(spring.s);
            springs_.push_back({std::move(spring), std::move(values)});
        }
    }

    void follow(const RodChange&) override
    {
        for (auto& [spring, values] : springs_)
            values = rod_.basis().values(spring.s);
    }

    double value(const RodState& state) const override
    {
        double sum = 0.0;
        for (const auto& [spring, values] : springs_)
        {
            const double longer = way(state, spring, values).norm() - spring.length;
            sum += 0.5 * spring.stiffness * longer * longer;
        }
        return sum;
    }

    double stiffness() const override
    {
        double sum = 0.0;
        for (const auto& [spring, values] : springs_)
            sum += spring.stiffness;
        return sum;
    }

    void add_gradient(const RodState& state, Eigen::VectorXd& out) const override
    {
        for (const auto& [spring, values] : springs_)
        {
            const Eigen::Vector3d e = way(state, spring, values);
            const Eigen::Vector3d force = spring.stiffness * share(spring, e.norm()) * e;
            for (int j = 0; j < values.count; ++j)
                out.segment<3>(unknown(values, j)) += values.value[0][idx(j)] * force;
        }
    }

    void add_hessian(const RodState& state, RodHessian how,
                     BandMatrix& out) const override
    {
        for (const auto& [spring, values] : springs_)
        {
            const Eigen::Vector3d e = way(state, spring, values);
            const double d = e.norm();
            double across = share(spring, d);
            if (how != RodHessian::Exact)
                across = std::max(across, 0.0);
            Eigen::Matrix3d B = across * Eigen::Matrix3d::Identity();
            if (d > 0.0)
                B += (1.0 - across) / (d * d) * e * e.transpose();
            for (int i = 0; i < values.count; ++i)
                for (int j = 0; j < values.count; ++j)
                {
                    const int row = unknown(values, i), column = unknown(values, j);
                    const double both = spring.stiffness * values.value[0][idx(i)] *
                                        values.value[0][idx(j)];
                    for (int a = 0; a < 3; ++a)
                        for (int b = 0; b < 3; ++b)
                            if (row + a >= column + b)
                                out.lower(row + a, column + b) += both * B(a, b);
                }
        }
    }

private:
    static Eigen::Vector3d way(const RodState& state, const PointSpring& spring,
                               const BasisValues& values)
    {
        return state.at(values).place - spring.point;
    }
    /// (d - L) / d
    static double share(const PointSpring& spring, double d)
    {
        return spring.length == 0.0 ? 1.0 : d > 0.0 ? 1.0 - spring.length / d : 0.0;
    }
    int unknown(const BasisValues& values, int j) const
    {
        return rod_.layout().control[idx(values.control[idx(j)])];
    }

    const Rod& rod_;
    std::vector<std::pair<PointSpring, BasisValues>> springs_;
};

} // namespace

std::unique_ptr<RodTerm> point_springs(const Rod& rod, std::vector<PointSpring> springs)
{
    return std::make_unique<PointSprings>(rod, std::move(springs));
}

} // namespace cellwarp
