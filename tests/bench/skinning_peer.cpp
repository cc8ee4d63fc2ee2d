// SPDX-License-Identifier: GPL-3.0-or-later
// Poses of scenes with skeletons beside skinning: the same bones move the same samples by
// linear blends of their motions and by blends of dual quaternions [Kavan07]. Weights are
// those that a file does not give: of the bones' distances to the power of -4, of the
// four nearest, through the air as automatic weights without a heat solve have them. For
// each frame the volume beside rest and the pairs of faces that intersect only now; a
// table on stdout.
#include <array>
#include <cmath>
#include <set>
#include <vector>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>
#include <Eigen/Geometry>
#include <fmt/format.h>

#include "editor/session/scene_script.h"
#include "editor/session/scene_settings.h"
#include "editor/session/session.h"
#include "editor/session/volume.h"
#include "io/error.h"
#include "io/geometry_file.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "octree/base/segment.h"

namespace cellwarp::bench
{

namespace
{

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr std::size_t kBones = 4;
constexpr double kPower = -4.0;

struct Weights
{
    std::array<std::size_t, kBones> region{};
    std::array<double, kBones> weight{};
};

std::vector<Weights> weights_of(const CellSystem& system)
{
    const RegionSet& regions = system.regions();
    std::vector<Weights> all;
    for (const Vector3d& x : system.rest().samples)
    {
        std::vector<std::pair<double, std::size_t>> away;
        for (std::size_t r = 0; r < regions.size(); ++r)
        {
            if (!regions[r].bone)
                continue;
            double least = INFINITY;
            for (const auto& [a, b] : regions.skeleton()->bones(regions[r].bone->joint))
                least =
                    std::min(least, (a + nearest_share(a, b, x) * (b - a) - x).norm());
            away.emplace_back(least, r);
        }
        std::sort(away.begin(), away.end());
        Weights& weights = all.emplace_back();
        double sum = 0.0;
        for (std::size_t k = 0; k < std::min(kBones, away.size()); ++k)
        {
            weights.region[k] = away[k].second;
            weights.weight[k] = std::pow(std::max(away[k].first, 1e-9), kPower);
            sum += weights.weight[k];
        }
        for (double& weight : weights.weight)
            weight /= sum;
    }
    return all;
}

Vector3d linear(const Weights& weights, const std::vector<Motion>& motions,
                const Vector3d& x)
{
    Vector3d sum = Vector3d::Zero();
    for (std::size_t k = 0; k < kBones; ++k)
        if (weights.weight[k] > 0.0)
            sum += weights.weight[k] * motions[weights.region[k]](x);
    return sum;
}

Vector3d dual(const Weights& weights, const std::vector<Motion>& motions,
              const Vector3d& x)
{
    const Quaterniond first(motions[weights.region[0]].R);
    Eigen::Vector4d real = Eigen::Vector4d::Zero(), other = real;
    for (std::size_t k = 0; k < kBones; ++k)
    {
        if (weights.weight[k] == 0.0)
            continue;
        const Motion& motion = motions[weights.region[k]];
        Quaterniond q(motion.R);
        if (q.dot(first) < 0)
            q.coeffs() *= -1.0;
        const Quaterniond t(0, motion.t.x(), motion.t.y(), motion.t.z());
        real += weights.weight[k] * q.coeffs();
        other += weights.weight[k] * 0.5 * (t * q).coeffs();
    }
    const double size = real.norm();
    const Quaterniond q(Eigen::Vector4d(real / size)), d(Eigen::Vector4d(other / size));
    return q * x + 2.0 * (d * q.conjugate()).vec();
}

using Pairs = std::set<std::pair<std::size_t, std::size_t>>;

Pairs crossings(const std::vector<Triangle>& triangles,
                const std::vector<Vector3d>& samples)
{
    using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
    using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
    Mesh mesh;
    for (const Vector3d& x : samples)
        mesh.add_vertex(Kernel::Point_3(x.x(), x.y(), x.z()));
    for (const Triangle& t : triangles)
        mesh.add_face(Mesh::Vertex_index(t[0]), Mesh::Vertex_index(t[1]),
                      Mesh::Vertex_index(t[2]));
    std::vector<std::pair<Mesh::Face_index, Mesh::Face_index>> found;
    CGAL::Polygon_mesh_processing::self_intersections(mesh, std::back_inserter(found));
    Pairs pairs;
    for (const auto& [one, other] : found)
        pairs.emplace(std::minmax<std::size_t>(one, other));
    return pairs;
}

void measure(const std::string& path)
{
    const SceneFile scene = read_scene(path);
    std::vector<std::string> warnings;
    std::optional<HandleFile> script = script_of(scene, scene.handles, warnings);
    const auto model = std::make_shared<const GeometryFile>(read_geometry(scene.model));
    Session session(geometry_of(model), std::move(*script), settings_of(scene));
    const std::vector<Triangle> triangles = triangles_of(model->geometry);
    const Pairs at_rest = crossings(triangles, model->geometry.samples);
    const std::vector<Weights> weights = weights_of(*session.system());
    const auto row =
        [&](const char* name, const std::vector<Vector3d>& samples, double seconds)
    {
        const std::optional<Volume> volume = enclosed_volumes(model->geometry, samples);
        std::size_t added = 0;
        for (const auto& pair : crossings(triangles, samples))
            added += !at_rest.contains(pair);
        fmt::print(" {:8} {:+7.2f} % {:7} {:8.3f} s |", name,
                   volume ? 100.0 * (volume->after / volume->before - 1.0) : NAN, added,
                   seconds);
    };
    fmt::print("{}\n", path);
    while (session.upcoming_frame())
    {
        const Clock::time_point start = Clock::now();
        session.next_frame(true);
        const double seconds = 1e-3 * ms_since(start);
        fmt::print("{:4} |", session.frames().back().frame);
        row("cells", session.deformed().samples, seconds);
        const CellSystem& system = *session.system();
        for (const bool is_dual : {false, true})
        {
            const Clock::time_point begin = Clock::now();
            std::vector<Vector3d> samples;
            for (std::size_t i = 0; i < weights.size(); ++i)
            {
                const Vector3d& x = system.rest().samples[i];
                samples.push_back(system.rest().frame.to_model(
                    is_dual ? dual(weights[i], system.motions(), x)
                            : linear(weights[i], system.motions(), x)));
            }
            row(is_dual ? "dual" : "linear", samples, 1e-3 * ms_since(begin));
        }
        fmt::print("\n");
    }
}

} // namespace

} // namespace cellwarp::bench

int main(int argc, char** argv)
{
    if (argc < 2)
    {
        fmt::print(stderr, "usage: skinning_peer SCENE...\n"
                           "frame | method, change of volume, new pairs of faces that "
                           "intersect, seconds | ...\n");
        return 2;
    }
    try
    {
        for (int k = 1; k < argc; ++k)
            cellwarp::bench::measure(argv[k]);
    }
    catch (const cellwarp::Error& error)
    {
        fmt::print(stderr, "error: {}\n", error.what());
        return static_cast<int>(error.fault());
    }
}
