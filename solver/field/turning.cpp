// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/turning.h"

#include <Eigen/Geometry>

#include "octree/base/nearest_rotation.h"

namespace cellwarp::core
{

Eigen::Vector3d turned_normal(const Eigen::Matrix3d& J, const Eigen::Vector3d& normal)
{
    if (J.isIdentity(0))
        return normal;
    Eigen::Matrix3d cofactor;
    for (int k = 0; k < 3; ++k)
        cofactor.col(k) = J.col((k + 1) % 3).cross(J.col((k + 2) % 3));
    const Eigen::Vector3d turned = cofactor * normal;
    const double length = turned.norm();
    return length > 0 ? Eigen::Vector3d(turned * (normal.norm() / length)) : normal;
}

Eigen::Vector3d turned_tangent(const Eigen::Matrix3d& J, const Eigen::Vector3d& tangent)
{
    if (J.isIdentity(0))
        return tangent;
    const Eigen::Vector3d turned = J * tangent;
    const double length = turned.norm();
    return length > 0 ? Eigen::Vector3d(turned * (tangent.norm() / length)) : tangent;
}

Eigen::Vector4d turned_rotation(const Eigen::Matrix3d& J, const Eigen::Vector4d& rotation)
{
    if (J.isIdentity(0))
        return rotation;
    const Eigen::Quaterniond turn(nearest_rotation(J));
    const Eigen::Quaterniond before(rotation[0], rotation[1], rotation[2], rotation[3]);
    const Eigen::Quaterniond after = turn * before;
    const Eigen::Vector4d turned(after.w(), after.x(), after.y(), after.z());
    const double scale = rotation.norm() / turned.norm();
    return turned * (turned.dot(rotation) < 0 ? -scale : scale);
}

} // namespace cellwarp::core
