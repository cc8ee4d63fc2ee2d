// SPDX-License-Identifier: GPL-3.0-or-later
// [Botsch07] integrates |T_a - T_b|^2 over both cells where they are. Here each of them
// is first slid to have its centroid at the centre x of the face that they share. With D
// = T_a - T_b, which is affine, and a cell's second moment S,
//   int_C |D|^2 = V ( |D(x)|^2 + tr(dR S dR^T) ),   dR = R_a - R_b,
// so over both cells, divided by V_a + V_b and with
// S = (V_a S_a + V_b S_b) / (V_a + V_b) = sum_k l_k l_k^T,
//   E = w ( |D(x)|^2 + sum_k |R_a l_k - R_b l_k|^2 ),   w = area / length.
// Both tend to int |grad phi - R|^2 as cells become small. But
// - What S has along the face makes up just what a bar of whole cells bends too easily by
//   without it; what it has across comes on top, and is too much: by 1 / n^2 in a bar of
//   n cells. Unslid, it would be 4 / n^2. Larger cells would be stiffer than smaller
//   ones, and where both meet the map would be worse than with the larger alone. So
//   solids are given a tenth of it, enough to hold films of material that are thinner
//   than a cell; over the face alone, without any, is the energy of [Botsch06]. A shell
//   has no thickness but its cells'. Measured: RMS error of the armadillo with 1,700
//   cells 2.5e-3 of the diagonal with all of S, 1.4e-3 with a twentieth; of a plate one
//   cell thick, refined in places, 4.2e-3 and 0.8e-3.
// - Slid, a field of constant strain F = R U balances every cell of one size, cut by the
//   surface or not. Let the T_i agree with it at the boxes' centres q_i: the gap is then
//   (F - R)(q_b - q_a), normal to the face and as long as the cells are apart. So the
//   force of a face is 2 area (F - R) n and acts at its centre, as the traction of that
//   field does; forces and moments of a cell add up to those of the field on what is left
//   open, where it has no traction. Between centroids, which lie anywhere in pieces, they
//   do not: forces of first order would be left along every surface.
//
// Where a cell B meets smaller ones, q_B - q_s is not normal to the face: it has a part
// t, half a small edge h along each axis of the face, towards the middle of B's side.
// With w = area / length that leaves a force 2 w (F - R) t on s, which no other face
// takes. But its sibling s' in that direction meets B as well and has the opposite force:
// when their common glue is weaker by d = w |t| / h, the two forces are just what it
// lacks. The energy is right again too: it lacks d h^2, and 2 w |t|^2 is as much. Taken
// over near B, what is left acts farther from it, by h / 2 d / (w' - d), w' its own w.
// Then constant strain leaves no force on cells of any size, and no moment if it is
// stretch along the axes; for shear the moments of V (F - R) are right to a sixth.
// Without this, cells of two sizes are less accurate than the larger ones alone.
//
// E is a sum of four terms m |d|^2 with
//   d = (r_a + f p_a) - (r_b + f p_b),
// arms r that turn with their cell and f = 1 for the face's centre, 0 for the moments.
// A twist changes r by omega x r + 1/2 omega x (omega x r) and p by v + 1/2 omega x v
// (see pose.cpp), hence
//   dE = 2 m d . (omega_a x r_a + f v_a - omega_b x r_b - f v_b),
// the Gauss-Newton matrix is 2 m J^T J, and the curvature of omega_a adds
//   2 m [ (d r^T + r d^T) / 2 - (d . r) I ],   that of omega_b the same with -d;
// with g_v the gradient in v, the blocks of (v, omega) gain [g_v]x / 2.
//
// With C = sum_k r_bk r_ak^T over the moments (C = R_b S R_a^T) their parts are
//   gradient   -2 w sum_k r_ak x r_bk, which is what is skew in C,
//   diagonal    2 w (tr A I - A),  A = R_a S R_a^T, curvature 2 w (A - sym C - tr(A - C)
//   I), coupling   -2 w (tr C I - C).
#include "solver/glue.h"

#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

/// The gaps of a face: T_a - T_b at its centre and of the turned moment roots.
struct Gaps
{
    Eigen::Vector3d arm_a, arm_b;   ///< R_a reach_a, R_b reach_b
    Eigen::Vector3d open;           ///< T_a - T_b
    Eigen::Matrix3d root_a, root_b; ///< R l_k as columns

    Gaps(const GlueFace& face, const Pose& a, const Pose& b)
        : arm_a(a.R * face.reach_a), arm_b(b.R * face.reach_b),
          open(a.p + arm_a - b.p - arm_b), root_a(a.R * face.moment_root),
          root_b(b.R * face.moment_root)
    {
    }
};

/// sym(d r^T) - (d . r) I
Eigen::Matrix3d arm_curvature(const Eigen::Vector3d& d, const Eigen::Vector3d& r)
{
    return 0.5 * (d * r.transpose() + r * d.transpose()) -
           d.dot(r) * Eigen::Matrix3d::Identity();
}

/// tr M I - M
Eigen::Matrix3d inertia(const Eigen::Matrix3d& M)
{
    return M.trace() * Eigen::Matrix3d::Identity() - M;
}

/// The diagonal block of the cell with the one given arm, the gap as seen from it, and
/// its moment roots.
Eigen::Matrix<double, 6, 6> diagonal(double stretch, const Eigen::Vector3d& arm,
                                     const Eigen::Vector3d& d,
                                     const Eigen::Matrix3d& root,
                                     const Eigen::Matrix3d& other_root, double share)
{
    const Eigen::Matrix3d A = root * root.transpose();
    Eigen::Matrix3d turn = inertia(arm * arm.transpose()) + inertia(A);
    Eigen::Matrix3d mixed = cross_matrix(arm); // angular, linear
    if (share > 0)
    {
        const Eigen::Matrix3d C = other_root * root.transpose(), D = A - C;
        turn += share * (arm_curvature(d, arm) + 0.5 * (D + D.transpose()) -
                         D.trace() * Eigen::Matrix3d::Identity());
        mixed -= 0.5 * share * cross_matrix(d);
    }
    Eigen::Matrix<double, 6, 6> H;
    H.topLeftCorner<3, 3>() = turn;
    H.topRightCorner<3, 3>() = mixed;
    H.bottomLeftCorner<3, 3>() = mixed.transpose();
    H.bottomRightCorner<3, 3>().setIdentity();
    return stretch * H;
}

/// Of the stiffness of a face this much stays where larger cells are beside it: a third
/// is left by two of them; what is cut by the surface may come out at less.
constexpr double kLeastLeft = 0.3;

/// Cells of which one has smaller neighbours in the other's place. One that shares its
/// box is not in a lattice with others.
bool differ_in_size(const Cell& a, const Cell& b)
{
    return a.edge != b.edge && a.anchor == a.box_centre && b.anchor == b.box_centre;
}

Eigen::Matrix3d square_root(const Eigen::Matrix3d& S)
{
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(S);
    return eigen.eigenvectors() *
           eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

/// Of the glue between two cells; without a root where both are the same.
double face_factor(std::span<const double> cell_factors, int a, int b)
{
    if (cell_factors.empty())
        return 1.0;
    const double of_a = cell_factors[static_cast<std::size_t>(a)];
    const double of_b = cell_factors[static_cast<std::size_t>(b)];
    return of_a == of_b ? of_a : std::sqrt(of_a) * std::sqrt(of_b);
}

/// What larger cells beside a face take over of its glue: see above.
struct TakenOver
{
    double stiffness = 0.0;                           ///< [length]
    Eigen::Vector3d moment = Eigen::Vector3d::Zero(); ///< times by how much it moves off
};

std::vector<TakenOver> taken_over(const Cells& cells, const Glue& glue,
                                  const std::vector<bool>& is_border)
{
    std::vector<TakenOver> taken(cells.faces.size());
    for (std::size_t f = 0; f < cells.faces.size(); ++f)
    {
        const Face& face = cells.faces[f];
        const Cell& a = cells.cells[static_cast<std::size_t>(face.a)];
        const Cell& b = cells.cells[static_cast<std::size_t>(face.b)];
        if (is_border[f] || !differ_in_size(a, b))
            continue;
        const bool is_a_small = a.edge < b.edge;
        const Cell& small = is_a_small ? a : b;
        const Eigen::Vector3d step = (is_a_small ? b : a).anchor - small.anchor;
        const std::size_t s = static_cast<std::size_t>(is_a_small ? face.a : face.b);
        for (int k = glue.first_face[s]; k < glue.first_face[s + 1]; ++k)
        {
            const std::size_t g =
                static_cast<std::size_t>(glue.faces_of_cell[static_cast<std::size_t>(k)]);
            const Face& other = cells.faces[g];
            const bool is_upwards = static_cast<std::size_t>(other.a) == s;
            if (other.axis == face.axis || is_border[g] ||
                is_upwards != (step[other.axis] > 0) ||
                differ_in_size(cells.cells[static_cast<std::size_t>(other.a)],
                               cells.cells[static_cast<std::size_t>(other.b)]))
                continue;
            // A half: the sibling gives the other.
            const double part =
                0.5 * glue.faces[f].stiffness * std::abs(step[other.axis]) / small.edge;
            taken[g].stiffness += part;
            taken[g].moment[face.axis] += 0.5 * small.edge * (is_a_small ? -part : part);
        }
    }
    return taken;
}

} // namespace

Glue build_glue(const Cells& cells, std::span<const double> cell_factors,
                std::span<const BorderGlue> borders, double across)
{
    Glue glue;
    std::vector<std::vector<int>> of_cell(cells.size());
    glue.faces.resize(cells.faces.size());
    for (std::size_t f = 0; f < cells.faces.size(); ++f)
    {
        const Face& face = cells.faces[f];
        glue.faces[f].a = face.a;
        glue.faces[f].b = face.b;
        glue.faces[f].length = face.distance;
        of_cell[static_cast<std::size_t>(face.a)].push_back(static_cast<int>(f));
        of_cell[static_cast<std::size_t>(face.b)].push_back(static_cast<int>(f));
    }
    glue.first_face.push_back(0);
    for (const std::vector<int>& faces : of_cell)
    {
        glue.faces_of_cell.insert(glue.faces_of_cell.end(), faces.begin(), faces.end());
        glue.first_face.push_back(static_cast<int>(glue.faces_of_cell.size()));
    }
    std::vector<bool> is_border(cells.faces.size(), false);
    for (const BorderGlue& border : borders)
    {
        glue.faces[static_cast<std::size_t>(border.face)].length = border.length;
        is_border[static_cast<std::size_t>(border.face)] = true;
    }
    for (std::size_t f = 0; f < cells.faces.size(); ++f)
    {
        GlueFace& face = glue.faces[f];
        face.stiffness =
            face_factor(cell_factors, face.a, face.b) * cells.faces[f].area / face.length;
    }
    const std::vector<TakenOver> taken = taken_over(cells, glue, is_border);
    for (std::size_t f = 0; f < cells.faces.size(); ++f)
    {
        const Face& face = cells.faces[f];
        const Cell& a = cells.cells[static_cast<std::size_t>(face.a)];
        const Cell& b = cells.cells[static_cast<std::size_t>(face.b)];
        GlueFace& out = glue.faces[f];
        out.stiffness =
            std::max(out.stiffness - taken[f].stiffness, kLeastLeft * out.stiffness);
        const Eigen::Vector3d place = face.centre + taken[f].moment / out.stiffness;
        out.reach_a = place - a.centre;
        out.reach_b = place - b.centre;
        Eigen::Matrix3d moment =
            (a.volume * a.second_moment + b.volume * b.second_moment) /
            (a.volume + b.volume);
        moment.row(face.axis) *= std::sqrt(across);
        moment.col(face.axis) *= std::sqrt(across);
        out.moment_root = square_root(moment);
    }
    return glue;
}

double glue_energy(const GlueFace& face, const Pose& a, const Pose& b)
{
    const Gaps gaps(face, a, b);
    return face.stiffness *
           (gaps.open.squaredNorm() + (gaps.root_a - gaps.root_b).squaredNorm());
}

Eigen::Matrix<double, 12, 1> glue_gradient(const GlueFace& face, const Pose& a,
                                           const Pose& b)
{
    const Gaps gaps(face, a, b);
    const double stretch = 2.0 * face.stiffness;
    const Eigen::Vector3d force = stretch * gaps.open;
    const Eigen::Matrix3d C = gaps.root_b * gaps.root_a.transpose();
    const Eigen::Vector3d turn =
        stretch *
        Eigen::Vector3d(C(1, 2) - C(2, 1), C(2, 0) - C(0, 2), C(0, 1) - C(1, 0));
    Eigen::Matrix<double, 12, 1> gradient;
    gradient << turn + gaps.arm_a.cross(force), force, -turn - gaps.arm_b.cross(force),
        -force;
    return gradient;
}

Eigen::Matrix<double, 6, 6> glue_diagonal_a(const GlueFace& face, const Pose& a,
                                            const Pose& b, Curvature curvature)
{
    const Gaps gaps(face, a, b);
    return diagonal(2.0 * face.stiffness, gaps.arm_a, gaps.open, gaps.root_a, gaps.root_b,
                    curvature.share);
}

Eigen::Matrix<double, 6, 6> glue_diagonal_b(const GlueFace& face, const Pose& a,
                                            const Pose& b, Curvature curvature)
{
    const Gaps gaps(face, a, b);
    return diagonal(2.0 * face.stiffness, gaps.arm_b, -gaps.open, gaps.root_b,
                    gaps.root_a, curvature.share);
}

GlueCoupling glue_coupling(const GlueFace& face, const Pose& a, const Pose& b)
{
    const Gaps gaps(face, a, b);
    const double stretch = 2.0 * face.stiffness;
    // (omega_a x r_a) . (omega_b x r_b) = omega_a^T (r_a . r_b I - r_b r_a^T) omega_b
    const Eigen::Matrix3d C =
        gaps.arm_b * gaps.arm_a.transpose() + gaps.root_b * gaps.root_a.transpose();
    return {stretch * inertia(C), stretch * gaps.arm_a, stretch * gaps.arm_b, stretch};
}

Eigen::Matrix<double, 6, 6> GlueCoupling::matrix() const
{
    Eigen::Matrix<double, 6, 6> M;
    M.topLeftCorner<3, 3>() = -turn;
    M.topRightCorner<3, 3>() = -cross_matrix(arm_a);
    M.bottomLeftCorner<3, 3>() = cross_matrix(arm_b);
    M.bottomRightCorner<3, 3>() = -stretch * Eigen::Matrix3d::Identity();
    return M;
}

double glue_energy(const Glue& glue, std::span<const Pose> poses)
{
    std::vector<double> energies(glue.faces.size());
    parallel_for(glue.faces.size(),
                 [&](std::size_t f)
                 {
                     const GlueFace& face = glue.faces[f];
                     energies[f] =
                         glue_energy(face, poses[static_cast<std::size_t>(face.a)],
                                     poses[static_cast<std::size_t>(face.b)]);
                 });
    double sum = 0.0;
    for (const double energy : energies)
        sum += energy;
    return sum;
}

} // namespace cellwarp
