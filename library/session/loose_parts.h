// SPDX-License-Identifier: GPL-3.0-or-later
// Components of a body that no region holds: each is bridged to the nearest one that a
// region holds or that is bridged, and goes with it. They are solved for after what is
// held, which does not notice them.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "library/session/body.h"
#include "library/session/contact_finder.h"
#include "octree/bridges.h"
#include "solver/cells/cell_minimizer.h"
#include "solver/field/region_fade.h"

namespace cellwarp::core
{

/// Samples of a loose part that are no more than a voxel off a part before it in their
/// order. They go where the field of that part takes them, so that parts that touch still
/// do so.
struct TouchingSamples
{
    RegionFade fade;                     ///< around the samples
    std::vector<int> leading_cells = {}; ///< for each node a cell of the other part
    int rank = 1;                        ///< see MovedRegion
};

class LooseParts
{
public:
    /// Nothing follows.
    LooseParts() = default;
    /// Makes the cells of those of \p components that go with another one
    /// Hold::Following; none where none is held. \p glue of the body without groups,
    /// \p factors: stiffness of its cells; empty: all 1.
    LooseParts(std::shared_ptr<const Body> body, const Glue& glue,
               std::span<const double> factors, std::span<const Component> components,
               std::vector<Constraint>& constraints, bool has_rigid_steps);

    /// In an order in which each one goes with one that is held or stands before it.
    const std::vector<BridgedComponent>& components() const { return bridged_; }

    /// Takes them to where the others are: each as a whole, by the rigid motion that its
    /// bridges ask for, then each cell by the least energy of their glue and their
    /// bridges; where the body's rest shape has a boundary, out of what they would pass
    /// through. A function of the poses alone.
    SolveReport follow(std::vector<Pose>& poses, const SolveOptions& options);
    /// Contacts of loose parts with each other and with what is held.
    std::vector<FoundContact> contacts(std::span<const Pose> poses) const;
    /// For each loose part that touches a part before it, in their order.
    std::vector<TouchingSamples> touching() const;

private:
    void carry(std::vector<Pose>& poses) const;
    bool is_at_minimum(std::span<const Pose> poses) const;
    SolveReport minimize(std::vector<Pose>& poses, const SolveOptions& options);

    std::shared_ptr<const Body> body_;
    std::vector<BridgedComponent> bridged_;
    std::vector<std::vector<int>> cells_; ///< of each of these
    std::vector<GlueFace> bridges_;       ///< of which they are held
    Glue glue_;                           ///< their own and the bridges
    std::vector<Constraint> constraints_; ///< what is held is prescribed
    std::vector<Component> components_;   ///< as the minimizer sees them
    bool has_rigid_steps_ = true;
    std::optional<ContactFinder> finder_;
    std::vector<FoundContact> contacts_;
    std::optional<CellMinimizer> minimizer_; ///< of the contacts; none: not needed yet
};

} // namespace cellwarp::core
