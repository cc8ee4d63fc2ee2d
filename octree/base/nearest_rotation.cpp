// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/nearest_rotation.h"

#include <Eigen/LU>
#include <Eigen/SVD>

namespace cellwarp::core
{

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& M)
{
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU |
                                                       Eigen::ComputeFullV);
    Eigen::Matrix3d U = svd.matrixU();
    if ((U * svd.matrixV().transpose()).determinant() < 0)
        U.col(2) *= -1.0;
    return U * svd.matrixV().transpose();
}

} // namespace cellwarp::core
