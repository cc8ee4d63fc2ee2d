// SPDX-License-Identifier: GPL-3.0-or-later
// Where the program goes its own way and leaves that of [Botsch07].
#pragma once

namespace cellwarp::core
{

/// Each can be taken back alone, to see what it brings; all taken back is the paper's
/// method ("energy": "botsch07").
struct Departures
{
    /// Glue is measured in the face that two cells share (glue.cpp). Else the integral
    /// over both cells where they are.
    bool glue_in_face = true;
    /// Where cells of different sizes meet, glue is handed over so that constant strain
    /// leaves no force. Else each face has its own.
    bool level_changes = true;
    /// Glue between a region and a free cell is as long as the free material there, and
    /// the release field has the region end there. Else glue is from centre to centre,
    /// and the region ends at the side of its cells.
    bool measured_borders = true;
    /// Sheets resist bending more around small handles; part of the glue in the face.
    /// Else they are alike everywhere.
    bool smooth_borders = true;
    /// A step keeps cells that turn as one rigid body in their places to each other
    /// (rigid_motion.cpp). Else each is turned by the closest rotation and shifted by v.
    bool rigid_steps = true;
    /// Cells split by how far they are off the affine map around them. Else by the gap to
    /// their neighbours.
    bool affine_errors = true;
    /// While dragging, a continuous blend along the glue. Else the plain average of the
    /// four closest cells.
    bool blend = true;
    /// On release, local RBFs along the glue, through corners and sides as well. Else one
    /// through all centres, and nothing but the centres.
    bool local_rbf = true;

    bool operator==(const Departures&) const = default;
};

inline constexpr Departures kBotsch07{.glue_in_face = false,
                                      .level_changes = false,
                                      .measured_borders = false,
                                      .smooth_borders = false,
                                      .rigid_steps = false,
                                      .affine_errors = false,
                                      .blend = false,
                                      .local_rbf = false};

} // namespace cellwarp::core
