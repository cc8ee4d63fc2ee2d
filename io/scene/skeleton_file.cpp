// SPDX-License-Identifier: GPL-3.0-or-later
// TGF, as libigl writes it: lines "number x y z", a line "#", lines "from to" with flags
// "bone pseudo cage" behind them, of which only edges that are bones count; columns
// behind these tell nothing (some writers leave them uninitialised). Joints are named by
// their numbers. The tree hangs on its first joint unless another one is named.
//
// BVH: a joint is at its parent's place + OFFSET at rest, and moved there by
//   Trans(OFFSET + positions) R_1 R_2 R_3,
// with rotations about the axes of CHANNELS in their order. Position channels of joints
// below the root that do not change tell nothing: some writers repeat the OFFSET there,
// others write zeros.
#include "io/scene/skeleton_file.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include <Eigen/Geometry>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/scene/handle_file.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Nothing of a skeleton is farther away: squares do not overflow.
constexpr double kFarthest = 1e100;

double finite_number(std::string_view text, const Where& where)
{
    const std::optional<double> value = parse_double(text);
    if (!value || !std::isfinite(*value) || std::abs(*value) > kFarthest)
        throw malformed(where, "got " + in_quotes(text) + ", need a finite number");
    return *value;
}

std::vector<std::string_view> words_of(std::string_view line)
{
    std::vector<std::string_view> words;
    Tokens tokens(line, 0);
    for (Token token; tokens.next(token);)
        words.push_back(token.text);
    return words;
}

// --- TGF
// --------------------------------------------------------------------------------

struct TgfJoint
{
    std::string name;
    Vector3d at;
    std::int64_t line = 0;
    std::vector<std::size_t> joined; ///< by bones
};

/// The tree that hangs on \p root, parents first. Throws for rings and what it does not
/// reach.
std::vector<SkeletonJoint> tree_of(const std::vector<TgfJoint>& joints, std::size_t root,
                                   const std::string& path)
{
    std::vector<int> parent(joints.size(), -2); // -2: not reached
    std::vector<std::size_t> order = {root};
    parent[root] = -1;
    for (std::size_t k = 0; k < order.size(); ++k)
        for (const std::size_t next : joints[order[k]].joined)
        {
            if (parent[order[k]] == static_cast<int>(next))
                continue;
            if (parent[next] != -2)
                throw malformed({path, joints[next].line, joints[next].name},
                                "is on a ring of bones, with joint " +
                                    joints[order[k]].name);
            parent[next] = static_cast<int>(order[k]);
            order.push_back(next);
        }
    for (std::size_t j = 0; j < joints.size(); ++j)
        if (parent[j] == -2)
            throw malformed({path, joints[j].line, joints[j].name},
                            "no bone joins it to the root, joint " + joints[root].name);
    std::vector<SkeletonJoint> out;
    for (const std::size_t j : order)
    {
        SkeletonJoint& joint = out.emplace_back();
        joint.name = joints[j].name;
        joint.at = joints[j].at;
        joint.line = joints[j].line;
        if (parent[j] >= 0)
            joint.parent = joints[static_cast<std::size_t>(parent[j])].name;
    }
    return out;
}

SkeletonValues parse_tgf(const std::string& path, std::string_view text,
                         const std::string& root)
{
    std::vector<TgfJoint> joints;
    std::map<std::int64_t, std::size_t> by_number;
    bool has_edges = false;
    LineReader lines(text, 0, true);
    for (std::string_view line; lines.next(line);)
    {
        const std::vector<std::string_view> words = words_of(line);
        const auto where = [&](const std::string& field) {
            return Where{path, lines.line_number(), field};
        };
        const auto number = [&](std::size_t k, const std::string& field)
        {
            if (k >= words.size())
                throw malformed(where(field), "is missing");
            const std::optional<std::int64_t> value = parse_integer(words[k]);
            if (!value)
                throw malformed(where(field),
                                "got " + in_quotes(words[k]) + ", need an integer");
            return *value;
        };
        if (words.empty())
            continue;
        if (words[0] == "#")
        {
            if (has_edges)
                break; // a second one ends the file
            has_edges = true;
            continue;
        }
        if (!has_edges)
        {
            if (joints.size() == kMostJoints)
                throw malformed(where("joint"),
                                "more than " + std::to_string(kMostJoints) + " joints");
            TgfJoint joint;
            const std::int64_t index = number(0, "joint");
            joint.name = std::to_string(index);
            joint.line = lines.line_number();
            for (std::size_t k = 0; k < 3; ++k)
            {
                if (k + 1 >= words.size())
                    throw malformed(where("place"), "need x y z");
                joint.at[static_cast<Eigen::Index>(k)] =
                    finite_number(words[k + 1], where("place"));
            }
            if (!by_number.try_emplace(index, joints.size()).second)
                throw malformed(where("joint"), joint.name + " is there twice");
            joints.push_back(std::move(joint));
            continue;
        }
        std::array<std::size_t, 2> ends{};
        for (std::size_t k = 0; k < 2; ++k)
        {
            const auto found = by_number.find(number(k, "bone"));
            if (found == by_number.end())
                throw malformed(where("bone"),
                                "there is no joint " + std::string(words[k]));
            ends[k] = found->second;
        }
        if (words.size() >= 5 && number(2, "bone flag") == 0)
            continue;
        if (joints[ends[0]].at == joints[ends[1]].at)
            throw malformed(where("bone"), "from joint " + joints[ends[0]].name + " to " +
                                               joints[ends[1]].name + " has no length");
        joints[ends[0]].joined.push_back(ends[1]);
        joints[ends[1]].joined.push_back(ends[0]);
    }
    if (joints.empty())
        throw malformed({path, lines.line_number(), ""}, "holds no joint");
    std::size_t first = 0;
    if (!root.empty())
    {
        const auto found =
            std::find_if(joints.begin(), joints.end(),
                         [&](const TgfJoint& j) { return j.name == root; });
        if (found == joints.end())
            throw malformed({path, 0, "root"}, "there is no joint " + in_quotes(root));
        first = static_cast<std::size_t>(found - joints.begin());
    }
    SkeletonValues out;
    out.joints = tree_of(joints, first, path);
    return out;
}

// --- BVH
// --------------------------------------------------------------------------------

/// Reads the hierarchy, then the motion.
class BvhReader
{
public:
    BvhReader(const std::string& path, std::string_view text)
        : path_(path), lines_(text, 0, true)
    {
    }

    SkeletonValues read()
    {
        next_line();
        need("HIERARCHY");
        next_line();
        if (word(0) != "root")
            fail("ROOT", "is missing");
        tree();
        if (word(0) == "root")
            fail(name_behind(1),
                 "is a second root; the first one is " + out_.joints.front().name);
        motion();
        return std::move(out_);
    }

private:
    struct Channel
    {
        std::size_t joint;
        bool is_turn;
        int axis;
    };

    [[noreturn]] void fail(const std::string& field, const std::string& what) const
    {
        throw malformed({path_, lines_.line_number(), field}, what);
    }
    /// To the next line that says something; false at the end.
    bool step()
    {
        std::string_view line;
        words_.clear();
        while (words_.empty())
        {
            if (!lines_.next(line))
                return false;
            words_ = words_of(line);
        }
        return true;
    }
    void next_line()
    {
        if (!step())
            fail("", "ends too early");
    }
    std::string word(std::size_t k) const
    {
        return k < words_.size() ? lower_case(words_[k]) : std::string();
    }
    void need(const char* keyword) const
    {
        if (word(0) != lower_case(keyword))
            fail(keyword,
                 "is missing (got " + in_quotes(words_.empty() ? "" : words_[0]) + ")");
    }
    /// The rest of the line, without a brace that opens.
    std::string name_behind(std::size_t k) const
    {
        std::string name;
        for (; k < words_.size() && words_[k] != "{"; ++k)
            name += (name.empty() ? "" : " ") + std::string(words_[k]);
        return name;
    }
    /// The brace behind a name, on its line or the next.
    void open()
    {
        if (words_.back() == "{")
            return;
        next_line();
        need("{");
    }
    Vector3d offset()
    {
        next_line();
        need("OFFSET");
        if (words_.size() != 4)
            fail("OFFSET", "need three numbers");
        Vector3d offset;
        for (std::size_t k = 0; k < 3; ++k)
            offset[static_cast<Eigen::Index>(k)] =
                finite_number(words_[k + 1], {path_, lines_.line_number(), "OFFSET"});
        return offset;
    }
    std::size_t add_joint(const std::string& name, int parent, const Vector3d& offset)
    {
        if (out_.joints.size() == kMostJoints)
            fail(name, "more than " + std::to_string(kMostJoints) + " joints");
        SkeletonJoint& joint = out_.joints.emplace_back();
        joint.name = name;
        joint.line = lines_.line_number();
        joint.at = offset;
        if (parent >= 0)
        {
            joint.parent = out_.joints[static_cast<std::size_t>(parent)].name;
            joint.at += out_.joints[static_cast<std::size_t>(parent)].at;
        }
        if (!names_.insert(name).second)
            fail(name, "is the name of two joints");
        offsets_.push_back(offset);
        return out_.joints.size() - 1;
    }
    /// From ROOT to the line behind its closing brace.
    void tree()
    {
        std::vector<int> open_joints;
        for (;;)
        {
            const bool is_end = word(0) == "end" && word(1) == "site";
            if (word(0) == "}")
            {
                if (words_.size() > 1)
                    fail("}", "one word too many");
                open_joints.pop_back();
                next_line();
                if (open_joints.empty())
                    return;
                continue;
            }
            if (!is_end && word(0) != "joint" && !(open_joints.empty()))
                fail("JOINT",
                     "got " + in_quotes(words_[0]) + ", need JOINT, End Site or }");
            const int parent = open_joints.empty() ? -1 : open_joints.back();
            std::string name = name_behind(1);
            if (is_end)
                name = out_.joints[static_cast<std::size_t>(parent)].name + ".end";
            for (int k = 2; is_end && names_.contains(name); ++k)
                name = out_.joints[static_cast<std::size_t>(parent)].name + ".end" +
                       std::to_string(k);
            if (name.empty())
                fail("JOINT", "has no name");
            open();
            const std::size_t joint = add_joint(name, parent, offset());
            next_line();
            if (word(0) == "channels")
            {
                channels(joint);
                next_line();
            }
            open_joints.push_back(static_cast<int>(joint));
        }
    }
    void channels(std::size_t joint)
    {
        const std::optional<std::int64_t> count =
            words_.size() > 1 ? parse_integer(words_[1]) : std::nullopt;
        if (!count || *count < 0 || *count > 6 ||
            words_.size() != static_cast<std::size_t>(*count) + 2)
            fail("CHANNELS", "need a count up to 6 and as many names");
        std::set<std::string> known;
        for (std::size_t k = 2; k < words_.size(); ++k)
        {
            const std::string name = word(k);
            const bool is_turn = name.ends_with("rotation");
            const int axis = name.empty() ? -1 : name[0] - 'x';
            if (axis < 0 || axis > 2 ||
                name.substr(1) != (is_turn ? "rotation" : "position") ||
                !known.insert(name).second)
                fail("CHANNELS", "got " + in_quotes(words_[k]) +
                                     ", need Xposition to Zposition, Xrotation to "
                                     "Zrotation, each once");
            channels_.push_back({joint, is_turn, axis});
        }
    }
    void motion()
    {
        need("MOTION");
        next_line();
        if (word(0) != "frames:" || words_.size() != 2)
            fail("Frames", "is missing");
        const std::optional<std::int64_t> frames = parse_integer(words_[1]);
        const std::int64_t frames_line = lines_.line_number();
        if (!frames || *frames < 0)
            fail("Frames", "got " + in_quotes(words_[1]) + ", need a count");
        next_line();
        if (word(0) != "frame" || word(1) != "time:" || words_.size() != 3)
            fail("Frame Time", "is missing");
        const double dt =
            finite_number(words_[2], {path_, lines_.line_number(), "Frame Time"});
        if (!(dt > 0))
            fail("Frame Time", "got " + in_quotes(words_[2]) + ", need > 0");
        start_tracks();
        std::int64_t frame = 0;
        for (; frame <= *frames + 1 && step(); ++frame)
        {
            // Some programs count the rest pose, others count from 0.
            if (frame == *frames + 1)
                fail("Frames", "promises " + std::to_string(*frames) + ", more follow");
            add_frame(frame, static_cast<double>(frame) * dt);
        }
        if (frame < *frames - 1 || (frame == 0 && *frames > 0))
            fail("Frames", "promises " + std::to_string(*frames) + " (got " +
                               std::to_string(frame) + ")");
        if (frame != *frames)
            out_.warnings.push_back(at({path_, frames_line, "Frames"},
                                       "promises " + std::to_string(*frames) +
                                           ", the file has " + std::to_string(frame) +
                                           ": all of these are read"));
        end_tracks();
    }
    void start_tracks()
    {
        turn_of_.assign(out_.joints.size(), -1);
        shift_of_.assign(out_.joints.size(), -1);
        for (const Channel& channel : channels_)
        {
            int& track = (channel.is_turn ? turn_of_ : shift_of_)[channel.joint];
            if (track >= 0)
                continue;
            if (channel.is_turn)
            {
                track = static_cast<int>(out_.turns.size());
                out_.turns.emplace_back().joint = channel.joint;
            }
            else
            {
                track = static_cast<int>(out_.shifts.size());
                out_.shifts.emplace_back().joint = channel.joint;
            }
        }
    }
    void add_frame(std::int64_t frame, double time)
    {
        const std::string field = "frame " + std::to_string(frame);
        if (words_.size() != channels_.size())
            fail(field, "need " + std::to_string(channels_.size()) + " numbers (got " +
                            std::to_string(words_.size()) + ")");
        for (TurnTrack& track : out_.turns)
        {
            track.times.push_back(time);
            track.values.push_back(Quaterniond::Identity().coeffs());
        }
        for (ShiftTrack& track : out_.shifts)
        {
            track.times.push_back(time);
            track.values.push_back(Vector3d::Zero());
        }
        for (std::size_t k = 0; k < channels_.size(); ++k)
        {
            const auto& [joint, is_turn, axis] = channels_[k];
            const double value =
                finite_number(words_[k], {path_, lines_.line_number(), field});
            if (is_turn)
            {
                Eigen::Vector4d& turn =
                    out_.turns[static_cast<std::size_t>(turn_of_[joint])].values.back();
                turn = (Quaterniond(turn) *
                        Quaterniond(Eigen::AngleAxisd(std::remainder(value, 720.0) *
                                                          std::numbers::pi / 180.0,
                                                      Vector3d::Unit(axis))))
                           .normalized()
                           .coeffs();
            }
            else
                out_.shifts[static_cast<std::size_t>(shift_of_[joint])]
                    .values.back()[axis] = value;
        }
    }
    /// Leaves out positions of inner joints that do not change.
    void end_tracks()
    {
        std::erase_if(out_.turns, [](const auto& track) { return track.times.empty(); });
        std::erase_if(
            out_.shifts,
            [&](const ShiftTrack& track)
            {
                const double size = offsets_[track.joint].norm();
                return track.times.empty() ||
                       (!out_.joints[track.joint].parent.empty() &&
                        std::all_of(track.values.begin(), track.values.end(),
                                    [&](const Vector3d& shift) {
                                        return (shift - track.values.front()).norm() <=
                                               1e-6 * size;
                                    }));
            });
    }

    const std::string& path_;
    LineReader lines_;
    std::vector<std::string_view> words_;
    std::set<std::string> names_;
    std::vector<Vector3d> offsets_;
    std::vector<Channel> channels_; ///< in the order of a frame's numbers
    std::vector<int> turn_of_, shift_of_;
    SkeletonValues out_;
};

// --- all of them
// ------------------------------------------------------------------------

/// Names that handle files can say, and that still differ.
void make_sayable(std::vector<SkeletonJoint>& joints)
{
    std::map<std::string, std::string> now; // by what it was
    std::set<std::string> known;
    for (SkeletonJoint& joint : joints)
    {
        std::string name = joint.name;
        if (!is_handle_name(name))
            std::replace_if(
                name.begin(), name.end(),
                [](char c) { return c == '\n' || c == '\r' || c == '\0' || c == '"'; },
                '_');
        const std::string first = name;
        for (int k = 2; !known.insert(name).second; ++k)
            name = first + "." + std::to_string(k);
        now[joint.name] = name;
        joint.name = name;
        if (!joint.parent.empty())
            joint.parent = now.at(joint.parent);
    }
}

void place(SkeletonValues& skeleton, const SkeletonPlacement& placement)
{
    const double quarter = 0.5 * std::numbers::pi;
    const Quaterniond turn =
        placement.up == 'z' ? Quaterniond(Eigen::AngleAxisd(-quarter, Vector3d::UnitX()))
        : placement.up == 'x' ? Quaterniond(Eigen::AngleAxisd(quarter, Vector3d::UnitZ()))
                              : Quaterniond::Identity();
    // Quarter turns move axes on to axes exactly.
    const Eigen::Matrix3d exact = turn.toRotationMatrix().array().round();
    const auto vector = [&](const Vector3d& v) -> Vector3d
    { return placement.scale * (exact * v); };
    const auto turned = [&](Eigen::Vector4d& q) { q.head<3>() = exact * q.head<3>(); };
    for (SkeletonJoint& joint : skeleton.joints)
        joint.at = vector(joint.at) + placement.shift;
    for (TurnTrack& track : skeleton.turns)
    {
        for (Eigen::Vector4d& value : track.values)
            turned(value);
        for (auto& tangents : track.tangents)
            for (Eigen::Vector4d& tangent : tangents)
                turned(tangent);
    }
    for (ShiftTrack& track : skeleton.shifts)
    {
        for (Vector3d& value : track.values)
            value = vector(value);
        for (auto& tangents : track.tangents)
            for (Vector3d& tangent : tangents)
                tangent = vector(tangent);
    }
}

} // namespace

bool is_skeleton_format(std::string_view extension)
{
    return extension == "tgf" || extension == "bvh" || extension == "gltf" ||
           extension == "glb";
}

SkeletonValues parse_skeleton(const std::string& path, std::string bytes,
                              const SkeletonPlacement& placement)
{
    const std::string extension = extension_of(path);
    if (!is_skeleton_format(extension))
        throw Error(Fault::Usage,
                    at({path, 0, ""}, "need a skeleton: .tgf, .bvh, .gltf or .glb"));
    if (!placement.root.empty() && extension != "tgf")
        throw malformed({path, 0, "root"}, "is for a .tgf: this file tells its own");
    if (!placement.animation.empty() && (extension == "tgf" || extension == "bvh"))
        throw malformed({path, 0, "animation"}, "is for a glTF");
    if (!placement.animation_file.empty() && (extension == "tgf" || extension == "bvh"))
        throw malformed({path, 0, "animation_file"}, "is for a glTF");
    SkeletonValues out;
    if (extension == "tgf" || extension == "bvh")
    {
        if (const std::string guess = foreign_content(bytes); !guess.empty())
            throw malformed({path, 0, ""},
                            "this looks like " + guess + ", need a skeleton");
        const std::string_view text =
            std::string_view(bytes).substr(byte_order_mark(bytes));
        out = extension == "tgf" ? parse_tgf(path, text, placement.root)
                                 : BvhReader(path, text).read();
    }
    else
        out = parse_gltf_skeleton(path, std::move(bytes), placement);
    make_sayable(out.joints);
    place(out, placement);
    for (const SkeletonJoint& joint : out.joints)
        if (!(joint.at.cwiseAbs().maxCoeff() <= kFarthest))
            throw malformed({path, joint.line, joint.name}, "is beyond 1e100");
    return out;
}

SkeletonValues read_skeleton(const std::string& path, const SkeletonPlacement& placement)
{
    if (!is_skeleton_format(extension_of(path)))
        return parse_skeleton(path, {}, placement);
    return parse_skeleton(path, read_file(path), placement);
}

std::string tgf_text(const std::vector<SkeletonJoint>& joints)
{
    std::string text, bones;
    std::map<std::string, std::size_t> number;
    for (const SkeletonJoint& joint : joints)
    {
        const std::size_t own = number.size() + 1;
        number[joint.name] = own;
        text += std::to_string(own);
        for (const double x : joint.at)
        {
            text += ' ';
            append_shortest(x, text);
        }
        text += '\n';
        if (!joint.parent.empty())
            bones += std::to_string(number[joint.parent]) + ' ' + std::to_string(own) +
                     " 1 0 0\n";
    }
    return text + "#\n" + bones;
}

std::vector<SkeletonJoint> in_order(std::vector<SkeletonJoint> joints,
                                    const std::string& file, const std::string& field)
{
    const auto where = [&](std::size_t k)
    {
        return Where{file, joints[k].line,
                     field.empty() ? joints[k].name
                                   : field + "[" + std::to_string(k) + "]"};
    };
    std::map<std::string, std::size_t> by_name;
    std::optional<std::size_t> root;
    for (std::size_t k = 0; k < joints.size(); ++k)
    {
        const SkeletonJoint& joint = joints[k];
        if (joint.name.empty() || !is_handle_name(joint.name))
            throw malformed(where(k), "got " + in_quotes(joint.name) + ", need a name");
        if (!by_name.try_emplace(joint.name, k).second)
            throw malformed(where(k),
                            in_quotes(joint.name) + " is the name of two joints");
        if (joint.parent.empty() && root)
            throw malformed(where(k), joint.name +
                                          " is a second root; the first one is " +
                                          joints[*root].name);
        if (joint.parent.empty())
            root = k;
        if (joint.twist && (*joint.twist)[0] > (*joint.twist)[1])
            throw malformed(where(k), "twist of " + joint.name + ": its least angle is " +
                                          shortest((*joint.twist)[0]) + ", its largest " +
                                          shortest((*joint.twist)[1]));
    }
    std::vector<std::vector<std::size_t>> children(joints.size());
    for (std::size_t k = 0; k < joints.size(); ++k)
    {
        if (joints[k].parent.empty())
            continue;
        const auto parent = by_name.find(joints[k].parent);
        if (parent == by_name.end())
            throw malformed(where(k), "the parent of " + joints[k].name + ", " +
                                          in_quotes(joints[k].parent) + ", is no joint");
        if (joints[parent->second].at == joints[k].at)
            throw malformed(where(k), "the bone from " + joints[k].parent + " to " +
                                          joints[k].name + " has no length");
        children[parent->second].push_back(k);
    }
    std::vector<std::size_t> order;
    std::vector<bool> is_in(joints.size(), false);
    if (root)
        order.push_back(*root);
    for (std::size_t next = 0; next < order.size(); ++next)
    {
        is_in[order[next]] = true;
        order.insert(order.end(), children[order[next]].begin(),
                     children[order[next]].end());
    }
    for (std::size_t k = 0; k < joints.size(); ++k)
        if (!is_in[k])
            throw malformed(where(k), joints[k].name + " is on a ring of bones, or below "
                                                       "one: it hangs on no root");
    std::vector<SkeletonJoint> sorted;
    for (const std::size_t k : order)
        sorted.push_back(std::move(joints[k]));
    return sorted;
}

} // namespace cellwarp::core
