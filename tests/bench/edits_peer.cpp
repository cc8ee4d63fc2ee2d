// SPDX-License-Identifier: GPL-3.0-or-later
// Edits beside what else moves the same samples by the same regions: linear blends of
// their motions, blends of dual quaternions [Kavan07] and, where there is no skeleton,
// CGAL's as-rigid-as-possible surface deformation, which runs until no vertex moves by
// 1e-4 of the diagonal. Weights are those that a file does not give: of the distances to
// bones or to the samples of regions, to the power of -4, of the four nearest, through
// the air as automatic weights without a heat solve have them. For each frame the volume
// beside rest, the pairs of faces that intersect only now, and by what factor the edge
// that is stretched most is longer. Seconds are from the read model to the samples:
// preparation counts to the first frame. A table on stdout.
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <vector>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/self_intersections.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_deformation.h>
#include <Eigen/Geometry>
#include <fmt/format.h>

#include "io/base/error.h"
#include "io/formats/face_triangles.h"
#include "io/formats/geometry_file.h"
#include "library/session/scene_script.h"
#include "library/session/scene_settings.h"
#include "library/session/session.h"
#include "library/session/volume.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "octree/base/segment.h"

namespace cellwarp::core::bench
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

/// Of a region that is a bone the distance to it, of others to their samples.
std::vector<Weights> weights_of(const CellSystem& system)
{
    const RegionSet& regions = system.regions();
    const std::vector<Vector3d>& samples = system.rest().samples;
    std::vector<std::optional<PointTree>> trees(regions.size());
    for (std::size_t r = 0; r < regions.size(); ++r)
        if (!regions.skeleton() && regions[r].prescribes() && !regions[r].samples.empty())
        {
            std::vector<Vector3d> places;
            for (const std::uint32_t i : regions[r].samples)
                places.push_back(samples[i]);
            trees[r].emplace(places);
        }
    std::vector<Weights> all;
    for (const Vector3d& x : samples)
    {
        std::vector<std::pair<double, std::size_t>> away;
        for (std::size_t r = 0; r < regions.size(); ++r)
        {
            double least = INFINITY;
            if (regions[r].bone)
                for (const auto& [a, b] :
                     regions.skeleton()->bones(regions[r].bone->joint))
                    least = std::min(least,
                                     (a + nearest_share(a, b, x) * (b - a) - x).norm());
            else if (trees[r])
                least = std::sqrt(trees[r]->nearest(x).distance_squared);
            else
                continue;
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

/// CGAL's deformation of a session's mesh, all samples of its regions held.
class Arap
{
public:
    Arap(const CellSystem& system, const std::vector<Triangle>& triangles)
    {
        const std::vector<Vector3d>& samples = system.rest().samples;
        for (const Vector3d& x : samples)
            mesh_.add_vertex(Point(x.x(), x.y(), x.z()));
        for (const Triangle& t : triangles)
            if (mesh_.add_face(Mesh::Vertex_index(t[0]), Mesh::Vertex_index(t[1]),
                               Mesh::Vertex_index(t[2])) == Mesh::null_face())
                return; // no manifold
        deformation_.emplace(mesh_);
        for (const auto vertex : mesh_.vertices())
            deformation_->insert_roi_vertex(vertex);
        const RegionSet& regions = system.regions();
        for (std::size_t r = 0; r < regions.size(); ++r)
            if (regions[r].prescribes())
                for (const std::uint32_t i : regions[r].samples)
                {
                    deformation_->insert_control_vertex(Mesh::Vertex_index(i));
                    held_.emplace_back(i, r);
                }
        if (!deformation_->preprocess())
            deformation_.reset();
    }
    bool is_possible() const { return deformation_.has_value(); }

    /// From where the last frame ended, at most a minute.
    std::vector<Vector3d> moved(const CellSystem& system)
    {
        constexpr double kStill = 1e-4, kMostSeconds = 60.0;
        for (const auto& [i, region] : held_)
        {
            const Vector3d x = system.motions()[region](system.rest().samples[i]);
            deformation_->set_target_position(Mesh::Vertex_index(i),
                                              Point(x.x(), x.y(), x.z()));
        }
        const Clock::time_point start = Clock::now();
        std::vector<Vector3d> places = positions(), last;
        double largest = INFINITY;
        while (largest > kStill * system.rest().frame.diagonal() &&
               1e-3 * ms_since(start) < kMostSeconds)
        {
            deformation_->deform(1, 0.0);
            last = std::exchange(places, positions());
            largest = 0.0;
            for (std::size_t i = 0; i < places.size(); ++i)
                largest = std::max(largest, (places[i] - last[i]).norm());
        }
        return places;
    }

private:
    using Point = CGAL::Simple_cartesian<double>::Point_3;
    using Mesh = CGAL::Surface_mesh<Point>;

    std::vector<Vector3d> positions() const
    {
        std::vector<Vector3d> places;
        for (const auto vertex : mesh_.vertices())
        {
            const Point& p = mesh_.point(vertex);
            places.emplace_back(p.x(), p.y(), p.z());
        }
        return places;
    }

    Mesh mesh_;
    std::optional<CGAL::Surface_mesh_deformation<Mesh, CGAL::Default, CGAL::Default,
                                                 CGAL::SPOKES_AND_RIMS>>
        deformation_;
    std::vector<std::pair<std::uint32_t, std::size_t>> held_;
};

/// Of the edge that has become longest beside its length at rest.
double largest_stretch(const std::vector<Triangle>& triangles,
                       const std::vector<Vector3d>& rest,
                       const std::vector<Vector3d>& samples)
{
    double largest = 0.0;
    for (const Triangle& t : triangles)
        for (std::size_t k = 0; k < 3; ++k)
        {
            const std::uint32_t i = t[k], j = t[(k + 1) % 3];
            const double length = (rest[i] - rest[j]).norm();
            if (length > 0.0)
                largest = std::max(largest, (samples[i] - samples[j]).norm() / length);
        }
    return largest;
}

void measure(const std::string& path)
{
    const SceneFile scene = read_scene(path);
    std::vector<std::string> warnings;
    std::optional<HandleFile> script = script_of(scene, scene.handles, warnings);
    const auto model = std::make_shared<const GeometryFile>(read_geometry(scene.model));
    const Clock::time_point begin_of_cells = Clock::now();
    Session session(geometry_of(model), std::move(*script), settings_of(scene));
    double cells_seconds = 1e-3 * ms_since(begin_of_cells);
    const std::vector<Triangle> triangles = triangles_of(model->geometry);
    const Pairs at_rest = crossings(triangles, model->geometry.samples);
    const Clock::time_point begin_of_weights = Clock::now();
    const std::vector<Weights> weights = weights_of(*session.system());
    double weights_seconds = 1e-3 * ms_since(begin_of_weights);
    const auto row =
        [&](const char* name, const std::vector<Vector3d>& samples, double seconds)
    {
        const std::optional<Volume> volume = enclosed_volumes(model->geometry, samples);
        std::size_t added = 0;
        for (const auto& pair : crossings(triangles, samples))
            added += !at_rest.contains(pair);
        fmt::print("  {:7} {:+7.2f} % {:7} {:7.2f} {:8.3f} s\n", name,
                   volume ? 100.0 * (volume->after / volume->before - 1.0) : NAN, added,
                   largest_stretch(triangles, model->geometry.samples, samples), seconds);
    };
    fmt::print("{}\n", path);
    std::optional<Arap> arap;
    double arap_seconds = 0.0;
    if (!session.system()->regions().skeleton())
    {
        const Clock::time_point start = Clock::now();
        arap.emplace(*session.system(), triangles);
        arap_seconds = 1e-3 * ms_since(start);
    }
    while (session.upcoming_frame())
    {
        const Clock::time_point start = Clock::now();
        session.next_frame(true);
        const double seconds = 1e-3 * ms_since(start);
        fmt::print(" frame {}\n", session.frames().back().frame);
        row("cells", session.deformed().samples,
            std::exchange(cells_seconds, 0.0) + seconds);
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
            row(is_dual ? "dual" : "linear", samples,
                weights_seconds + 1e-3 * ms_since(begin));
        }
        weights_seconds = 0.0;
        if (arap && arap->is_possible())
        {
            const Clock::time_point begin = Clock::now();
            std::vector<Vector3d> samples = arap->moved(system);
            for (Vector3d& x : samples)
                x = system.rest().frame.to_model(x);
            row("arap", samples,
                std::exchange(arap_seconds, 0.0) + 1e-3 * ms_since(begin));
        }
    }
}

} // namespace

} // namespace cellwarp::core::bench

int main(int argc, char** argv)
{
    if (argc < 2)
    {
        fmt::print(stderr, "usage: edits_peer SCENE...\n"
                           "of each frame and method: change of volume, new pairs of "
                           "faces that intersect, largest stretch of an edge, seconds\n");
        return 2;
    }
    try
    {
        for (int k = 1; k < argc; ++k)
            cellwarp::core::bench::measure(argv[k]);
    }
    catch (const cellwarp::core::Error& error)
    {
        fmt::print(stderr, "error: {}\n", error.what());
        return static_cast<int>(error.fault());
    }
}
