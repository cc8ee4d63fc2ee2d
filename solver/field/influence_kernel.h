// SPDX-License-Identifier: GPL-3.0-or-later
// The inner loops of the closest-cell blend and of fades at places that are not known
// beforehand, for each instruction set. All make the same sums in the same order, so
// their results are the same to the bit.
#pragma once

#include <cstddef>
#include <cstdint>

#include "octree/base/instruction_set.h"
#include "solver/field/rbf_kernel.h"

namespace cellwarp::core
{

struct CellBox
{
    double centre[3];
    double edge;
};

/// Displacement by a cell: A (x - centre) + shift.
struct CellMap
{
    double turn[9]; ///< A by rows
    double shift[3];
    double centre[3];
};

/// The plain weights of ClosestCells at places that one cell holds; rows of
/// kPlaceLanes.
struct PlaceWeights
{
    const CellBox* boxes = nullptr;
    std::size_t num_boxes = 0, own = 0; ///< own: which of them holds the places
    double slack = 0.0; ///< so far beyond its faces the own box holds a place [edge]
    const double* places = nullptr; ///< rows x, y, z
    double* inside = nullptr;       ///< out, likewise: nearest in the own box
    double* is_within = nullptr;    ///< out, likewise: 1 where that is the place, or 0
    double* rests = nullptr;        ///< out, a row for each box: 1 - d/s, or 0
    double* weights = nullptr;      ///< out, likewise, every \p stride numbers
    double* slopes = nullptr;       ///< out, three rows likewise; null: not wanted
    std::size_t stride = 0;
};

/// The maps of some cells, blended at places.
struct PlaceBlend
{
    const CellMap* maps = nullptr;   ///< of all cells
    const int* cells = nullptr;      ///< every \p cell_stride
    const double* weights = nullptr; ///< a row for each, every \p stride numbers
    const double* slopes = nullptr;  ///< three rows likewise; null: not wanted
    std::size_t num_cells = 0, stride = 0, cell_stride = 0;
    const double* places = nullptr; ///< rows x, y, z
    double* displacement = nullptr; ///< out, rows
    double* along = nullptr; ///< out, if slopes are wanted: nine rows, axis by axis
};

/// Squared distances of nodes from a place.
struct NodeSquares
{
    const double* nodes = nullptr; ///< rows x, y, z, every \p stride numbers
    std::size_t num_nodes = 0;     ///< a multiple of kPlaceLanes
    std::size_t stride = 0;
    double place[3] = {};
    double* squares = nullptr; ///< out
};

struct InfluenceKernels
{
    void (*weights)(const PlaceWeights&);
    void (*blend)(const PlaceBlend&);
    /// Returns the least of the squares.
    double (*squares)(const NodeSquares&);
    /// Of each number how many are less, into \p ranks. Both have room for \p count
    /// rounded up to a multiple of kPlaceLanes; what is beyond it does not matter.
    void (*ranks)(const double* numbers, std::size_t count, std::int64_t* ranks);
};

/// \pre \p set is one of instruction_sets()
InfluenceKernels influence_kernels(InstructionSet set);
/// Of the widest set that this processor has.
const InfluenceKernels& widest_influence_kernels();

} // namespace cellwarp::core
