// SPDX-License-Identifier: GPL-3.0-or-later
// The model's samples as they are written: carried by the smooth map of the lattice, and
// around the points that bones hold by what is missing there to the bones' motions.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "library/time/flesh_body.h"
#include "octree/base/rigid_motion.h"
#include "solver/field/region_fade.h"
#include "solver/flesh/smooth_map.h"

namespace cellwarp::core
{

/// All that does not change from frame to frame. Immutable, safe for many threads.
class SmoothSamples
{
public:
    /// \pre body.octree
    explicit SmoothSamples(const FleshBody& body);

    /// Displacement and gradient of each sample, in the work frame. \p u: displacements
    /// of the nodes [m]; \p motions: those that hold points [m]. Gradients are left 0
    /// unless they are wanted.
    std::vector<FieldValue> values(const Eigen::VectorXd& u,
                                   std::span<const Motion> motions,
                                   bool wants_gradients) const;

private:
    /// A sample near held points, and what it takes of their misses.
    struct NearBones
    {
        std::size_t sample = 0;
        RegionFade::Weight weight;
        RegionFade::NodeShares shares;
    };
    struct Bones
    {
        std::unique_ptr<RegionFade> fade; ///< null: there are none
        std::vector<int> motions;         ///< of each of its nodes
        std::vector<int> cells;           ///< likewise, that hold it
    };
    static Bones bones_of(const FleshBody& body);
    static SmoothMap map_of(const FleshBody& body, const Bones& bones);
    void find_near_bones(const FleshBody& body);

    std::vector<Eigen::Vector3d> samples_; ///< [work]
    double metre_;
    Bones bones_;
    SmoothMap map_; ///< of the samples, and then of the nodes of bones_
    std::vector<NearBones> near_bones_;
};

} // namespace cellwarp::core
