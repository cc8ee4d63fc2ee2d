// SPDX-License-Identifier: GPL-3.0-or-later
// Where the work is done: in the octree's own frame, moved to the origin and scaled
// by an exact power of two, so that a model of any size, at any place, is treated
// alike and loses no digit.
#pragma once

#include <span>

#include <Eigen/Core>

#include "io/scene/scene_file.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

struct WorkFrame
{
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();   ///< [model unit]
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity(); ///< rows: unit vectors
    int exponent = 0; ///< one model unit is 2^exponent work units
    Eigen::Vector3d size = Eigen::Vector3d::Zero(); ///< of the box [work]

    double diagonal() const { return size.norm(); }
    Eigen::Vector3d to_work(const Eigen::Vector3d& point) const;
    Eigen::Vector3d to_model(const Eigen::Vector3d& point) const;
    /// Vectors have a length but no place.
    Eigen::Vector3d vector_to_work(const Eigen::Vector3d& vector) const;
    Eigen::Vector3d vector_to_model(const Eigen::Vector3d& vector) const;
    double length_to_model(double length) const;
    /// A rotation given in model axes.
    Eigen::Matrix3d rotation_to_work(const Eigen::Matrix3d& R) const;
    /// A motion of the work's space, of the model's [model unit].
    Motion motion_to_model(const Motion& motion) const;
};

struct ModelBox
{
    Eigen::Vector3d low, high;
    Eigen::Vector3d size() const { return high - low; }
    Eigen::Vector3d centre() const { return 0.5 * (low + high); }
};
/// \pre not empty
ModelBox bounding_box(std::span<const Eigen::Vector3d> samples);

/// "1.25 0.5 -3": a place for people, to a thousandth of a size.
std::string place_text(const Eigen::Vector3d& x, double size);

/// The model's bounding box.
WorkFrame automatic_frame(const ModelBox& box);

/// The frame of a scene. Throws Fault::Malformed if its axes are no rotation
/// (to 1e-4; made exact from there).
WorkFrame given_frame(const FrameBox& box, const std::string& file);

} // namespace cellwarp::core
