// SPDX-License-Identifier: GPL-3.0-or-later
// The blend of the cells around a place, for eight places at a time: as many as fit into
// the processor's registers side by side. All eight lie in the material of one cell, so
// they share the search for the cells around it. Each place takes part in the same
// operations in the same order as if it came alone: its result does not depend on the
// other seven, to the bit.
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "solver/field/blend.h"
#include "solver/field/rbf_kernel.h"

namespace cellwarp
{

inline constexpr int kPlaces = static_cast<int>(kPlaceLanes);

/// One number of each place; a vector of each place.
using PlaceNumbers = Eigen::Array<double, kPlaces, 1>;
using PlaceVectors = Eigen::Array<double, kPlaces, 3>;

/// A displacement and its derivative (blend.h) at each place.
struct ValueOnPlaces
{
    PlaceVectors displacement = PlaceVectors::Zero();
    std::array<PlaceVectors, 3> slopes = {PlaceVectors::Zero(), PlaceVectors::Zero(),
                                          PlaceVectors::Zero()}; ///< along each axis
    FieldValue at(int place) const;
    void set(int place, const FieldValue& value);
};

/// All places are \p x.
PlaceVectors everywhere(const Eigen::Vector3d& x);

/// Influence (blend.h) of one cell on eight places.
struct InfluenceOnPlaces
{
    int cell = 0;
    PlaceNumbers weight = PlaceNumbers::Zero();
    PlaceVectors gradient = PlaceVectors::Zero(); ///< if wanted
};

/// The weights of ClosestCells for eight places that one cell holds. A scratch object:
/// one a thread.
class PlaceInfluences
{
public:
    explicit PlaceInfluences(const ClosestCells& closest) : closest_(closest) {}

    /// Before the places: which cell holds them, and the box around their nearest points
    /// in its box.
    void enter(int own, const Eigen::Vector3d& low, const Eigen::Vector3d& high);
    /// The influences, ascending by cell; 0 where a cell does not count.
    std::span<const InfluenceOnPlaces> find(const PlaceVectors& places,
                                            bool wants_gradient);

private:
    using PlaceMarks = Eigen::Array<bool, kPlaces, 1>;
    void find_ways(const Eigen::Vector3d& middle);
    void ask_for_ways();
    PlaceMarks find_plain(const PlaceVectors& places, bool wants_gradient);
    PlaceMarks narrow_places(const PlaceVectors& inside,
                             std::span<const PlaceNumbers> rests) const;
    void find_alone(const PlaceVectors& places, int place);

    const ClosestCells& closest_;
    int own_ = 0;
    std::vector<int> near_; ///< cells that may count, ascending
    // Of each of these, by its number there:
    std::vector<double> away_;     ///< squared distance over edge
    std::vector<int> hops_;        ///< glued faces between it and the own cell
    std::vector<int> lead_;        ///< the one before it on a way; the own one's: -1
    std::vector<char> is_regular_; ///< that way is one of a regular grid
    std::vector<char> is_asked_;   ///< whether that way is short, or another through it
    std::vector<int> order_;       ///< all of them, by hops
    bool has_asked_ = false;
    std::vector<InfluenceOnPlaces> found_;
    std::vector<Influence> single_;
};

/// The poses of the influences, blended at the places. [Botsch07]
void blend(std::span<const InfluenceOnPlaces> influences, std::span<const Pose> poses,
           const Cells& cells, const PlaceVectors& places, bool wants_gradient,
           ValueOnPlaces& out);

} // namespace cellwarp
