// SPDX-License-Identifier: GPL-3.0-or-later
// The map of space that the poses of the cells make: a base (blend or RBF) that
// gives way to the regions' own motions around their samples.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "solver/constraints.h"
#include "solver/field/blend.h"
#include "solver/field/local_rbf.h"
#include "solver/field/rbf.h"
#include "solver/field/region_fade.h"
#include "solver/pose.h"

namespace cellwarp
{

enum class FieldKind
{
    Blend,    ///< continuous blend of the closest cells
    Closest4, ///< the paper's four closest
    Rbf,      ///< triharmonic, local along the glue
    RbfGlobal ///< one dense triharmonic interpolant of all cells
};

/// Immutable once built, safe for many threads. Keeps references to \p cells and
/// to the fades of \p regions.
class Field
{
public:
    /// The misses of \p regions are found here. Idle cells hold their material at
    /// rest, whatever the others do.
    Field(FieldKind kind, const Cells& cells, std::vector<Pose> poses,
          std::span<const Constraint> constraints, std::vector<MovedRegion> regions);

    FieldKind kind() const { return kind_; }
    /// Of an RBF: its centres, its clusters, and the largest distance between a
    /// displacement given and the one reached. 0 of a blend.
    std::size_t num_centres() const { return num_centres_; }
    std::size_t num_clusters() const
    {
        return local_ ? local_->clusters().clusters.size() : 0;
    }
    double residual() const;

    /// Value and gradient at \p x in the material of cell \p own.
    FieldValue value(const Eigen::Vector3d& x, int own) const;

    /// Displacements of many points, in parallel; each is the one of value() alone.
    std::vector<Eigen::Vector3d> displacements(std::span<const Eigen::Vector3d> points,
                                               std::span<const int> own) const;

private:
    /// For each cell whether all that the field takes into account in its material moves
    /// by \p motion, and the field therefore too, up to rounding.
    std::vector<bool> followers_of(const Motion& motion,
                                   std::span<const Constraint> constraints) const;
    /// Without the regions. \p near is scratch.
    FieldValue base(const Eigen::Vector3d& x, int own,
                    std::span<const Influence> influences, std::vector<Influence>& near,
                    bool wants_gradient) const;

    FieldKind kind_;
    const Cells& cells_;
    std::vector<Pose> poses_;
    std::vector<bool> is_idle_; ///< a cell
    MovedRegions regions_;
    ClosestCells closest_;
    std::optional<Closest4> closest4_;
    std::size_t num_centres_ = 0;
    std::optional<LocalRbf> local_;
    std::optional<RbfField> global_;
};

} // namespace cellwarp
