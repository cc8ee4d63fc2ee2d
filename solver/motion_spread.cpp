// SPDX-License-Identifier: GPL-3.0-or-later
// The minimiser sees only glue that is torn where a region has moved away from its
// neighbours, and would mend it from there inwards, the slower the finer the cells. From
// a start that spreads the step over the whole body it takes the same few iterations for
// any number of cells.
//
// Shares s_r solve sum_j w_ij (s_i - s_j) = 0 over the glue, 1 in cells of region r, 0 in
// those of others: found by conjugate gradients, no better than a guess deserves. Steps
// are blended as dual quaternions [Kavan07], along screws; every step turns by less than
// half a turn, so the quaternions of all with a positive real part can be added.
#include "solver/motion_spread.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

/// Of the shares; relative to the first residual.
constexpr double kTolerance = 1e-3;
constexpr int kMaxSteps = 2000;

/// Smaller shares are none.
constexpr double kLeast = 1e-4;

/// sum_j w_ij (x_i - x_j) in free cells, 0 elsewhere.
class Laplacian
{
public:
    Laplacian(const Glue& glue, std::vector<bool> is_free)
        : glue_(glue), is_free_(std::move(is_free)), diagonal_(is_free_.size(), 0.0)
    {
        for (const GlueFace& face : glue.faces)
        {
            diagonal_[static_cast<std::size_t>(face.a)] += face.stiffness;
            diagonal_[static_cast<std::size_t>(face.b)] += face.stiffness;
        }
    }
    bool is_free(std::size_t cell) const { return is_free_[cell]; }
    double diagonal(std::size_t cell) const { return diagonal_[cell]; }

    void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const
    {
        parallel_ranges(
            is_free_.size(), 1024,
            [&](std::size_t begin, std::size_t end)
            {
                for (std::size_t i = begin; i < end; ++i)
                {
                    double sum = 0.0;
                    for (int k = glue_.first_face[i]; k < glue_.first_face[i + 1]; ++k)
                    {
                        const GlueFace& face = glue_.faces[static_cast<std::size_t>(
                            glue_.faces_of_cell[static_cast<std::size_t>(k)])];
                        sum += face.stiffness * (x[face.a] - x[face.b]) *
                               (face.a == static_cast<int>(i) ? 1.0 : -1.0);
                    }
                    y[static_cast<Eigen::Index>(i)] = is_free_[i] ? sum : 0.0;
                }
            });
    }

private:
    const Glue& glue_;
    std::vector<bool> is_free_;
    std::vector<double> diagonal_;
};

/// Makes \p x, given in cells that are not free, harmonic in the others.
void make_harmonic(const Laplacian& laplacian, Eigen::VectorXd& x)
{
    Eigen::VectorXd r(x.size()), z(x.size()), image(x.size());
    const auto precondition = [&]
    {
        for (Eigen::Index i = 0; i < x.size(); ++i)
            z[i] = laplacian.is_free(static_cast<std::size_t>(i))
                       ? r[i] / laplacian.diagonal(static_cast<std::size_t>(i))
                       : 0.0;
    };
    laplacian.multiply(x, r);
    r = -r;
    precondition();
    Eigen::VectorXd direction = z;
    double r_z = r.dot(z);
    const double least = kTolerance * kTolerance * r_z;
    for (int step = 0; step < kMaxSteps && r_z > least; ++step)
    {
        laplacian.multiply(direction, image);
        const double length = r_z / direction.dot(image);
        if (!std::isfinite(length))
            break;
        x += length * direction;
        r -= length * image;
        precondition();
        const double next = r.dot(z);
        direction = z + next / r_z * direction;
        r_z = next;
    }
}

struct DualQuaternion
{
    Eigen::Vector4d real, dual;

    explicit DualQuaternion(const Motion& motion)
    {
        Eigen::Quaterniond q(motion.R);
        if (q.w() < 0)
            q.coeffs() = -q.coeffs();
        const Eigen::Quaterniond t(0.0, motion.t.x(), motion.t.y(), motion.t.z());
        real = q.coeffs();
        dual = 0.5 * (t * q).coeffs();
    }
};

/// The motion of a sum of dual quaternions.
Motion motion_of(const Eigen::Vector4d& real, const Eigen::Vector4d& dual)
{
    const double length = real.norm();
    const Eigen::Quaterniond q(Eigen::Vector4d(real / length));
    const Eigen::Quaterniond d(Eigen::Vector4d(dual / length));
    return {q.toRotationMatrix(), 2.0 * (d * q.conjugate()).vec()};
}

} // namespace

MotionSpread::MotionSpread(const Cells& cells, const Glue& glue,
                           std::span<const Constraint> constraints,
                           std::span<const int> region_of_cell, int num_regions)
{
    const std::size_t n = cells.size();
    std::vector<bool> is_free(n);
    for (std::size_t i = 0; i < n; ++i)
        is_free[i] = constraints[i].hold == Hold::Free;
    const Laplacian laplacian(glue, is_free);
    std::vector<std::vector<Share>> of_cell(n);
    for (int region = 0; region < num_regions; ++region)
    {
        Eigen::VectorXd x = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(n));
        for (std::size_t i = 0; i < n; ++i)
            x[static_cast<Eigen::Index>(i)] =
                !is_free[i] && region_of_cell[i] == region ? 1.0 : 0.0;
        if (x.isZero(0))
            continue;
        make_harmonic(laplacian, x);
        for (std::size_t i = 0; i < n; ++i)
            if (const double value = x[static_cast<Eigen::Index>(i)]; value > kLeast)
                of_cell[i].push_back({region, static_cast<float>(value)});
    }
    first_.push_back(0);
    for (const std::vector<Share>& shares : of_cell)
    {
        shares_.insert(shares_.end(), shares.begin(), shares.end());
        first_.push_back(static_cast<int>(shares_.size()));
    }
}

double MotionSpread::share(int cell, int region) const
{
    const std::size_t c = static_cast<std::size_t>(cell);
    for (int k = first_[c]; k < first_[c + 1]; ++k)
        if (shares_[static_cast<std::size_t>(k)].region == region)
            return static_cast<double>(shares_[static_cast<std::size_t>(k)].value);
    return 0.0;
}

void MotionSpread::carry(std::span<const Motion> steps, std::span<const int> cells,
                         std::span<Pose> poses) const
{
    const auto carry_one = [&](std::size_t i)
    {
        const std::size_t first = static_cast<std::size_t>(first_[i]);
        const std::span<const Share> shares = std::span(shares_).subspan(
            first, static_cast<std::size_t>(first_[i + 1]) - first);
        if (shares.empty())
            return;
        const Motion& one = steps[static_cast<std::size_t>(shares[0].region)];
        bool is_one = true;
        Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = real;
        for (const Share& share : shares)
        {
            const Motion& step = steps[static_cast<std::size_t>(share.region)];
            is_one = is_one && step.R == one.R && step.t == one.t;
            const DualQuaternion q(step);
            real += static_cast<double>(share.value) * q.real;
            dual += static_cast<double>(share.value) * q.dual;
        }
        const Motion blend = is_one ? one : motion_of(real, dual);
        poses[i] = {blend.R * poses[i].R, blend(poses[i].p)};
    };
    parallel_ranges(cells.size(), 256,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t k = begin; k < end; ++k)
                            carry_one(static_cast<std::size_t>(cells[k]));
                    });
}

} // namespace cellwarp
