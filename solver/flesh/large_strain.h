// SPDX-License-Identifier: GPL-3.0-or-later
// Elasticity in large strain, part by part: energies with forces and second derivatives
// that are made positive semi-definite.
#pragma once

#include <array>

#include <Eigen/Core>

#include "solver/flesh/part_points.h"

namespace cellwarp::core
{

/// How energy grows with strain.
enum class StrainLaw
{
    /// Green's strain in the linear law: the source's. Turns inside out where it is
    /// pressed to less than 0.577 of its length.
    StVenantKirchhoff,
    /// [Smith18], in the form without logarithm.
    NeoHookean
};

/// Displacements, and forces, of a part's corners, one after the other.
using PartVector = Eigen::Matrix<double, 24, 1>;

/// With the modes of the points, such that they cost least: cells bend without shear.
/// Points whose modes are zero have none.
struct StrainEnergy
{
    double energy = 0.0; ///< [J]
    PartVector gradient = PartVector::Zero();
};

/// det F without the modes at the point where it is least.
double least_volume(const PartPoints& points, const PartVector& u);

StrainEnergy strain_energy(const PartPoints& points, const FleshMaterial& material,
                           StrainLaw law, const PartVector& u);

/// Whether what is negative of the second derivatives is cut off.
enum class Filter
{
    No,
    Yes
};

PartMatrix strain_hessian(const PartPoints& points, const FleshMaterial& material,
                          StrainLaw law, const PartVector& u, Filter filter);

} // namespace cellwarp::core
