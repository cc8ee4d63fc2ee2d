// SPDX-License-Identifier: GPL-3.0-or-later
// Elastic glue between rigid cells: the energy that makes them behave like one
// elastic body. No octree and no linear algebra here; glue.cpp has the derivation.
#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "octree/base/rigid_motion.h"
#include "octree/bridges.h"
#include "octree/cells.h"
#include "solver/cells/departures.h"
#include "solver/cells/glue_block.h"
#include "solver/minimize/term.h"

namespace cellwarp::core
{

/// What one face of glue remembers of the rest state.
struct GlueFace
{
    int a = 0, b = 0;
    double length = 0.0;    ///< over which it stretches
    double stiffness = 0.0; ///< w_ij [length], times the factor of stiff regions
    Eigen::Vector3d reach_a, reach_b; ///< from the centroids to the face's centre
    /// S with tr S I - S = M, what turning counts (Face::turning); M is positive
    /// definite, S need not be.
    Eigen::Matrix3d moment;
};

/// The glue of a set of cells. Rest state: immutable.
struct Glue
{
    std::vector<GlueFace> faces;
    std::vector<int> first_face; ///< cells + 1 offsets into faces_of_cell
    std::vector<int> faces_of_cell;

    /// Fills these two lists from the faces.
    void list_faces_of_cells(std::size_t num_cells);
};

/// A face whose glue does not stretch from anchor to anchor, because one of its cells is
/// rigid: over what length it does.
struct BorderGlue
{
    int face = 0;
    double length = 0.0;
    bool is_a_rigid = false; ///< else b
};

/// \p cell_factors: stiffness of each cell relative to plain material, > 0; a face
/// takes the geometric mean of its two. Empty: all 1.
/// \p departures: glue_in_face and level_changes count here.
/// \p bending: what Face::turning of each face grows by about the axes in its sheet, with
/// glue_in_face [length^2]; empty: 0.
Glue build_glue(const Cells& cells, std::span<const double> cell_factors,
                std::span<const BorderGlue> borders = {},
                const Departures& departures = {}, std::span<const double> bending = {});

/// The glue of bridges between cells, as between those that touch.
std::vector<GlueFace> bridge_glue(const Cells& cells, std::span<const Bridge> bridges,
                                  std::span<const double> cell_factors);

/// The same glue where groups of cells are one rigid body each: a group's faces are its
/// leader's, and those within it are gone. \p leaders: of each cell; -1: it is in none.
Glue with_groups(const Glue& glue, const Cells& cells, std::span<const int> leaders);

/// E_ij of one face: w_ij times the mean of |T_i - T_j|^2 over the cross-section of the
/// material, of which glue.cpp says what counts [length^3]. Zero if and only if both
/// cells make the same rigid motion. After [Botsch07].
double glue_energy(const GlueFace& face, const Pose& a, const Pose& b);

/// Derivative of the energy of one face in the twists of a (0..5) and b (6..11),
/// angular before linear. In place of rotations themselves: see moved().
Eigen::Matrix<double, 12, 1> glue_gradient(const GlueFace& face, const Pose& a,
                                           const Pose& b);

/// Second derivative in the twist of one of the face's cells.
GlueBlock glue_diagonal_a(const GlueFace& face, const Pose& a, const Pose& b,
                          Curvature curvature);
GlueBlock glue_diagonal_b(const GlueFace& face, const Pose& a, const Pose& b,
                          Curvature curvature);

/// Second derivative in the twists of both cells, rows of a, columns of b: all curvature
/// is in the diagonal.
GlueBlock glue_coupling(const GlueFace& face, const Pose& a, const Pose& b);

/// Sum over all faces, in their order, or over those that \p counts.
double glue_energy(const Glue& glue, std::span<const Pose> poses,
                   const std::function<bool(const GlueFace&)>& counts = {});

} // namespace cellwarp::core
