// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/glue_term.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Proximal term on rotations that nothing holds, relative to the diagonal: it
/// vanishes with the step and so does not change the solution.
constexpr double kProximal = 1e-3;

} // namespace

GlueTerm::GlueTerm(const CellState& state, const Glue& glue,
                   std::span<const Component> components)
    : state_(state), glue_(glue)
{
    const std::size_t unknowns = state.num_unknown_cells();
    turns_freely_.assign(unknowns, false);
    for (const Component& component : components)
        if (component.free_rotations > 0)
            for (const int cell : component.cells)
            {
                const UnknownCell unknown = state.unknown_of_cell(cell);
                if (unknown != UnknownCell::None &&
                    (state.is_pinned(unknown) || state.is_sliding(unknown)))
                    turns_freely_[idx(unknown)] = true;
            }
    sides_.reserve(glue_.faces_of_cell.size());
    for (int cell = 0; cell < state.num_cells(); ++cell)
        for (int k = glue_.first_face[idx(cell)]; k < glue_.first_face[idx(cell) + 1];
             ++k)
        {
            const int f = glue_.faces_of_cell[idx(k)];
            const GlueFace& face = glue_.faces[idx(f)];
            const bool is_a = face.a == cell;
            sides_.push_back({f, is_a ? face.b : face.a, is_a});
        }
    std::vector<std::pair<std::pair<int, int>, int>> faces;
    for (std::size_t f = 0; f < glue_.faces.size(); ++f)
    {
        const UnknownCell a = state.unknown_of_cell(glue_.faces[f].a);
        const UnknownCell b = state.unknown_of_cell(glue_.faces[f].b);
        if (a != UnknownCell::None && b != UnknownCell::None)
            faces.push_back({{state.block(std::max(a, b)), state.block(std::min(a, b))},
                             static_cast<int>(f)});
    }
    std::sort(faces.begin(), faces.end());
    for (const auto& [pair, face] : faces)
    {
        if (pairs_.empty() || pairs_.back() != pair)
        {
            pairs_.push_back(pair);
            first_of_pair_.push_back(static_cast<int>(faces_of_pair_.size()));
        }
        faces_of_pair_.push_back(face);
    }
    first_of_pair_.push_back(static_cast<int>(faces_of_pair_.size()));
    diagonals_.resize(unknowns);
    proximal_.assign(unknowns, 0.0);
    for (const UnknownCell unknown : state.unknown_cells())
        if (state.is_sliding(unknown))
            sliding_.resize(unknowns);
    couplings_.resize(glue_.faces.size());
    face_values_.resize(glue_.faces.size());
    face_gradients_.resize(glue_.faces.size());
    twists_.assign(idx(state.num_cells()), Twist::Zero());
}

std::span<const GlueTerm::Side> GlueTerm::sides_of(int cell) const
{
    const std::size_t c = idx(cell);
    const std::size_t first = idx(glue_.first_face[c]);
    const std::size_t end = idx(glue_.first_face[c + 1]);
    return std::span(sides_).subspan(first, end - first);
}

double GlueTerm::value() const
{
    parallel_for(glue_.faces.size(), kSmallBodies,
                 [&](std::size_t f)
                 {
                     const GlueFace& face = glue_.faces[f];
                     face_values_[f] =
                         glue_energy(face, state_.pose(face.a), state_.pose(face.b));
                 });
    double sum = 0.0;
    for (const double value : face_values_)
        sum += value;
    return sum;
}

void GlueTerm::find_face_gradients() const
{
    parallel_for(glue_.faces.size(), kSmallBodies,
                 [&](std::size_t f)
                 {
                     const GlueFace& face = glue_.faces[f];
                     face_gradients_[f] =
                         glue_gradient(face, state_.pose(face.a), state_.pose(face.b));
                 });
}

void GlueTerm::add_gradient(Eigen::VectorXd& out) const
{
    find_face_gradients();
    parallel_for(state_.num_unknown_cells(), kSmallBodies,
                 [&](std::size_t u)
                 {
                     const UnknownCell unknown{static_cast<int>(u)};
                     const int cell = state_.cell_of_unknown(unknown);
                     Twist sum = Twist::Zero();
                     for (const Side& side : sides_of(cell))
                         sum += face_gradients_[idx(side.face)].segment<6>(side.is_a ? 0
                                                                                     : 6);
                     double* const own = out.data() + state_.first(unknown);
                     const int slide = state_.num_turns(unknown);
                     const double before = state_.is_sliding(unknown) ? own[slide] : 0.0;
                     state_.add_body(unknown, sum, own);
                     if (is_stopped(unknown, sum))
                         own[slide] = before;
                 });
}

/// Whether the end of its curve keeps a sliding cell, by the derivative of its twist.
bool GlueTerm::is_stopped(UnknownCell unknown, const Twist& gradient) const
{
    return state_.is_sliding(unknown) &&
           state_.is_stopped(unknown, -state_.along(unknown).dot(gradient.tail<3>()));
}

double GlueTerm::uncancelled() const
{
    find_face_gradients();
    double sum = 0.0;
    for (const UnknownCell unknown : state_.unknown_cells())
    {
        const int cell = state_.cell_of_unknown(unknown);
        double forces = 0.0;
        for (const Side& side : sides_of(cell))
            forces +=
                face_gradients_[idx(side.face)].segment<6>(side.is_a ? 0 : 6).norm();
        sum += forces * forces;
    }
    return std::sqrt(sum);
}

void GlueTerm::add_rounding(std::span<double> out) const
{
    const std::size_t first = idx(state_.begin().block);
    for (const UnknownCell unknown : state_.unknown_cells())
    {
        double sizes = 0.0;
        for (const Side& side : sides_of(state_.cell_of_unknown(unknown)))
        {
            const GlueFace& face = glue_.faces[idx(side.face)];
            sizes += 2.0 * face.stiffness *
                     (state_.pose(face.a).p.norm() + state_.pose(face.b).p.norm());
        }
        out[first + idx(unknown)] += 4.0 * std::numeric_limits<double>::epsilon() * sizes;
    }
}

void GlueTerm::linearise(Curvature curvature)
{
    parallel_for(glue_.faces.size(), kSmallBodies,
                 [&](std::size_t f)
                 {
                     const GlueFace& face = glue_.faces[f];
                     couplings_[f] =
                         glue_coupling(face, state_.pose(face.a), state_.pose(face.b));
                 });
    parallel_for(diagonals_.size(), kSmallBodies,
                 [&](std::size_t u)
                 {
                     const UnknownCell unknown{static_cast<int>(u)};
                     const int cell = state_.cell_of_unknown(unknown);
                     GlueBlock& sum = diagonals_[u];
                     sum = GlueBlock::zero();
                     for (const Side& side : sides_of(cell))
                     {
                         const GlueFace& face = glue_.faces[idx(side.face)];
                         const Pose& a = state_.pose(face.a);
                         const Pose& b = state_.pose(face.b);
                         sum += side.is_a ? glue_diagonal_a(face, a, b, curvature)
                                          : glue_diagonal_b(face, a, b, curvature);
                     }
                     find_sliding(unknown, curvature);
                     proximal_[u] = turns_freely_[u]
                                        ? kProximal * std::abs(sum.turn.trace()) / 3.0
                                        : 0.0;
                 });
}

/// What the curve of a sliding cell adds: cell_state.cpp.
void GlueTerm::find_sliding(UnknownCell unknown, Curvature curvature)
{
    if (!state_.is_sliding(unknown))
        return;
    const int cell = state_.cell_of_unknown(unknown);
    Twist sum = Twist::Zero();
    for (const Side& side : sides_of(cell))
    {
        const GlueFace& face = glue_.faces[idx(side.face)];
        sum += glue_gradient(face, state_.pose(face.a), state_.pose(face.b))
                   .segment<6>(side.is_a ? 0 : 6);
    }
    const Eigen::Vector3d force = sum.tail<3>();
    Sliding& own = sliding_[idx(unknown)];
    own.is_stopped = is_stopped(unknown, sum);
    own.stiffness = own.is_stopped ? diagonals_[idx(unknown)].shift
                                   : curvature.share * force.dot(state_.bend(unknown));
    own.turn = own.is_stopped ? Eigen::Vector3d::Zero().eval()
                              : Eigen::Vector3d(-0.5 * curvature.share *
                                                (state_.pose(cell).R.transpose() *
                                                 state_.along(unknown).cross(force)));
}

void GlueTerm::add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const
{
    parallel_for(state_.num_unknown_cells(), kSmallBodies,
                 [&](std::size_t u)
                 {
                     const UnknownCell unknown{static_cast<int>(u)};
                     Twist& twist = twists_[idx(state_.cell_of_unknown(unknown))];
                     const double* const own = x.data() + state_.first(unknown);
                     twist = state_.world(unknown, own);
                     if (state_.is_sliding(unknown) && sliding_[idx(unknown)].is_stopped)
                         twist.tail<3>() -=
                             own[state_.num_turns(unknown)] * state_.along(unknown);
                 });
    parallel_for(diagonals_.size(), kSmallBodies,
                 [&](std::size_t u)
                 {
                     const UnknownCell unknown{static_cast<int>(u)};
                     const int cell = state_.cell_of_unknown(unknown);
                     Twist sum = Twist::Zero();
                     diagonals_[u].add_product(twists_[idx(cell)], sum);
                     for (const Side& side : sides_of(cell))
                     {
                         const GlueBlock& coupling = couplings_[idx(side.face)];
                         const Twist& other = twists_[idx(side.other)];
                         if (side.is_a)
                             coupling.add_product(other, sum);
                         else
                             coupling.add_transposed_product(other, sum);
                     }
                     const double* const x_block = x.data() + state_.first(unknown);
                     double* const y_block = y.data() + state_.first(unknown);
                     for (int k = 0; k < state_.block_sizes()[u]; ++k)
                         y_block[k] += proximal_[u] * x_block[k];
                     if (!state_.is_sliding(unknown))
                     {
                         state_.add_body(unknown, sum, y_block);
                         return;
                     }
                     const Sliding& sliding = sliding_[u];
                     const int slide = state_.num_turns(unknown);
                     const double before = y_block[slide];
                     state_.add_body(unknown, sum, y_block);
                     if (sliding.is_stopped)
                         y_block[slide] = before;
                     y_block[slide] += sliding.stiffness * x_block[slide];
                     for (int k = 0; k < slide; ++k)
                     {
                         const double turn = turn_of_slide(unknown, k);
                         y_block[k] += turn * x_block[slide];
                         y_block[slide] += turn * x_block[k];
                     }
                 });
}

CellState::Basis GlueTerm::basis(UnknownCell unknown) const
{
    CellState::Basis basis = state_.basis(unknown);
    if (state_.is_sliding(unknown) && sliding_[idx(unknown)].is_stopped)
        basis.col(state_.num_turns(unknown)).setZero();
    return basis;
}

void GlueTerm::add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const UnknownCell unknown = state_.unknown_of_block(block);
    if (unknown == UnknownCell::None)
        return;
    const std::size_t u = idx(unknown);
    const CellState::Basis own = basis(unknown);
    const CellState::Basis image = diagonals_[u].matrix() * own;
    out.noalias() += own.transpose().lazyProduct(image);
    out.diagonal().array() += proximal_[u];
    if (!state_.is_sliding(unknown))
        return;
    const int slide = state_.num_turns(unknown);
    out(slide, slide) += sliding_[u].stiffness;
    for (int k = 0; k < slide; ++k)
    {
        out(k, slide) += turn_of_slide(unknown, k);
        out(slide, k) += turn_of_slide(unknown, k);
    }
}

void GlueTerm::add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const std::size_t p = idx(pair);
    const UnknownCell row = state_.unknown_of_block(pairs_[p].first);
    const UnknownCell column = state_.unknown_of_block(pairs_[p].second);
    GlueBlock H = GlueBlock::zero();
    for (int k = first_of_pair_[p]; k < first_of_pair_[p + 1]; ++k)
    {
        const std::size_t f = idx(faces_of_pair_[idx(k)]);
        H += glue_.faces[f].a == state_.cell_of_unknown(row) ? couplings_[f]
                                                             : couplings_[f].transposed();
    }
    const CellState::Basis image = H.matrix() * basis(column);
    out.noalias() += basis(row).transpose().lazyProduct(image);
}

} // namespace cellwarp::core
