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
#include "solver/field/influence_kernel.h"

namespace cellwarp::core
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

/// The cells that may count at places in a box that one cell holds, and a short way
/// through the glue to each of them.
class CellsAround
{
public:
    /// \p own: holds the places; [\p low, \p high]: the box around their nearest points
    /// in its box.
    void find(const ClosestCells& closest, int own, const Eigen::Vector3d& low,
              const Eigen::Vector3d& high);

    int own() const { return cells_[own_place_]; }
    /// Ascending.
    std::span<const int> cells() const { return cells_; }
    /// Gives away the memory that is not needed any more.
    void shrink();
    std::size_t num_bytes() const;

private:
    friend class PlaceInfluences;
    /// How a cell is reached from the own one.
    struct Way
    {
        double away = 0.0;       ///< squared distance of the middle over edge
        int hops = -1;           ///< glued faces between it and the own cell
        int lead = -1;           ///< the one before it on the way; the own one's: -1
        bool is_regular = false; ///< the way is one of a regular grid
        bool is_asked = false;   ///< whether it is short, or another through it
    };
    void find_ways(const ClosestCells& closest, const Eigen::Vector3d& middle);
    void ask_for_ways();

    std::size_t own_place_ = 0; ///< of the own cell, among:
    std::vector<int> cells_;    ///< ascending
    std::vector<CellBox> boxes_;
    std::vector<Way> ways_;  ///< by their number among the cells, likewise:
    std::vector<int> order_; ///< all of them, by hops
    bool has_asked_ = false;
};

/// The weights of ClosestCells for eight places that one cell holds. A scratch object:
/// one a thread.
class PlaceInfluences
{
public:
    explicit PlaceInfluences(const ClosestCells& closest) : closest_(closest) {}

    /// The influences, ascending by cell; 0 where a cell does not count. \p around: of a
    /// box that holds the places.
    std::span<const InfluenceOnPlaces>
    find(const PlaceVectors& places, const CellsAround& around, bool wants_gradient);
    /// Of these places, those that are in the box of the cell that holds them.
    const Eigen::Array<bool, kPlaces, 1>& are_inside() const { return are_inside_; }

private:
    using PlaceMarks = Eigen::Array<bool, kPlaces, 1>;
    PlaceMarks find_plain(const PlaceVectors& places, const CellsAround& around,
                          bool wants_gradient);
    PlaceMarks narrow_places(const CellsAround& around, const PlaceVectors& inside,
                             std::span<const PlaceNumbers> rests) const;
    void find_alone(const PlaceVectors& places, const CellsAround& around, int place);

    const ClosestCells& closest_;
    PlaceMarks are_inside_;
    std::vector<InfluenceOnPlaces> found_;
    std::vector<Influence> single_;
};

/// How the cells move their material.
std::vector<CellMap> cell_maps(const Cells& cells, std::span<const Pose> poses);

/// The maps of the influences, blended at the places. [Botsch07]
void blend(std::span<const InfluenceOnPlaces> influences, std::span<const CellMap> maps,
           const PlaceVectors& places, bool wants_gradient, ValueOnPlaces& out);

} // namespace cellwarp::core
