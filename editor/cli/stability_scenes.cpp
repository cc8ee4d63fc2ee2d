// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/stability_scenes.h"

#include <array>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "editor/cli/command.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

/// A closed box from the origin, of \p counts squares along its edges.
struct Box
{
    std::vector<Eigen::Vector3d> places;
    std::vector<std::array<std::size_t, 4>> faces; ///< seen from outside

    Box(const Eigen::Vector3d& size, const Eigen::Vector3i& counts)
    {
        std::map<std::array<int, 3>, std::size_t> number;
        const auto corner = [&](const Eigen::Vector3i& at)
        {
            const auto [found, is_new] =
                number.try_emplace({at.x(), at.y(), at.z()}, places.size());
            if (is_new)
                places.push_back(size.cwiseProduct(at.cast<double>())
                                     .cwiseQuotient(counts.cast<double>()));
            return found->second;
        };
        for (int axis = 0; axis < 3; ++axis)
            for (const bool is_high : {false, true})
                for (int j = 0; j < counts[(axis + 2) % 3]; ++j)
                    for (int i = 0; i < counts[(axis + 1) % 3]; ++i)
                    {
                        std::array<std::size_t, 4> face{};
                        for (int k = 0; k < 4; ++k)
                        {
                            Eigen::Vector3i at;
                            at[axis] = is_high ? counts[axis] : 0;
                            at[(axis + 1) % 3] = i + (k == 1 || k == 2);
                            at[(axis + 2) % 3] = j + (k >= 2);
                            face[static_cast<std::size_t>(is_high ? k : 3 - k)] =
                                corner(at);
                        }
                        faces.push_back(face);
                    }
    }
    std::string obj(double scale = 1.0,
                    const Eigen::Vector3d& offset = Eigen::Vector3d::Zero()) const
    {
        std::string text;
        for (const Eigen::Vector3d& x : places)
        {
            const Eigen::Vector3d at = scale * x + offset;
            text += "v " + shortest(at.x()) + " " + shortest(at.y()) + " " +
                    shortest(at.z()) + "\n";
        }
        for (const auto& face : faces)
            text += fmt::format("f {} {} {} {}\n", face[0] + 1, face[1] + 1, face[2] + 1,
                                face[3] + 1);
        return text;
    }
};

/// What every scene of an edit stands for: a bar 1 x 1 x 4, its foot fixed.
const Box kBar({1, 1, 4}, {6, 6, 24});
constexpr const char* kRelative = "cellwarp-handles 1\nunits relative\n";
constexpr const char* kEnds = "fixed foot halfspace 0 0 -1 -0.07\n"
                              "handle head halfspace 0 0 1 0.93\n";
constexpr const char* kBend =
    "frame 1\nmove head rotate 1 0 0 60 translate 0 -0.9 -0.2\n";

/// A scene of an edit: its model and statements. \p cells: further settings.
ExtremeScene edit_of(const std::string& group, const std::string& name,
                     const SceneText& model, const std::string& statements,
                     const std::string& cells = "\"across\": 12, \"max_depth\": 0")
{
    ExtremeScene scene;
    scene.of.group = group;
    scene.of.name = name;
    scene.scene = fmt::format("{{\"cellwarp\": 1, \"model\": \"{}\", \"handles\": "
                              "\"{}.handles\", \"cells\": {{{}}}}}\n",
                              model.name, name, cells);
    scene.files = {model, {name + ".handles", statements}};
    return scene;
}

SceneText bar_model()
{
    return {"bar.obj", kBar.obj()};
}

/// A bar whose head is moved, in one frame.
ExtremeScene moved_bar(const std::string& group, const std::string& name,
                       const std::string& move, const std::string& regions = "")
{
    return edit_of(group, name, bar_model(),
                   std::string(kRelative) + kEnds + regions + "frame 1\nmove head " +
                       move + "\n");
}

void add_edits(std::vector<ExtremeScene>& scenes)
{
    scenes.push_back(
        edit_of("base", "bar", bar_model(), std::string(kRelative) + kEnds + kBend));
    for (const char* factor : {"1e8", "1e-8", "1e16", "1e-16"})
        scenes.push_back(
            moved_bar("stiffness contrast", fmt::format("stiff-{}", factor),
                      "rotate 1 0 0 60 translate 0 -0.9 -0.2",
                      fmt::format("stiff middle box -1 -1 0.35 2 2 0.65 {}\n", factor)));
    for (const char* turn : {"180", "179.999999", "360", "540"})
        scenes.push_back(moved_bar("rotations", fmt::format("twist-{}", turn),
                                   fmt::format("rotate 0 0 1 {}", turn)));
    for (const char* turn : {"180", "179.999999"})
        scenes.push_back(
            moved_bar("rotations", fmt::format("turn-{}", turn),
                      fmt::format("rotate 1 0 0 {} about 0.5 0.5 0.5", turn)));
    for (const char* way : {"1e3", "1e8"})
        scenes.push_back(moved_bar("teleports", fmt::format("teleport-{}", way),
                                   fmt::format("translate {} 0 0", way)));
    scenes.push_back(moved_bar("handles meet", "collapsed", "translate 0 0 -0.93"));
    scenes.push_back(moved_bar("handles meet", "passed-through", "translate 0 0 -2"));
    scenes.push_back(edit_of("handles meet", "swapped", bar_model(),
                             std::string(kRelative) +
                                 "handle foot halfspace 0 0 -1 -0.07\n"
                                 "handle head halfspace 0 0 1 0.93\nframe 1\n"
                                 "move head translate 0 0 -0.93\n"
                                 "move foot translate 0 0 0.93\n"));
}

/// The bent bar again, in other units and at other places.
void add_scaled(std::vector<ExtremeScene>& scenes)
{
    const auto add = [&](const std::string& name, double scale, double offset)
    {
        const Eigen::Vector3d at(offset, -0.7 * offset, 0.3 * offset);
        ExtremeScene scene =
            edit_of("scale and offset", name, {name + ".obj", kBar.obj(scale, at)},
                    std::string(kRelative) + kEnds + kBend);
        scene.of.same_as = "bar";
        scene.of.scale = scale;
        scene.of.offset = at;
        scenes.push_back(std::move(scene));
    };
    add("scale-1e30", 1e30, 0.0);
    add("scale-1e-30", 1e-30, 0.0);
    add("offset-1e6", 1.0, 1e6);
    add("offset-1e15", 1.0, 1e15);
    add("scale-1e30-offset-1e36", 1e30, 1e36);
}

void add_sizes(std::vector<ExtremeScene>& scenes)
{
    const std::string bend = std::string(kRelative) + kEnds + kBend;
    const Box cube({1, 1, 1}, {4, 4, 4});
    const std::string lifted =
        std::string(kRelative) + "handle all all\nframe 1\nmove all rotate 0 0 1 30\n";
    scenes.push_back(edit_of("sizes", "one-cell", {"cube.obj", cube.obj()}, lifted,
                             "\"across\": 1, \"max_depth\": 0"));
    scenes.push_back(
        edit_of("sizes", "two-cells", {"pair.obj", Box({1, 1, 2}, {2, 2, 4}).obj()},
                std::string(kRelative) + kEnds + "frame 1\nmove head translate 0.3 0 0\n",
                "\"across\": 2, \"max_depth\": 0"));
    scenes.push_back(edit_of(
        "sizes", "chain-10000", {"wire.obj", Box({1, 1, 10000}, {1, 1, 10000}).obj()},
        std::string(kRelative) + "fixed foot halfspace 0 0 -1 -0.001\nhandle head "
                                 "halfspace 0 0 1 0.999\nframe 1\nmove head rotate 1 0 0 "
                                 "30 translate 0 -1000 0\n",
        "\"across\": 10000, \"max_depth\": 0, \"gap\": 0.0001"));
    // A pin a sample, of a wave.
    const Box sheet({100, 100, 1}, {70, 70, 1});
    std::string regions, moves;
    for (std::size_t i = 0; i < sheet.places.size(); ++i)
    {
        const Eigen::Vector3d& x = sheet.places[i];
        regions += fmt::format("pin p{} indices {}\n", i, i);
        moves +=
            fmt::format("move p{} translate 0 0 {}\n", i,
                        shortest(5.0 * std::sin(0.05 * x.x()) * std::cos(0.04 * x.y())));
    }
    scenes.push_back(edit_of("sizes", "handles-10000", {"sheet.obj", sheet.obj()},
                             "cellwarp-handles 1\n" + regions + "frame 1\n" + moves,
                             "\"across\": 142, \"max_depth\": 0"));
    scenes.push_back(edit_of("depths", "depth-0", bar_model(), bend,
                             "\"across\": 4, \"max_depth\": 0"));
    scenes.push_back(edit_of("depths", "depth-4-everywhere", bar_model(), bend,
                             "\"across\": 4, \"max_depth\": 4, \"threshold\": 0, "
                             "\"max_cells\": 20000"));
    scenes.push_back(edit_of("depths", "depth-5-adaptive", bar_model(), bend,
                             "\"across\": 4, \"max_depth\": 5, \"threshold\": 1e-5, "
                             "\"max_cells\": 20000"));
    scenes.push_back(edit_of("depths", "depth-20", bar_model(), bend,
                             "\"across\": 4, \"max_depth\": 20"));
}

void add_degenerate(std::vector<ExtremeScene>& scenes)
{
    std::string flat, line, point;
    for (int j = 0; j <= 10; ++j)
        for (int i = 0; i <= 30; ++i)
            flat += fmt::format("v {} {} 0\n", 0.1 * i, 0.1 * j);
    for (int j = 0; j < 10; ++j)
        for (int i = 0; i < 30; ++i)
        {
            const int at = 31 * j + i + 1;
            flat += fmt::format("f {} {} {} {}\n", at, at + 1, at + 32, at + 31);
        }
    for (int i = 0; i < 200; ++i)
    {
        line += fmt::format("{} {} {}\n", 0.01 * i, 0.02 * i, -0.03 * i);
        point += "1.5 -2.5 0.25\n";
    }
    const std::string ends = std::string(kRelative) +
                             "fixed foot halfspace -1 0 0 -0.1\n"
                             "handle head halfspace 1 0 0 0.9\nframe 1\n";
    scenes.push_back(edit_of("degenerate samples", "coplanar", {"flat.obj", flat},
                             ends + "move head rotate 0 0 1 70\n"));
    scenes.push_back(edit_of("degenerate samples", "coplanar-lifted", {"flat.obj", flat},
                             ends + "move head rotate 0 1 0 70\n"));
    scenes.push_back(edit_of("degenerate samples", "collinear", {"line.xyz", line},
                             ends + "move head rotate 0 1 0 70\n"));
    scenes.push_back(edit_of("degenerate samples", "coincident", {"point.xyz", point},
                             "cellwarp-handles 1\nhandle all all\nframe 1\nmove all "
                             "translate 1 2 3\n"));
}

ExtremeScene in_time(const std::string& group, const std::string& name,
                     const std::string& scene)
{
    ExtremeScene out;
    out.of.group = group;
    out.of.name = name;
    out.scene = scene + "\n";
    return out;
}

void add_rods(std::vector<ExtremeScene>& scenes, std::int64_t long_steps)
{
    for (const char* young : {"1e3", "1e6", "1e9", "1e12", "1e15"})
        for (const double dt : {0.0001, 0.001, 0.0033, 0.01, 0.033})
        {
            scenes.push_back(in_time(
                "rods: E and dt", fmt::format("rod-E{}-dt{}", young, dt),
                fmt::format("{{\"cellwarp\": 1, \"rods\": [{{\"name\": \"rod\", "
                            "\"through\": [[0,0,0],[0.5,0,0],[1,0,0]], \"radius\": 0.01, "
                            "\"E\": {}, \"fixed\": [{{\"at\": 0}}]}}], \"simulate\": "
                            "{{\"dt\": {}, \"duration\": 0.33, \"every\": {}}}}}",
                            young, dt, std::round(0.033 / dt) * dt)));
            scenes.back().of.is_left_alone = true;
        }
    for (const char* friction : {"0", "0.3"})
    {
        scenes.push_back(in_time(
            "rods: sliding for long", fmt::format("sliding-mu{}", friction),
            fmt::format(
                "{{\"cellwarp\": 1, \"rods\": [{{\"name\": \"swing\", "
                "\"through\": [[-0.3,0,0],[0,-0.25,0],[0.3,0,0]], \"spans\": 2, "
                "\"radius\": 0.01, \"E\": 1e5, \"fixed\": [{{\"at\": 0, \"what\": "
                "[\"point\"]}}], \"on\": [{{\"at\": \"sliding\", \"start\": 0.9, "
                "\"point\": [0.26,-0.05,0], \"friction\": {}}}]}}], "
                "\"simulate\": {{\"dt\": 0.001, \"duration\": {}, \"every\": {}, "
                "\"viscosity\": 0.01}}}}",
                friction, 1e-3 * static_cast<double>(long_steps),
                2e-5 * static_cast<double>(long_steps))));
        scenes.back().of.is_left_alone = true;
    }
}

void add_flesh(std::vector<ExtremeScene>& scenes)
{
    const SceneText limb{"limb.obj", Box({0.1, 0.1, 0.4}, {4, 4, 16}).obj()};
    const auto add =
        [&](const std::string& name, const std::string& material, const std::string& dt)
    {
        scenes.push_back(in_time(
            "flesh: nu and dt", name,
            fmt::format("{{\"cellwarp\": 1, \"model\": \"limb.obj\", \"skeleton\": "
                        "{{\"joints\": [{{\"name\": \"a\", \"parent\": null, \"at\": "
                        "[0.05,0.05,0]}}, {{\"name\": \"b\", \"parent\": \"a\", \"at\": "
                        "[0.05,0.05,0.2]}}, {{\"name\": \"c\", \"parent\": \"b\", "
                        "\"at\": [0.05,0.05,0.38]}}], \"keys\": [{{\"time\": 0, "
                        "\"joint\": \"b\", \"rotate\": [1,0,0,0]}}, {{\"time\": 0.2, "
                        "\"joint\": \"b\", \"rotate\": [1,0,0,80]}}], \"across\": 12, "
                        "{}}}, \"simulate\": {{\"dt\": {}, \"duration\": 0.5}}}}",
                        material, dt)));
        scenes.back().files = {limb};
    };
    for (const char* nu : {"0.3", "0.45", "0.49", "0.499", "0.4999"})
        for (const char* dt : {"0.008", "0.05"})
            add(fmt::format("flesh-nu{}-dt{}", nu, dt),
                fmt::format("\"E\": 1e4, \"nu\": {}", nu), dt);
    for (const char* young : {"1e2", "1e9"})
        add(fmt::format("flesh-E{}", young), fmt::format("\"E\": {}, \"nu\": 0.4", young),
            "0.05");
    for (const char* law : {"neo-hookean", "stvk", "linear"})
        add(fmt::format("flesh-{}", law),
            fmt::format("\"E\": 1e4, \"nu\": 0.45, \"law\": \"{}\"", law), "0.05");
}

} // namespace

std::vector<ExtremeScene> extreme_scenes(std::int64_t long_steps)
{
    std::vector<ExtremeScene> scenes;
    add_edits(scenes);
    add_scaled(scenes);
    add_sizes(scenes);
    add_degenerate(scenes);
    add_rods(scenes, long_steps);
    add_flesh(scenes);
    return scenes;
}

} // namespace cellwarp::core
