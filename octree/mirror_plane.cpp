// SPDX-License-Identifier: GPL-3.0-or-later
// The normal of a mirror plane is an axis of the samples' second moments, or lies between
// two that are alike. From such normals a plane is improved in rounds: each sample p is
// paired with the sample q nearest to its image. With p', q' from their means, the
// reflection S = I - 2 n n^T that brings p' nearest to q' has the n that makes
// sum (n.p')(n.q') least: the last eigenvector of the symmetric part of sum p' q'^T. The
// plane goes through the middle of both means.
#include "octree/mirror_plane.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>

#include "octree/base/bounding_box.h"
#include "octree/base/index.h"
#include "octree/base/point_tree.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Numbers of samples that are mirrored to improve a plane, and to judge it.
constexpr std::size_t kToImprove = 400, kToJudge = 3000;

/// Rounds at the most; they end where the plane moves less than kPlaneStill (of its
/// normal, and of the diagonal).
constexpr int kPlaneRounds = 20;
constexpr double kPlaneStill = 1e-12;

/// Pairs that are farther apart do not count; a sample that is nearer to an image than
/// this is its image; and the share of samples that have one [diagonal].
constexpr double kImageFar = 0.15, kImageNear = 0.02, kImageShare = 0.97;

/// Two planes are one where their normals are nearer than this, and their places
/// [diagonal].
constexpr double kSameNormal = 0.1, kSamePlace = 0.02;

/// A normal so near to an axis, and a place so near to 0 [diagonal], are made exact where
/// images stay as near as kAsNear times their mean distance.
constexpr double kNearAxis = 0.04, kNearOrigin = 0.005, kAsNear = 1.05;

/// Every so manyth sample.
std::vector<Vector3d> thinned(const std::vector<Vector3d>& samples, std::size_t most)
{
    const std::size_t step = (samples.size() + most - 1) / most;
    std::vector<Vector3d> out;
    for (std::size_t k = 0; k < samples.size(); k += step)
        out.push_back(samples[k]);
    return out;
}

Vector3d mean_place(const std::vector<Vector3d>& points)
{
    Vector3d sum = Vector3d::Zero();
    for (const Vector3d& x : points)
        sum += x;
    return sum / static_cast<double>(points.size());
}

/// The quality of a mirror plane.
struct MirrorFit
{
    double share = 0.0; ///< of samples that have an image
    double mean = 0.0;  ///< distance of the image [diagonal]
};

class PlaneSearch
{
public:
    explicit PlaneSearch(const std::vector<Vector3d>& samples)
        : tree_(samples), to_improve_(thinned(samples, kToImprove)),
          to_judge_(thinned(samples, kToJudge)), middle_(mean_place(samples))
    {
        Matrix3d moments = Matrix3d::Zero();
        for (const Vector3d& x : samples)
            moments += (x - middle_) * (x - middle_).transpose();
        diagonal_ = box_around(samples).diagonal().norm();
        axes_ = Eigen::SelfAdjointEigenSolver<Matrix3d>(moments).eigenvectors();
    }

    std::vector<MirrorPlane> planes() const
    {
        struct Found
        {
            MirrorPlane plane;
            MirrorFit fit;
        };
        std::vector<Found> found;
        for (const Vector3d& normal : first_normals())
        {
            const MirrorPlane plane = rounded(improved({normal, normal.dot(middle_)}));
            const MirrorFit fit = fit_of(plane);
            if (fit.share < kImageShare)
                continue;
            const auto same = std::find_if(found.begin(), found.end(),
                                           [&](const Found& other)
                                           { return is_same(other.plane, plane); });
            if (same == found.end())
                found.push_back({plane, fit});
            else if (fit.mean < same->fit.mean)
                *same = {plane, fit};
        }
        std::stable_sort(found.begin(), found.end(),
                         [](const Found& a, const Found& b)
                         { return a.fit.mean < b.fit.mean; });
        std::vector<MirrorPlane> out;
        for (const Found& one : found)
            out.push_back(one.plane);
        return out;
    }

private:
    /// The axes of the space and of the moments, and those between two or three of these.
    std::vector<Vector3d> first_normals() const
    {
        std::vector<Vector3d> out = {Vector3d::UnitX(), Vector3d::UnitY(),
                                     Vector3d::UnitZ()};
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = 0; z <= 1; ++z)
                    if (z > 0 || y > 0 || (y == 0 && x > 0))
                        out.push_back((axes_ * Vector3d(x, y, z)).normalized());
        return out;
    }
    MirrorPlane improved(MirrorPlane plane) const
    {
        for (int round = 0; round < kPlaneRounds; ++round)
        {
            std::vector<Vector3d> from, to;
            for (const Vector3d& p : to_improve_)
            {
                const auto [index, squared] = tree_.nearest(plane.mirrored(p));
                if (squared > kImageFar * kImageFar * diagonal_ * diagonal_)
                    continue;
                from.push_back(p);
                to.push_back(tree_.points()[index]);
            }
            if (from.size() < 3)
                return plane;
            const Vector3d p = mean_place(from), q = mean_place(to);
            Matrix3d sum = Matrix3d::Zero();
            for (std::size_t k = 0; k < from.size(); ++k)
                sum += (from[k] - p) * (to[k] - q).transpose();
            Vector3d normal =
                Eigen::SelfAdjointEigenSolver<Matrix3d>(0.5 * (sum + sum.transpose()))
                    .eigenvectors()
                    .col(0);
            if (normal.dot(plane.normal) < 0.0)
                normal = -normal;
            const MirrorPlane next{normal, 0.5 * normal.dot(p + q)};
            const bool is_still = (next.normal - plane.normal).norm() < kPlaneStill &&
                                  std::abs(next.at - plane.at) < kPlaneStill * diagonal_;
            plane = next;
            if (is_still)
                break;
        }
        return plane;
    }
    /// The plane along axes and through 0 where that mirrors as well.
    MirrorPlane rounded(const MirrorPlane& plane) const
    {
        int axis = 0;
        plane.normal.cwiseAbs().maxCoeff(&axis);
        MirrorPlane exact = plane;
        if (1.0 - std::abs(plane.normal[axis]) < 0.5 * kNearAxis * kNearAxis)
        {
            exact.normal = Vector3d::Unit(axis);
            exact.at = plane.normal[axis] * plane.at;
        }
        if (std::abs(exact.at) < kNearOrigin * diagonal_)
            exact.at = 0.0;
        const MirrorFit fit = fit_of(plane), as_exact = fit_of(exact);
        return as_exact.mean <= kAsNear * fit.mean + kPlaneStill ? exact : plane;
    }
    MirrorFit fit_of(const MirrorPlane& plane) const
    {
        MirrorFit fit;
        for (const Vector3d& x : to_judge_)
        {
            const double away =
                std::sqrt(tree_.nearest(plane.mirrored(x)).distance_squared) / diagonal_;
            fit.mean += away;
            fit.share += away < kImageNear ? 1.0 : 0.0;
        }
        fit.mean /= static_cast<double>(to_judge_.size());
        fit.share /= static_cast<double>(to_judge_.size());
        return fit;
    }
    bool is_same(const MirrorPlane& one, const MirrorPlane& other) const
    {
        const double sign = one.normal.dot(other.normal) < 0.0 ? -1.0 : 1.0;
        return (one.normal - sign * other.normal).norm() < kSameNormal &&
               std::abs(one.side(middle_) - sign * other.side(middle_)) <
                   kSamePlace * diagonal_;
    }

    PointTree tree_;
    std::vector<Vector3d> to_improve_, to_judge_;
    Vector3d middle_;
    double diagonal_ = 0.0;
    Matrix3d axes_;
};

} // namespace

std::vector<MirrorPlane> mirror_planes(const std::vector<Vector3d>& samples)
{
    return samples.size() < 4 ? std::vector<MirrorPlane>()
                              : PlaneSearch(samples).planes();
}

} // namespace cellwarp::core
