// SPDX-License-Identifier: GPL-3.0-or-later
// How near to the closed original the inside of an opened shape is: what a flood does not
// reach beside the hollows, with the seconds that each takes, as a table.
// usage: inside_bench [WORD...]   only cases whose names hold one of the words
//   opening  the widest that was closed [of the diagonal]
//   off      voxels more and fewer than the closed original [of its voxels]
//   time     of the processor
#include <algorithm>
#include <cstdio>
#include <ctime>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "octree/base/index.h"
#include "octree/hollows.h"
#include "octree/lids.h"
#include "octree/sealed_inside.h"
#include "octree/surface_marks.h"
#include "octree/winding.h"
#include "tests/support/files.h"
#include "tests/support/pot.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using support::cloud_with_hole;
using support::with_hole;

/// Radii are of the diagonal.
constexpr double kLargestSeal = 0.04, kWidest = 0.125;
constexpr double kVoxel = 0.0033;
constexpr double kNearlyClosed = 0.2;

struct Case
{
    std::string name;
    Shape open;
    Shape closed; ///< empty: not known
};

/// Of the processor: both ways use one thread.
double seconds_since(std::clock_t start)
{
    return static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
}

Shape loaded(const std::string& path)
{
    const Geometry geometry = read_geometry(path).geometry;
    Shape shape{geometry.samples, {}};
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> corners = geometry.face(f);
        for (std::size_t k = 2; k < corners.size(); ++k)
            shape.triangles.push_back({corners[0], corners[k - 1], corners[k]});
    }
    return shape;
}

Shape soup_of(const Shape& shape, double share)
{
    Shape soup;
    std::mt19937 rng(5);
    for (const Triangle& t : shape.triangles)
        if (support::random_number(rng, 0.0, 1.0) < share)
        {
            const std::uint32_t first = static_cast<std::uint32_t>(soup.samples.size());
            for (const std::uint32_t i : t)
                soup.samples.push_back(shape.samples[i]);
            soup.triangles.push_back({first, first + 1, first + 2});
        }
    return soup;
}

std::vector<Case> cases()
{
    std::vector<Case> all;
    const std::string samples = support::samples_folder() + "/";
    const Shape creature = loaded(samples + "creature.obj");
    all.push_back({"scan", loaded(samples + "scan.xyz"), creature});
    Shape knot = loaded(samples + "soup.stl");
    knot.triangles = bounding_surface(knot).triangles;
    all.push_back({"soup, a third of its triangles", soup_of(knot, 0.33), knot});
    all.push_back({"soup, half of its triangles, a bite",
                   with_hole(soup_of(knot, 0.5), knot.samples[0], 0.5), knot});
    const Shape pot = support::pot(0.04);
    Shape copy = pot;
    const double pot_diagonal = support::to_origin({&copy}).norm();
    for (const double width : {0.15, 0.3, 0.45, 0.6})
    {
        const std::string suffix =
            fmt::format(", lid {:.2f}", 2.0 * width / pot_diagonal);
        const Vector3d top(0, 0.8, 0);
        const Shape open = with_hole(pot, top, width);
        all.push_back({"pot" + suffix, open, pot});
        all.push_back({"pot, half of its triangles" + suffix, soup_of(open, 0.5), pot});
        all.push_back({"pot, 30,000 points" + suffix,
                       cloud_with_hole(support::random_points(pot, 30000, 4), top, width),
                       pot});
    }
    for (const double radius : {0.15, 0.25})
        all.push_back({fmt::format("creature, a bite of {}", radius),
                       with_hole(creature, {0, 1.2, -0.25}, radius), creature});
    all.push_back({"vase", loaded(samples + "vase.obj"), Shape()});
    if (const std::string data = support::data_folder(); !data.empty())
    {
        const Shape bunny = loaded(data + "/stanford-bunny.obj");
        all.push_back({"bunny", bunny, with_lids(bunny)});
        all.push_back(
            {"bunny, its vertices", Shape{bunny.samples, {}}, with_lids(bunny)});
        const Shape armadillo = loaded(data + "/armadillo.obj");
        copy = armadillo;
        const double diagonal = support::to_origin({&copy}).norm();
        for (const double width : {0.08, 0.16})
            all.push_back(
                {fmt::format("armadillo, a bite of {}", width),
                 with_hole(armadillo, armadillo.samples[20000], 0.5 * width * diagonal),
                 armadillo});
        all.push_back({"beetle", loaded(data + "/beetle.obj"), Shape()});
    }
    return all;
}

using Flags = VoxelFlags;

std::size_t count(const Flags& flags)
{
    return idx(std::count(flags.begin(), flags.end(), 1));
}

/// What is in either.
Flags both(const Flags& a, const Flags& b)
{
    Flags all(a.size());
    for (std::size_t i = 0; i < all.size(); ++i)
        all[i] = a[i] || b[i];
    return all;
}

/// What one way finds.
struct Finding
{
    Flags material;
    double radius = -1.0; ///< of the openings closed [voxel]; negative: no inside
    double seconds = 0.0;
};

/// The columns of a finding: the width of openings [diagonal], of the voxels of \p truth
/// how many more and how many fewer [%], seconds.
std::string columns(const Finding& finding, const Flags& truth, double diagonal)
{
    const double size = static_cast<double>(count(truth)) / 100.0;
    double more = 0.0, fewer = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i)
    {
        more += finding.material[i] && !truth[i] ? 1.0 / size : 0.0;
        fewer += truth[i] && !finding.material[i] ? 1.0 / size : 0.0;
    }
    const std::string kind = finding.radius < 0
                                 ? "shell"
                                 : fmt::format("{:.3f}", 2.0 * finding.radius / diagonal);
    const std::string difference =
        size > 0 ? fmt::format("+{:.2f} % −{:.2f} %", more, fewer) : "";
    return fmt::format("{} | {} | {:.1f} s", kind, difference, finding.seconds);
}

void measure(Case& c)
{
    const Vector3d size = support::to_origin({&c.open, &c.closed});
    const GridShape shape = grid_shape(size, 16, 0, kVoxel * size.norm());
    const double diagonal = size.norm() / shape.voxel(); // [voxel]
    const VoxelGrid grid(shape);
    const Flags marks = surface_marks(c.open, grid);
    Flags truth(grid.size());
    if (!c.closed.samples.empty())
        truth =
            both(both(marks, surface_marks(c.closed, grid)),
                 inside_by_winding(c.closed, bounding_surface(c.closed).triangles, grid));
    const BoundingSurface surface = bounding_surface(c.open);
    Flags votes;
    if (surface.open_edges < kNearlyClosed)
        votes = inside_votes(c.open, surface.triangles, grid);
    const auto may_fill = [&](std::size_t i) { return votes.empty() || votes[i] >= 4; };
    const int most = static_cast<int>(kLargestSeal * diagonal);
    std::clock_t start = std::clock();
    SealedInside sealed(grid, marks, most);
    const double radius = sealed.radius();
    const Flags of_flood = std::move(sealed).voxels(may_fill);
    const Finding flood{both(marks, of_flood), radius, seconds_since(start)};
    const double narrowest = radius < 0 ? most : std::max(2.0, radius);
    start = std::clock();
    const Hollows hollows =
        hollow_voxels(grid, marks, {narrowest, kWidest * diagonal}, may_fill);
    const Finding found{both(marks, hollows.is_inside), hollows.radius,
                        seconds_since(start)};
    fmt::print("| {} | {} | {} |\n", c.name, columns(flood, truth, diagonal),
               columns(found, truth, diagonal));
    std::fflush(stdout);
}

} // namespace

} // namespace cellwarp::core

int main(int argc, char** argv)
{
    try
    {
        fmt::print("| | flood: opening | off | time | hollows: opening | off | time |\n"
                   "|---|---|---|---|---|---|---|\n");
        for (cellwarp::core::Case& c : cellwarp::core::cases())
            if (argc < 2 || std::any_of(argv + 1, argv + argc,
                                        [&](const char* word) {
                                            return c.name.find(word) != std::string::npos;
                                        }))
                cellwarp::core::measure(c);
    }
    catch (const cellwarp::core::Error& error)
    {
        std::fprintf(stderr, "inside_bench: %s\n", error.what());
        return 1;
    }
}
