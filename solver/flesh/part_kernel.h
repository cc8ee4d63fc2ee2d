// SPDX-License-Identifier: GPL-3.0-or-later
// The inner loops over parts of a lattice, for each instruction set: what stiffness and
// mass make of displacements, from the points of integration, without a matrix. All make
// the same sums in the same order, so their results are the same to the bit.
#pragma once

#include <cstddef>

#include "octree/base/instruction_set.h"

namespace cellwarp::core
{

/// Parts are lanes: blocks of this many, the last one padded.
constexpr std::size_t kPartLanes = 8;

/// Entries of the lower triangle of a matrix of eight corners.
constexpr std::size_t kCornerPairs = 36;

/// One quantity of the parts of a block.
struct alignas(64) PartRow
{
    double lane[kPartLanes];
};

/// Parts of boxes: point k is at centre + sum_i sign_of(k, i) spread column i, in units
/// of the box, from its middle. Matrices are by columns: row 3 j + i is entry (i, j).
struct PartBlock
{
    PartRow lambda, shear;
    PartRow rest[24]; ///< corners, from the middle of the cell
    PartRow centre[3], spread[9];
    PartRow inverse_edge; ///< of the box
    PartRow weight;       ///< of each point
    /// mode_solve() times the weight of all points, its lower triangle row by row.
    PartRow mode_solve[45];
    PartRow mass[kCornerPairs]; ///< M, the same
};

/// One block's part in a product.
struct PartRun
{
    const PartBlock* block = nullptr;
    const int* nodes = nullptr;      ///< of each corner, all lanes
    const double* values = nullptr;  ///< three a node
    const PartRow* frames = nullptr; ///< R, nine rows
    const PartRow* tubes = nullptr;  ///< T, as the block has its mass; or none
    double mass = 0.0, stiffness = 0.0, tube = 0.0;
    /// The values are displacements u, and what the stiffness sees is
    /// R^T (X + u) - X; mass and tube see nothing.
    bool from_rest = false;
    PartRow* out = nullptr; ///< 24 rows: corner, axis
};

/// The forces of values v, mass M v + stiffness R K R^T v + tube T v, or those to rest.
struct PartKernels
{
    void (*product)(const PartRun&);
    /// sum w grad of the values alone, nine rows.
    void (*gradients)(const PartRun&);
};

PartKernels part_kernels(InstructionSet set);

} // namespace cellwarp::core
