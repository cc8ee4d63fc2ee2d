// SPDX-License-Identifier: GPL-3.0-or-later
// The point q = p_a + R_a x of cell a and the plane through s = p_b + R_b y of cell b,
// with the normal n = R_b n_0, have the gap
//   g = n . (q - s)
// and the energy k min(0, g)^2: none before the plane, and of it the first derivative is
// continuous. With the twists (omega, v) of both cells
//   dg = n . (v_a + omega_a x (q - p_a) - v_b - omega_b x (s - p_b))
//        + (omega_b x n) . (q - s)
//      = n . v_a + ((q - p_a) x n) . omega_a - n . v_b - ((q - p_b) x n) . omega_b
// so that what b takes is the opposite of what a gives, at the same point q.
#include "solver/cells/contact_term.h"

#include <algorithm>
#include <limits>
#include <map>

#include <Eigen/Geometry>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

Eigen::Vector3d point_now(const CellContact& contact, const Pose& a)
{
    return a.p + a.R * contact.point;
}

} // namespace

double contact_gap(const CellContact& contact, const Pose& a, const Pose& b)
{
    return (b.R * contact.outward).dot(point_now(contact, a) - b.p - b.R * contact.place);
}

double contact_energy(const CellContact& contact, const Pose& a, const Pose& b)
{
    const double depth = std::min(0.0, contact_gap(contact, a, b));
    return contact.stiffness * depth * depth;
}

ContactTerm::ContactTerm(const CellState& state, std::span<const CellContact> contacts)
    : state_(state), contacts_of_unknown_(state.num_unknown_cells())
{
    const auto slides = [&](int cell)
    {
        const UnknownCell unknown = state.unknown_of_cell(cell);
        return unknown != UnknownCell::None && state.is_sliding(unknown);
    };
    std::map<std::pair<int, int>, std::vector<std::size_t>> of_pair;
    for (const CellContact& contact : contacts)
    {
        if (slides(contact.a) || slides(contact.b))
            continue;
        const UnknownCell a = state.unknown_of_cell(contact.a);
        const UnknownCell b = state.unknown_of_cell(contact.b);
        if (a == UnknownCell::None && b == UnknownCell::None)
            continue;
        for (const UnknownCell unknown : {a, b})
            if (unknown != UnknownCell::None)
                contacts_of_unknown_[idx(unknown)].push_back(contacts_.size());
        if (a != UnknownCell::None && b != UnknownCell::None)
            of_pair[{state.block(std::max(a, b)), state.block(std::min(a, b))}].push_back(
                contacts_.size());
        contacts_.push_back(contact);
    }
    for (auto& [pair, own] : of_pair)
    {
        pairs_.push_back(pair);
        contacts_of_pair_.push_back(std::move(own));
    }
    slopes_.resize(contacts_.size());
    weights_.resize(contacts_.size());
}

ContactTerm::Slope ContactTerm::slope(const CellContact& contact) const
{
    const Pose &a = state_.pose(contact.a), &b = state_.pose(contact.b);
    const Eigen::Vector3d n = b.R * contact.outward;
    const Eigen::Vector3d q = point_now(contact, a);
    Slope slope;
    slope.a << (q - a.p).cross(n), n;
    slope.b << -(q - b.p).cross(n), -n;
    return slope;
}

template <class Visit>
void ContactTerm::for_unknowns(const CellContact& contact, const Slope& slope,
                               Visit&& visit) const
{
    if (const UnknownCell a = state_.unknown_of_cell(contact.a); a != UnknownCell::None)
        visit(a, slope.a);
    if (const UnknownCell b = state_.unknown_of_cell(contact.b); b != UnknownCell::None)
        visit(b, slope.b);
}

double ContactTerm::value() const
{
    double sum = 0.0;
    for (const CellContact& contact : contacts_)
        sum += contact_energy(contact, state_.pose(contact.a), state_.pose(contact.b));
    return sum;
}

void ContactTerm::add_gradient(Eigen::VectorXd& out) const
{
    for (const CellContact& contact : contacts_)
    {
        const double depth = gap(contact);
        if (!(depth < 0.0))
            continue;
        const double force = 2.0 * contact.stiffness * depth;
        for_unknowns(contact, slope(contact),
                     [&](UnknownCell unknown, const Twist& own) {
                         state_.add_body(unknown, force * own,
                                         out.data() + state_.first(unknown));
                     });
    }
}

void ContactTerm::add_rounding(std::span<double> out) const
{
    const std::size_t first = idx(state_.begin().block);
    for (const CellContact& contact : contacts_)
        for_unknowns(
            contact, {},
            [&](UnknownCell unknown, const Twist&)
            {
                out[first + idx(unknown)] +=
                    8.0 * std::numeric_limits<double>::epsilon() * contact.stiffness *
                    (state_.pose(contact.a).p.norm() + state_.pose(contact.b).p.norm());
            });
}

void ContactTerm::linearise(Curvature)
{
    for (std::size_t k = 0; k < contacts_.size(); ++k)
    {
        slopes_[k] = slope(contacts_[k]);
        weights_[k] = gap(contacts_[k]) < 0.0 ? 2.0 * contacts_[k].stiffness : 0.0;
    }
}

void ContactTerm::add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const
{
    for (std::size_t k = 0; k < contacts_.size(); ++k)
    {
        if (weights_[k] == 0.0)
            continue;
        double change = 0.0; // of the gap
        for_unknowns(contacts_[k], slopes_[k],
                     [&](UnknownCell unknown, const Twist& own) {
                         change += own.dot(
                             state_.world(unknown, x.data() + state_.first(unknown)));
                     });
        for_unknowns(contacts_[k], slopes_[k],
                     [&](UnknownCell unknown, const Twist& own)
                     {
                         state_.add_body(unknown, weights_[k] * change * own,
                                         y.data() + state_.first(unknown));
                     });
    }
}

void ContactTerm::add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const UnknownCell unknown = state_.unknown_of_block(block);
    if (unknown == UnknownCell::None)
        return;
    for (const std::size_t k : contacts_of_unknown_[idx(unknown)])
        for_unknowns(contacts_[k], slopes_[k],
                     [&](UnknownCell one, const Twist& own)
                     {
                         if (one != unknown)
                             return;
                         const Eigen::VectorXd row =
                             state_.basis(unknown).transpose() * own;
                         out.noalias() += weights_[k] * row * row.transpose();
                     });
}

void ContactTerm::add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const UnknownCell row = state_.unknown_of_block(pairs_[idx(pair)].first);
    const UnknownCell column = state_.unknown_of_block(pairs_[idx(pair)].second);
    for (const std::size_t k : contacts_of_pair_[idx(pair)])
    {
        const bool is_row_a = state_.unknown_of_cell(contacts_[k].a) == row;
        const Slope& slope = slopes_[k];
        const Eigen::VectorXd left =
            state_.basis(row).transpose() * (is_row_a ? slope.a : slope.b);
        const Eigen::VectorXd right =
            state_.basis(column).transpose() * (is_row_a ? slope.b : slope.a);
        out.noalias() += weights_[k] * left * right.transpose();
    }
}

} // namespace cellwarp::core
