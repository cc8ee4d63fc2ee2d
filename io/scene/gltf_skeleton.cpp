// SPDX-License-Identifier: GPL-3.0-or-later
// Joints are the nodes of all skins, and animated nodes above them; without a skin, nodes
// that an animation moves, else all that show no mesh; and what hangs on them and shows
// none. The last joint of a skin's limb has a bone as well, half as long as the one that
// leads to it, in its direction: few files tell where it ends. At rest a
// joint of a skin is where its inverse bind matrix B says, another where its node stands.
//
// A node under the joint p, with the matrices F of nodes between them that do not move,
// moves space around it, as its parent has turned it, by
//   L(t) = B_p^-1 F M(t) B,   M(t) = Trans Rot Scale of the node,
// (above a root B_p^-1 F is what stands above it). With C = B_p^-1 F, x = B^-1 0 its
// place and the rotation parts q of these, its turn is q_C q(t) q_B and its shift C
// Trans(t) - x: both are linear in what the file has keys of, so that all ways of
// interpolation are the same here and there.
//
// Bones are rigid, so L must not scale. Files whose meshes are stored in other units than
// their scene (centimetres and metres) have one scale s = |W|, W = (world of a joint) B,
// for all joints of their skins: the scene is taken to be 1 / s as large, which makes L
// of each joint rigid. Scales that come within 1 % of 1 are left out, with a warning. All
// others are refused.
//
// An animation of another file moves the nodes that have the names of its own ones. What
// of it stands all the time where its node stands there tells nothing of this skeleton:
// the lengths of bones stay.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/gltf_data.h"
#include "io/formats/gltf_nodes.h"
#include "io/scene/skeleton_file.h"
#include "io/scene/weight_file.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Affine3d;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Json = GltfJson::Json;

/// Of all samples together.
constexpr std::size_t kMostWeights = 200'000'000;

/// Scales that differ from 1 by less are rounding of floats.
constexpr double kNoScale = 1e-3;
/// Those that differ by less are left out.
constexpr double kSmallScale = 0.01;
/// A joint that stands nearer to its rest than this has no key [rad, model unit].
constexpr double kAtRest = 1e-5;

class SkeletonReader
{
public:
    explicit SkeletonReader(GeometryFile& file)
        : data_(file, layout_, nullptr, nullptr), json_(data_.json()), nodes_(json_)
    {
    }

    /// \p other: the file whose animation is meant; null: this one.
    SkeletonValues read(const std::string& animation, SkeletonReader* other)
    {
        if (other)
            take_animation(animation, *other);
        else
            read_animation(animation);
        find_joints();
        name_joints();
        find_bind();
        for (const std::size_t node : order_)
            add_joint(node);
        add_ends();
        warn_of_scales();
        return std::move(out_);
    }

    /// Of the meshes' samples, in the order in which the geometry has them.
    PaintedWeights read_weights()
    {
        if (json_.list("skins").empty())
            json_.fail("skins", "there is no skin, and so no weights");
        read_animation("");
        find_joints();
        name_joints();
        std::map<std::size_t, std::size_t> column_of; // of a node
        PaintedWeights out;
        for (const std::size_t node : of_skin_)
        {
            column_of[node] = out.joints.size();
            out.joints.push_back(names_[node]);
        }
        std::vector<std::size_t> rest(nodes_.roots().rbegin(), nodes_.roots().rend());
        while (!rest.empty())
        {
            const std::size_t node = rest.back();
            rest.pop_back();
            const auto& children = nodes_.children(node);
            rest.insert(rest.end(), children.rbegin(), children.rend());
            if (nodes_[node].contains("mesh"))
                add_weights(node, column_of, out);
        }
        return out;
    }

private:
    /// Keys of one thing of a node, as stored.
    struct Channel
    {
        KeyStep step = KeyStep::Linear;
        std::vector<double> times, numbers;
        std::string where;
    };
    struct Channels
    {
        std::optional<Channel> rotation, translation, scale;
    };

    // --- animations --------------------------------------------------------------------
    void read_animation(const std::string& name)
    {
        const Json& animations = json_.list("animations");
        if (animations.empty() && name.empty())
            return;
        std::size_t chosen = animations.size();
        const std::optional<std::int64_t> number = parse_integer(name);
        if (name.empty())
            chosen = 0;
        else if (number && *number >= 0)
            chosen = static_cast<std::size_t>(*number);
        for (std::size_t k = 0; k < animations.size(); ++k)
            if (const Json* own = json_.find(animations[k], "name");
                own && own->is_string() && own->get<std::string>() == name)
                chosen = k;
        if (chosen >= animations.size())
            json_.fail("animations", "there is none of the name " + in_quotes(name) +
                                         " (there are " +
                                         std::to_string(animations.size()) + ")");
        if (animations.size() > 1 && name.empty())
            out_.warnings.push_back(
                at({json_.path(), 0, "animations"},
                   "has " + std::to_string(animations.size()) +
                       ", the first one is taken (\"animation\" names another)"));
        const Json& animation = animations[chosen];
        const std::string where = element("animations", chosen);
        for (const char* key : {"channels", "samplers"})
            if (const Json* list = json_.find(animation, key);
                !list || !list->is_array() ||
                std::any_of(list->begin(), list->end(),
                            [](const Json& e) { return !e.is_object(); }))
                json_.fail(where + "." + key, "need a list of objects");
        const Json& channels = animation["channels"];
        for (std::size_t k = 0; k < channels.size(); ++k)
            read_channel(animation, channels[k],
                         where + ".channels[" + std::to_string(k) + "]");
    }
    void read_channel(const Json& animation, const Json& channel,
                      const std::string& where)
    {
        const Json* target = json_.find(channel, "target");
        if (!target || !target->is_object())
            json_.fail(where + ".target", "is missing");
        const std::string path = json_.text_of(*target, "path", where + ".target");
        const Json* of_node = json_.find(*target, "node");
        if (!of_node)
            return; // of an extension
        const std::size_t node =
            json_.index_of(*of_node, where + ".target.node", "nodes", nodes_.size());
        Channels& channels = channels_[node];
        std::optional<Channel>* const slot = path == "rotation" ? &channels.rotation
                                             : path == "translation"
                                                 ? &channels.translation
                                             : path == "scale" ? &channels.scale
                                                               : nullptr;
        if (!slot)
        {
            if (path != "weights")
                json_.fail(where + ".target.path",
                           "got " + in_quotes(path) +
                               ", need rotation, translation, scale or weights");
            return; // shapes of a mesh
        }
        if (*slot)
            json_.fail(where, "moves what another channel moves");
        if (nodes_[node].contains("matrix"))
            json_.fail(where, "moves nodes[" + std::to_string(node) +
                                  "], which stands by a matrix");
        *slot = read_sampler(animation, channel, where, path == "rotation" ? 4 : 3);
    }
    std::vector<double> numbers(const Json& sampler, const char* key, std::size_t length,
                                const std::string& where) const
    {
        const Json* number = json_.find(sampler, key);
        if (!number)
            json_.fail(where + "." + key, "is missing");
        const std::size_t accessor = json_.index_of(
            *number, where + "." + key, "accessors", data_.accessors().size());
        if (data_.accessors()[accessor].length != length)
            json_.fail(where + "." + key,
                       element("accessors", accessor) + " has " +
                           std::to_string(data_.accessors()[accessor].length) +
                           " numbers an element, need " + std::to_string(length));
        std::vector<double> values = data_.numbers_of(accessor);
        if (std::any_of(values.begin(), values.end(),
                        [](double x) { return !(std::abs(x) <= 1e30); }))
            json_.fail(where + "." + key,
                       element("accessors", accessor) + " holds what is not finite");
        return values;
    }
    Channel read_sampler(const Json& animation, const Json& channel,
                         const std::string& where, std::size_t length) const
    {
        const Json& samplers = animation["samplers"];
        const Json* number = json_.find(channel, "sampler");
        if (!number)
            json_.fail(where + ".sampler", "is missing");
        const std::size_t s =
            json_.index_of(*number, where + ".sampler", "samplers", samplers.size());
        Channel out;
        out.where = where;
        out.times = numbers(samplers[s], "input", 1, where);
        out.numbers = numbers(samplers[s], "output", length, where);
        for (std::size_t k = 1; k < out.times.size(); ++k)
            if (!(out.times[k] > out.times[k - 1]))
                json_.fail(where + ".input", "key " + std::to_string(k) +
                                                 " is not later than the one before");
        const Json* step = json_.find(samplers[s], "interpolation");
        const std::string name = !step               ? "LINEAR"
                                 : step->is_string() ? step->get<std::string>()
                                                     : "";
        if (name == "STEP")
            out.step = KeyStep::Hold;
        else if (name == "CUBICSPLINE")
            out.step = KeyStep::Cubic;
        else if (name != "LINEAR")
            json_.fail(where + ".interpolation", "need LINEAR, STEP or CUBICSPLINE");
        const std::size_t each = out.step == KeyStep::Cubic ? 3 : 1;
        if (out.numbers.size() != out.times.size() * length * each)
            json_.fail(where + ".output",
                       "has " + std::to_string(out.numbers.size() / length) +
                           " elements, need " + std::to_string(out.times.size() * each));
        return out;
    }

    /// Moves the nodes that have the names of the other file's.
    void take_animation(const std::string& name, SkeletonReader& other)
    {
        other.read_animation(name);
        if (other.channels_.empty())
            other.json_.fail("animations", "there is none that moves a node");
        std::map<std::string, std::size_t> by_name;
        for (std::size_t node = 0; node < nodes_.size(); ++node)
            if (!nodes_.name(node).empty())
                by_name.try_emplace(nodes_.name(node), node);
        std::vector<std::string> unknown;
        for (const auto& [node, channels] : other.channels_)
        {
            const auto own = by_name.find(other.nodes_.name(node));
            if (own == by_name.end())
            {
                unknown.push_back(element("nodes", node) + " " +
                                  in_quotes(other.nodes_.name(node)));
                continue;
            }
            Channels taken = channels;
            const Affine3d rest = other.nodes_.matrix(node);
            if (stays(taken.translation, rest.translation()))
                taken.translation.reset();
            if (stays(taken.scale, rest.linear().colwise().norm()))
                taken.scale.reset();
            // The files may count in different units.
            const double theirs = scale_above(other.nodes_, node),
                         ours = scale_above(nodes_, own->second);
            if (taken.translation && theirs > 0.0 && ours > 0.0)
                for (double& x : taken.translation->numbers)
                    x *= theirs / ours;
            channels_[own->second] = std::move(taken);
        }
        if (channels_.empty())
            other.json_.fail("animations",
                             "moves no node that " + json_.path() + " has, by its name");
        out_.warnings.insert(out_.warnings.end(), other.out_.warnings.begin(),
                             other.out_.warnings.end());
        if (!unknown.empty())
            out_.warnings.push_back(
                at({other.json_.path(), 0, unknown.front()},
                   "moves nothing: " + json_.path() + " has no node of that name" +
                       (unknown.size() > 1
                            ? " (so do " + std::to_string(unknown.size() - 1) + " others)"
                            : "")));
    }
    /// The scale of what stands above a node.
    static double scale_above(const GltfNodes& nodes, std::size_t node)
    {
        Affine3d above = Affine3d::Identity();
        for (int parent = nodes.parent(node); parent >= 0;
             parent = nodes.parent(static_cast<std::size_t>(parent)))
            above = nodes.matrix(static_cast<std::size_t>(parent)) * above;
        return std::cbrt(std::abs(above.linear().determinant()));
    }
    /// Whether the keys all say, to 1 %, what is there without them.
    static bool stays(const std::optional<Channel>& keys, const Vector3d& rest)
    {
        if (!keys || keys->step == KeyStep::Cubic)
            return false;
        for (std::size_t k = 0; k + 2 < keys->numbers.size(); k += 3)
            if (!((Eigen::Map<const Vector3d>(&keys->numbers[k]) - rest).norm() <=
                  kSmallScale * rest.norm()))
                return false;
        return true;
    }

    // --- joints ------------------------------------------------------------------------
    void find_joints()
    {
        std::vector<bool> is_joint(nodes_.size(), false);
        const Json& skins = json_.list("skins");
        for (std::size_t s = 0; s < skins.size(); ++s)
        {
            const std::string where = element("skins", s) + ".joints";
            const Json* joints = json_.find(skins[s], "joints");
            if (!joints || !joints->is_array() || joints->empty())
                json_.fail(where, "need a list of nodes");
            for (const Json& joint : *joints)
                of_skin_.insert(json_.index_of(joint, where, "nodes", nodes_.size()));
        }
        for (const std::size_t node : of_skin_)
            is_joint[node] = true;
        const auto spread_up = [&](std::size_t node)
        {
            for (int above = nodes_.parent(node); above >= 0;
                 above = nodes_.parent(static_cast<std::size_t>(above)))
                if (channels_.contains(static_cast<std::size_t>(above)))
                    is_joint[static_cast<std::size_t>(above)] = true;
        };
        if (!skins.empty())
            for (std::size_t i = 0; i < nodes_.size(); ++i)
            {
                if (is_joint[i])
                    spread_up(i);
            }
        else if (!channels_.empty())
            for (const auto& [node, channels] : channels_)
                is_joint[node] = true;
        else
            for (std::size_t i = 0; i < nodes_.size(); ++i)
                is_joint[i] =
                    !nodes_[i].contains("mesh") && !nodes_[i].contains("camera");
        // Parents first, at any depth.
        std::vector<std::size_t> rest(nodes_.roots().rbegin(), nodes_.roots().rend());
        joint_above_.assign(nodes_.size(), -1);
        while (!rest.empty())
        {
            const std::size_t node = rest.back();
            rest.pop_back();
            const int parent = nodes_.parent(node);
            if (parent >= 0)
            {
                const auto above = static_cast<std::size_t>(parent);
                joint_above_[node] = is_joint[above] ? parent : joint_above_[above];
                if (!nodes_[node].contains("mesh") && joint_above_[node] >= 0)
                    is_joint[node] = true;
            }
            if (is_joint[node])
                order_.push_back(node);
            if (order_.size() > kMostJoints)
                json_.fail("nodes",
                           "more than " + std::to_string(kMostJoints) + " joints");
            const auto& children = nodes_.children(node);
            rest.insert(rest.end(), children.rbegin(), children.rend());
        }
        if (order_.empty())
            json_.fail("nodes", "there is no skeleton (no skin, and no node but those "
                                "with meshes)");
    }

    /// From the world to where the skin's units are those of the scene.
    Affine3d whole() const { return Affine3d(Eigen::Scaling(1.0 / whole_scale_)); }
    /// By how much the scene scales what its skins have bound, by their first joint.
    void find_whole_scale()
    {
        for (const std::size_t node : order_)
            if (const auto bind = bind_.find(node); bind != bind_.end())
            {
                const Matrix3d map = world(node).linear() * bind->second.linear();
                const double scale = std::cbrt(std::abs(map.determinant()));
                if (!(scale > 1e-15 && scale < 1e15) || std::abs(scale - 1.0) <= kNoScale)
                    return;
                whole_scale_ = scale;
                world_.clear();
                out_.warnings.push_back(
                    at({json_.path(), 0, element("nodes", node)},
                       "the skeleton is scaled by " + shortest_of(scale) +
                           " against its skin: it is read in the skin's units"));
                return;
            }
    }
    /// With as many digits as tell something.
    static std::string shortest_of(double scale)
    {
        return shortest(static_cast<double>(std::llround(scale * 1e6)) / 1e6);
    }
    void warn_of_scales()
    {
        if (largest_scale_ > kNoScale)
            out_.warnings.push_back(
                at({json_.path(), 0, ""}, "scales joints by up to " +
                                              shortest_of(100.0 * largest_scale_) +
                                              " %, which is left out: bones are rigid"));
    }

    /// From its parent to a node where nothing moves it.
    Affine3d world(std::size_t node) const
    {
        const auto known = world_.find(node);
        if (known != world_.end())
            return known->second;
        std::vector<std::size_t> up = {node};
        while (nodes_.parent(up.back()) >= 0)
            up.push_back(static_cast<std::size_t>(nodes_.parent(up.back())));
        Affine3d map = whole();
        for (auto above = up.rbegin(); above != up.rend(); ++above)
            map = map * nodes_.matrix(*above);
        return world_[node] = map;
    }

    void find_bind()
    {
        const Json& skins = json_.list("skins");
        for (std::size_t s = 0; s < skins.size(); ++s)
        {
            const Json& joints = skins[s]["joints"];
            const std::string where = element("skins", s);
            if (!skins[s].contains("inverseBindMatrices"))
                continue;
            const std::vector<double> all =
                numbers(skins[s], "inverseBindMatrices", 16, where);
            if (all.size() < 16 * joints.size())
                json_.fail(where + ".inverseBindMatrices",
                           "has " + std::to_string(all.size() / 16) + ", need " +
                               std::to_string(joints.size()));
            for (std::size_t k = 0; k < joints.size(); ++k)
            {
                Affine3d map;
                map.matrix() = Eigen::Map<const Eigen::Matrix4d>(all.data() + 16 * k);
                map.makeAffine();
                bind_.try_emplace(joints[k].get<std::size_t>(), map);
            }
        }
        find_whole_scale();
        for (const std::size_t node : order_)
            bind_.try_emplace(node, world(node).inverse());
        for (const auto& [node, map] : bind_)
            if (!(std::abs(map.linear().determinant()) > 1e-30) ||
                !map.matrix().allFinite())
                json_.fail(element("nodes", node), "its bind pose is flat: its matrix "
                                                   "has no inverse");
    }

    void name_joints()
    {
        std::set<std::string> known;
        for (const std::size_t node : order_)
        {
            const std::string own = nodes_.name(node);
            std::string name = own.empty() ? "node " + std::to_string(node) : own;
            for (int k = 2; !known.insert(name).second; ++k)
                name = own + "." + std::to_string(k);
            names_[node] = name;
        }
    }

    // --- weights ----------------------------------------------------------------------
    void add_weights(std::size_t node,
                     const std::map<std::size_t, std::size_t>& column_of,
                     PaintedWeights& out) const
    {
        const std::size_t mesh =
            json_.index_of(nodes_[node]["mesh"], element("nodes", node) + ".mesh",
                           "meshes", json_.list("meshes").size());
        const Json* primitives = json_.find(json_.list("meshes")[mesh], "primitives");
        const std::size_t width = out.joints.size();
        std::set<std::size_t> known; // positions that primitives of the mesh share
        for (std::size_t p = 0; primitives && p < primitives->size(); ++p)
        {
            const std::string where =
                element("meshes", mesh) + ".primitives[" + std::to_string(p) + "]";
            const Json* attributes = json_.find((*primitives)[p], "attributes");
            if (!attributes || !attributes->is_object() ||
                !attributes->contains("POSITION"))
                json_.fail(where, "has no POSITION");
            const std::size_t position =
                json_.index_of((*attributes)["POSITION"], where + ": POSITION",
                               "accessors", data_.accessors().size());
            if (!known.insert(position).second)
                continue;
            const auto count =
                static_cast<std::size_t>(data_.accessors()[position].count);
            const std::size_t first = out.values.size();
            if (width * count > kMostWeights - std::min(kMostWeights, first))
                json_.fail(where, "its weights are more than " +
                                      std::to_string(kMostWeights) + " numbers");
            out.values.resize(first + width * count, 0.0);
            if (!nodes_[node].contains("skin"))
                continue; // its samples have none
            const std::size_t skin =
                json_.index_of(nodes_[node]["skin"], element("nodes", node) + ".skin",
                               "skins", json_.list("skins").size());
            const Json& joints = json_.list("skins")[skin]["joints"];
            for (int set = 0;; ++set)
            {
                const std::string which = std::to_string(set);
                const std::string of_joints = "JOINTS_" + which,
                                  of_weights = "WEIGHTS_" + which;
                if (!attributes->contains(of_joints) || !attributes->contains(of_weights))
                    break;
                const std::vector<double> number =
                    numbers(*attributes, of_joints.c_str(), 4, where);
                const std::vector<double> weight =
                    numbers(*attributes, of_weights.c_str(), 4, where);
                if (number.size() != 4 * count || weight.size() != 4 * count)
                    json_.fail(where, "its attributes differ in count");
                for (std::size_t k = 0; k < number.size(); ++k)
                {
                    if (weight[k] == 0.0)
                        continue;
                    if (!(weight[k] > 0.0))
                        json_.fail(where + "." + of_weights, "holds a weight below 0");
                    if (!(number[k] >= 0.0 && number[k] < double(joints.size())))
                        json_.fail(where + "." + of_joints,
                                   "names a joint that the skin has not");
                    const std::size_t joint =
                        joints[static_cast<std::size_t>(number[k])].get<std::size_t>();
                    out.values[first + width * (k / 4) + column_of.at(joint)] +=
                        weight[k];
                }
            }
        }
    }

    // --- their keys --------------------------------------------------------------------
    /// The rotation of a map, and its scale.
    std::pair<Quaterniond, double> parts(const Matrix3d& map, std::size_t node) const
    {
        const Eigen::JacobiSVD<Matrix3d> svd(map,
                                             Eigen::ComputeFullU | Eigen::ComputeFullV);
        const Vector3d scales = svd.singularValues();
        const Matrix3d turn = svd.matrixU() * svd.matrixV().transpose();
        if (!(scales[2] > 0) || scales[0] > (1.0 + kSmallScale) * scales[2] ||
            turn.determinant() < 0)
            json_.fail(element("nodes", node),
                       "joint " + in_quotes(names_.at(node)) +
                           " is scaled differently along its axes, or mirrored");
        largest_scale_ = std::max(largest_scale_, scales[0] / scales[2] - 1.0);
        return {Quaterniond(turn).normalized(), scales.mean()};
    }

    void add_joint(std::size_t node)
    {
        const std::size_t number = out_.joints.size();
        const int parent = joint_above_[node];
        SkeletonJoint& joint = out_.joints.emplace_back();
        joint.name = names_.at(node);
        Affine3d before = whole(); // C: all that stands above M
        std::vector<std::size_t> between;
        for (int above = nodes_.parent(node); above >= 0 && above != parent;
             above = nodes_.parent(static_cast<std::size_t>(above)))
            between.push_back(static_cast<std::size_t>(above));
        if (parent >= 0)
        {
            joint.parent = names_.at(static_cast<std::size_t>(parent));
            before = bind_.at(static_cast<std::size_t>(parent)).inverse();
        }
        for (auto above = between.rbegin(); above != between.rend(); ++above)
            before = before * nodes_.matrix(*above);
        const Affine3d& bind = bind_.at(node);
        joint.at = bind.inverse().translation();
        check_scale(node, before, bind);
        const Quaterniond left = parts(before.linear(), node).first;
        const Quaterniond right = parts(bind.linear(), node).first;
        const Affine3d now = nodes_.matrix(node);
        const Quaterniond turn_now = parts(now.linear(), node).first;
        const auto found = channels_.find(node);
        const Channels none;
        const Channels& channels = found == channels_.end() ? none : found->second;
        const auto to_turn = [&](const double* q) -> Eigen::Vector4d
        { return (left * Quaterniond(q[3], q[0], q[1], q[2]) * right).coeffs(); };
        add_track<4>(number, channels.rotation, out_.turns, to_turn, to_turn,
                     (left * turn_now * right).coeffs(),
                     Quaterniond::Identity().coeffs());
        const Vector3d rest = joint.at;
        add_track<3>(
            number, channels.translation, out_.shifts,
            [&](const double* x) -> Vector3d
            { return before * Vector3d(x[0], x[1], x[2]) - rest; },
            [&](const double* x) -> Vector3d
            { return before.linear() * Vector3d(x[0], x[1], x[2]); },
            before* now.translation() - rest, Vector3d::Zero());
    }

    /// Of limbs whose last joint is that of a skin.
    void add_ends()
    {
        std::set<std::string> parents, names;
        for (const SkeletonJoint& joint : out_.joints)
        {
            parents.insert(joint.parent);
            names.insert(joint.name);
        }
        const std::size_t count = out_.joints.size();
        for (std::size_t j = 0; j < count; ++j)
        {
            const SkeletonJoint joint = out_.joints[j];
            const int above = joint_above_[order_[j]];
            if (above < 0 || parents.contains(joint.name) ||
                !of_skin_.contains(order_[j]))
                continue;
            const Vector3d from =
                bind_.at(static_cast<std::size_t>(above)).inverse().translation();
            SkeletonJoint end;
            end.name = joint.name + ".end";
            for (int k = 2; !names.insert(end.name).second; ++k)
                end.name = joint.name + ".end" + std::to_string(k);
            end.parent = joint.name;
            end.at = joint.at + 0.5 * (joint.at - from);
            if (end.at != joint.at)
                out_.joints.push_back(end);
        }
    }

    /// That the joint moves space without scaling it, at rest and by its keys.
    void check_scale(std::size_t node, const Affine3d& before, const Affine3d& bind) const
    {
        const double around =
            parts(before.linear(), node).second * parts(bind.linear(), node).second;
        const double own = parts(nodes_.matrix(node).linear(), node).second;
        const auto check = [&](double scale, const std::string& where)
        {
            const double more = std::abs(around * scale - 1.0);
            if (more <= kSmallScale)
                largest_scale_ = std::max(largest_scale_, more);
            else
                json_.fail(where, "scales joint " + in_quotes(names_.at(node)) +
                                      ": bones are rigid (got " +
                                      shortest(around * scale) + ", need 1)");
        };
        const auto found = channels_.find(node);
        if (found == channels_.end() || !found->second.scale)
            return check(own, element("nodes", node));
        const Channel& keys = *found->second.scale;
        const std::size_t each = keys.step == KeyStep::Cubic ? 3 : 1;
        for (std::size_t k = 0; k < keys.times.size(); ++k)
            for (std::size_t axis = 0; axis < 3; ++axis)
                check(keys.numbers[3 * (each * k + each / 2) + axis], keys.where);
    }

    /// The keys of a channel; without one, one key where the joint does not stand at
    /// rest.
    template <int size, class ToValue, class ToSlope>
    void add_track(std::size_t joint, const std::optional<Channel>& keys,
                   std::vector<KeyTrack<size>>& out, ToValue&& to_value,
                   ToSlope&& to_slope, const Eigen::Matrix<double, size, 1>& now,
                   const Eigen::Matrix<double, size, 1>& rest)
    {
        using Value = Eigen::Matrix<double, size, 1>;
        KeyTrack<size> track;
        track.joint = joint;
        const auto unit = [](Value value) -> Value
        {
            if constexpr (size == 4)
                value.normalize();
            return value;
        };
        if (!keys)
        {
            const double away =
                std::min((now - rest).norm(), size == 4 ? (now + rest).norm() : INFINITY);
            if (away <= kAtRest * std::max(1.0, out_.joints[joint].at.norm()))
                return;
            track.times = {0.0};
            track.values = {unit(now)};
            out.push_back(std::move(track));
            return;
        }
        track.step = keys->step;
        track.times = keys->times;
        const bool is_cubic = keys->step == KeyStep::Cubic;
        for (std::size_t k = 0; k < keys->times.size(); ++k)
        {
            const double* const first =
                keys->numbers.data() + (is_cubic ? 3 : 1) * k * size;
            const double* const value = first + (is_cubic ? size : 0);
            if (size == 4 && !(Eigen::Map<const Eigen::Vector4d>(value).norm() > 1e-6))
                json_.fail(keys->where, "key " + std::to_string(k) + " is no rotation");
            track.values.push_back(unit(to_value(value)));
            if (is_cubic)
                track.tangents.push_back({to_slope(first), to_slope(first + 2 * size)});
        }
        out.push_back(std::move(track));
    }

    GltfLayout layout_;
    GltfData data_;
    const GltfJson& json_;
    const GltfNodes nodes_;
    std::set<std::size_t> of_skin_;            ///< nodes
    std::map<std::size_t, Channels> channels_; ///< of nodes
    std::vector<std::size_t> order_;           ///< nodes that are joints, parents first
    std::vector<int> joint_above_;             ///< of a node: the next one; -1: none
    std::map<std::size_t, Affine3d> bind_;     ///< of a joint: from the rest to its space
    mutable std::map<std::size_t, Affine3d> world_;
    std::map<std::size_t, std::string> names_;
    double whole_scale_ = 1.0;           ///< > 0
    mutable double largest_scale_ = 0.0; ///< by how much bones would stretch, of 1
    SkeletonValues out_;
};

} // namespace

SkeletonValues parse_gltf_skeleton(const std::string& path, std::string bytes,
                                   const SkeletonPlacement& placement)
{
    const auto file_of = [](const std::string& name, std::string content)
    {
        GeometryFile file;
        file.path = name;
        file.bytes = std::move(content);
        file.geometry.format = extension_of(name);
        return file;
    };
    GeometryFile file = file_of(path, std::move(bytes)), other;
    SkeletonReader reader(file);
    std::optional<SkeletonReader> of_animation;
    if (!placement.animation_file.empty())
    {
        other = file_of(placement.animation_file, read_file(placement.animation_file));
        of_animation.emplace(other);
    }
    SkeletonValues out =
        reader.read(placement.animation, of_animation ? &*of_animation : nullptr);
    for (const GeometryFile* from : {&other, &file})
        out.warnings.insert(out.warnings.begin(), from->geometry.warnings.begin(),
                            from->geometry.warnings.end());
    return out;
}

PaintedWeights parse_gltf_weights(const std::string& path, std::string bytes)
{
    GeometryFile file;
    file.path = path;
    file.bytes = std::move(bytes);
    file.geometry.format = extension_of(path);
    return SkeletonReader(file).read_weights();
}

} // namespace cellwarp::core
