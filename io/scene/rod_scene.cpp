// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/rod_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "io/base/number.h"
#include "io/scene/json_object.h"
#include "io/scene/timed_keys.h"

namespace cellwarp::core
{

namespace
{

constexpr std::int64_t kMostSpans = 1000;

void read_window(JsonObject& object, TimeWindow& window)
{
    object.read("from", kNotNegative, window.from);
    object.read("until", Between<double>{window.from, kHuge}, window.until);
}

/// \p least: of a size.
void read_sizes(JsonObject& object, double least, SizeInTime& sizes)
{
    read_window(object, sizes);
    read_timed_keys(object, kNotNegative, sizes.keys,
                    [least](JsonObject& key, SizeKey& out) {
                        key.read("size", Between<double>{least, kHuge}, out.size);
                    });
}

/// Reads the damping of a material. \pre The integrator of the scene is known.
void read_damping(JsonObject& object, const RodScene& scene, double& damping)
{
    object.read("damping", kNotNegative, damping);
    if (damping > 0.0 && scene.is_static())
        object.fail("damping", "an equilibrium has no rates that it could damp");
}

void read_hold(JsonObject& object, RodHold& hold)
{
    object.read("at", kShare, hold.at);
    object.read("what", {{"point", &hold.has_point},
                         {"tangent", &hold.has_tangent},
                         {"twist", &hold.has_twist},
                         {"curvature", &hold.has_curvature},
                         {"bend", &hold.has_bend}});
    hold.has_point = hold.has_point || !(hold.has_tangent || hold.has_twist ||
                                         hold.has_curvature || hold.has_bend);
    read_window(object, hold);
    read_move_keys(object, kNotNegative, hold.keys);
}

void read_slide(JsonObject& object, SlideStatement& slide)
{
    object.read("start", kShare, slide.start);
    object.read("range", slide.range);
    if (!(0.0 <= slide.range[0] && slide.range[0] < slide.range[1] &&
          slide.range[1] <= 1.0))
        object.fail("range", "need two shares that rise within 0 and 1");
    if (slide.start &&
        !(slide.range[0] <= *slide.start && *slide.start <= slide.range[1]))
        object.fail("start", "is not within range");
    std::string end;
    object.read("end", OneOf{{"stop", "release"}}, end);
    slide.leaves = end == "release";
    const Json* const friction = object.find("friction");
    if (friction && friction->is_array())
        object.read("friction", slide.friction);
    else if (object.read("friction", kNotNegative, slide.friction[0]))
        slide.friction[1] = slide.friction[0];
    if (!(slide.friction[0] >= slide.friction[1] && slide.friction[1] >= 0.0))
        object.fail("friction", "need one at rest, and one in motion that is not larger");
    object.read("inertia", kAny, slide.inertia);
    object.read("apart", kNotNegative, slide.apart);
}

/// A share of the rest length, or "sliding": true.
bool read_share(JsonObject& object, const char* key, double& share)
{
    const Json* const value = object.find(key);
    if (!value || !value->is_string())
    {
        object.read(key, kShare, share);
        return false;
    }
    if (*value != "sliding")
        object.fail(key, "need a share of the rest length, or \"sliding\"");
    return true;
}

/// \p rod: the name of the one that it stays on, which may come later in the scene.
void read_on(JsonObject& object, RodOn& on, std::string& rod)
{
    if (read_share(object, "at", on.at))
        read_slide(object, on.slide.emplace());
    std::array<double, 4> plane;
    std::array<double, 6> axis;
    int count = object.read("point", on.point);
    if (object.read("plane", plane))
    {
        on.kind = RodOn::Kind::Plane;
        on.direction = {plane[0], plane[1], plane[2]};
        on.offset = plane[3];
        ++count;
    }
    if (object.read("axis", axis))
    {
        on.kind = RodOn::Kind::Axis;
        on.point = {axis[0], axis[1], axis[2]};
        on.direction = {axis[3], axis[4], axis[5]};
        ++count;
    }
    if (object.read("rod", rod))
    {
        on.kind = RodOn::Kind::Rod;
        if (read_share(object, "other", on.other))
            object.read("other_start", kShare, on.other_slide.emplace().start);
        ++count;
    }
    if (count != 1)
        object.fail("", "needs one of point, plane, axis and rod");
    if ((on.kind == RodOn::Kind::Plane || on.kind == RodOn::Kind::Axis) &&
        on.direction == Triple{})
        object.fail(on.kind == RodOn::Kind::Plane ? "plane" : "axis",
                    "its direction has no length");
    if (on.kind != RodOn::Kind::Rod)
        read_move_keys(object, kNotNegative, on.keys);
}

/// The name of the last of \p all.
template <class Statement>
void read_name(JsonObject& object, const std::string& kind, std::vector<Statement>& all)
{
    std::string& name = all.back().name = kind + std::to_string(all.size());
    object.read("name", name);
    if (std::any_of(name.begin(), name.end(),
                    [](char c) { return static_cast<unsigned char>(c) < 0x20; }))
        object.fail("name", "has characters that are none of a line");
}

void read_body(JsonObject& object, RodScene& scene)
{
    BodyStatement& body = scene.bodies.emplace_back();
    read_name(object, "body", scene.bodies);
    object.read("mass", kPositive, body.mass);
    if (!object.read("inertia", body.inertia))
    {
        // A ball as dense as water.
        constexpr double kWater = 1000.0;
        const double radius =
            std::cbrt(3.0 * body.mass / (4.0 * std::numbers::pi * kWater));
        body.inertia.fill(0.4 * body.mass * radius * radius);
    }
    const double half = 0.5 * (body.inertia[0] + body.inertia[1] + body.inertia[2]);
    for (const double one : body.inertia)
        if (!(one > 0.0) || one > half * (1.0 + 1e-12))
            object.fail("inertia", "no body has it: each must be above 0 and at most the "
                                   "sum of the other two");
    object.read("at", body.place.translation);
    read_turn(object, body.place);
    object.read("velocity", body.velocity);
    object.read("spin", body.spin);
    read_move_keys(object, kNotNegative, body.keys);
    if (object.find("damping"))
        object.fail("damping", "a rigid body has no strains that it could damp");
}

std::size_t index_of(JsonObject& object, const std::string& key, const Json& value,
                     std::size_t count)
{
    if (!value.is_number_integer() || value.get<std::int64_t>() < 0 ||
        value.get<std::int64_t>() >= static_cast<std::int64_t>(count))
        object.fail(key,
                    "need the number of a point, from 0 to " + std::to_string(count - 1));
    return value.get<std::size_t>();
}

void read_net(JsonObject& object, RodScene& scene)
{
    NetStatement& net = scene.nets.emplace_back();
    read_name(object, "net", scene.nets);
    object.read("points", net.points);
    if (net.points.empty())
        object.fail("points", "is missing");
    object.read_list(
        "springs",
        [&](const Json& value, const std::string& name)
        {
            if (!value.is_array() || value.size() != 3 || !value[2].is_number() ||
                !(value[2].get<double>() > 0.0) || !(value[2].get<double>() < kHuge))
                object.fail(name, "need two points and a stiffness above 0 [N/m]");
            NetStatement::Spring& spring = net.springs.emplace_back();
            for (const std::size_t k : {0u, 1u})
                spring.node[k] = index_of(object, name, value[k], net.points.size());
            if (spring.node[0] == spring.node[1])
                object.fail(name, "need two points, not one");
            spring.stiffness = value[2].get<double>();
        });
    const Json* const mass = object.find("mass");
    if (mass && mass->is_array())
    {
        for (const Json& one : *mass)
            net.masses.push_back(one.is_number() ? one.get<double>() : 0.0);
    }
    else
    {
        double all = 1.0;
        object.read("mass", kPositive, all);
        net.masses.assign(net.points.size(), all / double(net.points.size()));
    }
    if (net.masses.size() != net.points.size() ||
        !std::all_of(net.masses.begin(), net.masses.end(),
                     [](double one) { return one > kTiny && one < kHuge; }))
        object.fail("mass", "need that of all points together [kg], or a list "
                            "with that of each, above 0");
    read_damping(object, scene, net.damping);
    object.read_list(
        "fixed", [&](const Json& value, const std::string& name)
        { net.fixed.push_back(index_of(object, name, value, net.points.size())); });
}

void read_sheet(JsonObject& object, RodScene& scene)
{
    SheetStatement& sheet = scene.sheets.emplace_back();
    read_name(object, "sheet", scene.sheets);
    object.read("corner", sheet.corner);
    object.read("sides", sheet.sides);
    const std::size_t count = sheet.sides.size();
    if (count != 2 && count != 3)
        object.fail("sides", "need two of a sheet, or three of a block");
    object.read("degree", Between<std::int64_t>{1, 7}, sheet.degree);
    constexpr std::int64_t kMost = 200;
    object.read_list("counts",
                     [&](const Json& value, const std::string& name)
                     {
                         if (!value.is_number_integer() ||
                             value.get<std::int64_t>() < sheet.degree + 1 ||
                             value.get<std::int64_t>() > kMost)
                             object.fail(name, "need degree + 1 to " +
                                                   std::to_string(kMost) +
                                                   " control points");
                         sheet.counts.push_back(value.get<int>());
                     });
    if (sheet.counts.empty())
        sheet.counts.assign(count, static_cast<int>(sheet.degree) + 3);
    if (sheet.counts.size() != count)
        object.fail("counts", "need one for each side");
    object.read("E", kPositive, sheet.young);
    object.read("thickness", kPositive, sheet.thickness);
    object.read("density", kPositive, sheet.density);
    object.read("viscosity", kNotNegative, sheet.viscosity);
    read_damping(object, scene, sheet.damping);
    object.read("velocity", sheet.velocity);
    object.read_list("fixed",
                     [&](const Json& value, const std::string& name)
                     {
                         Triple place{};
                         bool is_good = value.is_array() && value.size() == count;
                         for (std::size_t k = 0; is_good && k < count; ++k)
                         {
                             is_good = value[k].is_number() &&
                                       value[k].get<double>() >= 0.0 &&
                                       value[k].get<double>() <= 1.0;
                             place[k] = is_good ? value[k].get<double>() : 0.0;
                         }
                         if (!is_good)
                             object.fail(name, "need a share of each side");
                         sheet.fixed.push_back(place);
                     });
    object.read("over", sheet.over);
    if (!sheet.over.empty() && count == 3)
        object.fail("over", "a point within a block holds nothing");
}

/// Number of what is called so; throws by \p object.
template <class Statement>
std::size_t number_of(JsonObject& object, const std::string& key,
                      const std::vector<Statement>& all, const std::string& name,
                      const std::string& kind)
{
    for (std::size_t k = 0; k < all.size(); ++k)
        if (all[k].name == name)
            return k;
    object.fail(key, "there is no " + kind + " called " + in_quotes(name));
}

/// "rod spine 0.5", "rod spine sliding", "body seat 0 0 0.1", "net cloth 7", "flesh 0 1
/// 0"
JointEnd read_end(JsonObject& object, const char* key, const RodScene& scene,
                  bool has_flesh)
{
    std::string text;
    object.need(key, text);
    std::vector<std::string> words;
    for (std::size_t at = 0; at < text.size();)
    {
        const std::size_t end = std::min(text.find(' ', at), text.size());
        if (end > at)
            words.push_back(text.substr(at, end - at));
        at = end + 1;
    }
    const auto bad = [&](const std::string& why)
    {
        object.fail(key, why +
                             ": need \"rod NAME SHARE\", \"rod NAME "
                             "sliding\", \"body NAME X Y Z\", \"net NAME "
                             "POINT\", \"sheet NAME SHARES\" or \"flesh X Y Z\", got " +
                             in_quotes(text));
    };
    const std::string kind = words.empty() ? "" : words.front();
    // How many numbers follow the name of a sheet is told by its sides.
    std::size_t numbers = kind == "body" || kind == "flesh" ? 3 : 1;
    for (const SheetStatement& sheet : scene.sheets)
    {
        std::string rest;
        for (std::size_t k = 1; k + sheet.sides.size() < words.size(); ++k)
            rest += (k > 1 ? " " : "") + words[k];
        if (kind == "sheet" && rest == sheet.name)
            numbers = sheet.sides.size();
    }
    const bool has_name =
        kind == "rod" || kind == "body" || kind == "net" || kind == "sheet";
    if (has_name ? words.size() < numbers + 2
                 : kind != "flesh" || words.size() != numbers + 1)
        bad("names no place");
    if (kind == "flesh" && !has_flesh)
        object.fail(key, "the scene has no skeleton, and so no flesh");
    std::string name;
    for (std::size_t k = 1; k + numbers < words.size(); ++k)
        name += (k > 1 ? " " : "") + words[k];
    JointEnd end;
    const auto number = [&](std::size_t k)
    {
        const std::optional<double> value =
            parse_double(words[words.size() - numbers + k]);
        if (!value || !std::isfinite(*value) || std::abs(*value) > kHuge)
            bad("what follows the name is no number");
        return *value;
    };
    if (kind == "flesh")
    {
        end.kind = JointEnd::Kind::Flesh;
        for (const std::size_t k : {0u, 1u, 2u})
            end.point[k] = number(k);
    }
    else if (kind == "rod")
    {
        end.index = number_of(object, key, scene.rods, name, kind);
        end.slides = words.back() == "sliding";
        end.at = end.slides ? 0.0 : number(0);
        if (!(end.at >= 0.0 && end.at <= 1.0))
            bad("the share is not within 0 and 1");
    }
    else if (kind == "body")
    {
        end.kind = JointEnd::Kind::Body;
        end.index = number_of(object, key, scene.bodies, name, kind);
        for (const std::size_t k : {0u, 1u, 2u})
            end.point[k] = number(k);
    }
    else if (kind == "sheet")
    {
        end.kind = JointEnd::Kind::Sheet;
        end.index = number_of(object, key, scene.sheets, name, kind);
        for (std::size_t k = 0; k < numbers; ++k)
        {
            end.point[k] = number(k);
            if (!(end.point[k] >= 0.0 && end.point[k] <= 1.0))
                bad("a share is not within 0 and 1");
        }
    }
    else
    {
        end.kind = JointEnd::Kind::Net;
        end.index = number_of(object, key, scene.nets, name, kind);
        const double point = number(0);
        if (!(point >= 0.0 && point < double(scene.nets[end.index].points.size())) ||
            point != std::floor(point))
            bad("the net has no such point");
        end.node = static_cast<std::size_t>(point);
    }
    return end;
}

void read_joint(JsonObject& object, RodScene& scene, bool has_flesh)
{
    JointStatement& joint = scene.joints.emplace_back();
    joint.field = object.name();
    joint.ends = {read_end(object, "a", scene, has_flesh),
                  read_end(object, "b", scene, has_flesh)};
    const auto is_of = [&](JointEnd::Kind kind)
    { return joint.ends[0].kind == kind || joint.ends[1].kind == kind; };
    const bool slides = joint.ends[0].slides || joint.ends[1].slides;
    object.read("what", {{"point", &joint.has_point},
                         {"frame", &joint.has_frame},
                         {"distance", &joint.has_distance}});
    if (!joint.has_point && !joint.has_frame && !joint.has_distance)
        joint.has_point = true;
    if (joint.has_frame && is_of(JointEnd::Kind::Net))
        object.fail("what", "a point of a net has no frame");
    if (joint.has_frame && is_of(JointEnd::Kind::Sheet))
        object.fail("what", "a place of a sheet has no frame");
    if (joint.has_frame && is_of(JointEnd::Kind::Flesh))
        object.fail("what", "a point of flesh has no frame");
    if (slides && (joint.has_frame || joint.has_distance))
        object.fail("what", "what slides is joined by point alone");
    if (slides)
        read_slide(object, joint.slide);
    if (joint.ends[0].slides && joint.ends[1].slides)
        object.read("other_start", kShare, joint.other_start);
}

void read_cut(JsonObject& object, CutStatement& cut)
{
    constexpr double kEnd = 1e-6; // of the length
    const int count = object.read("at", Between<double>{kEnd, 1.0 - kEnd}, cut.at) +
                      object.read("curvature", kPositive, cut.curvature) +
                      object.read("force", kPositive, cut.force);
    if (count != 1)
        object.fail("", "needs one of at, curvature and force");
    if (cut.at)
        object.read("time", kNotNegative, cut.time);
}

/// true, false, or an object; whether it is none of the first two.
bool is_object_or_switch(JsonObject& object, const std::string& key, const char* keys,
                         bool& is_on)
{
    const Json* const value = object.find(key);
    if (value && !value->is_boolean() && !value->is_object())
        object.fail(key, std::string("need true, false, or an object with ") + keys);
    if (value)
        is_on = value->is_object() || value->get<bool>();
    return value && value->is_object();
}

void read_refine(JsonObject& rod, std::optional<RefineStatement>& refine)
{
    bool is_on = false;
    const bool is_object =
        is_object_or_switch(rod, "refine", "insert, remove, tolerance, shortest", is_on);
    if (is_on)
        refine.emplace();
    if (is_object)
        rod.read_object(
            "refine",
            [&](JsonObject& object)
            {
                object.read("insert", Between<double>{0.01, 3.0}, refine->insert);
                object.read("remove", Between<double>{0.0, 3.0}, refine->remove);
                if (!(refine->remove < refine->insert))
                    object.fail("remove", "need a smaller turn than insert");
                object.read("tolerance", kShare, refine->tolerance);
                object.read("shortest", kNotNegative, refine->shortest);
            });
}

/// Rods touch what stands still, and have one friction.
void read_still_obstacle(JsonObject& object, RodScene& scene)
{
    scene.obstacles.push_back(read_obstacle(object));
    if (object.find("keys"))
        object.fail("keys", "rods touch only obstacles that stay");
    if (object.find("friction"))
        object.fail("friction", "rods have one friction, rod_contact.friction");
}

/// \pre The obstacles are known: they are there to be touched.
void read_contact(JsonObject& root, RodScene& scene)
{
    const std::string key = root.renamed("rod_contact", "contact");
    bool is_on = !scene.obstacles.empty();
    const bool is_object =
        is_object_or_switch(root, key, "friction, damping, stiffness, rods, self", is_on);
    if (is_on)
        scene.contact.emplace();
    if (is_object)
        root.read_object(
            key,
            [&](JsonObject& object)
            {
                object.read("friction", kNotNegative, scene.contact->friction);
                object.read("damping", Between<double>{0.0, 100.0},
                            scene.contact->damping);
                object.read("stiffness", kPositive, scene.contact->stiffness);
                object.read("rods", scene.contact->between_rods);
                object.read("self", scene.contact->with_itself);
            });
}

void read_radius(JsonObject& object, std::vector<double>& out)
{
    const Json* const radius = object.find("radius");
    if (!radius)
        return;
    out.clear();
    for (const Json& value : radius->is_array() ? *radius : Json::array({*radius}))
    {
        if (!value.is_number() || !(value.get<double>() > kTiny) ||
            !(value.get<double>() < kHuge))
            object.fail("radius", "need lengths above 0 [m]");
        out.push_back(value.get<double>());
    }
    if (out.empty())
        object.fail("radius", "need a length, or several");
}

void read_line(JsonObject& object, SplineLine& line)
{
    const bool is_through = object.read("through", line.points) && !line.points.empty();
    std::vector<Eigen::Vector3d> controls;
    object.read("points", controls);
    if (is_through == !controls.empty())
        object.fail("", "needs through or points, one of them");
    if (!is_through)
    {
        line.form = SplineLine::Form::Points;
        line.points = std::move(controls);
    }
    object.read("spans", Between<std::int64_t>{1, kMostSpans}, line.spans);
    object.read("degree", Between<std::int64_t>{2, 7}, line.degree);
    object.read("spline", OneOf{{"nonuniform", "uniform", "catmull-rom", "bezier"}},
                line.knots);
    object.read("closed", line.is_closed);
    const auto ignore = [&](const char* key, bool is_idle, const char* why)
    {
        if (is_idle && object.find(key))
            object.warn(key, std::string(why) + ", ignored");
    };
    ignore("spline", is_through && line.knots != "nonuniform",
           "is for points, not for through");
    ignore("spans", !is_through, "is for through, not for points");
    ignore("degree", line.knots == "bezier" || line.knots == "catmull-rom",
           "follows from the spline");
    read_radius(object, line.radii);
}

void read_spring(JsonObject& object, RodSpringTo& spring)
{
    object.read("at", kShare, spring.at);
    object.need("point", spring.point);
    object.read("stiffness", kNotNegative, spring.stiffness);
    object.read("length", kNotNegative, spring.length);
    object.read("damping", kNotNegative, spring.damping);
    if (!(spring.stiffness > 0.0) && !(spring.damping > 0.0))
        object.fail("stiffness", "is missing, or damping");
    read_sizes(object, 0.0, spring);
}

/// The name of a rod that a place of another stays on.
struct OtherRod
{
    std::size_t rod, on;
    std::string key, name;
};

void read_rod(JsonObject& object, RodScene& scene, std::vector<OtherRod>& others)
{
    RodStatement& rod = scene.rods.emplace_back();
    read_name(object, "rod", scene.rods);
    read_line(object, rod.line);
    object.read("E", kPositive, rod.young);
    object.read("nu", Between<double>{-0.999, 0.5}, rod.poisson);
    object.read("density", kPositive, rod.density);
    read_damping(object, scene, rod.damping);
    object.read("EI", rod.bending);
    object.read("GJ", kPositive, rod.twisting);
    if (rod.bending && !((*rod.bending)[0] > 0 && (*rod.bending)[1] > 0))
        object.fail("EI", "need two stiffnesses above 0 [N m^2]");
    object.read("normal", rod.normal);
    if (rod.bending && (*rod.bending)[0] != (*rod.bending)[1] && !rod.normal)
        object.fail("normal", "is missing: two different EI need the direction that the "
                              "first one bends about");
    object.read(object.renamed("elasticity", "energy"),
                OneOf{{"exact", "continuous", "discrete"}}, rod.elasticity);
    std::string rest;
    object.read("rest", OneOf{{"given", "straight"}}, rest);
    rod.is_straight_at_rest = rest == "straight";
    object.read("rest_twist", kAny, rod.rest_twist);
    object.read("link", Between<double>{-1e6, 1e6}, rod.link);
    if (rod.link != 0.0 && !rod.line.is_closed)
        object.fail("link", "only a closed rod has turns put in");
    object.read("velocity", rod.velocity);
    object.read_objects("fixed", [&](JsonObject& hold)
                        { read_hold(hold, rod.holds.emplace_back()); });
    object.read_objects("on",
                        [&](JsonObject& on)
                        {
                            std::string other;
                            read_on(on, rod.on.emplace_back(), other);
                            others.push_back({scene.rods.size() - 1, rod.on.size() - 1,
                                              on.name_of("rod"), other});
                        });
    object.read_objects("loads",
                        [&](JsonObject& of)
                        {
                            RodPull& load = rod.loads.emplace_back();
                            of.read("at", kShare, load.at);
                            of.read("force", load.force);
                            of.read("moment", load.moment);
                            read_sizes(of, -kHuge, load);
                        });
    object.read_objects("springs", [&](JsonObject& spring)
                        { read_spring(spring, rod.springs.emplace_back()); });
    object.read_objects("cut",
                        [&](JsonObject& cut) { read_cut(cut, rod.cuts.emplace_back()); });
    if (!rod.cuts.empty() && scene.is_static())
        object.fail("cut", "an equilibrium has no time in which to cut");
    read_refine(object, rod.refine);
    object.read("radius_of_contact", kPositive, rod.contact_radius);
    object.read("skin", rod.has_skin);
    object.read("carries", rod.carries);
    if (rod.carries && (rod.refine || !rod.cuts.empty()))
        object.fail("carries", "cells are carried by rods that are neither refined nor "
                               "cut");
}

/// Finds the rods that places of others stay on.
void find_others(JsonObject& root, RodScene& scene, const std::vector<OtherRod>& others)
{
    for (const OtherRod& other : others)
        if (RodOn& on = scene.rods[other.rod].on[other.on]; on.kind == RodOn::Kind::Rod)
        {
            on.rod = number_of(root, other.key, scene.rods, other.name, "rod");
            if (on.rod == other.rod && !on.slide && !on.other_slide && on.at == on.other)
                root.fail(other.key, "a place on itself");
        }
}

template <class Statement>
void need_names(JsonObject& root, const char* key, const std::vector<Statement>& all)
{
    std::set<std::string> names;
    for (const Statement& one : all)
        if (!names.insert(one.name).second)
            root.fail(key, "two are called " + in_quotes(one.name));
}

} // namespace

bool RodScene::has_objects() const
{
    return !(rods.empty() && bodies.empty() && nets.empty() && sheets.empty());
}

bool RodScene::carries() const
{
    return std::any_of(rods.begin(), rods.end(),
                       [](const RodStatement& rod) { return rod.carries; });
}

void read_objects_in_time(JsonObject& root, bool has_flesh, RodScene& scene)
{
    std::vector<OtherRod> others;
    root.read_objects("rods", [&](JsonObject& rod) { read_rod(rod, scene, others); });
    root.read_objects("bodies", [&](JsonObject& body) { read_body(body, scene); });
    root.read_objects("nets", [&](JsonObject& net) { read_net(net, scene); });
    root.read_objects("sheets", [&](JsonObject& sheet) { read_sheet(sheet, scene); });
    need_names(root, "rods", scene.rods);
    need_names(root, "bodies", scene.bodies);
    need_names(root, "nets", scene.nets);
    need_names(root, "sheets", scene.sheets);
    find_others(root, scene, others);
    root.read_objects(root.renamed("connections", "joints"),
                      [&](JsonObject& joint) { read_joint(joint, scene, has_flesh); });
    root.read_objects("obstacles", [&](JsonObject& obstacle)
                      { read_still_obstacle(obstacle, scene); });
    read_contact(root, scene);
    for (std::size_t k = 0; k < scene.rods.size(); ++k)
        if (has_flesh && scene.rods[k].carries)
            root.fail("rods[" + std::to_string(k) + "].carries",
                      "the model is flesh, which rods are joined to");
    if (scene.has_objects() && scene.integrator == "bdf2")
        root.fail("simulate.integrator",
                  "bdf2 is for flesh without rods, bodies and nets");
}

} // namespace cellwarp::core
