// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/rod_part.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "io/base/error.h"
#include "library/session/line_curve.h"
#include "library/time/drawn_shapes.h"
#include "library/time/key_motion.h"
#include "library/time/skin.h"
#include "octree/base/index.h"
#include "solver/rods/elasticity.h"
#include "solver/rods/rod_response.h"
#include "solver/rods/springs.h"
#include "solver/rods/tensor_stretch.h"

namespace cellwarp::core
{

namespace
{

/// Both sides of a tube, so that its twist is seen.
constexpr Colour kFront = {236, 145, 60}, kBack = {205, 208, 214},
                 kSkin = {222, 142, 126};

/// Neighbours at the same place are one point.
std::vector<Eigen::Vector3d> merged(std::vector<Eigen::Vector3d> points, bool is_closed)
{
    points.erase(std::unique(points.begin(), points.end()), points.end());
    if (is_closed && points.size() > 1 && points.front() == points.back())
        points.pop_back();
    return points;
}

/// Its points seen from \p origin; neighbours at the same place are one, but for Bezier
/// pieces, which count them.
std::vector<Eigen::Vector3d> points_of(const SplineLine& line,
                                       const Eigen::Vector3d& origin)
{
    std::vector<Eigen::Vector3d> points;
    for (const Eigen::Vector3d& point : line.points)
        points.push_back(point - origin);
    const bool is_through = line.form == SplineLine::Form::Through;
    return !is_through && line.knots == "bezier"
               ? points
               : merged(std::move(points), line.is_closed && is_through);
}

Section section_of(const RodStatement& rod, double share)
{
    const std::vector<double>& radii = rod.line.radii;
    const double at = share * static_cast<double>(radii.size() - 1);
    const std::size_t k = std::min(idx(static_cast<int>(at)),
                                   radii.size() - std::min<std::size_t>(2, radii.size()));
    const double next = k + 1 < radii.size() ? radii[k + 1] : radii[k];
    const double radius = radii[k] + (at - static_cast<double>(k)) * (next - radii[k]);
    Section section = Section::round(radius, rod.young, rod.poisson, rod.density);
    if (rod.bending)
        section.bending = *rod.bending;
    if (rod.twisting)
        section.twist = *rod.twisting;
    return section;
}

Rod built(const RodScene& scene, const RodStatement& of, const std::string& where,
          const Eigen::Vector3d& origin)
{
    if (of.elasticity == "discrete" &&
        (of.line.degree != 3 || of.line.knots == "bezier" ||
         of.line.knots == "catmull-rom"))
        throw malformed({scene.path, 0, where + ".elasticity"},
                        "springs need a cubic spline, uniform or nonuniform");
    try
    {
        return {curve_of(of.line, points_of(of.line, origin)),
                [&of](double share) { return section_of(of, share); },
                {of.is_straight_at_rest ? RodRest::Straight : RodRest::Given,
                 of.rest_twist, of.link, of.elasticity == "discrete" ? 2 : 1,
                 of.normal ? std::optional(vector_of(*of.normal)) : std::nullopt}};
    }
    catch (const std::invalid_argument& error)
    {
        throw malformed({scene.path, 0, where}, error.what());
    }
}

/// Whether weight and loads cancel.
bool is_balanced(const RodModel& model)
{
    Eigen::Vector3d sum = model.mass().total() * model.gravity;
    double largest = sum.norm();
    for (const RodLoad& load : model.loads)
    {
        sum += load.force;
        largest = std::max(largest, load.force.norm());
    }
    return sum.norm() <= 1e-12 * largest;
}

} // namespace

RodPart::RodPart(const RodScene& scene, std::size_t index, const Eigen::Vector3d& origin)
    : rod(built(scene, scene.rods[index], "rods[" + std::to_string(index) + "]", origin)),
      model(rod), state(rod), velocity(Eigen::VectorXd::Zero(rod.layout().num_unknowns)),
      statement_(scene.rods[index]), path_(scene.path),
      where_("rods[" + std::to_string(index) + "]"), origin_(origin), index_(index)
{
    warn_of_curve();
    const bool is_exact = statement_.elasticity == "exact",
               is_discrete = statement_.elasticity == "discrete";
    model.terms.push_back(
        exact_elasticity(rod, {.has_stretch = is_exact,
                               .has_bending = !(is_discrete && springs_bend(rod))}));
    if (is_discrete)
        model.terms.push_back(spring_elasticity(rod));
    else if (!is_exact)
        model.terms.push_back(tensor_stretch(rod));
    model.damping = statement_.damping;
    // Springs and tensors store what the exact strains lose.
    if (!is_exact && model.damping > 0.0)
        model.terms.push_back(
            exact_elasticity(rod, {.has_bending = is_discrete && springs_bend(rod),
                                   .has_twist = false,
                                   .has_energy = false}));
    model.gravity = vector_of(scene.gravity);
    model.viscosity = scene.viscosity / rod.section(0.5).mass;
    for (int k = 0; k < rod.num_controls(); ++k)
        velocity.segment<3>(rod.layout().control[idx(k)]) =
            vector_of(statement_.velocity);
    add_holds();
    add_on();
    for (const RodPull& load : statement_.loads)
        model.loads.push_back(
            {parameter(load.at), vector_of(load.force), vector_of(load.moment)});
    add_springs();
    hold_at(0.0, 1.0);
    open_holds(scene.is_static() ? scene.duration : 0.0, 0.0);
    if (scene.is_static())
        set_loads(scene.duration);
    is_cut_.assign(statement_.cuts.size(), 0);
    if (const auto& refine = statement_.refine)
        refinement_.emplace(RefinementSettings{refine->insert, refine->remove,
                                               refine->tolerance, 10, refine->shortest});
}

/// Warns of kinks and of merged points.
void RodPart::warn_of_curve()
{
    const SplineBasis& basis = rod.basis();
    for (int e = 0; e < static_cast<int>(basis.spans().size()); ++e)
        if (basis.smoothness_before(e) == 0)
        {
            const Eigen::Vector3d place =
                origin_ + rod.rest().at(e, basis.spans()[idx(e)].begin).place;
            warnings.push_back(
                at({path_, 0, where_ + ".points"},
                   fmt::format("a kink at ({:.6g}, {:.6g}, {:.6g}) is a hinge without "
                               "stiffness: handles in line would make it smooth",
                               place.x(), place.y(), place.z())));
        }
    const SplineLine& line = statement_.line;
    const bool is_through = line.form == SplineLine::Form::Through;
    const std::size_t given = line.points.size(), left = points_of(line, origin_).size();
    const bool closes = line.is_closed && is_through && given > 1 &&
                        line.points.front() == line.points.back();
    if (line.knots != "bezier" && left + (closes ? 1 : 0) < given)
        warnings.push_back(at(
            {path_, 0, where_ + (is_through ? ".through" : ".points")},
            fmt::format("neighbours at the same place are one point: {} of {} are left",
                        left, given)));
}

void RodPart::add_holds()
{
    for (std::size_t k = 0; k < statement_.holds.size(); ++k)
    {
        const RodHold& hold = statement_.holds[k];
        const double s = parameter(hold.at);
        const CurvePoint at = state.at(s);
        held_.push_back({&hold.keys, &hold, model.constraints.size(), 0, at.place,
                         state.frame(s), at.second, bend_at(s),
                         where_ + ".fixed[" + std::to_string(k) + "]"});
        const auto add = [&](HoldKind kind)
        {
            RodConstraint constraint;
            constraint.hold = kind;
            constraint.s = s;
            if (kind == HoldKind::Spin)
            {
                constraint.direction = held_.back().frame.col(0);
                constraint.tangent = held_.back().frame.col(2);
            }
            model.constraints.push_back(constraint);
            ++held_.back().count;
        };
        if (hold.has_point)
            add(HoldKind::Point);
        if (hold.has_tangent)
            add(HoldKind::Tangent);
        if (hold.has_twist)
            add(has_tangent(hold.at) ? HoldKind::TwistAngle : HoldKind::Spin);
        if (hold.has_curvature)
            add(HoldKind::CurvatureVector);
        if (hold.has_bend)
            add(HoldKind::GeometricCurvature);
    }
}

/// The curvature vector of the curve at a parameter, in lengths at rest [1/m].
Eigen::Vector3d RodPart::bend_at(double s) const
{
    const CurvePoint at = state.at(s);
    return at.first.cross(at.second) /
           (at.first.squaredNorm() * rod.rest().at(s).first.norm());
}

/// Some hold has the tangent there.
bool RodPart::has_tangent(double at) const
{
    return std::any_of(statement_.holds.begin(), statement_.holds.end(),
                       [&](const RodHold& hold)
                       { return hold.has_tangent && hold.at == at; });
}

void RodPart::add_on()
{
    for (std::size_t k = 0; k < statement_.on.size(); ++k)
    {
        const RodOn& on = statement_.on[k];
        if (on.kind == RodOn::Kind::Rod)
            continue;
        Eigen::Vector3d point = vector_of(on.point) - origin_,
                        direction = vector_of(on.direction);
        if (on.kind == RodOn::Kind::Plane)
            point = direction * (on.offset / direction.squaredNorm()) - origin_;
        if (on.kind != RodOn::Kind::Point)
            direction.normalize();
        RodConstraint constraint;
        constraint.s = parameter(on.at);
        constraint.point = point;
        constraint.hold = on.kind == RodOn::Kind::Point   ? HoldKind::Point
                          : on.kind == RodOn::Kind::Plane ? HoldKind::Plane
                                                          : HoldKind::Axis;
        if (on.kind != RodOn::Kind::Point)
            constraint.direction = direction;
        if (on.slide)
        {
            Eigen::Matrix3d held = Eigen::Matrix3d::Zero();
            for (const Eigen::Vector3d& n : held_directions(constraint))
                held += n * n.transpose();
            constraint.slide = add_slide(*on.slide, held, point,
                                         where_ + ".on[" + std::to_string(k) + "]");
        }
        Eigen::Matrix3d frame = Eigen::Matrix3d::Identity();
        frame.col(2) = constraint.direction;
        held_.push_back({&on.keys, nullptr, model.constraints.size(), 1, point, frame,
                         Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                         where_ + ".on[" + std::to_string(k) + "]"});
        model.constraints.push_back(constraint);
    }
}

int RodPart::add_slide(const SlideStatement& of, const Eigen::Matrix3d& held,
                       const Eigen::Vector3d& point, const std::string& where)
{
    RodSlide slide;
    // A range of a closed rod may lead over its seam.
    const double period = rod.basis().end() - rod.basis().begin();
    const auto unwrapped = [&](double share)
    { return share > 1.0 ? parameter(share - 1.0) + period : parameter(share); };
    slide.begin = unwrapped(of.range[0]);
    slide.end = unwrapped(of.range[1]);
    slide.is_endless =
        rod.basis().is_closed() && of.range[0] == 0.0 && of.range[1] == 1.0;
    slide.leaves = of.leaves;
    slide.sticks = of.friction[0];
    slide.slips = of.friction[1];
    const double start =
        of.start ? unwrapped(*of.start) : nearest_parameter(slide, state, point, held);
    const BasisValues values = sliding_values(rod.basis(), start);
    constexpr double kFar = 0.25, kNear = 0.01; // of the length
    const double off = (held * (state.at(values).place - point)).norm(),
                 length = rod.arc_length().total();
    if (off > kFar * length)
        throw malformed({path_, 0, where},
                        fmt::format("its place on the rod is {:.3g} m away from what it "
                                    "slides on at the start",
                                    off));
    if (off > kNear * length)
        warnings.push_back(at({path_, 0, where},
                              fmt::format("starts {:.3g} m away from what it slides on, "
                                          "the first step pulls it there",
                                          off)));
    const double speed = state.at(values).first.norm();
    slide.inertia = of.inertia * speed * speed;
    const int number = static_cast<int>(model.slides.size());
    if (of.inertia < 0.0)
    {
        // The mass that the rod shows to a force at that place.
        Eigen::VectorXd pull = Eigen::VectorXd::Zero(rod.layout().num_unknowns);
        for (int j = 0; j < values.count; ++j)
            pull[rod.layout().control[idx(values.control[idx(j)])]] =
                values.value[0][idx(j)];
        const double least = -1.0 / pull.dot(model.mass().solved(pull));
        if (of.inertia <= least)
            throw malformed({path_, 0, where + ".inertia"},
                            fmt::format("got {} kg, need more than {:.4g} kg: the rod "
                                        "would run away from rest",
                                        of.inertia, least));
    }
    model.slides.push_back(slide);
    state.sliding.push_back(begun(slide, start));
    if (of.apart)
    {
        if (last_apart_)
            model.gaps.push_back({last_apart_->first, number,
                                  std::max(last_apart_->second, *of.apart), false});
        else
            first_apart_ = number;
        last_apart_ = {number, *of.apart};
        state.touches.assign(model.gaps.size(), 0);
        for (const RodGap& gap : model.gaps)
            if (model.room(state, gap) < -1e-9 * rod.arc_length().total())
                throw malformed({path_, 0, where + ".apart"},
                                "it starts too near to the one before it, or behind it");
    }
    return number;
}

void RodPart::keep_last_two_apart(double share)
{
    int first = static_cast<int>(model.slides.size()) - 2, second = first + 1;
    if (state.sliding[idx(first)].s > state.sliding[idx(second)].s)
        std::swap(first, second);
    const double least = share * rod.arc_length().total();
    model.gaps.push_back({first, second, least, false});
    if (rod.basis().is_closed())
        model.gaps.push_back({second, first, least, true});
}

void RodPart::close_gaps()
{
    if (rod.basis().is_closed() && last_apart_ && last_apart_->first != first_apart_)
        model.gaps.push_back(
            {last_apart_->first, first_apart_, last_apart_->second, true});
    state.touches.assign(model.gaps.size(), 0);
}

void RodPart::add_springs()
{
    std::vector<PointSpring> springs;
    for (const RodSpringTo& spring : statement_.springs)
    {
        PointSpring to{parameter(spring.at), vector_of(spring.point) - origin_,
                       spring.stiffness, 0.0};
        to.length = spring.length.value_or((state.at(to.s).place - to.point).norm());
        SpringAt& at = springs_at_.emplace_back();
        if (spring.stiffness > 0.0)
        {
            at.spring = static_cast<int>(springs.size());
            springs.push_back(to);
        }
        if (spring.damping > 0.0)
        {
            at.drag = static_cast<int>(model.drags.size());
            model.drags.push_back({to.s, spring.damping});
        }
    }
    if (springs.empty())
        return;
    std::unique_ptr<PointSprings> term = point_springs(rod, std::move(springs));
    springs_ = term.get();
    model.terms.push_back(std::move(term));
}

bool RodPart::has_equilibrium() const
{
    return !model.is_free() || springs_ || is_balanced(model);
}

std::vector<double> RodPart::sliding(const Piece& piece) const
{
    std::vector<double> out;
    const SplineBasis& basis = rod.basis();
    for (const Sliding& sliding : state.sliding)
    {
        const double s = basis.wrapped(sliding.s);
        const std::size_t span = idx(basis.span_of(s));
        if (std::find(piece.spans.begin(), piece.spans.end(), span) != piece.spans.end())
            out.push_back(rod.arc_length().at(s) / rod.arc_length().total());
    }
    return out;
}

double RodPart::length(const Piece& piece) const
{
    const ArcLength now(state.curve());
    double sum = 0.0;
    for (const std::size_t e : piece.spans)
        sum += now.length_of(e);
    return sum;
}

void RodPart::hold_at(double time, double share)
{
    model.stop_leading();
    set_loads(time);
    for (Held& held : held_)
    {
        const Motion motion = motion_of(held, time, share);
        spin(held, motion.R);
        bring(held, motion(held.place), motion.R, Eigen::Vector3d::Zero(),
              Eigen::Vector3d::Zero());
    }
}

void RodPart::lead(const KeyTime& from, const KeyTime& to, double /*duration*/)
{
    struct Way
    {
        const Held* held;
        Motion begin;
        Eigen::Vector3d place, way, turn; ///< axis times angle [rad]
        double from_spin = 0.0, spin = 0.0;
    };
    std::vector<Way> ways;
    open_holds(0.5 * (from.time + to.time), from.time);
    for (Held& held : held_)
    {
        if (held.keys->empty())
            continue;
        const Motion begin = motion_of(held, from.time, from.share),
                     end = motion_of(held, to.time, to.share);
        const Eigen::Vector3d place = begin(held.place);
        ways.push_back({&held, begin, place, end(held.place) - place,
                        rotation_vector(end.R * begin.R.transpose())});
        spin(held, begin.R);
        if (const RodConstraint* const one = spin_of(held))
        {
            ways.back().from_spin = one->spin;
            ways.back().spin = ways.back().turn.dot(state.at(one->s).first.normalized());
        }
        held.R = end.R;
    }
    const bool changes_loads = this->changes_loads();
    if (ways.empty() && !changes_loads)
        return;
    const double duration = to.time - from.time;
    model.lead(
        [this, ways = std::move(ways), duration](double share)
        {
            for (const Way& one : ways)
            {
                const double angle = one.turn.norm();
                const Eigen::Matrix3d R =
                    angle > 0.0 ? Eigen::Matrix3d(
                                      rotation_about(one.turn / angle, share * angle) *
                                      one.begin.R)
                                : one.begin.R;
                bring(*one.held, one.place + share * one.way, R, one.way / duration,
                      one.turn / duration);
                if (RodConstraint* const at = spin_of(*one.held))
                {
                    at->spin = one.from_spin + share * one.spin;
                    at->spin_speed = one.spin / duration;
                }
            }
        },
        duration,
        changes_loads ? [this, duration, begin = from.time](double share)
            { set_loads(begin + share * duration); }
                      : std::function<void(double)>());
}

bool RodPart::changes_loads() const
{
    const auto changes = [](const SizeInTime& one)
    { return one.from > 0.0 || one.until || !one.keys.empty(); };
    return std::any_of(statement_.loads.begin(), statement_.loads.end(), changes) ||
           std::any_of(statement_.springs.begin(), statement_.springs.end(), changes);
}

void RodPart::set_loads(double time)
{
    for (std::size_t k = 0; k < statement_.loads.size(); ++k)
    {
        const RodPull& load = statement_.loads[k];
        const double size = size_at(load, time);
        model.loads[k].force = size * vector_of(load.force);
        model.loads[k].moment = size * vector_of(load.moment);
    }
    for (std::size_t k = 0; k < statement_.springs.size(); ++k)
    {
        const double size = size_at(statement_.springs[k], time);
        if (springs_at_[k].spring >= 0)
            springs_->set_size(idx(springs_at_[k].spring), size);
        if (springs_at_[k].drag >= 0)
            model.drags[idx(springs_at_[k].drag)].damping =
                size * statement_.springs[k].damping;
    }
}

/// The motion of a hold by its keys, from where it began.
Motion RodPart::motion_of(const Held& held, double time, double share) const
{
    const Motion motion = motion_at(*held.keys, time, held.place, share);
    const Eigen::Matrix3d R = motion.R * held.opened.R.transpose();
    const Eigen::Vector3d way = motion(held.place) - held.opened(held.place);
    return {R, held.place + way - R * held.place};
}

/// Lets holds begin that act at a time, with the rod as it is at \p begin [s], and ends
/// those that do not act.
void RodPart::open_holds(double time, double begin)
{
    for (Held& held : held_)
    {
        const bool is_off = held.window && !held.window->is_open(time);
        if (is_off == model.constraints[held.first].is_off)
            continue;
        for (std::size_t k = held.first; k < held.first + held.count; ++k)
            model.constraints[k].is_off = is_off;
        if (is_off)
            continue;
        const double s = model.constraints[held.first].s;
        const CurvePoint at = state.at(s);
        held.place = at.place;
        held.second = at.second;
        held.bend = bend_at(s);
        held.frame = state.frame(s);
        held.opened = motion_at(*held.keys, begin, held.place, 1.0);
        held.R.setIdentity();
        if (RodConstraint* const one = spin_of(held))
        {
            one->direction = held.frame.col(0);
            one->tangent = held.frame.col(2);
            one->spin = 0.0;
        }
        bring(held, held.place, Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero(),
              Eigen::Vector3d::Zero());
    }
}

RodConstraint* RodPart::spin_of(const Held& held)
{
    for (std::size_t k = held.first; k < held.first + held.count; ++k)
        if (model.constraints[k].hold == HoldKind::Spin)
            return &model.constraints[k];
    return nullptr;
}

/// Keys have turned a hold to \p R: where the tangent is free the material spins by the
/// part of that about it.
void RodPart::spin(Held& held, const Eigen::Matrix3d& R)
{
    if (RodConstraint* const one = spin_of(held))
        one->spin += rotation_vector(R * held.R.transpose())
                         .dot(state.at(one->s).first.normalized());
    held.R = R;
}

/// Sets the constraints of a hold to a place [m] and a turn from rest, and how they move
/// [m/s], [rad/s].
void RodPart::bring(const Held& held, const Eigen::Vector3d& place,
                    const Eigen::Matrix3d& R, const Eigen::Vector3d& speed,
                    const Eigen::Vector3d& turning)
{
    for (std::size_t k = held.first; k < held.first + held.count; ++k)
    {
        RodConstraint& constraint = model.constraints[k];
        constraint.point = place;
        constraint.point_speed = speed;
        constraint.turning = turning;
        switch (constraint.hold)
        {
        case HoldKind::Tangent:
        case HoldKind::Plane:
        case HoldKind::Axis:
            constraint.direction = R * held.frame.col(2);
            break;
        case HoldKind::TwistAngle:
            constraint.direction = R * held.frame.col(0);
            break;
        case HoldKind::CurvatureVector:
            constraint.direction = R * held.second;
            break;
        case HoldKind::GeometricCurvature:
            constraint.direction = R * held.bend;
            break;
        default:
            break;
        }
    }
}

double RodPart::turned(double begin, double end) const
{
    double largest = 0.0;
    for (const Held& held : held_)
        largest = std::max(largest, cellwarp::core::turned(*held.keys, begin, end));
    return largest;
}

double RodPart::first_turn() const
{
    double largest = 0.0;
    for (const Held& held : held_)
        if (!held.keys->empty())
            largest = std::max(largest, std::abs(held.keys->front().move.degrees));
    return largest;
}

double RodPart::largest_turn() const
{
    double largest = 0.0;
    for (const Held& held : held_)
        for (const MoveKey& key : *held.keys)
            largest = std::max(largest, std::abs(key.move.degrees));
    return largest;
}

bool RodPart::change(double time, std::span<const double> touched)
{
    const MovingRod all{rod, model, state, velocity};
    bool has_changed = false;
    for (std::size_t k = 0; k < statement_.cuts.size(); ++k)
    {
        const CutStatement& one = statement_.cuts[k];
        std::optional<double> place;
        if (!one.at)
            place = breaking_place(state, {one.curvature, one.force});
        else if (!is_cut_[k] && time >= one.time)
        {
            place = parameter(*one.at);
            is_cut_[k] = 1;
        }
        if (!place)
            continue;
        cut(all, *place);
        has_changed = true;
    }
    if (!refinement_)
        return has_changed;
    std::vector<double> used = joined_;
    for (const RodConstraint& constraint : model.constraints)
        if (constraint.slide < 0)
            used.push_back(constraint.s);
    for (const Sliding& sliding : state.sliding)
        used.push_back(rod.basis().wrapped(sliding.s));
    used.insert(used.end(), touched.begin(), touched.end());
    std::sort(used.begin(), used.end());
    return refinement_->refine(all, used) > 0 || has_changed;
}

std::vector<RodPart::Piece> RodPart::pieces() const
{
    const std::vector<std::array<double, 2>> parts = rod.pieces();
    const SplineBasis& basis = rod.basis();
    std::vector<Piece> out;
    for (const auto& [begin, end] : parts)
    {
        Piece& piece = out.emplace_back();
        piece.name =
            parts.size() == 1 ? name() : fmt::format("{}.{}", name(), out.size());
        piece.begin = begin;
        piece.end = end;
        piece.is_closed = basis.is_closed() && parts.size() == 1 &&
                          basis.smoothness_before(basis.span_of(begin)) >= 0;
        const std::size_t first = idx(basis.span_of(begin)), count = rod.spans().size();
        for (std::size_t k = 0; k < count; ++k)
        {
            const std::size_t e = (first + k) % count;
            if (k > 0 && basis.smoothness_before(static_cast<int>(e)) < 0)
                break;
            piece.spans.push_back(e);
        }
    }
    return out;
}

std::vector<std::pair<std::size_t, double>> RodPart::along(const Piece& piece,
                                                           int places) const
{
    double length = 0.0;
    for (const std::size_t e : piece.spans)
        length += rod.spans()[e].length;
    const double first = rod.arc_length().at(piece.begin),
                 total = rod.arc_length().total();
    std::vector<std::pair<std::size_t, double>> out;
    for (int k = 0; k < places; ++k)
    {
        const double at = first + length * k / (places - 1);
        const double s = parameter((at > total ? at - total : at) / total);
        // The last one is on this side of a cut.
        const std::size_t last = piece.spans.back();
        if (k + 1 == places && !piece.is_closed)
            out.emplace_back(last, rod.spans()[last].end);
        else
            out.emplace_back(idx(rod.basis().span_of(s)), rod.basis().wrapped(s));
    }
    return out;
}

std::vector<Eigen::Vector3d> RodPart::curve(const Piece& piece, int places) const
{
    std::vector<Eigen::Vector3d> out;
    for (const auto& [span, s] : along(piece, places))
        out.push_back(origin_ +
                      state.at(rod.basis().values_in(static_cast<int>(span), s)).place);
    return out;
}

std::vector<std::pair<SectionForces, Eigen::Matrix3d>>
RodPart::sections(const Piece& piece, int places) const
{
    const InnerForces forces(state);
    std::vector<std::pair<SectionForces, Eigen::Matrix3d>> out;
    for (const auto& [span, s] : along(piece, places))
        out.emplace_back(forces.in(span, s), state.frame_in(span, s));
    return out;
}

std::vector<RodPart::HeldForce>
RodPart::reactions(const Eigen::VectorXd& multipliers) const
{
    std::vector<HeldForce> out;
    if (multipliers.size() == 0)
        return out;
    const std::vector<Wrench> wrenches = model.reactions(state, multipliers);
    for (const Held& held : held_)
    {
        const RodConstraint& first = model.constraints[held.first];
        if (first.is_off)
            continue;
        const double s = first.slide < 0 ? first.s : state.sliding[idx(first.slide)].s;
        HeldForce& one = out.emplace_back();
        one.key = held.key;
        one.at = origin_ + state.at(sliding_values(rod.basis(), s)).place;
        for (std::size_t k = held.first; k < held.first + held.count; ++k)
        {
            one.wrench.force += wrenches[k].force;
            one.wrench.couple += wrenches[k].couple;
        }
    }
    return out;
}

void RodPart::add_skin(Geometry& out) const
{
    for (const Piece& piece : pieces())
    {
        // Balls half a radius apart, the thinnest part's.
        const std::vector<double>& radii = statement_.line.radii;
        const double radius = *std::min_element(radii.begin(), radii.end());
        const double length = this->length(piece);
        const int count = static_cast<int>(std::ceil(length / (0.5 * radius)));
        std::vector<Eigen::Vector3d> along = curve(piece, 8 * count + 1), centres;
        double way = 0.0, next = 0.0;
        const double step = length / count;
        for (std::size_t k = 0; k < along.size(); ++k)
        {
            if (k > 0)
                way += (along[k] - along[k - 1]).norm();
            if (way >= next - 1e-9 * length)
            {
                centres.push_back(along[k]);
                next += step;
            }
        }
        const std::size_t group = out.groups.size();
        cellwarp::core::add_skin(centres, radius, kSkin, out);
        out.groups[group].name = piece.name;
    }
}

RodObject& RodPart::articulable()
{
    if (!object_)
    {
        object_.emplace(model);
        object_->bind(state, velocity);
    }
    return *object_;
}

Eigen::Vector3d RodPart::place_of(const JointEnd& end, const std::string&) const
{
    return state.at(parameter(end.at)).place;
}

int RodPart::add_place(const JointEnd& end, const SlideStatement& slide,
                       const std::string& where, const Eigen::Vector3d& other)
{
    last_end_ = {index_};
    if (end.slides)
    {
        last_end_.slide = add_slide(slide, Eigen::Matrix3d::Identity(), other, where);
        return articulable().add_sliding_place(last_end_.slide);
    }
    last_end_.s = parameter(end.at);
    joined_.push_back(last_end_.s);
    return articulable().add_place(last_end_.s);
}

void RodPart::add_to(SimulationReport& report) const
{
    report.kinetic += model.mass().kinetic_energy(velocity);
    report.elastic += model.elastic_energy(state);
    report.gravity += model.gravity_energy(state);
    add_from_origin(model.mass().total(), model.mass().momentum(velocity),
                    model.mass().angular_momentum(state, velocity), origin_,
                    model.gravity, report);
}

void RodPart::add_to(int places, SimulatedObjects& out) const
{
    for (const Piece& piece : pieces())
        out.rods.push_back({piece.name, length(piece), curve(piece, places),
                            static_cast<int>(piece.spans.size()) + 1, sliding(piece)});
}

void RodPart::add_to(Eigen::AlignedBox3d& box) const
{
    for (const Eigen::Vector3d& control : rod.rest().controls)
        box.extend(origin_ + control);
}

void RodPart::add_surface(int around, Geometry& out) const
{
    if (statement_.has_skin)
        add_skin(out);
    else
        add_tube(around, out);
}

void RodPart::add_tube(int around, Geometry& out) const
{
    constexpr int kRings = 4; // a span
    std::vector<Colour> colours;
    for (int k = 0; k < around; ++k)
        colours.push_back(std::cos(2.0 * std::numbers::pi * k / around) > 0.0 ? kFront
                                                                              : kBack);
    for (const Piece& piece : pieces())
    {
        out.groups.push_back({piece.name, out.num_faces(), 0});
        std::vector<std::vector<Eigen::Vector3d>> rings;
        const auto add_ring = [&](std::size_t span, double s)
        {
            const Eigen::Matrix3d F = state.frame_in(span, s);
            const double radius = rod.section_at(s).radius;
            const BasisValues values = rod.basis().values_in(static_cast<int>(span), s);
            rings.push_back(ring(origin_ + state.at(values).place, radius * F.col(0),
                                 radius * F.col(1), around));
        };
        for (const std::size_t e : piece.spans)
        {
            const RodSpan& span = rod.spans()[e];
            for (int k = 0; k < kRings; ++k)
                add_ring(e, span.begin + (span.end - span.begin) * k / kRings);
        }
        if (!piece.is_closed)
            add_ring(piece.spans.back(), rod.spans()[piece.spans.back()].end);
        add_rings(rings, colours, piece.is_closed, out);
        out.groups.back().end_face = out.num_faces();
    }
}

} // namespace cellwarp::core
