// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/edit.h"

#include <algorithm>

#include "io/base/error.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

/// What an edit asks of the document and is not so: a journal of another document.
[[noreturn]] void misfit(const Edit& edit, const char* what)
{
    throw Error(Fault::Malformed,
                "the edit " + in_quotes(edit.name) + " does not fit: " + what);
}

Stage& last_stage(Edited& edited)
{
    return edited.handles.stages.back();
}

/// Does changes of one edit, forth or back.
class Applying
{
public:
    Applying(const Edit& edit, Edited& edited, bool is_back)
        : edit_(edit), edited_(edited), is_back_(is_back)
    {
    }

    void operator()(const Toggled& change)
    {
        const std::size_t count = edited_.selection.num_samples();
        if (std::any_of(change.runs.begin(), change.runs.end(),
                        [&](const SampleRun& run)
                        {
                            return run.first < 0 || run.second < run.first ||
                                   run.second >= static_cast<std::int64_t>(count);
                        }))
            misfit(edit_, "the model has other samples");
        edited_.selection = edited_.selection.difference(Selection(count, change.runs));
    }

    void operator()(const RegionChange& change)
    {
        const std::vector<RegionStatement>& old = is_back_ ? change.after : change.before;
        const std::vector<RegionStatement>& now = is_back_ ? change.before : change.after;
        std::vector<RegionStatement>& regions = last_stage(edited_).regions;
        if (change.index > regions.size() || old.size() > regions.size() - change.index)
            misfit(edit_, "the regions are others");
        const auto at = regions.begin() + static_cast<std::ptrdiff_t>(change.index);
        const auto next = regions.erase(at, at + static_cast<std::ptrdiff_t>(old.size()));
        regions.insert(next, now.begin(), now.end());
    }

    void operator()(const Renamed& change)
    {
        const std::string& old = is_back_ ? change.after : change.before;
        const std::string& now = is_back_ ? change.before : change.after;
        for (RegionStatement& region : last_stage(edited_).regions)
            if (region.name == old)
                region.name = now;
        for (FrameStatement& frame : last_stage(edited_).frames)
            for (Move& move : frame.moves)
                if (move.region == old)
                    move.region = now;
        for (OnStatement& on : last_stage(edited_).ons)
            for (std::string* const name : {&on.pin, &on.guide})
                if (*name == old)
                    *name = now;
        for (RegionStatement& region : last_stage(edited_).regions)
            if (region.spline && region.spline->near == old)
            {
                SplineStatement spline = *region.spline;
                spline.near = now;
                region.spline = std::make_shared<const SplineStatement>(spline);
            }
    }

    void operator()(const FramesAdded& change)
    {
        std::vector<FrameStatement>& frames = last_stage(edited_).frames;
        if (!is_back_)
            frames.insert(frames.end(), change.frames.begin(), change.frames.end());
        else if (frames.size() < change.frames.size())
            misfit(edit_, "its frames are not there");
        else
            frames.resize(frames.size() - change.frames.size());
    }

    void operator()(const StageAdded& change)
    {
        if (!is_back_)
            edited_.handles.stages.push_back({change.regions, {}});
        else if (edited_.handles.stages.size() < 2)
            misfit(edit_, "its commit is not there");
        else
            edited_.handles.stages.pop_back();
    }

    void operator()(const OnsChange& change)
    {
        last_stage(edited_).ons = is_back_ ? change.before : change.after;
    }

    void operator()(const SettingsChange& change)
    {
        edited_.settings = is_back_ ? change.before : change.after;
    }

private:
    const Edit& edit_;
    Edited& edited_;
    bool is_back_;
};

} // namespace

void apply(const Edit& edit, Edited& edited)
{
    for (const Change& change : edit.changes)
        std::visit(Applying(edit, edited, false), change);
}

void take_back(const Edit& edit, Edited& edited)
{
    for (auto change = edit.changes.rbegin(); change != edit.changes.rend(); ++change)
        std::visit(Applying(edit, edited, true), *change);
}

} // namespace cellwarp::core
