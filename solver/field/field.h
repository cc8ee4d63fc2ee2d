// SPDX-License-Identifier: GPL-3.0-or-later
// The map of space that the poses of the cells make: a base (blend or RBF) that
// gives way to the regions' own motions around their samples.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "solver/cells/constraints.h"
#include "solver/field/blend.h"
#include "solver/field/centres.h"
#include "solver/field/local_rbf.h"
#include "solver/field/rbf.h"
#include "solver/field/region_fade.h"
#include "solver/field/surroundings.h"

namespace cellwarp::core
{

enum class FieldKind
{
    Blend,     ///< continuous blend of the closest cells
    Closest4,  ///< the paper's four closest
    Rbf,       ///< triharmonic, local along the glue
    RbfGlobal, ///< one dense triharmonic interpolant of all cells
    RbfCentres ///< the same through the cells' own centres alone, as [Botsch07] has it
};

/// Whether a field is one RBF of all cells.
constexpr bool is_dense(FieldKind kind)
{
    return kind == FieldKind::RbfGlobal || kind == FieldKind::RbfCentres;
}

/// The centres of an RBF of all cells.
RbfCentres centres_of_all(FieldKind kind, const Cells& cells,
                          std::span<const Constraint> constraints,
                          std::span<const Pose> poses);

/// Clusters of the release field, by their distance from the RBF through all cells:
/// largest and RMS [1e-5 diagonal], and the largest difference of the gradient; time of a
/// fit on one thread [ms]. Bar of 2,048 cells, turned by 135 degrees | sample creature,
/// 1,900 cells | bunny in 4,400 cells of three sizes:
///   2, 2, 2     12  2.8 0.03 29 |  87 5.6 0.2   54 | 490 18  2.4 140
///   3, 2, 2      7  1.6 0.02 25 |  59 4.1 0.08  48 | 420 16  2.5 181
///   3, 2, 2.5    7  1.6 0.02 25 |  59 4.1 0.08  48 | 260 11  0.6 347
///   3, 2, 3      5  1.1 0.01 78 |  42 2.5 0.07 110 | 160 11  0.4 627
///   4, 2, 2      8  1.4 0.02 23 |  42 3.0 0.2   54 | 240 14  1.7 150
///   4, 2, 3      4  0.6 0.01 60 |  19 1.8 0.05 122 | 150  8  0.4 518
/// (core, support, reach.) The largest are where the global one drags near parts along.
inline constexpr ClusterSize kReleaseClusters = {3, 2.0, 2.5};

/// A field by what it is made of; a kind alone is its usual one.
struct FieldChoice
{
    // Implicit: most choose a kind and no more.
    constexpr FieldChoice(FieldKind of, const ClusterSize& size = kReleaseClusters)
        : kind(of), clusters(size)
    {
    }

    FieldKind kind;
    ClusterSize clusters; ///< of FieldKind::Rbf

    bool operator==(const FieldChoice&) const = default;
};

/// All that a field is made of, beside the cells.
struct FieldParts
{
    FieldKind kind = FieldKind::Blend;
    std::vector<Pose> poses;
    std::vector<char> is_idle;              ///< a cell: it holds its material at rest
    std::optional<LocalRbf> local;          ///< of FieldKind::Rbf
    std::shared_ptr<const RbfField> global; ///< of a dense one
    std::size_t num_centres = 0;            ///< of an RBF
    double residual = 0.0; ///< largest distance between a displacement given and reached
    std::vector<MovedRegion> regions;
};

/// Immutable once built but for what is kept, safe for many threads. Keeps references to
/// \p cells and to the fades of the regions.
class Field
{
public:
    Field(const Cells& cells, FieldParts parts);
    Field(Field&&) = default;
    Field(const Field&) = delete; // it looks into its own parts

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

    /// Keeps what is looked up around the points, up to \p max_bytes, for those to come:
    /// worth it where many points come a few at a time. Changes no bit.
    void keep_surroundings(std::size_t max_bytes);

private:
    friend class FieldFitter;
    class Evaluation;
    void lead_loose_parts();
    /// take(i, value) for each point, or take(i, values, place), from any thread.
    template <class Take>
    void evaluate(std::span<const Eigen::Vector3d> points, std::span<const int> own,
                  bool wants_gradient, const Take& take) const;

    const Cells& cells_;
    FieldParts parts_;
    ClosestCells closest_;
    std::vector<CellMap> maps_;
    std::optional<Closest4> closest4_;
    MovedRegions regions_; ///< looks into parts_.regions, which a move leaves in place
    std::unique_ptr<KeptSurroundings> kept_; ///< null: nothing is kept
};

/// Makes the fields of one set of cells, frame after frame.
class FieldFitter
{
public:
    /// Keeps references to \p cells and \p constraints. Idle cells hold their material at
    /// rest, whatever the others do. \p systems: what other fits of FieldKind::Rbf can
    /// use is found and kept there; null where there is no other.
    FieldFitter(const FieldChoice& choice, const Cells& cells,
                std::span<const Constraint> constraints, RbfSystems* systems);

    /// \p regions: their misses are found here. Loose parts are the last ones.
    Field fit(std::span<const Pose> poses, std::vector<MovedRegion> regions);

    /// Of FieldKind::Rbf, how many clusters the last fit solved for, and factored.
    std::size_t num_solved() const { return local_ ? local_->num_solved() : 0; }
    std::size_t num_factored() const { return local_ ? local_->num_factored() : 0; }

private:
    /// For each cell whether all that \p field takes into account in its material moves
    /// by \p motion, and the field therefore too, up to rounding.
    std::vector<bool> followers_of(const Motion& motion, const FieldParts& field) const;
    void find_misses(const Field& field, std::span<const std::vector<bool>> follows,
                     std::span<MovedRegion> regions) const;
    void find_deep_cells(const std::vector<bool>& follows,
                         std::span<const int> regions_near, MovedRegion& own) const;

    FieldKind kind_;
    const Cells& cells_;
    std::span<const Constraint> constraints_;
    std::optional<LocalRbfFitter> local_;
};

/// The field of one frame alone.
Field fit_field(const FieldChoice& choice, const Cells& cells,
                std::span<const Pose> poses, std::span<const Constraint> constraints,
                std::vector<MovedRegion> regions);

} // namespace cellwarp::core
