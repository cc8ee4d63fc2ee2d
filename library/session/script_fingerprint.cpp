// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/script_fingerprint.h"

#include <bit>
#include <string_view>

#include "octree/base/hash.h"

namespace cellwarp::core
{

namespace
{

/// Each word goes into the hash of all that came before it.
class Fingerprint
{
public:
    /// Goes on from a value.
    explicit Fingerprint(std::uint64_t start) : value_(start) {}

    void add(std::uint64_t word) { value_ = hash_of(&word, sizeof word, value_); }
    void add(double number) { add(std::bit_cast<std::uint64_t>(number)); }
    void add(std::int64_t number) { add(static_cast<std::uint64_t>(number)); }
    void add(std::string_view text)
    {
        add(std::uint64_t(text.size()));
        value_ = hash_of(text.data(), text.size(), value_);
    }
    void add(const Eigen::Vector3d& v)
    {
        for (int k = 0; k < 3; ++k)
            add(v[k]);
    }
    std::uint64_t value() const { return value_; }

private:
    std::uint64_t value_;
};

template <class Kind>
std::uint64_t number_of(Kind kind)
{
    return static_cast<std::uint64_t>(kind);
}

void add(Fingerprint& fingerprint, const RegionStatement& region)
{
    const Selector& selector = region.selector;
    fingerprint.add(number_of(region.role));
    fingerprint.add(region.name);
    fingerprint.add(region.factor);
    fingerprint.add(number_of(selector.kind));
    fingerprint.add(std::uint64_t(selector.numbers.size()));
    for (const double number : selector.numbers)
        fingerprint.add(number);
    fingerprint.add(std::uint64_t(selector.ranges.size()));
    for (const auto& [first, last] : selector.ranges)
    {
        fingerprint.add(first);
        fingerprint.add(last);
    }
    fingerprint.add(selector.name);
    fingerprint.add(selector.label);
    if (!region.spline)
        return;
    const SplineStatement& spline = *region.spline;
    fingerprint.add(number_of(spline.form));
    fingerprint.add(std::uint64_t(spline.points.size()));
    for (const Eigen::Vector3d& point : spline.points)
        fingerprint.add(point);
    fingerprint.add(spline.near);
    fingerprint.add(std::uint64_t(spline.is_closed) + 2 * spline.is_exact);
    fingerprint.add(spline.spans);
    fingerprint.add(spline.radii.empty() ? 0.0 : spline.radii.front());
    fingerprint.add(spline.stiffness.value_or(0.0));
}

void add(Fingerprint& fingerprint, const OnStatement& on)
{
    fingerprint.add(on.pin);
    fingerprint.add(on.guide);
    fingerprint.add(on.at.value_or(-1.0));
}

void add(Fingerprint& fingerprint, const SkeletonJoint& joint)
{
    fingerprint.add(joint.name);
    fingerprint.add(joint.parent);
    fingerprint.add(joint.at);
    fingerprint.add(std::uint64_t(joint.hinge.has_value()) + 2 * joint.twist.has_value() +
                    4 * joint.swing.has_value());
    fingerprint.add(joint.hinge.value_or(Eigen::Vector3d::Zero()));
    for (const double angle : joint.twist.value_or(std::array<double, 2>{}))
        fingerprint.add(angle);
    fingerprint.add(joint.swing.value_or(0.0));
    fingerprint.add(joint.radius.value_or(0.0));
}

void add(Fingerprint& fingerprint, const FrameStatement& frame)
{
    fingerprint.add(frame.number);
    fingerprint.add(std::uint64_t(frame.moves.size()));
    for (const Move& move : frame.moves)
    {
        fingerprint.add(move.region);
        if (move.place.kind != MovePlace::Kind::Whole)
        {
            fingerprint.add(number_of(move.place.kind));
            fingerprint.add(move.place.point);
        }
        if (move.released)
            fingerprint.add(std::uint64_t(1) + 2 * move.released->place +
                            4 * move.released->tangent + 8 * move.released->twist);
        fingerprint.add(std::uint64_t(move.operations.size()));
        fingerprint.add(move.chain);
        for (const Operation& operation : move.operations)
        {
            fingerprint.add(number_of(operation.kind));
            fingerprint.add(operation.vector);
            fingerprint.add(operation.move.translation);
            fingerprint.add(operation.move.axis);
            fingerprint.add(operation.move.degrees);
            fingerprint.add(std::uint64_t(operation.move.pivot.has_value()) +
                            2 * operation.is_about_border);
            if (operation.move.pivot)
                fingerprint.add(*operation.move.pivot);
            if (operation.matrix)
                for (int k = 0; k < 16; ++k)
                    fingerprint.add(operation.matrix->data()[k]);
        }
    }
}

/// Calls after(fingerprint) after the regions and after each frame.
template <class After>
void add(Fingerprint& fingerprint, const Stage& stage, After&& after)
{
    for (const RegionStatement& region : stage.regions)
        add(fingerprint, region);
    for (const OnStatement& on : stage.ons)
        add(fingerprint, on);
    for (const SkeletonJoint& joint : stage.joints)
        add(fingerprint, joint);
    after(fingerprint);
    for (const FrameStatement& frame : stage.frames)
    {
        add(fingerprint, frame);
        after(fingerprint);
    }
}

} // namespace

ScriptFingerprint::ScriptFingerprint(const HandleFile& handles)
{
    std::uint64_t before = before_first(handles.is_relative);
    for (const Stage& stage : handles.stages)
    {
        StageFingerprints& of_stage = stages_.emplace_back();
        of_stage.before = before;
        Fingerprint fingerprint(before);
        add(fingerprint, stage,
            [&](const Fingerprint& now) { of_stage.after.push_back(now.value()); });
        fingerprint.add("stage");
        before = fingerprint.value();
    }
}

std::uint64_t ScriptFingerprint::before_first(bool is_relative)
{
    Fingerprint fingerprint(is_relative);
    fingerprint.add("stage");
    return fingerprint.value();
}

std::uint64_t ScriptFingerprint::before_next(std::uint64_t before, const Stage& stage)
{
    Fingerprint fingerprint(before);
    add(fingerprint, stage, [](const Fingerprint&) {});
    fingerprint.add("stage");
    return fingerprint.value();
}

} // namespace cellwarp::core
