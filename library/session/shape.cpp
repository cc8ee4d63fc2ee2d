// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <unordered_map>

#include "io/formats/face_triangles.h"
#include "library/session/body.h"
#include "library/session/sample_normals.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Samples of one thread's part at the least.
constexpr std::size_t kSampleGrain = 4096;

/// Meshes with fewer triangles need no coarse ones.
constexpr std::size_t kManyTriangles = 300000;
/// Boxes along the longest side whose samples are drawn as one: some 100,000 triangles.
constexpr double kCoarseBoxes = 112.0;

/// Triangles between one sample of each box of a grid: those whose corners lie in three
/// boxes, each once for the boxes that it joins.
std::vector<std::uint32_t> coarse_triangles(const std::vector<Eigen::Vector3d>& samples,
                                            const std::vector<Triangle>& triangles,
                                            std::span<const std::uint32_t> place_of)
{
    const ModelBox box = bounding_box(samples);
    const double edge = box.size().maxCoeff() / kCoarseBoxes;
    if (triangles.size() < kManyTriangles || !(edge > 0))
        return {};
    const std::int64_t row = static_cast<std::int64_t>(kCoarseBoxes) + 2;
    std::unordered_map<std::int64_t, std::uint32_t> first_in_box;
    std::vector<std::uint32_t> chosen(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i)
    {
        const Eigen::Array3d at = ((samples[i] - box.low) / edge).array().floor();
        const std::int64_t key = static_cast<std::int64_t>(at[0]) +
                                 row * (static_cast<std::int64_t>(at[1]) +
                                        row * static_cast<std::int64_t>(at[2]));
        chosen[i] =
            first_in_box.try_emplace(key, static_cast<std::uint32_t>(i)).first->second;
    }
    std::vector<std::array<std::uint32_t, 3>> coarse;
    for (const Triangle& triangle : triangles)
    {
        std::array<std::uint32_t, 3> corners{};
        for (std::size_t k = 0; k < 3; ++k)
            corners[k] = place_of[chosen[triangle[k]]];
        if (corners[0] == corners[1] || corners[1] == corners[2] ||
            corners[2] == corners[0])
            continue;
        std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()),
                    corners.end());
        coarse.push_back(corners);
    }
    std::sort(coarse.begin(), coarse.end());
    coarse.erase(std::unique(coarse.begin(), coarse.end()), coarse.end());
    std::vector<std::uint32_t> flat;
    for (const std::array<std::uint32_t, 3>& corners : coarse)
        flat.insert(flat.end(), corners.begin(), corners.end());
    return flat;
}

} // namespace

std::shared_ptr<const ShapeLayout> layout_of(const Geometry& geometry,
                                             std::span<const std::uint32_t> order)
{
    auto layout = std::make_shared<ShapeLayout>();
    if (order.empty())
    {
        layout->order.resize(geometry.samples.size());
        std::iota(layout->order.begin(), layout->order.end(), 0u);
    }
    else
        layout->order.assign(order.begin(), order.end());
    layout->place_of.resize(layout->order.size());
    for (std::size_t place = 0; place < layout->order.size(); ++place)
        layout->place_of[layout->order[place]] = static_cast<std::uint32_t>(place);
    const std::vector<Triangle> triangles = triangles_of(geometry);
    layout->triangles.resize(3 * triangles.size());
    parallel_ranges(triangles.size(), kSampleGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t t = begin; t < end; ++t)
                            for (std::size_t k = 0; k < 3; ++k)
                                layout->triangles[3 * t + k] =
                                    layout->place_of[triangles[t][k]];
                    });
    layout->coarse_triangles =
        coarse_triangles(geometry.samples, triangles, layout->place_of);
    for (const auto& line : geometry.lines)
        for (const std::uint32_t sample : line)
            layout->lines.push_back(layout->place_of[sample]);
    return layout;
}

ShownShape shown_at(const Geometry& geometry, std::span<const Eigen::Vector3d> samples,
                    std::shared_ptr<const ShapeLayout> layout, const WorkFrame& view)
{
    ShownShape shape;
    shape.layout = std::move(layout);
    shape.positions.resize(3 * samples.size());
    const std::vector<Eigen::Vector3d> normals = sample_normals(geometry, samples);
    shape.normals.resize(3 * normals.size());
    parallel_ranges(samples.size(), kSampleGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t place = begin; place < end; ++place)
                        {
                            const std::uint32_t i = shape.layout->order[place];
                            Eigen::Map<Eigen::Vector3f>(&shape.positions[3 * place]) =
                                view.to_work(samples[i]).cast<float>();
                            if (!normals.empty())
                                Eigen::Map<Eigen::Vector3f>(&shape.normals[3 * place]) =
                                    normals[i].cast<float>();
                        }
                    });
    return shape;
}

Eigen::Matrix4d view_of_work(const WorkFrame& work, const WorkFrame& view)
{
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topRightCorner<3, 1>() = view.to_work(work.to_model(Eigen::Vector3d::Zero()));
    for (int k = 0; k < 3; ++k)
        matrix.block<3, 1>(0, k) =
            view.vector_to_work(work.vector_to_model(Eigen::Vector3d::Unit(k)));
    return matrix;
}

namespace
{

/// The joints of a system now. One without material of its own goes with the one above
/// it.
std::vector<PosedJoint> joints_of(const CellSystem& system)
{
    std::vector<PosedJoint> joints;
    const SkeletonHandle& skeleton = *system.regions().skeleton();
    std::vector<Motion> motions(skeleton.size());
    std::vector<bool> is_known(skeleton.size(), false);
    for (std::size_t r = 0; r < system.regions().size(); ++r)
        if (const auto& bone = system.regions()[r].bone)
        {
            motions[bone->joint] = system.motions()[r];
            is_known[bone->joint] = true;
        }
    for (std::size_t j = 0; j < skeleton.size(); ++j)
    {
        const int parent = skeleton.parent(j);
        if (!is_known[j] && parent >= 0)
            motions[j] = motions[idx(parent)];
        joints.push_back({skeleton.statement(j).name, parent,
                          system.rest().frame.to_model(motions[j](skeleton.place(j)))});
    }
    return joints;
}

} // namespace

std::vector<ShownLine> shown_joints(std::span<const PosedJoint> joints,
                                    const WorkFrame& view)
{
    std::vector<ShownLine> lines;
    for (const PosedJoint& joint : joints)
    {
        const Eigen::Vector3d place = view.to_work(joint.place);
        ShownLine& line = lines.emplace_back();
        line.name = joint.name;
        line.is_rod = false;
        line.is_bone = true;
        if (joint.parent >= 0)
            line.places = {view.to_work(joints[idx(joint.parent)].place), place};
        line.points = {place};
        line.tangents = {Eigen::Vector3d::Zero()};
        line.turns = {0.0};
    }
    return lines;
}

std::vector<ShownLine> shown_lines(const CellSystem& system, const WorkFrame& view)
{
    constexpr int kPlacesOfLine = 65;
    std::vector<ShownLine> lines;
    const WorkFrame& work = system.rest().frame;
    for (std::size_t r = 0; r < system.regions().size(); ++r)
    {
        const Region& region = system.regions()[r];
        if (!region.spline)
            continue;
        const SplineState& now = *system.spline(r);
        const Motion& motion = system.motions()[r];
        const auto seen = [&](const Eigen::Vector3d& place)
        { return view.to_work(work.to_model(motion(place))); };
        ShownLine& line = lines.emplace_back();
        line.name = region.name;
        line.is_rod = region.is_rod();
        for (int k = 0; k < kPlacesOfLine; ++k)
            line.places.push_back(
                seen(now.at(region.spline->parameter_of_share(k / (kPlacesOfLine - 1.0)))
                         .place));
        for (const Eigen::Vector3d& point : now.points())
        {
            const std::size_t k = line.points.size();
            line.points.push_back(seen(point));
            line.tangents.push_back(
                region.spline->has_frame_at(k)
                    ? Eigen::Vector3d(view.axes * work.axes.transpose() * motion.R *
                                      now.frame_at_point(k).col(2))
                    : Eigen::Vector3d::Zero());
            line.turns.push_back(region.spline->has_frame_at(k)
                                     ? now.turn_at_point(k) * 180.0 / std::numbers::pi
                                     : 0.0);
        }
    }
    if (system.regions().skeleton())
        for (ShownLine& line : shown_joints(joints_of(system), view))
            lines.push_back(std::move(line));
    return lines;
}

ShownCells shown_cells(const CellSystem& system, std::span<const Pose> poses,
                       const WorkFrame& view)
{
    const Body& body = system.body();
    const double diagonal = system.rest().frame.diagonal();
    ShownCells shown;
    shown.to_view = view_of_work(system.rest().frame, view);
    shown.cells.resize(body.cells.size());
    for (std::size_t c = 0; c < shown.cells.size(); ++c)
    {
        const Cell& cell = body.cells.cells[c];
        ShownCell& out = shown.cells[c];
        out.depth = body.octree[cell.leaf].level;
        out.region = system.region_of_cell()[c];
        for (std::size_t k = 0; k < 8; ++k)
        {
            const Eigen::Vector3d side(k & 1 ? 0.5 : -0.5, k & 2 ? 0.5 : -0.5,
                                       k & 4 ? 0.5 : -0.5);
            out.corners[k] =
                image(poses[c], cell.centre, cell.box_centre + cell.edge * side)
                    .cast<float>();
        }
    }
    for (const GlueFace& face : system.glue().faces)
    {
        ShownCell& a = shown.cells[idx(face.a)];
        ShownCell& b = shown.cells[idx(face.b)];
        const float gap = static_cast<float>(
            std::sqrt(glue_energy(face, poses[idx(face.a)], poses[idx(face.b)]) /
                      face.stiffness) /
            diagonal);
        a.gap = std::max(a.gap, gap);
        b.gap = std::max(b.gap, gap);
    }
    return shown;
}

} // namespace cellwarp::core
