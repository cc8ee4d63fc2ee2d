// SPDX-License-Identifier: GPL-3.0-or-later
// A tree of bridges, each on one spot, takes no stress: the parts that follow then go as
// rigid bodies, and what is held is where it would be without them. Bridges on many spots
// bend what they hold; solved for together both would bend less. So they are solved for
// one after the other, and what is held is the same to the bit whatever follows it.
//   A part is first carried by one rigid motion G of space, the one of the least energy
//   of
// its bridges. With x_f a bridge's centre, k_f its stiffness, T_a and T_b its cells'
// poses,
//   sum_f k_f (|T_a x_f - G T_b x_f|^2 + tr((R_a - G R_b) S_f (R_a - G R_b)^T)),
// whose turn is the rotation nearest to
//   sum_f k_f ((y_f - y) (z_f - z)^T + R_a S_f R_b^T),    y_f = T_a x_f,  z_f = T_b x_f,
// y and z their means weighted by k_f, and it takes z to y.
#include "library/session/loose_parts.h"

#include <algorithm>
#include <cmath>

#include "library/session/contact_rounds.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "octree/base/nearest_rotation.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// A motion that takes no cell farther is rounding [diagonal].
constexpr double kStill = 1e-15;

/// Glue whose gaps are no larger is as well as it can be [diagonal].
constexpr double kClosed = 1e-14;

/// The place of held parts in the order of all.
constexpr int kHeld = -1;

/// The cell for which \p may_lead in the 27 voxels around a place, that of the voxel
/// whose middle is nearest, the first where several are equally near; -1: there is none.
template <class MayLead>
int cell_beside(const Body& body, const Eigen::Vector3d& x, const MayLead& may_lead)
{
    const VoxelGrid& grid = body.rest->material.grid;
    const Eigen::Vector3i at = grid.locate(x);
    const VoxelRange around{at.array() - 1, at.array() + 1};
    int found = -1;
    double least = INFINITY;
    for_each_voxel(around.cut({Eigen::Vector3i::Zero(), grid.counts().array() - 1}),
                   [&](const Eigen::Vector3i& voxel)
                   {
                       const int cell = body.pieces.at(grid, voxel);
                       if (cell < 0 || !may_lead(cell))
                           return;
                       const double away = (grid.centre(voxel) - x).squaredNorm();
                       if (away < least)
                       {
                           least = away;
                           found = cell;
                       }
                   });
    return found;
}

/// The rigid motion that \p bridges ask of the cells at their far ends.
Motion asked_for(std::span<const GlueFace> bridges, std::span<const Pose> poses,
                 int flat_axis)
{
    const auto ends = [&](const GlueFace& bridge)
    {
        const Pose &a = poses[idx(bridge.a)], &b = poses[idx(bridge.b)];
        return std::pair<Eigen::Vector3d, Eigen::Vector3d>(a.p + a.R * bridge.reach_a,
                                                           b.p + b.R * bridge.reach_b);
    };
    const auto [first_y, first_z] = ends(bridges.front());
    double whole = 0.0;
    Eigen::Vector3d y = Eigen::Vector3d::Zero(), z = y;
    for (const GlueFace& bridge : bridges)
    {
        const auto [at_a, at_b] = ends(bridge);
        whole += bridge.stiffness;
        y += bridge.stiffness * (at_a - first_y);
        z += bridge.stiffness * (at_b - first_z);
    }
    y = first_y + y / whole;
    z = first_z + z / whole;
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
    for (const GlueFace& bridge : bridges)
    {
        const auto [at_a, at_b] = ends(bridge);
        H += bridge.stiffness * ((at_a - y) * (at_b - z).transpose() +
                                 poses[idx(bridge.a)].R * bridge.moment *
                                     poses[idx(bridge.b)].R.transpose());
    }
    if (flat_axis >= 0)
    {
        const double kept = H(flat_axis, flat_axis);
        H.row(flat_axis).setZero();
        H.col(flat_axis).setZero();
        H(flat_axis, flat_axis) = kept;
    }
    const Eigen::Matrix3d R = nearest_rotation(H);
    return {R, y - R * z};
}

} // namespace

LooseParts::LooseParts(std::shared_ptr<const Body> body, const Glue& glue,
                       std::span<const double> factors,
                       std::span<const Component> components,
                       std::vector<Constraint>& constraints, bool has_rigid_steps)
    : body_(std::move(body)), has_rigid_steps_(has_rigid_steps)
{
    std::vector<int> component(body_->cells.size());
    std::vector<bool> is_held;
    for (const Component& one : components)
    {
        for (const int cell : one.cells)
            component[idx(cell)] = static_cast<int>(is_held.size());
        is_held.push_back(one.is_held);
    }
    const Material& material = body_->rest->material;
    const Bridges bridges =
        find_bridges(material.grid, body_->pieces, material.notches, component, is_held);
    bridged_ = bridges.components;
    if (bridged_.empty())
        return;
    bridges_ = bridge_glue(body_->cells, bridges.all, factors);
    for (const BridgedComponent& one : bridged_)
    {
        cells_.push_back(components[idx(one.component)].cells);
        components_.push_back({cells_.back(), true});
        for (const int cell : cells_.back())
            constraints[idx(cell)].hold = Hold::Following;
    }
    constraints_ = constraints;
    for (Constraint& constraint : constraints_)
        constraint.hold =
            constraint.hold == Hold::Following ? Hold::Free : Hold::Prescribed;
    for (const GlueFace& face : glue.faces)
        if (constraints_[idx(face.a)].hold == Hold::Free)
            glue_.faces.push_back(face);
    glue_.faces.insert(glue_.faces.end(), bridges_.begin(), bridges_.end());
    glue_.list_faces_of_cells(body_->cells.size());
    if (body_->rest->boundary)
        finder_.emplace(body_, factors, constraints_);
}

/// Each as a whole.
void LooseParts::carry(std::vector<Pose>& poses) const
{
    const double still = kStill * body_->rest->frame.diagonal();
    const int flat_axis = body_->rest->flat_axis;
    for (std::size_t k = 0; k < bridged_.size(); ++k)
    {
        const BridgedComponent& one = bridged_[k];
        const Motion motion = asked_for(
            std::span(bridges_).subspan(idx(one.first), idx(one.end - one.first)), poses,
            flat_axis);
        if (std::all_of(cells_[k].begin(), cells_[k].end(),
                        [&](int cell)
                        {
                            const Pose& pose = poses[idx(cell)];
                            return (motion.R - Eigen::Matrix3d::Identity()).norm() *
                                           body_->cells.cells[idx(cell)].edge <=
                                       still &&
                                   (motion(pose.p) - pose.p).norm() <= still;
                        }))
            continue;
        for (const int cell : cells_[k])
        {
            Pose& pose = poses[idx(cell)];
            const double height = flat_axis >= 0 ? pose.p[flat_axis] : 0.0;
            pose = {motion.R * pose.R, motion(pose.p)};
            if (flat_axis >= 0)
                pose.p[flat_axis] = height;
        }
    }
}

bool LooseParts::is_at_minimum(std::span<const Pose> poses) const
{
    double stiffness = 0.0;
    for (const GlueFace& face : glue_.faces)
        stiffness += face.stiffness;
    const double gap = kClosed * body_->rest->frame.diagonal();
    return glue_energy(glue_, poses) <= stiffness * gap * gap;
}

SolveReport LooseParts::minimize(std::vector<Pose>& poses, const SolveOptions& options)
{
    if (!minimizer_)
    {
        std::vector<CellContact> in_contact;
        for (const FoundContact& found : contacts_)
            in_contact.push_back(found.contact);
        minimizer_.emplace(body_->cells, glue_, constraints_, components_,
                           has_rigid_steps_, MakeCompanion(), in_contact);
        if (!contacts_.empty())
            minimizer_->forget(poses, true); // at rest they do not touch
    }
    return minimizer_->minimize(poses, options);
}

SolveReport LooseParts::follow(std::vector<Pose>& poses, const SolveOptions& options)
{
    SolveReport report;
    report.stop = Stop::Converged;
    if (bridged_.empty())
        return report;
    const Clock::time_point start = Clock::now();
    carry(poses);
    if (!finder_ && is_at_minimum(poses))
        return report;
    SolveOptions own = options;
    own.checks_stability = false;
    own.stays_stable = false;
    own.watch = {};
    if (options.time_budget > 0)
        own.time_budget = std::max(1e-9, options.time_budget - 1e-3 * ms_since(start));
    contacts_.clear();
    const auto solve = [&](const SolveOptions& now) { return minimize(poses, now); };
    if (finder_)
        report = solve_in_contact({*finder_, body_->rest->material.grid.shape().voxel(),
                                   poses, contacts_, [&] { minimizer_.reset(); }, solve},
                                  own);
    else
        report = solve(own);
    // The next solve begins as the first one does.
    if (!contacts_.empty() || minimizer_->is_refreshed())
        minimizer_.reset();
    else
        minimizer_->forget(poses, false);
    contacts_.clear();
    return report;
}

std::vector<TouchingSamples> LooseParts::touching() const
{
    std::vector<TouchingSamples> touching;
    if (bridged_.empty())
        return touching;
    // Held parts come first, then the loose ones in their order.
    std::vector<int> order(body_->cells.size(), kHeld);
    for (std::size_t k = 0; k < bridged_.size(); ++k)
        for (const int cell : cells_[k])
            order[idx(cell)] = static_cast<int>(k);
    const RestShape& rest = *body_->rest;
    const auto leading_cell = [&](const Eigen::Vector3d& x, int own)
    {
        return cell_beside(*body_, x,
                           [&](int cell) { return order[idx(cell)] < order[idx(own)]; });
    };
    std::vector<char> is_led(rest.samples.size(), false);
    parallel_for(is_led.size(), 1024,
                 [&](std::size_t i)
                 {
                     const int own = body_->cell_of_sample[i];
                     is_led[i] = order[idx(own)] != kHeld &&
                                 leading_cell(rest.samples[i], own) >= 0;
                 });
    std::vector<std::vector<RegionFade::Node>> nodes(bridged_.size());
    for (std::size_t i = 0; i < is_led.size(); ++i)
        if (is_led[i])
        {
            const int own = body_->cell_of_sample[i];
            nodes[idx(order[idx(own)])].push_back({rest.samples[i], own});
        }
    std::vector<int> rank(bridged_.size(), 0);
    for (std::size_t k = 0; k < nodes.size(); ++k)
    {
        if (nodes[k].empty())
            continue;
        TouchingSamples samples = {RegionFade(body_->cells, nodes[k], {})};
        for (std::size_t i = 0; i < samples.fade.nodes().size(); ++i)
        {
            const int leading =
                leading_cell(samples.fade.nodes()[i], samples.fade.node_cells()[i]);
            samples.leading_cells.push_back(leading);
            if (const int other = order[idx(leading)]; other != kHeld)
                rank[k] = std::max(rank[k], rank[idx(other)]);
        }
        samples.rank = ++rank[k];
        touching.push_back(std::move(samples));
    }
    return touching;
}

std::vector<FoundContact> LooseParts::contacts(std::span<const Pose> poses) const
{
    return finder_ ? finder_->find(poses) : std::vector<FoundContact>();
}

} // namespace cellwarp::core
