// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/shapes.h"

#include <cmath>
#include <map>
#include <random>

#include <Eigen/Geometry>

#include "io/base/number.h"
#include "octree/base/index.h"
#include "octree/sheet.h"
#include "tests/support/random.h"

namespace cellwarp::core::support
{

Shape box_shape(const Eigen::Vector3d& low, const Eigen::Vector3d& high, int n)
{
    Shape shape;
    std::map<std::array<int, 3>, std::uint32_t> numbers;
    const Eigen::Vector3d size = high - low;
    Eigen::Vector3i counts;
    for (int k = 0; k < 3; ++k)
        counts[k] =
            std::max(1, static_cast<int>(std::lround(n * size[k] / size.minCoeff())));
    const auto vertex = [&](const Eigen::Vector3i& at)
    {
        const auto [found, is_new] = numbers.try_emplace(
            {at.x(), at.y(), at.z()}, static_cast<std::uint32_t>(numbers.size()));
        if (is_new)
            shape.samples.push_back(
                low + size.cwiseProduct(
                          at.cast<double>().cwiseQuotient(counts.cast<double>())));
        return found->second;
    };
    for (int axis = 0; axis < 3; ++axis)
        for (const int side : {0, counts[axis]})
        {
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            for (int i = 0; i < counts[u]; ++i)
                for (int j = 0; j < counts[v]; ++j)
                {
                    std::uint32_t corner[4];
                    for (int c = 0; c < 4; ++c)
                    {
                        Eigen::Vector3i at;
                        at[axis] = side;
                        at[u] = i + (c == 1 || c == 2);
                        at[v] = j + (c >= 2);
                        corner[c] = vertex(at);
                    }
                    if (side == 0)
                        std::swap(corner[1], corner[3]);
                    shape.triangles.push_back({corner[0], corner[1], corner[2]});
                    shape.triangles.push_back({corner[0], corner[2], corner[3]});
                }
        }
    return shape;
}

Shape blocks_shape(const std::array<std::vector<double>, 3>& lines,
                   const std::function<bool(int, int, int)>& holds)
{
    Eigen::Vector3i counts;
    for (std::size_t axis = 0; axis < 3; ++axis)
        counts[static_cast<Eigen::Index>(axis)] =
            static_cast<int>(lines[axis].size()) - 1;
    const auto is_held = [&](const Eigen::Vector3i& block)
    {
        return (block.array() >= 0).all() && (block.array() < counts.array()).all() &&
               holds(block.x(), block.y(), block.z());
    };
    Shape shape;
    std::map<std::array<int, 3>, std::uint32_t> known;
    const auto sample = [&](const Eigen::Vector3i& at)
    {
        const auto [found, is_new] = known.try_emplace(
            {at.x(), at.y(), at.z()}, static_cast<std::uint32_t>(shape.samples.size()));
        if (is_new)
            shape.samples.emplace_back(lines[0][idx(at.x())], lines[1][idx(at.y())],
                                       lines[2][idx(at.z())]);
        return found->second;
    };
    for (int k = 0; k < counts.z(); ++k)
        for (int j = 0; j < counts.y(); ++j)
            for (int i = 0; i < counts.x(); ++i)
                for (int axis = 0; axis < 3; ++axis)
                    for (const int side : {0, 1})
                    {
                        const Eigen::Vector3i block(i, j, k);
                        const Eigen::Vector3i normal = Eigen::Vector3i::Unit(axis);
                        if (!is_held(block) || is_held(block + (side ? normal : -normal)))
                            continue;
                        const Eigen::Vector3i u = Eigen::Vector3i::Unit((axis + 1) % 3),
                                              v = Eigen::Vector3i::Unit((axis + 2) % 3);
                        const Eigen::Vector3i corner = block + side * normal;
                        const std::uint32_t a = sample(corner), b = sample(corner + u),
                                            c = sample(corner + u + v),
                                            d = sample(corner + v);
                        if (side)
                            shape.triangles.insert(shape.triangles.end(),
                                                   {{a, b, c}, {a, c, d}});
                        else
                            shape.triangles.insert(shape.triangles.end(),
                                                   {{a, c, b}, {a, d, c}});
                    }
    return shape;
}

Shape l_prism()
{
    return blocks_shape({std::vector{0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0},
                         std::vector{0.0, 0.5, 1.0, 1.5, 2.0},
                         std::vector{0.0, 0.5, 1.0}},
                        [](int i, int j, int) { return i < 4 || j < 2; });
}

Shape cross(bool has_arms)
{
    std::vector<double> x, y, z;
    for (int k = -20; k <= 20; ++k)
        x.push_back(0.25 * k);
    for (int k = -2; k <= 2; ++k)
        y.push_back(0.25 * k);
    for (int k = 0; k <= 40; ++k)
        z.push_back(0.25 * k);
    return blocks_shape({x, y, z},
                        [=](int i, int, int k)
                        {
                            const bool is_trunk = i >= 18 && i < 22;
                            return is_trunk || (has_arms && k >= 28 && k < 32);
                        });
}

Shape comb()
{
    return blocks_shape({std::vector{0.0, 0.66, 1.32, 1.98, 2.485, 2.99, 3.495, 4.0},
                         std::vector{0.0, 0.225, 0.45, 0.55, 0.775, 1.0},
                         std::vector{0.0, 0.25, 0.5, 0.75, 1.0}},
                        [](int i, int j, int) { return i < 3 || j != 2; });
}

Shape steps()
{
    return blocks_shape({std::vector{0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0},
                         std::vector{0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0},
                         std::vector{0.0, 0.5, 1.0}},
                        [](int i, int j, int) { return j / 2 <= i / 2; });
}

Shape sheet_shape(double length, double width, int n)
{
    const double edge = std::min(length, width) / n;
    const int nx = static_cast<int>(std::lround(length / edge));
    const int ny = static_cast<int>(std::lround(width / edge));
    Shape shape;
    for (int i = 0; i <= nx; ++i)
        for (int j = 0; j <= ny; ++j)
            shape.samples.emplace_back(length * i / nx, width * j / ny, 0.0);
    const auto vertex = [&](int i, int j)
    { return static_cast<std::uint32_t>(i * (ny + 1) + j); };
    for (int i = 0; i < nx; ++i)
        for (int j = 0; j < ny; ++j)
        {
            shape.triangles.push_back(
                {vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1)});
            shape.triangles.push_back(
                {vertex(i, j), vertex(i + 1, j + 1), vertex(i, j + 1)});
        }
    return shape;
}

Shape joined(const Shape& a, const Shape& b)
{
    Shape shape = a;
    const std::uint32_t first = static_cast<std::uint32_t>(a.samples.size());
    shape.samples.insert(shape.samples.end(), b.samples.begin(), b.samples.end());
    for (const Triangle& t : b.triangles)
        shape.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    return shape;
}

std::string obj_text(const Shape& shape)
{
    std::string text;
    for (const Eigen::Vector3d& x : shape.samples)
        text +=
            "v " + shortest(x.x()) + " " + shortest(x.y()) + " " + shortest(x.z()) + "\n";
    for (const Triangle& t : shape.triangles)
        text += "f " + std::to_string(t[0] + 1) + " " + std::to_string(t[1] + 1) + " " +
                std::to_string(t[2] + 1) + "\n";
    for (const auto& [a, b] : shape.lines)
        text += "l " + std::to_string(a + 1) + " " + std::to_string(b + 1) + "\n";
    return text;
}

std::vector<Eigen::Vector3d> random_points(const Shape& shape, int count, unsigned seed)
{
    std::mt19937 rng(seed);
    std::vector<double> areas;
    for (const Triangle& t : shape.triangles)
        areas.push_back((shape.samples[t[1]] - shape.samples[t[0]])
                            .cross(shape.samples[t[2]] - shape.samples[t[0]])
                            .norm());
    std::discrete_distribution<std::size_t> pick(areas.begin(), areas.end());
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < count; ++i)
    {
        const Triangle& t = shape.triangles[pick(rng)];
        double u = random_number(rng, 0, 1), v = random_number(rng, 0, 1);
        if (u + v > 1)
        {
            u = 1 - u;
            v = 1 - v;
        }
        points.push_back(shape.samples[t[0]] +
                         u * (shape.samples[t[1]] - shape.samples[t[0]]) +
                         v * (shape.samples[t[2]] - shape.samples[t[0]]));
    }
    return points;
}

namespace
{

/// Of sheets [of the high corner's distance], the usual one.
constexpr double kThickness = 0.01;

/// \p divided: how the coarsest octree is divided.
template <class Divided>
Built built_in(const Shape& shape, int across, int depth, Fill fill, double max_voxel,
               const Divided& divided)
{
    Eigen::Vector3d high = shape.samples.front();
    for (const Eigen::Vector3d& x : shape.samples)
        high = high.cwiseMax(x);
    const GridShape grid = grid_shape(high, across, depth, max_voxel);
    Material material = find_material(shape, bounding_surface(shape), grid, fill);
    const MaterialTest test = material_test(material.grid);
    Octree octree = divided(Octree(grid, test), test);
    Pieces pieces = find_pieces(material.grid, octree);
    const Sheets sheets =
        find_sheets(shape, bounding_surface(shape), material, kThickness * high.norm());
    Cells cells = build_cells(material.grid, octree, pieces, material.is_sheet, sheets);
    return {std::move(material), std::move(octree), std::move(pieces), std::move(cells)};
}

} // namespace

Built built(const Shape& shape, int across, int depth, Fill fill, double max_voxel)
{
    return built_in(shape, across, depth, fill, max_voxel,
                    [&](const Octree& coarsest, const MaterialTest& test)
                    { return coarsest.split_all(depth, test); });
}

Built built_mixed(const Shape& shape, int across, int depth, unsigned seed,
                  double max_voxel)
{
    const auto divided = [&](Octree octree, const MaterialTest& test)
    {
        std::mt19937 rng(seed);
        for (int level = 0; level < depth; ++level)
        {
            std::vector<LeafNumber> some;
            for (std::size_t i = 0; i < octree.leaves().size(); ++i)
                if (rng() % 3 == 0)
                    some.push_back(LeafNumber(i));
            octree = octree.split(some, test);
        }
        return octree;
    };
    return built_in(shape, across, depth, Fill::Solid, max_voxel, divided);
}

Built bar(int nx, int ny, int nz)
{
    return built(box_shape(Eigen::Vector3d::Zero(), Eigen::Vector3d(nx, ny, nz), 1),
                 std::max({nx, ny, nz}));
}

} // namespace cellwarp::core::support
