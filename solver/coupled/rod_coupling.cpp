// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/coupled/rod_coupling.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/base/index.h"
#include "solver/rods/elasticity.h"

namespace cellwarp
{

namespace
{

using Triplet = Eigen::Triplet<double>;

template <class Block>
void add_block(int row, int column, const Block& block, std::vector<Triplet>& out)
{
    for (Eigen::Index i = 0; i < block.rows(); ++i)
        for (Eigen::Index j = 0; j < block.cols(); ++j)
            out.emplace_back(row + static_cast<int>(i), column + static_cast<int>(j),
                             block(i, j));
}

} // namespace

RodCoupling::RodCoupling(const CellState& cells, const GlueTerm& glue,
                         const RodUnknowns& rods)
    : cells_(cells), glue_(glue), rods_(rods), carried_(idx(cells.num_cells()), -1)
{
    int number = 0;
    std::vector<int> rod_of_carried;
    for (std::size_t rod = 0; rod < rods.size(); ++rod)
    {
        for (const CarriedCell& cell : rods.rod(rod).cells)
        {
            carried_[idx(cell.cell)] = number++;
            rod_of_carried.push_back(static_cast<int>(rod));
        }
        RodModel& model =
            *models_.emplace_back(std::make_unique<RodModel>(rods.rod(rod).rest->rod()));
        model.terms.push_back(exact_elasticity(rods.rod(rod).rest->rod()));
    }
    const int first = rods.begin().block;
    for (const GlueFace& face : glue.glue().faces)
    {
        const int a = carried_[idx(face.a)], b = carried_[idx(face.b)];
        if (a < 0 && b < 0)
            continue;
        faces_.push_back(&face);
        const auto pair_with_cell = [&](int carried, int cell)
        {
            if (const int unknown = cells.unknown_of_cell(cell); unknown >= 0)
                pairs_.emplace_back(first + rod_of_carried[idx(carried)],
                                    cells.begin().block + unknown);
        };
        if (a >= 0 && b >= 0)
        {
            const int one = rod_of_carried[idx(a)], other = rod_of_carried[idx(b)];
            if (one != other)
                pairs_.emplace_back(first + std::max(one, other),
                                    first + std::min(one, other));
        }
        else if (a >= 0)
            pair_with_cell(a, face.b);
        else
            pair_with_cell(b, face.a);
    }
    std::sort(pairs_.begin(), pairs_.end());
    pairs_.erase(std::unique(pairs_.begin(), pairs_.end()), pairs_.end());
}

double RodCoupling::value() const
{
    if (rods_.is_too_far())
        return std::numeric_limits<double>::infinity(); // such a step is halved
    double sum = 0.0;
    for (std::size_t rod = 0; rod < rods_.size(); ++rod)
        sum += rods_.rod(rod).stiffness * models_[rod]->elastic_energy(rods_.state(rod));
    return sum;
}

Eigen::VectorXd RodCoupling::gradient_by_steps() const
{
    Eigen::VectorXd by_twists = Eigen::VectorXd::Zero(6 * rods_.num_carried());
    for (const GlueFace* face : faces_)
    {
        const Eigen::Matrix<double, 12, 1> gradient =
            glue_gradient(*face, cells_.pose(face->a), cells_.pose(face->b));
        if (const int a = carried_[idx(face->a)]; a >= 0)
            by_twists.segment<6>(6 * a) += gradient.head<6>();
        if (const int b = carried_[idx(face->b)]; b >= 0)
            by_twists.segment<6>(6 * b) += gradient.tail<6>();
    }
    Eigen::VectorXd out = rods_.twists().transpose() * by_twists;
    Eigen::VectorXd own;
    for (std::size_t rod = 0; rod < rods_.size(); ++rod)
    {
        models_[rod]->gradient(rods_.state(rod), own);
        out.segment(rods_.first(rod), own.size()) += rods_.rod(rod).stiffness * own;
    }
    return out;
}

void RodCoupling::add_gradient(Eigen::VectorXd& out) const
{
    out.segment(rods_.begin().unknown, rods_.num_unknowns()) +=
        rods_.steps().transpose() * gradient_by_steps();
}

void RodCoupling::add_rounding(std::span<double> out) const
{
    std::vector<double> sizes(idx(rods_.num_carried()), 0.0);
    for (const GlueFace* face : faces_)
        for (const int cell : {face->a, face->b})
            if (const int c = carried_[idx(cell)]; c >= 0)
                sizes[idx(c)] +=
                    2.0 * face->stiffness *
                    (cells_.pose(face->a).p.norm() + cells_.pose(face->b).p.norm());
    const Eigen::VectorXd stiffness = elastic(RodHessian::Definite).diagonal();
    std::size_t next = 0;
    for (std::size_t rod = 0; rod < rods_.size(); ++rod)
    {
        double sum = 0.0;
        for (std::size_t k = 0; k < rods_.rod(rod).cells.size(); ++k)
            sum += sizes[next++];
        const Eigen::VectorXd& x = rods_.state(rod).x();
        sum += stiffness.segment(rods_.first(rod), x.size())
                   .cwiseProduct(x.cwiseAbs())
                   .norm();
        out[idx(rods_.begin().block) + rod] +=
            4.0 * std::numeric_limits<double>::epsilon() * sum;
    }
}

/// By control points and angles.
SparseMatrix RodCoupling::elastic(RodHessian how) const
{
    std::vector<Triplet> out;
    for (std::size_t rod = 0; rod < rods_.size(); ++rod)
    {
        const RodLayout& layout = rods_.state(rod).rod().layout();
        BandMatrix band(layout.num_unknowns, layout.half_band);
        models_[rod]->hessian(rods_.state(rod), how, band);
        const int first = rods_.first(rod);
        for (int column = 0; column < band.rows(); ++column)
            for (int row = column;
                 row < std::min(band.rows(), column + band.half_band() + 1); ++row)
            {
                const double value = rods_.rod(rod).stiffness * band.lower(row, column);
                if (value == 0.0)
                    continue;
                out.emplace_back(first + row, first + column, value);
                if (row != column)
                    out.emplace_back(first + column, first + row, value);
            }
    }
    SparseMatrix matrix(rods_.num_unknowns(), rods_.num_unknowns());
    matrix.setFromTriplets(out.begin(), out.end());
    return matrix;
}

void RodCoupling::linearise(Curvature curvature)
{
    const int num_cell_unknowns = rods_.begin().unknown - cells_.begin().unknown;
    std::vector<Triplet> among, with;
    for (const GlueFace* face : faces_)
    {
        const Pose &pose_a = cells_.pose(face->a), &pose_b = cells_.pose(face->b);
        const int a = carried_[idx(face->a)], b = carried_[idx(face->b)];
        const Eigen::Matrix<double, 6, 6> coupling =
            glue_coupling(*face, pose_a, pose_b).matrix();
        if (a >= 0)
            add_block(6 * a, 6 * a, glue_diagonal_a(*face, pose_a, pose_b, curvature),
                      among);
        if (b >= 0)
            add_block(6 * b, 6 * b, glue_diagonal_b(*face, pose_a, pose_b, curvature),
                      among);
        if (a >= 0 && b >= 0)
        {
            add_block(6 * a, 6 * b, coupling, among);
            add_block(6 * b, 6 * a, coupling.transpose(), among);
            continue;
        }
        const int unknown = cells_.unknown_of_cell(a >= 0 ? face->b : face->a);
        if (unknown < 0)
            continue;
        const CellState::Basis basis = glue_.basis(unknown);
        const int column = cells_.first(unknown) - cells_.begin().unknown;
        if (a >= 0)
            add_block(6 * a, column, (coupling * basis).eval(), with);
        else
            add_block(6 * b, column, (coupling.transpose() * basis).eval(), with);
    }
    const int num_twists = 6 * rods_.num_carried();
    SparseMatrix glue(num_twists, num_twists), to_cells(num_twists, num_cell_unknowns);
    glue.setFromTriplets(among.begin(), among.end());
    to_cells.setFromTriplets(with.begin(), with.end());
    const SparseMatrix twists = rods_.twists() * rods_.steps();
    const SparseMatrix back = twists.transpose();
    const SparseMatrix glue_of_twists = glue * twists;
    const SparseMatrix steps_back = rods_.steps().transpose();
    const SparseMatrix of_steps =
        elastic(curvature.share > 0.0 ? RodHessian::Exact : RodHessian::Definite) *
        rods_.steps();
    among_rods_ = back * glue_of_twists + steps_back * of_steps;
    with_cells_ = back * to_cells;
    // What holds have taken does nothing: any stiffness keeps the matrix definite.
    const double stiffness = among_rods_.diagonal().cwiseAbs().maxCoeff();
    std::vector<Triplet> idle;
    for (int unknown = 0; unknown < rods_.num_unknowns(); ++unknown)
        if (rods_.is_taken(unknown))
            idle.emplace_back(unknown, unknown, stiffness > 0.0 ? stiffness : 1.0);
    SparseMatrix held(rods_.num_unknowns(), rods_.num_unknowns());
    held.setFromTriplets(idle.begin(), idle.end());
    among_rods_ += held;
}

void RodCoupling::add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const
{
    const auto own = x.segment(rods_.begin().unknown, rods_.num_unknowns());
    const Eigen::Index first = cells_.begin().unknown, count = with_cells_.cols();
    y.segment(rods_.begin().unknown, rods_.num_unknowns()) +=
        among_rods_ * own + with_cells_ * x.segment(first, count);
    y.segment(first, count) += with_cells_.transpose() * own;
}

void RodCoupling::add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const int rod = rod_of(block);
    if (rod < 0 || rod >= static_cast<int>(rods_.size()))
        return;
    const int first = rods_.first(idx(rod));
    out += among_rods_.block(first, first, out.rows(), out.cols());
}

void RodCoupling::add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const auto& [row, column] = pairs_[idx(pair)];
    const int first = rods_.first(idx(rod_of(row)));
    if (const int other = rod_of(column); other >= 0)
        out += among_rods_.block(first, rods_.first(idx(other)), out.rows(), out.cols());
    else
        out += with_cells_.block(
            first, cells_.first(column - cells_.begin().block) - cells_.begin().unknown,
            out.rows(), out.cols());
}

} // namespace cellwarp
