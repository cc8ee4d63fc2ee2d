// SPDX-License-Identifier: GPL-3.0-or-later
// The peer that cellwarp is measured beside: CGAL's as-rigid-as-possible surface
// deformation, as it ships (one thread, its default solver), on the same scenes with the
// same fixed and moved vertices. One JSON object on stdout.
#include <algorithm>
#include <cmath>

#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_deformation.h>
#include <CGAL/version.h>
#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <sys/resource.h>

#include "octree/base/clock.h"
#include "tests/bench/scenes.h"

namespace
{

using cellwarp::core::Clock;
using cellwarp::core::seconds_since;
using cellwarp::core::bench::Scene;
using Eigen::Vector3d;
using Json = nlohmann::ordered_json;
using Point = CGAL::Simple_cartesian<double>::Point_3;
using Mesh = CGAL::Surface_mesh<Point>;
using Points = std::vector<Vector3d>;

Mesh mesh_of(const cellwarp::core::Shape& shape)
{
    Mesh mesh;
    for (const Vector3d& x : shape.samples)
        mesh.add_vertex(Point(x.x(), x.y(), x.z()));
    for (const cellwarp::core::Triangle& t : shape.triangles)
        if (mesh.add_face(Mesh::Vertex_index(t[0]), Mesh::Vertex_index(t[1]),
                          Mesh::Vertex_index(t[2])) == Mesh::null_face())
            throw std::runtime_error("the mesh is no manifold");
    return mesh;
}

/// One deformation from rest. What it times is CGAL's own work: copies and comparisons
/// for this program's sake are outside.
template <CGAL::Deformation_algorithm_tag kTag>
class Peer
{
public:
    explicit Peer(const Scene& scene)
        : mesh_(mesh_of(scene.shape)), positions_(scene.shape.samples)
    {
        const Clock::time_point start = Clock::now();
        deformation_ = std::make_unique<Deformation>(mesh_);
        for (const auto vertex : mesh_.vertices())
            deformation_->insert_roi_vertex(vertex);
        for (const auto* samples : {&scene.fixed, &scene.moved})
            for (const std::uint32_t i : *samples)
                deformation_->insert_control_vertex(Mesh::Vertex_index(i));
        if (!deformation_->preprocess())
            throw std::runtime_error("CGAL could not factorise its matrix");
        for (const std::uint32_t i : scene.moved)
        {
            const Vector3d x = scene.motion * scene.shape.samples[i];
            deformation_->set_target_position(Mesh::Vertex_index(i),
                                              Point(x.x(), x.y(), x.z()));
        }
        preprocess_seconds_ = seconds_since(start);
        seconds_ = preprocess_seconds_;
    }

    /// Gives the largest vertex movement [model unit].
    double iterate()
    {
        const Clock::time_point start = Clock::now();
        deformation_->deform(1, 0.0);
        iteration_seconds_.push_back(seconds_since(start));
        seconds_ += iteration_seconds_.back();
        double movement = 0.0;
        for (std::size_t i = 0; i < positions_.size(); ++i)
        {
            const Point& p = mesh_.point(Mesh::Vertex_index(static_cast<unsigned>(i)));
            const Vector3d now(p.x(), p.y(), p.z());
            movement = std::max(movement, (now - positions_[i]).norm());
            positions_[i] = now;
        }
        return movement;
    }

    const Points& positions() const { return positions_; }
    double seconds() const { return seconds_; } ///< preprocessing and iterations
    double preprocess_seconds() const { return preprocess_seconds_; }
    std::size_t iterations() const { return iteration_seconds_.size(); }
    double median_iteration() const
    {
        std::vector<double> sorted = iteration_seconds_;
        std::sort(sorted.begin(), sorted.end());
        return sorted.empty() ? 0.0 : sorted[sorted.size() / 2];
    }

private:
    using Deformation =
        CGAL::Surface_mesh_deformation<Mesh, CGAL::Default, CGAL::Default, kTag>;
    Mesh mesh_;
    Points positions_;
    std::unique_ptr<Deformation> deformation_;
    double preprocess_seconds_ = 0.0, seconds_ = 0.0;
    std::vector<double> iteration_seconds_;
};

/// Why a run ended.
struct End
{
    double movement = 0.0; ///< of the last iteration, of the diagonal
    bool is_converged = false;
};

/// Iterates until no vertex moves by \p tolerance of the diagonal, or out of time;
/// \p after sees the peer after each iteration.
template <class Peer, class After>
End run(Peer& peer, double diagonal, double tolerance, double max_seconds,
        const After& after)
{
    End end;
    while (!end.is_converged && (peer.iterations() == 0 || peer.seconds() < max_seconds))
    {
        end.movement = peer.iterate() / diagonal;
        end.is_converged = end.movement < tolerance;
        after(end);
    }
    return end;
}

double volume(const cellwarp::core::Shape& shape, const Points& positions)
{
    double six_volumes = 0.0;
    for (const cellwarp::core::Triangle& t : shape.triangles)
        six_volumes += positions[t[0]].dot(positions[t[1]].cross(positions[t[2]]));
    return six_volumes / 6.0;
}

/// How far fixed and moved vertices are from where they belong [model unit].
double handle_residual(const Scene& scene, const Points& positions)
{
    double residual = 0.0;
    for (const std::uint32_t i : scene.fixed)
        residual = std::max(residual, (positions[i] - scene.shape.samples[i]).norm());
    for (const std::uint32_t i : scene.moved)
        residual = std::max(
            residual, (positions[i] - scene.motion * scene.shape.samples[i]).norm());
    return residual;
}

struct Distance
{
    double largest = 0.0, rms = 0.0;
};

Distance distance(const Points& a, const Points& b)
{
    Distance distance;
    for (std::size_t i = 0; i < a.size(); ++i)
    {
        const double squared = (a[i] - b[i]).squaredNorm();
        distance.largest = std::max(distance.largest, squared);
        distance.rms += squared;
    }
    return {std::sqrt(distance.largest),
            std::sqrt(distance.rms / static_cast<double>(a.size()))};
}

/// How far the iterations still lead, if their movements go on to shrink by the same
/// factor as in the last hundred, of the diagonal; all of it if they do not shrink.
double remaining(const std::vector<double>& movements)
{
    constexpr std::size_t kBack = 100;
    if (movements.size() <= kBack)
        return movements.back();
    const double before = movements[movements.size() - 1 - kBack];
    const double factor = std::pow(movements.back() / before, 1.0 / kBack);
    return factor < 1.0 ? movements.back() * factor / (1.0 - factor) : 1.0;
}

struct Flags
{
    std::string scene;
    std::string energy = "spokes-and-rims";
    double tolerance = 1e-4;
    double max_seconds = 60.0;
    bool has_curve = false;
    double reference_seconds = 300.0;
};

/// Distance from the converged result against seconds: one run to find that result, one
/// to compare with it. Points are a tenth of the iterations so far apart.
template <class Peer>
Json curve(const Scene& scene, const Flags& flags)
{
    constexpr double kReferenceTolerance = 1e-8;
    const double diagonal = cellwarp::core::bench::diagonal(scene.shape);
    Peer reference(scene);
    std::vector<double> movements;
    const End end = run(reference, diagonal, kReferenceTolerance, flags.reference_seconds,
                        [&](const End& now) { movements.push_back(now.movement); });
    Json points = Json::array();
    Peer peer(scene);
    std::size_t next = 1;
    run(peer, diagonal, kReferenceTolerance, flags.max_seconds,
        [&](const End& now)
        {
            if (peer.iterations() < next || peer.iterations() >= reference.iterations())
                return;
            next = peer.iterations() + 1 + peer.iterations() / 10;
            const Distance error = distance(peer.positions(), reference.positions());
            points.push_back({{"iteration", peer.iterations()},
                              {"seconds", peer.seconds()},
                              {"movement", now.movement},
                              {"largest", error.largest / diagonal},
                              {"rms", error.rms / diagonal}});
        });
    return {{"reference",
             {{"tolerance", kReferenceTolerance},
              {"is_converged", end.is_converged},
              {"movement", end.movement},
              {"remaining", remaining(movements)},
              {"iterations", reference.iterations()},
              {"seconds", reference.seconds()}}},
            {"points", points}};
}

double peak_rss_mb()
{
    struct rusage usage
    {
    };
    ::getrusage(RUSAGE_SELF, &usage);
    return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

template <class Peer>
Json measure(const Flags& flags)
{
    const Scene scene = cellwarp::core::bench::make_scene(flags.scene);
    Peer peer(scene);
    const End end = run(peer, cellwarp::core::bench::diagonal(scene.shape),
                        flags.tolerance, flags.max_seconds, [](const End&) {});
    Json json = {{"peer", "CGAL " CGAL_VERSION_STR " Surface_mesh_deformation"},
                 {"energy", flags.energy},
                 {"scene", scene.name},
                 {"vertices", scene.shape.samples.size()},
                 {"triangles", scene.shape.triangles.size()},
                 {"fixed", scene.fixed.size()},
                 {"moved", scene.moved.size()},
                 {"tolerance", flags.tolerance},
                 {"max_seconds", flags.max_seconds},
                 {"preprocess_seconds", peer.preprocess_seconds()},
                 {"iteration_seconds", peer.median_iteration()},
                 {"iterations", peer.iterations()},
                 {"seconds", peer.seconds()},
                 {"is_converged", end.is_converged},
                 {"movement", end.movement},
                 {"handle_residual", handle_residual(scene, peer.positions())},
                 {"volume",
                  {{"before", volume(scene.shape, scene.shape.samples)},
                   {"after", volume(scene.shape, peer.positions())}}},
                 {"peak_rss_mb", peak_rss_mb()}};
    if (flags.has_curve)
        json["curve"] = curve<Peer>(scene, flags);
    return json;
}

} // namespace

int main(int argc, char** argv)
{
    Flags flags;
    CLI::App app("CGAL's as-rigid-as-possible deformation of a benchmark scene");
    app.add_option("SCENE", flags.scene, "name, as bench_scenes lists them")->required();
    app.add_option("--energy", flags.energy, "spokes-and-rims or arap")
        ->check(CLI::IsMember({"spokes-and-rims", "arap"}))
        ->capture_default_str();
    app.add_option("--tolerance", flags.tolerance,
                   "stop when no vertex moves farther in an iteration, of the diagonal")
        ->capture_default_str();
    app.add_option("--max-seconds", flags.max_seconds,
                   "stop the run, or the curve, there")
        ->capture_default_str();
    app.add_flag("--curve", flags.has_curve,
                 "also the distance from the converged result against seconds");
    app.add_option("--reference-seconds", flags.reference_seconds,
                   "what finding the converged result may take")
        ->capture_default_str();
    CLI11_PARSE(app, argc, argv);
    try
    {
        const Json json = flags.energy == "arap"
                              ? measure<Peer<CGAL::ORIGINAL_ARAP>>(flags)
                              : measure<Peer<CGAL::SPOKES_AND_RIMS>>(flags);
        fmt::print("{}\n", json.dump(2));
    }
    catch (const std::exception& error)
    {
        fmt::print(stderr, "error: {}\n", error.what());
        return 1;
    }
}
