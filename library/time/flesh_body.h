// SPDX-License-Identifier: GPL-3.0-or-later
// The flesh of a model in one lattice: what holds it, and where the model's samples lie
// in it.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "library/session/body.h"
#include "library/time/flesh_model.h"
#include "library/time/held_points.h"
#include "solver/flesh/flesh.h"
#include "solver/flesh/leaving_nodes.h"

namespace cellwarp::core
{

/// All lengths are in metres, in the axes of the work frame.
struct FleshBody
{
    std::shared_ptr<const FleshModel> model;
    /// The octree's; null of a lattice that was drawn.
    std::shared_ptr<const Body> octree;
    std::shared_ptr<const Octree> tree; ///< its leaves have the cells
    std::shared_ptr<Flesh> flesh;
    std::vector<int> cell_of_sample;
    std::vector<Eigen::Vector3d> local; ///< of each sample, in its cell
    std::size_t held = 0, dropped = 0;  ///< points of bones
    double mass = 0.0;                  ///< [kg]
    std::vector<bool> is_loose;         ///< nodes of parts that no bone holds
    /// Their motions come after those of the joints.
    HeldPoints held_points;
    /// With detail that comes and goes, points that may lie off what holds them, and come
    /// to it: first nodes that leave, then points of bones, then held_points.whole. Each
    /// has a motion of its own, after those of the held points.
    struct OwnMotion
    {
        int follows = -1; ///< motion of a joint, or a hold; -1: of a node that leaves
        /// The point, by the nodes.
        NodeShares shares;
        Eigen::Vector3d place = Eigen::Vector3d::Zero();
    };
    std::vector<OwnMotion> own_motions;
    LeavingNodes leaving;
    /// Cells of the coarser lattice that each cell is or will be a part of, and the
    /// leaves of those; empty: nothing leaves.
    std::vector<int> coarse_cell;
    std::vector<Leaf> coarse_leaf;
    std::vector<std::string> warnings;

    /// The own motion of a point that is held wholly.
    std::size_t own_of_whole(std::size_t number) const
    {
        return own_motions.size() - held_points.whole.size() + number;
    }
    std::size_t first_own_motion() const
    {
        return model->skeleton->size() + held_points.holds.size();
    }
    FleshPoint point_of_sample(std::size_t sample) const;
};

/// The octree of a lattice without detail, or before there is any. Throws Fault::Budget.
Octree first_octree(const FleshModel& model);

/// The leaves that hold material of regions whose cells are small.
std::vector<LeafNumber> leaves_of_fine_regions(const FleshModel& model,
                                               const Octree& octree);

/// Of each cell of a body, the one of another body of the same shape that has its
/// material: its first voxel, or its first part.
std::vector<int> cells_around(const FleshBody& body, const FleshBody& other);

/// In the first lattice; of material whose stiffness the scene does not tell with that
/// of holding_stiffness(). Throws Fault::Malformed for what the scene says and cannot be.
FleshBody build_flesh(std::shared_ptr<const FleshModel> model);

/// The lattice of an octree that is about to become \p coarser, the same where it stays.
FleshBody build_flesh(std::shared_ptr<const FleshModel> model, const Octree& octree,
                      const Octree& coarser);

} // namespace cellwarp::core
