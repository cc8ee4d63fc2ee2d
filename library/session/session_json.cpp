// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/session_json.h"

#include <algorithm>

#include <fmt/format.h>

namespace cellwarp::core
{

Json unused_parts(const PartCounts& parts)
{
    Json unused = Json::array();
    if (parts.interior == 0)
        unused.push_back("interior");
    if (parts.refinement == 0)
        unused.push_back("refinement");
    if (parts.blend == 0)
        unused.push_back("blend");
    if (parts.rbf == 0)
        unused.push_back("rbf");
    if (parts.rbf_global == 0)
        unused.push_back("rbf-global");
    if (parts.rods == 0)
        unused.push_back("rods");
    if (parts.skeleton == 0)
        unused.push_back("skeleton");
    if (parts.contact == 0)
        unused.push_back("contact");
    unused.push_back("picking");
    if (parts.normals == 0)
        unused.push_back("normals");
    if (parts.faces == 0)
        unused.push_back("faces");
    return unused;
}

namespace
{

Json contacts_json(const std::optional<CellContactReport>& contacts)
{
    if (!contacts)
        return nullptr;
    return {{"points", contacts->points}, {"deepest", contacts->deepest}};
}

} // namespace

Json skeleton_json(const Session& session)
{
    const std::optional<SkeletonBinding> binding = session.skeleton();
    if (!binding)
        return nullptr;
    const auto triple = [](const Eigen::Vector3d& x) {
        return Json{x.x(), x.y(), x.z()};
    };
    Json bones = Json::array(), joints = Json::array();
    for (const BoneBinding& bone : binding->bones)
        bones.push_back({{"name", bone.name},
                         {"cells", bone.cells},
                         {"radius", bone.radius},
                         {"inside", bone.inside}});
    for (const PosedJoint& joint : session.joints())
        joints.push_back({{"name", joint.name}, {"at", triple(joint.place)}});
    return {{"joints", joints},
            {"bones", bones},
            {"outside", binding->outside},
            {"far_share", binding->far_share},
            {"farthest", triple(binding->farthest)}};
}

std::string skeleton_text(const Session& session)
{
    const std::optional<SkeletonBinding> binding = session.skeleton();
    if (!binding)
        return {};
    std::string text = fmt::format("  skeleton: {} joints\n", binding->joints);
    for (const BoneBinding& bone : binding->bones)
        text += fmt::format("    {}: holds {} cells, radius {:.4g}, {:.0f} % inside\n",
                            bone.name, bone.cells, bone.radius, 100.0 * bone.inside);
    return text;
}

Json parts_json(const std::optional<Parts>& parts)
{
    if (!parts)
        return nullptr;
    Json each = Json::array(), touching = Json::array();
    for (const Parts::Part& part : parts->parts)
        each.push_back(
            {{"first_sample", part.first_sample}, {"samples", part.num_samples}});
    for (const auto& [a, b] : parts->touching)
        touching.push_back({a, b});
    return {{"count", parts->count()}, {"each", each}, {"touching", touching}};
}

std::string parts_text(const std::optional<Parts>& parts)
{
    constexpr std::size_t kMostTold = 6;
    if (!parts || parts->count() < 2)
        return {};
    std::string text = fmt::format("  {} parts", parts->count());
    for (std::size_t k = 0; k < std::min(kMostTold, parts->count()); ++k)
        text +=
            fmt::format("{} {} (sample {} and {} more)", k == 0 ? ":" : ",", k,
                        parts->parts[k].first_sample, parts->parts[k].num_samples - 1);
    text += parts->count() > kMostTold ? ", ...\n" : "\n";
    if (parts->touching.empty())
        return text + "  none of them touch\n";
    text += "  of these touch";
    for (std::size_t k = 0; k < std::min(kMostTold, parts->touching.size()); ++k)
        text += fmt::format("{} {} and {}", k == 0 ? "" : ",", parts->touching[k].first,
                            parts->touching[k].second);
    return text + (parts->touching.size() > kMostTold
                       ? fmt::format(", ... ({} pairs)\n", parts->touching.size())
                       : "\n");
}

Json frame_json(const FrameReport& report)
{
    Json pins = Json::array();
    for (const PinReport& pin : report.pins)
    {
        Json matrix = Json::array(); // row-major, as in handle files
        for (int row = 0; row < 4; ++row)
            for (int column = 0; column < 4; ++column)
                matrix.push_back(pin.motion(row, column));
        pins.push_back(
            {{"name", pin.name}, {"degrees", pin.degrees}, {"matrix", matrix}});
    }
    return {{"frame", report.frame},
            {"iterations", report.solve.iterations},
            {"energy_before", report.solve.energy_before},
            {"energy_after", report.solve.energy_after},
            {"gradient", report.solve.gradient},
            {"stop", stop_name(report.solve.stop)},
            {"handle_residual", report.handle_residual},
            {"max_pair_gap", report.max_pair_gap},
            {"largest_rise", report.largest_rise},
            {"pins", pins},
            {"contacts", contacts_json(report.contacts)},
            {"second_start", second_start_name(report.second_start)},
            {"steps", report.steps},
            {"iterations_in_larger_cells", report.iterations_in_larger_cells},
            {"cells", report.cells},
            {"recuts", report.refinements},
            {"cells_at_depth_limit", report.cells_at_limit},
            {"linear_steps", report.solve.linear_steps},
            {"refreshes", report.solve.refreshes},
            {"backward_error", report.solve.backward_error},
            {"damped_factorisations", report.solve.damped_factorisations},
            {"ms",
             {{"cells", report.cells_ms},
              {"solve", report.solve_ms},
              {"linearise", report.solve.ms.linearise},
              {"linear", report.solve.ms.linear},
              {"factorise", report.solve.ms.factorise},
              {"line_search", report.solve.ms.line_search},
              {"stability", report.solve.ms.stability},
              {"field_fit", report.fit_ms},
              {"field_apply", report.apply_ms}}}};
}

} // namespace cellwarp::core
