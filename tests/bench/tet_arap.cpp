// SPDX-License-Identifier: GPL-3.0-or-later
// With F = R S, S symmetric, the energy of a sample is w |F - R|^2. As R is the nearest
// rotation, its own change does not count in the first derivative, 2 w (F - R). It does
// in the second: dF makes A = R^T dF, of which the part [a]x is skew. F + dF = (R + dR)(S
// + dS) with dR = R [r]x leaves of the skew parts 2 [a]x = [r]x S + S [r]x = [(tr S I -
// S) r]x, hence r = 2 (tr S I - S)^-1 a, and the derivative is 2 w (dF - R [r]x).
//
// The same equation, with the skew part of R^T F instead, is Newton's method for R. Where
// tr S I - S is positive definite there is no nearer rotation; elsewhere a singular value
// decomposition starts anew.
//
// A local/global iteration takes the R for given and minimises: x - (2 L)^-1 g, with
// L = sum w G^T G of the free nodes (G: gradients of the shape functions), which is the
// same for all three coordinates and is factorised once. So its movement is small where
// progress is slow, near the minimum or not; that of a Newton step is the distance from
// the minimum, up to second order.
#include "tests/bench/tet_arap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "io/base/error.h"
#include "octree/base/index.h"

namespace cellwarp::core::bench
{

namespace
{

constexpr std::array<std::array<std::size_t, 2>, 6> kEdges = {
    {{0, 1}, {0, 2}, {0, 3}, {1, 2}, {1, 3}, {2, 3}}};

/// The four places of a rule that is exact to the second order: one barycentric weight is
/// large, the others small.
constexpr double kLarge = 0.58541019662496845446, kSmall = 0.13819660112501051518;

Eigen::Matrix3d cross(const Eigen::Vector3d& a)
{
    Eigen::Matrix3d matrix;
    matrix << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return matrix;
}

/// The vector a of the skew part [a]x of a matrix, twice.
Eigen::Vector3d two_axes(const Eigen::Matrix3d& A)
{
    return {A(2, 1) - A(1, 2), A(0, 2) - A(2, 0), A(1, 0) - A(0, 1)};
}

Eigen::Matrix3d rotation(const Eigen::Vector3d& r)
{
    const double angle = r.norm();
    return angle > 0 ? Eigen::AngleAxisd(angle, r / angle).toRotationMatrix()
                     : Eigen::Matrix3d::Identity();
}

/// Also for matrices that turn space inside out.
Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& F)
{
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU |
                                                       Eigen::ComputeFullV);
    Eigen::Matrix3d U = svd.matrixU();
    if (U.determinant() * svd.matrixV().determinant() < 0)
        U.col(2) = -U.col(2);
    return U * svd.matrixV().transpose();
}

bool is_positive_definite(const Eigen::Matrix3d& M)
{
    return M(0, 0) > 0 && M(0, 0) * M(1, 1) - M(0, 1) * M(1, 0) > 0 &&
           M.determinant() > 0;
}

Eigen::Matrix3d trace_less(const Eigen::Matrix3d& A)
{
    return A.trace() * Eigen::Matrix3d::Identity() - 0.5 * (A + A.transpose());
}

/// Of the barycentric coordinates, one a column.
Eigen::Matrix<double, 3, 4> corner_gradients(const TetMesh& mesh, const Tet& tet)
{
    const auto point = [&](std::size_t k) -> const Eigen::Vector3d&
    { return mesh.points[idx(tet[k])]; };
    Eigen::Matrix3d edges;
    edges << point(1) - point(0), point(2) - point(0), point(3) - point(0);
    Eigen::Matrix<double, 3, 4> gradients;
    gradients.rightCols<3>() = edges.inverse().transpose();
    gradients.col(0) = -gradients.rightCols<3>().rowwise().sum();
    return gradients;
}

/// Quadratic shape functions: b (2 b - 1) of a corner, 4 b c of an edge.
Eigen::Matrix<double, 3, 10> gradients_at(const Eigen::Vector4d& b,
                                          const Eigen::Matrix<double, 3, 4>& of_corners)
{
    Eigen::Matrix<double, 3, 10> gradients;
    for (Eigen::Index k = 0; k < 4; ++k)
        gradients.col(k) = (4.0 * b[k] - 1.0) * of_corners.col(k);
    for (std::size_t e = 0; e < kEdges.size(); ++e)
    {
        const Eigen::Index i = static_cast<Eigen::Index>(kEdges[e][0]),
                           j = static_cast<Eigen::Index>(kEdges[e][1]);
        gradients.col(static_cast<Eigen::Index>(4 + e)) =
            4.0 * (b[i] * of_corners.col(j) + b[j] * of_corners.col(i));
    }
    return gradients;
}

double dot(const Eigen::MatrixX3d& a, const Eigen::MatrixX3d& b)
{
    return a.cwiseProduct(b).sum();
}

double largest_row(const Eigen::MatrixX3d& rows)
{
    return rows.rows() > 0 ? std::sqrt(rows.rowwise().squaredNorm().maxCoeff()) : 0.0;
}

} // namespace

TetElements::TetElements(const TetMesh& mesh, int order_)
    : order(order_), nodes_per_tet(order_ == 1 ? 4 : 10),
      region_of_node(mesh.region_of_point)
{
    std::vector<Eigen::Vector3d> places = mesh.points;
    std::map<std::pair<int, int>, int> node_of_edge;
    for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    {
        const Tet& tet = mesh.tets[t];
        nodes.insert(nodes.end(), tet.begin(), tet.end());
        const double volume = six_volumes(mesh, tet) / 6.0;
        const Eigen::Matrix<double, 3, 4> of_corners = corner_gradients(mesh, tet);
        if (order == 1)
        {
            samples.push_back({t, volume, of_corners});
            continue;
        }
        for (const auto& [i, j] : kEdges)
        {
            const std::pair<int, int> edge = std::minmax(tet[i], tet[j]);
            const auto [found, is_new] =
                node_of_edge.try_emplace(edge, static_cast<int>(places.size()));
            if (is_new)
            {
                const std::size_t a = idx(edge.first), b = idx(edge.second);
                places.push_back(0.5 * (places[a] + places[b]));
                region_of_node.push_back(
                    region_of_node[a] == region_of_node[b] ? region_of_node[a] : -1);
            }
            nodes.push_back(found->second);
        }
        for (Eigen::Index k = 0; k < 4; ++k)
        {
            Eigen::Vector4d b = Eigen::Vector4d::Constant(kSmall);
            b[k] = kLarge;
            samples.push_back({t, 0.25 * volume, gradients_at(b, of_corners)});
        }
    }
    rest.resize(3, static_cast<Eigen::Index>(places.size()));
    for (std::size_t n = 0; n < places.size(); ++n)
        rest.col(static_cast<Eigen::Index>(n)) = places[n];
}

Eigen::Vector3d TetElements::place(const TetFinder::Found& at,
                                   const Eigen::Matrix3Xd& x) const
{
    Eigen::Vector4d b = at.weights.cwiseMax(0.0);
    b /= b.sum();
    const Eigen::Vector4d beyond = at.weights - b;
    const int* const own = nodes_of(at.tet);
    Eigen::Vector3d place = Eigen::Vector3d::Zero();
    for (Eigen::Index k = 0; k < 4; ++k)
        place +=
            (order == 1 ? b[k] + beyond[k]
                        : b[k] * (2.0 * b[k] - 1.0) + (4.0 * b[k] - 1.0) * beyond[k]) *
            x.col(own[k]);
    for (std::size_t e = 0; order == 2 && e < kEdges.size(); ++e)
    {
        const Eigen::Index i = static_cast<Eigen::Index>(kEdges[e][0]),
                           j = static_cast<Eigen::Index>(kEdges[e][1]);
        place +=
            4.0 * (b[i] * b[j] + b[i] * beyond[j] + b[j] * beyond[i]) * x.col(own[4 + e]);
    }
    return place;
}

TetArap::TetArap(const TetElements& elements)
    : elements_(elements), splits_(elements.samples.size())
{
}

Eigen::Matrix3d TetArap::gradient_of(std::size_t sample, const Eigen::Matrix3Xd& x) const
{
    const TetSample& at = elements_.samples[sample];
    const int* const own = elements_.nodes_of(at.tet);
    Eigen::Matrix3d F = Eigen::Matrix3d::Zero();
    for (Eigen::Index k = 0; k < at.gradients.cols(); ++k)
        F += x.col(own[k]) * at.gradients.col(k).transpose();
    return F;
}

void TetArap::add_to(std::size_t sample, const Eigen::Matrix3d& P,
                     Eigen::Matrix3Xd& sum) const
{
    const TetSample& at = elements_.samples[sample];
    const int* const own = elements_.nodes_of(at.tet);
    for (Eigen::Index k = 0; k < at.gradients.cols(); ++k)
        sum.col(own[k]) += P * at.gradients.col(k);
}

void TetArap::split(Split& at)
{
    constexpr int kMaxSteps = 20;
    constexpr double kSmallTurn = 1e-9; // the next one is its square
    Eigen::Matrix3d M;
    bool is_found = false;
    for (int k = 0; k < kMaxSteps && !is_found; ++k)
    {
        const Eigen::Matrix3d A = at.R.transpose() * at.F;
        M = trace_less(A);
        if (!is_positive_definite(M))
            break;
        const Eigen::Vector3d turn = M.inverse() * two_axes(A);
        at.R = at.R * rotation(turn);
        is_found = turn.norm() < kSmallTurn;
    }
    if (!is_found)
        at.R = nearest_rotation(at.F);
    // Products of many rotations drift away from being one.
    at.R = at.R * (1.5 * Eigen::Matrix3d::Identity() - 0.5 * at.R.transpose() * at.R);
    M = trace_less(at.R.transpose() * at.F);
    at.inverse = M.inverse();
    if (!at.inverse.allFinite())
        at.inverse.setZero(); // no rotation is nearest: as if it were given
}

double TetArap::move_to(const Eigen::Matrix3Xd& x)
{
    double energy = 0.0;
    for (std::size_t s = 0; s < splits_.size(); ++s)
    {
        splits_[s].F = gradient_of(s, x);
        split(splits_[s]);
        energy +=
            elements_.samples[s].weight * (splits_[s].F - splits_[s].R).squaredNorm();
    }
    return energy;
}

Eigen::Matrix3Xd TetArap::gradient() const
{
    Eigen::Matrix3Xd gradient = Eigen::Matrix3Xd::Zero(3, elements_.rest.cols());
    for (std::size_t s = 0; s < splits_.size(); ++s)
        add_to(s, 2.0 * elements_.samples[s].weight * (splits_[s].F - splits_[s].R),
               gradient);
    return gradient;
}

Eigen::Matrix3Xd TetArap::hessian_times(const Eigen::Matrix3Xd& p) const
{
    Eigen::Matrix3Xd product = Eigen::Matrix3Xd::Zero(3, elements_.rest.cols());
    for (std::size_t s = 0; s < splits_.size(); ++s)
    {
        const Split& at = splits_[s];
        const Eigen::Matrix3d dF = gradient_of(s, p);
        const Eigen::Vector3d turn = at.inverse * two_axes(at.R.transpose() * dF);
        add_to(s, 2.0 * elements_.samples[s].weight * (dF - at.R * cross(turn)), product);
    }
    return product;
}

TetSolver::TetSolver(const TetElements& elements)
    : energy_(elements), row_of_node_(elements.num_nodes(), -1)
{
    for (std::size_t n = 0; n < elements.num_nodes(); ++n)
        if (elements.region_of_node[n] < 0)
        {
            row_of_node_[n] = static_cast<int>(node_of_row_.size());
            node_of_row_.push_back(static_cast<int>(n));
        }
    std::vector<Eigen::Triplet<double>> entries;
    for (const TetSample& at : elements.samples)
    {
        const int* const own = elements.nodes_of(at.tet);
        for (Eigen::Index i = 0; i < at.gradients.cols(); ++i)
            for (Eigen::Index j = 0; j < at.gradients.cols(); ++j)
            {
                const int row = row_of_node_[idx(own[i])],
                          column = row_of_node_[idx(own[j])];
                if (row >= column && column >= 0)
                    entries.emplace_back(
                        row, column,
                        2.0 * at.weight * at.gradients.col(i).dot(at.gradients.col(j)));
            }
    }
    const Eigen::Index rows = static_cast<Eigen::Index>(node_of_row_.size());
    Eigen::SparseMatrix<double> matrix(rows, rows);
    matrix.setFromTriplets(entries.begin(), entries.end());
    factor_.cholmod().print = 0;
    factor_.compute(matrix);
    if (factor_.info() != Eigen::Success)
        throw Error(Fault::Unsolvable, "parts of the model are held by no region");
}

TetSolver::Free TetSolver::free_rows(const Eigen::Matrix3Xd& all) const
{
    Free rows(static_cast<Eigen::Index>(node_of_row_.size()), 3);
    for (std::size_t row = 0; row < node_of_row_.size(); ++row)
        rows.row(static_cast<Eigen::Index>(row)) = all.col(node_of_row_[row]).transpose();
    return rows;
}

Eigen::Matrix3Xd TetSolver::all_columns(const Free& rows) const
{
    Eigen::Matrix3Xd all =
        Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(row_of_node_.size()));
    for (std::size_t row = 0; row < node_of_row_.size(); ++row)
        all.col(node_of_row_[row]) = rows.row(static_cast<Eigen::Index>(row)).transpose();
    return all;
}

/// Conjugate gradients for H step = -gradient. Where the curvature is negative it ends
/// with what it has; if that is nothing, with the local/global step.
TetSolver::Direction TetSolver::newton_direction(const Free& gradient,
                                                 double accuracy) const
{
    constexpr int kMaxSteps = 2000;
    Direction found{Free::Zero(gradient.rows(), 3)};
    Free residual = -gradient;
    Free z = factor_.solve(residual);
    Free p = z;
    double rz = dot(residual, z);
    const double goal = accuracy * accuracy * rz;
    while (found.cg_steps < kMaxSteps && rz > goal)
    {
        const Free Hp = free_rows(energy_.hessian_times(all_columns(p)));
        const double curvature = dot(p, Hp);
        if (!(curvature > 0))
        {
            found.is_saddle = true;
            if (found.cg_steps == 0)
                found.step = z;
            break;
        }
        ++found.cg_steps;
        const double alpha = rz / curvature;
        found.step += alpha * p;
        residual -= alpha * Hp;
        z = factor_.solve(residual);
        const double next = dot(residual, z);
        p = z + next / rz * p;
        rz = next;
    }
    return found;
}

double TetSolver::descend(Eigen::Matrix3Xd& x, const Free& gradient, const Free& step,
                          double& energy)
{
    constexpr double kSufficient = 1e-4;
    constexpr double kRounding = 1e-13; // of the energy: below it nothing is told
    const Eigen::Matrix3Xd whole = all_columns(step);
    const double slope = dot(gradient, step);
    for (double share = 1.0; share > 1e-6; share *= 0.5)
    {
        const Eigen::Matrix3Xd there = x + share * whole;
        const double found = energy_.move_to(there);
        if (found <= energy + kSufficient * share * slope + kRounding * energy)
        {
            x = there;
            energy = found;
            return share;
        }
    }
    energy = energy_.move_to(x);
    return 0.0;
}

TetSolveReport TetSolver::solve(Eigen::Matrix3Xd& x, const TetSolveOptions& options)
{
    constexpr double kRough = 0.1, kFine = 1e-3; // of Newton's equation
    TetSolveReport report;
    report.energy = energy_.move_to(x);
    for (int k = 0; k < options.local_global; ++k)
    {
        const Free gradient = free_rows(energy_.gradient());
        x -= all_columns(factor_.solve(gradient));
        report.energy = energy_.move_to(x);
    }
    report.stop = "iteration limit";
    double accuracy = kRough;
    for (; report.newton < options.max_newton; ++report.newton)
    {
        const Free gradient = free_rows(energy_.gradient());
        const Direction direction = newton_direction(gradient, accuracy);
        report.cg_steps += direction.cg_steps;
        report.is_saddle = direction.is_saddle;
        const double share = descend(x, gradient, direction.step, report.energy);
        report.newton_movement = share * largest_row(direction.step) / options.diagonal;
        if (share == 0.0)
        {
            report.stop = "no descent";
            break;
        }
        if (share == 1.0 && !direction.is_saddle && accuracy <= kFine &&
            report.newton_movement <= options.tolerance)
        {
            ++report.newton;
            report.stop = "converged";
            break;
        }
        // From here on each step squares what is left.
        constexpr double kNear = 1e-2;
        accuracy = report.newton_movement < kNear && share == 1.0 ? kFine : kRough;
    }
    const Free gradient = free_rows(energy_.gradient());
    report.local_global_movement =
        largest_row(factor_.solve(gradient)) / options.diagonal;
    return report;
}

} // namespace cellwarp::core::bench
