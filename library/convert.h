// SPDX-License-Identifier: GPL-3.0-or-later
// Values of the interface as those of the rooms, and back.
#pragma once

#include <cmath>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <cellwarp/points.h>
#include <cellwarp/report.h>
#include <cellwarp/settings.h>
#include <cellwarp/skeleton.h>

#include "io/scene/skeleton_file.h"
#include "library/session/frame_report.h"
#include "library/session/rod_report.h"
#include "library/session/session_settings.h"
#include "library/session/skeleton_handle.h"

namespace cellwarp
{

inline Eigen::Vector3d to_eigen(const Vec3& v)
{
    return {v[0], v[1], v[2]};
}

inline Vec3 from_eigen(const Eigen::Vector3d& v)
{
    return {v.x(), v.y(), v.z()};
}

std::vector<Vec3> from_eigen(std::span<const Eigen::Vector3d> vectors);
Eigen::Matrix4d to_eigen(const Mat4& matrix);
Mat4 from_eigen(const Eigen::Matrix4d& matrix);

/// The numbers of vectors that lie one behind the other.
template <class Vector>
std::span<const double> numbers_of(const std::vector<Vector>& vectors)
{
    static_assert(sizeof(Vector) == Vector::SizeAtCompileTime * sizeof(double));
    return {reinterpret_cast<const double*>(vectors.data()),
            vectors.size() * Vector::SizeAtCompileTime};
}

core::SkeletonJoint to_core(const Joint& joint);
std::vector<Joint> from_core(std::span<const core::SkeletonJoint> joints);
std::vector<PosedJoint> from_core(std::span<const core::PosedJoint> joints);
Stop from_core(core::Stop stop);
FrameReport from_core(const core::FrameReport& report);
std::vector<RodReport> from_core(std::span<const core::RodReport> rods);

/// Settings of a session. Throws Fault::Usage for what is out of range.
core::SessionSettings to_core(const Settings& settings);
core::FieldKind to_core(FieldKind kind);
/// RbfCentres counts as RbfGlobal.
FieldKind from_core(core::FieldKind kind);
/// The limit of a process [byte], 0: none; of one where 0 is 70 % of what is free, and
/// infinity none.
double memory_limit(double max_memory);

} // namespace cellwarp
