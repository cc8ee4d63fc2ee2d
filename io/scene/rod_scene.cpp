// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/rod_scene.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <utility>

#include "io/base/bytes.h"
#include "io/base/file_limits.h"
#include "io/base/relative_name.h"
#include "io/base/text.h"
#include "io/scene/json_object.h"

namespace cellwarp::core
{

namespace
{

constexpr std::int64_t kMostSpans = 1000;
constexpr std::size_t kMostPoints = 10'000'000;

/// Reads what rods and simulate have in common, with defaults.
class RodReader
{
public:
    RodReader(const Json& json, const RodScene& scene, std::string prefix,
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

private:
    JsonObject object_;
};

void read_turn(RodReader& reader, std::array<double, 4>& turn)
{
    reader.read("rotate", turn);
    if (turn[0] == 0 && turn[1] == 0 && turn[2] == 0)
        reader.object().fail("rotate", "its axis has no length");
}

/// Keys whose times rise. \p read_value(reader of the key, key) reads all but the time.
template <class Key, class ReadValue>
void read_timed_keys(RodReader& reader, RodScene& scene, const std::string& prefix,
                     std::vector<Key>& keys, const ReadValue& read_value)
{
    double last = -1.0;
    reader.each("keys",
                [&](const Json& value, const std::string& name)
                {
                    RodReader key(value, scene, prefix + name + ".", scene.warnings);
                    Key& out = keys.emplace_back();
                    key.read("time", 0.0, kHuge, out.time);
                    read_value(key, out);
                    if (!(out.time > last))
                        key.object().fail("time", "need times that rise");
                    last = out.time;
                    key.object().warn_of_the_rest();
                });
}

void read_keys(RodReader& reader, RodScene& scene, const std::string& prefix,
               std::vector<RodKey>& keys)
{
    read_timed_keys(reader, scene, prefix, keys,
                    [](RodReader& key, RodKey& out)
                    {
                        key.read("translate", out.translate);
                        read_turn(key, out.rotate);
                    });
}

void read_window(RodReader& reader, TimeWindow& window)
{
    reader.read("from", 0.0, kHuge, window.from);
    if (reader.object().find("until"))
        reader.read("until", window.from, kHuge, window.until.emplace(0.0));
}

/// \p least: of a size.
void read_sizes(RodReader& reader, RodScene& scene, const std::string& prefix,
                double least, SizeInTime& sizes)
{
    read_window(reader, sizes);
    read_timed_keys(reader, scene, prefix, sizes.keys,
                    [least](RodReader& key, SizeKey& out)
                    { key.read("size", least, kHuge, out.size); });
}

/// Reads the damping of a material. \pre The integrator of the scene is known.
void read_damping(RodReader& reader, const RodScene& scene, double& damping)
{
    reader.read("damping", 0.0, kHuge, damping);
    if (damping > 0.0 && scene.is_static())
        reader.object().fail("damping", "an equilibrium has no rates that it could damp");
}

void read_hold(RodReader& reader, RodScene& scene, const std::string& prefix,
               RodHold& hold)
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
                                       : what == "bend"      ? &hold.has_bend
                                                             : nullptr;
                    if (!flag)
                        reader.object().fail(
                            name, "need one of point, tangent, twist, curvature, bend");
                    *flag = has_any = true;
                });
    if (!has_any)
        hold.has_point = true;
    read_window(reader, hold);
    read_keys(reader, scene, prefix, hold.keys);
    reader.object().warn_of_the_rest();
}

void read_slide(RodReader& reader, SlideStatement& slide)
{
    if (reader.object().find("start"))
        reader.read("start", 0.0, 1.0, slide.start.emplace(0.0));
    reader.read("range", slide.range);
    if (!(0.0 <= slide.range[0] && slide.range[0] < slide.range[1] &&
          slide.range[1] <= 1.0))
        reader.object().fail("range", "need two shares that rise within 0 and 1");
    if (slide.start &&
        !(slide.range[0] <= *slide.start && *slide.start <= slide.range[1]))
        reader.object().fail("start", "is not within range");
    std::string end = "stop";
    reader.read("end", OneOf{{"stop", "release"}}, end);
    slide.leaves = end == "release";
    const Json* const friction = reader.object().find("friction");
    if (friction && friction->is_array())
        reader.read("friction", slide.friction);
    else if (friction)
    {
        reader.read("friction", 0.0, kHuge, slide.friction[0]);
        slide.friction[1] = slide.friction[0];
    }
    if (!(slide.friction[0] >= slide.friction[1] && slide.friction[1] >= 0.0))
        reader.object().fail("friction",
                             "need one at rest, and one in motion that is not larger");
    reader.read("inertia", -kHuge, kHuge, slide.inertia);
    if (reader.object().find("apart"))
        reader.read("apart", 0.0, kHuge, slide.apart.emplace(0.0));
}

/// A share of the rest length, or "sliding": true.
bool read_share(RodReader& reader, const char* key, double& share)
{
    const Json* const value = reader.object().find(key);
    if (!value || !value->is_string())
    {
        reader.read(key, 0.0, 1.0, share);
        return false;
    }
    if (*value != "sliding")
        reader.object().fail(key, "need a share of the rest length, or \"sliding\"");
    return true;
}

void read_on(RodReader& reader, RodScene& scene, const std::string& prefix, RodOn& on,
             std::string& rod)
{
    if (read_share(reader, "at", on.at))
        read_slide(reader, on.slide.emplace());
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
    if (std::optional<std::string> other; reader.object().read("rod", other), other)
    {
        on.kind = RodOn::Kind::Rod;
        rod = *other;
        if (read_share(reader, "other", on.other))
        {
            on.other_slide.emplace();
            if (reader.object().find("other_start"))
                reader.read("other_start", 0.0, 1.0, on.other_slide->start.emplace(0.0));
        }
        ++count;
    }
    if (count != 1)
        reader.object().fail("", "needs one of point, plane, axis and rod");
    if ((on.kind == RodOn::Kind::Plane || on.kind == RodOn::Kind::Axis) &&
        on.direction == Triple{})
        reader.object().fail(on.kind == RodOn::Kind::Plane ? "plane" : "axis",
                             "its direction has no length");
    if (on.kind != RodOn::Kind::Rod)
        read_keys(reader, scene, prefix, on.keys);
    reader.object().warn_of_the_rest();
}

std::string read_name(RodReader& reader, const std::string& otherwise)
{
    std::optional<std::string> name;
    reader.object().read("name", name);
    const std::string out = name.value_or(otherwise);
    if (std::any_of(out.begin(), out.end(),
                    [](char c) { return static_cast<unsigned char>(c) < 0x20; }))
        reader.object().fail("name", "has characters that are none of a line");
    return out;
}

void read_body(const Json& json, const std::string& prefix, RodScene& scene)
{
    BodyStatement& body = scene.bodies.emplace_back();
    RodReader reader(json, scene, prefix, scene.warnings);
    body.name = read_name(reader, "body" + std::to_string(scene.bodies.size()));
    reader.read("mass", kTiny, kHuge, body.mass);
    if (reader.object().find("inertia"))
        reader.read("inertia", body.inertia);
    else
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
            reader.object().fail("inertia", "no body has it: each must be above 0 and at "
                                            "most the sum of the other two");
    reader.read("at", body.at);
    read_turn(reader, body.rotate);
    reader.read("velocity", body.velocity);
    reader.read("spin", body.spin);
    read_keys(reader, scene, prefix, body.keys);
    if (reader.object().find("damping"))
        reader.object().fail("damping", "a rigid body has no strains that it could damp");
    reader.object().warn_of_the_rest();
}

std::size_t index_of(RodReader& reader, const std::string& key, const Json& value,
                     std::size_t count)
{
    if (!value.is_number_integer() || value.get<std::int64_t>() < 0 ||
        value.get<std::int64_t>() >= static_cast<std::int64_t>(count))
        reader.object().fail(key, "need the number of a point, from 0 to " +
                                      std::to_string(count - 1));
    return value.get<std::size_t>();
}

void read_net(const Json& json, const std::string& prefix, RodScene& scene)
{
    NetStatement& net = scene.nets.emplace_back();
    RodReader reader(json, scene, prefix, scene.warnings);
    net.name = read_name(reader, "net" + std::to_string(scene.nets.size()));
    reader.points("points", net.points);
    if (net.points.empty())
        reader.object().fail("points", "is missing");
    reader.each(
        "springs",
        [&](const Json& value, const std::string& name)
        {
            if (!value.is_array() || value.size() != 3 || !value[2].is_number() ||
                !(value[2].get<double>() > 0.0) || !(value[2].get<double>() < kHuge))
                reader.object().fail(name,
                                     "need two points and a stiffness above 0 [N/m]");
            NetStatement::Spring& spring = net.springs.emplace_back();
            for (const std::size_t k : {0u, 1u})
                spring.node[k] = index_of(reader, name, value[k], net.points.size());
            if (spring.node[0] == spring.node[1])
                reader.object().fail(name, "need two points, not one");
            spring.stiffness = value[2].get<double>();
        });
    const Json* const mass = reader.object().find("mass");
    if (mass && mass->is_array())
    {
        for (const Json& one : *mass)
            net.masses.push_back(one.is_number() ? one.get<double>() : 0.0);
    }
    else
    {
        double all = 1.0;
        reader.read("mass", kTiny, kHuge, all);
        net.masses.assign(net.points.size(), all / double(net.points.size()));
    }
    if (net.masses.size() != net.points.size() ||
        !std::all_of(net.masses.begin(), net.masses.end(),
                     [](double one) { return one > kTiny && one < kHuge; }))
        reader.object().fail("mass", "need that of all points together [kg], or a list "
                                     "with that of each, above 0");
    read_damping(reader, scene, net.damping);
    reader.each("fixed",
                [&](const Json& value, const std::string& name) {
                    net.fixed.push_back(index_of(reader, name, value, net.points.size()));
                });
    reader.object().warn_of_the_rest();
}

void read_sheet(const Json& json, const std::string& prefix, RodScene& scene)
{
    SheetStatement& sheet = scene.sheets.emplace_back();
    RodReader reader(json, scene, prefix, scene.warnings);
    sheet.name = read_name(reader, "sheet" + std::to_string(scene.sheets.size()));
    reader.read("corner", sheet.corner);
    reader.points("sides", sheet.sides);
    const std::size_t count = sheet.sides.size();
    if (count != 2 && count != 3)
        reader.object().fail("sides", "need two of a sheet, or three of a block");
    reader.read("degree", std::int64_t(1), std::int64_t(7), sheet.degree);
    constexpr std::int64_t kMost = 200;
    reader.each("counts",
                [&](const Json& value, const std::string& name)
                {
                    if (!value.is_number_integer() ||
                        value.get<std::int64_t>() < sheet.degree + 1 ||
                        value.get<std::int64_t>() > kMost)
                        reader.object().fail(name, "need degree + 1 to " +
                                                       std::to_string(kMost) +
                                                       " control points");
                    sheet.counts.push_back(value.get<int>());
                });
    if (sheet.counts.empty())
        sheet.counts.assign(count, static_cast<int>(sheet.degree) + 3);
    if (sheet.counts.size() != count)
        reader.object().fail("counts", "need one for each side");
    reader.read("E", kTiny, kHuge, sheet.young);
    reader.read("thickness", kTiny, kHuge, sheet.thickness);
    reader.read("density", kTiny, kHuge, sheet.density);
    reader.read("viscosity", 0.0, kHuge, sheet.viscosity);
    read_damping(reader, scene, sheet.damping);
    reader.read("velocity", sheet.velocity);
    reader.each("fixed",
                [&](const Json& value, const std::string& name)
                {
                    Triple place{};
                    bool is_good = value.is_array() && value.size() == count;
                    for (std::size_t k = 0; is_good && k < count; ++k)
                    {
                        is_good = value[k].is_number() && value[k].get<double>() >= 0.0 &&
                                  value[k].get<double>() <= 1.0;
                        place[k] = is_good ? value[k].get<double>() : 0.0;
                    }
                    if (!is_good)
                        reader.object().fail(name, "need a share of each side");
                    sheet.fixed.push_back(place);
                });
    reader.points("over", sheet.over);
    if (!sheet.over.empty() && count == 3)
        reader.object().fail("over", "a point within a block holds nothing");
    reader.object().warn_of_the_rest();
}

/// Number of what is called so; throws by \p reader.
template <class Statement>
std::size_t number_of(RodReader& reader, const std::string& key,
                      const std::vector<Statement>& all, const std::string& name,
                      const std::string& kind)
{
    for (std::size_t k = 0; k < all.size(); ++k)
        if (all[k].name == name)
            return k;
    reader.object().fail(key, "there is no " + kind + " called " + in_quotes(name));
}

/// "rod spine 0.5", "rod spine sliding", "body seat 0 0 0.1", "net cloth 7", "flesh 0 1
/// 0"
JointEnd read_end(RodReader& reader, const char* key, const RodScene& scene)
{
    std::optional<std::string> text;
    reader.object().read(key, text);
    if (!text)
        reader.object().fail(key, "is missing");
    std::vector<std::string> words;
    for (std::size_t at = 0; at < text->size();)
    {
        const std::size_t end = std::min(text->find(' ', at), text->size());
        if (end > at)
            words.push_back(text->substr(at, end - at));
        at = end + 1;
    }
    const auto bad = [&](const std::string& why)
    {
        reader.object().fail(
            key, why +
                     ": need \"rod NAME SHARE\", \"rod NAME "
                     "sliding\", \"body NAME X Y Z\", \"net NAME "
                     "POINT\", \"sheet NAME SHARES\" or \"flesh X Y Z\", got " +
                     in_quotes(*text));
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
    if (kind == "flesh" && !scene.has_flesh)
        reader.object().fail(key, "the scene has no skeleton, and so no flesh");
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
        end.index = number_of(reader, key, scene.rods, name, kind);
        end.slides = words.back() == "sliding";
        end.at = end.slides ? 0.0 : number(0);
        if (!(end.at >= 0.0 && end.at <= 1.0))
            bad("the share is not within 0 and 1");
    }
    else if (kind == "body")
    {
        end.kind = JointEnd::Kind::Body;
        end.index = number_of(reader, key, scene.bodies, name, kind);
        for (const std::size_t k : {0u, 1u, 2u})
            end.point[k] = number(k);
    }
    else if (kind == "sheet")
    {
        end.kind = JointEnd::Kind::Sheet;
        end.index = number_of(reader, key, scene.sheets, name, kind);
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
        end.index = number_of(reader, key, scene.nets, name, kind);
        const double point = number(0);
        if (!(point >= 0.0 && point < double(scene.nets[end.index].points.size())) ||
            point != std::floor(point))
            bad("the net has no such point");
        end.node = static_cast<std::size_t>(point);
    }
    return end;
}

void read_joint(const Json& json, const std::string& prefix, RodScene& scene)
{
    JointStatement& joint = scene.joints.emplace_back();
    RodReader reader(json, scene, prefix, scene.warnings);
    joint.ends = {read_end(reader, "a", scene), read_end(reader, "b", scene)};
    const auto is_of = [&](JointEnd::Kind kind)
    { return joint.ends[0].kind == kind || joint.ends[1].kind == kind; };
    const bool slides = joint.ends[0].slides || joint.ends[1].slides;
    reader.each("what",
                [&](const Json& value, const std::string& name)
                {
                    const std::string what =
                        value.is_string() ? value.get<std::string>() : "";
                    bool* const flag = what == "point"      ? &joint.has_point
                                       : what == "frame"    ? &joint.has_frame
                                       : what == "distance" ? &joint.has_distance
                                                            : nullptr;
                    if (!flag)
                        reader.object().fail(name, "need one of point, frame, distance");
                    *flag = true;
                });
    if (!joint.has_point && !joint.has_frame && !joint.has_distance)
        joint.has_point = true;
    if (joint.has_frame && is_of(JointEnd::Kind::Net))
        reader.object().fail("what", "a point of a net has no frame");
    if (joint.has_frame && is_of(JointEnd::Kind::Sheet))
        reader.object().fail("what", "a place of a sheet has no frame");
    if (joint.has_frame && is_of(JointEnd::Kind::Flesh))
        reader.object().fail("what", "a point of flesh has no frame");
    if (slides && (joint.has_frame || joint.has_distance))
        reader.object().fail("what", "what slides is joined by point alone");
    if (slides)
        read_slide(reader, joint.slide);
    if (joint.ends[0].slides && joint.ends[1].slides &&
        reader.object().find("other_start"))
        reader.read("other_start", 0.0, 1.0, joint.other_start.emplace(0.0));
    reader.object().warn_of_the_rest();
}

void read_cut(RodReader& reader, CutStatement& cut)
{
    constexpr double kEnd = 1e-6; // of the length
    int count = 0;
    const auto limit =
        [&](const char* key, double low, double high, std::optional<double>& out)
    {
        if (!reader.object().find(key))
            return;
        reader.read(key, low, high, out.emplace(0.0));
        ++count;
    };
    limit("at", kEnd, 1.0 - kEnd, cut.at);
    limit("curvature", kTiny, kHuge, cut.curvature);
    limit("force", kTiny, kHuge, cut.force);
    if (count != 1)
        reader.object().fail("", "needs one of at, curvature and force");
    if (cut.at)
        reader.read("time", 0.0, kHuge, cut.time);
    reader.object().warn_of_the_rest();
}

/// true, false, or an object.
void read_refine(RodReader& reader, RodScene& scene, const std::string& prefix,
                 std::optional<RefineStatement>& refine)
{
    const Json* const value = reader.object().find("refine");
    if (!value || (value->is_boolean() && !value->get<bool>()))
        return;
    refine.emplace();
    if (value->is_boolean())
        return;
    if (!value->is_object())
        reader.object().fail("refine", "need true, false, or an object with insert, "
                                       "remove, tolerance, shortest");
    RodReader of(*value, scene, prefix + "refine.", scene.warnings);
    of.read("insert", 0.01, 3.0, refine->insert);
    of.read("remove", 0.0, 3.0, refine->remove);
    if (!(refine->remove < refine->insert))
        of.object().fail("remove", "need a smaller turn than insert");
    of.read("tolerance", 0.0, 1.0, refine->tolerance);
    of.read("shortest", 0.0, kHuge, refine->shortest);
    of.object().warn_of_the_rest();
}

void read_obstacle(const Json& json, const std::string& prefix, RodScene& scene)
{
    ObstacleStatement& obstacle = scene.obstacles.emplace_back();
    RodReader reader(json, scene, prefix, scene.warnings);
    int count = 0;
    if (std::array<double, 4> plane; reader.read("plane", plane))
    {
        obstacle.plane = plane;
        if (plane[0] == 0.0 && plane[1] == 0.0 && plane[2] == 0.0)
            reader.object().fail("plane", "its direction has no length");
        ++count;
    }
    if (std::array<double, 4> sphere; reader.read("sphere", sphere))
    {
        obstacle.sphere = sphere;
        if (!(sphere[3] > 0.0))
            reader.object().fail("sphere", "need a radius above 0 [m]");
        ++count;
    }
    if (std::optional<std::string> mesh; reader.object().read("mesh", mesh), mesh)
    {
        obstacle.mesh = resolved_name(scene.path, *mesh);
        ++count;
    }
    if (count != 1)
        reader.object().fail("", "needs one of plane, sphere and mesh");
    reader.object().warn_of_the_rest();
}

/// true, false, or an object; obstacles are there to be touched.
void read_contact(RodReader& root, RodScene& scene)
{
    const Json* const value = root.object().find("contact");
    if (value ? !(value->is_boolean() && !value->get<bool>()) : !scene.obstacles.empty())
        scene.contact.emplace();
    if (!value || value->is_boolean())
        return;
    if (!value->is_object())
        root.object().fail("contact", "need true, false, or an object with friction, "
                                      "damping, stiffness, rods, self");
    RodReader reader(*value, scene, "contact.", scene.warnings);
    reader.read("friction", 0.0, kHuge, scene.contact->friction);
    reader.read("damping", 0.0, 100.0, scene.contact->damping);
    if (reader.object().find("stiffness"))
        reader.read("stiffness", kTiny, kHuge, scene.contact->stiffness.emplace(0.0));
    reader.read("rods", scene.contact->between_rods);
    reader.read("self", scene.contact->with_itself);
    reader.object().warn_of_the_rest();
}

/// A rod's place on another, which may stand behind it in the scene.
struct OtherRod
{
    std::size_t rod, on;
    std::string key, name;
};

void read_rod(const Json& json, const std::string& prefix, RodScene& scene,
              std::vector<OtherRod>& others)
{
    RodStatement& rod = scene.rods.emplace_back();
    RodReader reader(json, scene, prefix, scene.warnings);
    rod.name = read_name(reader, "rod" + std::to_string(scene.rods.size()));
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
    read_damping(reader, scene, rod.damping);
    if (std::array<double, 2> both; reader.read("EI", both))
        rod.bending = both;
    if (reader.object().find("GJ"))
        reader.read("GJ", kTiny, kHuge, rod.twisting.emplace(0.0));
    if (rod.bending && !((*rod.bending)[0] > 0 && (*rod.bending)[1] > 0))
        reader.object().fail("EI", "need two stiffnesses above 0 [N m^2]");
    if (reader.object().find("normal"))
        reader.read("normal", rod.normal.emplace());
    if (rod.bending && (*rod.bending)[0] != (*rod.bending)[1] && !rod.normal)
        reader.object().fail("normal", "is missing: two different EI need the direction "
                                       "that the first one bends about");
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
                    RodReader of(value, scene, prefix + key + ".", scene.warnings);
                    read_hold(of, scene, prefix + key + ".", rod.holds.emplace_back());
                });
    reader.each("on",
                [&](const Json& value, const std::string& key)
                {
                    RodReader of(value, scene, prefix + key + ".", scene.warnings);
                    std::string other;
                    read_on(of, scene, prefix + key + ".", rod.on.emplace_back(), other);
                    others.push_back({scene.rods.size() - 1, rod.on.size() - 1,
                                      prefix + key + ".rod", other});
                });
    reader.each("loads",
                [&](const Json& value, const std::string& key)
                {
                    RodReader of(value, scene, prefix + key + ".", scene.warnings);
                    RodPull& load = rod.loads.emplace_back();
                    of.read("at", 0.0, 1.0, load.at);
                    of.read("force", load.force);
                    of.read("moment", load.moment);
                    read_sizes(of, scene, prefix + key + ".", -kHuge, load);
                    of.object().warn_of_the_rest();
                });
    reader.each("springs",
                [&](const Json& value, const std::string& key)
                {
                    RodReader of(value, scene, prefix + key + ".", scene.warnings);
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
                    read_sizes(of, scene, prefix + key + ".", 0.0, spring);
                    of.object().warn_of_the_rest();
                });
    reader.each("cut",
                [&](const Json& value, const std::string& key)
                {
                    RodReader of(value, scene, prefix + key + ".", scene.warnings);
                    read_cut(of, rod.cuts.emplace_back());
                });
    read_refine(reader, scene, prefix, rod.refine);
    if (reader.object().find("radius_of_contact"))
        reader.read("radius_of_contact", kTiny, kHuge, rod.contact_radius.emplace(0.0));
    reader.read("skin", rod.has_skin);
    reader.read("carries", rod.carries);
    if (rod.carries && (rod.refine || !rod.cuts.empty()))
        reader.object().fail("carries", "cells are carried by rods that are neither "
                                        "refined nor cut");
    reader.object().warn_of_the_rest();
}

RodScene rod_scene_of(const std::string& path, const std::string& text)
{
    RodScene scene;
    scene.path = path;
    const Json json = parse_json(path, text, &scene.warnings);
    RodReader root(json, scene, "", scene.warnings);
    std::int64_t version = 0;
    if (!json.contains("cellwarp"))
        root.object().fail("cellwarp", "is missing (need \"cellwarp\": 1)");
    root.read("cellwarp", std::int64_t(1), std::int64_t(1), version);
    for (const char* other : {"model", "handles", "save", "energy", "cells", "field"})
        root.object().find(other);
    scene.has_flesh = json.contains("skeleton");
    if (scene.has_flesh)
        scene.dt = kStepOfFlesh;
    read_time_settings(root.object(), scene.path, scene, scene.warnings);
    std::vector<OtherRod> others;
    root.each("rods", [&](const Json& value, const std::string& key)
              { read_rod(value, key + ".", scene, others); });
    root.each("bodies", [&](const Json& value, const std::string& key)
              { read_body(value, key + ".", scene); });
    root.each("nets", [&](const Json& value, const std::string& key)
              { read_net(value, key + ".", scene); });
    root.each("sheets", [&](const Json& value, const std::string& key)
              { read_sheet(value, key + ".", scene); });
    if (scene.rods.empty() && scene.sheets.empty() && scene.bodies.empty() &&
        scene.nets.empty() && !scene.has_flesh)
        root.object().fail("rods", "is missing: there is nothing to simulate");
    const auto need_names = [&](const char* key, const auto& all)
    {
        std::set<std::string> names;
        for (const auto& one : all)
            if (!names.insert(one.name).second)
                root.object().fail(key, "two are called " + in_quotes(one.name));
    };
    need_names("rods", scene.rods);
    need_names("bodies", scene.bodies);
    need_names("nets", scene.nets);
    need_names("sheets", scene.sheets);
    for (const OtherRod& other : others)
        if (RodOn& on = scene.rods[other.rod].on[other.on]; on.kind == RodOn::Kind::Rod)
        {
            on.rod = number_of(root, other.key, scene.rods, other.name, "rod");
            if (on.rod == other.rod && !on.slide && !on.other_slide && on.at == on.other)
                root.object().fail(other.key, "a place on itself");
        }
    root.each("joints", [&](const Json& value, const std::string& key)
              { read_joint(value, key + ".", scene); });
    if (json.contains("model") && !scene.carries() && !scene.has_flesh)
        scene.warnings.push_back(
            at({path, 0, "model"}, "no rod carries it, it is left out"));
    if (scene.carries() && !json.contains("model"))
        root.object().fail("model", "is missing: rods carry its cells");
    for (std::size_t k = 0; k < scene.rods.size(); ++k)
        if (scene.has_flesh && scene.rods[k].carries)
            root.object().fail("rods[" + std::to_string(k) + "].carries",
                               "the model is flesh, which rods are joined to");
    root.object().find("skeleton");
    root.each("obstacles", [&](const Json& value, const std::string& key)
              { read_obstacle(value, key + ".", scene); });
    read_contact(root, scene);
    if (scene.integrator == "bdf2")
        root.object().fail("simulate.integrator",
                           "bdf2 is for flesh without rods, bodies and nets");
    if (scene.integrator == "static")
        for (std::size_t k = 0; k < scene.rods.size(); ++k)
            if (!scene.rods[k].cuts.empty())
                root.object().fail("rods[" + std::to_string(k) + "].cut",
                                   "an equilibrium has no time in which to cut");
    root.object().warn_of_the_rest();
    return scene;
}

} // namespace

bool RodScene::carries() const
{
    return std::any_of(rods.begin(), rods.end(),
                       [](const RodStatement& rod) { return rod.carries; });
}

RodScene read_rod_scene(const std::string& path)
{
    return parse_rod_scene(path, read_file(path));
}

RodScene parse_rod_scene(const std::string& path, const std::string& text)
{
    return with_lines(path, text, [&] { return rod_scene_of(path, text); });
}

} // namespace cellwarp::core
