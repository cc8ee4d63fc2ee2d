// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/session_json.h"

#include <fmt/format.h>

namespace cellwarp
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
    unused.push_back("picking");
    if (parts.normals == 0)
        unused.push_back("normals");
    if (parts.faces == 0)
        unused.push_back("faces");
    return unused;
}

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

Json frame_json(const FrameReport& report)
{
    return {{"frame", report.frame},
            {"iterations", report.solve.iterations},
            {"energy_before", report.solve.energy_before},
            {"energy_after", report.solve.energy_after},
            {"gradient", report.solve.gradient},
            {"stop", stop_name(report.solve.stop)},
            {"handle_residual", report.handle_residual},
            {"max_pair_gap", report.max_pair_gap},
            {"second_start", second_start_name(report.second_start)},
            {"steps", report.steps},
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

} // namespace cellwarp
