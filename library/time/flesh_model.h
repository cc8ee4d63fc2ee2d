// SPDX-License-Identifier: GPL-3.0-or-later
// A model, its skeleton and what a scene tells of their flesh: all that the lattices made
// of it have in common.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "io/scene/scene_file.h"
#include "library/session/body.h"
#include "library/session/region_set.h"
#include "library/session/skeleton_handle.h"
#include "solver/flesh/bone_tube.h"
#include "solver/flesh/flesh.h"

namespace cellwarp::core
{

struct DrawnFlesh;

/// All lengths of flesh are in metres, in the axes of the work frame. Immutable once
/// made.
struct FleshModel
{
    std::shared_ptr<const Geometry> geometry;
    SceneFile scene;
    CellSettings cells;
    WorkFrame frame;
    double metre = 1.0; ///< a work unit [m]
    std::shared_ptr<const SkeletonHandle> skeleton;
    std::vector<TubeBone> bones;
    std::vector<FleshMaterial> materials;
    FleshSettings settings;
    std::vector<std::pair<FleshObstacle, MoveKeys>> obstacles; ///< at rest, and moved
    /// What the octree cuts; null of a lattice that was drawn.
    std::shared_ptr<const RestShape> rest;
    /// Null of an octree's lattice.
    std::shared_ptr<const DrawnFlesh> drawn;
    /// The material of each voxel; empty: there is one material, or no octree.
    std::vector<int> material_of_voxel;
    std::vector<std::vector<std::size_t>> tube_voxels; ///< of each bone
    /// Cells that lie in it are small; null: no region is asked for.
    std::shared_ptr<const RegionSet> fine;
    std::vector<std::string> warnings;

    const FleshStatement& flesh() const { return scene.skeleton->flesh; }
    /// Whether a box of the lattice's octree may be a cell.
    MaterialTest has_material() const;
    /// Throws Fault::Budget for more cells at a level than there may be.
    void check_cells(std::size_t size, int level) const;
    Units units() const;
    Eigen::Vector3d to_metres(const Eigen::Vector3d& of_model) const
    {
        return metre * frame.to_work(of_model);
    }
    Eigen::Vector3d to_model(const Eigen::Vector3d& metres) const
    {
        return frame.to_model(metres / metre);
    }
    /// Their shifts in metres; flesh has no keys that turn.
    MoveKeys to_metres(MoveKeys of_model) const;
    /// A unit vector.
    Eigen::Vector3d direction_of(const Eigen::Vector3d& of_model) const;
};

/// The regions of \p selectors, as a handle file has them. Throws Fault::Malformed at
/// \p field of the scene.
std::vector<Region> flesh_regions(const FleshModel& model,
                                  const std::vector<std::string>& selectors,
                                  const std::string& field);

/// Stiffness of flesh without one, until it is known how far it sags [Pa].
inline constexpr double kFirstYoung = 1e4;

/// \p is_tight: linear systems to 1e-10 instead of 1e-3. Throws Fault::Malformed for what
/// the scene says and cannot be, and what build_rest_shape() and
/// read_drawn_flesh() throw.
/// \pre scene.has_flesh()
std::shared_ptr<const FleshModel> flesh_model(std::shared_ptr<const Geometry> geometry,
                                              const SceneFile& scene,
                                              const SkeletonValues& skeleton,
                                              const CellSettings& cells, bool is_tight);

} // namespace cellwarp::core
