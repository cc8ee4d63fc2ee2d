// SPDX-License-Identifier: GPL-3.0-or-later
// What the region statements of a handle file mean for one model: the places and samples
// that a region names.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "io/scene/handle_file.h"
#include "library/session/handle_trajectory.h"
#include "library/session/led_rod.h"
#include "library/session/spline_handle.h"
#include "octree/coincident_samples.h"

namespace cellwarp::core
{

/// A geometric selector in model coordinates.
struct RegionShape
{
    std::function<bool(const Eigen::Vector3d&)> holds; ///< closed
    /// Of a point outside [model unit]; infinite where there is nothing inside. Never
    /// more than that, and not above 0 inside.
    std::function<double(const Eigen::Vector3d&)> distance;
    /// Bounds of it; infinite where it has none.
    Eigen::Vector3d low = Eigen::Vector3d::Constant(-INFINITY);
    Eigen::Vector3d high = Eigen::Vector3d::Constant(INFINITY);
};

/// A region of one stage, all its selectors together.
struct Region
{
    Role role = Role::Fixed;
    std::string name;
    double factor = 1.0;                ///< of a stiff region
    std::int64_t line = 0;              ///< of its first statement
    std::vector<std::uint32_t> samples; ///< sorted
    bool is_at_one_place = false;       ///< it has samples, and they are
    /// About which it turns where a move does not say: the centre of the box of its rest
    /// samples; of one without samples, of its shapes as far as they are in the model's
    /// box [model unit].
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    /// Sorted; the ones named one by one (lists, labels, groups), with all that coincide.
    std::vector<std::uint32_t> listed;
    std::vector<RegionShape> shapes; ///< one a geometric selector
    /// Of a rod or curve. The tube of a rod is its shapes.
    std::shared_ptr<const SplineHandle> spline = {};
    std::shared_ptr<const SplineStatement> told = {}; ///< null: it is led
    bool is_led() const { return spline && !told; }
    std::int64_t spans =
        0;                 ///< of each gap of `told`; fewer than stated if it pushes back
    bool is_exact = false; ///< of a rod: its samples end where its frames have them
    /// The curve or rod that a pin of one place stays on.
    struct Guide
    {
        std::size_t region = 0;   ///< by index
        std::optional<double> at; ///< share of its rest length; none: it slides
        std::int64_t line = 0;
    };
    std::optional<Guide> guide = {};
    /// What moves with one joint of a skeleton. It holds no sample: the field carries
    /// all.
    struct Bone
    {
        std::size_t joint = 0;
        /// Straight pieces whose cells it has, whatever share of them is its own [work].
        std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> lines;
    };
    std::optional<Bone> bone = {};

    bool is_rod() const { return role == Role::Rod; }
    /// Its cells' places are given, or a point of each.
    bool prescribes() const { return role != Role::Stiff && role != Role::Curve; }
    /// It has one rigid motion, of which its moves tell where its centroid goes.
    bool turns_freely() const { return role == Role::Pin && !is_at_one_place; }
    bool is_pin_of_one_place() const { return role == Role::Pin && is_at_one_place; }
    /// By one motion of all.
    bool moves_as_one() const { return prescribes() && role != Role::Rod; }
    bool holds(const Eigen::Vector3d& model_point) const;
};

/// Resolves statements of \p file. \p samples: the rest samples [model unit], in the
/// order of \p geometry, which gives the groups; \p known_coincident: of them, where
/// somebody has them already; \p led_rods come after the regions of the statements.
/// Throws Fault::Malformed for a group or label that does not exist, an index out of
/// range, a label file of another length, a rod or curve without length, and what reading
/// a label file throws.
std::vector<Region> resolve_regions(const std::vector<RegionStatement>& statements,
                                    const Geometry& geometry,
                                    const std::vector<Eigen::Vector3d>& samples,
                                    const Units& units, const HandleFile& file,
                                    const CoincidentSamples* known_coincident = nullptr,
                                    std::span<const LedRod> led_rods = {});

/// Throws what resolve_regions() throws for the samples, groups and label files that
/// statements of \p file name.
void check_lists(const std::vector<RegionStatement>& statements, const Geometry& geometry,
                 const HandleFile& file);

/// Puts pins on curves and rods. Throws Fault::Malformed for a pin that is not of one
/// place.
void put_on_guides(std::span<const OnStatement> statements, const std::string& file,
                   std::vector<Region>& regions);

/// " (line 12)": where a region stands; empty where it stands in no file.
std::string line_note(const Region& region);

/// " (the nearest sample, 17, is 0.3 away, at 1 2 3, relative 0.5 1 0.2)": by how much a
/// region missed the model.
std::string nearest_sample_note(const Region& region,
                                const std::vector<Eigen::Vector3d>& samples);

} // namespace cellwarp::core
