// SPDX-License-Identifier: GPL-3.0-or-later
// Cells that do not pass through each other, as a term of an energy beside their glue.
// contact_term.cpp has the derivation.
#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "solver/cells/cell_state.h"
#include "solver/minimize/term.h"

namespace cellwarp::core
{

/// A point of one cell that is to stay before a plane of another one. Rest coordinates,
/// from the cells' centres.
struct CellContact
{
    int a = 0, b = 0;        ///< whose the point is, and the plane
    Eigen::Vector3d point;   ///< of a
    Eigen::Vector3d place;   ///< in the plane, of b
    Eigen::Vector3d outward; ///< of b, of length 1
    double stiffness = 0.0;  ///< [length], as of glue
};

/// How far the point is before its plane; negative: behind it [length].
double contact_gap(const CellContact& contact, const Pose& a, const Pose& b);
/// stiffness gap^2 where the gap is negative; else 0 [length^3].
double contact_energy(const CellContact& contact, const Pose& a, const Pose& b);

/// The contacts of all cells. Of second derivatives it gives J^T J alone: contacts are
/// found anew again and again, with their planes. Those with a cell that slides along a
/// curve count for nothing. One object serves one thread.
class ContactTerm final : public Term
{
public:
    /// \p state must outlive it.
    ContactTerm(const CellState& state, std::span<const CellContact> contacts);

    std::span<const std::pair<int, int>> pairs() const override { return pairs_; }
    double value() const override;
    void add_gradient(Eigen::VectorXd& out) const override;
    void add_rounding(std::span<double> out) const override;
    void linearise(Curvature curvature) override;
    void add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
    void add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const override;

private:
    /// The derivative of the gap in the twists of both cells.
    struct Slope
    {
        Twist a, b;
    };
    Slope slope(const CellContact& contact) const;
    double gap(const CellContact& contact) const
    {
        return contact_gap(contact, state_.pose(contact.a), state_.pose(contact.b));
    }
    /// Calls visit(unknown, its part of \p slope) for the cells that may move.
    template <class Visit>
    void for_unknowns(const CellContact& contact, const Slope& slope,
                      Visit&& visit) const;

    const CellState& state_;
    std::vector<CellContact> contacts_;
    std::vector<std::pair<int, int>> pairs_;
    std::vector<std::vector<std::size_t>> contacts_of_pair_, contacts_of_unknown_;
    // Of the last linearise():
    std::vector<Slope> slopes_;
    std::vector<double> weights_; ///< 2 stiffness; 0 where the gap is not negative
};

} // namespace cellwarp::core
