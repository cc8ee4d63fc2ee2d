// SPDX-License-Identifier: GPL-3.0-or-later
// What error smaller cells mend. The gap between two cells is their size times the strain
// between them; it only halves when they are split, and is largest where the material is
// strained evenly, where the map between the cells is known well. So the strain that a
// cell and its neighbours have in common is taken out first: an affine map around each
// cell, by least squares over its neighbours' anchors. What a neighbour is off from it is
// of second order, second derivatives of the map times the square of the size. A
// prescribed cell is looked at where its glue ends: past that it tells nothing of strain.
// It knows no strain itself. What it is off from the map that the free cell's other
// neighbours tell is its error: nothing where the strain is even up to the border.
#include "solver/cells/refinement.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "octree/base/index.h"
#include "octree/base/nearest_rotation.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Weight of a cell's own rotation against one neighbour on each side: it decides where
/// there are no neighbours.
constexpr double kOwnWeight = 1e-3;

/// What a step to a neighbour misses is four times what is missed half way, where the
/// cell ends, because it grows with the square.
constexpr double kHalfWay = 0.25;

bool is_rigid(const Constraint& constraint)
{
    return constraint.is_of_rigid_region() || constraint.hold == Hold::Idle;
}

/// From a cell over one of its faces: to where, and what is there.
struct View
{
    Eigen::Vector3d step;  ///< from the anchor, at rest
    Eigen::Vector3d place; ///< of its end now
    Eigen::Vector3d turn;  ///< rotation vector from this cell to the other
    int other = 0;
    double weight = 0.0;
};

/// A neighbour is looked at in its anchor; one that is prescribed moves as a whole, so
/// already where its glue ends.
View view_of(const Cells& cells, const GlueFace& glue, const Face& face,
             std::span<const Constraint> constraints, std::span<const Pose> poses,
             std::size_t cell)
{
    const bool is_a = idx(face.a) == cell;
    const std::size_t other = idx(is_a ? face.b : face.a);
    const Cell& from = cells.cells[cell];
    const Cell& to = cells.cells[other];
    View view;
    view.other = static_cast<int>(other);
    view.step = to.anchor - from.anchor;
    if (constraints[other].is_of_rigid_region())
    {
        view.step.setZero();
        view.step[face.axis] = is_a ? glue.length : -glue.length;
    }
    view.place = image(poses[other], to.centre, from.anchor + view.step);
    view.turn = rotation_vector(poses[other].R * poses[cell].R.transpose());
    view.weight = face.area / glue.length;
    return view;
}

/// The map around a cell that is not rigid, by all its neighbours but the one over
/// \p without (-1: none).
LocalMap fitted_map(const Cells& cells, const Glue& glue,
                    std::span<const Constraint> constraints, std::span<const Pose> poses,
                    std::size_t i, int without = -1)
{
    const Cell& cell = cells.cells[i];
    LocalMap map;
    map.place = image(poses[i], cell.centre, cell.anchor);
    Eigen::Matrix3d steps =
        Eigen::Matrix3d::Identity() * (2.0 * kOwnWeight * std::pow(cell.edge, 3));
    Eigen::Matrix3d places = poses[i].R * steps;
    Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
    for (int k = glue.first_face[i]; k < glue.first_face[i + 1]; ++k)
    {
        const int face = glue.faces_of_cell[idx(k)];
        if (face == without)
            continue;
        const std::size_t f = idx(face);
        const View view =
            view_of(cells, glue.faces[f], cells.faces[f], constraints, poses, i);
        steps += view.weight * view.step * view.step.transpose();
        places += view.weight * (view.place - map.place) * view.step.transpose();
        turns += view.weight * view.turn * view.step.transpose();
    }
    const Eigen::Matrix3d inverse = steps.inverse();
    map.gradient = places * inverse;
    map.turning = turns * inverse;
    return map;
}

} // namespace

std::vector<LocalMap> local_maps(const Cells& cells, const Glue& glue,
                                 std::span<const Constraint> constraints,
                                 std::span<const Pose> poses)
{
    std::vector<LocalMap> maps(cells.size());
    parallel_for(cells.size(),
                 [&](std::size_t i)
                 {
                     if (!is_rigid(constraints[i]))
                     {
                         maps[i] = fitted_map(cells, glue, constraints, poses, i);
                         return;
                     }
                     const Cell& cell = cells.cells[i];
                     maps[i].place = image(poses[i], cell.centre, cell.anchor);
                     maps[i].gradient = poses[i].R;
                 });
    return maps;
}

double least_stretch(const Cells& cells, const Glue& glue,
                     std::span<const Constraint> constraints, std::span<const Pose> poses)
{
    const std::vector<LocalMap> maps = local_maps(cells, glue, constraints, poses);
    double least = 1.0;
    for (std::size_t i = 0; i < maps.size(); ++i)
    {
        if (is_rigid(constraints[i]) || constraints[i].hold == Hold::Following)
            continue;
        const Eigen::Matrix3d stretch = poses[i].R.transpose() * maps[i].gradient;
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(
            0.5 * (stretch + stretch.transpose()), Eigen::EigenvaluesOnly);
        least = std::min(least, eigen.eigenvalues()[0]);
    }
    return least;
}

namespace
{

/// Whether a cell has another face along the axis of \p face: without one its neighbours
/// do not tell what strain to expect there.
bool has_other_along(const Glue& glue, const Cells& cells, std::size_t cell,
                     std::size_t face)
{
    for (int k = glue.first_face[cell]; k < glue.first_face[cell + 1]; ++k)
    {
        const std::size_t other = idx(glue.faces_of_cell[idx(k)]);
        if (other != face && cells.faces[other].axis == cells.faces[face].axis)
            return true;
    }
    return false;
}

} // namespace

std::vector<double> cell_errors(const Cells& cells, const Glue& glue,
                                std::span<const Constraint> constraints,
                                std::span<const Pose> poses)
{
    const std::vector<LocalMap> maps = local_maps(cells, glue, constraints, poses);
    // What is over a face of a free cell, against a map around the cell.
    const auto miss = [&](std::size_t cell, std::size_t face, const LocalMap& map)
    {
        const View view =
            view_of(cells, glue.faces[face], cells.faces[face], constraints, poses, cell);
        return (view.place - map.place - map.gradient * view.step).norm();
    };
    std::vector<double> errors(cells.size(), 0.0);
    parallel_for(cells.size(),
                 [&](std::size_t i)
                 {
                     for (int k = glue.first_face[i]; k < glue.first_face[i + 1]; ++k)
                     {
                         const std::size_t f = idx(glue.faces_of_cell[idx(k)]);
                         const Face& face = cells.faces[f];
                         const std::size_t other =
                             idx(idx(face.a) == i ? face.b : face.a);
                         if (!is_rigid(constraints[i]))
                             errors[i] = std::max(errors[i], miss(i, f, maps[i]));
                         else if (!is_rigid(constraints[other]) &&
                                  has_other_along(glue, cells, other, f))
                             errors[i] =
                                 std::max(errors[i],
                                          miss(other, f,
                                               fitted_map(cells, glue, constraints, poses,
                                                          other, static_cast<int>(f))));
                     }
                     errors[i] *= kHalfWay;
                 });
    return errors;
}

std::vector<double> pair_gaps(const Cells& cells, const Glue& glue,
                              std::span<const Pose> poses)
{
    std::vector<double> gaps(cells.size(), 0.0);
    for (const GlueFace& face : glue.faces)
    {
        const std::size_t a = idx(face.a), b = idx(face.b);
        const double gap =
            std::sqrt(glue_energy(face, poses[a], poses[b]) / face.stiffness);
        gaps[a] = std::max(gaps[a], gap);
        gaps[b] = std::max(gaps[b], gap);
    }
    return gaps;
}

namespace
{

Eigen::Matrix3d rotation_of(const Eigen::Vector3d& turn)
{
    const double angle = turn.norm();
    return angle > 0 ? rotation_about(turn / angle, angle)
                     : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
}

/// An old piece and how many voxels of a new one it had.
struct Origin
{
    int piece = 0, voxels = 0;
};

/// Of the new pieces of one leaf; crumbs, which lie in other leaves, don't count.
std::vector<std::vector<Origin>> origins_of(const VoxelGrid& grid,
                                            const VoxelBlock& block, LeafNumber leaf,
                                            const Pieces& old_pieces,
                                            const Pieces& pieces)
{
    const int first = pieces.first(leaf), end = pieces.end(leaf);
    std::vector<std::vector<Origin>> origins(idx(end - first));
    int last_piece = -1;
    Origin* last = nullptr; // most voxels have the origin of the one before
    const auto add = [&](int piece, int old)
    {
        if (piece != last_piece || last->piece != old)
        {
            std::vector<Origin>& of = origins[idx(piece - first)];
            auto known =
                std::find_if(of.begin(), of.end(),
                             [&](const Origin& origin) { return origin.piece == old; });
            if (known == of.end())
                known = of.insert(known, {old, 0});
            last = &*known;
            last_piece = piece;
        }
        ++last->voxels;
    };
    pieces.for_each_run(
        grid, block, leaf,
        [&](int y, int z, int from, int to, int piece)
        {
            if (piece >= first && piece < end)
                for (int x = from; x < to; ++x)
                    add(piece,
                        old_pieces.at(grid, block.first + Eigen::Vector3i(x, y, z)));
        });
    return origins;
}

/// The one old cell that fills the box of a new leaf, if there is one; -1 where several
/// share it. \p old: what held one of its voxels.
int only_origin(const Pieces& old_pieces, const Cells& old_cells, const Cell& cell,
                int old)
{
    const LeafNumber leaf = old_pieces.leaf(old);
    const bool is_alone = old_pieces.end(leaf) - old_pieces.first(leaf) == 1;
    const Cell& from = old_cells.cells[idx(old)];
    // A crumb belongs to a cell of another box.
    const bool is_inside =
        (cell.box_centre - from.box_centre).cwiseAbs().maxCoeff() + 0.5 * cell.edge <=
        0.5 * from.edge * (1 + 1e-9);
    return is_alone && is_inside ? old : -1;
}

/// The first voxel of a leaf that belongs to one of its own pieces.
Eigen::Vector3i first_voxel(const VoxelGrid& grid, const VoxelBlock& block,
                            LeafNumber leaf, const Pieces& pieces)
{
    for (int k = 0; k < block.width; ++k)
        for (int j = 0; j < block.width; ++j)
            for (int i = 0; i < block.width; ++i)
            {
                const Eigen::Vector3i voxel = block.first + Eigen::Vector3i(i, j, k);
                const int piece = pieces.at(grid, voxel);
                if (piece >= pieces.first(leaf) && piece < pieces.end(leaf))
                    return voxel;
            }
    return block.first; // it has a piece
}

} // namespace

std::vector<Pose> handed_on(const VoxelGrid& grid, const Pieces& old_pieces,
                            const Cells& old_cells, std::span<const Pose> old_poses,
                            std::span<const LocalMap> old_maps, const Octree& octree,
                            const Pieces& pieces, const Cells& cells)
{
    std::vector<Pose> poses(cells.size());
    parallel_for(
        octree.leaves().size(),
        [&](std::size_t i)
        {
            const auto leaf = LeafNumber(i);
            const std::size_t first = idx(pieces.first(leaf));
            const std::size_t count = idx(pieces.end(leaf)) - first;
            if (count == 0)
                return; // nothing but crumbs
            const VoxelBlock block = voxel_block(grid.shape(), octree[leaf]);
            const int only =
                only_origin(old_pieces, old_cells, cells.cells[first],
                            old_pieces.at(grid, first_voxel(grid, block, leaf, pieces)));
            std::vector<std::vector<Origin>> origins(count, {{only, 1}});
            if (only < 0)
                origins = origins_of(grid, block, leaf, old_pieces, pieces);
            for (std::size_t k = 0; k < origins.size(); ++k)
            {
                const std::size_t c = first + k;
                const Cell& cell = cells.cells[c];
                const std::size_t one = idx(origins[k][0].piece);
                if (origins[k].size() == 1 &&
                    old_cells.cells[one].anchor == cell.anchor &&
                    old_cells.cells[one].centre == cell.centre)
                {
                    poses[c] = old_poses[one];
                    continue;
                }
                Eigen::Vector3d place = Eigen::Vector3d::Zero();
                Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
                double whole = 0.0;
                for (const Origin& origin : origins[k])
                {
                    const std::size_t o = idx(origin.piece);
                    const double weight = origin.voxels;
                    const Eigen::Vector3d step = cell.anchor - old_cells.cells[o].anchor;
                    place += weight * (old_maps[o].place + old_maps[o].gradient * step);
                    R += weight *
                         (rotation_of(old_maps[o].turning * step) * old_poses[o].R);
                    whole += weight;
                }
                poses[c].R = nearest_rotation(R / whole);
                poses[c].p = place / whole + poses[c].R * (cell.centre - cell.anchor);
            }
        });
    return poses;
}

} // namespace cellwarp::core
