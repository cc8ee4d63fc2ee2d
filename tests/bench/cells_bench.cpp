// SPDX-License-Identifier: GPL-3.0-or-later
// What cells cost beside the voxels that they are made of: a cube that lies askew, in
// some 2,200 cells.
//   material/VOXELS     finding the material
//   all/VOXELS          all cells, from nothing
//   recut/VOXELS        cells of an octree in which some leaves of an earlier one are
//                       split: some 5 % of the cells are new (the counter `new`)
#include <cmath>
#include <map>
#include <memory>
#include <random>

#include <Eigen/Geometry>
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "octree/base/index.h"
#include "octree/cells.h"
#include "tests/support/bodies.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace
{

using namespace cellwarp::core;

constexpr int kAcross = 18;
constexpr int kDepth = 2;

/// A cube with its corner where the axes begin, turned.
Shape askew_cube()
{
    return support::turned(
        support::box_shape({0, 0, 0}, {1, 1, 1}, 100),
        Eigen::AngleAxisd(0.5, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix());
}

struct Cube
{
    Shape shape = askew_cube();
    BoundingSurface surface = bounding_surface(shape);
    GridShape grid;
    Material material;
    MaterialTest test;
    Octree octree, finer;
    Pieces pieces;
    Cells cells;

    explicit Cube(double voxels)
        : grid(grid_of(shape, voxels)),
          material(find_material(shape, surface, grid, Fill::Solid)),
          test(material_test(material.grid)), octree(material.grid.shape(), test),
          finer(octree), pieces(find_pieces(material.grid, octree)),
          cells(build_cells(material.grid, octree, pieces))
    {
        std::mt19937 rng(3);
        std::vector<LeafNumber> some;
        for (const LeafNumber leaf : octree.numbers())
            if (support::random_number(rng, 0.0, 1.0) < 0.007)
                some.push_back(leaf);
        finer = octree.split(some, test);
    }

    /// About so many of its voxels are material.
    static GridShape grid_of(const Shape& shape, double voxels)
    {
        Eigen::Vector3d high = Eigen::Vector3d::Zero();
        for (const Eigen::Vector3d& x : shape.samples)
            high = high.cwiseMax(x);
        return grid_shape(high, kAcross, kDepth, std::cbrt(1.0 / voxels));
    }
};

const Cube& cube_of(double voxels)
{
    static std::map<double, std::unique_ptr<Cube>> cubes;
    std::unique_ptr<Cube>& cube = cubes[voxels];
    if (!cube)
        cube = std::make_unique<Cube>(voxels);
    return *cube;
}

void count_voxels(benchmark::State& state, const Cube& cube)
{
    double count = 0.0;
    for_each_set(cube.material.grid.material(), [&](std::size_t) { ++count; });
    state.counters["voxels"] = count;
    state.counters["cells"] = static_cast<double>(cube.cells.size());
}

void find(benchmark::State& state, double voxels)
{
    const Cube& cube = cube_of(voxels);
    for (auto _ : state)
        benchmark::DoNotOptimize(
            find_material(cube.shape, cube.surface, cube.grid, Fill::Solid));
    count_voxels(state, cube);
}

void make_all(benchmark::State& state, double voxels)
{
    const Cube& cube = cube_of(voxels);
    const VoxelGrid& grid = cube.material.grid;
    for (auto _ : state)
    {
        const Pieces pieces = find_pieces(grid, cube.octree);
        benchmark::DoNotOptimize(build_cells(grid, cube.octree, pieces));
    }
    count_voxels(state, cube);
}

void recut(benchmark::State& state, double voxels)
{
    const Cube& cube = cube_of(voxels);
    const VoxelGrid& grid = cube.material.grid;
    const EarlierCells earlier{cube.octree, cube.pieces, cube.cells};
    Cells cells;
    for (auto _ : state)
    {
        const Pieces pieces = find_pieces(grid, cube.finer, {}, cube.octree, cube.pieces);
        cells = build_cells(grid, cube.finer, pieces, {}, {}, {}, &earlier);
    }
    const std::vector<LeafNumber> same = cube.finer.numbers_in(cube.octree);
    double num_new = 0.0;
    for (const Cell& cell : cells.cells)
        num_new += same[idx(cell.leaf)] == LeafNumber::None;
    count_voxels(state, cube);
    state.counters["new"] = num_new;
}

} // namespace

int main(int argc, char** argv)
{
    benchmark::Initialize(&argc, argv);
    for (const double voxels : {1e5, 1e6, 1e7})
        for (const auto& [name, measure] :
             {std::pair("material", &find), {"all", &make_all}, {"recut", &recut}})
            benchmark::RegisterBenchmark(
                fmt::format("{}/{:.0f}", name, voxels).c_str(),
                [voxels, measure = measure](benchmark::State& state)
                { measure(state, voxels); })
                ->Unit(benchmark::kMillisecond)
                ->UseRealTime();
    benchmark::RunSpecifiedBenchmarks();
}
