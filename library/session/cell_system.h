// SPDX-License-Identifier: GPL-3.0-or-later
// A body with its regions: which cells they move, what is solved for the others, and
// where all of them are. Made anew for another body or other regions, never for a motion.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "library/session/body.h"
#include "library/session/contact_finder.h"
#include "library/session/handle_trajectory.h"
#include "library/session/loose_parts.h"
#include "library/session/pushing_splines.h"
#include "library/session/region_set.h"
#include "solver/cells/cell_minimizer.h"
#include "solver/cells/initial_guess.h"
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

/// Components that have samples, by what becomes of them.
struct PartsByHold
{
    std::size_t held = 0;   ///< by regions
    std::size_t follow = 0; ///< others
    std::size_t stay = 0;   ///< at rest
};

/// Where the cells of a system are.
struct CellSystemState
{
    std::vector<Pose> poses;
    std::vector<Motion> motions; ///< of the regions, without what pins have turned
    /// Of the regions: where rods and curves are; null for others.
    std::vector<std::shared_ptr<const SplineState>> splines;
    std::vector<double> on_guide; ///< of the regions: parameter of a pin on its curve
    double way_left = 1.0;        ///< see move_regions()
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
    /// Of the regions: as they are moved, and as pins of several places have turned.
    const std::vector<Motion>& motions() const { return found_motions_; }
    /// Of the regions: where rods and curves are, before their motions; null for others.
    const std::vector<std::shared_ptr<const SplineState>>& splines() const
    {
        return splines_;
    }
    /// The motion that a region's cell, or what is near it, takes from it: for a rod that
    /// of its frame nearest to the rest place \p x.
    Motion motion_at(std::size_t region, const Eigen::Vector3d& x) const;
    const CellMinimizer& minimizer() const { return *minimizer_; }
    const std::vector<std::string>& warnings() const { return warnings_; }
    PartsByHold parts_by_hold() const;

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
    double way_left() const { return way_left_; }
    /// A pin on its way: round with all that holds its part of the material, and straight
    /// by what is left.
    struct PinWay
    {
        std::size_t region;
        HandleTrajectory around;
        Eigen::Vector3d rest, from, left; ///< place at rest and at first; what is left
        Motion at(double t) const;        ///< \p t in [0, 1)
    };
    /// The ways of the pins that go round when the regions go from motions to motions.
    /// Pins on curves, and in parts with rods, go with these.
    std::vector<PinWay> pin_ways(std::span<const Motion> from,
                                 std::span<const Motion> to) const;
    /// The share of its curve's rest length where a pin is, and the force of the curve on
    /// it [work^2].
    double share_on_guide(std::size_t region) const;
    Eigen::Vector3d place_on_guide(std::size_t region) const; ///< [work]
    Eigen::Vector3d force_of_guide(std::size_t region) const;
    /// Lets the others take part in the last move: a component whose regions all made one
    /// rigid step makes it as a whole, in others each cell by its share. Pins turn as the
    /// best rigid step of all that holds their component does.
    void carry_others();
    /// Finds the shares, once; carry_others() does it where it was not done before.
    void make_guess();
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
    /// Starts from other poses, at which the regions have made \p motions.
    void set_state(std::span<const Pose> poses, std::span<const Motion> motions);
    /// The same with all of another system's regions, in other cells.
    void set_state(std::span<const Pose> poses, const CellSystem& other);
    /// All that the next solve depends on.
    CellSystemState state() const
    {
        return {poses_,    motions_,  splines_,
                on_guide_, way_left_, minimizer_->is_refreshed()};
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
    /// A place that leads a part of the material: that of a pin's cell, of a handle where
    /// the part borders it, or of a rod.
    struct Holder
    {
        std::size_t step; ///< in steps_
        Eigen::Vector3d rest;
        bool is_pin; ///< its motion tells nothing of a turn
        Eigen::Vector3d at(const Motion& motion) const
        {
            return is_pin ? Eigen::Vector3d(rest + motion.t) : motion(rest);
        }
    };
    /// A connected part: its cells that no region prescribes.
    struct Part
    {
        Component component;
        std::vector<int> movable;
        std::vector<Holder> holders;           ///< none where no pin is among them
        std::vector<Eigen::Vector3d> from, to; ///< scratch, one a holder
    };

    /// A place of a rod, whose motion the others take part in.
    struct Station
    {
        std::size_t region;
        double s;
    };

    /// The curve of a pin, where it is now.
    class GuideRail final : public Rail
    {
    public:
        explicit GuideRail(const SplineHandle& of) : of_(of) {}
        void set(const std::shared_ptr<const SplineState>& now, const Motion& motion,
                 const Eigen::Vector3d& off)
        {
            now_ = now;
            motion_ = motion;
            off_ = off;
        }
        RailPlace at(double s) const override;
        double begin() const override { return of_.begin(); }
        double end() const override { return of_.end(); }
        bool is_closed() const override { return of_.is_closed(); }

    private:
        const SplineHandle& of_;
        std::shared_ptr<const SplineState> now_;
        Motion motion_;
        Eigen::Vector3d off_ = Eigen::Vector3d::Zero(); ///< of all places
    };
    /// The cells of a pin that is one rigid body.
    struct Group
    {
        std::size_t region;
        std::vector<int> cells; ///< the first leads
    };
    /// A pin on a curve.
    struct Guided
    {
        std::size_t region;
        int cell;
        Eigen::Vector3d off; ///< from the curve at rest to the pin at rest
        std::unique_ptr<GuideRail> rail;
    };

    void hold_cells();
    void set_insets(std::span<const BorderGlue> borders);
    void hold_group(std::size_t region);
    void settle_groups();
    void place_stations();
    void place_guided();
    void settle_regions();
    void hold_guided();
    std::vector<Driving> driving() const;
    void find_station_motions(std::vector<Motion>& motions) const;
    Pose pose_on_rod(std::size_t cell) const;
    std::vector<PushingSpline> pushing_splines(const std::vector<Component>& components);
    void place_pushing_rods();
    void lead_pushing_rods();
    void take_solved_rods();
    void take_guided();
    void make_minimizer();
    void take_contacts();
    void take_solved();
    void solve_to_holds(const SolveOptions& options, double used, SolveReport& report);
    void hold_pins();
    void warn_of_components();
    void warn_of_loose_parts(std::span<const std::size_t> samples);
    std::vector<std::size_t> samples_of_parts() const;
    void check_memory(const char* what, double bytes,
                      const CellSystemSettings& settings) const;
    std::vector<Holder> holders_of(const Component& component,
                                   std::span<const Eigen::Vector3d> borders) const;
    Motion best_step(std::span<const Eigen::Vector3d> from,
                     std::span<const Eigen::Vector3d> to) const;
    void turn_pins(Part& part);
    std::optional<Motion> rigid_step_of(const Component& component) const;

    std::shared_ptr<const Body> body_;
    std::shared_ptr<const RegionSet> regions_;
    std::vector<RegionShares> shares_;
    std::vector<int> region_of_cell_;
    std::vector<Constraint> constraints_;
    std::vector<Part> parts_;
    Glue glue_;
    LooseParts loose_;
    std::optional<ContactFinder> finder_;
    std::vector<FoundContact> contacts_;
    bool has_rigid_steps_;                     ///< see Departures
    std::vector<std::size_t> pushing_regions_; ///< of the rods that push back
    std::vector<PushingSpline> rods_;          ///< those
    std::optional<CellMinimizer> minimizer_;
    PushingSplines* pushing_ = nullptr; ///< a part of the minimizer; null: none
    bool rods_lead_ = false;            ///< in the last solve
    std::vector<char> is_bent_;         ///< of the regions: a spline, by the last move
    std::optional<InitialGuess> guess_;
    std::vector<std::optional<RegionFade>> fades_;
    std::optional<std::vector<TouchingSamples>> touching_;
    std::vector<std::string> warnings_;
    std::vector<double> on_rod_;    ///< parameter of a rod's cell; empty: no rods
    std::vector<Station> stations_; ///< of all rods
    std::vector<std::size_t> first_station_; ///< regions + 1 offsets into stations
    std::vector<Guided> guided_;
    std::vector<Group> groups_;
    // State.
    std::vector<Pose> poses_;
    std::vector<Motion> motions_, last_motions_; ///< a region, as it is moved
    std::vector<Motion> found_motions_;          ///< a region, as it has turned too
    std::vector<std::shared_ptr<const SplineState>> splines_, last_splines_;
    std::vector<Motion> station_motions_, last_station_motions_;
    std::vector<double> on_guide_; ///< a region; empty: none
    double way_left_ = 1.0;
    std::vector<Motion> steps_; ///< of the regions, then of the stations
};

} // namespace cellwarp::core
