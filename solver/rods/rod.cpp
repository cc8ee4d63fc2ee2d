// SPDX-License-Identifier: GPL-3.0-or-later
// Frames. Every station e keeps a unit vector a_e across its tangent t_e; the material
// stands at the angle theta_e from it. To compare neighbours a vector is taken along the
// curve by the shortest turn from tangent to tangent, H(t_a -> t_b). In a span with
// places 0 (station), 1 ... G (inside), G + 1 (station) it is taken twice: along the
// chain of all places, and at once from end to end. The angle about the tangent from what
// arrives to the far station's own vector is m^c and m^d. Both differ from the true turn
// by terms that grow with the cubes of the steps, in shares c_k of the whole span, so
// that
//   m = (m^c - c_0 m^d) / (1 - c_0),   c_0 = sum c_k^3
// is better by two orders. The span's twist is Delta = theta_far - theta_near + m.
//
// A vector that is taken from the old tangent to the new one as the rod moves does not
// spin; so a turn of a_e about t_e is exactly a shift of theta_e, and nothing drifts.
// [Bergou08]
#include "solver/rods/rod.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include <Eigen/Geometry>

namespace cellwarp::core
{

namespace
{

constexpr double kPi = std::numbers::pi;

/// The angle of the turns that \p value may mean which is nearest to \p near.
double nearest_turn(double value, double near)
{
    return value + 2.0 * kPi * std::round((near - value) / (2.0 * kPi));
}

/// The angle about \p axis from \p a to \p b, both across it.
double angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                     const Eigen::Vector3d& axis)
{
    return std::atan2(axis.cross(a).dot(b), a.dot(b));
}

/// The same for unit vectors that are mostly near each other: by the series of the arc
/// sine where rounding lets it.
double small_angle_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                           const Eigen::Vector3d& axis)
{
    const double sine = axis.cross(a).dot(b), square = sine * sine;
    if (square > 4e-4 || a.dot(b) < 0.0)
        return std::atan2(sine, a.dot(b));
    return sine *
           (1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * 15.0 / 336.0)));
}

} // namespace

Section Section::round(double radius, double young, double poisson, double density)
{
    const double area = kPi * radius * radius, inertia = 0.25 * area * radius * radius;
    return {young * area,
            {young * inertia, young * inertia},
            young / (2.0 * (1.0 + poisson)) * 2.0 * inertia,
            density * area,
            density * 2.0 * inertia,
            radius};
}

Rod::Rod(Spline rest, const std::function<Section(double)>& section,
         const RodSettings& settings)
    : rest_(std::move(rest)), arc_length_(rest_), section_(section), settings_(settings),
      seam_turn_(2.0 * kPi * settings.link)
{
    if (!(arc_length_.total() > 0.0))
        throw std::invalid_argument("a rod without length");
    if (const std::optional<Eigen::Vector3d>& normal = settings.normal)
    {
        constexpr double kAlong = 1e-6; // sine of the least angle
        const Eigen::Vector3d t = rest_.at(basis().begin()).first.normalized();
        if (!(t.cross(*normal).norm() > kAlong * normal->norm()))
            throw std::invalid_argument("the normal is along the begin of the rod");
    }
    order_ = basis().degree() + 1;
    num_bending_ = std::max(basis().degree() - 1, 1);
    for (int p = 1; p < num_places(); ++p)
        cubes_of_steps_ += std::pow(place(p) - place(p - 1), 3);
    find_spans();
    const double still = 1e-12 * arc_length_.total() / (basis().end() - basis().begin());
    // Between the places that are looked at it may stand still or turn back, too.
    Eigen::Vector3d before = Eigen::Vector3d::Zero();
    for (std::size_t e = 0; e < spans_.size(); ++e)
    {
        constexpr int kParts = 16;
        constexpr double kBack = -1.0 + 1e-9; // cosine
        if (basis().smoothness_before(static_cast<int>(e)) < 1)
            before.setZero();
        for (int k = 0; k <= kParts; ++k)
        {
            const RodSpan& span = spans_[e];
            const Eigen::Vector3d u =
                rest_
                    .at(static_cast<int>(e),
                        span.begin + (span.end - span.begin) * k / kParts)
                    .first;
            if (!(u.norm() > still))
                throw std::invalid_argument(
                    "a rod that stands still at a place of its curve");
            if (before.dot(u.normalized()) < kBack)
                throw std::invalid_argument("a rod whose curve turns straight back");
            before = u.normalized();
        }
    }
    find_places();
    for (std::size_t e = 0; e < spans_.size(); ++e)
    {
        weights_.push_back(weighed(e));
        for (int p = 0; p < num_places(); ++p)
        {
            Eigen::Vector3d u = Eigen::Vector3d::Zero(), w = u;
            for (int j = 0; j < order_; ++j)
            {
                u += first(e, p)[j] * rest_.controls[idx(controls(e)[j])];
                w += second(e, p)[j] * rest_.controls[idx(controls(e)[j])];
            }
            if (!(u.norm() > still))
                throw std::invalid_argument(
                    "a rod that stands still at a place of its curve");
            const double curvature = u.cross(w).norm() / std::pow(u.norm(), 3);
            if (settings_.rest == RodRest::Given &&
                curvature * arc_length_.total() >= 1e-9)
                is_straight_ = false;
        }
    }
    find_layout();
}

double Weight::at(const std::array<double, 4>& values, double s) const
{
    const std::span<const double> places = gauss_places(4);
    const double x = (s - begin) / (end - begin);
    double sum = 0.0;
    for (std::size_t i = 0; i < 4; ++i)
    {
        double share = 1.0;
        for (std::size_t j = 0; j < 4; ++j)
            if (j != i)
                share *= (x - places[j]) / (places[i] - places[j]);
        sum += share * values[i];
    }
    return sum;
}

Weight Rod::weighed(std::size_t e) const
{
    Weight out{spans_[e].begin, spans_[e].end, {}, {}};
    for (std::size_t g = 0; g < 4; ++g)
    {
        const double s = out.begin + gauss_places(4)[g] * (out.end - out.begin);
        const Section section = section_at(s);
        const double sigma = rest_.at(static_cast<int>(e), s).first.norm();
        out.mass[g] = section.mass * sigma;
        out.spin[g] = section.spin * sigma;
    }
    return out;
}

void Rod::find_spans()
{
    const SplineBasis& basis = rest_.basis;
    const std::vector<SplineSpan>& spans = basis.spans();
    const int smooth = basis.degree() - 1;
    spans_.clear();
    int station = 0;
    for (std::size_t e = 0; e < spans.size(); ++e)
    {
        RodSpan span;
        span.begin = spans[e].begin;
        span.end = spans[e].end;
        const int number = static_cast<int>(e), next = number + 1;
        // A kink is a hinge: each side has a station of its own.
        if (e > 0 && basis.smoothness_before(number) < 1)
            ++station;
        span.station = {station, station + 1};
        ++station;
        const int behind = next < static_cast<int>(spans.size())
                               ? basis.smoothness_before(next)
                           : basis.is_closed() ? basis.smoothness_before(0)
                                               : -1;
        span.is_smooth = {basis.smoothness_before(number) >= smooth, behind >= smooth};
        span.length = arc_length_.length_of(e);
        spans_.push_back(span);
    }
    num_stations_ = station + 1;
    if (basis.is_closed() && basis.smoothness_before(0) >= 1)
    {
        --num_stations_;
        spans_.back().station[1] = 0;
    }
}

/// What acts in the spans.
void Rod::find_places()
{
    controls_.resize(spans_.size() * idx(order_));
    first_.resize(spans_.size() * idx(num_places() * order_));
    second_.resize(first_.size());
    for (std::size_t e = 0; e < spans_.size(); ++e)
        for (int p = 0; p < num_places(); ++p)
        {
            const RodSpan& span = spans_[e];
            const BasisValues values = basis().values_in(
                static_cast<int>(e), span.begin + place(p) * (span.end - span.begin));
            if (p == 0)
                std::copy_n(values.control.begin(), order_, &controls_[e * idx(order_)]);
            const std::size_t at = (e * idx(num_places()) + idx(p)) * idx(order_);
            std::copy_n(values.value[1].begin(), order_, &first_[at]);
            std::copy_n(values.value[2].begin(), order_, &second_[at]);
        }
}

RodChange Rod::insert_knot(double s)
{
    const KnotChange knot(basis(), s);
    return change_to(with_knot(rest_, s), knot, true);
}

RodChange Rod::remove_knot(const KnotRemoval& removal)
{
    Spline rest{removal.coarse(), {}};
    removal.apply(rest_.controls, rest.controls);
    return change_to(std::move(rest), removal.change(), false);
}

// All is found again but for the weights, and lengths of spans that stay.
RodChange Rod::change_to(Spline rest, const KnotChange& knot, bool is_insertion)
{
    RodChange out{is_insertion, {}, {}, -1, layout_, knot};
    const std::vector<RodSpan> before = std::move(spans_);
    const std::vector<Weight> old_weights = std::move(weights_);
    rest_ = std::move(rest);
    const std::vector<SplineSpan>& spans = basis().spans();
    // Spans of the same parameters.
    std::size_t old = 0;
    for (std::size_t e = 0; e < spans.size(); ++e)
    {
        while (old < before.size() && before[old].begin < spans[e].begin)
            ++old;
        const bool is_same = old < before.size() && before[old].begin == spans[e].begin &&
                             before[old].end == spans[e].end;
        out.span_from.push_back(is_same ? static_cast<int>(old) : -1);
        if (!is_same && out.span < 0)
            out.span = static_cast<int>(e);
    }
    arc_length_ = ArcLength(rest_, arc_length_, out.span_from);
    find_spans();
    find_places();
    out.station_from.assign(idx(num_stations_), -1);
    const auto keep = [&](int now, int was) { out.station_from[idx(now)] = was; };
    for (std::size_t e = 0; e < spans_.size(); ++e)
        if (const int from = out.span_from[e]; from < 0)
            weights_.emplace_back();
        else
        {
            for (const std::size_t end : {0u, 1u})
                keep(spans_[e].station[end], before[idx(from)].station[end]);
            weights_.push_back(old_weights[idx(from)]);
        }
    // The ends of what was cut in two, or has become one.
    if (out.span >= 0)
    {
        const std::size_t e = idx(out.span);
        const std::size_t was = idx(static_cast<int>(
            std::upper_bound(before.begin(), before.end(), spans_[e].begin,
                             [](double s, const RodSpan& span)
                             { return s < span.begin; }) -
            before.begin() - 1));
        keep(spans_[e].station[0], before[was].station[0]);
        keep(spans_[e + (is_insertion ? 1 : 0)].station[1],
             before[was + (is_insertion ? 0 : 1)].station[1]);
        const Weight &first = old_weights[was],
                     &last = old_weights[was + (is_insertion ? 0 : 1)];
        if (is_insertion)
            weights_[e] = weights_[e + 1] = first;
        else
            weights_[e] =
                first.begin == last.begin && first.end == last.end ? first : weighed(e);
    }
    find_layout();
    return out;
}

namespace
{

constexpr std::array<double, 3> kLobattoPlaces = {0.0, 0.5, 1.0},
                                kLobattoWeights = {1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0};

} // namespace

/// Whether both ends of a cubic's span are knots where the curve is C1 and no more, or
/// one is and the other is an end of the rod.
bool Rod::is_between_c1(std::size_t e) const
{
    const RodSpan& of = spans_[e];
    const std::size_t next = e + 1 < spans_.size() ? e + 1 : 0;
    const bool has_next = e + 1 < spans_.size() || basis().is_closed();
    const int before = basis().smoothness_before(static_cast<int>(e)),
              behind = has_next ? basis().smoothness_before(static_cast<int>(next)) : -1;
    return basis().degree() == 3 && !of.is_smooth[0] && !of.is_smooth[1] &&
           (before == 1 || behind == 1);
}

int Rod::num_stretch(std::size_t e) const
{
    const RodSpan& of = spans_[e];
    const bool follows_bend = basis().smoothness_before(static_cast<int>(e)) >= 1;
    const int num_ends = (!of.is_smooth[0] && !follows_bend) + !of.is_smooth[1];
    const int degree = basis().degree();
    return num_ends == 0   ? 1
           : num_ends == 1 ? (degree + 2) / 2
                           : std::min(degree, kMaxGaussPlaces);
}

std::span<const double> Rod::stretch_places(std::size_t e) const
{
    return is_between_c1(e) ? std::span<const double>(kLobattoPlaces)
                            : gauss_places(num_stretch(e));
}

std::span<const double> Rod::stretch_weights(std::size_t e) const
{
    return is_between_c1(e) ? std::span<const double>(kLobattoWeights)
                            : gauss_weights(num_stretch(e));
}

std::vector<std::array<double, 2>> Rod::pieces() const
{
    std::vector<double> cuts;
    for (std::size_t e = 0; e < spans_.size(); ++e)
        if (basis().smoothness_before(static_cast<int>(e)) < 0)
            cuts.push_back(spans_[e].begin);
    if (cuts.empty())
        return {{basis().begin(), basis().end()}};
    std::vector<std::array<double, 2>> out;
    for (std::size_t k = 0; k + 1 < cuts.size(); ++k)
        out.push_back({cuts[k], cuts[k + 1]});
    out.push_back({cuts.back(), basis().is_closed()
                                    ? cuts.front() + basis().end() - basis().begin()
                                    : basis().end()});
    return out;
}

void Rod::find_layout()
{
    layout_ = {};
    const int n = num_controls();
    // Around a closed rod from both sides: 0, n - 1, 1, n - 2, ...
    std::vector<int> rank(idx(n));
    for (int k = 0; k < n; ++k)
        rank[idx(k)] = !rest_.basis.is_closed() ? k : 2 * k < n ? 2 * k : 2 * (n - k) - 1;
    struct Entry
    {
        int rank, kind, index;
        auto operator<=>(const Entry&) const = default;
    };
    std::vector<Entry> entries;
    for (int k = 0; k < n; ++k)
        entries.push_back({rank[idx(k)], 0, k});
    std::vector<char> is_placed(idx(num_stations_), 0);
    for (std::size_t e = 0; e < spans_.size(); ++e)
        for (const int end : {0, 1})
        {
            const int station = spans_[e].station[idx(end)];
            if (std::exchange(is_placed[idx(station)], 1))
                continue;
            const int near = std::min(1 + end, order_ - 1);
            entries.push_back({rank[idx(controls(e)[near])], 1, station});
        }
    // Of an open rod both halves are in order.
    const auto stations = entries.begin() + n;
    if (rest_.basis.is_closed())
        std::sort(entries.begin(), entries.end());
    else
        std::inplace_merge(entries.begin(), stations, entries.end());
    layout_.control.resize(idx(n));
    layout_.angle.resize(idx(num_stations_));
    for (const Entry& entry : entries)
    {
        (entry.kind == 0 ? layout_.control : layout_.angle)[idx(entry.index)] =
            layout_.num_unknowns;
        layout_.num_unknowns += entry.kind == 0 ? 3 : 1;
    }
    for (std::size_t first = 0; first < spans_.size(); ++first)
    {
        int low = layout_.num_unknowns, high = 0;
        for (std::size_t k = first; k < first + idx(settings_.coupled_spans); ++k)
        {
            if (k >= spans_.size() && !rest_.basis.is_closed())
                break;
            const std::size_t e = k % spans_.size();
            for (int j = 0; j < order_; ++j)
            {
                low = std::min(low, layout_.control[idx(controls(e)[j])]);
                high = std::max(high, layout_.control[idx(controls(e)[j])] + 2);
            }
            for (const int station : spans_[e].station)
            {
                low = std::min(low, layout_.angle[idx(station)]);
                high = std::max(high, layout_.angle[idx(station)]);
            }
        }
        layout_.half_band = std::max(layout_.half_band, high - low);
    }
}

RodState::RodState(const Rod& rod)
    : rod_(&rod), x_(Eigen::VectorXd::Zero(rod.layout().num_unknowns)),
      tangent_(idx(rod.num_stations())), reference_(idx(rod.num_stations())),
      chain_(rod.spans().size(), 0.0), winding_(rod.spans().size(), 0.0)
{
    for (int k = 0; k < rod.num_controls(); ++k)
        x_.segment<3>(rod.layout().control[idx(k)]) = rod.rest().controls[idx(k)];
    find_velocities();
    const std::span<const RodSpan> spans = rod.spans();
    // Turns put into a closed rod are spread evenly along it.
    double way = 0.0;
    for (std::size_t e = 0; e < spans.size(); ++e)
    {
        x_[rod.layout().angle[idx(spans[e].station[0])]] =
            rod.seam_turn(spans.size() - 1) * way / rod.arc_length().total();
        way += spans[e].length;
    }
    for (std::size_t e = 0; e < spans.size(); ++e)
    {
        const auto [near, far] = spans[e].station;
        if (e == 0 || near != spans[e - 1].station[1])
        {
            tangent_[idx(near)] = velocity(e, 0).tangent;
            const Eigen::Vector3d& t = tangent_[idx(near)];
            const std::optional<Eigen::Vector3d>& normal = rod.settings().normal;
            // A piece behind a kink goes on with the directions of the one before it.
            const std::size_t end = e == 0 ? 0 : idx(spans[e - 1].station[1]);
            const Eigen::Vector3d a =
                !normal  ? any_normal(t)
                : e == 0 ? *normal
                         : transported(tangent_[end], t, reference_[end]);
            reference_[idx(near)] = (a - t.dot(a) * t).normalized();
        }
        if (far == 0)
            continue;
        // Along the chain, so that the windings are small at rest.
        Eigen::Vector3d a = reference_[idx(near)], t = tangent_[idx(near)];
        for (int p = 1; p < rod.num_places(); ++p)
        {
            const Eigen::Vector3d& next = velocity(e, p).tangent;
            a = transported(t, next, a);
            t = next;
        }
        tangent_[idx(far)] = t;
        reference_[idx(far)] = (a - t.dot(a) * t).normalized();
    }
    find_windings();
}

void RodState::find_velocities()
{
    if (rod_->order() == 4)
        find_velocities(std::integral_constant<int, 4>());
    else
        find_velocities(rod_->order());
}

/// \p order: a number, or for cubics a constant, which takes half the time.
template <class Order>
void RodState::find_velocities(Order order)
{
    const int count = rod_->num_places();
    velocity_.resize(rod_->spans().size() * idx(count));
    Velocity* out = velocity_.data();
    std::array<Eigen::Vector3d, kMaxOrder> q;
    for (std::size_t e = 0; e < rod_->spans().size(); ++e)
    {
        const int* const controls = rod_->controls(e);
        for (int j = 0; j < order; ++j)
            q[idx(j)] = control(controls[j]);
        const double* b = rod_->first(e, 0);
        for (int p = 0; p < count; ++p, ++out, b += order)
        {
            Eigen::Vector3d u = Eigen::Vector3d::Zero();
            for (int j = 0; j < order; ++j)
                u += b[j] * q[idx(j)];
            const double length = u.norm();
            out->first = u;
            out->length = length;
            out->tangent = u * (1.0 / length);
        }
    }
}

double RodState::twist(std::size_t span) const
{
    const auto [near, far] = rod_->spans()[span].station;
    return angle(far) + rod_->seam_turn(span) - angle(near) + winding_[span];
}

void RodState::find_windings()
{
    const double c0 = rod_->cubes_of_steps();
    const int last = rod_->num_places() - 1;
    for (std::size_t e = 0; e < rod_->spans().size(); ++e)
    {
        const auto [near, far] = rod_->spans()[e].station;
        const Eigen::Vector3d& own = reference_[idx(far)];
        const Eigen::Vector3d& end = tangent_[idx(far)];
        Eigen::Vector3d a = reference_[idx(near)], t = tangent_[idx(near)];
        const Eigen::Vector3d at_once = transported(t, end, a);
        for (int p = 1; p <= last; ++p)
        {
            const Eigen::Vector3d& next = p == last ? end : velocity(e, p).tangent;
            a = transported(t, next, a);
            t = next;
        }
        chain_[e] = nearest_turn(angle_between(a, own, end), chain_[e]);
        // m^d - m^c is the angle from what arrives at once to what the chain brings.
        winding_[e] = chain_[e] - c0 / (1.0 - c0) * small_angle_between(at_once, a, end);
    }
}

void RodState::move(const Eigen::VectorXd& step, double length)
{
    x_ += length * step.head(x_.size());
    for (Eigen::Index k = x_.size(); k < step.size(); ++k)
        sliding[static_cast<std::size_t>(k - x_.size())].s += length * step[k];
    find_velocities();
    turn_stations();
    find_windings();
}

/// To the tangents of now, by the shortest turns.
void RodState::turn_stations()
{
    const std::span<const RodSpan> spans = rod_->spans();
    const int last = rod_->num_places() - 1;
    const auto turn = [&](int station, const Eigen::Vector3d& t)
    {
        const Eigen::Vector3d a =
            transported(tangent_[idx(station)], t, reference_[idx(station)]);
        reference_[idx(station)] = (a - t.dot(a) * t).normalized();
        tangent_[idx(station)] = t;
    };
    for (std::size_t e = 0; e < spans.size(); ++e)
    {
        const auto [near, far] = spans[e].station;
        turn(near, velocity(e, 0).tangent);
        // The near station of the next span is this one, unless there is none.
        if (e + 1 == spans.size() ? far != 0 : far != spans[e + 1].station[0])
            turn(far, velocity(e, last).tangent);
    }
}

void RodState::move_to(const Eigen::VectorXd& x)
{
    move(x - x_);
    x_ = x;
}

void RodState::follow(const RodChange& change, std::span<const Eigen::Vector3d> controls)
{
    const RodLayout& layout = rod_->layout();
    Eigen::VectorXd x(layout.num_unknowns);
    for (int k = 0; k < rod_->num_controls(); ++k)
        x.segment<3>(layout.control[idx(k)]) = controls[idx(k)];
    const std::vector<Eigen::Vector3d> tangents = std::move(tangent_),
                                       references = std::move(reference_);
    const std::vector<double> chain = std::move(chain_);
    tangent_.resize(idx(rod_->num_stations()));
    reference_.resize(tangent_.size());
    for (std::size_t k = 0; k < tangent_.size(); ++k)
        if (const int from = change.station_from[k]; from >= 0)
        {
            tangent_[k] = tangents[idx(from)];
            reference_[k] = references[idx(from)];
            x[layout.angle[k]] = x_[change.before.angle[idx(from)]];
        }
    chain_.assign(rod_->spans().size(), 0.0);
    winding_.resize(chain_.size());
    for (std::size_t e = 0; e < chain_.size(); ++e)
        if (const int from = change.span_from[e]; from >= 0)
            chain_[e] = chain[idx(from)];
    x_ = std::move(x);
    find_velocities();
    if (change.span < 0 || !change.is_insertion)
    {
        if (change.span >= 0)
            chain_[idx(change.span)] =
                chain[idx(change.span)] + chain[idx(change.span) + 1];
        turn_stations();
        find_windings();
        return;
    }
    // The new station's vector is what the chain brings.
    const std::size_t e = idx(change.span);
    const RodSpan &first = rod_->spans()[e], &second = rod_->spans()[e + 1];
    const int near = first.station[0], here = first.station[1], far = second.station[1];
    Eigen::Vector3d a = reference_[idx(near)], t = tangent_[idx(near)];
    for (int p = 1; p < rod_->num_places(); ++p)
    {
        const Eigen::Vector3d& next = velocity(e, p).tangent;
        a = transported(t, next, a);
        t = next;
    }
    tangent_[idx(here)] = t;
    reference_[idx(here)] = (a - t.dot(a) * t).normalized();
    chain_[e + 1] = chain[e];
    find_windings();
    const double twist =
        angle(far) + rod_->seam_turn(e + 1) - angle(near) + winding_[e] + winding_[e + 1];
    x_[layout.angle[idx(here)]] =
        angle(near) - winding_[e] + first.length / (first.length + second.length) * twist;
}

CurvePoint RodState::at(const BasisValues& values) const
{
    std::array<Eigen::Vector3d, 3> sums;
    sums.fill(Eigen::Vector3d::Zero());
    for (int j = 0; j < values.count; ++j)
        for (std::size_t order = 0; order < 3; ++order)
            sums[order] += values.value[order][idx(j)] * control(values.control[idx(j)]);
    return {sums[0], sums[1], sums[2]};
}

Eigen::Matrix3d RodState::frame(double s) const
{
    const double at_s = rod_->basis().wrapped(s);
    return frame_in(idx(rod_->basis().span_of(at_s)), at_s);
}

Eigen::Matrix3d RodState::frame_in(std::size_t e, double at_s) const
{
    const RodSpan& span = rod_->spans()[e];
    const double x = (at_s - span.begin) / (span.end - span.begin);
    const int near = span.station[0];
    Eigen::Vector3d a = reference_[idx(near)], t = tangent_[idx(near)];
    const auto go_to = [&](const Eigen::Vector3d& u)
    {
        const Eigen::Vector3d next = u.normalized();
        a = transported(t, next, a);
        t = next;
    };
    double angle_here = angle(near) + x * twist(e);
    if (x == 1.0)
    {
        // The far station has a vector of its own.
        a = reference_[idx(span.station[1])];
        t = tangent_[idx(span.station[1])];
        angle_here = angle(span.station[1]);
    }
    else if (x > 0.0)
    {
        for (int p = 1; p + 1 < rod_->num_places() && rod_->place(p) < x; ++p)
            go_to(velocity(e, p).first);
        go_to(at(rod_->basis().values_in(static_cast<int>(e), at_s)).first);
    }
    Eigen::Matrix3d frame;
    frame.col(0) = std::cos(angle_here) * a + std::sin(angle_here) * t.cross(a);
    frame.col(1) = t.cross(frame.col(0));
    frame.col(2) = t;
    return frame;
}

Spline RodState::curve() const
{
    Spline curve = rod_->rest();
    for (int k = 0; k < rod_->num_controls(); ++k)
        curve.controls[idx(k)] = control(k);
    return curve;
}

} // namespace cellwarp::core
