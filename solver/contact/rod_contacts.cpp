// SPDX-License-Identifier: GPL-3.0-or-later
// Balls of radius R stand along a rod, R / 2 apart, R / 4 where it bends more sharply
// than with radius 4 R, from the begin of each span at equal lengths as it is now; how
// many are in a span changes only where the length leaves a range, so that they do not
// flicker. Pairs of one rod with less than pi R between them along it are none: a curve
// of radius R or more cannot come back to itself sooner.
//
// The law. With n the direction from one to the other at the begin of the step and y the
// way between them, o = R_a + R_b - n . y is how far they overlap, and
//   f_n = max(0, k o + c do/dt),   c = 2 zeta sqrt(k m*),   m* = 1 / (G_a + G_b).
// G = b^T M^-1 b, what a force does to the place, is about 1 / (mass of a span) within a
// rod and 10 times that at its ends.
//
// Implicit: do/dt = (o - o_begin) / dt, so f_n = K max(0, o - s) with K = k + c / dt and
// s = c o_begin / (dt K): the gradient of 1/2 K max(0, o - s)^2. As n stays in the step
// it is a parabola.
//
// Friction. u = a + (I - n n^T)(y - y_begin) stretches a spring across n as stiff as K,
// which slips where it holds mu f_n: its energy is
//   1/2 K |u|^2 up to K |u| = mu f_n,   mu f_n (|u| - mu f_n / (2 K)) beyond.
// Its force f_t goes to the next step as a = -f_t / K with the K of that step, in the
// next tangent plane: what sticks does not creep, in time and in the pseudo-steps of
// statics. A new contact has a = 0. mu f_n is held while a step is solved for, and
// brought up to date with the f_n of the solve until both agree: an impact rubs by
// Coulomb's law, too.
//
// Explicit: forces of the begin, as they are all through the step; stable for
// k <= 0.1 m* / dt^2, as balls share control points. Friction min(mu f_n, m* |v_t| / dt).
#include "solver/contact/rod_contacts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <tuple>
#include <utility>

#include "solver/rods/rod_refinement.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kSpacing = 0.5, kDense = 0.25;  ///< of the radius
constexpr double kSharp = 0.25, kNotSharp = 0.2; ///< radius times curvature
/// Of modulus times radius: some ten times what full material gives way by where two rods
/// cross, so that little of them overlaps.
constexpr double kHardness = 1.0;
constexpr double kAtEnd = 10.4; ///< how much looser a free end is
/// Friction agrees with what presses, to that share; weak contacts to that of a tenth of
/// the strongest.
constexpr double kAgrees = 3e-3, kWeak = 0.1;
/// Contacts of two steps are one where their balls are so near along the rods, of the
/// radius, and their normals so near, by cosine.
constexpr double kSameBall = 0.2, kSameNormal = 0.7;
/// A ball may go this part of its radius in a step where something is near.
constexpr double kWay = 0.5;
/// Of the largest ball: how far is looked beyond the way of the step.
constexpr double kMargin = 0.1;
constexpr double kStableShare = 0.1; ///< of m* / dt^2
constexpr int kMostBalls = 4000;     ///< in a span
/// Pairs and contacts for each ball. In the densest coil a ball has some 50 contacts, one
/// for two balls; where a step is so long that all might come to all it has to be shorter
/// anyway.
constexpr std::size_t kMostPairs = 256, kMostContacts = 64;

} // namespace

void RodContacts::add_rod(const Member& rod)
{
    rods_.push_back(rod);
    counts_.emplace_back();
    is_dense_.emplace_back();
    touches_.emplace_back();
}

void RodContacts::add_obstacle(std::unique_ptr<Obstacle> obstacle)
{
    obstacles_.push_back(std::move(obstacle));
}

void RodContacts::exempt(const PlaceOnRod& a, const PlaceOnRod& b)
{
    exempt_.emplace_back(a, b);
}

const Eigen::VectorXd& RodContacts::x_of(std::size_t rod, bool of_trial) const
{
    const Member& member = rods_[rod];
    return of_trial ? member.object->state(true).x() : member.state->x();
}

Vector3d RodContacts::place(const Ball& ball, const Eigen::VectorXd& x) const
{
    Vector3d sum = Vector3d::Zero();
    for (int j = 0; j < ball.count; ++j)
        sum += ball.share[idx(j)] * x.segment<3>(ball.unknown[idx(j)]);
    return sum;
}

void RodContacts::push(const Ball& ball, const Vector3d& force,
                       Eigen::VectorXd& out) const
{
    for (int j = 0; j < ball.count; ++j)
        out.segment<3>(ball.unknown[idx(j)]) += ball.share[idx(j)] * force;
}

void RodContacts::place_balls_on(std::size_t number)
{
    const Member& member = rods_[number];
    const Rod& rod = member.model->rod();
    const RodState& state = *member.state;
    const std::span<const RodSpan> spans = rod.spans();
    std::vector<int>& counts = counts_[number];
    std::vector<char>& is_dense = is_dense_[number];
    if (counts.size() != spans.size())
    {
        counts.assign(spans.size(), 0);
        is_dense.assign(spans.size(), 0);
    }
    double along = 0.0;
    for (std::size_t e = 0; e < spans.size(); ++e)
    {
        const RodSpan& span = spans[e];
        const double h = span.end - span.begin;
        const Section section = rod.section_at(0.5 * (span.begin + span.end));
        const double radius = member.radius.value_or(section.radius);
        // Lengths up to five parameters of the span.
        constexpr int kParts = 4;
        std::array<double, kParts + 1> speed, length;
        for (int k = 0; k <= kParts; ++k)
        {
            const BasisValues values =
                rod.basis().values_in(static_cast<int>(e), span.begin + h * k / kParts);
            speed[idx(k)] = state.at(values).first.norm();
            length[idx(k)] =
                k == 0 ? 0.0
                       : length[idx(k - 1)] +
                             0.5 * (speed[idx(k)] + speed[idx(k - 1)]) * h / kParts;
        }
        const double sharpness = radius * turn_of(state, e) / span.length;
        is_dense[e] = sharpness > (is_dense[e] ? kNotSharp : kSharp);
        const double wanted =
            length[kParts] / ((is_dense[e] ? kDense : kSpacing) * radius);
        if (!(counts[e] - 1.25 <= wanted && wanted <= counts[e] + 0.25))
            counts[e] =
                static_cast<int>(std::clamp(std::ceil(wanted), 1.0, double(kMostBalls)));
        const double young = section.stretch / (kPi * section.radius * section.radius);
        const double mass = section.mass * span.length;
        const bool is_last =
            e + 1 == spans.size()
                ? !rod.basis().is_closed()
                : rod.basis().smoothness_before(static_cast<int>(e) + 1) < 0;
        const bool is_first = rod.basis().smoothness_before(static_cast<int>(e)) < 0;
        const int count = counts[e] + (is_last ? 1 : 0);
        int part = 0;
        for (int k = 0; k < count; ++k)
        {
            const double at = length[kParts] * k / counts[e];
            while (part + 1 < kParts && length[idx(part + 1)] <= at)
                ++part;
            const double rest = length[idx(part + 1)] - length[idx(part)];
            const double x =
                k == counts[e]
                    ? 1.0
                    : (part + (rest > 0.0 ? (at - length[idx(part)]) / rest : 0.0)) /
                          kParts;
            const BasisValues values =
                rod.basis().values_in(static_cast<int>(e), span.begin + x * h);
            Ball& ball = balls_.emplace_back();
            ball.rod = number;
            ball.s = span.begin + x * h;
            ball.along = along + x * span.length;
            ball.radius = radius;
            ball.stiffness = settings_.stiffness.value_or(kHardness * young * radius);
            const double to_end = std::min(is_first ? x : 1.0, is_last ? 1.0 - x : 1.0);
            ball.loose =
                (1.0 + (kAtEnd - 1.0) * std::max(0.0, 1.0 - 2.0 * to_end)) / mass;
            ball.count = values.count;
            for (int j = 0; j < values.count; ++j)
            {
                ball.unknown[idx(j)] = rod.layout().control[idx(values.control[idx(j)])];
                ball.share[idx(j)] = values.value[0][idx(j)];
            }
            centres_.push_back(place(ball, state.x()));
            radii_.push_back(radius);
            largest_radius_ = std::max(largest_radius_, radius);
        }
        along += span.length;
    }
}

double RodContacts::least_radius(const Member& of)
{
    if (of.radius)
        return *of.radius;
    double least = std::numeric_limits<double>::infinity();
    for (const RodSpan& span : of.model->rod().spans())
        least = std::min(
            least, of.model->rod().section_at(0.5 * (span.begin + span.end)).radius);
    return least;
}

void RodContacts::place_balls()
{
    balls_.clear();
    centres_.clear();
    radii_.clear();
    largest_radius_ = 0.0;
    for (std::size_t k = 0; k < rods_.size(); ++k)
        place_balls_on(k);
}

double RodContacts::largest_way(double step) const
{
    double most = 0.0;
    for (const Ball& ball : balls_)
        most = std::max(most, place(ball, *rods_[ball.rod].velocity).squaredNorm());
    return step * std::sqrt(most);
}

bool RodContacts::is_exempt(const Ball& a, const Ball& b) const
{
    const auto length = [&](const Ball& ball)
    { return rods_[ball.rod].model->rod().arc_length().total(); };
    const auto is_closed = [&](const Ball& ball)
    { return rods_[ball.rod].model->rod().basis().is_closed(); };
    const double near = kPi * std::max(a.radius, b.radius);
    if (a.rod == b.rod)
    {
        double apart = std::abs(a.along - b.along);
        if (is_closed(a))
            apart = std::min(apart, length(a) - apart);
        if (apart < near)
            return true;
    }
    const auto is_at = [&](const Ball& ball, const PlaceOnRod& place)
    {
        if (ball.rod != place.rod)
            return false;
        const Member& member = rods_[place.rod];
        const double s =
            place.slide < 0 ? place.s : member.state->sliding[idx(place.slide)].s;
        const SplineBasis& basis = member.model->rod().basis();
        double apart =
            std::abs(member.model->rod().arc_length().at(basis.wrapped(s)) - ball.along);
        if (basis.is_closed())
            apart = std::min(apart, length(ball) - apart);
        return apart < near;
    };
    return std::any_of(exempt_.begin(), exempt_.end(),
                       [&](const auto& both)
                       {
                           return (is_at(a, both.first) && is_at(b, both.second)) ||
                                  (is_at(b, both.first) && is_at(a, both.second));
                       });
}

bool RodContacts::find_contacts(double margin, Limit limit)
{
    margin_ = margin;
    contacts_.clear();
    const auto most = [&](std::size_t of_a_ball)
    { return limit == Limit::None ? BallGrid::kAll : of_a_ball * balls_.size(); };
    if (settings_.between_rods || settings_.with_itself)
    {
        const auto may_touch = [&](std::size_t i, std::size_t j)
        {
            return balls_[i].rod == balls_[j].rod ? settings_.with_itself
                                                  : settings_.between_rods;
        };
        const auto& pairs =
            grid_.pairs(centres_, radii_, margin, most(kMostPairs), may_touch);
        if (pairs.size() > most(kMostPairs))
            return false;
        for (const auto& [i, j] : pairs)
        {
            const Ball &a = balls_[i], &b = balls_[j];
            const Vector3d way = centres_[i] - centres_[j];
            const double length = way.norm();
            if (length >= a.radius + b.radius + margin || is_exempt(a, b))
                continue;
            Contact contact;
            contact.a = i;
            contact.b = static_cast<std::ptrdiff_t>(j);
            contact.normal = length > 0.0 ? Vector3d(way / length) : Vector3d::UnitY();
            contact.place.setZero();
            contact.begin = way;
            contact.reach = a.radius + b.radius;
            contact.mass = 1.0 / (a.loose + b.loose);
            contact.stiffness =
                2.0 * a.stiffness * b.stiffness / (a.stiffness + b.stiffness);
            contacts_.push_back(contact);
            if (contacts_.size() > most(kMostContacts))
                return false;
        }
    }
    std::vector<NearPlace> places;
    for (std::size_t i = 0; i < balls_.size() && !obstacles_.empty(); ++i)
    {
        places.clear();
        for (const std::unique_ptr<Obstacle>& obstacle : obstacles_)
            obstacle->near(centres_[i], balls_[i].radius + margin, places);
        for (const NearPlace& near : places)
        {
            Contact contact;
            contact.a = i;
            contact.normal = near.normal;
            contact.place = near.place;
            contact.begin = centres_[i] - near.place;
            contact.reach = balls_[i].radius;
            contact.mass = 1.0 / balls_[i].loose;
            contact.stiffness = balls_[i].stiffness;
            contacts_.push_back(contact);
        }
    }
    return true;
}

bool RodContacts::is_too_fast(double step) const
{
    const auto is_fast = [&](const Ball& ball)
    { return step * place(ball, *rods_[ball.rod].velocity).norm() > kWay * ball.radius; };
    return std::any_of(contacts_.begin(), contacts_.end(),
                       [&](const Contact& contact)
                       {
                           return is_fast(balls_[contact.a]) ||
                                  (contact.b >= 0 &&
                                   is_fast(balls_[std::size_t(contact.b)]));
                       });
}

// Implicit steps.

bool RodContacts::start(double step)
{
    grips_before_ = grips_;
    place_balls();
    // At rest, in statics, they may go a little farther than last time.
    const double way = largest_way(step),
                 look = way > 0.0
                            ? 3.0 * way
                            : std::min(3.0 * last_way_, 2.0 * kWay * largest_radius_);
    const bool are_all_found =
        find_contacts(look + kMargin * largest_radius_, Limit::OfBalls);
    if (!are_all_found)
        contacts_.clear(); // some of them would tell nothing
    for (Contact& contact : contacts_)
    {
        const double k = contact.stiffness,
                     c = 2.0 * settings_.damping * std::sqrt(k * contact.mass),
                     overlap =
                         std::max(0.0, contact.reach - contact.normal.dot(contact.begin));
        contact.whole = k + c / step;
        contact.shift = c * overlap / (step * contact.whole);
        if (settings_.friction == 0.0)
            continue;
        contact.grip = settings_.friction * k * overlap;
        if (const Grip* const last = grip_of(contact))
        {
            contact.grip = settings_.friction * last->press;
            contact.stretch =
                transported(last->normal, contact.normal, last->force) / -contact.whole;
        }
    }
    return are_all_found && !is_too_fast(step);
}

/// The contact of the step before that is this one; null: it is new.
const RodContacts::Grip* RodContacts::grip_of(const Contact& contact) const
{
    const Ball& a = balls_[contact.a];
    const double reach = kSameBall * a.radius;
    const Grip* best = nullptr;
    // Obstacles that touch a ball at one place differ by their directions.
    std::pair<double, double> nearest(reach, 0.0);
    const auto first = std::lower_bound(
        grips_before_.begin(), grips_before_.end(), std::pair(a.rod, a.along - reach),
        [](const Grip& one, const std::pair<std::size_t, double>& at)
        { return std::pair(one.a, one.along_a) < at; });
    for (auto one = first;
         one != grips_before_.end() && one->a == a.rod && one->along_a <= a.along + reach;
         ++one)
    {
        double off = std::abs(one->along_a - a.along);
        if ((one->b < 0) != (contact.b < 0) ||
            one->normal.dot(contact.normal) < kSameNormal)
            continue;
        if (contact.b >= 0)
        {
            const Ball& b = balls_[std::size_t(contact.b)];
            if (std::size_t(one->b) != b.rod)
                continue;
            off = std::max(off, std::abs(one->along_b - b.along));
        }
        if (const std::pair way(off, -one->normal.dot(contact.normal)); way < nearest)
        {
            nearest = way;
            best = &*one;
        }
    }
    return best;
}

/// f_n, with y between the places [N].
double RodContacts::press(const Contact& contact, const Vector3d& y) const
{
    return contact.whole *
           std::max(0.0, contact.reach - contact.normal.dot(y) - contact.shift);
}

/// u [m]
Vector3d RodContacts::slip(const Contact& contact, const Vector3d& y) const
{
    const Vector3d way = y - contact.begin;
    return contact.stretch + way - contact.normal.dot(way) * contact.normal;
}

ArticulableObject::Again RodContacts::again(bool is_last)
{
    if (settings_.friction == 0.0)
        return ArticulableObject::Again::No;
    std::vector<double> before;
    double strongest = 0.0;
    for (Contact& contact : contacts_)
    {
        before.push_back(contact.grip);
        contact.grip = settings_.friction * press(contact, between(contact, false));
        strongest = std::max(strongest, contact.grip);
    }
    bool agrees = true;
    for (std::size_t k = 0; k < contacts_.size(); ++k)
        agrees = agrees && std::abs(contacts_[k].grip - before[k]) <=
                               kAgrees * std::max({contacts_[k].grip, before[k],
                                                   kWeak * strongest});
    return agrees || is_last ? ArticulableObject::Again::No
                             : ArticulableObject::Again::FromHere;
}

/// \p at: where ball a is.
void RodContacts::add_acting(const Contact& contact, const Vector3d& at,
                             const Vector3d& force)
{
    const Ball& a = balls_[contact.a];
    Force one;
    one.a = a.rod;
    one.s_a = a.s;
    if (contact.b >= 0)
    {
        const Ball& b = balls_[std::size_t(contact.b)];
        one.b = static_cast<std::ptrdiff_t>(b.rod);
        one.s_b = b.s;
    }
    one.place = at - a.radius * contact.normal;
    one.force = force;
    acting_.push_back(one);
}

void RodContacts::finish()
{
    last_way_ = 0.0;
    for (std::size_t k = 0; k < balls_.size(); ++k)
        last_way_ = std::max(
            last_way_,
            (place(balls_[k], rods_[balls_[k].rod].state->x()) - centres_[k]).norm());
    grips_.clear();
    acting_.clear();
    for (const Contact& contact : contacts_)
    {
        const Vector3d y = between(contact, false), u = slip(contact, y);
        const Ball& a = balls_[contact.a];
        const Vector3d rubs =
            -std::min(contact.whole, contact.grip / std::max(u.norm(), 1e-300)) * u;
        if (const double pressed = press(contact, y); pressed > 0.0)
            add_acting(contact, place(a, rods_[a.rod].state->x()),
                       pressed * contact.normal + rubs);
        if (contact.grip == 0.0)
            continue;
        Grip grip;
        grip.a = a.rod;
        grip.along_a = a.along;
        if (contact.b >= 0)
        {
            const Ball& b = balls_[std::size_t(contact.b)];
            grip.b = static_cast<std::ptrdiff_t>(b.rod);
            grip.along_b = b.along;
        }
        grip.normal = contact.normal;
        grip.press = press(contact, y);
        grip.force = rubs;
        grips_.push_back(grip);
    }
    std::sort(grips_.begin(), grips_.end(),
              [](const Grip& p, const Grip& q)
              {
                  return std::tuple(p.a, p.along_a, p.b, p.along_b) <
                         std::tuple(q.a, q.along_a, q.b, q.along_b);
              });
}

Vector3d RodContacts::between(const Contact& contact, bool of_trial) const
{
    const Ball& a = balls_[contact.a];
    const Vector3d at = place(a, x_of(a.rod, of_trial));
    if (contact.b < 0)
        return at - contact.place;
    const Ball& b = balls_[std::size_t(contact.b)];
    return at - place(b, x_of(b.rod, of_trial));
}

double RodContacts::value(bool of_trial)
{
    double sum = 0.0;
    for (const Contact& contact : contacts_)
    {
        const Vector3d y = between(contact, of_trial);
        const double pressed = contact.reach - contact.normal.dot(y) - contact.shift;
        if (pressed > 0.0)
            sum += 0.5 * contact.whole * pressed * pressed;
        if (contact.grip == 0.0)
            continue;
        const double way = slip(contact, y).norm(), slack = contact.grip / contact.whole;
        sum += way < slack ? 0.5 * contact.whole * way * way
                           : contact.grip * (way - 0.5 * slack);
    }
    return sum;
}

double RodContacts::linearise(std::vector<Eigen::VectorXd>& gradient)
{
    double largest = 0.0;
    has_product_ = false;
    std::vector<Matrix3d> of_ball(balls_.size(), Matrix3d::Zero());
    std::vector<char> is_pressed(balls_.size(), 0);
    for (Contact& contact : contacts_)
    {
        const Vector3d y = between(contact, false);
        const double pressed = contact.reach - contact.normal.dot(y) - contact.shift;
        Vector3d pull = Vector3d::Zero(); // gradient by a
        contact.second.setZero();
        contact.is_pressed = pressed > 0.0 || contact.grip > 0.0;
        if (!contact.is_pressed)
            continue;
        const Matrix3d along = contact.normal * contact.normal.transpose();
        if (pressed > 0.0)
        {
            pull -= contact.whole * pressed * contact.normal;
            contact.second += contact.whole * along;
        }
        if (contact.grip > 0.0)
        {
            const Vector3d u = slip(contact, y);
            const double way = u.norm(), slack = contact.grip / contact.whole,
                         hold = contact.grip / std::max(way, slack);
            pull += hold * u;
            contact.second += hold * (Matrix3d::Identity() - along);
            if (way > slack)
                contact.second -= hold / (way * way) * u * u.transpose();
        }
        largest = std::max(largest, pull.norm());
        const Ball& a = balls_[contact.a];
        push(a, pull, gradient[rods_[a.rod].number]);
        of_ball[contact.a] += contact.second;
        is_pressed[contact.a] = 1;
        if (contact.b < 0)
            continue;
        has_product_ = true;
        const std::size_t other = std::size_t(contact.b);
        const Ball& b = balls_[other];
        push(b, -pull, gradient[rods_[b.rod].number]);
        of_ball[other] += contact.second;
        is_pressed[other] = 1;
    }
    for (std::vector<RodTouch>& touches : touches_)
        touches.clear();
    for (std::size_t k = 0; k < balls_.size(); ++k)
        if (is_pressed[k])
            touches_[balls_[k].rod].push_back(
                {balls_[k].count, balls_[k].unknown, balls_[k].share, of_ball[k]});
    for (std::size_t r = 0; r < rods_.size(); ++r)
        rods_[r].object->set_touches(touches_[r]);
    return largest;
}

void RodContacts::add_product(const std::vector<Eigen::VectorXd>& x,
                              std::vector<Eigen::VectorXd>& out) const
{
    for (const Contact& contact : contacts_)
    {
        if (contact.b < 0 || !contact.is_pressed)
            continue;
        const Ball &a = balls_[contact.a], &b = balls_[std::size_t(contact.b)];
        const std::size_t of_a = rods_[a.rod].number, of_b = rods_[b.rod].number;
        push(a, -contact.second * place(b, x[of_b]), out[of_a]);
        push(b, -contact.second * place(a, x[of_a]), out[of_b]);
    }
}

bool RodContacts::is_beyond()
{
    bool is_far = false;
    for (std::size_t k = 0; k < balls_.size(); ++k)
    {
        const Ball& ball = balls_[k];
        const double way = (place(ball, rods_[ball.rod].state->x()) - centres_[k]).norm();
        is_far = is_far || (way > 0.5 * margin_ && way > kMargin * ball.radius);
    }
    // What is pressed so hard that centres pass each other has gone through.
    for (const Contact& contact : contacts_)
        is_far = is_far || contact.normal.dot(between(contact, false)) < 0.0;
    if (!is_far || !contacts_.empty())
        return is_far;
    // Nothing was near. Is anything now?
    place_balls();
    return !find_contacts(0.0, Limit::OfBalls) || !contacts_.empty();
}

double RodContacts::energy() const
{
    double sum = 0.0;
    for (const Contact& contact : contacts_)
    {
        const Vector3d y = between(contact, false);
        if (const double overlap = contact.reach - contact.normal.dot(y); overlap > 0.0)
            sum += 0.5 * contact.stiffness * overlap * overlap;
        if (contact.grip > 0.0)
        {
            const double hold =
                std::min(contact.whole * slip(contact, y).norm(), contact.grip);
            sum += 0.5 * hold * hold / contact.whole;
        }
    }
    return sum;
}

// Explicit steps.

int RodContacts::parts(double step)
{
    // Mostly control points tell that nothing is fast: no place is much faster than they
    // are.
    constexpr double kHull = 1.25;
    bool is_fast = false;
    for (const Member& rod : rods_)
    {
        const RodLayout& layout = rod.model->rod().layout();
        const double most = kWay * least_radius(rod) / (kHull * step);
        for (const int first : layout.control)
            is_fast = is_fast || rod.velocity->segment<3>(first).norm() > most;
    }
    if (!is_fast)
        return 1;
    place_balls();
    const double way = largest_way(step);
    constexpr double kMost = 1e6;
    double parts = 1.0;
    if (!find_contacts(2.0 * way + kMargin * largest_radius_, Limit::OfBalls))
        parts = way / (kWay * *std::min_element(radii_.begin(), radii_.end()));
    for (const Contact& contact : contacts_)
    {
        double radius = balls_[contact.a].radius;
        if (contact.b >= 0)
            radius = std::min(radius, balls_[std::size_t(contact.b)].radius);
        parts = std::max(parts, way / (kWay * radius));
    }
    return static_cast<int>(std::ceil(std::min(parts, kMost)));
}

std::vector<Eigen::VectorXd> RodContacts::forces(double step)
{
    place_balls();
    find_contacts(kMargin * largest_radius_, Limit::None);
    std::vector<Eigen::VectorXd> out;
    acting_.clear();
    for (const Member& rod : rods_)
        out.push_back(Eigen::VectorXd::Zero(rod.state->x().size()));
    for (const Contact& contact : contacts_)
    {
        const Ball& a = balls_[contact.a];
        const Ball* const b = contact.b < 0 ? nullptr : &balls_[std::size_t(contact.b)];
        const double overlap = contact.reach - contact.normal.dot(contact.begin);
        if (overlap <= 0.0)
            continue;
        Vector3d v = place(a, *rods_[a.rod].velocity);
        if (b)
            v -= place(*b, *rods_[b->rod].velocity);
        const double k = std::min(contact.stiffness,
                                  kStableShare * contact.mass / (step * step)),
                     c = 2.0 * settings_.damping * std::sqrt(k * contact.mass),
                     along = contact.normal.dot(v);
        const double press = std::max(0.0, k * overlap - c * along);
        const Vector3d across = v - along * contact.normal;
        const double rubs =
            std::min(settings_.friction * press, contact.mass / step * across.norm());
        Vector3d force = press * contact.normal;
        if (across.norm() > 0.0)
            force -= rubs * across.normalized();
        push(a, force, out[a.rod]);
        if (press > 0.0)
            add_acting(contact, centres_[contact.a], force);
        if (b)
            push(*b, -force, out[b->rod]);
    }
    return out;
}

// What is seen.

ContactReport RodContacts::report() const
{
    ContactReport out;
    for (const Contact& contact : contacts_)
    {
        const Vector3d y = between(contact, false);
        // Balls are round, obstacles are taken as they are at the begin.
        const double distance = contact.b < 0 ? contact.normal.dot(y) : y.norm();
        out.count += distance < contact.reach;
        out.least = std::min(out.least.value_or(distance / contact.reach),
                             distance / contact.reach);
    }
    return out;
}

std::vector<double> RodContacts::touched(std::size_t rod) const
{
    std::vector<double> out;
    for (const Contact& contact : contacts_)
    {
        if (contact.reach <= contact.normal.dot(between(contact, false)))
            continue;
        if (balls_[contact.a].rod == rod)
            out.push_back(balls_[contact.a].s);
        if (contact.b >= 0 && balls_[std::size_t(contact.b)].rod == rod)
            out.push_back(balls_[std::size_t(contact.b)].s);
    }
    std::sort(out.begin(), out.end());
    return out;
}

} // namespace cellwarp::core
