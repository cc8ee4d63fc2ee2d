// SPDX-License-Identifier: GPL-3.0-or-later
// The inner loops of SampleBlend, for each instruction set. All make the same sums in
// the same order, so their results are the same to the bit.
#pragma once

#include <cstddef>

#include "octree/base/instruction_set.h"

namespace cellwarp::core
{

/// Samples are lanes: blocks of this many, the last one of a group padded.
constexpr std::size_t kLanes = 16;

/// One quantity of the samples of a block.
struct alignas(64) Row
{
    float lane[kLanes];
};

/// Displacement of x: A (x - reference) + b, as A by rows and then b.
constexpr std::size_t kMapSize = 12;

/// Rows of a block before those of its weights, and of one cell's weight: a place
/// alone, or with a normal, whose weights have slopes along two tangents.
constexpr std::size_t kPlaceRows = 3, kPlaceWeightRows = 1;
constexpr std::size_t kNormalRows = 6, kNormalWeightRows = 3;
/// Rows of a block's corrections: of the displacement, or of its two slopes.
constexpr std::size_t kPlaceCorrectionRows = 3, kNormalCorrectionRows = 6;

/// Samples that follow the same cells.
struct BlendRun
{
    const Row* rows = nullptr;        ///< one block after the other
    const Row* corrections = nullptr; ///< as well; none: null
    const float* maps = nullptr; ///< of the first cell; of the others, less the first
    std::size_t num_maps = 1;
    std::size_t num_samples = 0;
    float reference[3] = {0, 0, 0};
    float* out = nullptr; ///< three numbers a sample
};

/// One node's part in a correction (fade_table.h): factors of the miss there and of its
/// three slopes.
struct FadeTerm
{
    unsigned node = 0;
    float factors[4] = {0, 0, 0, 0};
};

/// What the field misses at a node: the displacement and its three slopes, each of three
/// numbers and one unused.
struct alignas(64) NodeMiss
{
    float columns[16] = {};
};

/// Sums of terms, each for one lane of three rows.
struct FadeRun
{
    const NodeMiss* misses = nullptr;
    const FadeTerm* terms = nullptr;
    const std::size_t* first_term = nullptr; ///< of each lane, and the end of the last
    std::size_t num_blocks = 0;              ///< of kLanes lanes
    Row* out = nullptr;
};

struct BlendKernels
{
    void (*places)(const BlendRun&);
    void (*normals)(const BlendRun&);
    void (*corrections)(const FadeRun&);
};

/// \pre \p set is one of instruction_sets()
BlendKernels blend_kernels(InstructionSet set);

} // namespace cellwarp::core
