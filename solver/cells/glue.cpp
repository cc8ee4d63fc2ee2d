// SPDX-License-Identifier: GPL-3.0-or-later
// [Botsch07] integrates |T_a - T_b|^2 over both cells where they are. Here each of them
// is first slid to have its centroid at the centre x of the face that they share, and of
// its second moments those along the face count. With D = T_a - T_b, which is affine, and
// S second moments about x,
//   E = w ( |D(x)|^2 + tr(dR S dR^T) ),   dR = R_a - R_b,   w = area / length.
// As cells become small this tends to int |grad phi - R|^2: a material with E = 2, nu =
// 0.
// - Moments across the face come on top of that. In a film of thickness t the moments in
//   the face give t^3 / 12 a curvature squared, as the continuum does, whatever the
//   cells; those across would add t h^2 / 12 for cells of edge h. Unslid, a bar of n
//   cells would be too stiff by 4 / n^2. Larger cells would be stiffer than smaller ones,
//   and where both meet the map would be worse than with the larger alone. Without any
//   moments it would be too soft by 1 / n^2, and a film would not bend at all: that is
//   [Botsch06].
// - What counts of the moments is found with the cells (cells.cpp): in solids all along
//   the face, in sheets what is strain. It is given as the
//   quadratic form M of a small relative turn omega, omega^T M omega; then
//     S = tr M / 2 I - M,   M = tr S I - S,
//   and for a turn by any angle about the axis n
//     tr(dR S dR^T) = 4 sin^2(angle / 2) n^T M n,
//   never negative while M is positive, though S itself may have a negative eigenvalue:
//   a sheet turns hard in its plane and bends easily about both other axes, which no sum
//   of squares of moments does. M is kept above (distance / 100)^2 / 12, distance that of
//   the boxes' centres, so that no face, however small, is a hinge.
// - Slid, a field of constant strain F = R U balances every cell of one size, cut by the
//   surface or not. Let the T_i agree with it at the boxes' centres q_i: the gap is then
//   (F - R)(q_b - q_a), normal to the face and as long as the cells are apart. So the
//   force of a face is 2 area (F - R) n and acts at its centre, as the traction of that
//   field does; forces and moments of a cell add up to those of the field on what is left
//   open, where it has no traction. Between centroids, which lie anywhere in pieces, they
//   do not: forces of first order would be left along every surface.
// - In a sheet the place x is half way between the centroids g_a and g_b of what both
//   cells hold of it. Let it be bent to the height k s^2 / 2 and the T_i be tangent to it
//   at the g_i: where the tangent planes of a and b cut, half way, there is no gap, and
//   what the energy has is t^3 / 12 k^2. At the centre of the cut they would part by k h
//   times how far that is off, and as t is much less than h, a sheet that lies askew to
//   the cells would be up to 13 times too stiff. At a border it is half way from the free
//   cell's to where the glue ends. Measured on plane sheets with t = 0.15 h, lying along
//   two axes, one or none, smoothly bent and twisted: 0.96 to 1.04 of the plate's energy;
//   at the centres of the cuts, after relaxing, 1.0 to 2.2; with all second moments of
//   the strip in which the face cuts the sheet 1 to 45.
//
// Cells of two sizes. Let B be a cell below which there are cells s, s' of half its edge:
//
//     +---------------+
//     |               |       q_B = q_s + distance n + t,
//     |       B       |       n the face's normal,
//     |               |       t = (h/2) along s s' (and the same along the third axis),
//     +-------+-------+       h the edge of s
//     |   s   |   s'  |
//     +-------+-------+
//
// Under constant strain the gap of the face between B and s is (F - R)(q_B - q_s). Its
// part along n balances as above; its part along t leaves the force 2 w (F - R) t on s,
// and the opposite one on s', which t' = -t leads to.
//   Both are taken away by weakening the glue between s and s'. With a weight less by
//     d = w |t| / h
// the face s s' pulls less by exactly these forces, for its gap is (F - R) h along s s'.
// Then the energy is right, too: the faces to B count 2 w |t|^2 too much, the face s s'
// counts d h^2 less, and both are w h^2 / 2.
//   The weight is taken from the part of the face s s' that lies next to B, so the centre
// of what is left moves away from B, by (h / 2) d / (w' - d), with w' the weight of the
// whole face. So cells of any size are left without a force by constant strain, and
// without a moment by stretch along the axes; by shear a moment is left of at most a
// sixth of V (F - R), V the volume of the small cell.
//   Measured (docs/departures.md): without it, cells of two sizes are less accurate than
// the larger ones alone.
//
// E is a sum of four terms m |d|^2 with
//   d = (r_a + f p_a) - (r_b + f p_b),
// arms r that turn with their cell and f = 1 for the face's centre, 0 for the moments.
// A twist changes r by omega x r + 1/2 omega x (omega x r) and p by v + 1/2 omega x v
// (see rigid_motion.cpp), hence
//   dE = 2 m d . (omega_a x r_a + f v_a - omega_b x r_b - f v_b),
// the Gauss-Newton matrix is 2 m J^T J, and the curvature of omega_a adds
//   2 m [ (d r^T + r d^T) / 2 - (d . r) I ],   that of omega_b the same with -d;
// with g_v the gradient in v, the blocks of (v, omega) gain [g_v]x / 2.
//
// With C = R_b S R_a^T, which is sum_k r_bk r_ak^T over the columns of a root of S, the
// moments' parts are
//   gradient   what is skew in C, times -2 w,
//   diagonal    2 w (tr C I - sym C), with the curvature,
//   coupling   -2 w K,  K = tr C I - C.
// Their Gauss-Newton diagonal would be 2 w (tr A I - A), A = R_a S R_a^T; since S need
// not be positive, it is 2 w (K K^T)^1/2 for a and 2 w (K^T K)^1/2 for b in its place:
// with K = U D V^T the whole is (U, -V) D (U, -V)^T. At rest all of them are M.
#include "solver/cells/glue.h"

#include <cmath>
#include <numeric>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// The gap of a face: T_a - T_b at its place.
struct Gap
{
    Eigen::Vector3d arm_a, arm_b; ///< R_a reach_a, R_b reach_b
    Eigen::Vector3d open;         ///< T_a - T_b

    Gap(const GlueFace& face, const Pose& a, const Pose& b)
        : arm_a(a.R * face.reach_a), arm_b(b.R * face.reach_b),
          open(a.p + arm_a - b.p - arm_b)
    {
    }
};

/// C: the moments as b and a have turned them.
Eigen::Matrix3d turned_moment(const GlueFace& face, const Pose& a, const Pose& b)
{
    return b.R * face.moment * a.R.transpose();
}

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

/// What is symmetric but for this share is so but for rounding.
constexpr double kSymmetric = 1e-12;

/// (K K^T)^1/2: at rest K itself. Of a singular K the root of K K^T is off by up to
/// 1.5e-8 of the largest number, which Gauss-Newton's steps do not feel.
Eigen::Matrix3d left_stretch(const Eigen::Matrix3d& K)
{
    if ((K - K.transpose()).norm() <= kSymmetric * K.norm() &&
        Eigen::LLT<Eigen::Matrix3d>(K).info() == Eigen::Success)
        return 0.5 * (K + K.transpose());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(K * K.transpose());
    return eigen.eigenvectors() *
           eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
           eigen.eigenvectors().transpose();
}

/// The diagonal block of the cell with the one given arm, the gap as seen from it, and
/// the turned moments with its own side on the left or, transposed, on the right.
GlueBlock diagonal(double stretch, const Eigen::Vector3d& arm, const Eigen::Vector3d& d,
                   const Eigen::Matrix3d& C, double share)
{
    Eigen::Matrix3d turn = inertia(arm * arm.transpose());
    Eigen::Vector3d row_arm = arm;
    if (share < 1)
        turn += (1.0 - share) * left_stretch(inertia(C));
    if (share > 0)
    {
        turn += share * (arm_curvature(d, arm) + inertia(0.5 * (C + C.transpose())));
        row_arm -= 0.5 * share * d;
    }
    return {stretch * turn, stretch * row_arm, -stretch * row_arm, stretch};
}

/// No face turns more easily than a film of this thickness [its glue's length].
constexpr double kHingeThickness = 0.01;

/// Of the stiffness of a face this much stays where larger cells are beside it: a third
/// is left by two of them; what is cut by the surface may come out at less.
constexpr double kLeastLeft = 0.3;

/// Cells of which one has smaller neighbours in the other's place. One that shares its
/// box is not in a lattice with others.
bool differ_in_size(const Cell& a, const Cell& b)
{
    return a.edge != b.edge && a.anchor == a.box_centre && b.anchor == b.box_centre;
}

/// S of a face: see above. \p bending is about the axes in its sheet, which turns hardest
/// about its normal.
Eigen::Matrix3d moment_of(const Face& face, double bending)
{
    const double least = std::pow(kHingeThickness * face.distance, 2) / 12.0;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(face.turning);
    Eigen::Matrix3d M =
        eigen.eigenvalues()[0] >= least
            ? face.turning
            : Eigen::Matrix3d(eigen.eigenvectors() *
                              eigen.eigenvalues().cwiseMax(least).asDiagonal() *
                              eigen.eigenvectors().transpose());
    if (bending > 0)
    {
        const Eigen::Vector3d normal = eigen.eigenvectors().col(2);
        M += bending * (Eigen::Matrix3d::Identity() - normal * normal.transpose());
    }
    return 0.5 * M.trace() * Eigen::Matrix3d::Identity() - M;
}

/// Half way between what both cells hold of a sheet; at a border of the given length from
/// the free cell's to there.
Eigen::Vector3d sheet_place(const Face& face, const Cell& a, const Cell& b,
                            const BorderGlue* border)
{
    if (!border)
        return 0.5 * (a.middle + b.middle);
    const Eigen::Vector3d& free = border->is_a_rigid ? b.middle : a.middle;
    const Eigen::Vector3d& held = border->is_a_rigid ? a.middle : b.middle;
    return free + 0.5 * border->length / face.distance * (held - free);
}

/// Of the glue between two cells; without a root where both are the same.
double face_factor(std::span<const double> cell_factors, int a, int b)
{
    if (cell_factors.empty())
        return 1.0;
    const double of_a = cell_factors[idx(a)];
    const double of_b = cell_factors[idx(b)];
    return of_a == of_b ? of_a : std::sqrt(of_a) * std::sqrt(of_b);
}

/// The integral over both cells where they are [Botsch07]: about the centroid of the two,
/// with the second moments of both.
void measure_over_cells(const Cell& a, const Cell& b, Eigen::Vector3d& place,
                        Eigen::Matrix3d& moment)
{
    const double volume = a.volume + b.volume;
    place = (a.volume * a.centre + b.volume * b.centre) / volume;
    moment.setZero();
    for (const Cell* const cell : {&a, &b})
    {
        const Eigen::Vector3d off = cell->centre - place;
        moment += cell->volume / volume * (cell->second_moment + off * off.transpose());
    }
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
        const Cell& a = cells.cells[idx(face.a)];
        const Cell& b = cells.cells[idx(face.b)];
        if (is_border[f] || !differ_in_size(a, b))
            continue;
        const bool is_a_small = a.edge < b.edge;
        const Cell& small = is_a_small ? a : b;
        const Eigen::Vector3d step = (is_a_small ? b : a).anchor - small.anchor;
        const std::size_t s = idx(is_a_small ? face.a : face.b);
        for (int k = glue.first_face[s]; k < glue.first_face[s + 1]; ++k)
        {
            const std::size_t g = idx(glue.faces_of_cell[idx(k)]);
            const Face& other = cells.faces[g];
            const bool is_upwards = idx(other.a) == s;
            if (other.axis == face.axis || is_border[g] ||
                is_upwards != (step[other.axis] > 0) ||
                differ_in_size(cells.cells[idx(other.a)], cells.cells[idx(other.b)]))
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

void Glue::list_faces_of_cells(std::size_t num_cells)
{
    first_face.assign(num_cells + 1, 0);
    for (const GlueFace& face : faces)
    {
        ++first_face[idx(face.a) + 1];
        ++first_face[idx(face.b) + 1];
    }
    std::partial_sum(first_face.begin(), first_face.end(), first_face.begin());
    faces_of_cell.resize(2 * faces.size());
    std::vector<int> next(first_face.begin(), first_face.end() - 1);
    for (std::size_t f = 0; f < faces.size(); ++f)
        for (const int cell : {faces[f].a, faces[f].b})
            faces_of_cell[idx(next[idx(cell)]++)] = static_cast<int>(f);
}

Glue with_groups(const Glue& glue, const Cells& cells, std::span<const int> leaders)
{
    // A cell's reach begins at its own centroid, the leader's at the leader's.
    const auto to_leader = [&](int& cell, Eigen::Vector3d& reach)
    {
        const int leader = leaders[idx(cell)];
        if (leader < 0)
            return;
        reach += cells.cells[idx(cell)].centre - cells.cells[idx(leader)].centre;
        cell = leader;
    };
    Glue grouped;
    for (GlueFace face : glue.faces)
    {
        to_leader(face.a, face.reach_a);
        to_leader(face.b, face.reach_b);
        if (face.a != face.b)
            grouped.faces.push_back(face);
    }
    grouped.list_faces_of_cells(cells.size());
    return grouped;
}

Glue build_glue(const Cells& cells, std::span<const double> cell_factors,
                std::span<const BorderGlue> borders, const Departures& departures,
                std::span<const double> bending)
{
    Glue glue;
    glue.faces.resize(cells.faces.size());
    for (std::size_t f = 0; f < cells.faces.size(); ++f)
    {
        const Face& face = cells.faces[f];
        glue.faces[f].a = face.a;
        glue.faces[f].b = face.b;
        glue.faces[f].length = face.distance;
    }
    glue.list_faces_of_cells(cells.size());
    std::vector<bool> is_border(cells.faces.size(), false);
    std::vector<const BorderGlue*> border_of(cells.faces.size(), nullptr);
    for (const BorderGlue& border : borders)
    {
        glue.faces[idx(border.face)].length = border.length;
        is_border[idx(border.face)] = true;
        border_of[idx(border.face)] = &border;
    }
    for (std::size_t f = 0; f < cells.faces.size(); ++f)
    {
        GlueFace& face = glue.faces[f];
        const double area =
            departures.glue_in_face ? cells.faces[f].area : cells.faces[f].contact;
        face.stiffness = face_factor(cell_factors, face.a, face.b) * area / face.length;
    }
    const std::vector<TakenOver> taken = departures.level_changes
                                             ? taken_over(cells, glue, is_border)
                                             : std::vector<TakenOver>(cells.faces.size());
    for (std::size_t f = 0; f < cells.faces.size(); ++f)
    {
        const Face& face = cells.faces[f];
        const Cell& a = cells.cells[idx(face.a)];
        const Cell& b = cells.cells[idx(face.b)];
        GlueFace& out = glue.faces[f];
        // What is left is no less than a share; no more than is taken moves the place.
        const double can_be_taken = (1.0 - kLeastLeft) * out.stiffness;
        const double is_taken = std::min(taken[f].stiffness, can_be_taken);
        out.stiffness -= is_taken;
        Eigen::Vector3d place = face.centre;
        if (is_taken > 0)
            place += is_taken / taken[f].stiffness * taken[f].moment / out.stiffness;
        if (face.sheet_share > 0)
            place += face.sheet_share * (sheet_place(face, a, b, border_of[f]) - place);
        if (departures.glue_in_face)
            out.moment = moment_of(face, bending.empty() ? 0.0 : bending[f]);
        else
            measure_over_cells(a, b, place, out.moment);
        out.reach_a = place - a.centre;
        out.reach_b = place - b.centre;
    }
    return glue;
}

std::vector<GlueFace> bridge_glue(const Cells& cells, std::span<const Bridge> bridges,
                                  std::span<const double> cell_factors)
{
    std::vector<GlueFace> faces;
    for (const Bridge& bridge : bridges)
    {
        GlueFace& face = faces.emplace_back();
        face.a = bridge.a;
        face.b = bridge.b;
        face.length = bridge.length;
        face.stiffness =
            face_factor(cell_factors, bridge.a, bridge.b) * bridge.area / bridge.length;
        face.reach_a = bridge.centre - cells.cells[idx(bridge.a)].centre;
        face.reach_b = bridge.centre - cells.cells[idx(bridge.b)].centre;
        face.moment = bridge.moment;
    }
    return faces;
}

double glue_energy(const GlueFace& face, const Pose& a, const Pose& b)
{
    const Gap gap(face, a, b);
    const Eigen::Matrix3d turn = a.R - b.R;
    return face.stiffness *
           (gap.open.squaredNorm() + (turn * face.moment).cwiseProduct(turn).sum());
}

Eigen::Matrix<double, 12, 1> glue_gradient(const GlueFace& face, const Pose& a,
                                           const Pose& b)
{
    const Gap gap(face, a, b);
    const double stretch = 2.0 * face.stiffness;
    const Eigen::Vector3d force = stretch * gap.open;
    const Eigen::Matrix3d C = turned_moment(face, a, b);
    const Eigen::Vector3d turn =
        stretch *
        Eigen::Vector3d(C(1, 2) - C(2, 1), C(2, 0) - C(0, 2), C(0, 1) - C(1, 0));
    Eigen::Matrix<double, 12, 1> gradient;
    gradient << turn + gap.arm_a.cross(force), force, -turn - gap.arm_b.cross(force),
        -force;
    return gradient;
}

GlueBlock glue_diagonal_a(const GlueFace& face, const Pose& a, const Pose& b,
                          Curvature curvature)
{
    const Gap gap(face, a, b);
    return diagonal(2.0 * face.stiffness, gap.arm_a, gap.open, turned_moment(face, a, b),
                    curvature.share);
}

GlueBlock glue_diagonal_b(const GlueFace& face, const Pose& a, const Pose& b,
                          Curvature curvature)
{
    const Gap gap(face, a, b);
    return diagonal(2.0 * face.stiffness, gap.arm_b, -gap.open,
                    turned_moment(face, a, b).transpose(), curvature.share);
}

GlueBlock glue_coupling(const GlueFace& face, const Pose& a, const Pose& b)
{
    const Gap gap(face, a, b);
    const double stretch = 2.0 * face.stiffness;
    // (omega_a x r_a) . (omega_b x r_b) = omega_a^T (r_a . r_b I - r_b r_a^T) omega_b
    const Eigen::Matrix3d C =
        gap.arm_b * gap.arm_a.transpose() + turned_moment(face, a, b);
    return {-stretch * inertia(C), -stretch * gap.arm_a, stretch * gap.arm_b, -stretch};
}

double glue_energy(const Glue& glue, std::span<const Pose> poses,
                   const std::function<bool(const GlueFace&)>& counts)
{
    std::vector<double> energies(glue.faces.size());
    parallel_for(glue.faces.size(),
                 [&](std::size_t f)
                 {
                     const GlueFace& face = glue.faces[f];
                     if (!counts || counts(face))
                         energies[f] =
                             glue_energy(face, poses[idx(face.a)], poses[idx(face.b)]);
                 });
    double sum = 0.0;
    for (const double energy : energies)
        sum += energy;
    return sum;
}

} // namespace cellwarp::core
