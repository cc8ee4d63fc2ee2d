// SPDX-License-Identifier: GPL-3.0-or-later
// The quick field for samples known beforehand, while the user drags: all that depends
// on places is tabulated, so that a frame is one pass over the tables.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "solver/cells/constraints.h"
#include "solver/field/blend_kernel.h"
#include "solver/field/blend_table.h"
#include "solver/field/fade_table.h"
#include "solver/field/field.h"

namespace cellwarp::core
{

/// Places and normals of the samples as Field gives them, in single precision. They
/// stand in an order of their own, by the cells that they follow: whoever draws them
/// sorts its indices once. A sample and its normal stand at the same place if there is
/// one normal a sample, in the samples' order.
class SampleBlend
{
public:
    /// \p kind: Blend or Closest4. Keeps references to \p cells and to the fades of
    /// \p regions. Samples of idle cells stay at rest.
    /// \pre the normals are unit vectors
    SampleBlend(FieldKind kind, const Cells& cells, const SampleSet& samples,
                std::span<const Constraint> constraints,
                std::span<const FadedRegion> regions);

    /// One frame, on all threads, without an allocation. \p motions: one a region. The
    /// same bits for each instruction set and number of threads.
    /// \pre the cells of the regions have the poses that the motions carry
    void apply(std::span<const Pose> poses, std::span<const Motion> motions);

    /// Three numbers each, in the units of the cells; at rest before the first frame.
    std::span<const float> positions() const { return places_.values(); }
    std::span<const float> normals() const { return normals_.values(); }
    /// Which sample, which normal, stands at each place of these.
    std::span<const std::uint32_t> order() const { return places_.order(); }
    std::span<const std::uint32_t> normal_order() const { return normals_.order(); }

    /// In the order in which they were given.
    std::vector<Eigen::Vector3f> positions_as_given() const;
    std::vector<Eigen::Vector3f> normals_as_given() const;

    InstructionSet instruction_set() const { return instruction_set_; }
    /// Instead of the widest one.
    void use(InstructionSet set) { instruction_set_ = set; }

    /// What a frame reads of the tables, and writes.
    std::size_t bytes_read() const { return places_.bytes() + normals_.bytes(); }
    std::size_t bytes_written() const
    {
        return positions().size_bytes() + normals().size_bytes();
    }

private:
    const Cells& cells_;
    BlendInfluences influences_;
    FadeNodes nodes_;
    BlendTable places_, normals_;
    std::vector<AffineMap> maps_; ///< of the cells, then of the regions
    InstructionSet instruction_set_;
};

} // namespace cellwarp::core
