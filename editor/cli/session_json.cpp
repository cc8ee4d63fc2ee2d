// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/session_json.h"

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
    for (const char* part : {"skeleton", "picking"})
        unused.push_back(part);
    if (parts.normals == 0)
        unused.push_back("normals");
    if (parts.faces == 0)
        unused.push_back("faces");
    return unused;
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
