// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/coupled/rod_coupling.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "octree/base/index.h"
#include "solver/rods/elasticity.h"

namespace cellwarp::core
{

namespace
{

Eigen::SparseMatrix<double> matrix_of(const std::vector<Eigen::Triplet<double>>& entries,
                                      Eigen::Index rows, Eigen::Index columns)
{
    Eigen::SparseMatrix<double> out(rows, columns);
    out.setFromTriplets(entries.begin(), entries.end());
    return out;
}

} // namespace

RodCoupling::RodCoupling(const CellState& cells, const GlueTerm& glue,
                         const RodUnknowns& rods)
    : cells_(cells), glue_(glue), rods_(rods)
{
    std::vector<int> carried(idx(cells.num_cells()), -1);
    for (std::size_t rod = 0; rod < rods.size(); ++rod)
    {
        for (const CarriedCell& cell : rods.rod(rod).cells)
        {
            carried[idx(cell.cell)] = static_cast<int>(rod_of_carried_.size());
            rod_of_carried_.push_back(rod);
        }
        RodModel& model =
            *models_.emplace_back(std::make_unique<RodModel>(rods.rod(rod).rest->rod()));
        model.terms.push_back(exact_elasticity(rods.rod(rod).rest->rod()));
        const RodLayout& layout = rods.rod(rod).rest->rod().layout();
        elastic_.emplace_back(layout.num_unknowns, layout.half_band);
    }
    const auto block_of = [&](int number)
    { return rods.begin().block + static_cast<int>(rod_of_carried_[idx(number)]); };
    std::map<std::pair<int, int>, std::vector<int>> faces_of_pair;
    for (const GlueFace& glued : glue.glue().faces)
    {
        Face face;
        face.glue = &glued;
        face.a = carried[idx(glued.a)];
        face.b = carried[idx(glued.b)];
        if (face.a < 0 && face.b < 0)
            continue;
        std::pair<int, int> pair = {-1, -1};
        if (face.a >= 0 && face.b >= 0)
            pair = {std::max(block_of(face.a), block_of(face.b)),
                    std::min(block_of(face.a), block_of(face.b))};
        else
        {
            face.unknown = cells.unknown_of_cell(face.a >= 0 ? glued.b : glued.a);
            if (face.unknown != UnknownCell::None)
                pair = {block_of(std::max(face.a, face.b)), cells.block(face.unknown)};
        }
        if (pair.first != pair.second)
            faces_of_pair[pair].push_back(static_cast<int>(faces_.size()));
        faces_.push_back(face);
    }
    for (auto& [pair, faces] : faces_of_pair)
    {
        pairs_.push_back(pair);
        faces_of_pair_.push_back(std::move(faces));
    }
    diagonals_.resize(rod_of_carried_.size());
    twists_.resize(rod_of_carried_.size());
    forces_.resize(rod_of_carried_.size());
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
    std::fill(forces_.begin(), forces_.end(), Twist::Zero());
    for (const Face& face : faces_)
    {
        const Eigen::Matrix<double, 12, 1> gradient = glue_gradient(
            *face.glue, cells_.pose(face.glue->a), cells_.pose(face.glue->b));
        if (face.a >= 0)
            forces_[idx(face.a)] += gradient.head<6>();
        if (face.b >= 0)
            forces_[idx(face.b)] += gradient.tail<6>();
    }
    Eigen::VectorXd out = Eigen::VectorXd::Zero(rods_.num_unknowns()), own;
    add_back(out);
    for (std::size_t rod = 0; rod < rods_.size(); ++rod)
    {
        models_[rod]->gradient(rods_.state(rod), own);
        out.segment(rods_.first(rod), own.size()) += rods_.rod(rod).stiffness * own;
    }
    return out;
}

/// To the derivatives by the steps: forces_, those by the twists.
void RodCoupling::add_back(Eigen::VectorXd& by_steps) const
{
    for (std::size_t c = 0; c < forces_.size(); ++c)
    {
        const CarriedTwist& twist = rods_.twists()[c];
        for (std::size_t k = 0; k < twist.steps.size(); ++k)
            by_steps[twist.steps[k]] +=
                twist.by_steps.col(static_cast<Eigen::Index>(k)).dot(forces_[c]);
    }
}

void RodCoupling::add_gradient(Eigen::VectorXd& out) const
{
    out.segment(rods_.begin().unknown, rods_.num_unknowns()) +=
        rods_.steps().transpose() * gradient_by_steps();
}

void RodCoupling::add_rounding(std::span<double> out) const
{
    constexpr double kEpsilon = 4.0 * std::numeric_limits<double>::epsilon();
    const std::size_t first = idx(rods_.begin().block);
    for (const Face& face : faces_)
        for (const int number : {face.a, face.b})
            if (number >= 0)
                out[first + rod_of_carried_[idx(number)]] +=
                    kEpsilon * 2.0 * face.glue->stiffness *
                    (cells_.pose(face.glue->a).p.norm() +
                     cells_.pose(face.glue->b).p.norm());
    for (std::size_t rod = 0; rod < rods_.size(); ++rod)
    {
        const RodState& state = rods_.state(rod);
        BandMatrix band(static_cast<int>(state.x().size()),
                        state.rod().layout().half_band);
        models_[rod]->hessian(state, RodHessian::Definite, band);
        double sum = 0.0;
        for (int k = 0; k < band.rows(); ++k)
            sum += std::pow(band.lower(k, k) * state.x()[k], 2);
        out[first + rod] += kEpsilon * rods_.rod(rod).stiffness * std::sqrt(sum);
    }
}

void RodCoupling::linearise(Curvature curvature)
{
    std::fill(diagonals_.begin(), diagonals_.end(), Eigen::Matrix<double, 6, 6>::Zero());
    for (Face& face : faces_)
    {
        const GlueFace& glue = *face.glue;
        const Pose &a = cells_.pose(glue.a), &b = cells_.pose(glue.b);
        face.coupling = glue_coupling(glue, a, b).matrix();
        if (face.a >= 0)
            diagonals_[idx(face.a)] += glue_diagonal_a(glue, a, b, curvature).matrix();
        if (face.b >= 0)
            diagonals_[idx(face.b)] += glue_diagonal_b(glue, a, b, curvature).matrix();
        if (face.unknown != UnknownCell::None)
            face.basis = glue_.basis(face.unknown);
    }
    idle_ = 0.0;
    for (std::size_t rod = 0; rod < rods_.size(); ++rod)
    {
        models_[rod]->hessian(rods_.state(rod),
                              curvature.share > 0.0 ? RodHessian::Exact
                                                    : RodHessian::Definite,
                              elastic_[rod]);
        for (int k = 0; k < elastic_[rod].rows(); ++k)
            idle_ = std::max(idle_, rods_.rod(rod).stiffness *
                                        std::abs(elastic_[rod].lower(k, k)));
    }
    if (!(idle_ > 0.0))
        idle_ = 1.0;
}

void RodCoupling::add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const
{
    const auto own = x.segment(rods_.begin().unknown, rods_.num_unknowns());
    steps_.noalias() = rods_.steps() * own;
    for (std::size_t c = 0; c < twists_.size(); ++c)
    {
        const CarriedTwist& twist = rods_.twists()[c];
        twists_[c].setZero();
        for (std::size_t k = 0; k < twist.steps.size(); ++k)
            twists_[c] +=
                steps_[twist.steps[k]] * twist.by_steps.col(static_cast<Eigen::Index>(k));
        forces_[c].noalias() = diagonals_[c] * twists_[c];
    }
    for (const Face& face : faces_)
    {
        if (face.a >= 0 && face.b >= 0)
        {
            forces_[idx(face.a)] += face.coupling * twists_[idx(face.b)];
            forces_[idx(face.b)] += face.coupling.transpose() * twists_[idx(face.a)];
        }
        else if (face.unknown != UnknownCell::None)
        {
            const Eigen::Index at = cells_.first(face.unknown), size = face.basis.cols();
            const Twist other = face.basis * x.segment(at, size);
            if (face.a >= 0)
            {
                forces_[idx(face.a)] += face.coupling * other;
                y.segment(at, size) += face.basis.transpose() *
                                       (face.coupling.transpose() * twists_[idx(face.a)]);
            }
            else
            {
                forces_[idx(face.b)] += face.coupling.transpose() * other;
                y.segment(at, size) +=
                    face.basis.transpose() * (face.coupling * twists_[idx(face.b)]);
            }
        }
    }
    by_steps_.setZero(rods_.num_unknowns());
    add_back(by_steps_);
    for (std::size_t rod = 0; rod < rods_.size(); ++rod)
    {
        const Eigen::Index first = rods_.first(rod), size = elastic_[rod].rows();
        own_steps_ = steps_.segment(first, size);
        elastic_[rod].multiply(own_steps_, part_);
        by_steps_.segment(first, size) += rods_.rod(rod).stiffness * part_;
    }
    auto out = y.segment(rods_.begin().unknown, rods_.num_unknowns());
    out += rods_.steps().transpose() * by_steps_;
    for (int k = 0; k < rods_.num_unknowns(); ++k)
        if (rods_.is_taken(k))
            out[k] += idle_ * own[k];
}

/// out += J_row^T H J_column of two carried cells, by the steps from \p first and
/// \p first_column on.
void RodCoupling::add_between(const CarriedTwist& row,
                              const Eigen::Matrix<double, 6, 6>& H,
                              const CarriedTwist& column, int first, int first_column,
                              Entries& out) const
{
    const Eigen::MatrixXd block = row.by_steps.transpose() * H * column.by_steps;
    for (std::size_t i = 0; i < row.steps.size(); ++i)
        for (std::size_t j = 0; j < column.steps.size(); ++j)
            out.emplace_back(
                row.steps[i] - first, column.steps[j] - first_column,
                block(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)));
}

/// The unknowns of a rod and their steps.
Eigen::SparseMatrix<double> RodCoupling::steps_of(std::size_t rod) const
{
    const int first = rods_.first(rod), size = rods_.first(rod + 1) - first;
    return rods_.steps().block(first, first, size, size);
}

void RodCoupling::add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const int number = rod_of(block);
    if (number < 0 || number >= static_cast<int>(rods_.size()))
        return;
    const std::size_t rod = idx(number);
    const int first = rods_.first(rod);
    Entries entries;
    for (std::size_t c = 0; c < diagonals_.size(); ++c)
        if (rod_of_carried_[c] == rod)
            add_between(rods_.twists()[c], diagonals_[c], rods_.twists()[c], first, first,
                        entries);
    for (const Face& face : faces_)
        if (face.a >= 0 && face.b >= 0 && rod_of_carried_[idx(face.a)] == rod &&
            rod_of_carried_[idx(face.b)] == rod)
        {
            add_between(twist(face.a), face.coupling, twist(face.b), first, first,
                        entries);
            add_between(twist(face.b), face.coupling.transpose(), twist(face.a), first,
                        first, entries);
        }
    const BandMatrix& band = elastic_[rod];
    for (int column = 0; column < band.rows(); ++column)
        for (int row = column; row < std::min(band.rows(), column + band.half_band() + 1);
             ++row)
        {
            const double value = rods_.rod(rod).stiffness * band.lower(row, column);
            entries.emplace_back(row, column, value);
            if (row != column)
                entries.emplace_back(column, row, value);
        }
    const Eigen::SparseMatrix<double> steps = steps_of(rod);
    const Eigen::SparseMatrix<double> right =
        matrix_of(entries, out.rows(), out.cols()) * steps;
    out += Eigen::SparseMatrix<double>(steps.transpose() * right);
    for (Eigen::Index k = 0; k < out.rows(); ++k)
        if (rods_.is_taken(first + static_cast<int>(k)))
            out(k, k) += idle_;
}

void RodCoupling::add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const auto& [row, column] = pairs_[idx(pair)];
    const std::size_t rod = idx(rod_of(row));
    const int first = rods_.first(rod);
    Entries entries;
    const int other = rod_of(column);
    for (const int f : faces_of_pair_[idx(pair)])
    {
        const Face& face = faces_[idx(f)];
        const bool is_a = face.a >= 0 && rod_of_carried_[idx(face.a)] == rod;
        const Eigen::Matrix<double, 6, 6> H =
            is_a ? face.coupling : Eigen::Matrix<double, 6, 6>(face.coupling.transpose());
        const CarriedTwist& own = twist(is_a ? face.a : face.b);
        if (other >= 0)
        {
            add_between(own, H, twist(is_a ? face.b : face.a), first,
                        rods_.first(idx(other)), entries);
            continue;
        }
        const Eigen::MatrixXd block = own.by_steps.transpose() * (H * face.basis);
        for (std::size_t i = 0; i < own.steps.size(); ++i)
            for (Eigen::Index j = 0; j < block.cols(); ++j)
                entries.emplace_back(own.steps[i] - first, static_cast<int>(j),
                                     block(static_cast<Eigen::Index>(i), j));
    }
    Eigen::SparseMatrix<double> product = matrix_of(entries, out.rows(), out.cols());
    if (other >= 0)
        product = product * steps_of(idx(other));
    out += Eigen::SparseMatrix<double>(steps_of(rod).transpose() * product);
}

} // namespace cellwarp::core
