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
#include "solver/field/rbf.h"
#include "solver/field/region_fade.h"
#include "solver/pose.h"

namespace cellwarp
{

enum class FieldKind
{
    Blend,    ///< continuous blend of the closest cells
    Closest4, ///< the paper's four closest
    Rbf       ///< one triharmonic interpolant
};

/// Centres of the RBF and where they go: the centres of all cells, and the corners
/// of the prescribed ones, whose motion is known. A corner that cells of different
/// motions share is left out.
struct RbfCentres
{
    std::vector<Eigen::Vector3d> points, displacements;
};
RbfCentres rbf_centres(const Cells& cells, std::span<const Pose> poses,
                       std::span<const Constraint> constraints);

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
    const RbfField* rbf() const { return rbf_ ? &*rbf_ : nullptr; }

    /// Value and gradient at \p x in the material of cell \p own.
    FieldValue value(const Eigen::Vector3d& x, int own) const;

    /// Displacements of many points, in parallel; each is the one of value() alone.
    std::vector<Eigen::Vector3d> displacements(std::span<const Eigen::Vector3d> points,
                                               std::span<const int> own) const;

private:
    /// Without the regions. \p near is scratch.
    FieldValue base(const Eigen::Vector3d& x, std::span<const Influence> influences,
                    std::vector<Influence>& near, bool wants_gradient) const;

    FieldKind kind_;
    const Cells& cells_;
    std::vector<Pose> poses_;
    std::vector<bool> is_idle_; ///< a cell
    MovedRegions regions_;
    ClosestCells closest_;
    std::optional<Closest4> closest4_;
    std::optional<RbfField> rbf_;
};

} // namespace cellwarp
