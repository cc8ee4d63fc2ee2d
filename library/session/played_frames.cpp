// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/played_frames.h"

#include <algorithm>
#include <utility>

#include "io/base/error.h"
#include "library/session/frame_plan.h"
#include "library/session/retargeted_motion.h"
#include "library/session/skeleton_handle.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

void refuse_what_is_not_played(const HandleFile& handles, const SkeletonValues& skeleton)
{
    for (const Stage& stage : handles.stages)
        for (const RegionStatement& region : stage.regions)
            throw malformed({handles.path, region.line, region.name},
                            "a region (" + role_name(region.role) +
                                ") cannot be played by simulate: flesh is held by its "
                                "bones, and by skeleton.held");
    if (handles.stages.size() > 1)
    {
        const Stage& next = handles.stages[1];
        const std::int64_t line = !next.joints.empty()   ? next.joints.front().line
                                  : !next.frames.empty() ? next.frames.front().line
                                                         : 0;
        throw malformed({handles.path, line, "commit"},
                        "cannot be played by simulate: frames before it alone can");
    }
    if (handles.stages.empty())
        return;
    const std::vector<SkeletonJoint>& joints = handles.stages.front().joints;
    for (std::size_t j = skeleton.joints.size(); j < joints.size(); ++j)
        throw malformed({handles.path, joints[j].line, joints[j].name},
                        "is no joint of the scene's skeleton: simulate plays no others");
}

/// Frames of one stage as tracks.
class PlayedFrames
{
public:
    PlayedFrames(const SceneFile& scene, const HandleFile& handles, const ModelBox& box,
                 SkeletonValues& skeleton)
        : scene_(scene), handles_(handles),
          skeleton_(skeleton), units_{WorkFrame(), handles.is_relative, box, 0.0},
          diagonal_(box.size().norm()),
          every_(scene.skeleton->every.value_or(
              scene.time.dt * static_cast<double>(scene.time.steps_a_frame())))
    {
    }

    void play(const std::vector<FrameStatement>& frames)
    {
        const SkeletonHandle handle(skeleton_.joints, units_, handles_.path);
        if (frames.front().number > 0)
            add(0, handle.rest());
        for (const FrameStatement& frame : frames)
        {
            std::vector<const Move*> moves;
            for (const Move& move : frame.moves)
                moves.push_back(&move);
            SkeletonAim aim =
                handle.moved(aims_.empty() ? handle.rest() : aims_.back(), moves, units_);
            warn_of_joints(handle, aim, frame, handles_.path, diagonal_,
                           skeleton_.warnings);
            add(frame.number, std::move(aim));
        }
        skeleton_.turns.clear();
        skeleton_.shifts.clear();
        for (std::size_t joint = 0; joint < skeleton_.joints.size(); ++joint)
            add_tracks(joint);
        for (std::size_t k = 1; k < aims_.size(); ++k)
            add_holds(k);
    }

private:
    void add(std::int64_t number, SkeletonAim aim)
    {
        times_.push_back(static_cast<double>(number) * every_);
        aims_.push_back(std::move(aim));
    }

    void add_tracks(std::size_t joint)
    {
        TurnTrack turns;
        ShiftTrack shifts;
        bool is_turned = false, is_shifted = false;
        for (const SkeletonAim& aim : aims_)
        {
            turns.values.push_back(aim.turns[joint].coeffs());
            shifts.values.push_back(aim.shifts[joint]);
            is_turned = is_turned || !aim.turns[joint].vec().isZero(0);
            is_shifted = is_shifted || !aim.shifts[joint].isZero(0);
        }
        turns.joint = shifts.joint = joint;
        turns.times = shifts.times = times_;
        turns.step = shifts.step = scene_.skeleton->step.value_or(KeyStep::Smooth);
        if (is_turned)
            skeleton_.turns.push_back(std::move(turns));
        if (is_shifted)
            skeleton_.shifts.push_back(std::move(shifts));
    }

    /// Holds the joints that have one place in both frames k - 1 and k.
    void add_holds(std::size_t k)
    {
        for (const JointHold& hold : aims_[k].holds)
        {
            const std::vector<JointHold>& last = aims_[k - 1].holds;
            const auto before = std::find_if(last.begin(), last.end(),
                                             [&](const JointHold& other)
                                             {
                                                 return other.joint == hold.joint &&
                                                        other.place == hold.place &&
                                                        other.chain == hold.chain;
                                             });
            if (before == last.end() ||
                std::max(before->miss, hold.miss) > kReachedPlace * diagonal_)
                continue;
            const auto same =
                std::find_if(skeleton_.reaches.begin(), skeleton_.reaches.end(),
                             [&](const ReachTrack& track) {
                                 return track.joint == idx(hold.joint) &&
                                        track.times.back() == times_[k - 1];
                             });
            if (same != skeleton_.reaches.end() && same->values.back() == hold.place)
            {
                same->times.push_back(times_[k]);
                same->values.push_back(hold.place);
                continue;
            }
            ReachTrack& track = skeleton_.reaches.emplace_back();
            track.joint = idx(hold.joint);
            track.times = {times_[k - 1], times_[k]};
            track.values = {hold.place, hold.place};
            track.chain.assign(hold.chain.begin(), hold.chain.end());
            track.is_hold = true;
        }
    }

    const SceneFile& scene_;
    const HandleFile& handles_;
    SkeletonValues& skeleton_;
    const Units units_; ///< the model's own
    const double diagonal_, every_;
    std::vector<double> times_; ///< [s]
    std::vector<SkeletonAim> aims_;
};

} // namespace

SkeletonValues played_skeleton(const SceneFile& scene, const HandleFile& handles,
                               const Geometry& geometry)
{
    SkeletonValues skeleton = moving_skeleton(*scene.skeleton, scene.path);
    refuse_what_is_not_played(handles, skeleton);
    if (handles.stages.empty() || handles.stages.front().frames.empty())
        return skeleton;
    const std::vector<FrameStatement>& frames = handles.stages.front().frames;
    // Frames of keys have times; those that follow them are an editor's, of no time.
    if (!frames.front().time)
        PlayedFrames(scene, handles, bounding_box(geometry.samples), skeleton)
            .play(frames);
    return skeleton;
}

} // namespace cellwarp::core
