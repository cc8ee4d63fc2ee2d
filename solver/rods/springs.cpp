// SPDX-License-Identifier: GPL-3.0-or-later
// All is of ways e = sum c_k q_k: from one sample of the curve to another, or along the
// tangent. A force f on a way pulls control point k with c_k f. Samples stand at knots
// and in the middle of spans.
//
// Distance springs 1/2 k (D - D0)^2, D = |e|, k = YA / D0, from knot to knot; in spans
// that touch an end or a less smooth knot, over each half of the span. That makes as many
// as stretch has dimensions: with halves everywhere the rod would not bend without
// stretching, without any the ends would have shapes that cost nothing.
//
// Angular springs between successive halves of spans, at an end between its tangent and
// the first half, c the cosine of the turn alpha:
//   1/2 k (2 tan(alpha / 2))^2 = 2 k (1 - c) / (1 + c),   k = YI / S,
// S the length from the middle of the one to that of the other. With
// U' = -4 k / (1 + c)^2 and U'' = 8 k / (1 + c)^3,
//   dc/de_a = (t_b - c t_a) / |e_a|,
//   d2c/de_a2 = -[(t_b - c t_a) t_a^T + t_a (t_b - c t_a)^T + c (I - t_a t_a^T)] /
//   |e_a|^2, d2c/de_a de_b = (I - t_a t_a^T)(I - t_b t_b^T) / (|e_a| |e_b|).
// As c = 1 - |t_a - t_b|^2 / 2, -U' |dt_a - dt_b|^2 + U'' dc^2 is what is definite of it.
#include "solver/rods/springs.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

class Springs final : public RodTerm
{
public:
    Springs(const Rod& rod, bool bends);

    void follow(const RodChange& change) override;
    double value(const RodState& state) const override;
    void add_gradient(const RodState& state, Eigen::VectorXd& out) const override;
    void add_hessian(const RodState& state, RodHessian how,
                     BandMatrix& out) const override;
    void predict(const RodState& state, const Eigen::VectorXd* step) override;
    void add_correction(const RodState& before, const RodState& after,
                        const Eigen::VectorXd& step, Eigen::VectorXd& out) const override;

private:
    struct Angle
    {
        PointShares a, b;
        double stiffness = 0.0; ///< [N m]
    };
    /// Both ways of an angle.
    struct Corner
    {
        Vector3d ta, tb;
        double la, lb, c;
        /// Derivatives of c by both ways.
        Vector3d by_a() const { return (tb - c * ta) / la; }
        Vector3d by_b() const { return (ta - c * tb) / lb; }
    };

    void build();
    void add_stretch(const RodState& rest, PointShares way, double length,
                     const Section& section);
    void add_bending(const std::vector<PointShares>& halves);
    static Corner corner(const Angle& angle, const Eigen::VectorXd& x);
    static void add_block(const PointShares& a, const PointShares& b, const Matrix3d& B,
                          BandMatrix& out);

    const Rod& rod_;
    bool bends_;
    DistanceSprings distances_;
    std::vector<Angle> angles_;
};

Springs::Springs(const Rod& rod, bool bends) : rod_(rod), bends_(bends)
{
    if (rod.settings().coupled_spans < 2)
        throw std::invalid_argument("a rod of springs couples two spans");
    build();
}

/// Springs are bound to one resolution, and cheap.
void Springs::follow(const RodChange&)
{
    distances_.clear();
    angles_.clear();
    distances_.predict({}, nullptr);
    build();
}

void Springs::build()
{
    const Rod& rod = rod_;
    const RodState rest(rod);
    std::vector<PointShares> halves;
    for (std::size_t e = 0; e < rod.spans().size(); ++e)
    {
        const RodSpan& span = rod.spans()[e];
        const double middle = 0.5 * (span.begin + span.end);
        std::vector<PointShares> values;
        for (const double s : {span.begin, middle, span.end})
            values.push_back(
                shares_of(rod, rod.basis().values_in(static_cast<int>(e), s), 0));
        halves.push_back(way_between(values[0], values[1]));
        halves.push_back(way_between(values[1], values[2]));
        if (span.is_smooth[0] && span.is_smooth[1])
        {
            add_stretch(rest, way_between(values[0], values[2]), span.length,
                        rod.section_at(middle));
            continue;
        }
        const double half = rod.arc_length().at(middle) - rod.arc_length().at(span.begin);
        add_stretch(rest, halves[2 * e], half,
                    rod.section_at(0.5 * (span.begin + middle)));
        add_stretch(rest, halves[2 * e + 1], span.length - half,
                    rod.section_at(0.5 * (middle + span.end)));
    }
    if (bends_)
        add_bending(halves);
}

/// \p length: at rest, if the rod is to be straight there.
void Springs::add_stretch(const RodState& rest, PointShares way, double length,
                          const Section& section)
{
    const double at_rest =
        rod_.settings().rest == RodRest::Given ? along(way, rest.x()).norm() : length;
    distances_.add({std::move(way), section.stretch / at_rest, at_rest});
}

/// \p halves: two a span.
void Springs::add_bending(const std::vector<PointShares>& halves)
{
    const std::span<const RodSpan> spans = rod_.spans();
    const auto stiffness = [&](double s) { return rod_.section_at(s).bending[0]; };
    for (std::size_t e = 0; e < spans.size(); ++e)
    {
        const RodSpan &span = spans[e], &next = spans[(e + 1) % spans.size()];
        const PointShares &first = halves[2 * e], &second = halves[2 * e + 1];
        const double middle = 0.5 * (span.begin + span.end), L = span.length;
        angles_.push_back({first, second, stiffness(middle) / (0.5 * L)});
        // A hinge is an end on either side.
        const bool goes_on = span.station[1] == next.station[0];
        const std::size_t before = (e + spans.size() - 1) % spans.size();
        if (spans[before].station[1] != span.station[0])
            angles_.push_back(
                {shares_of(rod_, rod_.basis().values_in(static_cast<int>(e), span.begin),
                           1),
                 first, stiffness(span.begin) / (0.25 * L)});
        if (goes_on)
            angles_.push_back({second, halves[(2 * e + 2) % halves.size()],
                               stiffness(span.end) / (0.25 * (L + next.length))});
        else
            angles_.push_back(
                {second,
                 shares_of(rod_, rod_.basis().values_in(static_cast<int>(e), span.end),
                           1),
                 stiffness(span.end) / (0.25 * L)});
    }
}

Springs::Corner Springs::corner(const Angle& angle, const Eigen::VectorXd& x)
{
    const Vector3d a = along(angle.a, x), b = along(angle.b, x);
    Corner out{a.normalized(), b.normalized(), a.norm(), b.norm(), 0.0};
    // A fold by half a turn, which no force can reach, is kept from 0.
    out.c = std::max(out.ta.dot(out.tb), -1.0 + 1e-9);
    return out;
}

double Springs::value(const RodState& state) const
{
    double sum = distances_.energy(state.x());
    for (const Angle& angle : angles_)
    {
        const double c = corner(angle, state.x()).c;
        sum += 2.0 * angle.stiffness * (1.0 - c) / (1.0 + c);
    }
    return sum;
}

void Springs::add_gradient(const RodState& state, Eigen::VectorXd& out) const
{
    distances_.add_gradient(state.x(), out);
    for (const Angle& angle : angles_)
    {
        const Corner at = corner(angle, state.x());
        const double slope = -4.0 * angle.stiffness / ((1.0 + at.c) * (1.0 + at.c));
        pull(angle.a, slope * at.by_a(), out);
        pull(angle.b, slope * at.by_b(), out);
    }
}

/// out += second derivatives B by two ways; of two different ones the transpose, too.
void Springs::add_block(const PointShares& a, const PointShares& b, const Matrix3d& B,
                        BandMatrix& out)
{
    for (const auto& [row, of_row] : a)
        for (const auto& [column, of_column] : b)
        {
            if (&a == &b && row < column)
                continue;
            // One control point in two ways: its block gets B and the transpose.
            const bool is_twice = &a != &b && row == column;
            const double share = of_row * of_column;
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    if (row != column)
                        out.add(row + i, column + j, share * B(i, j));
                    else if (i >= j)
                        out.lower(row + i, column + j) +=
                            share * (is_twice ? B(i, j) + B(j, i) : B(i, j));
        }
}

void Springs::add_hessian(const RodState& state, RodHessian how, BandMatrix& out) const
{
    add_second_derivatives(distances_, state, how, out);
    for (const Angle& angle : angles_)
    {
        const Corner at = corner(angle, state.x());
        const double w = 1.0 + at.c;
        const double first = -4.0 * angle.stiffness / (w * w),
                     second = 8.0 * angle.stiffness / (w * w * w);
        const Matrix3d across_a = Matrix3d::Identity() - at.ta * at.ta.transpose(),
                       across_b = Matrix3d::Identity() - at.tb * at.tb.transpose();
        const Vector3d a = at.by_a(), b = at.by_b();
        Matrix3d aa = second * a * a.transpose(), ab = second * a * b.transpose(),
                 bb = second * b * b.transpose();
        ab += first / (at.la * at.lb) * across_a * across_b;
        if (how == RodHessian::Definite)
        {
            aa -= first / (at.la * at.la) * across_a;
            bb -= first / (at.lb * at.lb) * across_b;
        }
        else
        {
            aa -=
                first / at.la *
                (a * at.ta.transpose() + at.ta * a.transpose() + at.c / at.la * across_a);
            bb -=
                first / at.lb *
                (b * at.tb.transpose() + at.tb * b.transpose() + at.c / at.lb * across_b);
        }
        add_block(angle.a, angle.a, aa, out);
        add_block(angle.b, angle.b, bb, out);
        add_block(angle.a, angle.b, ab, out);
    }
}

void Springs::predict(const RodState& state, const Eigen::VectorXd* step)
{
    distances_.predict(state.x(), step);
}

void Springs::add_correction(const RodState& before, const RodState& after,
                             const Eigen::VectorXd& step, Eigen::VectorXd& out) const
{
    distances_.add_correction(before.x(), after.x(), step, out);
}

} // namespace

std::unique_ptr<RodTerm> spring_elasticity(const Rod& rod)
{
    return std::make_unique<Springs>(rod, springs_bend(rod));
}

bool springs_bend(const Rod& rod)
{
    for (const RodSpan& span : rod.spans())
        for (const double s : {span.begin, 0.5 * (span.begin + span.end), span.end})
            if (const Section section = rod.section_at(s);
                section.bending[0] != section.bending[1])
                return false;
    return rod.is_straight();
}

PointShares shares_of(const Rod& rod, const BasisValues& values, int order)
{
    PointShares out;
    for (int j = 0; j < values.count; ++j)
        if (const double share = values.value[idx(order)][idx(j)]; share != 0.0)
            out.emplace_back(rod.layout().control[idx(values.control[idx(j)])], share);
    std::sort(out.begin(), out.end());
    return out;
}

void add_second_derivatives(const DistanceSprings& springs, const RodState& state,
                            RodHessian how, BandMatrix& out)
{
    springs.for_each_block(state.x(),
                           how == RodHessian::Exact
                               ? DistanceSprings::Curvature::Exact
                               : DistanceSprings::Curvature::WithoutPushes,
                           [&](int row, int column, const Matrix3d& B)
                           {
                               for (int i = 0; i < 3; ++i)
                                   for (int j = 0; j < 3; ++j)
                                       if (row + i >= column + j)
                                           out.lower(row + i, column + j) += B(i, j);
                           });
}

} // namespace cellwarp::core
