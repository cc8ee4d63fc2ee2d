// SPDX-License-Identifier: GPL-3.0-or-later
// Bar and cylinder are tubes of rings with a lid on both ends; quads are cut along
// alternating diagonals, so that no direction is stiffer than another.
#include "tests/bench/scenes.h"

#include <cmath>
#include <functional>
#include <numbers>

#include <fmt/format.h>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/formats/face_triangles.h"
#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::bench
{

namespace
{

using Eigen::Vector3d;
using Index = std::uint32_t;

constexpr double radians(double degrees)
{
    return degrees * std::numbers::pi / 180.0;
}

Vector3d low_corner(const std::vector<Vector3d>& points)
{
    Vector3d low = points.front();
    for (const Vector3d& x : points)
        low = low.cwiseMin(x);
    return low;
}

Vector3d high_corner(const std::vector<Vector3d>& points)
{
    Vector3d high = points.front();
    for (const Vector3d& x : points)
        high = high.cwiseMax(x);
    return high;
}

/// A selector, as a test of points and as words of a handle file.
struct Selection
{
    std::function<bool(const Vector3d&)> holds;
    std::string text;
};

std::string numbers_text(std::initializer_list<double> numbers)
{
    std::string text;
    for (const double number : numbers)
        text += " " + shortest(number);
    return text;
}

Selection box(const Vector3d& low, const Vector3d& high)
{
    return {
        [=](const Vector3d& x)
        { return (x.array() >= low.array()).all() && (x.array() <= high.array()).all(); },
        "box" + numbers_text({low.x(), low.y(), low.z(), high.x(), high.y(), high.z()})};
}

Selection sphere(const Vector3d& centre, double radius)
{
    return {[=](const Vector3d& x) { return (x - centre).norm() <= radius; },
            "sphere" + numbers_text({centre.x(), centre.y(), centre.z(), radius})};
}

/// All points that are no higher than this along y.
Selection below(double height)
{
    return {[=](const Vector3d& x) { return x.y() <= height; },
            "halfspace" + numbers_text({0, -1, 0, -height})};
}

std::vector<Index> selected(const Shape& shape, const Selection& selection)
{
    std::vector<Index> samples;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
        if (selection.holds(shape.samples[i]))
            samples.push_back(static_cast<Index>(i));
    return samples;
}

/// One frame, which fixes one selection and moves another.
Scene scene_of(const std::string& name, Shape shape, const Selection& fixed,
               const Selection& handle, const Eigen::Isometry3d& motion)
{
    Scene scene;
    scene.name = name;
    scene.shape = std::move(shape);
    scene.motion = motion;
    scene.fixed = selected(scene.shape, fixed);
    scene.moved = selected(scene.shape, handle);
    scene.handles = "cellwarp-handles 1\nfixed foot " + fixed.text + "\nhandle head " +
                    handle.text + "\nframe 1\nmove head matrix";
    for (int row = 0; row < 4; ++row)
        for (int column = 0; column < 4; ++column)
            scene.handles += " " + shortest(motion.matrix()(row, column));
    scene.handles += "\n";
    return scene;
}

/// Two triangles for the quad a b c d; neighbours give the other \p diagonal.
void add_quad(Shape& shape, Index a, Index b, Index c, Index d, int diagonal)
{
    if (diagonal % 2 == 0)
        shape.triangles.insert(shape.triangles.end(), {{a, b, d}, {b, c, d}});
    else
        shape.triangles.insert(shape.triangles.end(), {{a, b, c}, {a, c, d}});
}

/// An open tube of rows + 1 copies of a ring, which runs counter-clockwise seen from
/// +z. Sample a of row k has the number k * ring.size() + a.
Shape tube(const std::vector<Vector3d>& ring, int rows, double height)
{
    Shape shape;
    const Index around = static_cast<Index>(ring.size());
    for (int k = 0; k <= rows; ++k)
        for (const Vector3d& x : ring)
            shape.samples.push_back(x + Vector3d(0, 0, height * k / rows));
    for (int k = 0; k < rows; ++k)
        for (Index a = 0; a < around; ++a)
        {
            const Index low = static_cast<Index>(k) * around, high = low + around;
            const Index next = (a + 1) % around;
            add_quad(shape, low + a, low + next, high + next, high + a,
                     static_cast<int>(a) + k);
        }
    return shape;
}

/// Turns the triangles from number \p first on over, for the lid at the lower end.
void turn_over(Shape& shape, std::size_t first)
{
    for (std::size_t t = first; t < shape.triangles.size(); ++t)
        std::swap(shape.triangles[t][1], shape.triangles[t][2]);
}

/// The outline of [-.5, .5]^2, n quads an edge, from the corner (-.5, -.5) on.
std::vector<Vector3d> square_ring(int n)
{
    std::vector<Vector3d> ring;
    for (const auto& [corner, along] :
         {std::pair(Vector3d(-0.5, -0.5, 0), Vector3d(1, 0, 0)),
          {Vector3d(0.5, -0.5, 0), Vector3d(0, 1, 0)},
          {Vector3d(0.5, 0.5, 0), Vector3d(-1, 0, 0)},
          {Vector3d(-0.5, 0.5, 0), Vector3d(0, -1, 0)}})
        for (int i = 0; i < n; ++i)
            ring.push_back(corner + along * i / n);
    return ring;
}

/// n x n quads inside the square ring whose first sample has the number \p ring.
void add_square_lid(Shape& shape, int n, Index ring, double z)
{
    const Index inside = static_cast<Index>(shape.samples.size());
    for (int j = 1; j < n; ++j)
        for (int i = 1; i < n; ++i)
            shape.samples.push_back(
                {static_cast<double>(i) / n - 0.5, static_cast<double>(j) / n - 0.5, z});
    const auto number = [=](int i, int j) -> Index
    {
        if (j == 0)
            return ring + static_cast<Index>(i);
        if (i == n)
            return ring + static_cast<Index>(n + j);
        if (j == n)
            return ring + static_cast<Index>(3 * n - i);
        if (i == 0)
            return ring + static_cast<Index>(4 * n - j);
        return inside + static_cast<Index>((j - 1) * (n - 1) + i - 1);
    };
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i)
            add_quad(shape, number(i, j), number(i + 1, j), number(i + 1, j + 1),
                     number(i, j + 1), i + j);
}

/// A closed box [-.5, .5]^2 x [0, 4] of n x n x 4n quads.
Shape bar_shape(int n)
{
    const int rows = 4 * n;
    Shape shape = tube(square_ring(n), rows, 4.0);
    const std::size_t first = shape.triangles.size();
    add_square_lid(shape, n, 0, 0.0);
    turn_over(shape, first);
    add_square_lid(shape, n, static_cast<Index>(rows * 4 * n), 4.0);
    return shape;
}

/// 6 j points on a circle.
std::vector<Vector3d> circle(int j, double radius)
{
    std::vector<Vector3d> ring;
    for (int a = 0; a < 6 * j; ++a)
    {
        const double angle = radians(60.0 * a / j);
        ring.push_back({radius * std::cos(angle), radius * std::sin(angle), 0});
    }
    return ring;
}

/// A disk inside the ring of 6 \p rings samples from number \p outer on: rings of six
/// samples fewer each, down to the centre, hence nearly regular triangles.
void add_round_lid(Shape& shape, int rings, Index outer, double radius, double z)
{
    for (int j = rings; j > 0; --j)
    {
        const Index inner = static_cast<Index>(shape.samples.size());
        for (const Vector3d& x : circle(j - 1, radius * (j - 1) / rings))
            shape.samples.push_back(x + Vector3d(0, 0, z));
        if (j == 1)
            shape.samples.push_back({0, 0, z});
        const auto outside = [=](int a)
        { return outer + static_cast<Index>(a % (6 * j)); };
        const auto inside = [=](int a)
        { return inner + static_cast<Index>(j == 1 ? 0 : a % (6 * (j - 1))); };
        for (int sector = 0; sector < 6; ++sector)
            for (int a = 0; a < j; ++a)
            {
                const int o = sector * j + a, i = sector * (j - 1) + a;
                shape.triangles.push_back({outside(o), outside(o + 1), inside(i)});
                if (a + 1 < j)
                    shape.triangles.push_back({outside(o + 1), inside(i + 1), inside(i)});
            }
        outer = inner;
    }
}

/// A closed cylinder, 0 <= z <= 5, 6 \p rings quads around, as high as they are wide.
Shape cylinder_shape(int rings)
{
    const double radius = 0.5, height = 5.0;
    const int around = 6 * rings;
    const int rows = static_cast<int>(
        std::lround(height * around / (2.0 * std::numbers::pi * radius)));
    Shape shape = tube(circle(rings, radius), rows, height);
    const std::size_t first = shape.triangles.size();
    add_round_lid(shape, rings, 0, radius, 0.0);
    turn_over(shape, first);
    add_round_lid(shape, rings, static_cast<Index>(rows * around), radius, height);
    return shape;
}

Eigen::Isometry3d turned(const Vector3d& axis, double degrees, const Vector3d& from,
                         const Vector3d& to)
{
    return Eigen::Translation3d(to) * Eigen::AngleAxisd(radians(degrees), axis) *
           Eigen::Translation3d(-from);
}

Scene bar(const std::string& name, int n)
{
    return scene_of(name, bar_shape(n), box({-1, -1, -1}, {1, 1, 0.25}),
                    box({-1, -1, 3.75}, {1, 1, 5}),
                    turned(Vector3d::UnitZ(), 135.0, Vector3d::Zero(), Vector3d::Zero()));
}

/// The middle of the handle's border moves to where a circular arc of the same length
/// ends.
Scene cylinder(const std::string& name, int rings)
{
    const double angle = radians(120.0), radius = 4.5 / angle;
    const Vector3d end(radius * (1.0 - std::cos(angle)), 0,
                       0.25 + radius * std::sin(angle));
    return scene_of(name, cylinder_shape(rings), box({-1, -1, -1}, {1, 1, 0.25}),
                    box({-1, -1, 4.75}, {1, 1, 6}),
                    turned(Vector3d::UnitY(), 120.0, {0, 0, 4.75}, end));
}

/// The triangles of a geometry file.
Shape shape_of(const Geometry& geometry)
{
    return {geometry.samples, triangles_of(geometry)};
}

Scene armadillo(const std::string& name, int)
{
    const std::string folder = support::data_folder();
    if (folder.empty())
        throw Error(Fault::Usage, "armadillo: CELLWARP_TEST_DATA must name a folder with "
                                  "armadillo.obj");
    Shape shape = shape_of(read_geometry(folder + "/armadillo.obj").geometry);
    const double low = low_corner(shape.samples).y(),
                 high = high_corner(shape.samples).y();
    const Selection hand = sphere({0.331274, 0.231563, 0.38333}, 0.15);
    std::vector<Vector3d> points;
    for (const Index i : selected(shape, hand))
        points.push_back(shape.samples[i]);
    if (points.empty())
        throw Error(Fault::Usage, "armadillo: " + folder +
                                      "/armadillo.obj has no sample "
                                      "where the hand must be");
    const Vector3d centre = 0.5 * (low_corner(points) + high_corner(points));
    return scene_of(
        name, std::move(shape), below(low + 0.08 * (high - low)), hand,
        turned(Vector3d::UnitZ(), 60.0, centre, centre + Vector3d(0, 0.2, 0)));
}

struct Recipe
{
    const char* name;
    Scene (*make)(const std::string&, int);
    int fineness;
};
const Recipe kRecipes[] = {{"bar1k", bar, 7},         {"bar6k", bar, 18},
                           {"bar50k", bar, 53},       {"bar200k", bar, 105},
                           {"bar1m", bar, 236},       {"cyl5k", cylinder, 9},
                           {"cyl500k", cylinder, 89}, {"armadillo", armadillo, 0}};

} // namespace

std::vector<std::string> scene_names()
{
    std::vector<std::string> names;
    for (const Recipe& recipe : kRecipes)
        names.push_back(recipe.name);
    return names;
}

Scene make_scene(const std::string& name)
{
    std::string known;
    for (const Recipe& recipe : kRecipes)
    {
        if (name == recipe.name)
            return recipe.make(name, recipe.fineness);
        known += std::string(" ") + recipe.name;
    }
    throw Error(Fault::Usage,
                fmt::format("scene: got {}, need one of{}", in_quotes(name), known));
}

namespace
{

/// Samples as an `indices` selector: ascending numbers as ranges.
std::string as_indices(std::span<const Index> samples)
{
    std::string text = "indices";
    for (std::size_t begin = 0, end = 0; begin < samples.size(); begin = end)
    {
        while (end < samples.size() && samples[end] - samples[begin] == end - begin)
            ++end;
        text += fmt::format(" {}-{}", samples[begin], samples[end - 1]);
    }
    return text;
}

/// The statements of a scene with lists in the place of its selectors.
std::string with_lists(const Scene& scene)
{
    return "cellwarp-handles 1\nfixed foot " + as_indices(scene.fixed) +
           "\nhandle head " + as_indices(scene.moved) + "\n" +
           scene.handles.substr(scene.handles.find("frame 1"));
}

} // namespace

void write_scene(const Scene& scene, const std::filesystem::path& folder)
{
    const auto write = [&](const std::string& name, const std::string& text)
    { write_file((folder / name).string(), text, Overwrite::Yes); };
    write(scene.name + ".obj", support::obj_text(scene.shape));
    for (const auto& [name, handles] :
         {std::pair(scene.name, scene.handles),
          std::pair(scene.name + "-lists", with_lists(scene))})
    {
        write(name + ".handles", handles);
        write(name + ".json", fmt::format("{{ \"cellwarp\": 1, \"model\": \"{}.obj\", "
                                          "\"handles\": \"{}.handles\" }}\n",
                                          scene.name, name));
    }
}

double diagonal(const Shape& shape)
{
    return (high_corner(shape.samples) - low_corner(shape.samples)).norm();
}

} // namespace cellwarp::core::bench
