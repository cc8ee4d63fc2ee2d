// SPDX-License-Identifier: GPL-3.0-or-later
// Lets the cells that no region prescribes take part in a step of the regions: a part of
// the material as a whole, or each of its cells by its share.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "library/session/body.h"
#include "library/session/handle_trajectory.h"
#include "library/session/region_driving.h"
#include "library/session/region_set.h"
#include "solver/cells/initial_guess.h"

namespace cellwarp::core
{

/// A pin on its way: round with all that holds its part of the material, and straight by
/// what is left.
struct PinWay
{
    std::size_t region;
    HandleTrajectory around;
    Eigen::Vector3d rest, from, left; ///< place at rest and at first; what is left
    Motion at(double t) const;        ///< \p t in [0, 1)
};

class CarriedParts
{
public:
    /// \p components of the body; \p borders of the regions, see
    /// CellSystem::region_borders().
    CarriedParts(std::shared_ptr<const Body> body,
                 std::shared_ptr<const RegionSet> regions, const RegionDriving& driving,
                 std::vector<Component> components,
                 std::span<const Eigen::Vector3d> borders);

    const std::vector<Component>& components() const { return components_; }

    /// The ways of the pins that go round when the regions go from motions to motions.
    /// Pins on curves, and in parts with rods, go with these.
    std::vector<PinWay> pin_ways(std::span<const Motion> from,
                                 std::span<const Motion> to) const;

    /// Finds the shares of the cells, once.
    void make_guess(const Glue& glue, const RegionDriving& driving);
    /// A component whose regions all made one rigid step makes it as a whole, in others
    /// each cell by its share. Pins turn as the best rigid step of all that holds their
    /// component does. \pre make_guess()
    void carry(const RegionDriving& driving, std::vector<Pose>& poses);

private:
    /// A place that leads a part of the material: that of a pin's cell, of a handle where
    /// the part borders it, or of a rod.
    struct Holder
    {
        std::size_t step; ///< of the driving
        Eigen::Vector3d rest;
        bool is_pin; ///< its motion tells nothing of a turn
        Eigen::Vector3d at(const Motion& motion) const
        {
            return is_pin ? Eigen::Vector3d(rest + motion.t) : motion(rest);
        }
    };
    /// A component, without the cells that regions prescribe.
    struct Part
    {
        std::vector<int> movable;
        std::vector<Holder> holders;           ///< none where no pin is among them
        std::vector<Eigen::Vector3d> from, to; ///< scratch, one a holder
    };

    std::vector<Holder> holders_of(const Component& component,
                                   const RegionDriving& driving,
                                   std::span<const Eigen::Vector3d> borders) const;
    Motion best_step(std::span<const Eigen::Vector3d> from,
                     std::span<const Eigen::Vector3d> to) const;
    void turn_pins(Part& part, const RegionDriving& driving);
    std::optional<Motion> rigid_step_of(const Component& component,
                                        const RegionDriving& driving) const;

    std::shared_ptr<const Body> body_;
    std::shared_ptr<const RegionSet> regions_;
    std::vector<Component> components_;
    std::vector<Part> parts_; ///< one a component
    std::optional<InitialGuess> guess_;
    std::vector<Motion> steps_; ///< of the driving
};

} // namespace cellwarp::core
