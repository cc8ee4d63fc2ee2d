// SPDX-License-Identifier: GPL-3.0-or-later
// A step is linearised implicit Euler [BaraffWitkin98], at the state that is predicted
// and with the bones where they will be [theory-skeleton 6.2]: with u' = u + h v,
//   (M + h C + h^2 S) dv = h f(u', v; motions after the step),
//   v += dv,  u += h v.
// M is the mass, S the stiffness of cells in their frames at u' and that of the tubes,
// and C = alpha M + beta R K R^T. Held points are rows on dv, such that they end exactly
// where they should: J dv = (gamma - J u) / h - J v. They are eliminated: with
// dv = Z dv_free + G c, Z^T A Z dv_free = Z^T (b - A G c) has only free nodes. It is
// solved from zero: to begin with the last step's dv saves nothing (16 to 20 steps either
// way).
#include "solver/flesh/flesh.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include "octree/base/parallel.h"
#include "solver/flesh/flesh_forces.h"
#include "solver/flesh/level_preconditioner.h"
#include "solver/flesh/node_rows.h"
#include "solver/flesh/step_rows.h"
#include "solver/linear/conjugate_gradients.h"

namespace cellwarp
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::size_t kNodeGrain = 2048; ///< nodes

/// More steps than this tell that a system cannot be solved to the tolerance.
constexpr int kMostCgSteps = 2000;

/// Below this h^2 E / (density edge^2) the mass is most of the matrix, and its diagonal
/// a better preconditioner than all levels [theory-skeleton 10].
constexpr double kHeavy = 3.0;

/// Newton ends where the residual is below this, relative to that of the first round.
constexpr double kNewtonTolerance = 1e-6;

/// What is nearer to an obstacle touches it, relative to the size.
constexpr double kTouching = 1e-6;

/// Of settle(): a round ends at rest where nothing moves farther, relative to the size;
/// and how much longer than sound takes through the shape its steps are.
constexpr double kAtRest = 1e-7, kLongStep = 300.0;
constexpr int kMostRounds = 200;

} // namespace

struct Flesh::Parts
{
    Lattice lattice;
    std::vector<FleshMaterial> materials;
    std::vector<HeldPoint> points;
    BoundNodes nodes;
    FleshSettings settings;
    FleshForces forces;
    VectorXd weight, loads;        ///< of all nodes [N]
    double edge = 0.0, size = 0.0; ///< of the smallest cell, and of all [m]

    /// For one length of the step.
    double prepared_dt = -1.0;
    std::optional<LevelPreconditioner> preconditioner;
    ConjugateGradients cg;
    // Scratch: vectors of all nodes, and of the free ones.
    VectorXd predicted, velocity, change, force, image, free_b, free_step;
    VectorXd rows; ///< c, of the points

    FleshSurface surface;
    FreeShares free_shares;
    std::vector<TubePart> tubes; ///< of the regions alone
    std::optional<BlendedRegions> regions;
    VectorXd by_mass; ///< of the regions: of each free node, 1 / its mass [1/kg]

    Parts(Lattice of, std::vector<FleshMaterial> of_what, std::vector<HeldPoint> held,
          std::vector<TubePart> of_tubes, FleshSettings how,
          std::vector<FleshRegionShares> of_regions)
        : lattice(std::move(of)), materials(std::move(of_what)), points(std::move(held)),
          nodes(bind_nodes(lattice.hanging, points)), settings(how),
          forces(lattice, materials, of_tubes), free_shares(nodes, lattice.places.size())
    {
        if (settings.law == FleshLaw::Regions)
        {
            tubes = std::move(of_tubes);
            regions.emplace(lattice, nodes, materials, tubes, std::move(of_regions),
                            settings.alpha, settings.beta);
        }
        Vector3d low = Vector3d::Constant(INFINITY), high = -low;
        for (const Vector3d& x : lattice.places)
        {
            low = low.cwiseMin(x);
            high = high.cwiseMax(x);
        }
        size = lattice.places.empty() ? 0.0 : (high - low).norm();
        edge = size;
        for (const LatticePart& part : lattice.parts)
        {
            const CornerNodes& corners = lattice.cells[idx(part.cell)];
            edge = std::min(
                edge, (lattice.places[idx(corners[1])] - lattice.places[idx(corners[0])])
                          .norm());
        }
        VectorXd g = all_nodes();
        for (Eigen::Index n = 0; n < g.size(); n += 3)
            g.segment<3>(n) = settings.gravity;
        forces.multiply(g, {1.0, 0.0, 0.0}, weight);
        loads = all_nodes();
        if (settings.law == FleshLaw::StVenantKirchhoff)
            forces.take_law(StrainLaw::StVenantKirchhoff);
        if (settings.law == FleshLaw::NeoHookean)
            forces.take_law(StrainLaw::NeoHookean);
    }

    VectorXd all_nodes() const
    {
        return VectorXd::Zero(Eigen::Index(3 * lattice.places.size()));
    }

    /// Free nodes as given, bound ones by them and the points' \p c, if any.
    void expand(const VectorXd& free, const VectorXd* c, VectorXd& all) const
    {
        all.resize(Eigen::Index(3 * lattice.places.size()));
        parallel_for(nodes.free.size(), kNodeGrain,
                     [&](std::size_t k) {
                         all.segment<3>(3 * nodes.free[k]) =
                             free.segment<3>(Eigen::Index(3 * k));
                     });
        parallel_for(nodes.bound.size(), kNodeGrain,
                     [&](std::size_t k)
                     {
                         Vector3d sum = Vector3d::Zero();
                         for (const NodeShare& share : nodes.by_free[k])
                             sum += share.share * free.segment<3>(3 * share.node);
                         if (c)
                             for (const NodeShare& share : nodes.by_points[k])
                                 sum += share.share * c->segment<3>(3 * share.node);
                         all.segment<3>(3 * nodes.bound[k]) = sum;
                     });
    }
    /// Forces on free nodes, with what those on bound ones come to.
    void reduce(const VectorXd& all, VectorXd& free) const
    {
        free.resize(Eigen::Index(3 * nodes.free.size()));
        parallel_for(nodes.free.size(), kNodeGrain,
                     [&](std::size_t k)
                     {
                         Vector3d sum = all.segment<3>(3 * nodes.free[k]);
                         for (const NodeShare& share : nodes.free_of[k])
                             sum += share.share *
                                    all.segment<3>(3 * nodes.bound[idx(share.node)]);
                         free.segment<3>(Eigen::Index(3 * k)) = sum;
                     });
    }

    FleshFactors factors(double dt) const
    {
        return {1.0 + dt * settings.alpha, dt * dt + dt * settings.beta, dt * dt};
    }

    void prepare(double dt)
    {
        if (dt == prepared_dt)
            return;
        double stiffest = 0.0; // z^2
        for (const FleshMaterial& material : materials)
            stiffest = std::max(stiffest, dt * dt * material.young /
                                              (material.density * edge * edge));
        preconditioner.emplace(lattice, nodes, forces.mean_blocks(), factors(dt),
                               settings.has_levels && !regions && stiffest >= kHeavy);
        cg = ConjugateGradients(Eigen::Index(3 * nodes.free.size()));
        prepared_dt = dt;
    }

    static Vector3d displacement_of(const HeldPoint& point,
                                    std::span<const Motion> motions)
    {
        return motions[idx(point.motion)](point.place) - point.place;
    }

    /// Changes of the held points' velocities, such that they end where they should.
    void find_rows(const FleshState& state, double dt, std::span<const Motion> motions)
    {
        rows.resize(Eigen::Index(3 * points.size()));
        for (std::size_t k = 0; k < points.size(); ++k)
            rows.segment<3>(Eigen::Index(3 * k)) = (displacement_of(points[k], motions) -
                                                    at_point(points[k].shares, state.u)) /
                                                       dt -
                                                   at_point(points[k].shares, velocity);
    }

    // To the velocities after the step.
    FleshReport step_by_rounds(const FleshState& state, double dt,
                               std::span<const Motion> motions,
                               const FleshSurroundings& around);
    FleshReport step_by_regions(const FleshState& state, double dt,
                                std::span<const Motion> motions,
                                const FleshSurroundings& around);

    /// What is left of forces and inertia, times the step, at velocities \p v after it.
    void impulse(const VectorXd& u, const VectorXd& v0, const VectorXd& v, double dt,
                 std::span<const Motion> motions)
    {
        predicted = u + dt * v;
        if (settings.law != FleshLaw::Linear)
            forces.follow(predicted);
        forces.forces(predicted, motions, force);
        force += weight + loads;
        if (settings.alpha > 0.0 || settings.beta > 0.0)
        {
            forces.multiply(v, {settings.alpha, settings.beta, 0.0}, image);
            force -= image;
        }
        force *= dt;
        change = v - v0;
        if (!change.isZero(0.0))
        {
            forces.multiply(change, {1.0, 0.0, 0.0}, image);
            force -= image;
        }
    }
};

namespace
{

/// The matrix of a step, on free nodes.
template <class Parts>
class StepOperator final : public LinearOperator
{
public:
    StepOperator(const Parts& parts, double dt)
        : parts_(parts), factors_(parts.factors(dt))
    {
    }
    void multiply(const VectorXd& x, VectorXd& y) const override
    {
        parts_.expand(x, nullptr, all_);
        parts_.forces.multiply(all_, factors_, image_);
        parts_.reduce(image_, y);
    }

private:
    const Parts& parts_;
    const FleshFactors factors_;
    mutable VectorXd all_, image_;
};

} // namespace

FleshReport Flesh::Parts::step_by_rounds(const FleshState& state, double dt,
                                         std::span<const Motion> motions,
                                         const FleshSurroundings& around)
{
    FleshReport report;
    const StepOperator<Parts> A(*this, dt);
    velocity = state.v;
    double first_size = 0.0; // of the right side
    StepRows changing(free_shares, surface, around, dt, size);
    for (int round = 0; round < std::max(1, settings.newton); ++round)
    {
        impulse(state.u, state.v, velocity, dt, motions);
        // Held points are met by the first round, exactly.
        if (round == 0)
            find_rows(state, dt, motions);
        else
            rows.setZero();
        free_step = VectorXd::Zero(Eigen::Index(3 * nodes.free.size()));
        expand(free_step, &rows, change);
        forces.multiply(change, factors(dt), image);
        force -= image;
        reduce(force, free_b);
        const double now = free_b.norm();
        if (round > 0 && now <= kNewtonTolerance * first_size)
            break;
        const auto solve = [&](NodeRows& met, std::span<const NodeBrake> brakes,
                               const VectorXd& b, VectorXd& x, VectorXd& l)
        {
            const LinearReport linear =
                met.solve(BrakedOperator(A, brakes), *preconditioner, b,
                          {settings.tolerance, kMostCgSteps}, cg, x, l);
            ++report.systems;
            report.cg_steps += linear.steps;
            report.residual = linear.residual;
            expand(x, &rows, change);
        };
        report.contacts = changing.solve(state.u, velocity, rows, free_b,
                                         preconditioner->scale(), solve, change);
        report.is_converged = report.is_converged && report.contacts.is_settled &&
                              report.residual <= 1.01 * settings.tolerance;
        if (round == 0)
            first_size = now;
        if (!change.allFinite())
        {
            report.is_finite = report.is_converged = false;
            return report;
        }
        velocity += change;
    }
    return report;
}

/// What changes is added to the blended step: by the least change that meets it.
FleshReport Flesh::Parts::step_by_regions(const FleshState& state, double dt,
                                          std::span<const Motion> motions,
                                          const FleshSurroundings& around)
{
    FleshReport report;
    velocity = state.v;
    find_rows(state, dt, motions);
    predicted = state.u + dt * state.v;
    const bool is_prepared = regions->is_prepared(dt);
    if (!regions->prepare(dt))
    {
        report.is_finite = report.is_converged = false;
        return report;
    }
    VectorXd blended;
    regions->step(predicted, state.v, {loads, settings.gravity, motions, rows}, blended);
    report.systems = static_cast<int>(regions->size());
    if (!is_prepared)
        report.factors = static_cast<int>(regions->size() - regions->num_taken());
    if (by_mass.size() == 0)
    {
        // So that forces are what changes momentum.
        forces.multiply(VectorXd::Ones(weight.size()), {1.0, 0.0, 0.0}, image);
        reduce(image, free_b);
        by_mass.resize(Eigen::Index(nodes.free.size()));
        for (Eigen::Index n = 0; n < by_mass.size(); ++n)
            by_mass[n] = 1.0 / free_b[3 * n];
    }
    const VectorXd& scale = by_mass;
    free_b = VectorXd::Zero(blended.size());
    const auto solve = [&](NodeRows& met, std::span<const NodeBrake> brakes,
                           const VectorXd&, VectorXd& x, VectorXd& l)
    {
        x = blended;
        for (const NodeBrake& brake : brakes)
        {
            double gives = 0.0;
            for (const NodeShare& share : brake.shares)
                gives += share.share * share.share * scale[share.node];
            const Vector3d braked = brake.force(x) / (1.0 + brake.factor * gives);
            for (const NodeShare& share : brake.shares)
                x.segment<3>(3 * share.node) += scale[share.node] * share.share * braked;
        }
        l.resize(0);
        if (!met.rows().empty())
        {
            l = met.weighed(met.values() - met.times(x));
            met.correct(x);
        }
        expand(x, &rows, change);
    };
    StepRows changing(free_shares, surface, around, dt, size);
    report.contacts =
        changing.solve(state.u, velocity, rows, free_b, scale, solve, change);
    report.is_converged = report.contacts.is_settled;
    if (!change.allFinite())
        report.is_finite = report.is_converged = false;
    velocity += change;
    return report;
}

Flesh::Flesh(Lattice lattice, std::vector<FleshMaterial> materials,
             std::vector<HeldPoint> points, std::vector<TubePart> tubes,
             FleshSettings settings, std::vector<FleshRegionShares> regions)
    : parts_(std::make_unique<Parts>(std::move(lattice), std::move(materials),
                                     std::move(points), std::move(tubes), settings,
                                     std::move(regions)))
{
}

Flesh::~Flesh() = default;
Flesh::Flesh(Flesh&&) noexcept = default;

const Lattice& Flesh::lattice() const
{
    return parts_->lattice;
}

const std::vector<HeldPoint>& Flesh::points() const
{
    return parts_->points;
}

const BoundNodes& Flesh::nodes() const
{
    return parts_->nodes;
}

FleshState Flesh::rest() const
{
    return {parts_->all_nodes(), parts_->all_nodes()};
}

void Flesh::load(const VectorXd& forces)
{
    parts_->loads = forces;
}

void Flesh::take_factors(Flesh& of)
{
    if (parts_->regions && of.parts_->regions)
        parts_->regions->take_factors(*of.parts_->regions);
}

void Flesh::set_surface(std::vector<FleshPoint> points)
{
    parts_->surface = FleshSurface(std::move(points), parts_->lattice.places.size());
}

FleshReport Flesh::step(FleshState& state, double dt, std::span<const Motion> motions,
                        const FleshSurroundings& around)
{
    Parts& p = *parts_;
    p.prepare(dt);
    FleshReport report = p.regions ? p.step_by_regions(state, dt, motions, around)
                                   : p.step_by_rounds(state, dt, motions, around);
    if (!report.is_finite)
        return report;
    state.v = p.velocity;
    state.u += dt * state.v;
    return report;
}

FleshReport Flesh::settle(FleshState& state, std::span<const Motion> motions,
                          Weighs weighs, const FleshSurroundings& around)
{
    Parts& p = *parts_;
    VectorXd weight = p.weight;
    if (weighs == Weighs::No)
        p.weight.setZero();
    double slowest = INFINITY; // sound [m/s]
    for (const FleshMaterial& material : p.materials)
        slowest = std::min(slowest, std::sqrt(material.young / material.density));
    const double dt = kLongStep * p.size / slowest;
    FleshReport report;
    report.is_converged = false;
    for (int round = 0; round < kMostRounds && !report.is_converged; ++round)
    {
        const FleshReport step = this->step(state, dt, motions, around);
        report.cg_steps += step.cg_steps;
        report.residual = step.residual;
        report.is_finite = step.is_finite;
        if (!step.is_finite)
            break;
        report.is_converged =
            step.is_converged && dt * state.v.cwiseAbs().maxCoeff() <= kAtRest * p.size;
        state.v.setZero();
    }
    p.weight = std::move(weight);
    return report;
}

Flesh::Energies Flesh::energies(const FleshState& state,
                                std::span<const Motion> motions) const
{
    Parts& p = *parts_;
    Energies out;
    if (p.settings.law == FleshLaw::Cells || p.settings.law == FleshLaw::Regions)
        p.forces.follow(state.u);
    out.elastic = p.forces.elastic_energy(state.u);
    out.tube = p.forces.tube_energy(state.u, motions);
    p.forces.multiply(state.v, {1.0, 0.0, 0.0}, p.image);
    out.kinetic = 0.5 * state.v.dot(p.image);
    for (std::size_t n = 0; n < p.lattice.places.size(); ++n)
        out.gravity -=
            p.weight.segment<3>(Eigen::Index(3 * n))
                .dot(p.lattice.places[n] + state.u.segment<3>(Eigen::Index(3 * n)));
    return out;
}

Vector3d Flesh::momentum(const FleshState& state) const
{
    parts_->forces.multiply(state.v, {1.0, 0.0, 0.0}, parts_->image);
    Vector3d sum = Vector3d::Zero();
    for (Eigen::Index n = 0; n < parts_->image.size(); n += 3)
        sum += parts_->image.segment<3>(n);
    return sum;
}

Vector3d Flesh::angular_momentum(const FleshState& state) const
{
    parts_->forces.multiply(state.v, {1.0, 0.0, 0.0}, parts_->image);
    Vector3d sum = Vector3d::Zero();
    for (std::size_t n = 0; n < parts_->lattice.places.size(); ++n)
    {
        const Vector3d x =
            parts_->lattice.places[n] + state.u.segment<3>(Eigen::Index(3 * n));
        sum += x.cross(Vector3d(parts_->image.segment<3>(Eigen::Index(3 * n))));
    }
    return sum;
}

double Flesh::largest_strain(const FleshState& state) const
{
    double largest = 0.0;
    for (const Matrix3d& F : deformations(state))
        largest =
            std::max(largest, 0.5 * (F.transpose() * F - Matrix3d::Identity()).norm());
    return largest;
}

double Flesh::largest_miss(const FleshState& state, std::span<const Motion> motions) const
{
    double largest = 0.0;
    const std::vector<int>& dropped = parts_->nodes.dropped;
    for (std::size_t k = 0; k < parts_->points.size(); ++k)
        if (!std::binary_search(dropped.begin(), dropped.end(), static_cast<int>(k)))
            largest =
                std::max(largest, (at_point(parts_->points[k].shares, state.u) -
                                   Parts::displacement_of(parts_->points[k], motions))
                                      .norm());
    return largest;
}

std::size_t Flesh::num_inverted(const FleshState& state) const
{
    if (parts_->settings.law == FleshLaw::StVenantKirchhoff ||
        parts_->settings.law == FleshLaw::NeoHookean)
        return parts_->forces.num_inverted(state.u);
    const std::vector<Matrix3d> F = deformations(state);
    return static_cast<std::size_t>(std::count_if(F.begin(), F.end(),
                                                  [](const Matrix3d& of)
                                                  { return !(of.determinant() > 0.0); }));
}

std::vector<std::size_t> Flesh::touching(const FleshState& state,
                                         std::span<const FleshObstacle> obstacles) const
{
    std::vector<std::size_t> points;
    if (!obstacles.empty())
        for (const FleshSurface::Candidate& candidate :
             parts_->surface.candidates(state.u, kTouching * parts_->size, obstacles))
            points.push_back(candidate.point);
    return points;
}

std::vector<Matrix3d> Flesh::deformations(const FleshState& state) const
{
    std::vector<Matrix3d> F;
    parts_->forces.mean_deformations(state.u, F);
    return F;
}

Eigen::MatrixXd Flesh::dense_matrix(double mass, double stiffness, double tube) const
{
    Parts& p = *parts_;
    p.forces.stand_still();
    if (p.settings.law == FleshLaw::StVenantKirchhoff ||
        p.settings.law == FleshLaw::NeoHookean)
        p.forces.follow(p.all_nodes());
    const Eigen::Index size = p.weight.size();
    Eigen::MatrixXd out(size, size);
    for (Eigen::Index k = 0; k < size; ++k)
    {
        VectorXd unit = VectorXd::Zero(size);
        unit[k] = 1.0;
        p.forces.multiply(unit, {mass, stiffness, tube}, p.image);
        out.col(k) = p.image;
    }
    return out;
}

} // namespace cellwarp
