// SPDX-License-Identifier: GPL-3.0-or-later
// Pictures without a display: rays, a key light and ambient occlusion.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "library/picture/image.h"

namespace cellwarp::core
{

using Colour = std::array<std::uint8_t, 3>;

/// What stands in a picture. All lengths in one unit; faces are seen from both sides.
struct Figure
{
    struct Bead
    {
        Eigen::Vector3d place;
        double radius = 0.0;
        Colour colour = {};
    };
    /// What is seen through the rest: the line of a rod, its held points.
    std::vector<Bead> beads;
    std::vector<Bead> balls; ///< as solid as the rest
    std::vector<Eigen::Vector3d> points;
    std::vector<std::array<std::uint32_t, 3>> triangles;
    std::vector<Colour> colours; ///< one a point
    double point_radius = 0.0;   ///< > 0: points in no triangle are drawn as balls
    /// Boxes drawn as glass over the rest: eight corners each, corner k at the upper
    /// end of axis a if bit a of k is set.
    std::vector<std::array<Eigen::Vector3d, 8>> boxes;
    std::vector<Colour> box_colours; ///< one a box
    std::string label;               ///< above the figure; empty: none
};

struct PictureOptions
{
    int width = 1000; ///< [pixel] of one figure
    int height = 800;
    /// [degree] of the viewer about the up axis, and above the ground: as the editor
    /// shows a model at first.
    double azimuth = -35.0, elevation = 20.0;
    int up = 1; ///< axis that points up: 0, 1 or 2
    /// A sample of a pixel; fewer, down to four, in a picture of more than a million
    /// pixels, where each of them matters less.
    int occlusion_rays = 16;
    bool shows_axes = false; ///< around all figures, or what is in focus, with numbers
    /// What fills the picture; nothing: all figures.
    std::optional<Eigen::AlignedBox3d> focus = {};
};

/// Draws the figures side by side, from one viewpoint and at one scale. The same
/// input gives the same image. Throws Fault::File where letters are wanted and there is
/// no font. \pre figures are not empty
Image draw(const std::vector<Figure>& figures, const PictureOptions& options);

} // namespace cellwarp::core
