// SPDX-License-Identifier: GPL-3.0-or-later
// A saved deformation: a map of space as plain arrays, self-contained. Written byte by
// byte (little-endian):
//
//   8 bytes   "cwfield\n"
//   uint32    version, 1
//   uint32    stages: maps that follow each other, one for each commit and the last
//   sections, in the order of StoredField below, stage after stage; then one named "end"
//   that holds the CRC-32 (as in zip files) of all bytes before it, as uint32
//
// A section:
//   12 bytes  its name, padded with zeros
//   uint32    what it holds: 1 int32, 2 uint32, 3 double, 4 uint8
//   uint64    how many
//   the numbers; then zeros up to a multiple of 8 bytes
//
// Lengths and places are in work units: the model's places less `origin`, times
// 2^exponent, in the directions `axes`.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cellwarp::core
{

/// A motion of a region and by how much the field misses it at the nodes: the places of
/// its samples, and others at its border.
struct StoredRegion
{
    std::array<double, 12> motion = {};   ///< "motion": R by rows, t
    double radius = 0.0;                  ///< "radius" of the fade
    std::uint8_t may_turn = 0;            ///< "may turn": 1 a pin, 2 a rod
    std::vector<double> nodes;            ///< "nodes": 3 each
    std::vector<std::int32_t> node_cells; ///< "node cells": whose material holds a node
    std::vector<double> misses; ///< "misses": 12 a node: miss, gradient by columns
    std::vector<std::int32_t>
        near_cells; ///< "near cells" that the fade may reach, ascending
    std::vector<std::int32_t> deep_cells; ///< "deep cells": the motion alone, ascending
};

/// One map. The names of the sections stand in quotes.
struct StoredField
{
    // The frame.
    std::array<double, 3> origin = {}; ///< "origin" [model unit]
    std::array<double, 9> axes = {};   ///< "axes": a rotation, by rows
    std::int32_t exponent = 0;         ///< "exponent"
    std::array<double, 3> size = {};   ///< "size" of the model's box
    // Where the material is: the box in voxels, and the piece (cell) of each.
    std::array<std::int32_t, 3> coarsest = {}; ///< "coarsest" leaves along each axis
    double edge = 0.0;                         ///< "edge" of a coarsest leaf
    std::int32_t max_depth = 0;                ///< "max depth" below it
    std::int32_t voxels_per_leaf = 0;          ///< "leaf voxels" along the finest leaf
    std::vector<std::uint32_t> run_lengths;    ///< "runs": voxels of one piece, x fastest
    std::vector<std::int32_t> run_pieces;      ///< "run pieces": of each run; -1: none
    // The cells.
    std::vector<double> box_centres;           ///< "box centres": 3 each
    std::vector<double> edges;                 ///< "edges" of their boxes
    std::vector<double> centres;               ///< "centres" of their pieces: 3 each
    std::vector<std::int32_t> first_neighbour; ///< "neighbours 1": cells + 1 offsets
    std::vector<std::int32_t> neighbours;      ///< "neighbours": glued to a cell
    std::vector<double> poses;                 ///< "poses": 12 each: R by rows, p
    std::vector<std::uint8_t> is_idle;         ///< "idle": at rest whatever else moves
    // The field.
    std::int32_t kind = 0;         ///< "kind": 0 blend, 1 closest4, 2 rbf, 3 rbf-global,
                                   ///< 4 rbf-centres
    std::uint32_t num_centres = 0; ///< "centre count" of an RBF
    double residual = 0.0;         ///< "residual" of its fit
    std::vector<std::int32_t> first_membership; ///< "members 1": cells + 1 offsets (rbf)
    std::vector<std::int32_t> membership_fits;  ///< "members": RBFs a cell belongs to;
                                                ///< -1: the blend of the cells
    std::vector<double> membership_weights;     ///< "weights": how much
    // The RBFs: d(x) = sum_j w_j |u - c_j|^3 + P b(u), u = x - origin,
    // b = 1 x y z xx yy zz xy yz zx.
    std::vector<std::int32_t> first_centre; ///< "rbf 1": RBFs + 1 offsets
    std::vector<double> rbf_origins;        ///< "rbf origins": 3 each
    std::vector<double> rbf_polynomials;    ///< "rbf P": 3x10 each, by columns
    std::vector<double> rbf_centres;        ///< "rbf centres": 6 each: c, w
    // "regions": their number, then their sections.
    std::vector<StoredRegion> regions;
};

struct FieldFile
{
    std::vector<StoredField> stages;
    std::uint32_t checksum = 0; ///< of the bytes read or written
};

/// The bytes of a field file.
std::string field_bytes(const FieldFile& file);

/// Reads and checks a field file whole: sizes, index ranges, finite numbers. Throws
/// Fault::File or Fault::Malformed.
FieldFile read_field(const std::string& path);
/// The same for bytes in memory; \p path names them.
FieldFile parse_field(const std::string& path, std::string_view bytes);

} // namespace cellwarp::core
