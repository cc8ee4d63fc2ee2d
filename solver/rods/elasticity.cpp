// SPDX-License-Identifier: GPL-3.0-or-later
// With u = P', w = P'', l = |u|, t = u / l, sigma = |P0'|:
//   eps = l / sigma - 1,   K = u x w / (l^2 sigma) [1/m],   kappa_i = K . m_i
//   U = int 1/2 YA eps^2 + sum_i 1/2 YI_i (kappa_i - kappa0_i)^2 dS
//     + sum_spans 1/2 GJ / L (Delta - Delta0)^2
// in the frames of rod.cpp: at place g of a span m_1 is the near station's vector, taken
// along the chain and turned by psi_g = theta_near + x_g Delta.
//
// Quadrature. Bending: degree - 1 Gauss points a span. Stretch: the centre of each span,
// but more points in spans that touch an end or a knot that is less smooth; for cubics
// two, three where both are such, n - 1 in all, as many as u has dimensions. A knot where
// the curve is C1 counts for the span before it alone. More would lock slender rods (they
// would not bend without stretching), fewer would leave mechanisms. Cubics between such
// knots have Lobatto's three points, the ends shared with the neighbours: at two of Gauss
// in each span a ripple of u from span to span would not be seen.
//
// Derivatives. Of the angle m_ab about t_b that H(t_a -> t_b) leaves, with
// chi = 1 + t_a . t_b, beta = 2 t_a x t_b / chi, tt = (t_a + t_b) / chi:
//   dm = beta . du_a / (2 l_a) + beta . du_b / (2 l_b)
//   H_aa = -[beta (t_a + tt)^T + (t_a + tt) beta^T] / (4 l_a^2),  H_bb likewise with b,
//   H_ab = {[tt]x - 1/2 (beta tt^T + tt beta^T)} / (2 l_a l_b)
// spin at g:  dphi = dtheta_near + x_g dDelta - sum_{hops before g} dm
//   deps = t . du / sigma,   d2eps = du . (I - t t^T) du / (l sigma)
//   dK = (u x dw - w x du) f - 2 K (t . du) / l,   f = 1 / (l^2 sigma)
//   dkappa_1 = m_1 . dK + kappa_2 dphi,   dkappa_2 = m_2 . dK - kappa_1 dphi
// and, with C = u x w, for a vector p that does not move,
//   d2(p . K) = 2 f p . (du x dw) + 2 (p . dC) df + (p . C) d2f,
//   df = -2 f (t . du) / l,   d2f = f [8 (t . du)^2 - 2 |du|^2] / l^2
//   d2kappa_1 = d2(m_1 . K) - (m_1 . dt)(t . dK) + kappa_2 d2phi + 2 (m_2 . dK) dphi
//               - kappa_1 dphi^2
//   d2kappa_2 = d2(m_2 . K) - (m_2 . dt)(t . dK) - kappa_1 d2phi - 2 (m_1 . dK) dphi
//               - kappa_2 dphi^2
// where t . dK = -K . du / l and m . dt = m . du / l. Forces S_i = YI_i (kappa_i -
// kappa0_i) gather them: with p = S_1 m_1 + S_2 m_2 and r = S_1 m_2 - S_2 m_1,
//   sum S_i d2kappa_i = d2(p . K) + (p . du)(K . du) / l^2 + (S_1 kappa_2 - S_2 kappa_1)
//   d2phi
//                       + 2 (r . dK) dphi - (S_1 kappa_1 + S_2 kappa_2) dphi^2
// A round section that is straight at rest needs no frames: 1/2 YI |K|^2.
//
// Material damping. A strain e of stiffness k that loses b k / 2 (e - e_n)^2 on the way
// from e_n in a step, b the gain, is one of stiffness k (1 + b) with the rest value
//   (e_0 + b e_n) / (1 + b),
// but for a constant. As the strains do not change in a rigid motion, nothing is lost in
// one. Curvatures are by the directions of the section, for round ones as well.
#include "solver/rods/elasticity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "octree/base/index.h"
#include "solver/rods/elastic_kernel.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

template <int M>
class Elasticity final : public RodTerm, ElasticCounts<M>
{
    using Counts = ElasticCounts<M>;
    using Counts::kLegs, Counts::kInside, Counts::kPlaces, Counts::kUnknowns,
        Counts::kEntries;

    /// Where a span stands in vectors and in the band.
    struct Span
    {
        std::array<int, M> control = {}; ///< first unknown of each
        std::array<int, 2> angle = {};   ///< unknowns
        int near = 0;                    ///< station
        int first_unknown = 0;
        std::size_t pattern = 0;
    };

public:
    Elasticity(const Rod& rod, const ElasticParts& parts)
        : rod_(rod), rest_(rod), kernels_(elastic_kernels<M>(instruction_sets().back()))
    {
        kind_.has_stretch = parts.has_stretch;
        kind_.has_bending = parts.has_bending;
        kind_.has_twist = parts.has_twist;
        has_energy_ = parts.has_energy;
        kind_.is_plain = rod.is_straight();
        kind_.cubes = rod.cubes_of_steps();
        std::copy_n(rod.bending_places().begin(), kInside, kind_.place);
        describe_spans();
        for (std::size_t e = 0; e < spans_.size(); ++e)
            kind_.is_plain = kind_.is_plain && is_round(e);
        find_rest_curvature();
    }

    void follow(const RodChange& change) override
    {
        rest_.follow(change, rod_.rest().controls);
        kind_.is_predicted = false;
        damped_.clear();
        describe_spans();
        find_rest_curvature();
    }

    double value(const RodState& state) const override
    {
        return has_energy_ ? value(state, kind_, groups_) : 0.0;
    }

    double step_value(const RodState& state) const override
    {
        return damped_.empty() ? value(state) : value(state, framed(), damped_);
    }

    void add_gradient(const RodState& state, Eigen::VectorXd& out) const override
    {
        if (!is_at_work())
            return;
        for (std::size_t k = 0; k < groups_.size(); ++k)
            add_gradient(state, k, kind(), groups()[k], out);
    }

    void damp(const RodState& begin, double gain) override
    {
        damped_.clear();
        if (!(gain > 0.0))
            return;
        damped_ = groups_;
        const double of_energy = has_energy_ ? 1.0 : 0.0, sum = of_energy + gain;
        for (std::size_t k = 0; k < damped_.size(); ++k)
        {
            const ElasticStrains<M> at = strains(begin, k);
            change(damped_[k], at,
                   [&](double& stiffness, double& rest, double strain)
                   {
                       stiffness *= sum;
                       rest = (of_energy * rest + gain * strain) / sum;
                   });
        }
    }

    void add_damping_forces(const RodState& state, const Eigen::VectorXd& velocity,
                            double time, Eigen::VectorXd& out) const override
    {
        const ElasticKind kind = framed();
        for (std::size_t k = 0; k < groups_.size(); ++k)
        {
            const ElasticPlaces<M> at = places(state, k, kind);
            ElasticRates<M> moves;
            for (int l = 0; l < groups_[k].count; ++l)
            {
                const Span& span = spans_[k * kSpanLanes + idx(l)];
                const Legs legs_move = legs(span, velocity);
                for (int j = 0; j < kLegs; ++j)
                    for (int c = 0; c < 3; ++c)
                        moves.of[3 * j + c].lane[l] = legs_move[idx(j)][c];
                for (const int end : {0, 1})
                    moves.of[3 * kLegs + end].lane[l] = velocity[span.angle[idx(end)]];
            }
            ElasticStrains<M> strains, rates;
            kernels_.strains(kind, groups_[k], at, strains);
            kernels_.rates(kind, groups_[k], at, moves, rates);
            // Forces of strains that are off by what the rates make of the time.
            ElasticSpans<M> lossy = groups_[k];
            change(lossy, strains,
                   [](double&, double& rest, double strain) { rest = strain; });
            change(lossy, rates,
                   [&](double&, double& rest, double rate) { rest -= time * rate; });
            add_gradient(state, k, kind, lossy, out);
        }
    }

    void add_hessian(const RodState& state, RodHessian how,
                     BandMatrix& out) const override
    {
        if (!is_at_work())
            return;
        std::array<SpanNumbers, idx(kEntries)> entries;
        const ElasticKind kind = this->kind();
        for (std::size_t k = 0; k < groups_.size(); ++k)
        {
            kernels_.hessian(kind, how, groups()[k], places(state, k, kind),
                             entries.data());
            for (int l = 0; l < groups_[k].count; ++l)
            {
                const Span& span = spans_[k * kSpanLanes + idx(l)];
                double* const to = &out.lower(span.first_unknown, span.first_unknown);
                const int* const at = patterns_[span.pattern].data();
                for (std::size_t n = 0; n < entries.size(); ++n)
                    to[at[n]] += entries[n].lane[l];
            }
        }
    }

    void predict(const RodState& state, const Eigen::VectorXd* step) override
    {
        kind_.is_predicted = step != nullptr && kind_.has_stretch && is_at_work();
        if (!kind_.is_predicted)
            return;
        force_.resize(groups_.size() * Counts::kMostStretch);
        for (std::size_t e = 0; e < spans_.size(); ++e)
        {
            const ElasticSpans<M>& group = groups()[e / kSpanLanes];
            const std::size_t l = e % kSpanLanes;
            const Legs at = legs(spans_[e], state.x()), by = legs(spans_[e], *step);
            for (int k = 0; k < group.num_stretch; ++k)
            {
                const Vector3d u = sum(group.stretch_first[k], l, at);
                const double length = u.norm(), sigma = group.stretch_sigma[k].lane[l];
                force_[e / kSpanLanes * Counts::kMostStretch + idx(k)].lane[l] =
                    group.stretch_weight[k].lane[l] *
                    (length / sigma - 1.0 - group.stretch_rest[k].lane[l] +
                     u.dot(sum(group.stretch_first[k], l, by)) / (length * sigma));
            }
        }
    }

    void add_correction(const RodState& before, const RodState& after,
                        const Eigen::VectorXd& step, Eigen::VectorXd& out) const override
    {
        if (!kind_.has_stretch || !is_at_work())
            return;
        for (std::size_t e = 0; e < spans_.size(); ++e)
        {
            const Span& span = spans_[e];
            const ElasticSpans<M>& group = groups()[e / kSpanLanes];
            const std::size_t l = e % kSpanLanes;
            const Legs old = legs(span, before.x()), now = legs(span, after.x()),
                       by = legs(span, step);
            for (int k = 0; k < group.num_stretch; ++k)
            {
                const SpanNumbers* const share = group.stretch_first[k];
                const double sigma = group.stretch_sigma[k].lane[l];
                const Vector3d u = sum(share, l, old);
                const double length = u.norm();
                const double left = (sum(share, l, now).norm() - length -
                                     u.dot(sum(share, l, by)) / length) /
                                    sigma;
                const Vector3d pull =
                    -group.stretch_weight[k].lane[l] * left / (length * sigma) * u;
                for (int j = 0; j < kLegs; ++j)
                {
                    const Vector3d on_leg = share[j].lane[l] * pull;
                    out.template segment<3>(span.control[idx(j + 1)]) += on_leg;
                    out.template segment<3>(span.control[idx(j)]) -= on_leg;
                }
            }
        }
    }

private:
    using Legs = std::array<Vector3d, idx(Counts::kLegs)>;

    /// It has an energy, or damp() has made it lose some.
    bool is_at_work() const { return has_energy_ || !damped_.empty(); }
    ElasticKind framed() const
    {
        ElasticKind out = kind_;
        out.is_plain = false;
        return out;
    }
    /// The strains that forces are made of.
    ElasticKind kind() const { return damped_.empty() ? kind_ : framed(); }
    const std::vector<ElasticSpans<M>>& groups() const
    {
        return damped_.empty() ? groups_ : damped_;
    }

    double value(const RodState& state, const ElasticKind& kind,
                 const std::vector<ElasticSpans<M>>& groups) const
    {
        double sum = 0.0;
        for (std::size_t k = 0; k < groups.size(); ++k)
        {
            SpanNumbers energy;
            kernels_.energy(kind, groups[k], places(state, k, kind), energy);
            for (int l = 0; l < groups[k].count; ++l)
                sum += energy.lane[l];
        }
        return sum;
    }

    void add_gradient(const RodState& state, std::size_t k, const ElasticKind& kind,
                      const ElasticSpans<M>& group, Eigen::VectorXd& out) const
    {
        std::array<SpanNumbers, idx(kUnknowns)> force;
        kernels_.gradient(kind, group, places(state, k, kind), force.data());
        for (int l = 0; l < group.count; ++l)
        {
            const Span& span = spans_[k * kSpanLanes + idx(l)];
            for (int j = 0; j < M; ++j)
                for (int c = 0; c < 3; ++c)
                    out[span.control[idx(j)] + c] += force[idx(3 * j + c)].lane[l];
            for (const int end : {0, 1})
                out[span.angle[idx(end)]] += force[idx(3 * M + end)].lane[l];
        }
    }

    ElasticStrains<M> strains(const RodState& state, std::size_t k) const
    {
        ElasticStrains<M> out;
        kernels_.strains(framed(), groups_[k], places(state, k, framed()), out);
        return out;
    }

    /// \p each(stiffness, strain at rest, number of \p strains) of all strains.
    template <class Each>
    static void change(ElasticSpans<M>& group, const ElasticStrains<M>& strains,
                       const Each& each)
    {
        const auto lanes =
            [&](SpanNumbers& stiffness, SpanNumbers& rest, const SpanNumbers& strain)
        {
            for (std::size_t l = 0; l < idx(group.count); ++l)
                each(stiffness.lane[l], rest.lane[l], strain.lane[l]);
        };
        for (int k = 0; k < group.num_stretch; ++k)
            lanes(group.stretch_weight[k], group.stretch_rest[k], strains.stretch[k]);
        for (int g = 0; g < kInside; ++g)
            for (const int i : {0, 1})
                lanes(group.stiffness[g][i], group.rest[g][i], strains.curvature[g][i]);
        lanes(group.twist_stiffness, group.rest_twist, strains.twist);
    }

    static Legs legs(const Span& span, const Eigen::VectorXd& x)
    {
        Legs out;
        for (int j = 0; j < kLegs; ++j)
            out[idx(j)] = x.segment<3>(span.control[idx(j + 1)]) -
                          x.segment<3>(span.control[idx(j)]);
        return out;
    }
    static Vector3d sum(const SpanNumbers* share, std::size_t lane, const Legs& of)
    {
        Vector3d out = Vector3d::Zero();
        for (int j = 0; j < kLegs; ++j)
            out += share[j].lane[lane] * of[idx(j)];
        return out;
    }
    /// Shares of control points, which sum to 0, become those of legs.
    static void take_shares(const double* of_controls, std::size_t lane, SpanNumbers* out)
    {
        double share = 0.0;
        for (int j = kLegs; j > 0; --j)
        {
            share += of_controls[j];
            out[j - 1].lane[lane] = share;
        }
    }

    /// All of the spans but their rest curvature.
    void describe_spans()
    {
        const std::size_t num_spans = rod_.spans().size();
        patterns_.clear();
        spans_.clear();
        groups_.assign((num_spans + kSpanLanes - 1) / kSpanLanes, {});
        for (std::size_t e = 0; e < num_spans; ++e)
        {
            Span span;
            span.near = rod_.spans()[e].station[0];
            for (int j = 0; j < M; ++j)
                span.control[idx(j)] = rod_.layout().control[idx(rod_.controls(e)[j])];
            for (const std::size_t end : {0u, 1u})
                span.angle[end] = rod_.layout().angle[idx(rod_.spans()[e].station[end])];
            find_pattern(span);
            spans_.push_back(span);
            ElasticSpans<M>& group = groups_[e / kSpanLanes];
            ++group.count;
            group.num_stretch = std::max(group.num_stretch,
                                         static_cast<int>(rod_.stretch_places(e).size()));
            describe(e);
        }
    }

    void find_rest_curvature()
    {
        if (rod_.settings().rest != RodRest::Given || kind_.is_plain)
            return;
        for (std::size_t k = 0; k < groups_.size(); ++k)
        {
            const ElasticStrains<M> rest = strains(rest_, k);
            std::copy_n(&rest.curvature[0][0], 2 * kInside, &groups_[k].rest[0][0]);
        }
    }

    bool is_round(std::size_t e) const
    {
        const ElasticSpans<M>& group = groups_[e / kSpanLanes];
        const std::size_t l = e % kSpanLanes;
        for (int g = 0; g < kInside; ++g)
            if (group.stiffness[g][0].lane[l] != group.stiffness[g][1].lane[l])
                return false;
        return true;
    }

    /// What is known of span \p e without its rest curvature.
    void describe(std::size_t e)
    {
        ElasticSpans<M>& group = groups_[e / kSpanLanes];
        const std::size_t l = e % kSpanLanes;
        const RodSpan& of = rod_.spans()[e];
        const double h = of.end - of.begin;
        for (int p = 0; p < kPlaces; ++p)
            take_shares(rod_.first(e, p), l, group.first[p]);
        double twist = 0.0;
        for (int g = 0; g < kInside; ++g)
        {
            take_shares(rod_.second(e, g + 1), l, group.second[g]);
            const double share = rod_.bending_weights()[idx(g)],
                         sigma = rest_.velocity(e, g + 1).length;
            const Section section = rod_.section_at(of.begin + kind_.place[g] * h);
            group.sigma[g].lane[l] = sigma;
            for (const std::size_t i : {0u, 1u})
                group.stiffness[g][i].lane[l] = share * h * sigma * section.bending[i];
            twist += share * section.twist;
        }
        group.twist_stiffness.lane[l] = twist / of.length;
        group.rest_twist.lane[l] = rod_.settings().rest_twist * of.length;
        if (rod_.settings().rest == RodRest::Given)
            // Turns put into a closed rod are no rest twist.
            group.rest_twist.lane[l] +=
                rest_.twist(e) - rod_.seam_turn(rod_.spans().size() - 1) * of.length /
                                     rod_.arc_length().total();
        const std::span<const double> at_shares = rod_.stretch_places(e),
                                      weights = rod_.stretch_weights(e);
        const int count = static_cast<int>(at_shares.size());
        for (int k = 0; k < Counts::kMostStretch; ++k)
        {
            // What others have more is here of no weight.
            const bool is_one = k < count;
            const double share = is_one ? at_shares[idx(k)] : 0.5;
            const double at = of.begin + share * h;
            const BasisValues values = rod_.basis().values_in(static_cast<int>(e), at);
            take_shares(values.value[1].data(), l, group.stretch_first[k]);
            // As the kernels form it: at rest nothing is left.
            const double sigma =
                sum(group.stretch_first[k], l, legs(spans_[e], rest_.x())).norm();
            group.stretch_sigma[k].lane[l] = sigma;
            group.stretch_weight[k].lane[l] =
                is_one ? weights[idx(k)] * h * sigma * rod_.section_at(at).stretch : 0.0;
        }
    }

    ElasticPlaces<M> places(const RodState& state, std::size_t group,
                            const ElasticKind& kind) const
    {
        const ElasticSpans<M>& spans = groups_[group];
        ElasticPlaces<M> out;
        for (int l = 0; l < spans.count; ++l)
        {
            const std::size_t e = group * kSpanLanes + idx(l);
            const Span& span = spans_[e];
            const Legs at = legs(span, state.x());
            for (int j = 0; j < kLegs; ++j)
                for (int c = 0; c < 3; ++c)
                    out.leg[j][c].lane[l] = at[idx(j)][c];
            out.twist.lane[l] = state.twist(e);
            if (kind.is_plain)
                continue;
            for (int c = 0; c < 3; ++c)
                out.reference[c].lane[l] = state.reference(span.near)[c];
            for (int g = 0; g < kInside; ++g)
            {
                const double angle =
                    state.angle(span.near) + kind_.place[g] * out.twist.lane[l];
                out.turn[g][0].lane[l] = std::cos(angle);
                out.turn[g][1].lane[l] = std::sin(angle);
            }
        }
        if (kind_.is_predicted)
            for (int k = 0; k < spans.num_stretch; ++k)
                out.force[k] = force_[group * Counts::kMostStretch + idx(k)];
        return out;
    }

    /// Where the lower triangle of a span's matrix stands in the band, from the entry of
    /// its first unknown on.
    using Pattern = std::array<int, idx(kEntries)>;

    void find_pattern(Span& span)
    {
        std::array<int, idx(kUnknowns)> place;
        for (int j = 0; j < M; ++j)
            for (int c = 0; c < 3; ++c)
                place[idx(3 * j + c)] = span.control[idx(j)] + c;
        place[idx(3 * M)] = span.angle[0];
        place[idx(3 * M + 1)] = span.angle[1];
        const int first = *std::min_element(place.begin(), place.end());
        const int width = rod_.layout().half_band + 1;
        Pattern pattern;
        auto next = pattern.begin();
        for (int j = 0; j < kUnknowns; ++j)
            for (int i = j; i < kUnknowns; ++i)
            {
                const auto [low, high] = std::minmax(place[idx(i)], place[idx(j)]);
                *next++ = (low - first) * width + high - low;
            }
        span.first_unknown = first;
        // Along a rod they are all alike but at its ends.
        const auto same = std::find(patterns_.begin(), patterns_.end(), pattern);
        span.pattern = idx(static_cast<int>(same - patterns_.begin()));
        if (same == patterns_.end())
            patterns_.push_back(pattern);
    }

    const Rod& rod_;
    RodState rest_;
    ElasticKind kind_;
    bool has_energy_ = true;
    ElasticKernels<M> kernels_;
    std::vector<Span> spans_;
    std::vector<ElasticSpans<M>> groups_; ///< eight spans each
    std::vector<ElasticSpans<M>> damped_; ///< in a step with losses
    std::vector<SpanNumbers> force_;      ///< as predicted, kMostStretch a group
    std::vector<Pattern> patterns_;
};

} // namespace

std::unique_ptr<RodTerm> exact_elasticity(const Rod& rod, const ElasticParts& parts)
{
    switch (rod.order())
    {
    case 3:
        return std::make_unique<Elasticity<3>>(rod, parts);
    case 4:
        return std::make_unique<Elasticity<4>>(rod, parts);
    case 5:
        return std::make_unique<Elasticity<5>>(rod, parts);
    case 6:
        return std::make_unique<Elasticity<6>>(rod, parts);
    case 7:
        return std::make_unique<Elasticity<7>>(rod, parts);
    case 8:
        return std::make_unique<Elasticity<8>>(rod, parts);
    default:
        throw std::invalid_argument("a rod that bends needs degree 2 or more");
    }
}

} // namespace cellwarp::core
