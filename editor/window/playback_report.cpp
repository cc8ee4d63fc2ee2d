// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include "editor/window/playback.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Json = nlohmann::ordered_json;

double rounded_ms(double ms)
{
    return std::round(ms * 1000.0) / 1000.0;
}

Json summary_of(std::vector<double> values)
{
    if (values.empty())
        return nullptr;
    std::sort(values.begin(), values.end());
    const auto at = [&](double share)
    {
        const double place = share * static_cast<double>(values.size() - 1);
        return rounded_ms(values[idx(std::lround(place))]);
    };
    return {{"median", at(0.5)}, {"p95", at(0.95)}, {"worst", at(1.0)}};
}

/// Of the frames for which the view was drawn.
std::vector<double> column(const std::vector<FrameParts>& frames,
                           double FrameParts::*part)
{
    std::vector<double> values;
    for (const FrameParts& frame : frames)
        if (frame.is_drawn)
            values.push_back(frame.*part);
    return values;
}

} // namespace

std::string report_text(const PlaybackReport& report)
{
    Json json = {{"model", report.model},       {"samples", report.samples},
                 {"renderer", report.renderer}, {"size", {report.width, report.height}},
                 {"drags", Json::array()},      {"waits", Json::array()}};
    for (const DragTimes& drag : report.drags)
        json["drags"].push_back(
            {{"line", drag.line},
             {"events", drag.frames.size()},
             {"drawn_frames", column(drag.frames, &FrameParts::total).size()},
             {"solved_frames", drag.solved},
             {"frame_ms", summary_of(column(drag.frames, &FrameParts::total))},
             {"update_ms", summary_of(column(drag.frames, &FrameParts::update))},
             {"upload_ms", summary_of(column(drag.frames, &FrameParts::upload))},
             {"draw_ms", summary_of(column(drag.frames, &FrameParts::draw))},
             {"solve_ms", summary_of(drag.solve_ms)},
             {"blend_ms", summary_of(drag.blend_ms)},
             {"latency_ms", summary_of(drag.latency_ms)},
             {"release_ms",
              {{"total", rounded_ms(drag.release.total)},
               {"update", rounded_ms(drag.release.update)},
               {"upload", rounded_ms(drag.release.upload)},
               {"draw", rounded_ms(drag.release.draw)},
               {"cpu", rounded_ms(drag.release_cpu_ms)},
               {"is_coarse", drag.release.is_coarse}}}});
    for (const WaitTime& wait : report.waits)
        json["waits"].push_back({{"line", wait.line},
                                 {"shape_ms", rounded_ms(wait.shape_ms)},
                                 {"ms", rounded_ms(wait.ms)}});
    return json.dump(2) + "\n";
}

} // namespace cellwarp::core
