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
#include "editor/session/regions.h"
#include "solver/field/field.h"
#include "solver/minimize.h"
#include "solver/motion_spread.h"

namespace cellwarp
{

struct RigSettings
{
    double max_memory = 0.0; ///< [byte], 0: no limit
    Method method = Method::Newton;
};

class Rig
{
public:
    /// \p regions of the samples of \p body; \p file is where they stand, for messages.
    /// All is at rest. Throws Fault::Malformed for a region that selects nothing,
    /// Fault::Unsolvable for one that others leave no cell, Fault::Budget.
    Rig(std::shared_ptr<const Body> body, std::vector<Region> regions,
        const RigSettings& settings, const std::string& file);

    const Body& body() const { return *body_; }
    const std::vector<Region>& regions() const { return regions_; }
    const std::vector<int>& region_of_cell() const
    {
        return region_of_cell_;
    } ///< -1: none
    const std::vector<Constraint>& constraints() const { return constraints_; }
    const std::vector<Pose>& poses() const { return poses_; }
    const Minimizer& minimizer() const { return *minimizer_; }
    const std::vector<std::string>& warnings() const { return warnings_; }

    /// The box of a region's samples, or of its cells' centres if it has none [work].
    const ModelBox& box(std::size_t region) const { return boxes_[region]; }
    /// A sample that two regions hold: their motions must agree about it.
    struct Overlap
    {
        std::size_t a, b;
        std::uint32_t sample;
    };
    const std::vector<Overlap>& overlaps() const { return overlaps_; }
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

    void measure_regions(const std::vector<RegionShares>& shares);
    void find_overlaps();
    void hold_cells(const std::vector<RegionShares>& shares);
    void hold_pins(const std::vector<RegionShares>& shares);
    void warn_of_components();
    void place_fades();
    void check_memory(const char* what, double bytes, const RigSettings& settings) const;
    std::optional<Motion> rigid_step_of(const Component& component) const;

    std::shared_ptr<const Body> body_;
    std::vector<Region> regions_;
    std::vector<int> region_of_cell_;
    std::vector<ModelBox> boxes_;
    std::vector<Overlap> overlaps_;
    std::vector<Constraint> constraints_;
    std::vector<Part> parts_;
    Glue glue_;
    std::optional<Minimizer> minimizer_;
    std::optional<MotionSpread> spread_;
    std::vector<std::optional<RegionFade>> fades_;
    std::vector<std::string> warnings_;
    // State.
    std::vector<Pose> poses_;
    std::vector<Motion> motions_, last_motions_, steps_; ///< a region
};

} // namespace cellwarp
