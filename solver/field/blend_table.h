// SPDX-License-Identifier: GPL-3.0-or-later
// Points known beforehand in groups that follow the same cells, with their weights.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "solver/field/blend_kernel.h"
#include "solver/field/fade_table.h"

namespace cellwarp::core
{

/// A unit normal at a sample.
struct SampleNormal
{
    std::uint32_t sample = 0;
    Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();
};

/// Samples at rest, in the units of the cells.
struct SampleSet
{
    std::span<const Eigen::Vector3d> places;
    std::span<const int> cells; ///< whose material holds a sample, or is nearest to it
    std::span<const SampleNormal> normals;
};

/// Points that follow the same maps, in blocks.
struct BlendGroup
{
    std::size_t first_map = 0, num_maps = 0;
    std::size_t first_row = 0, rows_a_block = 0;
    std::size_t first_sum = 0; ///< of the corrections
    bool has_corrections = false;
    std::size_t first_value = 0, num_values = 0;
    Eigen::Vector3f reference = Eigen::Vector3f::Zero(); ///< a place amid them
};

/// Either the places of the samples or their normals.
class BlendTable
{
public:
    enum class Kind
    {
        Places,
        Normals
    };
    BlendTable(Kind kind, const SampleSet& samples, const Cells& cells,
               std::span<const char> is_idle, const BlendInfluences& influences,
               const FadeNodes& nodes);

    /// The sample, or the normal, at each place of the values.
    std::span<const std::uint32_t> order() const { return order_; }
    /// Three numbers each; at rest before the first frame.
    std::span<const float> values() const { return values_; }
    /// Of the corrections.
    std::span<FadeTerm> terms() { return sums_.terms(); }
    /// What a frame reads of the table.
    std::size_t bytes() const;

    /// \p maps: of the cells, then of the regions.
    void apply(std::span<const AffineMap> maps, std::span<const NodeMiss> misses,
               const BlendKernels& kernels);

private:
    /// Blocks that one thread does at once.
    struct Chunk
    {
        std::size_t group = 0, first_block = 0;
        std::size_t spilled_maps = 0; ///< in spill_, of a group with very many
    };
    void make_chunks();
    void run(const Chunk& chunk, std::span<const AffineMap> maps,
             const BlendKernels& kernels);

    Kind kind_;
    std::vector<BlendGroup> groups_;
    std::vector<Chunk> chunks_;
    std::vector<std::uint32_t> maps_;
    std::vector<Row> rows_;
    FadeSums sums_;
    std::vector<float> spill_;
    std::vector<std::uint32_t> order_;
    std::vector<float> values_;
};

} // namespace cellwarp::core
