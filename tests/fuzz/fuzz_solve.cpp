// SPDX-License-Identifier: GPL-3.0-or-later
// Arbitrary bytes as samples, cut into cells, held and solved for a few iterations: the
// octree keeps its promises, and no solve leaves a number that is none, a rotation that
// is none, more energy than before, or other bits the second time.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include <Eigen/LU>

#include "octree/base/index.h"
#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "octree/material.h"
#include "octree/octree.h"
#include "octree/pieces.h"
#include "octree/sheet.h"
#include "solver/cells/cell_minimizer.h"
#include "solver/cells/constraints.h"
#include "solver/cells/glue.h"

using namespace cellwarp::core;

namespace
{

void require(bool condition)
{
    if (!condition)
        std::abort();
}

/// Numbers out of bytes; zeros after the last one.
class Bytes
{
public:
    Bytes(const std::uint8_t* data, std::size_t size) : next_(data), end_(data + size) {}
    bool is_empty() const { return next_ == end_; }
    int byte() { return is_empty() ? 0 : *next_++; }
    /// In [0, 1], both ends among them.
    double share() { return byte() / 255.0; }

private:
    const std::uint8_t *next_, *end_;
};

Eigen::Vector3d vector(Bytes& bytes)
{
    const double x = bytes.share(), y = bytes.share();
    return {x, y, bytes.share()};
}

/// Half turns and identities among them; moves by far more and far less than the box.
Motion motion(Bytes& bytes)
{
    static constexpr double angles[] = {0.0,  0.3,   1.5,        3.0,
                                        M_PI, -M_PI, 2.0 * M_PI, 1e-9};
    static constexpr double lengths[] = {0.0, 0.1, 1.0, 30.0, 1e3, 1e-12, 1e-6, 1e8};
    const int choice = bytes.byte();
    const Eigen::Vector3d axis =
        vector(bytes) - Eigen::Vector3d::Constant(0.5) + 1e-3 * Eigen::Vector3d::UnitX();
    const Eigen::Matrix3d R = rotation_about(axis.normalized(), angles[choice % 8]);
    return {R,
            lengths[choice / 8 % 8] * (vector(bytes) - Eigen::Vector3d::Constant(0.5))};
}

Shape shape(Bytes& bytes, const Eigen::Vector3d& size, bool has_triangles)
{
    Shape shape;
    constexpr std::size_t kMostSamples = 60;
    const std::size_t count = 1 + idx(bytes.byte()) % kMostSamples;
    for (std::size_t i = 0; i < count; ++i)
        shape.samples.push_back(vector(bytes).cwiseProduct(size));
    // Some corners stand at the box's own, as those of every shape do.
    shape.samples.push_back(Eigen::Vector3d::Zero());
    shape.samples.push_back(size);
    for (std::size_t i = 0; has_triangles && i + 2 < shape.samples.size(); ++i)
        shape.triangles.push_back({static_cast<std::uint32_t>(i),
                                   static_cast<std::uint32_t>(i + 1),
                                   static_cast<std::uint32_t>(i + 2)});
    return shape;
}

void check_octree(const VoxelGrid& grid, const Octree& octree, const Pieces& pieces)
{
    require(octree.is_balanced());
    const int per_leaf = grid.shape().voxels_per_leaf;
    for (std::size_t v = 0; v < grid.size(); ++v)
    {
        const bool has_material = grid.material()[v] != 0;
        require(has_material == (pieces.at(grid, v) >= 0));
        if (!has_material)
            continue;
        require(idx(pieces.at(grid, v)) < pieces.size());
        const LeafNumber leaf = octree.find(grid.coordinates(v) / per_leaf);
        require(leaf != LeafNumber::None);
        const VoxelBlock block = voxel_block(grid.shape(), octree[leaf]);
        require(is_in(block, grid.coordinates(v)));
    }
}

void check_cells(const Cells& cells)
{
    for (const Cell& cell : cells.cells)
    {
        require(cell.volume > 0 && std::isfinite(cell.volume) && cell.edge > 0);
        require(cell.centre.allFinite() && cell.anchor.allFinite() &&
                cell.second_moment.allFinite());
    }
    for (const Face& face : cells.faces)
        require(face.a != face.b && face.area > 0 && face.turning.allFinite());
    for (std::size_t c = 0; c < cells.size(); ++c)
        for (const int other : cells.neighbours_of(static_cast<int>(c)))
        {
            const auto back = cells.neighbours_of(other);
            require(std::binary_search(back.begin(), back.end(), static_cast<int>(c)));
        }
}

void check_poses(const std::vector<Pose>& poses)
{
    for (const Pose& pose : poses)
    {
        require(pose.p.allFinite() && pose.R.allFinite());
        require((pose.R.transpose() * pose.R - Eigen::Matrix3d::Identity())
                    .cwiseAbs()
                    .maxCoeff() < 1e-12);
        require(pose.R.determinant() > 0);
    }
}

SolveReport solve(const Cells& cells, const Glue& glue,
                  const std::vector<Constraint>& constraints,
                  const std::vector<Component>& components, Method method,
                  std::vector<Pose>& poses)
{
    SolveOptions options;
    options.method = method;
    options.max_iterations = 6;
    options.checks_stability = true;
    return CellMinimizer(cells, glue, constraints, components).minimize(poses, options);
}

bool same_bits(const std::vector<Pose>& a, const std::vector<Pose>& b)
{
    for (std::size_t i = 0; i < a.size(); ++i)
        if (a[i].p != b[i].p || a[i].R != b[i].R)
            return false;
    return true;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    Bytes bytes(data, size);
    const int choice = bytes.byte();
    const Eigen::Vector3d box =
        Eigen::Vector3d(1.0, 0.01 + bytes.share(), choice & 1 ? 1e-9 : bytes.share());
    const Fill fill = choice & 2 ? Fill::Solid : Fill::Shell;
    const Shape samples = shape(bytes, box, (choice & 4) != 0);
    const int across = 1 + (choice >> 3 & 3), depth = choice >> 5 & 1;
    const GridShape grid = grid_shape(box, across, depth, 0.12);
    if (num_voxels(grid) > 20000)
        return 0;
    const Material material =
        find_material(samples, bounding_surface(samples), grid, fill);
    const MaterialTest has_material = material_test(material.grid);
    Octree octree(grid, has_material);
    std::vector<LeafNumber> some;
    for (std::size_t i = 0; i < octree.leaves().size(); ++i)
        if (bytes.byte() & 1)
            some.push_back(LeafNumber(i));
    octree = octree.split(some, has_material);
    const Pieces pieces = find_pieces(material.grid, octree);
    check_octree(material.grid, octree, pieces);
    const Cells cells = build_cells(material.grid, octree, pieces);
    check_cells(cells);

    std::vector<Constraint> constraints(cells.size());
    std::vector<Pose> rest, poses;
    const Motion motions[] = {Motion(), motion(bytes), motion(bytes)};
    std::vector<double> factors(cells.size(), 1.0);
    for (std::size_t c = 0; c < cells.size(); ++c)
    {
        const Eigen::Vector3d& centre = cells.cells[c].centre;
        const int held = bytes.byte();
        const Motion& own = motions[held >> 4 & 1 ? 1 + (held >> 5 & 1) : 0];
        poses.push_back(carried(Motion(), centre));
        if (held % 4 == 0)
        {
            constraints[c].hold = Hold::Prescribed;
            poses.back() = carried(own, centre);
        }
        if (held % 16 == 1)
            constraints[c] = {Hold::Pinned, centre, own(centre)};
        if (constraints[c].hold == Hold::Pinned)
            poses.back() = held_at_pin(poses.back(), constraints[c], centre);
        if (held % 16 == 6)
            factors[c] = 1e4;
        if (held % 16 == 7)
            factors[c] = 1e-4;
    }
    const std::vector<Component> components = find_components(cells, constraints);
    const Glue glue = build_glue(cells, factors);
    const Method method = choice >> 6 == 0   ? Method::GaussNewton
                          : choice >> 6 == 1 ? Method::GaussNewtonDirect
                                             : Method::Newton;
    const std::vector<Pose> start = poses;
    std::vector<Pose> again = poses;
    const SolveReport report = solve(cells, glue, constraints, components, method, poses);
    require(report.stop != Stop::NotRun && std::isfinite(report.energy_after));
    require(report.energy_after <= report.energy_before * (1.0 + 1e-9) + 1e-20);
    check_poses(poses);
    for (std::size_t c = 0; c < cells.size(); ++c)
        if (constraints[c].hold == Hold::Prescribed)
            require(poses[c].p == start[c].p && poses[c].R == start[c].R);
    solve(cells, glue, constraints, components, method, again);
    require(same_bits(poses, again));
    return 0;
}
