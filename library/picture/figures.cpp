// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/picture/figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/formats/face_triangles.h"
#include "library/picture/role_colour.h"
#include "octree/base/index.h"
#include "octree/material.h"

namespace cellwarp::core
{

namespace
{

constexpr Colour kPlain = {205, 208, 214};

/// Radii of the lines of rods and curves and of what holds them [diagonal].
constexpr double kThread = 0.005, kHeld = 0.012;
constexpr Colour kHeldColour = {60, 60, 66};

/// As balls so close that they look like a thread.
void add_thread(std::span<const Eigen::Vector3d> line, double radius, Colour colour,
                std::vector<Figure::Bead>& beads)
{
    constexpr int kMost = 200; // between two places of the line
    for (std::size_t k = 0; k + 1 < line.size(); ++k)
    {
        const double length = (line[k + 1] - line[k]).norm();
        const int count = static_cast<int>(
            std::clamp(std::ceil(3.0 * length / radius), 1.0, double(kMost)));
        for (int i = 0; i < count; ++i)
            beads.push_back({line[k] + (line[k + 1] - line[k]) * (double(i) / count),
                             radius, colour});
    }
}

/// Balls that just cover the gaps of a cloud.
constexpr double kBallShare = 0.7;

/// A thread along each of the lines that a file draws between its samples.
void add_drawn_lines(const Geometry& geometry, Figure& figure)
{
    const double diagonal = bounding_box(figure.points).size().norm();
    for (const auto& [a, b] : geometry.lines)
        add_thread(std::array{figure.points[a], figure.points[b]}, kThread * diagonal,
                   figure.colours[a], figure.balls);
}

/// Without the lines that are drawn between them.
Figure samples_of(const Geometry& geometry)
{
    Figure figure;
    figure.points = geometry.samples;
    figure.triangles = triangles_of(geometry);
    figure.colours = geometry.colours;
    if (figure.colours.empty())
        figure.colours.assign(figure.points.size(), kPlain);
    if (figure.triangles.empty() && geometry.lines.empty())
    {
        const ModelBox box = bounding_box(figure.points);
        const double spacing = point_spacing(figure.points);
        figure.point_radius =
            kBallShare * (spacing > 0 ? spacing : std::max(1e-3, box.size().norm()));
    }
    return figure;
}

} // namespace

Figure figure_of(const Geometry& geometry)
{
    Figure figure = samples_of(geometry);
    add_drawn_lines(geometry, figure);
    return figure;
}

Figure figure_of(const std::vector<Geometry>& parts)
{
    Figure figure;
    for (const Geometry& part : parts)
    {
        const Figure more = figure_of(part);
        const auto first = static_cast<std::uint32_t>(figure.points.size());
        figure.points.insert(figure.points.end(), more.points.begin(), more.points.end());
        figure.colours.insert(figure.colours.end(), more.colours.begin(),
                              more.colours.end());
        for (const std::array<std::uint32_t, 3>& t : more.triangles)
            figure.triangles.push_back({first + t[0], first + t[1], first + t[2]});
        figure.balls.insert(figure.balls.end(), more.balls.begin(), more.balls.end());
        figure.point_radius = std::max(figure.point_radius, more.point_radius);
    }
    return figure;
}

Figure figure_of(const Session& session)
{
    return figure_of(session, session.deformed().samples);
}

Figure figure_of(const Session& session, const std::vector<Eigen::Vector3d>& samples)
{
    Figure figure = samples_of(session.geometry());
    figure.points = samples;
    if (session.geometry().colours.empty())
        figure.colours.assign(figure.points.size(), kFreeColour);
    if (const CellSystem* const system = session.system())
        for (const Region& region : system->regions().regions())
            for (const std::uint32_t i : region.samples)
                figure.colours[i] = role_colour(region.role);
    add_drawn_lines(session.geometry(), figure);
    const double diagonal = bounding_box(figure.points).size().norm();
    for (const RodReport& rod : session.rods())
    {
        const Colour colour =
            rod.is_rod ? role_colour(Role::Rod) : role_colour(Role::Curve);
        const double thin =
            std::min(kThread * diagonal, rod.is_rod ? rod.radius : INFINITY);
        add_thread(rod.line, thin, colour, figure.beads);
        for (const RodReport::Pin& pin : rod.pins)
            figure.beads.push_back({pin.place, kHeld * diagonal, role_colour(Role::Pin)});
        for (std::size_t k = 0; k < rod.points.size(); ++k)
            if (rod.is_rod && rod.holds[k].place)
                figure.beads.push_back({rod.points[k], kHeld * diagonal, kHeldColour});
    }
    add_joints(figure, session.joints());
    return figure;
}

Eigen::AlignedBox3d box_of_region(const Session& session, const std::string& name)
{
    if (const CellSystem* const system = session.system())
        for (const Region& region : system->regions().regions())
            if (region.name == name)
            {
                Eigen::AlignedBox3d box;
                for (const std::uint32_t i : region.samples)
                    box.extend(session.deformed().samples[i]);
                return box;
            }
    throw wrong_flag("--focus", "there is no region " + in_quotes(name));
}

void add_joints(Figure& figure, const std::vector<PosedJoint>& joints)
{
    const double diagonal = bounding_box(figure.points).size().norm();
    for (const PosedJoint& joint : joints)
    {
        figure.beads.push_back({joint.place, kHeld * diagonal, kHeldColour});
        if (joint.parent >= 0)
            add_thread(std::array{joints[idx(joint.parent)].place, joint.place},
                       kThread * diagonal, role_colour(Role::Bone), figure.beads);
    }
}

void add_lattice(Figure& figure, const std::vector<std::array<Eigen::Vector3d, 8>>& cells)
{
    figure.boxes.insert(figure.boxes.end(), cells.begin(), cells.end());
    figure.box_colours.resize(figure.boxes.size(), kPlain);
}

void add_cells(Figure& figure, const Session& session)
{
    const CellSystem* const system = session.system();
    if (!system)
        return;
    for (std::size_t c = 0; c < system->body().cells.size(); ++c)
    {
        const Cell& cell = system->body().cells.cells[c];
        const Pose& pose = system->poses()[c];
        std::array<Eigen::Vector3d, 8> corners;
        for (std::size_t k = 0; k < 8; ++k)
        {
            const Eigen::Vector3d side(k & 1 ? 0.5 : -0.5, k & 2 ? 0.5 : -0.5,
                                       k & 4 ? 0.5 : -0.5);
            corners[k] = system->rest().frame.to_model(
                image(pose, cell.centre, cell.box_centre + cell.edge * side));
        }
        figure.boxes.push_back(corners);
        const int owner = system->region_of_cell()[c];
        figure.box_colours.push_back(
            owner < 0 ? kFreeColour : role_colour(system->regions()[idx(owner)].role));
    }
}

} // namespace cellwarp::core
