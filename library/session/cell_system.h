// SPDX-License-Identifier: GPL-3.0-or-later
// A body with its regions: where all of its cells are, and what is solved for those that
// no region moves. Made anew for another body or other regions, never for a motion.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "library/session/body.h"
#include "library/session/carried_parts.h"
#include "library/session/contact_finder.h"
#include "library/session/loose_parts.h"
#include "library/session/pushing_splines.h"
#include "library/session/region_driving.h"
#include "library/session/region_set.h"
#include "solver/cells/cell_minimizer.h"
#include "solver/field/field.h"

namespace cellwarp::core
{

struct CellSystemSettings
{
    double max_memory = 0.0; ///< of the process [byte], 0: no limit
    Method method = Method::Newton;
    Departures departures = {};
    bool loose_follow = true; ///< see CellSettings
};

/// Where the cells of a system are.
struct CellSystemState
{
    std::vector<Pose> poses;
    std::vector<Driven> regions;
    double way_left = 1.0; ///< see CellSystem::move_regions()
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
    const RegionDriving& driving() const { return *driving_; }
    const std::vector<int>& region_of_cell() const
    {
        return driving_->region_of_cell();
    } ///< -1: none
    const std::vector<Constraint>& constraints() const { return driving_->constraints(); }
    const std::vector<Component>& components() const { return parts_->components(); }
    const LooseParts& loose() const { return loose_; }
    /// Of the regions, in the cells.
    const std::vector<RegionShares>& shares() const { return shares_; }
    const Glue& glue() const { return glue_; }
    const std::vector<Pose>& poses() const { return poses_; }
    /// One a region: as it is moved, and as a pin of several places has turned.
    const std::vector<Motion>& motions() const { return driving_->found_motions(); }
    /// The place of a rod or curve, before its motion; null for other regions.
    const std::shared_ptr<const SplineState>& spline(std::size_t region) const
    {
        return driving_->now()[region].spline;
    }
    std::vector<std::shared_ptr<const SplineState>> splines() const;
    const CellMinimizer& minimizer() const { return *minimizer_; }

    /// Finds where the regions' corrections act, unless it has: for a field, or a drag.
    void place_fades();
    /// After place_fades(): where a region's correction acts; null for one without
    /// samples.
    const RegionFade* fade(std::size_t region) const
    {
        return fades_[region] ? &*fades_[region] : nullptr;
    }
    /// Samples of loose parts that touch other parts: found when they are first asked
    /// for.
    const std::vector<TouchingSamples>& touching_samples();

    /// Moves the cells of the regions, one motion a region, from rest. The others stay.
    /// Of a pin the motion tells where its place or the centroid of its samples goes.
    /// \p splines: one a region, to which rods and curves bend before; empty: as they
    /// are. Pins on curves go where those lead them, whatever their motions say;
    /// \p way_left: what part of the way from their rest to the curve they have not gone.
    void move_regions(std::span<const Motion> motions,
                      std::span<const std::shared_ptr<const SplineState>> splines = {},
                      double way_left = 0.0);
    /// See CarriedParts.
    std::vector<PinWay> pin_ways(std::span<const Motion> from,
                                 std::span<const Motion> to) const
    {
        return parts_->pin_ways(from, to);
    }
    /// The force of its curve on a pin [work^2].
    Eigen::Vector3d force_of_guide(std::size_t region) const;
    /// Lets the others take part in the last move, see CarriedParts.
    void carry_others();
    /// Finds what carry_others() needs, once; else it does so itself.
    void make_guess() { parts_->make_guess(glue_, *driving_); }
    /// At the current poses.
    Residual residual();
    /// Lowers the glue energy of the cells that may move. Allocates nothing from the
    /// second call on but in the direct method and where there are contacts.
    /// Rods that push back are solved for with them; where \p rods_lead those that the
    /// last move has bent stay where it took them, as other rods do.
    /// Where the rest shape has a boundary, contacts are found at the poses, solved with
    /// and found again, until none is new, at most eight times: then it is as at the
    /// limit of iterations.
    SolveReport solve(const SolveOptions& options, bool rods_lead = false);
    /// Starts from other poses, to which \p other has come in other cells.
    void set_state(std::span<const Pose> poses, const CellSystem& other);
    /// All that the next solve depends on.
    CellSystemState state() const
    {
        return {poses_, driving_->now(), driving_->way_left(),
                minimizer_->is_refreshed()};
    }
    /// Goes on from a state of a system in the same cells, to the same bits as from
    /// there.
    void set_state(const CellSystemState& state);
    /// Makes the preconditioner for the state as it is: where that is far from rest, a
    /// solve takes fewer steps, by more than this costs. From then on forget_way() makes
    /// it anew, too.
    void precondition_here() { minimizer_->forget(poses_, true); }
    /// From here on a solve depends on state() alone, not on the way to it.
    void forget_way();

    /// Of each region the centroid of the glue between its cells and free ones; its
    /// centre where there is none [work].
    std::vector<Eigen::Vector3d> region_borders() const;
    /// The energy of the glue, of contacts, and of the rods that push back; parts that
    /// follow do not count.
    double energy() const;
    /// Where parts are pressed against each other at the current poses.
    std::vector<FoundContact> contacts() const;
    /// Between glued cells [diagonal].
    double largest_gap() const;

private:
    void make_minimizer();
    void hold_driven();
    void place_pushing_rods();
    void lead_pushing_rods();
    void take_solved_rods();
    void take_solved();
    void take_contacts();
    void solve_to_holds(const SolveOptions& options, double used, SolveReport& report);
    void check_memory(const char* what, double bytes,
                      const CellSystemSettings& settings) const;

    std::shared_ptr<const Body> body_;
    std::shared_ptr<const RegionSet> regions_;
    std::vector<RegionShares> shares_;
    Glue glue_;
    std::vector<Pose> poses_;
    std::optional<RegionDriving> driving_;
    std::optional<CarriedParts> parts_;
    LooseParts loose_;
    std::optional<ContactFinder> finder_;
    std::vector<FoundContact> contacts_;
    bool has_rigid_steps_;            ///< see Departures
    std::vector<PushingSpline> rods_; ///< that push back
    std::optional<CellMinimizer> minimizer_;
    PushingSplines* pushing_ = nullptr; ///< a part of the minimizer; null: none
    bool rods_lead_ = false;            ///< in the last solve
    std::vector<std::optional<RegionFade>> fades_;
    std::optional<std::vector<TouchingSamples>> touching_;
};

} // namespace cellwarp::core
