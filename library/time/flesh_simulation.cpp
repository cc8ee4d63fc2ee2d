// SPDX-License-Identifier: GPL-3.0-or-later
// BDF2 is a step of implicit Euler too, of another length from another state:
//   (3 u_n+1 - 4 u_n + u_n-1) / 2 h = v_n+1  <=>  u_n+1 = u^ + (2 h / 3) v_n+1,
// u^ = (4 u_n - u_n-1) / 3, and so for velocities. Held points end where they should, and
// obstacles move by the same differences. The first step is of Euler, and each one after
// a step in which something touched: what touches comes to rest by what Euler dissipates
// (a block on the ground pressed it by 0.9 to 1.1 of its weight with BDF2).
#include "library/time/flesh_simulation.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "io/base/error.h"
#include "io/scene/skeleton_scene.h"
#include "library/session/played_frames.h"
#include "library/time/drawn_shapes.h"
#include "library/time/key_motion.h"
#include "library/time/softness.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kNormalsGrain = 1024; ///< samples

/// Flesh is taken from rest to the first pose in parts of at most this turn [rad].
constexpr double kTurnOfFirst = 0.2;
/// And of this way [diagonal], in no more parts than this.
constexpr double kWayOfFirst = 0.2, kMostPartsOfWay = 64.0;
/// Before the last part rest need not be near [diagonal].
constexpr double kNearRest = 1e-3, kAtRest = 1e-7;

/// What a hand pulls goes this share of its way in a step: its force stays small.
constexpr double kPullOfStep = 0.2;

SimulationReport nothing_yet()
{
    SimulationReport report;
    report.flesh.emplace();
    return report;
}

} // namespace

FleshSimulation::FleshSimulation(std::shared_ptr<const Geometry> geometry,
                                 const SceneFile& scene, const CellSettings& cells,
                                 bool is_tight, const HandleFile& handles)
    : geometry_(std::move(geometry)), time_(scene.time),
      // Blended regions have factors for one length of the step.
      is_of_second_order_(time_.integrator == "bdf2" &&
                          (scene.skeleton->flesh.law != "regions" ||
                           scene.skeleton->flesh.obstacles.empty())),
      skeleton_(played_skeleton(scene, handles, *geometry_)),
      model_(flesh_model(geometry_, scene, skeleton_, cells, is_tight)),
      body_(build_flesh(model_)), settles_(settles(body_)), warnings_(skeleton_.warnings),
      since_(nothing_yet())
{
    model_ = body_.model;
    warnings_.insert(warnings_.end(), model_->warnings.begin(), model_->warnings.end());
    warnings_.insert(warnings_.end(), body_.warnings.begin(), body_.warnings.end());
    keys_.emplace(skeleton_);
    for (std::string& warning : keys_->warnings(scene.path))
        warnings_.push_back(std::move(warning));
    for (const DirectionUse& use : direction_uses(*geometry_))
        use_samples_.push_back(use.sample);
    snapshot_.state = body_.flesh->rest();
    if (model_->flesh().detail > 0.0)
    {
        snapshot_.detail.octree = body_.tree;
        snapshot_.detail.coarser = snapshot_.detail.octree;
        snapshot_.detail.fading.resize(body_.own_motions.size());
    }
    begin();
    if (has_detail())
    {
        snapshot_.detail.now = motions_at(0);
        snapshot_.detail.now.resize(body_.first_own_motion());
    }
}

FleshSimulation::~FleshSimulation() = default;

std::int64_t FleshSimulation::num_steps() const
{
    return time_.num_steps();
}

std::int64_t FleshSimulation::steps_a_frame() const
{
    return time_.steps_a_frame();
}

std::int64_t FleshSimulation::last_frame() const
{
    return time_.last_frame();
}

/// The aim of the skeleton's joints.
SkeletonAim FleshSimulation::aim_at(double time, const std::vector<Move>& by_hand) const
{
    std::vector<Move> moves = keys_->moves_at(time);
    for (const Move& move : by_hand)
    {
        const auto same =
            std::find_if(moves.begin(), moves.end(),
                         [&](const Move& other) { return other.region == move.region; });
        if (same == moves.end())
            moves.push_back(move);
        else
            *same = move;
    }
    std::vector<const Move*> pointers;
    for (const Move& move : moves)
        pointers.push_back(&move);
    const Units units{model_->frame, false, bounding_box(geometry_->samples), 0.0};
    return model_->skeleton->moved(model_->skeleton->rest(), pointers, units);
}

/// Of space around each joint, from rest, on the way between two aims [m]; then those of
/// points that are held, at \p time, so much of their way from rest.
std::vector<Motion> FleshSimulation::motions_between(const SkeletonAim& from,
                                                     const SkeletonAim& to, double share,
                                                     double time) const
{
    std::vector<Motion> motions = model_->skeleton->motions(from, to, share);
    for (Motion& motion : motions)
        motion.t *= model_->metre;
    for (const MoveKeys& keys : body_.held_points.holds)
        motions.push_back({Matrix3d::Identity(), share * motion_at(keys, time).t});
    for (std::size_t k = 0; k < body_.own_motions.size(); ++k)
    {
        const int follows = body_.own_motions[k].follows;
        Motion& motion =
            motions.emplace_back(follows < 0 ? Motion() : motions[idx(follows)]);
        motion.t += snapshot_.detail.fading[k].at(time);
    }
    return motions;
}

/// At the end of the step that ends at \p time, with the velocities that it has them by.
std::vector<FleshObstacle> FleshSimulation::obstacles_at(double time) const
{
    std::vector<FleshObstacle> obstacles;
    for (const auto& [rest, keys] : model_->obstacles)
    {
        FleshObstacle& obstacle = obstacles.emplace_back(rest);
        const Vector3d shift = motion_at(keys, time).t;
        obstacle.centre += shift;
        if (obstacle.normal)
            obstacle.offset += obstacle.normal->dot(shift);
        const Vector3d last = motion_at(keys, time - time_.dt).t;
        obstacle.velocity = (shift - last) / time_.dt;
        if (snapshot_.before)
            obstacle.velocity +=
                0.5 * (shift - 2.0 * last + motion_at(keys, time - 2.0 * time_.dt).t) /
                time_.dt;
    }
    return obstacles;
}

/// What is held along a normal, so much of its way, and what the hand pulls.
std::vector<PulledPoint> FleshSimulation::pulled_at(double time, double share) const
{
    std::vector<PulledPoint> pulled;
    for (const HeldPoints::Guided& guided : body_.held_points.guided)
    {
        PulledPoint& point = pulled.emplace_back(guided.point);
        point.goal = point.point.place + share * motion_at(guided.keys, time).t;
        if (has_detail() && guided.whole >= 0)
            point.goal +=
                snapshot_.detail.fading[body_.own_of_whole(idx(guided.whole))].at(time);
    }
    if (const std::optional<FleshPull>& pull = snapshot_.pull;
        pull && pull->sample < geometry_->samples.size() && pull->place.allFinite())
    {
        PulledPoint& point = pulled.emplace_back();
        point.point = body_.point_of_sample(pull->sample);
        const Vector3d now =
            point.point.place + at_point(point.point.shares, snapshot_.state.u);
        point.goal = now + kPullOfStep * (model_->to_metres(pull->place) - now);
    }
    return pulled;
}

std::vector<Motion> FleshSimulation::motions_at(std::int64_t step) const
{
    const double time = static_cast<double>(step) * time_.dt;
    const SkeletonAim aim = aim_at(time, snapshot_.by_hand);
    return motions_between(aim, aim, 1.0, time);
}

/// The same at the end of the step that is done.
std::vector<Motion> FleshSimulation::motions_now() const
{
    return motions_at(steps_done());
}

/// The aim of which \p pose is the rest, but for the turn and the shift of its only root:
/// that moves all flesh as a rigid body, which is where \p state is then.
SkeletonAim FleshSimulation::carried_by_root(const SkeletonAim& pose, FleshState& state)
{
    SkeletonAim aim = model_->skeleton->rest();
    std::size_t root = 0, num_roots = 0;
    for (std::size_t j = 0; j < model_->skeleton->size(); ++j)
        if (model_->skeleton->parent(j) < 0 && num_roots++ == 0)
            root = j;
    // Points that are held at their places do not go along.
    if (num_roots != 1 || !body_.held_points.whole.empty() ||
        !body_.held_points.guided.empty())
        return aim;
    aim.turns[root] = pose.turns[root];
    aim.shifts[root] = pose.shifts[root];
    const Motion carries = motions_between(aim, aim, 1.0, 0.0)[root];
    const Lattice& lattice = body_.flesh->lattice();
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        state.u.segment<3>(Eigen::Index(3 * n)) =
            carries(lattice.places[n]) - lattice.places[n];
    return aim;
}

/// From rest to the first pose, without inertia; then, where the scene says so, on to
/// where the flesh hangs in its weight.
void FleshSimulation::begin()
{
    const SkeletonAim pose = aim_at(0.0, {}),
                      from = carried_by_root(pose, snapshot_.state);
    const std::vector<Motion> before = motions_between(from, from, 0.0, 0.0),
                              first = motions_between(pose, pose, 1.0, 0.0);
    std::vector<FleshObstacle> obstacles = obstacles_at(0.0);
    for (FleshObstacle& obstacle : obstacles)
        obstacle.velocity.setZero(); // there is no time yet
    double turn = 0.0, way = 0.0;
    for (std::size_t j = 0; j < model_->skeleton->size(); ++j)
    {
        turn =
            std::max(turn, rotation_vector(first[j].R * before[j].R.transpose()).norm());
        const Vector3d at = model_->metre * model_->skeleton->place(j);
        way = std::max(way, (first[j](at) - before[j](at)).norm());
    }
    for (const std::vector<PulledPoint> pulled = pulled_at(0.0, 1.0);
         const PulledPoint& point : pulled)
        way = std::max(way, (point.goal - point.point.place).norm());
    for (const MoveKeys& keys : body_.held_points.holds)
        way = std::max(way, motion_at(keys, 0.0).t.norm());
    bool is_at_rest = true;
    const auto settle =
        [&](const SkeletonAim& begin, double share, Weighs weighs, double at_rest)
    {
        const std::vector<PulledPoint> pulled = pulled_at(0.0, share);
        const FleshReport report =
            body_.flesh->settle(snapshot_.state, motions_between(begin, pose, share, 0.0),
                                weighs, {obstacles, pulled}, at_rest);
        since_.iterations += report.systems;
        since_.flesh->cg_steps += report.cg_steps;
        since_.flesh->factors += report.factors;
        return report.is_converged;
    };
    if (turn > 0.0 || way > 0.0)
    {
        // The way of the joints, not that of each bone alone: they stay together.
        const double size = model_->metre * model_->frame.diagonal();
        const int parts =
            std::max(1, static_cast<int>(std::ceil(std::min(
                            kMostPartsOfWay,
                            std::max(turn / kTurnOfFirst, way / (kWayOfFirst * size))))));
        for (int part = 1; part < parts; ++part)
            settle(from, static_cast<double>(part) / parts, Weighs::No, kNearRest);
        is_at_rest = settle(from, 1.0, Weighs::No, kAtRest);
    }
    bool hangs = settles_;
    const auto settle_here = [&]
    {
        const FleshState before_it = snapshot_.state;
        const bool has_rest =
            settle(pose, 1.0, hangs ? Weighs::Yes : Weighs::No, kAtRest);
        is_at_rest = is_at_rest && has_rest;
        if (hangs && !has_rest)
        {
            // After a change of the lattice the state before is one with weight.
            snapshot_.state = before_it;
            hangs = false;
            settle(pose, 1.0, Weighs::No, kAtRest);
        }
    };
    if (settles_)
        settle_here();
    // What bends there gets its detail, and comes to rest with it.
    for (int look = 0; has_detail() && look < 2 * model_->cells.max_depth + 2; ++look)
    {
        if (!look_for_detail())
            break;
        settle_here();
    }
    if (!is_at_rest)
        stopped("no rest before frame 0");
}

void FleshSimulation::step()
{
    const Clock::time_point start = Clock::now();
    const double end = static_cast<double>(snapshot_.steps + 1) * time_.dt;
    const std::vector<FleshObstacle> obstacles = obstacles_at(end);
    const std::vector<PulledPoint> pulled = pulled_at(end, 1.0);
    FleshState state = snapshot_.state;
    double dt = time_.dt;
    if (const std::optional<FleshState>& before = snapshot_.before)
    {
        state.u = (4.0 * state.u - before->u) / 3.0;
        state.v = (4.0 * state.v - before->v) / 3.0;
        dt *= 2.0 / 3.0;
    }
    const FleshReport report = body_.flesh->step(
        state, dt, motions_at(snapshot_.steps + 1), {obstacles, pulled});
    if (!report.is_finite)
        state = snapshot_.state;
    take_step(std::move(state), report, ms_since(start));
}

void FleshSimulation::take_step(FleshState state, const FleshReport& report, double ms)
{
    std::swap(snapshot_.state, state);
    const bool was_of_second_order = snapshot_.before.has_value();
    snapshot_.before.reset();
    if (is_of_second_order_ && report.is_finite && report.contacts.count == 0)
        snapshot_.before = std::move(state);
    ++snapshot_.steps;
    if (has_detail())
    {
        FleshDetail& detail = snapshot_.detail;
        detail.earlier = std::move(detail.before);
        if (!was_of_second_order)
            detail.earlier.clear();
        detail.before = std::move(detail.now);
        detail.now = motions_at(snapshot_.steps);
        detail.now.resize(body_.first_own_motion());
    }
    since_.flesh->limited =
        aim_at(static_cast<double>(snapshot_.steps) * time_.dt, snapshot_.by_hand)
            .limited;
    since_.iterations += report.systems;
    since_.flesh->factors += report.factors;
    since_.flesh->contacts = report.contacts.count;
    since_.flesh->support = report.contacts.force;
    since_.flesh->pull = report.contacts.pull;
    since_.flesh->cg_steps += report.cg_steps;
    since_.flesh->step_ms += ms;
    is_finite_ = report.is_finite;
    const auto every =
        static_cast<std::int64_t>(std::ceil(kDetailEvery / time_.dt - 0.5));
    if (has_detail() && is_finite_ &&
        snapshot_.steps % std::max<std::int64_t>(every, 1) == 0)
        look_for_detail();
    if (!report.is_converged)
        stopped(!is_finite_                   ? "no finite numbers"
                : !report.contacts.is_settled ? "contacts not found"
                                              : "iteration limit");
}

std::int64_t FleshSimulation::steps_of_fade() const
{
    return std::max<std::int64_t>(1, std::llround(kFade / time_.dt));
}

/// Cells that are to be small whatever their strain: where something touches, where a
/// hand pulls, and where the scene says so.
std::vector<char> FleshSimulation::wanted_cells() const
{
    const Octree& octree = *snapshot_.detail.octree;
    std::vector<char> is_fine(octree.leaves().size(), 0);
    for (const LeafNumber leaf : leaves_of_fine_regions(*model_, octree))
        is_fine[idx(leaf)] = 1;
    std::vector<char> is_wanted;
    for (const LatticeBox& box : body_.flesh->lattice().boxes)
        is_wanted.push_back(is_fine[idx(octree.find(box.corner))]);
    const std::vector<FleshObstacle> obstacles =
        obstacles_at(static_cast<double>(snapshot_.steps) * time_.dt);
    for (const std::size_t sample : body_.flesh->touching(snapshot_.state, obstacles))
        is_wanted[idx(body_.cell_of_sample[sample])] = 1;
    if (snapshot_.pull && snapshot_.pull->sample < geometry_->samples.size())
        is_wanted[idx(body_.cell_of_sample[snapshot_.pull->sample])] = 1;
    return is_wanted;
}

/// Where it bends, touches or is pulled cells become smaller, elsewhere larger again.
/// True: it has another lattice.
bool FleshSimulation::look_for_detail()
{
    const Clock::time_point start = Clock::now();
    const std::vector<double> errors = uneven_strains(body_, snapshot_.state);
    const std::vector<char> is_wanted = wanted_cells();
    DetailLook look{errors, is_wanted};
    look.threshold = model_->flesh().detail * model_->metre * model_->frame.diagonal();
    look.time = static_cast<double>(snapshot_.steps) * time_.dt;
    look.step = snapshot_.steps;
    look.steps_of_fade = steps_of_fade();
    look.most_cells = model_->cells.max_cells;
    FleshDetail next = snapshot_.detail;
    const DetailChange change = change_detail(body_, look, next);
    since_.flesh->split += change.split;
    since_.flesh->merged += change.merged;
    if (change.is_full && !std::exchange(has_told_of_most_, true))
        warnings_.push_back(at({model_->scene.path, 0, "skeleton.detail"},
                               "is not added any more: there would be more than "
                               "max_cells " +
                                   std::to_string(model_->cells.max_cells)));
    if (!change.has_changed)
    {
        snapshot_.detail = std::move(next);
        return false;
    }
    FleshBody body = build_flesh(model_, *next.octree, *next.coarser);
    CarriedState carried = carried_to(body, body_, snapshot_.state);
    next.fading = fading_in(body, carried, next);
    for (const std::string& warning : body.warnings)
        if (std::find(warnings_.begin(), warnings_.end(), warning) == warnings_.end())
            warnings_.push_back(warning);
    body.flesh->take_factors(*body_.flesh);
    snapshot_.state = std::move(carried.state);
    if (snapshot_.before)
        snapshot_.before = carried_to(body, body_, *snapshot_.before).state;
    snapshot_.detail = std::move(next);
    body_ = std::move(body);
    smooth_.reset();
    since_.flesh->detail_ms += ms_since(start);
    return true;
}

/// Of the own motions of another lattice: points lie as far off as they do, go on as fast
/// as they are, and come to where they belong.
std::vector<Fading> FleshSimulation::fading_in(const FleshBody& body,
                                               const CarriedState& carried,
                                               const FleshDetail& next) const
{
    std::vector<Fading> out(body.own_motions.size());
    if (snapshot_.steps == 0)
        return out; // it comes to rest there
    const double now = static_cast<double>(snapshot_.steps) * time_.dt;
    const double fade = time_.dt * static_cast<double>(steps_of_fade());
    std::map<int, double> ends; // of nodes that leave already
    double on_bones = now;      // when points of bones that are on their way get there
    for (std::size_t k = 0; k < body_.own_motions.size(); ++k)
        if (const double end = snapshot_.detail.fading[k].end;
            k < body_.leaving.nodes.size())
            ends.emplace(body_.leaving.nodes[k].node, end);
        else
            on_bones = std::max(on_bones, end);
    for (std::size_t k = 0; k < out.size(); ++k)
    {
        const FleshBody::OwnMotion& of = body.own_motions[k];
        Fading& fading = out[k];
        fading.begin = now;
        fading.end = now + fade;
        fading.from = at_point(of.shares, carried.state.u);
        fading.slope = at_point(of.shares, carried.state.v);
        if (of.follows < 0)
        {
            const auto old = ends.find(carried.old_node[idx(body.leaving.nodes[k].node)]);
            if (old != ends.end() && old->second > now)
                fading.end = old->second;
            continue;
        }
        const Vector3d there = next.now[idx(of.follows)](of.place);
        fading.from -= there - of.place;
        // As fast as the last step had it.
        const Vector3d last = next.before[idx(of.follows)](of.place);
        fading.slope -= (there - last) / time_.dt;
        if (!next.earlier.empty())
            fading.slope -=
                0.5 * (there - 2.0 * last + next.earlier[idx(of.follows)](of.place)) /
                time_.dt;
        // One change follows the other: what is on its way must get there.
        if (on_bones > now)
            fading.end = std::max(on_bones, now + fade / 4.0);
    }
    return out;
}

void FleshSimulation::go_to(Snapshot snapshot)
{
    const bool has_same_lattice = snapshot_.detail.has_lattice_of(snapshot.detail);
    snapshot_ = std::move(snapshot);
    if (has_same_lattice)
        return;
    body_ = build_flesh(model_, *snapshot_.detail.octree, *snapshot_.detail.coarser);
    smooth_.reset();
}

/// Remembers why, the first time since the last report.
void FleshSimulation::stopped(const char* why)
{
    if (since_.is_converged)
        since_.stop = why;
    since_.is_converged = false;
}

void FleshSimulation::next_frame(const std::function<void()>& watch)
{
    do
    {
        step();
        if (watch)
            watch();
    } while (steps_done() < num_steps() && steps_done() % steps_a_frame() != 0);
}

SimulationReport FleshSimulation::report()
{
    SimulationReport out = std::exchange(since_, nothing_yet());
    FleshMeasures& flesh = *out.flesh;
    out.time = static_cast<double>(steps_done()) * time_.dt;
    const std::vector<Motion> motions = motions_now();
    const FleshState& state = snapshot_.state;
    // Heights count from the model's own origin.
    const Vector3d origin = model_->to_metres(Vector3d::Zero());
    const Flesh::Energies energies = body_.flesh->energies(state, motions, origin);
    out.kinetic = flesh.kinetic = energies.kinetic;
    out.elastic = flesh.elastic = energies.elastic + energies.tube;
    out.gravity = energies.gravity;
    const Vector3d momentum = body_.flesh->momentum(state);
    const Matrix3d to_model = model_->frame.axes.transpose();
    flesh.support = to_model * flesh.support;
    flesh.pull = to_model * flesh.pull;
    out.momentum = to_model * momentum;
    out.angular_momentum =
        to_model * (body_.flesh->angular_momentum(state) - origin.cross(momentum));
    out.violation = body_.flesh->largest_miss(state, motions);
    // Points that are on their way are off their bones, which is where they should be.
    const std::vector<int>& dropped = body_.flesh->nodes().dropped;
    for (std::size_t k = body_.leaving.nodes.size(); k < body_.own_motions.size(); ++k)
        if (!std::binary_search(dropped.begin(), dropped.end(), static_cast<int>(k)))
        {
            const FleshBody::OwnMotion& of = body_.own_motions[k];
            out.violation =
                std::max(out.violation, (at_point(of.shares, state.u) + of.place -
                                         motions[idx(of.follows)](of.place))
                                            .norm());
        }
    flesh.largest_strain = body_.flesh->largest_strain(state);
    flesh.inverted = body_.flesh->num_inverted(state);
    if (!out.is_converged)
        out.problems.push_back("the flesh: " + out.stop);
    return out;
}

Geometry FleshSimulation::obstacles() const
{
    Geometry out;
    const double time = static_cast<double>(steps_done()) * time_.dt;
    const ModelBox box = bounding_box(geometry_->samples);
    for (const FleshObstacle& obstacle : obstacles_at(time))
    {
        constexpr int kAround = 24;
        if (!obstacle.normal)
        {
            add_ball(model_->to_model(obstacle.centre),
                     model_->frame.length_to_model(obstacle.radius / model_->metre),
                     kAround, out);
            continue;
        }
        const Vector3d normal = model_->frame.axes.transpose() * *obstacle.normal;
        add_tile(normal, normal.dot(model_->to_model(obstacle.offset * *obstacle.normal)),
                 box.centre(), 0.75 * box.size().norm(), out);
    }
    return out;
}

std::vector<PosedJoint> FleshSimulation::joints() const
{
    const std::vector<Motion> motions = motions_now();
    std::vector<PosedJoint> joints;
    for (std::size_t j = 0; j < model_->skeleton->size(); ++j)
        joints.push_back(
            {model_->skeleton->statement(j).name, model_->skeleton->parent(j),
             model_->to_model(motions[j](model_->metre * model_->skeleton->place(j)))});
    return joints;
}

std::optional<Move> FleshSimulation::pointed(const std::string& joint,
                                             const Vector3d& place) const
{
    const int number = model_->skeleton->find(joint);
    if (number < 0 || !place.allFinite())
        return std::nullopt;
    const std::vector<Motion> motions = motions_now();
    const auto now = [&](int j) -> Vector3d
    { return motions[idx(j)](model_->metre * model_->skeleton->place(idx(j))); };
    const Matrix3d& axes = model_->frame.axes; // rows
    const auto turn_of = [&](const Matrix3d& R)
    {
        Operation turn;
        turn.kind = Operation::Kind::Rotate;
        const Vector3d vector = axes.transpose() * rotation_vector(R);
        turn.move.degrees = vector.norm() * 180.0 / std::numbers::pi;
        turn.move.axis =
            vector.isZero(0.0) ? Vector3d::UnitZ() : Vector3d(vector.normalized());
        return turn;
    };
    Move move;
    const int parent = model_->skeleton->parent(idx(number));
    if (parent < 0)
    {
        move.region = joint;
        Operation shift;
        shift.move.translation =
            model_->to_model(model_->to_metres(place)) -
            model_->to_model(model_->metre * model_->skeleton->place(idx(number)));
        move.operations = {turn_of(motions[idx(number)].R), shift};
        return move;
    }
    // D turns the bone to the place; a joint turns in the axes of the one above it.
    const Vector3d from = now(number) - now(parent),
                   to = model_->to_metres(place) - now(parent);
    if (!(to.norm() > 0.0) || !(from.norm() > 0.0))
        return std::nullopt;
    const Matrix3d D = Eigen::Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
    const int above = model_->skeleton->parent(idx(parent));
    const Matrix3d R = above < 0 ? Matrix3d(Matrix3d::Identity()) : motions[idx(above)].R;
    move.region = model_->skeleton->statement(idx(parent)).name;
    move.operations = {turn_of(R.transpose() * D * motions[idx(parent)].R)};
    if (above < 0) // its shift stays
    {
        Operation shift;
        shift.move.translation =
            model_->to_model(now(parent)) -
            model_->to_model(model_->metre * model_->skeleton->place(idx(parent)));
        move.operations.push_back(shift);
    }
    return move;
}

DeformedSamples FleshSimulation::rest_samples() const
{
    DeformedSamples out{
        geometry_->samples, {}, geometry_->tangents, geometry_->rotations};
    for (const DirectionUse& use : direction_uses(*geometry_))
        out.directions.push_back(geometry_->directions[use.direction]);
    return out;
}

Carried FleshSimulation::carried_of(DeformedSamples& samples) const
{
    return {samples.samples,
            {use_samples_, samples.directions},
            {geometry_->tangent_samples, samples.tangents},
            {geometry_->rotation_samples, samples.rotations}};
}

DeformedSamples FleshSimulation::deformed_live() const
{
    const Lattice& lattice = body_.flesh->lattice();
    DeformedSamples out = rest_samples();
    const Carried carried = carried_of(out);
    // What turns does so by F, averaged at the nodes.
    std::vector<Matrix3d> slopes;
    if (carried.has_directions())
    {
        slopes.assign(lattice.places.size(), Matrix3d::Zero());
        std::vector<double> counts(lattice.places.size(), 0.0);
        const std::vector<Matrix3d> F = body_.flesh->deformations(snapshot_.state);
        for (const LatticePart& part : lattice.parts)
            for (const int node : lattice.cells[idx(part.cell)])
            {
                slopes[idx(node)] +=
                    part.volume * (F[idx(part.cell)] - Matrix3d::Identity());
                counts[idx(node)] += part.volume;
            }
        for (std::size_t n = 0; n < slopes.size(); ++n)
            if (counts[n] > 0.0)
                slopes[n] /= counts[n];
    }
    std::vector<FieldValue> values(geometry_->samples.size());
    parallel_for(values.size(), kNormalsGrain,
                 [&](std::size_t i)
                 {
                     const std::array<double, 8> shares = corner_shares(body_.local[i]);
                     const CornerNodes& nodes =
                         lattice.cells[idx(body_.cell_of_sample[i])];
                     FieldValue& value = values[i];
                     value = {};
                     for (std::size_t k = 0; k < 8; ++k)
                     {
                         value.displacement += shares[k] / model_->metre *
                                               snapshot_.state.u.segment<3>(3 * nodes[k]);
                         if (!slopes.empty())
                             value.gradient += shares[k] * slopes[idx(nodes[k])];
                     }
                 });
    carry(model_->frame, values, carried);
    return out;
}

DeformedSamples FleshSimulation::deformed()
{
    if (!body_.octree)
        return deformed_live();
    if (!smooth_)
        smooth_ = std::make_unique<SmoothSamples>(body_);
    DeformedSamples out = rest_samples();
    const Carried carried = carried_of(out);
    carry(model_->frame,
          smooth_->values(snapshot_.state.u, motions_now(), carried.has_directions()),
          carried);
    return out;
}

std::vector<Vector3d> FleshSimulation::nodes() const
{
    const Lattice& lattice = body_.flesh->lattice();
    std::vector<Vector3d> places;
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        places.push_back(model_->to_model(
            lattice.places[n] + snapshot_.state.u.segment<3>(Eigen::Index(3 * n))));
    return places;
}

std::vector<std::array<Vector3d, 8>> FleshSimulation::drawn_cells() const
{
    // Of the cell; and of its edge.
    constexpr double kNextToNothing = 0.02, kLittle = 0.25, kSpike = 3.0;
    const std::vector<CornerNodes>& cells = body_.flesh->lattice().cells;
    const std::vector<Vector3d> places = nodes();
    std::vector<std::array<Vector3d, 8>> out;
    for (std::size_t c = 0; c < cells.size(); ++c)
    {
        std::array<Vector3d, 8> corners;
        for (std::size_t k = 0; k < 8; ++k)
            corners[k] = places[idx(cells[c][k])];
        if (body_.octree)
        {
            const Cell& cell = body_.octree->cells.cells[c];
            const double share = cell.volume / (cell.edge * cell.edge * cell.edge);
            const double edge = model_->frame.length_to_model(cell.edge);
            const bool is_spike = (corners[7] - corners[0]).norm() > kSpike * edge ||
                                  (corners[6] - corners[1]).norm() > kSpike * edge ||
                                  (corners[5] - corners[2]).norm() > kSpike * edge ||
                                  (corners[4] - corners[3]).norm() > kSpike * edge;
            if (share < kNextToNothing || (share < kLittle && is_spike))
                continue;
        }
        out.push_back(corners);
    }
    return out;
}

} // namespace cellwarp::core
