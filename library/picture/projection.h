// SPDX-License-Identifier: GPL-3.0-or-later
// From a model's space to the pixels of a picture, without perspective.
#pragma once

#include <Eigen/Core>

namespace cellwarp::core
{

struct Projection
{
    Eigen::Vector3d right, up, back; ///< unit vectors; the viewer looks along -back
    Eigen::Vector3d centre;          ///< that is in the picture's middle
    double pixel = 1.0;              ///< its edge, in the model's unit
    int width = 0, height = 0;       ///< [pixel]

    /// Columns to the right and rows downwards, from the upper left corner of the
    /// picture.
    Eigen::Vector2d at(const Eigen::Vector3d& x) const
    {
        const Eigen::Vector3d d = x - centre;
        return {0.5 * width + right.dot(d) / pixel, 0.5 * height - up.dot(d) / pixel};
    }
};

} // namespace cellwarp::core
