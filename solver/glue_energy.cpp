// SPDX-License-Identifier: GPL-3.0-or-later
// Unknowns are twists about the current centres in the cell's own axes: 6 numbers x for a
// free cell, whose twist in world axes is (R x_angular, R x_linear). In these axes the
// second derivatives hardly change when a part of the body turns, so what was prepared at
// rest stays a good preconditioner.
// A pinned cell, whose held point is at X, has 3 unknowns omega: with q = p - X the
// centre follows,
//   p' = X + rot(R omega) q = p + (R omega) x q + ...,
// which is a twist with v = (R omega) x q: its gradient is R^T (g_omega + q x g_v).
#include "solver/glue_energy.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

/// Proximal term on rotations that nothing holds, relative to the diagonal: it
/// vanishes with the step and so does not change the solution.
constexpr double kProximal = 1e-3;

/// Loops shorter than this are not worth a second thread.
constexpr std::size_t kGrain = 256;

template <class Body>
void for_each(std::size_t count, Body&& body)
{
    parallel_ranges(count, kGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                            body(i);
                    });
}

} // namespace

GlueEnergy::GlueEnergy(const Cells& cells, const Glue& glue,
                       std::span<const Constraint> constraints,
                       std::span<const Component> components, bool has_rigid_steps)
    : glue_(glue), has_rigid_steps_(has_rigid_steps),
      constraints_(constraints.begin(), constraints.end())
{
    first_.push_back(0);
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        centres_.push_back(cells.cells[i].centre);
        poses_.push_back({Eigen::Matrix3d::Identity(), centres_[i]});
        const Hold hold = constraints_[i].hold;
        const bool is_unknown = hold == Hold::Free || hold == Hold::Pinned;
        unknown_of_cell_.push_back(is_unknown ? num_unknown_cells() : -1);
        if (!is_unknown)
            continue;
        cell_of_unknown_.push_back(static_cast<int>(i));
        sizes_.push_back(hold == Hold::Free ? 6 : 3);
        first_.push_back(first_.back() + sizes_.back());
        constraints_[i].held_now = constraints_[i].held_rest;
    }
    base_ = poses_;
    turns_freely_.assign(cell_of_unknown_.size(), false);
    for (const Component& component : components)
        if (component.free_rotations > 0)
            for (const int cell : component.cells)
                if (constraints_[static_cast<std::size_t>(cell)].hold == Hold::Pinned)
                    turns_freely_[static_cast<std::size_t>(at(unknown_of_cell_, cell))] =
                        true;
    std::vector<std::pair<std::pair<int, int>, int>> faces;
    for (std::size_t f = 0; f < glue_.faces.size(); ++f)
    {
        const int a = at(unknown_of_cell_, glue_.faces[f].a);
        const int b = at(unknown_of_cell_, glue_.faces[f].b);
        if (a >= 0 && b >= 0)
            faces.push_back({{std::max(a, b), std::min(a, b)}, static_cast<int>(f)});
    }
    std::sort(faces.begin(), faces.end());
    for (const auto& [pair, face] : faces)
    {
        pairs_.push_back(pair);
        face_of_pair_.push_back(face);
    }
    diagonals_.resize(cell_of_unknown_.size());
    proximal_.assign(cell_of_unknown_.size(), 0.0);
    couplings_.resize(glue_.faces.size());
    face_values_.resize(glue_.faces.size());
    face_gradients_.resize(glue_.faces.size());
    twists_.assign(cells.size(), Twist::Zero());
}

std::vector<Pose> GlueEnergy::unknown_poses() const
{
    std::vector<Pose> poses;
    for (const int cell : cell_of_unknown_)
        poses.push_back(poses_[static_cast<std::size_t>(cell)]);
    return poses;
}

void GlueEnergy::set_poses(std::span<const Pose> poses)
{
    std::copy(poses.begin(), poses.end(), poses_.begin());
    settle();
}

void GlueEnergy::set_held_points(std::span<const Constraint> constraints)
{
    for (std::size_t i = 0; i < constraints_.size(); ++i)
        constraints_[i].held_now = constraints[i].held_now;
}

std::span<const int> GlueEnergy::faces_of(int cell) const
{
    const std::size_t first = static_cast<std::size_t>(at(glue_.first_face, cell));
    const std::size_t end = static_cast<std::size_t>(at(glue_.first_face, cell + 1));
    return std::span(glue_.faces_of_cell).subspan(first, end - first);
}

double GlueEnergy::value() const
{
    for_each(glue_.faces.size(),
             [&](std::size_t f)
             {
                 const GlueFace& face = glue_.faces[f];
                 face_values_[f] =
                     glue_energy(face, poses_[static_cast<std::size_t>(face.a)],
                                 poses_[static_cast<std::size_t>(face.b)]);
             });
    double sum = 0.0;
    for (const double value : face_values_)
        sum += value;
    return sum;
}

void GlueEnergy::find_face_gradients() const
{
    for_each(glue_.faces.size(),
             [&](std::size_t f)
             {
                 const GlueFace& face = glue_.faces[f];
                 face_gradients_[f] =
                     glue_gradient(face, poses_[static_cast<std::size_t>(face.a)],
                                   poses_[static_cast<std::size_t>(face.b)]);
             });
}

void GlueEnergy::gradient(Eigen::VectorXd& out) const
{
    find_face_gradients();
    out.resize(first_.back());
    for_each(cell_of_unknown_.size(),
             [&](std::size_t u)
             {
                 const int unknown = static_cast<int>(u), cell = cell_of_unknown_[u];
                 Twist sum = Twist::Zero();
                 for (const int f : faces_of(cell))
                     sum += face_gradients_[static_cast<std::size_t>(f)].segment<6>(
                         glue_.faces[static_cast<std::size_t>(f)].a == cell ? 0 : 6);
                 double* const at_block = out.data() + at(first_, unknown);
                 std::fill_n(at_block, sizes_[u], 0.0);
                 add_body(unknown, sum, at_block);
             });
}

double GlueEnergy::uncancelled() const
{
    find_face_gradients();
    double sum = 0.0;
    for (const int cell : cell_of_unknown_)
    {
        double forces = 0.0;
        for (const int f : faces_of(cell))
            forces += face_gradients_[static_cast<std::size_t>(f)]
                          .segment<6>(
                              glue_.faces[static_cast<std::size_t>(f)].a == cell ? 0 : 6)
                          .norm();
        sum += forces * forces;
    }
    return std::sqrt(sum);
}

void GlueEnergy::rounding(std::span<double> out) const
{
    for (std::size_t u = 0; u < cell_of_unknown_.size(); ++u)
    {
        double sizes = 0.0;
        for (const int f : faces_of(cell_of_unknown_[u]))
        {
            const GlueFace& face = glue_.faces[static_cast<std::size_t>(f)];
            sizes += 2.0 * face.stiffness *
                     (poses_[static_cast<std::size_t>(face.a)].p.norm() +
                      poses_[static_cast<std::size_t>(face.b)].p.norm());
        }
        out[u] = 4.0 * std::numeric_limits<double>::epsilon() * sizes;
    }
}

void GlueEnergy::linearise(Curvature curvature)
{
    for_each(glue_.faces.size(),
             [&](std::size_t f)
             {
                 const GlueFace& face = glue_.faces[f];
                 couplings_[f] =
                     glue_coupling(face, poses_[static_cast<std::size_t>(face.a)],
                                   poses_[static_cast<std::size_t>(face.b)]);
             });
    for_each(cell_of_unknown_.size(),
             [&](std::size_t u)
             {
                 const int cell = cell_of_unknown_[u];
                 Eigen::Matrix<double, 6, 6>& sum = diagonals_[u];
                 sum.setZero();
                 for (const int f : faces_of(cell))
                 {
                     const GlueFace& face = glue_.faces[static_cast<std::size_t>(f)];
                     const Pose& a = poses_[static_cast<std::size_t>(face.a)];
                     const Pose& b = poses_[static_cast<std::size_t>(face.b)];
                     sum += face.a == cell ? glue_diagonal_a(face, a, b, curvature)
                                           : glue_diagonal_b(face, a, b, curvature);
                 }
                 proximal_[u] =
                     turns_freely_[u]
                         ? kProximal * std::abs(sum.topLeftCorner<3, 3>().trace()) / 3.0
                         : 0.0;
             });
}

Eigen::Vector3d GlueEnergy::arm_of_pin(int cell) const
{
    const std::size_t c = static_cast<std::size_t>(cell);
    return poses_[c].p - constraints_[c].held_now;
}

Twist GlueEnergy::world(int unknown, const double* x) const
{
    const int cell = cell_of_unknown(unknown);
    const Eigen::Matrix3d& R = poses_[static_cast<std::size_t>(cell)].R;
    Twist twist;
    twist.head<3>() = R * Eigen::Map<const Eigen::Vector3d>(x);
    if (is_pinned(unknown))
        twist.tail<3>() = twist.head<3>().cross(arm_of_pin(cell));
    else
        twist.tail<3>() = R * Eigen::Map<const Eigen::Vector3d>(x + 3);
    return twist;
}

void GlueEnergy::add_body(int unknown, const Twist& twist, double* y) const
{
    const int cell = cell_of_unknown(unknown);
    const Eigen::Matrix3d& R = poses_[static_cast<std::size_t>(cell)].R;
    if (is_pinned(unknown))
        Eigen::Map<Eigen::Vector3d>(y) +=
            R.transpose() * (twist.head<3>() + arm_of_pin(cell).cross(twist.tail<3>()));
    else
    {
        Eigen::Map<Eigen::Vector3d>(y).noalias() += R.transpose() * twist.head<3>();
        Eigen::Map<Eigen::Vector3d>(y + 3).noalias() += R.transpose() * twist.tail<3>();
    }
}

void GlueEnergy::multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const
{
    y.resize(first_.back());
    for_each(cell_of_unknown_.size(),
             [&](std::size_t u)
             {
                 twists_[static_cast<std::size_t>(cell_of_unknown_[u])] =
                     world(static_cast<int>(u), x.data() + first_[u]);
             });
    for_each(
        cell_of_unknown_.size(),
        [&](std::size_t u)
        {
            const int cell = cell_of_unknown_[u];
            Twist sum = diagonals_[u] * twists_[static_cast<std::size_t>(cell)];
            for (const int f : faces_of(cell))
            {
                const GlueFace& face = glue_.faces[static_cast<std::size_t>(f)];
                const GlueCoupling& coupling = couplings_[static_cast<std::size_t>(f)];
                if (face.a == cell)
                    coupling.add_to_a(twists_[static_cast<std::size_t>(face.b)], sum);
                else
                    coupling.add_to_b(twists_[static_cast<std::size_t>(face.a)], sum);
            }
            const double* const x_block = x.data() + first_[u];
            double* const y_block = y.data() + first_[u];
            for (int k = 0; k < sizes_[u]; ++k)
                y_block[k] = proximal_[u] * x_block[k];
            add_body(static_cast<int>(u), sum, y_block);
        });
}

GlueEnergy::Basis GlueEnergy::basis(int unknown) const
{
    const int cell = cell_of_unknown(unknown);
    const Eigen::Matrix3d& R = poses_[static_cast<std::size_t>(cell)].R;
    Basis basis = Basis::Zero(6, at(sizes_, unknown));
    basis.topLeftCorner<3, 3>() = R;
    if (is_pinned(unknown))
        basis.bottomLeftCorner<3, 3>() = -cross_matrix(arm_of_pin(cell)) * R;
    else
        basis.bottomRightCorner<3, 3>() = R;
    return basis;
}

void GlueEnergy::diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const std::size_t u = static_cast<std::size_t>(block);
    const Basis own = basis(block);
    const Basis image = diagonals_[u] * own;
    out.noalias() = own.transpose().lazyProduct(image);
    out.diagonal().array() += proximal_[u];
}

void GlueEnergy::pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const
{
    const auto [row, column] = pairs_[static_cast<std::size_t>(pair)];
    const std::size_t f =
        static_cast<std::size_t>(face_of_pair_[static_cast<std::size_t>(pair)]);
    Eigen::Matrix<double, 6, 6> H = couplings_[f].matrix();
    if (glue_.faces[f].a != cell_of_unknown(row))
        H.transposeInPlace();
    const Basis image = H * basis(column);
    out.noalias() = basis(row).transpose().lazyProduct(image);
}

void GlueEnergy::move(const Eigen::VectorXd& step, double length)
{
    for_each(cell_of_unknown_.size(),
             [&](std::size_t u)
             {
                 const std::size_t cell = static_cast<std::size_t>(cell_of_unknown_[u]);
                 const Eigen::Matrix3d& R = base_[cell].R;
                 const double* const x = step.data() + first_[u];
                 Twist twist = Twist::Zero();
                 twist.head<3>() = length * (R * Eigen::Map<const Eigen::Vector3d>(x));
                 if (sizes_[u] == 6)
                     twist.tail<3>() =
                         length * (R * Eigen::Map<const Eigen::Vector3d>(x + 3));
                 poses_[cell] = has_rigid_steps_ ? moved(base_[cell], twist)
                                                 : shape_matched(base_[cell], twist);
                 if (sizes_[u] == 3)
                     poses_[cell] =
                         held_at_pin(poses_[cell], constraints_[cell], centres_[cell]);
             });
}

void GlueEnergy::settle()
{
    std::copy(poses_.begin(), poses_.end(), base_.begin());
}

} // namespace cellwarp
