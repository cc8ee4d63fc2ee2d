// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/object_simulation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "io/base/error.h"
#include "io/formats/face_triangles.h"
#include "io/formats/geometry_file.h"
#include "library/time/drawn_shapes.h"
#include "library/time/joined_flesh.h"
#include "library/time/key_motion.h"
#include "library/time/rod_part.h"
#include "octree/base/index.h"
#include "solver/contact/rod_contacts.h"
#include "solver/dynamics/implicit_stepper.h"
#include "solver/rods/rod_newton.h"
#include "solver/rods/rod_stepper.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

constexpr double kMostPartsOfFrame = 4096.0; ///< of a step
constexpr int kMostRounds = 100;             ///< of an equilibrium whose rods change

/// How near places of one rod that are joined may slide to each other, of its length.
constexpr double kOffItself = 0.02;

/// Directions tell of turns below 90 degrees alone: larger ones go in parts [degree].
int parts_of(double turn)
{
    constexpr double kPart = 30.0;
    return static_cast<int>(std::clamp(std::ceil(turn / kPart), 1.0, kMostPartsOfFrame));
}

} // namespace

/// Steps and forces are small beside the places of a scene far from the origin, and drown
/// in their rounding: everything is seen from one of its points.
Vector3d ObjectSimulation::origin_of(const RodScene& scene)
{
    if (scene.rods.empty())
        return !scene.sheets.empty()   ? vector_of(scene.sheets.front().corner)
               : !scene.bodies.empty() ? scene.bodies.front().place.translation
               : !scene.nets.empty()   ? vector_of(scene.nets.front().points.front())
                                       : Vector3d::Zero();
    return scene.rods.front().line.points.front();
}

struct ObjectSimulation::Parts
{
    std::vector<std::unique_ptr<ObjectInTime>> owned;
    /// All: rods, bodies, nets, sheets, and flesh that joints hold.
    std::vector<ObjectInTime*> objects;
    std::vector<RodPart*> rods;
    std::vector<Joint> joints;           ///< between objects of those numbers
    std::vector<std::string> joint_keys; ///< of each the key of the scene
    std::optional<RodContacts> contacts;
    std::vector<std::pair<PlaceOnRod, PlaceOnRod>> on_each_other; ///< joined places
    std::vector<Geometry> meshes;                                 ///< obstacles
    // What touched at the end of the last step.
    ContactReport touching;
    double touching_energy = 0.0;
    std::vector<std::vector<double>> touched; ///< parameters of each rod

    /// The number of the object at an end of a joint.
    std::size_t object_at(const JointEnd& end) const
    {
        std::size_t first = 0;
        while (objects[first]->kind() != end.kind)
            ++first;
        return first + end.index;
    }
};

/// What is joined.
struct ObjectSimulation::Group
{
    std::vector<ObjectInTime*> objects;
    std::vector<RodPart*> rods; ///< the first of the objects
    std::string name;
    double violation = 0.0;
    int parts = 1;                   ///< of a step, that explicit ones stay stable with
    std::optional<RodStepper> alone; ///< of one rod
    std::optional<ImplicitStepper> joined; ///< of all else
    Eigen::VectorXd multipliers;           ///< of an equilibrium of one rod
    std::vector<std::string> joint_keys;
    std::vector<int> first_of_joint; ///< objects
    std::vector<int> first_place;    ///< places in them
};

ObjectSimulation::~ObjectSimulation() = default;

ObjectSimulation::ObjectSimulation(const RodScene& scene, JoinedFlesh* flesh)
    : scene_(scene), flesh_(flesh), origin_(origin_of(scene)),
      parts_(std::make_unique<Parts>())
{
    Parts& parts = *parts_;
    for (std::size_t r = 0; r < scene_.rods.size(); ++r)
    {
        auto rod = std::make_unique<RodPart>(scene_, r, origin_);
        parts.rods.push_back(rod.get());
        parts.owned.push_back(std::move(rod));
    }
    for (std::size_t k = 0; k < scene_.bodies.size(); ++k)
        parts.owned.push_back(body_in_time(scene_, k, origin_));
    for (std::size_t k = 0; k < scene_.nets.size(); ++k)
        parts.owned.push_back(net_in_time(scene_, k, origin_));
    for (std::size_t k = 0; k < scene_.sheets.size(); ++k)
        parts.owned.push_back(sheet_in_time(scene_, k, origin_));
    for (const std::unique_ptr<ObjectInTime>& object : parts.owned)
        parts.objects.push_back(object.get());
    if (flesh_)
        parts.objects.push_back(flesh_);
    join();
    touch();
    for (RodPart* const rod : parts.rods)
    {
        rod->close_gaps();
        warnings_.insert(warnings_.end(), rod->warnings.begin(), rod->warnings.end());
    }
    group();
}

/// A place that slides towards another of the same rod would end on it: it stays on its
/// side, a little way off, and starts where the curve is nearest.
void ObjectSimulation::keep_off_itself(std::size_t rod, double at,
                                       SlideStatement& slide) const
{
    constexpr double kNear = 0.1; // of the length
    constexpr int kTries = 1000;
    const RodPart& part = *parts_->rods[rod];
    const bool is_closed = part.rod.basis().is_closed();
    const auto place = [&](double share)
    { return part.state.at(part.parameter(share)).place; };
    const auto apart = [&](double share)
    {
        const double off = std::abs(share - at);
        return is_closed ? std::min(off, 1.0 - off) : off;
    };
    if (!slide.start)
    {
        double least = std::numeric_limits<double>::infinity();
        for (int k = 0; k <= kTries; ++k)
        {
            const double share = double(k) / kTries;
            if (apart(share) < kNear || share < slide.range[0] || share > slide.range[1])
                continue;
            if (const double away = (place(share) - place(at)).norm(); away < least)
            {
                least = away;
                slide.start = share;
            }
        }
    }
    if (!slide.start)
        return;
    const bool is_whole = slide.range[0] == 0.0 && slide.range[1] == 1.0;
    if (is_closed && is_whole)
    {
        // Once around, from the place to itself.
        slide.range = {at + kOffItself, at + 1.0 - kOffItself};
        if (*slide.start < at)
            slide.start = *slide.start + 1.0;
    }
    else if (*slide.start < at)
        slide.range[1] =
            std::min(slide.range[1], std::max(at - kOffItself, *slide.start));
    else
        slide.range[0] =
            std::max(slide.range[0], std::min(at + kOffItself, *slide.start));
}

namespace
{

/// Two places that slide on each other start where the curves are nearest, unless the
/// statements say where.
void start_nearest(const RodPart& a, const RodPart& b, SlideStatement& of_a,
                   SlideStatement& of_b)
{
    constexpr int kTries = 300;
    const auto candidates = [](const SlideStatement& of)
    {
        if (of.start)
            return std::vector<double>{*of.start};
        std::vector<double> out;
        for (int k = 0; k <= kTries; ++k)
            if (const double share = double(k) / kTries;
                of.range[0] <= share && share <= of.range[1])
                out.push_back(share);
        return out;
    };
    // Places by length are searches along the rod: each once, not once a pair.
    const auto places = [](const RodPart& of, const std::vector<double>& shares)
    {
        std::vector<Vector3d> out;
        for (const double share : shares)
            out.push_back(of.state.at(of.parameter(share)).place);
        return out;
    };
    double least = std::numeric_limits<double>::infinity();
    const std::vector<double> shares_of_a = candidates(of_a),
                              shares_of_b = candidates(of_b);
    const std::vector<Vector3d> places_of_a = places(a, shares_of_a),
                                places_of_b = places(b, shares_of_b);
    for (size_t i = 0; i < shares_of_a.size(); ++i)
        for (size_t j = 0; j < shares_of_b.size(); ++j)
        {
            // Of a rod on itself not its neighbours.
            if (&a == &b && std::abs(shares_of_a[i] - shares_of_b[j]) < 0.1)
                continue;
            const double away = (places_of_a[i] - places_of_b[j]).norm();
            if (away < least)
            {
                least = away;
                of_a.start = shares_of_a[i];
                of_b.start = shares_of_b[j];
            }
        }
}

} // namespace

void ObjectSimulation::join()
{
    struct Both
    {
        JointEnd a, b;
        SlideStatement of_a, of_b;
        std::string where;
        bool has_point, has_frame, has_distance;
    };
    std::vector<Both> all;
    for (std::size_t r = 0; r < scene_.rods.size(); ++r)
        for (std::size_t k = 0; k < scene_.rods[r].on.size(); ++k)
        {
            const RodOn& on = scene_.rods[r].on[k];
            if (on.kind != RodOn::Kind::Rod)
                continue;
            Both both{};
            both.a.index = r;
            both.a.at = on.at;
            both.a.slides = on.slide.has_value();
            both.of_a = on.slide.value_or(SlideStatement());
            both.b.index = on.rod;
            both.b.at = on.other;
            both.b.slides = on.other_slide.has_value();
            both.of_b = on.other_slide.value_or(SlideStatement());
            both.where = fmt::format("rods[{}].on[{}]", r, k);
            both.has_point = true;
            all.push_back(both);
        }
    for (std::size_t k = 0; k < scene_.joints.size(); ++k)
    {
        const JointStatement& joint = scene_.joints[k];
        Both& both = all.emplace_back(Both{joint.ends[0], joint.ends[1], joint.slide,
                                           joint.slide, joint.field, joint.has_point,
                                           joint.has_frame, joint.has_distance});
        if (joint.ends[0].slides && joint.ends[1].slides)
            both.of_b.start = joint.other_start;
    }
    for (Both& both : all)
    {
        if (both.a.slides && both.b.slides)
            start_nearest(*parts_->rods[both.a.index], *parts_->rods[both.b.index],
                          both.of_a, both.of_b);
        if (both.a.index == both.b.index && both.a.kind == JointEnd::Kind::Rod &&
            both.b.kind == JointEnd::Kind::Rod && both.a.slides != both.b.slides)
            keep_off_itself(both.a.slides ? both.a.index : both.b.index,
                            both.a.slides ? both.b.at : both.a.at,
                            both.a.slides ? both.of_a : both.of_b);
        const std::size_t a = parts_->object_at(both.a), b = parts_->object_at(both.b);
        ObjectInTime &first = *parts_->objects[a], &second = *parts_->objects[b];
        const auto start_of =
            [&](const ObjectInTime& object, JointEnd end, const SlideStatement& slide)
        {
            end.at = end.slides ? slide.start.value_or(0.0) : end.at;
            return object.place_of(end, both.where);
        };
        const Vector3d of_a = start_of(first, both.a, both.of_a),
                       of_b = start_of(second, both.b, both.of_b);
        const int place_of_a = first.add_place(both.a, both.of_a, both.where, of_b);
        PlaceOnRod on_a;
        if (a < parts_->rods.size())
            on_a = parts_->rods[a]->last_end();
        const int place_of_b = second.add_place(both.b, both.of_b, both.where, of_a);
        if (both.a.slides && both.b.slides && a == b)
            parts_->rods[a]->keep_last_two_apart(kOffItself);
        if (a == b && a >= parts_->rods.size())
            throw malformed({scene_.path, 0, both.where},
                            "joins " + first.name() + " to itself");
        Joint joint;
        joint.object = {static_cast<int>(a), static_cast<int>(b)};
        joint.place = {place_of_a, place_of_b};
        if (std::max(a, b) < parts_->rods.size())
            parts_->on_each_other.emplace_back(on_a, parts_->rods[b]->last_end());
        const ArticulableObject &one = first.articulable(), &other = second.articulable();
        const double apart =
            (one.place(place_of_a, false) - other.place(place_of_b, false)).norm();
        if (both.has_point)
        {
            if (!both.a.slides && !both.b.slides &&
                apart > 1e-2 * std::max(one.size(), other.size()))
                warnings_.push_back(
                    at({scene_.path, 0, both.where},
                       fmt::format("starts {:.3g} m apart, the first step "
                                   "pulls it together",
                                   apart)));
            joint.kind = Joint::Kind::Point;
            parts_->joints.push_back(joint);
            parts_->joint_keys.push_back(both.where);
        }
        if (both.has_frame)
        {
            joint.kind = Joint::Kind::Frame;
            joint.frame =
                one.frame(place_of_a, false).transpose() * other.frame(place_of_b, false);
            parts_->joints.push_back(joint);
            parts_->joint_keys.push_back(both.where);
        }
        if (both.has_distance)
        {
            if (!(apart > 0.0))
                throw malformed({scene_.path, 0, both.where + ".what"},
                                "a distance of 0 has no direction: need point");
            joint.kind = Joint::Kind::Distance;
            joint.distance = apart;
            parts_->joints.push_back(joint);
            parts_->joint_keys.push_back(both.where);
        }
    }
}

namespace
{

/// Seen from \p origin.
std::unique_ptr<Obstacle> obstacle_of(const ObstacleStatement& of, const Vector3d& origin,
                                      std::vector<Geometry>& meshes)
{
    if (of.plane)
    {
        const Vector3d normal((*of.plane)[0], (*of.plane)[1], (*of.plane)[2]);
        return plane_obstacle(normal, (*of.plane)[3] - normal.dot(origin));
    }
    if (of.sphere)
        return sphere_obstacle(
            Vector3d((*of.sphere)[0], (*of.sphere)[1], (*of.sphere)[2]) - origin,
            (*of.sphere)[3]);
    const Geometry& mesh = meshes.emplace_back(read_geometry(of.mesh).geometry);
    std::vector<Vector3d> vertices = mesh.samples;
    for (Vector3d& vertex : vertices)
        vertex -= origin;
    std::vector<std::array<std::uint32_t, 3>> triangles = triangles_of(mesh);
    if (triangles.empty())
        throw malformed({of.mesh, 0, ""}, "has no faces to touch");
    return mesh_obstacle(std::move(vertices), std::move(triangles));
}

} // namespace

void ObjectSimulation::touch()
{
    if (!scene_.contact || parts_->rods.empty())
        return; // bodies and nets touch nothing
    const ContactStatement& of = *scene_.contact;
    RodContacts& contacts = parts_->contacts.emplace(ContactSettings{
        of.friction, of.damping, of.stiffness, of.between_rods, of.with_itself});
    for (std::size_t r = 0; r < parts_->rods.size(); ++r)
    {
        RodPart& rod = *parts_->rods[r];
        RodContacts::Member member{&rod.model, &rod.state, &rod.velocity,
                                   scene_.rods[r].contact_radius};
        if (scene_.integrator != "rk4")
        {
            member.object = &rod.articulable();
            member.number = r;
        }
        contacts.add_rod(member);
    }
    for (const auto& [a, b] : parts_->on_each_other)
        contacts.exempt(a, b);
    for (const ObstacleStatement& obstacle : scene_.obstacles)
        contacts.add_obstacle(obstacle_of(obstacle, origin_, parts_->meshes));
    contacts.start(scene_.dt);
    see_contacts();
    constexpr double kOverlap = 0.9; // of the thickness
    if (const ContactReport& start = parts_->touching;
        start.least && *start.least < kOverlap)
        warnings_.push_back(fmt::format("at the start things overlap by up to {:.3g} of "
                                        "their thickness: they push each other away",
                                        1.0 - *start.least));
}

void ObjectSimulation::group()
{
    const std::size_t count = parts_->objects.size();
    std::vector<std::size_t> group_of(count);
    std::iota(group_of.begin(), group_of.end(), std::size_t(0));
    // What may touch goes together; explicit steps take forces of the begin.
    const bool is_coupled = parts_->contacts && scene_.integrator != "rk4";
    if (is_coupled)
        std::fill_n(group_of.begin(), parts_->rods.size(), std::size_t(0));
    if (is_coupled && scene_.integrator == "midpoint")
        throw malformed({scene_.path, 0, "simulate.integrator"},
                        "what touches needs implicit-euler, rk4 or static");
    for (bool changes = true; changes;)
    {
        changes = false;
        for (const Joint& joint : parts_->joints)
        {
            std::size_t &a = group_of[idx(joint.object[0])],
                        &b = group_of[idx(joint.object[1])];
            changes = changes || a != b;
            a = b = std::min(a, b);
        }
    }
    for (std::size_t first = 0; first < count; ++first)
    {
        if (group_of[first] != first)
            continue;
        if (flesh_ && first == count - 1)
            continue; // no joint holds it
        Group& group = *groups_.emplace_back(std::make_unique<Group>());
        group.name = parts_->objects[first]->name();
        std::vector<std::size_t> members;
        std::map<int, int> number;
        for (std::size_t k = first; k < count; ++k)
            if (group_of[k] == first)
            {
                number[static_cast<int>(k)] = static_cast<int>(members.size());
                members.push_back(k);
                group.objects.push_back(parts_->objects[k]);
                if (k < parts_->rods.size())
                    group.rods.push_back(parts_->rods[k]);
            }
        std::vector<Joint> joints;
        for (std::size_t j = 0; j < parts_->joints.size(); ++j)
            if (Joint joint = parts_->joints[j]; number.contains(joint.object[0]))
            {
                group.joint_keys.push_back(parts_->joint_keys[j]);
                group.first_of_joint.push_back(joint.object[0]);
                group.first_place.push_back(joint.place[0]);
                for (int& object : joint.object)
                    object = number[object];
                joints.push_back(joint);
            }
        const bool has_contacts = is_coupled && first == 0;
        if (members.size() == 1 && joints.empty() && !group.rods.empty() && !has_contacts)
        {
            start_alone(group, first);
            continue;
        }
        if (scene_.integrator != "implicit-euler" && !is_static())
            throw malformed({scene_.path, 0, "simulate.integrator"},
                            "bodies, nets and what is joined need implicit-euler or "
                            "static");
        need_hold(group);
        std::vector<ArticulableObject*> objects;
        for (ObjectInTime* const object : group.objects)
            objects.push_back(&object->articulable());
        moves_flesh_ = moves_flesh_ || (flesh_ && members.back() == count - 1);
        group.joined.emplace(std::move(objects), std::move(joints), 1e-9,
                             has_contacts ? &*parts_->contacts : nullptr);
    }
}

/// An equilibrium needs something that holds.
void ObjectSimulation::need_hold(const Group& group) const
{
    const bool is_held =
        !is_static() || vector_of(scene_.gravity).isZero(0.0) ||
        !scene_.obstacles.empty() ||
        std::any_of(group.objects.begin(), group.objects.end(),
                    [](const ObjectInTime* object) { return object->is_held(); });
    if (!is_held)
        throw malformed({scene_.path, 0, "simulate.integrator"},
                        "nothing holds " + group.name +
                            " against its weight: there is no "
                            "equilibrium (need fixed, on, springs or a body with keys)");
}

void ObjectSimulation::start_alone(Group& group, std::size_t index)
{
    RodPart& rod = *group.rods.front();
    if (is_static() && !rod.has_equilibrium())
        throw malformed({scene_.path, 0, fmt::format("rods[{}]", index)},
                        "nothing holds it against its weight and loads: there is no "
                        "equilibrium (need fixed, on or springs)");
    if (const Eigen::VectorXd off = rod.model.violations(rod.state); off.size() > 0)
        group.violation = off.cwiseAbs().maxCoeff();
    const Integrator rule = scene_.integrator == "midpoint" ? Integrator::Midpoint
                            : scene_.integrator == "rk4"    ? Integrator::RungeKutta
                                                            : Integrator::ImplicitEuler;
    if (!rod.model.slides.empty() && rule == Integrator::Midpoint)
        throw malformed({scene_.path, 0, "simulate.integrator"},
                        "what slides needs implicit-euler, rk4 or static");
    if (!rod.model.gaps.empty() && rule == Integrator::RungeKutta)
        throw malformed({scene_.path, 0, "simulate.integrator"},
                        "what stays apart needs implicit-euler or static");
    group.alone.emplace(rod.model, rule);
    if (rule != Integrator::RungeKutta)
        return;
    if (const double limit = group.alone->largest_step(rod.state); scene_.dt > limit)
        throw malformed({scene_.path, 0, "simulate.dt"},
                        fmt::format("got {} s, rk4 is stable up to {:.4g} s with {} "
                                    "(implicit-euler and midpoint at any step)",
                                    scene_.dt, limit, rod.name()));
}

bool ObjectSimulation::is_static() const
{
    return scene_.integrator == "static";
}

std::int64_t ObjectSimulation::num_steps() const
{
    return scene_.num_steps();
}

std::int64_t ObjectSimulation::steps_a_frame() const
{
    return scene_.steps_a_frame();
}

std::int64_t ObjectSimulation::last_frame() const
{
    return scene_.last_frame();
}

void ObjectSimulation::next_frame(const std::function<void()>& watch)
{
    do
    {
        step();
        if (watch)
            watch();
    } while (done_ < num_steps() && done_ % steps_a_frame() != 0);
}

std::int64_t ObjectSimulation::steps_done() const
{
    return done_;
}

void ObjectSimulation::step()
{
    const double begin = static_cast<double>(done_) * scene_.dt;
    int parts = 1;
    if (parts_->contacts && scene_.integrator == "rk4")
    {
        constexpr int kMost = 256;
        parts = parts_->contacts->parts(scene_.dt);
        if (parts > kMost)
        {
            parts = kMost;
            StepReport report;
            report.stop = MotionStop::TooFast;
            take(*groups_.front(), report);
        }
    }
    for (int part = 0; part < parts; ++part)
        go_on(begin + scene_.dt * part / parts, scene_.dt / parts);
    ++done_;
}

void ObjectSimulation::go_on(double begin, double dt)
{
    if (parts_->contacts && scene_.integrator == "rk4")
    {
        const std::vector<Eigen::VectorXd> forces = parts_->contacts->forces(dt);
        for (std::size_t r = 0; r < forces.size(); ++r)
            parts_->rods[r]->model.pushed = forces[r];
    }
    for (const std::unique_ptr<Group>& group : groups_)
        if (is_static())
            settle(*group);
        else
            advance(*group, begin, dt);
    see_contacts();
    // Equilibria change what they need, again and again until nothing does.
    for (const std::unique_ptr<Group>& group : groups_)
        for (int round = 0;
             change(*group, begin + dt) && is_static() && round < kMostRounds; ++round)
        {
            settle(*group);
            see_contacts();
        }
}

/// What touches, before anything changes.
void ObjectSimulation::see_contacts()
{
    if (!parts_->contacts)
        return;
    parts_->touching = parts_->contacts->report();
    parts_->touching_energy = parts_->contacts->energy();
    parts_->touched.clear();
    for (std::size_t r = 0; r < parts_->rods.size(); ++r)
        parts_->touched.push_back(parts_->contacts->touched(r));
}

/// Knots and cuts after a step. False: nothing has changed.
bool ObjectSimulation::change(Group& group, double time)
{
    bool has_changed = false;
    for (RodPart* const rod : group.rods)
        if (rod->may_change())
        {
            std::span<const double> touched;
            for (std::size_t r = 0; r < parts_->touched.size(); ++r)
                if (parts_->rods[r] == rod)
                    touched = parts_->touched[r];
            has_changed = rod->change(time, touched) || has_changed;
        }
    if (has_changed && group.alone && scene_.integrator == "rk4")
        group.parts = explicit_parts(group);
    return has_changed;
}

/// Shorter spans are stiffer.
int ObjectSimulation::explicit_parts(const Group& group) const
{
    const double limit = group.alone->largest_step(group.rods.front()->state);
    return static_cast<int>(
        std::clamp(std::ceil(scene_.dt / limit), 1.0, kMostPartsOfFrame));
}

void ObjectSimulation::settle(Group& group)
{
    double largest = 0.0;
    for (const ObjectInTime* const object : group.objects)
        largest = std::max(largest, object->largest_turn());
    const int parts = parts_of(largest);
    StepReport last;
    for (int part = 1; part <= parts; ++part)
    {
        const double share = static_cast<double>(part) / parts;
        for (ObjectInTime* const object : group.objects)
            object->hold_at(scene_.duration, share);
        if (group.alone)
        {
            RodPart& rod = *group.rods.front();
            RodNewton newton(rod.model);
            const MotionReport report = newton.solve(rod.state);
            group.multipliers = newton.multipliers();
            last.stop = report.stop;
            last.iterations = report.iterations;
            last.violation = report.violation;
            if (!is_solved(report.stop) && !rod.model.slides.empty())
            {
                // What slides may have far to go, and may stop on the way.
                RodObject object(rod.model);
                object.bind(rod.state, rod.velocity);
                ImplicitStepper stepper({&object});
                last = stepper.settle();
                last.iterations += report.iterations;
                group.multipliers = stepper.solved().multipliers(0);
            }
        }
        else
            last = group.joined->settle();
        iterations_ += last.iterations;
    }
    take(group, last);
}

void ObjectSimulation::advance(Group& group, double begin, double dt)
{
    // In the first step all goes from rest to its first key.
    const auto share_at = [&](double time) { return std::min(time / scene_.dt, 1.0); };
    const double of_first = share_at(begin + dt) - share_at(begin);
    double largest = 0.0;
    for (const ObjectInTime* const object : group.objects)
        largest = std::max(largest, object->turned(begin, begin + dt) +
                                        of_first * object->first_turn());
    const int parts = std::max(parts_of(largest), group.parts);
    for (int part = 1; part <= parts; ++part)
    {
        const double from = begin + dt * (part - 1) / parts,
                     to = begin + dt * part / parts;
        for (ObjectInTime* const object : group.objects)
            object->lead({from, share_at(from)}, {to, share_at(to)}, dt / parts);
        RodPart* const rod = group.rods.empty() ? nullptr : group.rods.front();
        const StepReport report =
            group.alone ? group.alone->step(rod->state, rod->velocity, dt / parts)
                        : group.joined->step(dt / parts);
        iterations_ += report.iterations;
        take(group, report);
    }
}

void ObjectSimulation::take(Group& group, const StepReport& report)
{
    group.violation = report.violation;
    at_once_ += report.is_at_once;
    if (report.stop == MotionStop::Converged || stop_ != "converged")
        return;
    stop_ = stop_name(report.stop);
    stopped_ = group.name;
    stopped_violation_ = group.violation;
}

namespace
{

std::string problem_of(const SimulationReport& report)
{
    std::string what = report.stopped + ": " + report.stop;
    if (report.violation > 1e-9)
        what += fmt::format("; constraints are violated by up to {:.3g} (m, or rad)",
                            report.violation);
    if (report.at_once > 0)
        what += fmt::format("; {} steps were not cut in parts, since those before them "
                            "failed in all of theirs",
                            report.at_once);
    return what;
}

} // namespace

SimulationReport ObjectSimulation::report()
{
    SimulationReport out;
    out.time = is_static() ? 0.0 : static_cast<double>(done_) * scene_.dt;
    for (const ObjectInTime* const object : parts_->objects)
        object->add_to(out);
    for (const std::unique_ptr<Group>& group : groups_)
        out.violation = std::max(out.violation, group->violation);
    if (parts_->contacts)
    {
        out.contacts = parts_->touching.count;
        out.has_contacts = true;
        out.nearest = parts_->touching.least;
        out.touching = parts_->touching_energy;
    }
    out.iterations = std::exchange(iterations_, 0);
    out.at_once = std::exchange(at_once_, 0);
    out.stop = std::exchange(stop_, "converged");
    out.is_converged = out.stop == "converged";
    out.stopped = std::exchange(stopped_, "");
    if (!out.is_converged)
    {
        out.violation = std::max(out.violation, stopped_violation_);
        out.problems.push_back(problem_of(out));
    }
    return out;
}

SimulatedObjects ObjectSimulation::seen(JointEnd::Kind kind, int places) const
{
    SimulatedObjects out;
    for (const ObjectInTime* const object : parts_->objects)
        if (object->kind() == kind)
            object->add_to(places, out);
    return out;
}

std::vector<SimulatedForce> ObjectSimulation::forces() const
{
    std::vector<SimulatedForce> out;
    if (done_ == 0)
        return out;
    for (const std::unique_ptr<Group>& group : groups_)
    {
        for (std::size_t r = 0; r < group->rods.size(); ++r)
        {
            const RodPart& rod = *group->rods[r];
            const Eigen::VectorXd multipliers =
                group->joined ? group->joined->solved().multipliers(static_cast<int>(r))
                : is_static() ? group->multipliers
                              : group->alone->multipliers(rod.state, rod.velocity);
            for (const RodPart::HeldForce& one : rod.reactions(multipliers))
                out.push_back(
                    {one.key, one.at, one.wrench.force, one.wrench.couple, {}, {}});
        }
        if (!group->joined)
            continue;
        const std::vector<Wrench> wrenches = group->joined->solved().joint_wrenches();
        for (std::size_t j = 0; j < wrenches.size(); ++j)
        {
            const Vector3d at =
                origin_ +
                parts_->objects[idx(group->first_of_joint[j])]->articulable().place(
                    group->first_place[j], false);
            // A joint may be several, of places and of frames.
            const bool is_more =
                j > 0 && group->joint_keys[j] == group->joint_keys[j - 1];
            if (!is_more)
                out.push_back({group->joint_keys[j],
                               at,
                               Vector3d::Zero(),
                               Vector3d::Zero(),
                               {},
                               {}});
            out.back().force += wrenches[j].force;
            out.back().couple += wrenches[j].couple;
        }
    }
    if (!parts_->contacts)
        return out;
    const auto share_of = [&](std::size_t rod, double s)
    {
        const ArcLength& length = parts_->rods[rod]->rod.arc_length();
        return length.at(s) / length.total();
    };
    for (const RodContacts::Force& one : parts_->contacts->acting())
    {
        SimulatedForce force;
        force.at = origin_ + one.place;
        force.force = one.force;
        force.couple.setZero();
        force.rod = parts_->rods[one.a]->name();
        force.share = share_of(one.a, one.s_a);
        if (one.b >= 0)
        {
            force.other = parts_->rods[std::size_t(one.b)]->name();
            force.other_share = share_of(std::size_t(one.b), one.s_b);
        }
        out.push_back(force);
    }
    return out;
}

std::vector<SimulatedSections> ObjectSimulation::sections(int places) const
{
    std::vector<SimulatedSections> out;
    for (const RodPart* const part : parts_->rods)
        for (const RodPart::Piece& piece : part->pieces())
        {
            SimulatedSections& one = out.emplace_back();
            for (const auto& [forces, frame] : part->sections(piece, places))
            {
                one.tension.push_back(forces.tension);
                one.torque.push_back(forces.torque);
                one.shear.push_back(forces.shear);
                one.moment.push_back(forces.moment);
                one.frame.push_back(frame);
            }
        }
    return out;
}

std::vector<const RodPart*> ObjectSimulation::carriers() const
{
    std::vector<const RodPart*> out;
    for (const RodPart* const part : parts_->rods)
        if (part->carries())
            out.push_back(part);
    return out;
}

Geometry ObjectSimulation::surface(int around) const
{
    Geometry out;
    for (const ObjectInTime* const object : parts_->objects)
        object->add_surface(around, out);
    return out;
}

Geometry ObjectSimulation::stage(int around) const
{
    Geometry out = surface(around);
    if (scene_.obstacles.empty())
        return out;
    const Vector3d up = -vector_of(scene_.gravity).normalized();
    Eigen::AlignedBox3d box;
    for (const ObjectInTime* const object : parts_->objects)
        object->add_to(box);
    std::size_t next_mesh = 0;
    for (const ObstacleStatement& obstacle : scene_.obstacles)
    {
        if (!obstacle.mesh.empty())
            add_mesh(parts_->meshes[next_mesh++], out);
        else if (obstacle.sphere)
        {
            const std::array<double, 4>& s = *obstacle.sphere;
            add_ball({s[0], s[1], s[2]}, s[3], around, out);
        }
        else
        {
            const std::array<double, 4>& p = *obstacle.plane;
            const Vector3d normal(p[0], p[1], p[2]);
            constexpr double kCarries = 0.5;
            if (up.isZero() || normal.normalized().dot(up) > kCarries)
                add_tile(normal, p[3], 0.5 * (box.min() + box.max()),
                         0.6 * (box.max() - box.min()).norm(), out);
        }
    }
    return out;
}

} // namespace cellwarp::core
