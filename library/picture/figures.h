// SPDX-License-Identifier: GPL-3.0-or-later
// Sessions as figures: a model with its regions in colour, and its cells.
#pragma once

#include "io/formats/geometry.h"
#include "library/picture/picture.h"
#include "library/session/session.h"

namespace cellwarp::core
{

/// Samples at their places, in the file's colours if it has any.
Figure figure_of(const Geometry& geometry);

/// All of them in one figure.
Figure figure_of(const std::vector<Geometry>& parts);

/// The session's model where its last frame put it (at rest before the first), its
/// regions in the colours of their roles; what is free in the file's colours if it has
/// any.
Figure figure_of(const Session& session);
/// The same with its samples at other places.
Figure figure_of(const Session& session, const std::vector<Eigen::Vector3d>& samples);

/// What the samples of a region take where the session's last frame put them. Throws
/// Fault::Usage where there is no region of that name.
Eigen::AlignedBox3d box_of_region(const Session& session, const std::string& name);

/// Adds the bones of a skeleton, seen through the rest.
void add_joints(Figure& figure, const std::vector<PosedJoint>& joints);

/// Adds the cells of a lattice, corners as Figure::boxes has them.
void add_lattice(Figure& figure,
                 const std::vector<std::array<Eigen::Vector3d, 8>>& cells);

/// Adds the cells at their poses, coloured by what holds them.
void add_cells(Figure& figure, const Session& session);

} // namespace cellwarp::core
