// SPDX-License-Identifier: GPL-3.0-or-later
// A model and its skeleton as flesh: the lattice, what holds it, and where the model's
// samples lie in it.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "editor/session/body.h"
#include "editor/session/skeleton_handle.h"
#include "io/geometry.h"
#include "io/scene_file.h"
#include "solver/flesh/flesh.h"
#include "solver/skeleton/joint_keys.h"

namespace cellwarp
{

/// All lengths of the lattice are in metres, in the axes of the work frame.
struct FleshBody
{
    WorkFrame frame;
    double metre = 1.0; ///< a work unit [m]
    std::shared_ptr<const SkeletonHandle> skeleton;
    /// The octree's; null of a lattice that was drawn.
    std::shared_ptr<const Body> octree;
    std::shared_ptr<Flesh> flesh;
    std::vector<int> cell_of_sample;
    std::vector<Eigen::Vector3d> local; ///< of each sample, in its cell
    std::size_t held = 0, dropped = 0;  ///< points of bones
    double mass = 0.0;                  ///< [kg]
    /// Of points that are held wholly: their motions come after those of the joints [m].
    std::vector<ShiftKeys> holds;
    /// Held along a normal alone; and where they are to go [m].
    std::vector<std::pair<PulledPoint, ShiftKeys>> guided;
    std::vector<std::pair<FleshObstacle, ShiftKeys>> obstacles;
    std::vector<std::string> warnings;

    Eigen::Vector3d to_metres(const Eigen::Vector3d& model) const
    {
        return metre * frame.to_work(model);
    }
    FleshPoint point_of_sample(std::size_t sample) const;
    Eigen::Vector3d to_model(const Eigen::Vector3d& metres) const
    {
        return frame.to_model(metres / metre);
    }
};

/// \p is_tight: linear systems to 1e-10 instead of 1e-3. Throws Fault::Malformed for what
/// the scene says and cannot be, and what build_rest_shape() throws.
/// \pre scene.skeleton and scene.time
FleshBody build_flesh(const Geometry& geometry, const SceneFile& scene,
                      const SkeletonValues& skeleton, const CellSettings& cells,
                      bool is_tight);

} // namespace cellwarp
