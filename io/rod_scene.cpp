// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/rod_scene.h"

#include <cmath>
#include <set>
#include <utility>

#include "io/bytes.h"
#include "io/json_object.h"
#include "io/text.h"

namespace cellwarp
{

namespace
{

constexpr double kHuge = 1e30, kTiny = 1e-30;
constexpr std::int64_t kMostSpans = 1000;
constexpr std::size_t kMostPoints = 10'000'000;

/// Reads what rods and simulate have in common, with defaults.
class Reader
{
public:
    Reader(const Json& json, const RodScene& scene, std::string prefix,
           std::vector<std::string>& warnings)
        : object_(json, scene.path, std::move(prefix), warnings)
    {
    }
    JsonObject& object() { return object_; }

    void read(const char* key, double low, double high, double& out)
    {
        std::optional<double> value;
        object_.read(key, Between<double>{low, high}, value);
        out = value.value_or(out);
    }
    void read(const char* key, std::int64_t low, std::int64_t high, std::int64_t& out)
    {
        std::optional<std::int64_t> value;
        object_.read(key, Between<std::int64_t>{low, high}, value);
        out = value.value_or(out);
    }
    void read(const char* key, const OneOf& allowed, std::string& out)
    {
        std::optional<std::string> value;
        object_.read(key, allowed, value);
        out = value.value_or(out);
    }
    void read(const char* key, bool& out)
    {
        if (const Json* value = object_.find(key))
        {
            if (!value->is_boolean())
                object_.fail(key, "need true or false");
            out = value->get<bool>();
        }
    }
    void read(const char* key, Triple& out)
    {
        if (const Json* value = object_.find(key))
            out = object_.vector(key, *value);
    }
    template <std::size_t count>
    bool read(const char* key, std::array<double, count>& out)
    {
        const Json* value = object_.find(key);
        if (!value)
            return false;
        if (!value->is_array() || value->size() != count)
            object_.fail(key, "need " + std::to_string(count) + " numbers");
        for (std::size_t k = 0; k < count; ++k)
        {
            if (!(*value)[k].is_number() || !std::isfinite((*value)[k].get<double>()))
                object_.fail(key, "need " + std::to_string(count) + " finite numbers");
            out[k] = (*value)[k].get<double>();
        }
        return true;
    }
    /// Each item of a list, by its own reader.
    template <class Each>
    void each(const char* key, Each&& each)
    {
        const Json* list = object_.find(key);
        if (!list)
            return;
        if (!list->is_array())
            object_.fail(key, "need a list");
        for (std::size_t k = 0; k < list->size(); ++k)
            each((*list)[k], std::string(key) + "[" + std::to_string(k) + "]");
    }
    void points(const char* key, std::vector<Triple>& out)
    {
        each(key,
             [&](const Json& value, const std::string& name)
             {
                 if (out.size() >= kMostPoints)
                     object_.fail(key, "more points than a rod can have");
                 const Triple point = object_.vector(name, value);
                 for (const double x : point)
                     if (std::abs(x) > kHuge)
                         object_.fail(name, "is beyond 1e30");
                 out.push_back(point);
             });
    }
    void later(const char* key)
    {
        const Json* const value = object_.find(key);
        const bool is_off = value && value->is_boolean() && !value->get<bool>();
        if (value && !value->empty() && !is_off)
            object_.fail(key, "is not supported by this version");
    }

private:
    JsonObject object_;
};

void read_hold(Reader& reader, const RodScene& scene, const std::string& prefix,
               std::vector<std::string>& warnings, RodHold& hold)
{
    reader.read("at", 0.0, 1.0, hold.at);
    bool has_any = false;
    reader.each("what",
                [&](const Json& value, const std::string& name)
                {
                    const std::string what =
                        value.is_string() ? value.get<std::string>() : "";
                    bool* const flag = what == "point"       ? &hold.has_point
                                       : what == "tangent"   ? &hold.has_tangent
                                       : what == "twist"     ? &hold.has_twist
                                       : what == "curvature" ? &hold.has_curvature
                                                             : nullptr;
                    if (!flag)
                        reader.object().fail(
                            name, "need one of point, tangent, twist, curvature");
                    *flag = has_any = true;
                });
    if (!has_any)
        hold.has_point = true;
    double last = -1.0;
    reader.each("keys",
                [&](const Json& value, const std::string& name)
                {
                    Reader key(value, scene, prefix + name + ".", warnings);
                    RodKey& out = hold.keys.emplace_back();
                    key.read("time", 0.0, kHuge, out.time);
                    key.read("translate", out.translate);
                    key.read("rotate", out.rotate);
                    if (!(out.time > last))
                        key.object().fail("time", "need times that rise");
                    if (out.rotate[0] == 0 && out.rotate[1] == 0 && out.rotate[2] == 0)
                        key.object().fail("rotate", "its axis has no length");
                    last = out.time;
                    key.object().warn_of_the_rest();
                });
    reader.object().warn_of_the_rest();
}

void read_on(Reader& reader, RodOn& on)
{
    if (const Json* at = reader.object().find("at"); at && at->is_string())
        reader.object().fail("at", "sliding is not supported by this version");
    reader.read("at", 0.0, 1.0, on.at);
    std::array<double, 4> plane;
    std::array<double, 6> axis;
    int count = 0;
    if (reader.object().find("point"))
    {
        reader.read("point", on.point);
        ++count;
    }
    if (reader.read("plane", plane))
    {
        on.kind = RodOn::Kind::Plane;
        on.direction = {plane[0], plane[1], plane[2]};
        on.offset = plane[3];
        ++count;
    }
    if (reader.read("axis", axis))
    {
        on.kind = RodOn::Kind::Axis;
        on.point = {axis[0], axis[1], axis[2]};
        on.direction = {axis[3], axis[4], axis[5]};
        ++count;
    }
    reader.later("rod");
    if (count != 1)
        reader.object().fail("", "needs one of point, plane and axis");
    if (on.kind != RodOn::Kind::Point && on.direction == Triple{})
        reader.object().fail(on.kind == RodOn::Kind::Plane ? "plane" : "axis",
                             "its direction has no length");
    reader.object().warn_of_the_rest();
}

void read_rod(const Json& json, const std::string& prefix, RodScene& scene)
{
    RodStatement& rod = scene.rods.emplace_back();
    Reader reader(json, scene, prefix, scene.warnings);
    std::optional<std::string> name;
    reader.object().read("name", name);
    rod.name = name.value_or("rod" + std::to_string(scene.rods.size()));
    if (std::any_of(rod.name.begin(), rod.name.end(),
                    [](char c) { return static_cast<unsigned char>(c) < 0x20; }))
        reader.object().fail("name", "has characters that are none of a line");
    reader.points("through", rod.through);
    reader.points("points", rod.points);
    if (rod.through.empty() == rod.points.empty())
        reader.object().fail("", "needs through or points, one of them");
    reader.read("spans", std::int64_t(1), kMostSpans, rod.spans);
    reader.read("degree", std::int64_t(2), std::int64_t(7), rod.degree);
    reader.read("spline", OneOf{{"nonuniform", "uniform", "catmull-rom", "bezier"}},
                rod.spline);
    reader.read("closed", rod.is_closed);
    const auto ignore = [&](const char* key, bool is_idle, const char* why)
    {
        if (is_idle && reader.object().find(key))
            scene.warnings.push_back(
                at({scene.path, 0, prefix + key}, std::string(why) + ", ignored"));
    };
    ignore("spline", !rod.through.empty() && rod.spline != "nonuniform",
           "is for points, not for through");
    ignore("spans", !rod.points.empty(), "is for through, not for points");
    ignore("degree", rod.spline == "bezier" || rod.spline == "catmull-rom",
           "follows from the spline");
    if (const Json* radius = reader.object().find("radius"))
    {
        rod.radius.clear();
        const auto add = [&](const Json& value)
        {
            if (!value.is_number() || !(value.get<double>() > kTiny) ||
                !(value.get<double>() < kHuge))
                reader.object().fail("radius", "need lengths above 0 [m]");
            rod.radius.push_back(value.get<double>());
        };
        if (radius->is_array())
            for (const Json& value : *radius)
                add(value);
        else
            add(*radius);
        if (rod.radius.empty())
            reader.object().fail("radius", "need a length, or several");
    }
    reader.read("E", kTiny, kHuge, rod.young);
    reader.read("nu", -0.999, 0.5, rod.poisson);
    reader.read("density", kTiny, kHuge, rod.density);
    if (std::array<double, 2> both; reader.read("EI", both))
        rod.bending = both;
    if (reader.object().find("GJ"))
        reader.read("GJ", kTiny, kHuge, rod.twisting.emplace(0.0));
    if (rod.bending && !((*rod.bending)[0] > 0 && (*rod.bending)[1] > 0))
        reader.object().fail("EI", "need two stiffnesses above 0 [N m^2]");
    reader.read("energy", OneOf{{"exact", "continuous", "discrete"}}, rod.energy);
    std::string rest = "given";
    reader.read("rest", OneOf{{"given", "straight"}}, rest);
    rod.is_straight_at_rest = rest == "straight";
    reader.read("rest_twist", -kHuge, kHuge, rod.rest_twist);
    reader.read("link", -1e6, 1e6, rod.link);
    if (rod.link != 0.0 && !rod.is_closed)
        reader.object().fail("link", "only a closed rod has turns put in");
    reader.read("velocity", rod.velocity);
    reader.each("fixed",
                [&](const Json& value, const std::string& key)
                {
                    Reader of(value, scene, prefix + key + ".", scene.warnings);
                    read_hold(of, scene, prefix + key + ".", scene.warnings,
                              rod.holds.emplace_back());
                });
    reader.each("on",
                [&](const Json& value, const std::string& key)
                {
                    Reader of(value, scene, prefix + key + ".", scene.warnings);
                    read_on(of, rod.on.emplace_back());
                });
    reader.each("loads",
                [&](const Json& value, const std::string& key)
                {
                    Reader of(value, scene, prefix + key + ".", scene.warnings);
                    RodPull& load = rod.loads.emplace_back();
                    of.read("at", 0.0, 1.0, load.at);
                    of.read("force", load.force);
                    of.read("moment", load.moment);
                    of.object().warn_of_the_rest();
                });
    reader.each("springs",
                [&](const Json& value, const std::string& key)
                {
                    Reader of(value, scene, prefix + key + ".", scene.warnings);
                    RodSpringTo& spring = rod.springs.emplace_back();
                    of.read("at", 0.0, 1.0, spring.at);
                    if (!of.object().find("point"))
                        of.object().fail("point", "is missing");
                    of.read("point", spring.point);
                    of.read("stiffness", 0.0, kHuge, spring.stiffness);
                    if (of.object().find("length"))
                        of.read("length", 0.0, kHuge, spring.length.emplace(0.0));
                    of.read("damping", 0.0, kHuge, spring.damping);
                    if (!(spring.stiffness > 0.0) && !(spring.damping > 0.0))
                        of.object().fail("stiffness", "is missing, or damping");
                    of.object().warn_of_the_rest();
                });
    for (const char* key : {"cut", "refine", "carries", "radius_of_contact"})
        reader.later(key);
    reader.object().warn_of_the_rest();
}

} // namespace

bool has_simulation(const std::string& path)
{
    if (extension_of(path) != "json")
        return false;
    const Json json = parse_json(path, read_file(path));
    return json.contains("simulate") ||
           (json.contains("rods") && !json.contains("model"));
}

RodScene read_rod_scene(const std::string& path)
{
    return parse_rod_scene(path, read_file(path));
}

RodScene parse_rod_scene(const std::string& path, const std::string& text)
{
    RodScene scene;
    scene.path = path;
    const Json json = parse_json(path, text);
    Reader root(json, scene, "", scene.warnings);
    std::int64_t version = 0;
    if (!json.contains("cellwarp"))
        root.object().fail("cellwarp", "is missing (need \"cellwarp\": 1)");
    root.read("cellwarp", std::int64_t(1), std::int64_t(1), version);
    for (const char* other : {"model", "handles", "save", "energy", "cells", "field"})
        root.object().find(other);
    root.each("rods", [&](const Json& value, const std::string& key)
              { read_rod(value, key + ".", scene); });
    if (scene.rods.empty())
        root.object().fail("rods", "is missing: there is nothing to simulate");
    std::set<std::string> names;
    for (const RodStatement& rod : scene.rods)
        if (!names.insert(rod.name).second)
            root.object().fail("rods", "two are called " + in_quotes(rod.name));
    if (const Json* unit = root.object().find("unit"); unit && *unit != 1)
        root.object().fail("unit", "only metres are supported by this version");
    for (const char* key : {"bodies", "nets", "joints", "obstacles", "skeleton"})
        root.later(key);
    if (const Json* value = root.object().find("simulate"))
    {
        Reader simulate(*value, scene, "simulate.", scene.warnings);
        simulate.read("dt", 1e-12, 1e6, scene.dt);
        simulate.read("duration", 0.0, 1e9, scene.duration);
        simulate.read("every", 1e-12, 1e9, scene.every);
        simulate.read("integrator",
                      OneOf{{"implicit-euler", "midpoint", "rk4", "static"}},
                      scene.integrator);
        simulate.read("gravity", scene.gravity);
        simulate.read("viscosity", 0.0, kHuge, scene.viscosity);
        simulate.object().warn_of_the_rest();
        if (scene.duration / scene.dt > 1e9)
            simulate.object().fail("duration", "takes more than 1e9 steps of dt");
    }
    root.object().warn_of_the_rest();
    return scene;
}

} // namespace cellwarp
