// SPDX-License-Identifier: GPL-3.0-or-later
// What elasticity, inertia and tubes make of the displacements of a lattice's nodes. All
// sums are in a fixed order: the same bits for any number of threads.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "solver/flesh/bone_tube.h"
#include "solver/flesh/large_strain.h"
#include "solver/flesh/lattice.h"
#include "solver/flesh/part_kernel.h"

namespace cellwarp::core
{

/// How much each kind counts in a product.
struct FleshFactors
{
    double mass = 0.0;      ///< of the matrix M
    double stiffness = 0.0; ///< of sum R K R^T
    double tube = 0.0;      ///< of the tubes' matrix
};

/// Vectors have three numbers for each node of the lattice.
class FleshForces
{
public:
    /// \p materials: of the lattice's parts. \p set: of instructions, for tests.
    FleshForces(const Lattice& lattice, std::span<const FleshMaterial> materials,
                std::vector<TubePart> tubes);
    FleshForces(const Lattice& lattice, std::span<const FleshMaterial> materials,
                std::vector<TubePart> tubes, InstructionSet set);

    std::size_t num_nodes() const { return num_nodes_; }

    /// Strain is large from now on, by a law: then there are no frames, and follow()
    /// finds the second derivatives, made positive, part by part.
    void take_law(StrainLaw law);

    /// Turns the frame of each cell to the rotation of its mean deformation [4.6].
    void follow(const Eigen::VectorXd& u);
    /// No frame is turned.
    void stand_still();
    /// Of the last follow().
    const std::vector<Eigen::Matrix3d>& frames() const { return frames_; }
    /// Second derivatives of the parts, made positive, of the last follow() with a law.
    const std::vector<PartMatrix>& hessians() const { return hessians_; }
    bool has_law() const { return law_.has_value(); }
    const std::vector<TubePart>& tubes() const { return tubes_; }
    /// F, the mean of each cell.
    void mean_deformations(const Eigen::VectorXd& u,
                           std::vector<Eigen::Matrix3d>& out) const;

    /// y = (sum of the factors' matrices) x.
    void multiply(const Eigen::VectorXd& x, const FleshFactors& factors,
                  Eigen::VectorXd& y) const;
    /// Elastic forces and those of tubes [N]; their negatives are the gradient of
    /// elastic_energy() while the frames stand. \p motions: of what the tubes are told
    /// by.
    void forces(const Eigen::VectorXd& u, std::span<const Motion> motions,
                Eigen::VectorXd& out) const;
    /// Parts that are turned inside out at one of their points; 0 without a law.
    std::size_t num_inverted(const Eigen::VectorXd& u) const;
    /// Energies of material and of tubes [J].
    double elastic_energy(const Eigen::VectorXd& u) const;
    double tube_energy(const Eigen::VectorXd& u, std::span<const Motion> motions) const;

    /// The mean of the three axes' entries of the factors' matrices at rest, which no
    /// turn of a frame changes: pairs of corners of each part.
    std::vector<Eigen::Matrix<double, 8, 8>>
    mean_blocks(const FleshFactors& factors) const;

private:
    void gather(Eigen::VectorXd& out) const;
    PartVector corners(const Eigen::VectorXd& x, std::size_t part) const;
    void give(const PartVector& forces, std::size_t part, bool adds) const;
    PartVector way_to_bone(const TubePart& tube, const Eigen::VectorXd& u,
                           std::span<const Motion> motions) const;
    PartVector product(const PartVector& values, std::size_t part) const;
    void run_blocks(const PartRun& how, void (*kernel)(const PartRun&)) const;
    void pull_to_rest(const Eigen::VectorXd& u, double factor) const;

    const Lattice& lattice_;
    PartKernels kernels_;
    std::size_t num_nodes_ = 0, num_blocks_ = 0;
    std::vector<FleshMaterial> materials_;
    std::vector<TubePart> tubes_;
    std::vector<PartBlock> blocks_; ///< of boxes
    /// Stiffness times overlap of a block's tubes, as PartRun has it; empty without them.
    std::vector<std::vector<PartRow>> tube_rows_;
    /// Mass, tubes and sum of the slopes' weighted values of a hexahedron that was drawn.
    struct DrawnPart
    {
        Eigen::Matrix<double, 8, 8> mass, tube;
        Eigen::Matrix<double, 3, 8> slopes;
    };
    std::vector<DrawnPart> drawn_;
    std::vector<int> nodes_;          ///< of each block 8 corners of 8 parts
    std::vector<PartRow> frame_rows_; ///< nine a block
    std::vector<int> cell_of_part_;   ///< lane by lane
    std::optional<StrainLaw> law_;
    std::vector<PartPoints> points_; ///< of the parts, with a law
    /// In the frames of the cells: with a law of the last follow(), of drawn hexahedra
    /// without one at rest.
    std::vector<PartMatrix> hessians_;
    std::vector<double> share_of_cell_;   ///< of a part's volume in its cell
    std::vector<Eigen::Matrix3d> frames_; ///< of each cell
    /// Where the x of a node stands in what the parts give, once for each part that has
    /// the node; its y is eight numbers further, its z sixteen.
    std::vector<std::size_t> first_of_node_;
    std::vector<std::uint32_t> offsets_;
    mutable std::vector<PartRow> given_; ///< scratch
};

} // namespace cellwarp::core
