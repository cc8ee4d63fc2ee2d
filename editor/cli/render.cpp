// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/command.h"

#include <filesystem>
#include <memory>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "editor/cli/pictures.h"
#include "editor/cli/session_flags.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/output_set.h"
#include "io/base/text.h"
#include "io/formats/geometry_file.h"
#include "library/picture/figures.h"
#include "library/session/json.h"
#include "library/time/simulation.h"

namespace cellwarp::core
{

namespace
{

struct RenderFlags
{
    SessionFlags session;
    std::string output, compare, frame = "rest", size = "1000x800", up = "y", focus;
    std::vector<double> view = {PictureOptions().azimuth, PictureOptions().elevation};
    bool shows_cells = false, shows_axes = false;
    std::int64_t strip = 0; ///< frames side by side; 0: one picture
};

PictureOptions picture_options(const RenderFlags& flags)
{
    PictureOptions options;
    const std::size_t cross = flags.size.find('x');
    const std::optional<std::int64_t> width = parse_integer(flags.size.substr(0, cross));
    const std::optional<std::int64_t> height =
        cross == std::string::npos ? std::nullopt
                                   : parse_integer(flags.size.substr(cross + 1));
    if (!width || !height || *width < 1 || *height < 1 || *width > 8192 || *height > 8192)
        throw wrong_flag("--size", "got " + in_quotes(flags.size) +
                                       ", need WIDTHxHEIGHT up to 8192x8192");
    options.width = static_cast<int>(*width);
    options.height = static_cast<int>(*height);
    options.azimuth = flags.view[0];
    options.elevation = flags.view[1];
    options.up = flags.up == "x" ? 0 : flags.up == "y" ? 1 : 2;
    options.shows_axes = flags.shows_axes;
    return options;
}

/// A number, or nothing for "last". Throws Fault::Usage.
std::optional<std::int64_t> number_of(const std::string& frame)
{
    const std::optional<std::int64_t> number =
        frame == "last" ? std::nullopt : parse_integer(frame);
    if (frame != "last" && !number)
        throw wrong_flag("--frame",
                         "got " + in_quotes(frame) + ", need rest, last or a number");
    return number;
}

/// Solves up to the frame that is wanted: "rest", "last" or a number.
void play(Session& session, const std::string& wanted)
{
    if (wanted == "rest")
        return;
    const std::optional<std::int64_t> number = number_of(wanted);
    while (const std::optional<std::int64_t> next = session.upcoming_frame())
    {
        session.next_frame(true);
        if (number && *next == *number)
            return;
    }
    if (number)
        throw wrong_flag("--frame", "the handle file has no frame " + wanted);
}

/// \p count of 0 ... last, evenly, both ends among them.
std::vector<std::int64_t> spread(std::int64_t last, std::int64_t count)
{
    std::vector<std::int64_t> chosen;
    const std::int64_t gaps = std::max<std::int64_t>(1, std::min(count - 1, last));
    for (std::int64_t k = 0; k <= gaps && k < count && k <= last; ++k)
        chosen.push_back((k * last + gaps / 2) / gaps);
    return chosen;
}

/// Figures of a scene in time. \p problems: gets those of all frames up to the last one.
std::vector<Figure> figures_of(Simulation& simulation, const RenderFlags& flags,
                               std::vector<std::string>& problems)
{
    constexpr int kAround = 24; // corners of a tube
    // An equilibrium is shown before and after its step.
    const std::int64_t last = simulation.is_static() ? 1 : simulation.last_frame();
    std::vector<std::int64_t> frames = {0};
    if (flags.strip > 0)
        frames = spread(last, flags.strip);
    else if (flags.frame != "rest")
    {
        frames[0] = number_of(flags.frame).value_or(last);
        if (frames[0] < 0 || frames[0] > last)
            throw wrong_flag("--frame",
                             fmt::format("the scene has frames 0 to {}", last));
    }
    std::vector<Figure> figures;
    std::int64_t now = 0;
    for (const std::int64_t frame : frames)
    {
        while (now < frame)
        {
            simulation.next_frame({}, ++now == frame);
            const std::vector<std::string> more = simulation.report().problems;
            problems.insert(problems.end(), more.begin(), more.end());
        }
        const ShapesInTime shapes = simulation.shapes(kAround);
        if (flags.shows_cells && shapes.cells.empty())
            throw wrong_flag("--cells", "rods have none");
        Figure& figure = figures.emplace_back(figure_of(shapes.parts));
        add_joints(figure, shapes.joints);
        if (flags.shows_cells)
            add_lattice(figure, shapes.cells);
    }
    return figures;
}

/// \p options: told what --focus names.
std::vector<Figure> figures_of(Session& session, std::size_t num_frames,
                               const RenderFlags& flags, PictureOptions& options)
{
    std::vector<Figure> figures;
    const auto add = [&]
    {
        figures.push_back(figure_of(session));
        if (!flags.focus.empty())
        {
            if (!options.focus)
                options.focus.emplace();
            options.focus->extend(box_of_region(session, flags.focus));
        }
        if (flags.shows_cells)
            add_cells(figures.back(), session);
    };
    if (flags.strip == 0)
    {
        play(session, flags.frame);
        add();
        return figures;
    }
    std::int64_t now = 0;
    for (const std::int64_t frame :
         spread(static_cast<std::int64_t>(num_frames), flags.strip))
    {
        for (; now < frame; ++now)
            session.next_frame(true);
        add();
    }
    return figures;
}

/// Two files by their names; where these are the same, with the folders that they are in.
std::pair<std::string, std::string> names_of(const std::string& a, const std::string& b)
{
    const std::filesystem::path x = a, y = b;
    if (x.filename() != y.filename())
        return {x.filename().string(), y.filename().string()};
    const auto name = [](const std::filesystem::path& file)
    { return (file.parent_path().filename() / file.filename()).string(); };
    return {name(x), name(y)};
}

int run(const RenderFlags& flags, const CommonFlags& common)
{
    PictureOptions options = picture_options(flags);
    check_stdout(flags.output, common);
    check_output(flags.output, common.overwrite());
    if (extension_of(flags.output) != "png" && flags.output != "-")
        throw Error(Fault::Usage, at({flags.output, 0, ""}, "a picture is a .png"));
    if (flags.strip > 0 && flags.frame != "rest")
        throw Error(Fault::Usage, "--strip and --frame: one of them");
    std::vector<Figure> figures;
    std::vector<std::string> warnings, problems;
    const SceneFile scene = scene_or_model(flags.session.model);
    if (!flags.focus.empty() && (scene.is_in_time() || !flags.session.has_session()))
        throw Error(Fault::Usage,
                    "--focus needs a region: of a scene, --handles, --fix or "
                    "--handle");
    if (scene.is_in_time())
    {
        Simulation simulation(read_simulation(scene));
        figures = figures_of(simulation, flags, problems);
        warnings = simulation.warnings();
    }
    else if (!flags.session.has_session() && !flags.shows_cells)
    {
        if (flags.frame != "rest" || flags.strip > 0)
            throw Error(Fault::Usage,
                        std::string(flags.strip > 0 ? "--strip" : "--frame") +
                            " needs a scene or --handles");
        figures.push_back(figure_of(
            read_geometry(flags.session.model, {flags.session.columns}).geometry));
    }
    else
    {
        SessionRequest request = read_request(flags.session, ForTime::No, scene);
        if (!request.handles || request.handles->stages.empty() ||
            request.handles->stages.front().frames.empty())
        {
            // Cells exist where something is to be deformed: one frame at rest.
            if (!request.handles)
                request.handles.emplace();
            if (request.handles->stages.empty())
                request.handles->stages.emplace_back();
            request.handles->stages.front().frames.push_back(
                {.number = 0, .moves = {}, .is_asked = false});
        }
        std::size_t num_frames = 0;
        for (const Stage& stage : request.handles->stages)
            num_frames += stage.frames.size();
        Session session(read_geometry(request.scene.model, request.read).geometry,
                        std::move(*request.handles), request.settings);
        figures = figures_of(session, num_frames, flags, options);
        warnings = session.warnings();
    }
    if (!flags.compare.empty())
    {
        const auto [left, right] = names_of(flags.compare, flags.session.model);
        for (Figure& figure : figures)
            figure.label = right;
        figures.insert(
            figures.begin(),
            figure_of(read_geometry(flags.compare, {flags.session.columns}).geometry));
        figures.front().label = left;
    }
    const bool is_converged = problems.empty();
    if (!is_converged)
        warnings.push_back("a frame did not converge: see cellwarp simulate");
    print_warnings(warnings, common);
    OutputSet outputs(common.overwrite());
    outputs.write(flags.output, png_bytes(draw(figures, options)));
    if (common.is_json)
        outputs.write("-", json_text({{"input", flags.session.model},
                                      {"output", flags.output},
                                      {"figures", figures.size()},
                                      {"width", options.width * figures.size()},
                                      {"height", options.height},
                                      {"converged", is_converged},
                                      {"warnings", warnings}}));
    outputs.commit();
    return is_converged ? 0 : kNotConverged;
}

/// Of one figure of a report [pixel]: three side by side fill a page.
constexpr int kReportWidth = 560, kReportHeight = 480;

} // namespace

std::optional<Pictures> make_pictures()
{
    const auto figures = std::make_shared<std::vector<Figure>>();
    const auto add = [figures](const Session& session,
                               const std::vector<Eigen::Vector3d>& samples,
                               bool shows_cells)
    {
        Figure& figure = figures->emplace_back(figure_of(session, samples));
        if (shows_cells)
            add_cells(figure, session);
    };
    const auto png = [figures]
    {
        PictureOptions options;
        options.width = kReportWidth;
        options.height = kReportHeight;
        return png_bytes(draw(*figures, options));
    };
    return Pictures{add, png};
}

void add_render(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<RenderFlags>();
    CLI::App* command = app.add_subcommand(
        "render", "A picture without a display.\n\n"
                  "  cellwarp render bent.obj -o bent.png --compare bar.obj\n"
                  "  cellwarp render samples/bar.json --frame last --cells -o cells.png\n"
                  "  cellwarp render samples/rods/pendulum.json --strip=7 --size 160x320 "
                  "-o swing.png\n");
    flags->session.add_to(*command);
    command->add_option("-o,--output", flags->output, "picture (.png)")->required();
    command->add_flag("--cells", flags->shows_cells, "show the cells, as glass");
    command->add_option("--compare", flags->compare,
                        "geometry file to draw on the left; both have their names above");
    command->add_flag("--axes", flags->shows_axes,
                      "three edges of the box of all that is shown, with numbers");
    command->add_option("--focus", flags->focus,
                        "REGION of a scene or its flags that fills the picture");
    command->add_option("--frame", flags->frame,
                        "of a scene: rest, last or a frame's number (default rest)");
    command
        ->add_flag("--strip{6}", flags->strip,
                   "frames side by side, evenly from the first to the last: six, or "
                   "--strip=N")
        ->check(CLI::Range(1, 64));
    command
        ->add_option(
            "--view", flags->view,
            "azimuth and elevation of the viewer [degree] (default -35 20): 0 0 from "
            "+z, -90 0 from +x, 180 0 from -z, 90 0 from -x, 0 90 from above; with "
            "--up z 0 0 from -y, with --up x from +y")
        ->expected(2);
    command->add_option("--up", flags->up, "axis that points up (default y)")
        ->check(CLI::IsMember({"x", "y", "z"}));
    command->add_option("--size", flags->size, "WIDTHxHEIGHT of one figure [pixel]");
    command->callback([flags, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp::core
