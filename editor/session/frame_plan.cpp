// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/frame_plan.h"

#include <algorithm>
#include <map>

#include <fmt/format.h>

#include "io/error.h"

namespace cellwarp
{

namespace
{

/// Two motions of one sample that differ by no more are one [diagonal].
constexpr double kSameMotion = 1e-12;

/// A handle that travels farther than this gets a warning [diagonal].
constexpr double kExtremeMove = 100.0;

/// Regions that hold one sample must move it alike.
void check_overlaps(const std::vector<Motion>& motions, const RegionSet& regions,
                    const RestShape& rest, const std::string& file, std::int64_t line)
{
    for (const RegionSet::Overlap& overlap : regions.overlaps())
    {
        const Eigen::Vector3d& x = rest.samples[overlap.sample];
        const double apart = (motions[overlap.a](x) - motions[overlap.b](x)).norm();
        const double scale =
            std::max(rest.frame.diagonal(), motions[overlap.a](x).norm());
        if (!(apart <= kSameMotion * scale))
            throw malformed(
                {file, line, regions[overlap.a].name},
                fmt::format("and {} (line {}) both hold sample {} and move it "
                            "differently ({:.3g} of the diagonal apart)",
                            regions[overlap.b].name, regions[overlap.b].line,
                            overlap.sample, apart / rest.frame.diagonal()));
    }
}

} // namespace

bool FramePlan::stands() const
{
    return std::all_of(paths.begin(), paths.end(),
                       [](const HandleTrajectory& path)
                       {
                           const Motion from = path.at(0.0), to = path.at(1.0);
                           return from.R == to.R && from.t == to.t;
                       });
}

bool FramePlan::is_wound() const
{
    return std::any_of(paths.begin(), paths.end(),
                       [](const HandleTrajectory& path) { return path.is_wound(); });
}

std::vector<Motion> FramePlan::motions(double t) const
{
    std::vector<Motion> motions;
    for (const HandleTrajectory& path : paths)
        motions.push_back(path.at(t));
    return motions;
}

FramePlan plan_frame(const FrameStatement& frame, const RegionSet& regions,
                     const Units& units, const RestShape& rest, const std::string& file,
                     std::vector<std::vector<Step>>& steps,
                     std::vector<std::string>& warnings)
{
    const double diagonal = rest.frame.diagonal();
    std::map<std::string, const Move*> moves;
    for (const Move& move : frame.moves)
        moves[move.region] = &move;
    FramePlan plan;
    std::vector<Motion> motions;
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        const ModelBox& box = regions.box(r);
        std::vector<Step> next = steps[r];
        if (const auto found = moves.find(regions[r].name); found != moves.end())
        {
            const Move& move = *found->second;
            const bool is_placed = std::any_of(
                move.operations.begin(), move.operations.end(),
                [](const Operation& o) { return o.kind == Operation::Kind::To; });
            if (is_placed && box.size().norm() > 1e-9 * diagonal)
                throw malformed({file, move.line, move.region},
                                "'to' needs a pin of one place; this one has " +
                                    std::to_string(regions[r].samples.size()) +
                                    " samples, use translate");
            next = steps_of(move, units, regions.centre(r), box.low, file, warnings);
        }
        const HandleTrajectory& path = plan.paths.emplace_back(steps[r], next);
        steps[r] = std::move(next);
        motions.push_back(path.at(1.0));
        if (!regions[r].prescribes())
            continue;
        plan.num_parts =
            std::max(plan.num_parts, path.num_parts(box.low, box.high, diagonal));
        if (diagonal > 0 && (motions.back()(box.centre()) - box.centre()).norm() >
                                kExtremeMove * diagonal)
            warnings.push_back(fmt::format("frame {}: {} moves by more than {} "
                                           "diagonals: the shape is stretched "
                                           "to an extreme",
                                           frame.number, regions[r].name, kExtremeMove));
    }
    check_overlaps(motions, regions, rest, file, frame.line);
    return plan;
}

} // namespace cellwarp
