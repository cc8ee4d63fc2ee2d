// SPDX-License-Identifier: GPL-3.0-or-later
// Moves the cells that regions hold: by rigid motions, along rods, and at the places of
// pins. carried_parts.h has what the other cells do then.
#pragma once

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "library/session/body.h"
#include "library/session/pushing_splines.h"
#include "library/session/region_set.h"
#include "solver/cells/cell_minimizer.h"
#include "solver/cells/glue.h"
#include "solver/cells/initial_guess.h"

namespace cellwarp::core
{

/// The state to which a region is driven.
struct Driven
{
    Motion motion = {}; ///< from rest, without what a pin has turned
    /// The place of a rod or curve, before the motion; null for others.
    std::shared_ptr<const SplineState> spline = nullptr;
    double s = 0.0; ///< parameter of a pin on its curve
};

/// A step of the driving is that of a region, or of a place of a rod: there are about as
/// many of these as cells along it. Steps are numbered: the regions, then these places.
class RegionDriving
{
public:
    /// At rest. \p region_of_cell from prescribing_regions(), \p borders of its glue, or
    /// none. Sets the \p poses of pins on curves. Throws Fault::Unsolvable for one whose
    /// cell another region holds.
    RegionDriving(std::shared_ptr<const Body> body,
                  std::shared_ptr<const RegionSet> regions,
                  std::vector<int> region_of_cell, std::span<const BorderGlue> borders,
                  std::vector<Pose>& poses);

    /// -1: none. Of a pin on a curve only the cell of its sample is left.
    const std::vector<int>& region_of_cell() const { return region_of_cell_; }
    const std::vector<Constraint>& constraints() const { return constraints_; }
    /// LooseParts marks what follows.
    std::vector<Constraint>& constraints() { return constraints_; }
    bool has_groups() const { return !groups_.empty(); }

    /// One a region.
    const std::vector<Driven>& now() const { return now_; }
    double way_left() const { return way_left_; }
    /// One a region: as it is moved, and as a pin of several places has turned.
    const std::vector<Motion>& found_motions() const { return found_motions_; }
    /// The motion that a region's cell, or what is near it, takes from it: for a rod that
    /// of its frame nearest to the rest place \p x.
    Motion motion_at(std::size_t region, const Eigen::Vector3d& x) const;
    /// True if the last move has bent a rod or curve.
    bool is_bent(std::size_t region) const { return is_bent_[region]; }
    bool has_bent() const;

    std::size_t num_steps() const { return now_.size() + stations_.size(); }
    /// From rest to before the last move, and to now.
    const Motion& before_step(std::size_t step) const
    {
        return step < last_.size() ? last_[step].motion
                                   : last_station_motions_[step - last_.size()];
    }
    const Motion& after_step(std::size_t step) const
    {
        return step < now_.size() ? now_[step].motion
                                  : station_motions_[step - now_.size()];
    }
    /// The steps of a rod, [first, end), and the rest place of one of them.
    std::pair<std::size_t, std::size_t> steps_of_rod(std::size_t region) const
    {
        return {now_.size() + first_station_[region],
                now_.size() + first_station_[region + 1]};
    }
    Eigen::Vector3d rest_of_rod_step(std::size_t step) const;
    /// The steps that each cell takes part in: that of its region, on a rod those of the
    /// places around it.
    std::vector<Driving> driving() const;

    /// See CellSystem::move_regions().
    void move(std::span<const Motion> motions,
              std::span<const std::shared_ptr<const SplineState>> splines,
              double way_left, std::vector<Pose>& poses);
    /// The same, and the next step begins there.
    void start_from(std::span<const Driven> regions, double way_left,
                    std::vector<Pose>& poses);
    /// Carries all cells of pins of several places by what their leaders have turned.
    void settle_groups(std::vector<Pose>& poses);
    /// Gives the leaders the turns of other cells.
    void turn_groups(std::span<const Motion> found_motions,
                     std::vector<Pose>& poses) const;
    /// Takes over where a solve has left the pins on curves.
    void take_pins(const CellMinimizer& solved);
    /// Takes over where a solve has left a rod; place_rods() moves the cells.
    void take_rod(std::size_t region, std::shared_ptr<const SplineState> solved)
    {
        now_[region].spline = std::move(solved);
    }
    void place_rods(std::vector<Pose>& poses);

    /// The rods with stiffness, and their cells. \p components of the body.
    std::vector<PushingSpline>
    pushing_splines(std::span<const Component> components) const;

private:
    /// A place of a rod, whose motion other cells take part in.
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
        void set(const Driven& curve, const Eigen::Vector3d& off)
        {
            curve_ = curve;
            off_ = off;
        }
        RailPlace at(double s) const override;
        double begin() const override { return of_.begin(); }
        double end() const override { return of_.end(); }
        bool is_closed() const override { return of_.is_closed(); }

    private:
        const SplineHandle& of_;
        Driven curve_;
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

    const RestShape& rest() const { return *body_->rest; }
    const Eigen::Vector3d& centre_of(std::size_t cell) const
    {
        return body_->cells.cells[cell].centre;
    }
    bool is_on_rod(std::size_t cell) const;
    void hold_cells();
    void hold_group(std::size_t region);
    void set_insets(std::span<const BorderGlue> borders);
    void place_stations();
    void place_guided(std::vector<Pose>& poses);
    void hold_guided(std::vector<Pose>& poses);
    void place_cells(std::vector<Pose>& poses);
    void find_station_motions();
    Pose pose_on_rod(std::size_t cell) const;

    std::shared_ptr<const Body> body_;
    std::shared_ptr<const RegionSet> regions_;
    std::vector<int> region_of_cell_;
    std::vector<Constraint> constraints_;
    std::vector<double> on_rod_;    ///< parameter of a rod's cell; empty: no rods
    std::vector<Station> stations_; ///< of all rods
    std::vector<std::size_t> first_station_; ///< regions + 1 offsets into stations
    std::vector<Guided> guided_;
    std::vector<Group> groups_;
    // State.
    std::vector<Driven> now_, last_;
    std::vector<Motion> station_motions_, last_station_motions_;
    std::vector<char> is_bent_; ///< of the regions
    std::vector<Motion> found_motions_;
    double way_left_ = 1.0;
};

} // namespace cellwarp::core
