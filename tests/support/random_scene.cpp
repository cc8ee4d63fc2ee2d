// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/random_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <numbers>
#include <random>

#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

namespace
{

using Eigen::Vector3d;

/// The way one sample goes with its region.
struct Rigid
{
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
    Vector3d t = Vector3d::Zero();
    Vector3d operator()(const Vector3d& x) const { return R * x + t; }
};

struct Mesh
{
    std::vector<Vector3d> samples;
    std::vector<std::array<std::size_t, 3>> faces;
};

std::string text_of(const Vector3d& v)
{
    char text[100];
    std::snprintf(text, sizeof(text), " %.17g %.17g %.17g", v.x(), v.y(), v.z());
    return text;
}
std::string text_of(double value)
{
    char text[40];
    std::snprintf(text, sizeof(text), " %.17g", value);
    return text;
}

class Maker
{
public:
    explicit Maker(std::uint32_t seed, bool is_small) : rng_(seed), is_small_(is_small) {}
    RandomScene operator()();

private:
    double number(double low, double high) { return random_number(rng_, low, high); }
    int integer(int low, int high) // both included
    {
        return low + static_cast<int>(rng_() % static_cast<unsigned>(high - low + 1));
    }
    bool happens(double share) { return number(0.0, 1.0) < share; }
    double power(double low, double high) { return std::pow(10.0, number(low, high)); }
    Vector3d direction()
    {
        if (happens(0.5))
            return (happens(0.5) ? 1.0 : -1.0) * Vector3d::Unit(integer(0, 2));
        return random_vector(rng_, 1.0).normalized();
    }

    Mesh box();
    Mesh grid_surface(int nu, int nv, bool closed_u, bool closed_v, auto&& at);
    Mesh tube();
    Mesh torus();
    Mesh sheet();
    Mesh one_shape();
    void spoil(Mesh& mesh);
    void place(Mesh& mesh);
    void make_model();
    std::string selector();
    bool add_region(const std::string& role, const std::string& name);
    Rigid add_move(const std::string& name, const std::vector<std::size_t>& held,
                   std::string& text);
    void make_handles();
    void make_arguments();

    std::mt19937 rng_;
    bool is_small_;
    RandomScene scene_;
    Vector3d low_, high_;
    std::vector<std::size_t> held_; ///< by the selector made last, with a margin
    struct Region
    {
        std::string name, role;
        std::vector<std::size_t> held;
    };
    std::vector<Region> regions_;
};

Mesh mesh_of(const Shape& shape)
{
    Mesh mesh;
    mesh.samples = shape.samples;
    for (const auto& t : shape.triangles)
        mesh.faces.push_back({t[0], t[1], t[2]});
    return mesh;
}

Mesh Maker::box()
{
    const Vector3d size(power(-1.0, 0.5), power(-0.7, 0.5), power(-0.3, 0.7));
    return mesh_of(box_shape(Vector3d::Zero(), size, integer(1, 5)));
}

Mesh Maker::grid_surface(int nu, int nv, bool closed_u, bool closed_v, auto&& at)
{
    Mesh mesh;
    const int rows = closed_u ? nu : nu + 1, columns = closed_v ? nv : nv + 1;
    for (int u = 0; u < rows; ++u)
        for (int v = 0; v < columns; ++v)
            mesh.samples.push_back(
                at(static_cast<double>(u) / nu, static_cast<double>(v) / nv));
    const auto index = [&](int u, int v)
    { return idx((u % rows) * columns + v % columns); };
    for (int u = 0; u < nu; ++u)
        for (int v = 0; v < nv; ++v)
        {
            mesh.faces.push_back({index(u, v), index(u + 1, v), index(u + 1, v + 1)});
            mesh.faces.push_back({index(u, v), index(u + 1, v + 1), index(u, v + 1)});
        }
    return mesh;
}

constexpr double kRound = 2.0 * std::numbers::pi;

Mesh Maker::tube()
{
    const double radius = power(-1.3, 0.0), length = power(0.0, 0.7);
    return grid_surface(integer(2, 12), integer(3, 12), false, true,
                        [&](double u, double v)
                        {
                            return Vector3d(radius * std::cos(kRound * v),
                                            radius * std::sin(kRound * v), length * u);
                        });
}

Mesh Maker::torus()
{
    const double radius = number(0.1, 0.6);
    return grid_surface(integer(6, 20), integer(4, 10), true, true,
                        [&](double u, double v)
                        {
                            const double r = 1.0 + radius * std::cos(kRound * v);
                            return Vector3d(r * std::cos(kRound * u),
                                            r * std::sin(kRound * u),
                                            radius * std::sin(kRound * v));
                        });
}

Mesh Maker::sheet()
{
    const double length = power(0.0, 0.6), height = happens(0.5) ? 0.0 : number(0.0, 0.5);
    return grid_surface(
        integer(2, 10), integer(2, 10), false, false,
        [&](double u, double v)
        { return Vector3d(length * u, v, height * std::sin(kRound * u) * (1 - v)); });
}

Mesh Maker::one_shape()
{
    switch (integer(0, 4))
    {
    case 0:
        return tube();
    case 1:
        return torus();
    case 2:
        return sheet();
    case 3:
        return mesh_of(happens(0.5) ? l_prism() : comb());
    default:
        return box();
    }
}

/// Degenerate and duplicate faces, duplicate samples, holes.
void Maker::spoil(Mesh& mesh)
{
    if (mesh.faces.empty())
        return;
    const auto any_face = [&] { return rng_() % mesh.faces.size(); };
    const auto any_sample = [&] { return rng_() % mesh.samples.size(); };
    for (int count = integer(1, 6); count > 0; --count)
        switch (integer(0, 4))
        {
        case 0:
            mesh.faces.push_back(mesh.faces[any_face()]);
            break;
        case 1:
        {
            const std::size_t one = any_sample();
            mesh.faces.push_back({one, one, any_sample()});
            break;
        }
        case 2:
            mesh.samples.push_back(mesh.samples[any_sample()]);
            break;
        case 3:
            mesh.faces.erase(mesh.faces.begin() + static_cast<long>(any_face()));
            if (mesh.faces.empty())
                return;
            break;
        default:
            std::swap(mesh.faces[any_face()][0], mesh.faces[any_face()][1]);
            break;
        }
}

/// Anywhere, turned, of any size.
void Maker::place(Mesh& mesh)
{
    const Eigen::Matrix3d R =
        happens(0.5) ? Eigen::Matrix3d::Identity() : random_rotation(rng_);
    const double scale = happens(0.15)  ? power(-20.0, 20.0)
                         : happens(0.3) ? power(-3.0, 3.0)
                                        : 1.0;
    const Vector3d shift =
        happens(0.3) ? random_vector(rng_, power(0.0, 3.0)) : Vector3d::Zero();
    const bool is_mirrored = happens(0.2);
    for (Vector3d& x : mesh.samples)
    {
        if (is_mirrored)
            x.x() = -x.x();
        x = scale * (R * x + shift);
    }
}

void Maker::make_model()
{
    Mesh mesh = one_shape();
    for (int more = happens(0.3) ? integer(1, 3) : 0; more > 0; --more)
    {
        Mesh other = one_shape();
        const Vector3d apart = random_vector(rng_, happens(0.5) ? 2.0 : 0.5);
        const std::size_t first = mesh.samples.size();
        for (const Vector3d& x : other.samples)
            mesh.samples.push_back(x + apart);
        for (const auto& f : other.faces)
            mesh.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
    }
    if (happens(0.25))
        spoil(mesh);
    const double kind = number(0.0, 1.0);
    if (kind < 0.2) // a cloud, on the surface or in a flat or full box
    {
        const int count = integer(20, is_small_ ? 150 : 1500);
        if (happens(0.6))
        {
            Shape shape;
            shape.samples = mesh.samples;
            for (const auto& f : mesh.faces)
                shape.triangles.push_back({static_cast<std::uint32_t>(f[0]),
                                           static_cast<std::uint32_t>(f[1]),
                                           static_cast<std::uint32_t>(f[2])});
            mesh.samples = random_points(shape, count, rng_());
        }
        else
        {
            const Vector3d size(1.0, power(-1.5, 0.0), power(-2.0, 0.0));
            mesh.samples.clear();
            for (int i = 0; i < count; ++i)
                mesh.samples.push_back(
                    Vector3d(number(0.0, 1.0), number(0.0, 1.0), number(0.0, 1.0))
                        .cwiseProduct(size));
        }
        mesh.faces.clear();
        if (happens(0.05))
            mesh.samples.push_back(mesh.samples[0] + random_vector(rng_, 500.0));
    }
    else if (kind < 0.35) // a soup: each face its own corners, some missing
    {
        Mesh soup;
        const double kept = happens(0.5) ? 1.0 : number(0.5, 1.0);
        for (const auto& f : mesh.faces)
        {
            if (!soup.faces.empty() && !happens(kept))
                continue;
            const std::size_t first = soup.samples.size();
            for (const std::size_t corner : f)
                soup.samples.push_back(mesh.samples[corner]);
            soup.faces.push_back({first, first + 1, first + 2});
        }
        mesh = std::move(soup);
    }
    place(mesh);
    low_ = high_ = mesh.samples.front();
    for (const Vector3d& x : mesh.samples)
    {
        low_ = low_.cwiseMin(x);
        high_ = high_.cwiseMax(x);
    }
    scene_.diagonal = (high_ - low_).stableNorm();
    scene_.samples = mesh.samples;
    const bool is_cloud = mesh.faces.empty();
    scene_.model_name = is_cloud ? "model.xyz" : "model.obj";
    for (const Vector3d& x : mesh.samples)
        scene_.model_text += (is_cloud ? "" : "v") + text_of(x) + "\n";
    for (const auto& f : mesh.faces)
        scene_.model_text += "f " + std::to_string(f[0] + 1) + " " +
                             std::to_string(f[1] + 1) + " " + std::to_string(f[2] + 1) +
                             "\n";
}

/// A selector with the samples that it surely holds, whatever the rounding.
std::string Maker::selector()
{
    const double size = scene_.diagonal, hair = 1e-9 * size;
    held_.clear();
    const auto hold = [&](auto&& is_inside)
    {
        for (std::size_t i = 0; i < scene_.samples.size(); ++i)
            if (is_inside(scene_.samples[i]))
                held_.push_back(i);
    };
    const Vector3d centre = happens(0.7) ? scene_.samples[rng_() % scene_.samples.size()]
                                         : Vector3d(low_ + 0.5 * (high_ - low_));
    switch (integer(0, 5))
    {
    case 0:
    {
        const Vector3d half(size * number(0.02, 0.4), size * number(0.02, 0.4),
                            size * number(0.02, 0.4));
        hold([&](const Vector3d& x)
             { return ((x - centre).cwiseAbs().array() < half.array() - hair).all(); });
        return "box" + text_of(Vector3d(centre - half)) +
               text_of(Vector3d(centre + half));
    }
    case 1:
    {
        const double radius = size * number(0.001, 0.35);
        hold([&](const Vector3d& x)
             { return (x - centre).stableNorm() < radius - hair; });
        return "sphere" + text_of(centre) + text_of(radius);
    }
    case 2:
    {
        const Vector3d along = size * number(0.05, 0.5) * direction();
        const double radius = size * number(0.02, 0.2);
        hold(
            [&](const Vector3d& x)
            {
                const double share =
                    std::clamp((x - centre).dot(along) / along.dot(along), 0.0, 1.0);
                return (x - centre - share * along).stableNorm() < radius - hair;
            });
        return "capsule" + text_of(centre) + text_of(Vector3d(centre + along)) +
               text_of(radius);
    }
    case 3:
    {
        const std::size_t first = rng_() % scene_.samples.size();
        const std::size_t last = std::min(scene_.samples.size() - 1, first + rng_() % 30);
        for (std::size_t i = first; i <= last; ++i)
            held_.push_back(i);
        return "indices " + std::to_string(first) + "-" + std::to_string(last);
    }
    default:
    {
        const Vector3d n = direction();
        const int axis = static_cast<int>(rng_() % 2);
        const Vector3d corner = low_ + number(0.02, 0.35) * (high_ - low_);
        const Vector3d other = high_ - number(0.02, 0.35) * (high_ - low_);
        const double d = n.dot(axis == 0 ? corner : other);
        const double far =
            std::max(low_.cwiseAbs().maxCoeff(), high_.cwiseAbs().maxCoeff());
        hold([&](const Vector3d& x) { return n.dot(x) > d + 1e-9 * far; });
        return "halfspace" + text_of(n) + text_of(d);
    }
    }
}

bool Maker::add_region(const std::string& role, const std::string& name)
{
    const std::string text = selector();
    Region region{name, role, held_};
    // A sample in two regions of different motion is an error, and known to be one:
    // mostly the later region is left out.
    const bool overlaps = std::any_of(
        regions_.begin(), regions_.end(),
        [&](const Region& other)
        {
            return role != "stiff" && other.role != "stiff" &&
                   std::any_of(region.held.begin(), region.held.end(),
                               [&](std::size_t i) {
                                   return std::binary_search(other.held.begin(),
                                                             other.held.end(), i);
                               });
        });
    if ((overlaps || region.held.empty()) && !happens(0.05))
        return false;
    scene_.handles_text += role + " " + name + " " + text;
    if (role == "stiff")
        scene_.handles_text +=
            std::string(text[0] == 'i' ? " factor" : "") + text_of(power(-3.0, 6.0));
    scene_.handles_text += "\n";
    regions_.push_back(std::move(region));
    return true;
}

Rigid Maker::add_move(const std::string& name, const std::vector<std::size_t>& held,
                      std::string& text)
{
    const Vector3d& one = scene_.samples[held.front()];
    const double far = happens(0.05) ? power(0.0, 3.0) : number(0.0, 0.5);
    const Vector3d shift = far * scene_.diagonal * direction();
    text += "move " + name;
    Rigid motion;
    const auto turn = [&](const Vector3d& axis, double degrees, const Vector3d& about)
    {
        const Eigen::Matrix3d R =
            Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, axis)
                .toRotationMatrix();
        motion = {R * motion.R, R * motion.t + about - R * about};
    };
    const auto rotate = [&]
    {
        const Vector3d axis = direction();
        const double degrees = happens(0.1) ? number(-720.0, 720.0) : number(-120, 120);
        const Vector3d about = scene_.samples[rng_() % scene_.samples.size()];
        text += " rotate" + text_of(axis) + text_of(degrees) + " about" + text_of(about);
        turn(axis, degrees, about);
    };
    const auto translate = [&]
    {
        text += " translate" + text_of(shift);
        motion.t += shift;
    };
    switch (integer(0, 3))
    {
    case 0:
        translate();
        break;
    case 1:
        rotate();
        break;
    case 2:
        rotate();
        translate();
        break;
    default:
    {
        const Eigen::Matrix3d R = random_rotation(rng_);
        motion = {R, one - R * one + shift};
        text += " matrix";
        for (int k = 0; k < 3; ++k)
            text += text_of(Vector3d(motion.R.row(k))) + text_of(motion.t[k]);
        text += " 0 0 0 1";
    }
    }
    text += "\n";
    return motion;
}

void Maker::make_handles()
{
    scene_.handles_text = "cellwarp-handles 1\n";
    const auto add_some = [&](const std::string& role, int count)
    {
        for (int i = 0; i < count; ++i)
            for (int tries = 0; tries < 10; ++tries)
                if (add_region(role, role + std::to_string(i)))
                    break;
    };
    add_some("fixed", happens(0.9) ? integer(1, 2) : 0);
    add_some("handle", happens(0.95) ? integer(1, 3) : 0);
    add_some("pin", happens(0.2) ? integer(1, 2) : 0);
    add_some("stiff", happens(0.15) ? 1 : 0);
    scene_.ends.resize(regions_.size());
    std::vector<Rigid> motions(regions_.size());
    const int frames = integer(1, is_small_ ? 2 : 3);
    for (int frame = 1; frame <= frames; ++frame)
    {
        scene_.handles_text += "frame " + std::to_string(frame) + "\n";
        for (std::size_t r = 0; r < regions_.size(); ++r)
        {
            const Region& region = regions_[r];
            if (region.held.empty() || !happens(0.8))
                continue;
            if (region.role == "handle")
                motions[r] = add_move(region.name, region.held, scene_.handles_text);
        }
    }
    for (std::size_t r = 0; r < regions_.size(); ++r)
        if (regions_[r].role == "fixed" || regions_[r].role == "handle")
            for (const std::size_t i : regions_[r].held)
            {
                const Vector3d place = motions[r](scene_.samples[i]);
                scene_.ends[r].push_back({i, place});
                scene_.travel =
                    std::max(scene_.travel,
                             (place - scene_.samples[i]).stableNorm() / scene_.diagonal);
            }
}

void Maker::make_arguments()
{
    const auto add = [&](const std::string& name, const std::string& value)
    {
        scene_.arguments.push_back(name);
        if (!value.empty())
            scene_.arguments.push_back(value);
    };
    add("--across", std::to_string(integer(2, is_small_ ? 5 : happens(0.1) ? 16 : 7)));
    if (happens(0.5))
        add("--max-depth", std::to_string(integer(0, 2)));
    if (happens(0.3))
        add("--threshold", text_of(power(-5.0, -1.0)).substr(1));
    if (happens(0.2))
        add("--fill", "shell");
    if (happens(0.1))
        add("--thickness", text_of(power(-3.0, -1.0)).substr(1));
    if (is_small_)
        add("--gap", text_of(power(-1.0, -0.6)).substr(1));
    else if (happens(0.1))
        add("--gap", text_of(power(-1.9, -1.0)).substr(1));
    if (happens(0.1))
        add("--energy", "botsch07");
    if (happens(0.1))
        add("--preview", "");
    if (happens(0.1))
        add("--tight", "");
    if (happens(0.15))
        add("--solver", "gauss-newton");
    scene_.is_limited = happens(0.1);
    if (scene_.is_limited)
        add("--max-iterations", std::to_string(integer(0, 30)));
    else if (is_small_)
        add("--max-iterations", "60");
    const int most = is_small_ ? 100 : 2000;
    add("--max-cells", std::to_string(happens(0.1) ? integer(1, 400) : most));
    add("--threads", std::to_string(integer(1, 2)));
}

RandomScene Maker::operator()()
{
    make_model();
    make_handles();
    make_arguments();
    return std::move(scene_);
}

} // namespace

std::string RandomScene::describe() const
{
    std::string text = model_name + ", " + std::to_string(samples.size()) + " samples;";
    for (const std::string& argument : arguments)
        text += " " + argument;
    return text + "\n" + handles_text;
}

std::string fault_of_samples(const RandomScene& scene,
                             const std::vector<Vector3d>& samples)
{
    // Where a sample may end beside its target: of the larger of diagonal and travel.
    constexpr double kPlace = 2e-9;
    if (samples.size() != scene.samples.size())
        return "lost samples";
    double farthest = 0.0;
    for (const Vector3d& x : scene.samples)
        farthest = std::max(farthest, x.stableNorm());
    const double size = scene.diagonal * std::max(1.0, scene.travel);
    for (const Vector3d& x : samples)
        if (!x.allFinite())
            return "samples nowhere";
    double worst = 0.0;
    for (const std::vector<RandomScene::Target>& ends : scene.ends)
        for (const RandomScene::Target& end : ends)
            worst = std::max(worst, (samples[end.sample] - end.place).stableNorm());
    return worst <= kPlace * size + 1e-15 * farthest
               ? ""
               : "handle samples in the wrong place, by " +
                     std::to_string(worst / scene.diagonal) + " diagonals";
}

std::uint32_t number_of_scenes(const char* variable, std::uint32_t otherwise)
{
    const char* const text = std::getenv(variable);
    return text ? static_cast<std::uint32_t>(std::strtoul(text, nullptr, 10)) : otherwise;
}

std::string kept_copy(const Folder& folder, std::uint32_t seed)
{
    const std::filesystem::path to =
        std::filesystem::temp_directory_path() /
        ("scene-" + std::to_string(seed) + "-" +
         std::filesystem::path(folder.path()).filename().string());
    std::filesystem::remove_all(to);
    std::filesystem::copy(folder.path(), to);
    return to.string();
}

RandomScene random_scene(std::uint32_t seed)
{
    return Maker(seed, false)();
}

RandomScene small_random_scene(std::uint32_t seed)
{
    return Maker(seed, true)();
}

} // namespace cellwarp::core::support
