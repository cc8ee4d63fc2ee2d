// SPDX-License-Identifier: GPL-3.0-or-later
// Flesh around moving bones, in time: elastic, heavy, held by its bones. [Capell02]
// flesh.cpp has the step.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "solver/flesh/blended_regions.h"
#include "solver/flesh/bone_tube.h"
#include "solver/flesh/bound_nodes.h"
#include "solver/flesh/flesh_contact.h"
#include "solver/flesh/lattice.h"

namespace cellwarp::core
{

/// What is taken for the strain of a cell.
enum class FleshLaw
{
    Cells,             ///< small strain in a frame that turns with the cell
    Regions,           ///< small strain in the frames of bones, blended
    Linear,            ///< small strain: right for small turns alone
    StVenantKirchhoff, ///< Green's strain in the linear law
    NeoHookean         ///< with a barrier against collapse [Smith18]
};

struct FleshSettings
{
    FleshLaw law = FleshLaw::Cells;
    double alpha = 0.0;                                ///< damping of the mass [1/s]
    double beta = 0.0;                                 ///< and of the stiffness [s]
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero(); ///< [m/s^2]
    double tolerance = 1e-3; ///< of the linear systems' residual, relative
    int newton = 1;          ///< linear systems a step, at the most
    bool has_levels = true;  ///< of the preconditioner, where a step is long enough
};

/// All that a step depends on.
struct FleshState
{
    Eigen::VectorXd u, v; ///< displacements and velocities of the nodes [m], [m/s]

    bool operator==(const FleshState& other) const
    {
        return u == other.u && v == other.v;
    }
};

struct FleshReport
{
    int systems = 0, cg_steps = 0; ///< linear ones, and steps of their solution
    int factors = 0;               ///< of regions that were made in it
    double residual = 0.0;         ///< of the last linear system, relative
    bool is_converged = true;      ///< to the tolerance
    bool is_finite = true;         ///< else the state is that of before
    FleshContacts contacts;
};

/// Of settle(): whether the flesh feels its own weight.
enum class Weighs
{
    No,
    Yes
};

/// Its functions share scratch: one call at a time, of the const ones too.
class Flesh
{
public:
    /// \p materials: of the lattice's parts; \p points: as bind_nodes() takes them.
    /// \p regions: of FleshLaw::Regions alone, as BlendedRegions takes them.
    Flesh(Lattice lattice, std::vector<FleshMaterial> materials,
          std::vector<HeldPoint> points, std::vector<TubePart> tubes,
          FleshSettings settings, std::vector<FleshRegionShares> regions = {});
    ~Flesh();
    Flesh(Flesh&&) noexcept;

    const Lattice& lattice() const;
    const std::vector<HeldPoint>& points() const;
    const BoundNodes& nodes() const;
    FleshState rest() const;
    /// Further forces on the nodes, until they are set again [N].
    void load(const Eigen::VectorXd& forces);
    /// From now on forces cancel the weight of the nodes while the motions are those of
    /// rest, so that the shape is at rest as it was drawn. The force on a node turns with
    /// the bones, as much as its shares say; a node without a share feels its weight.
    void carry_weight(std::vector<FleshRegionShares> bones);
    /// What can be kept of the same flesh in another lattice, which is not used any more:
    /// factors of regions that the change has not touched.
    void take_factors(Flesh& of);
    /// What obstacles touch; before, nothing of it does.
    void set_surface(std::vector<FleshPoint> points);

    /// Goes on by \p dt [s], to where the bones have moved by \p motions (from rest).
    FleshReport step(FleshState& state, double dt, std::span<const Motion> motions,
                     const FleshSurroundings& around = {});
    /// To where all is at rest while the bones stand: the last round moves nothing
    /// farther than \p at_rest [size]. Not converged: rest was not found; the state is on
    /// the way there.
    FleshReport settle(FleshState& state, std::span<const Motion> motions,
                       Weighs weighs = Weighs::Yes, const FleshSurroundings& around = {},
                       double at_rest = 1e-7);

    /// Displacements of the nodes in a weight of this gravity [m], held at their rest, by
    /// small strain. \p gravity: [m/s^2]. Parts that nothing holds fall far.
    Eigen::VectorXd sag(const Eigen::Vector3d& gravity, std::span<const Motion> at_rest);

    struct Energies
    {
        double kinetic = 0.0, elastic = 0.0, tube = 0.0, gravity = 0.0; ///< [J]
    };
    /// Heights are counted from \p origin; `gravity` is that of the weight and of what
    /// cancels it.
    Energies energies(const FleshState& state, std::span<const Motion> motions,
                      const Eigen::Vector3d& origin = Eigen::Vector3d::Zero()) const;
    Eigen::Vector3d momentum(const FleshState& state) const;         ///< [kg m/s]
    Eigen::Vector3d angular_momentum(const FleshState& state) const; ///< [kg m^2/s]
    /// Frobenius norm of Green's mean strain, of the cell where it is largest.
    double largest_strain(const FleshState& state) const;
    /// Cells that are turned inside out: at one of the points of their parts for laws of
    /// large strain, else in the mean.
    std::size_t num_inverted(const FleshState& state) const;
    /// How far a held point is from where it should be, at the most; those that were
    /// dropped do not count [m].
    double largest_miss(const FleshState& state, std::span<const Motion> motions) const;
    /// Points of the surface that touch an obstacle, one a node at the most.
    std::vector<std::size_t> touching(const FleshState& state,
                                      std::span<const FleshObstacle> obstacles) const;
    /// F, the mean of each cell.
    std::vector<Eigen::Matrix3d> deformations(const FleshState& state) const;

    /// y = (sum of the factors' matrices) x of all nodes at rest, for tests.
    Eigen::MatrixXd dense_matrix(double mass, double stiffness, double tube) const;

private:
    friend class FleshStep;
    class Settling; ///< flesh_settle.cpp
    struct Parts;
    std::unique_ptr<Parts> parts_;
};

} // namespace cellwarp::core
