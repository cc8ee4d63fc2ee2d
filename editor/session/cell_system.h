// SPDX-License-Identifier: GPL-3.0-or-later
// A body with its regions: which cells they move, what is solved for the others, and
// where all of them are. Made anew for another body or other regions, never for a motion.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "editor/session/body.h"
#include "editor/session/region_set.h"
#include "solver/cells/cell_minimizer.h"
#include "solver/cells/initial_guess.h"
#include "solver/field/field.h"

namespace cellwarp
{

struct CellSystemSettings
{
    double max_memory = 0.0; ///< [byte], 0: no limit
    Method method = Method::Newton;
    Departures departures = {};
};

/// Where the cells of a system are.
struct CellSystemState
{
    std::vector<Pose> poses;
    std::vector<Motion> motions; ///< of the regions
    /// Whether the preconditioner is no longer that of the rest.
    bool is_refreshed = false;
};

class CellSystem
{
public:
    /// \p regions of the rest shape of \p body. All is at rest. Throws Fault::Unsolvable
    /// for a region that others leave no cell, Fault::Budget.
    CellSystem(std::shared_ptr<const Body> body, std::shared_ptr<const RegionSet> regions,
               const CellSystemSettings& settings);

    const Body& body() const { return *body_; }
    std::shared_ptr<const Body> shared_body() const { return body_; }
    std::shared_ptr<const RegionSet> shared_regions() const { return regions_; }
    const RestShape& rest() const { return *body_->rest; }
    const RegionSet& regions() const { return *regions_; }
    const std::vector<int>& region_of_cell() const
    {
        return region_of_cell_;
    } ///< -1: none
    const std::vector<Constraint>& constraints() const { return constraints_; }
    /// Of the regions, in the cells.
    const std::vector<RegionShares>& shares() const { return shares_; }
    const Glue& glue() const { return glue_; }
    const std::vector<Pose>& poses() const { return poses_; }
    const std::vector<Motion>& motions() const { return motions_; } ///< of the regions
    const CellMinimizer& minimizer() const { return *minimizer_; }
    const std::vector<std::string>& warnings() const { return warnings_; }

    /// Where a region's correction acts; null for one without samples.
    const RegionFade* fade(std::size_t region) const
    {
        return fades_[region] ? &*fades_[region] : nullptr;
    }

    /// Moves the cells of the regions, one motion a region, from rest. The others stay.
    void move_regions(std::span<const Motion> motions);
    /// Lets the others take part in the last move: a component whose regions all made one
    /// rigid step makes it as a whole, in others each cell by its share.
    void carry_others();
    /// At the current poses.
    Residual residual();
    /// Lowers the glue energy of the cells that may move. Allocates nothing from the
    /// second call on but in the direct method.
    SolveReport solve(const SolveOptions& options);
    /// Starts from other poses, at which the regions have made \p motions.
    void set_state(std::span<const Pose> poses, std::span<const Motion> motions);
    /// All that the next solve depends on.
    CellSystemState state() const
    {
        return {poses_, motions_, minimizer_->is_refreshed()};
    }
    /// Goes on from a state of a system in the same cells, to the same bits as from
    /// there.
    void set_state(const CellSystemState& state);
    /// From here on a solve depends on state() alone, not on the way to it.
    void forget_way() { minimizer_->forget(poses_, false); }

    double energy() const { return glue_energy(glue_, poses_); }
    /// Between glued cells [diagonal].
    double largest_gap() const;

private:
    /// A connected part: its cells that no region prescribes.
    struct Part
    {
        Component component;
        std::vector<int> movable;
    };

    void hold_cells();
    void hold_pins();
    void warn_of_components();
    void place_fades();
    void check_memory(const char* what, double bytes,
                      const CellSystemSettings& settings) const;
    std::optional<Motion> rigid_step_of(const Component& component) const;

    std::shared_ptr<const Body> body_;
    std::shared_ptr<const RegionSet> regions_;
    std::vector<RegionShares> shares_;
    std::vector<int> region_of_cell_;
    std::vector<Constraint> constraints_;
    std::vector<Part> parts_;
    Glue glue_;
    std::optional<CellMinimizer> minimizer_;
    std::optional<InitialGuess> guess_;
    std::vector<std::optional<RegionFade>> fades_;
    std::vector<std::string> warnings_;
    // State.
    std::vector<Pose> poses_;
    std::vector<Motion> motions_, last_motions_, steps_; ///< a region
};

} // namespace cellwarp
