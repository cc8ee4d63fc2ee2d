// SPDX-License-Identifier: GPL-3.0-or-later
// Arbitrary bytes as a scene of rods. First byte 0: the rest is the file's text. Else
// each byte chooses: curve, section, holds, loads, rule and step; what it makes is built
// and taken a few steps on. It ends in an error that names the key, or goes on with
// finite places and a stop reason.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "io/base/error.h"
#include "io/scene/scene_file.h"
#include "library/time/key_motion.h"
#include "library/time/object_simulation.h"

using namespace cellwarp::core;

namespace
{

void require(bool condition)
{
    if (!condition)
        std::abort();
}

/// How many balls the contacts of a scene's rods have, roughly: two for each radius of
/// the way from point to point.
double balls_about(const RodScene& scene)
{
    double balls = 0.0;
    for (const RodStatement& rod : scene.rods)
    {
        const double radius = rod.contact_radius.value_or(
            rod.line.radii.empty() ? 1.0 : rod.line.radii.front());
        const std::vector<Eigen::Vector3d>& points = rod.line.points;
        for (std::size_t k = 1; k < points.size(); ++k)
            balls += 2.0 * (points[k] - points[k - 1]).stableNorm() / radius;
    }
    return balls;
}

/// Small enough for hundreds of runs a second.
bool is_small(const RodScene& scene)
{
    double points = 0.0;
    for (const RodStatement& rod : scene.rods)
        points += static_cast<double>(rod.line.points.size()) *
                  static_cast<double>(
                      rod.line.form == SplineLine::Form::Through ? rod.line.spans : 1);
    for (const NetStatement& net : scene.nets)
        points += static_cast<double>(net.points.size() + net.springs.size());
    points += static_cast<double>(scene.bodies.size() + scene.joints.size());
    for (const SheetStatement& sheet : scene.sheets)
    {
        double controls = 1.0;
        for (const int count : sheet.counts)
            controls *= count;
        points += controls / 8.0;
    }
    return points <= 12.0 && (!scene.contact || balls_about(scene) <= 500.0);
}

void run(const RodScene& scene)
{
    // Sanitizers make an iteration some 60 times as slow: a step of many is the last.
    constexpr int kSteps = 2, kMany = 100;
    ObjectSimulation simulation(scene);
    SimulationReport report;
    for (int k = 0; k < kSteps && simulation.steps_done() < simulation.num_steps() &&
                    report.is_converged && report.iterations <= kMany;
         ++k)
    {
        simulation.step();
        report = simulation.report();
        require(!report.stop.empty());
    }
    if (!report.is_converged)
        return;
    require(std::isfinite(report.kinetic) && std::isfinite(report.elastic) &&
            std::isfinite(report.gravity) && std::isfinite(report.violation));
    for (const SimulatedRod& rod : simulation.rods(9))
        for (const Eigen::Vector3d& p : rod.curve)
            require(p.allFinite());
    for (const Eigen::Vector3d& p : simulation.surface(3).samples)
        require(p.allFinite());
}

/// Bytes one by one, zeros behind the last.
class Choices
{
public:
    Choices(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
    int below(int count) { return (at_ < size_ ? data_[at_++] : 0) % count; }
    double share() { return below(256) / 255.0; }
    Triple place()
    {
        // Now and then the same place, or a far one.
        const double scale = below(16) == 0 ? 0.0 : below(16) == 1 ? 1e6 : 1.0;
        return {scale * share(), scale * share(), scale * share()};
    }

private:
    const std::uint8_t* data_;
    std::size_t size_, at_ = 0;
};

SlideStatement slide_of(Choices& choose)
{
    SlideStatement slide;
    if (choose.below(2) == 0)
        slide.start = choose.share();
    if (choose.below(3) == 0)
    {
        slide.range = {0.5 * choose.share(), 0.5 + 0.5 * choose.share()};
        slide.start.reset();
    }
    slide.leaves = choose.below(3) == 0;
    if (choose.below(2) == 0)
        slide.friction = {1.0, choose.share()};
    if (choose.below(4) == 0)
        slide.inertia = 10.0 * choose.share() - 1.0;
    if (choose.below(4) == 0)
        slide.apart = 0.1 * choose.share();
    return slide;
}

/// \p most: of the angle [degree].
RigidMove any_move(Choices& choose, const Eigen::Vector3d& axis, double most)
{
    RigidMove move;
    move.translation = vector_of(choose.place());
    move.axis = axis;
    move.degrees = most * choose.share();
    return move;
}

/// A body, a net of two points, and what joins them to the rod.
void add_joined(Choices& choose, RodScene& scene)
{
    BodyStatement& body = scene.bodies.emplace_back();
    body.name = "b";
    body.mass = choose.below(4) == 0 ? 1e6 : 0.1;
    body.inertia = {0.01, 0.01 + 0.01 * choose.share(), 0.01};
    body.place.translation = vector_of(choose.place());
    body.velocity = choose.below(3) == 0 ? choose.place() : Triple{};
    if (choose.below(3) == 0)
        body.keys = {{0.0, any_move(choose, {0, 1, 0}, 360.0)},
                     {0.01, any_move(choose, {1, 0, 1}, 90.0)}};
    NetStatement& net = scene.nets.emplace_back();
    net.name = "n";
    net.points = {choose.place(), choose.place()};
    net.masses = {0.1, 0.2};
    net.springs.push_back({{0, 1}, choose.below(2) == 0 ? 10.0 : 1e6});
    for (int k = choose.below(4); k > 0; --k)
    {
        JointStatement& joint = scene.joints.emplace_back();
        for (JointEnd& end : joint.ends)
        {
            end.kind = static_cast<JointEnd::Kind>(choose.below(3));
            end.at = choose.share();
            end.slides = end.kind == JointEnd::Kind::Rod && choose.below(2) == 0;
            end.node = static_cast<std::size_t>(choose.below(2));
        }
        const bool slides = joint.ends[0].slides || joint.ends[1].slides;
        const bool is_of_net = joint.ends[0].kind == JointEnd::Kind::Net ||
                               joint.ends[1].kind == JointEnd::Kind::Net;
        joint.has_distance = !slides && choose.below(3) == 0;
        joint.has_frame = !slides && !is_of_net && choose.below(2) == 0;
        joint.has_point = !joint.has_distance;
        joint.slide = slide_of(choose);
    }
}

/// Knots that come, cuts, what touches, a sheet.
void add_changes(Choices& choose, RodScene& scene)
{
    RodStatement& rod = scene.rods.front();
    if (choose.below(2) == 0)
        rod.refine = RefineStatement{0.5 * choose.share() + 0.01, 0.005, 1e-3, 0.05};
    for (int k = choose.below(3); k > 0; --k)
    {
        CutStatement& cut = rod.cuts.emplace_back();
        if (choose.below(2) == 0)
            cut.at = 0.001 + 0.998 * choose.share();
        else if (choose.below(2) == 0)
            cut.curvature = 10.0 * choose.share() + 1e-3;
        else
            cut.force = 10.0 * choose.share() + 1e-3;
    }
    if (choose.below(2) == 0)
    {
        scene.contact.emplace().friction = choose.below(2) * choose.share();
        rod.contact_radius = 0.02 + choose.share();
        ObstacleStatement& obstacle = scene.obstacles.emplace_back();
        if (choose.below(2) == 0)
            obstacle.plane = {choose.share(), 1.0, 0.0, choose.share()};
        else
            obstacle.sphere = {choose.share(), choose.share(), 0.0, 0.1 + choose.share()};
    }
    if (choose.below(3) == 0)
    {
        SheetStatement& sheet = scene.sheets.emplace_back();
        sheet.name = "s";
        sheet.corner = choose.place();
        sheet.sides = {choose.place(), choose.place()};
        sheet.degree = 1 + choose.below(3);
        sheet.counts = {static_cast<int>(sheet.degree) + 1 + choose.below(2),
                        static_cast<int>(sheet.degree) + 1};
        sheet.fixed = {{choose.share(), choose.share(), 0.0}};
        if (choose.below(2) == 0)
            sheet.over = {sheet.corner};
        JointStatement& joint = scene.joints.emplace_back();
        joint.ends[0].at = choose.share();
        joint.ends[1].kind = JointEnd::Kind::Sheet;
        joint.ends[1].point = {choose.share(), choose.share(), 0.0};
        joint.has_point = true;
    }
}

RodScene scene_of(Choices choose)
{
    static constexpr double kScales[] = {1.0, 1e-3, 1e3, 1e-9, 1e9, 1e15};
    static const char* const kSplines[] = {"nonuniform", "uniform", "catmull-rom",
                                           "bezier"};
    static const char* const kEnergies[] = {"exact", "continuous", "discrete"};
    static const char* const kRules[] = {"implicit-euler", "midpoint", "rk4", "static"};
    RodScene scene;
    scene.path = "x.json";
    RodStatement& rod = scene.rods.emplace_back();
    rod.name = "a";
    rod.line.form =
        choose.below(2) == 0 ? SplineLine::Form::Through : SplineLine::Form::Points;
    for (int k = choose.below(8); k >= 0; --k)
        rod.line.points.push_back(vector_of(choose.place()));
    rod.line.spans = 1 + choose.below(3);
    rod.line.degree = 2 + choose.below(6);
    rod.line.knots = kSplines[choose.below(4)];
    rod.line.is_closed = choose.below(3) == 0;
    rod.elasticity = kEnergies[choose.below(3)];
    rod.is_straight_at_rest = choose.below(2) == 0;
    rod.young = 1e6 * kScales[choose.below(6)];
    rod.density = 1e3 * kScales[choose.below(3)];
    rod.line.radii = {0.01 * kScales[choose.below(3)]};
    if (choose.below(4) == 0)
        rod.line.radii.push_back(0.02);
    rod.rest_twist = choose.below(4) == 0 ? 10.0 * choose.share() : 0.0;
    rod.link = rod.line.is_closed ? choose.below(4) : 0.0;
    for (int k = choose.below(3); k > 0; --k)
    {
        RodHold& hold = rod.holds.emplace_back();
        hold.at = choose.share();
        const int what = choose.below(16);
        hold.has_point = what & 1;
        hold.has_tangent = what & 2;
        hold.has_twist = what & 4;
        hold.has_curvature = what & 8;
        if (choose.below(3) == 0)
            hold.keys = {{0.0, any_move(choose, {0, 0, 1}, 90.0)},
                         {0.01, any_move(choose, {1, 0, 1}, 90.0)}};
    }
    for (int k = choose.below(3); k > 0; --k)
    {
        RodOn& on = rod.on.emplace_back();
        on.at = choose.share();
        on.kind = static_cast<RodOn::Kind>(choose.below(4));
        if (choose.below(3) == 0)
            on.slide = slide_of(choose);
        on.other = choose.share();
        if (on.kind == RodOn::Kind::Rod && choose.below(2) == 0)
            on.other_slide.emplace();
        on.point = choose.place();
        on.direction = {choose.share(), choose.share(), 1.0};
        on.offset = choose.share();
    }
    for (int k = choose.below(2); k > 0; --k)
        rod.loads.push_back({choose.share(), choose.place(), choose.place()});
    if (choose.below(2) == 0)
        add_joined(choose, scene);
    if (choose.below(2) == 0)
        add_changes(choose, scene);
    scene.integrator = kRules[choose.below(4)];
    scene.dt = 1e-3 * kScales[choose.below(3)];
    scene.duration = 3.0 * scene.dt;
    scene.viscosity = choose.below(2);
    return scene;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    if (size == 0)
        return 0;
    try
    {
        const std::string text(data + 1, data + size);
        const RodScene scene = data[0] == 0 ? parse_scene("x.json", text).time
                                            : scene_of(Choices(data + 1, size - 1));
        if (scene.has_objects() && is_small(scene))
            run(scene);
    }
    catch (const Error& error)
    {
        require(error.fault() == Fault::Malformed);
        require(std::string(error.what()).starts_with("x.json"));
    }
    return 0;
}
