// SPDX-License-Identifier: GPL-3.0-or-later
// The map of space that the poses of the cells make: a base (blend or RBF) that
// gives way to the regions' own motions around their samples.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <stop_token>
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

/// All that a field is made of, beside the cells.
struct FieldParts
{
    FieldKind kind = FieldKind::Blend;
    std::vector<Pose> poses;
    std::vector<char> is_idle;              ///< a cell: it holds its material at rest
    std::optional<LocalRbf> local;          ///< of FieldKind::Rbf
    std::shared_ptr<const RbfField> global; ///< of FieldKind::RbfGlobal
    std::size_t num_centres = 0;            ///< of an RBF
    double residual = 0.0; ///< largest distance between a displacement given and reached
    std::vector<MovedRegion> regions;
};

/// Immutable once built, safe for many threads. Keeps references to \p cells and to the
/// fades of the regions.
class Field
{
public:
    Field(const Cells& cells, FieldParts parts);

    FieldKind kind() const { return parts_.kind; }
    const FieldParts& parts() const { return parts_; }
    std::size_t num_clusters() const
    {
        return parts_.local ? parts_.local->fits().size() : 0;
    }

    /// Value and gradient at \p x in the material of cell \p own.
    FieldValue value(const Eigen::Vector3d& x, int own) const;

    /// Of many points, in parallel; each is the one of value() alone, to the bit.
    std::vector<FieldValue> values(std::span<const Eigen::Vector3d> points,
                                   std::span<const int> own) const;
    std::vector<Eigen::Vector3d> displacements(std::span<const Eigen::Vector3d> points,
                                               std::span<const int> own) const;

private:
    class Evaluation;
    /// take(i, value) for each point, from any thread.
    template <class Take>
    void evaluate(std::span<const Eigen::Vector3d> points, std::span<const int> own,
                  bool wants_gradient, const Take& take) const;

    const Cells& cells_;
    FieldParts parts_;
    ClosestCells closest_;
    std::optional<Closest4> closest4_;
    MovedRegions regions_;
};

/// Makes the fields of one set of cells, frame after frame.
class FieldFitter
{
public:
    /// Keeps references to \p cells and \p constraints. Idle cells hold their material at
    /// rest, whatever the others do. \p has_more_frames: what a second fit can use is
    /// kept, the factors of FieldKind::Rbf.
    FieldFitter(FieldKind kind, const Cells& cells,
                std::span<const Constraint> constraints, bool has_more_frames);

    /// \p regions: their misses are found here. Nothing if it was stopped.
    std::optional<Field> fit(std::span<const Pose> poses,
                             std::vector<MovedRegion> regions, std::stop_token stop = {});

    /// Of FieldKind::Rbf, how many clusters the last fit solved for, and factored.
    std::size_t num_solved() const { return local_ ? local_->num_solved() : 0; }
    std::size_t num_factored() const { return local_ ? local_->num_factored() : 0; }

private:
    /// For each cell whether all that \p field takes into account in its material moves
    /// by \p motion, and the field therefore too, up to rounding.
    std::vector<bool> followers_of(const Motion& motion, const FieldParts& field) const;
    void find_misses(const Field& field, const std::vector<bool>& follows,
                     MovedRegion& region) const;
    void find_deep_cells(const std::vector<bool>& follows, std::span<MovedRegion> regions,
                         std::size_t region) const;

    FieldKind kind_;
    const Cells& cells_;
    std::span<const Constraint> constraints_;
    std::size_t num_centres_ = 0;
    std::optional<LocalRbfFitter> local_;
};

/// The field of one frame alone.
Field fit_field(FieldKind kind, const Cells& cells, std::span<const Pose> poses,
                std::span<const Constraint> constraints,
                std::vector<MovedRegion> regions);

} // namespace cellwarp
