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
// two, three where both are such, n - 1 in all, as many as u has dimensions. More would
// lock slender rods (they would not bend without stretching), fewer would leave
// mechanisms.
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
#include "solver/rods/elasticity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

template <int M>
class Elasticity final : public RodTerm
{
    static constexpr int kInside = M > 2 ? M - 2 : 1; ///< bending places
    static constexpr int kPlaces = kInside + 2;
    static constexpr int kLocal = 3 * M + 2; ///< control points, near and far angle
    using Local = Eigen::Matrix<double, kLocal, 1>;

    struct Bending
    {
        double place = 0.0; ///< in the span
        double weight = 0.0, sigma = 0.0;
        std::array<double, 2> stiffness = {}, rest = {};
    };
    struct Stretch
    {
        std::array<double, M> first = {};
        double weight = 0.0; ///< YA W sigma [N m]
        double sigma = 0.0;
        double force = 0.0; ///< YA W sigma eps, as predicted
    };
    struct Span
    {
        std::array<int, M> control = {}; ///< first unknown of each
        std::array<int, 2> angle = {};   ///< unknowns
        std::array<std::array<double, M>, kPlaces> first = {};
        std::array<std::array<double, M>, kInside> second = {};
        std::array<Bending, kInside> bending;
        int first_stretch = 0, num_stretch = 0;
        double twist_stiffness = 0.0, rest_twist = 0.0; ///< GJ / L [N m], [rad]
        std::array<int, 2> station = {};
        int first_unknown = 0;
        std::size_t pattern = 0;
    };

    /// What the derivatives of one span are made of.
    struct Look
    {
        std::array<Vector3d, M> q;
        const RodState::Velocity* at; ///< of all places
        std::array<Vector3d, kInside> w;
    };
    /// One hop from tangent to tangent.
    struct Hop
    {
        int a = 0, b = 0;
        Vector3d beta, tt;
    };
    /// Forces on a span, gathered where they act.
    struct Pull
    {
        std::array<Vector3d, kPlaces> on_u;
        std::array<Vector3d, kInside> on_w;
        std::array<double, kPlaces> on_hop = {}; ///< moments
        double on_near = 0.0, on_far = 0.0;      ///< on the angles
        Pull()
        {
            on_u.fill(Vector3d::Zero());
            on_w.fill(Vector3d::Zero());
        }
        void add_twist(const Elasticity& of, double moment)
        {
            for (int k = 0; k < kPlaces; ++k)
                on_hop[idx(k)] += moment * of.hop_share(k);
            on_near -= moment;
            on_far += moment;
        }
        /// On the spin at an inner place.
        void add_spin(const Elasticity& of, double place, int g, double moment)
        {
            add_twist(of, moment * place);
            for (int k = 0; k <= g; ++k)
                on_hop[idx(k)] -= moment;
            on_near += moment;
        }
    };
    struct Strain
    {
        Vector3d K;
        double f = 0.0;
    };

public:
    Elasticity(const Rod& rod, const ElasticParts& parts)
        : rod_(rod), parts_(parts), cubes_(rod.cubes_of_steps())
    {
        const RodState rest(rod);
        const std::span<const double> places = rod.bending_places(),
                                      weights = rod.bending_weights();
        const bool is_given = rod.settings().rest == RodRest::Given;
        is_plain_ = rod.is_straight();
        for (std::size_t e = 0; e < rod.spans().size(); ++e)
        {
            const RodSpan& of = rod.spans()[e];
            const double h = of.end - of.begin;
            Span span;
            span.station = of.station;
            for (int j = 0; j < M; ++j)
                span.control[idx(j)] = rod.layout().control[idx(rod.controls(e)[j])];
            for (const std::size_t end : {0u, 1u})
                span.angle[end] = rod.layout().angle[idx(of.station[end])];
            for (int p = 0; p < kPlaces; ++p)
                std::copy_n(rod.first(e, p), M, span.first[idx(p)].begin());
            double twist = 0.0;
            for (int g = 0; g < kInside; ++g)
            {
                std::copy_n(rod.second(e, g + 1), M, span.second[idx(g)].begin());
                Bending& b = span.bending[idx(g)];
                b.place = places[idx(g)];
                b.sigma = rest.velocity(e, g + 1).length;
                b.weight = weights[idx(g)] * h * b.sigma;
                const Section section = rod.section_at(of.begin + b.place * h);
                b.stiffness = section.bending;
                twist += weights[idx(g)] * section.twist;
                is_plain_ = is_plain_ && b.stiffness[0] == b.stiffness[1];
            }
            span.twist_stiffness = twist / of.length;
            span.rest_twist = rod.settings().rest_twist * of.length;
            if (is_given)
                span.rest_twist += rest.winding(e);
            find_pattern(span);
            spans_.push_back(span);
            add_stretch(e, h);
        }
        if (is_given)
            for (std::size_t e = 0; e < spans_.size(); ++e)
            {
                Span& span = spans_[e];
                const Look at = look(rest, span, e);
                for (int g = 0; g < kInside; ++g)
                {
                    const Strain strain = strain_of(at, span, g);
                    const auto [m1, m2] = directions(rest, e, at, g);
                    span.bending[idx(g)].rest = {strain.K.dot(m1), strain.K.dot(m2)};
                }
            }
        if (is_plain_)
            for (Span& span : spans_)
                for (Bending& b : span.bending)
                    b.rest = {};
    }

    double value(const RodState& state) const override
    {
        double sum = 0.0;
        for (std::size_t e = 0; e < spans_.size(); ++e)
        {
            const Span& span = spans_[e];
            const Look at = look(state, span, e);
            for (int k = 0; parts_.has_stretch && k < span.num_stretch; ++k)
            {
                const Stretch& s = stretch_[idx(span.first_stretch + k)];
                const double eps = strain(at, s);
                sum += 0.5 * s.weight * eps * eps;
            }
            for (int g = 0; parts_.has_bending && g < kInside; ++g)
            {
                const Bending& b = span.bending[idx(g)];
                const Vector3d K = strain_of(at, span, g).K;
                if (is_plain_)
                {
                    sum += 0.5 * b.weight * b.stiffness[0] * K.squaredNorm();
                    continue;
                }
                const auto [m1, m2] = directions(state, e, at, g);
                sum += 0.5 * b.weight *
                       (b.stiffness[0] * square(K.dot(m1) - b.rest[0]) +
                        b.stiffness[1] * square(K.dot(m2) - b.rest[1]));
            }
            if (parts_.has_twist)
                sum +=
                    0.5 * span.twist_stiffness * square(state.twist(e) - span.rest_twist);
        }
        return sum;
    }

    void add_gradient(const RodState& state, Eigen::VectorXd& out) const override
    {
        for (std::size_t e = 0; e < spans_.size(); ++e)
        {
            const Span& span = spans_[e];
            const Look at = look(state, span, e);
            Forces forces = {};
            for (int k = 0; parts_.has_stretch && k < span.num_stretch; ++k)
            {
                const Stretch& s = stretch_[idx(span.first_stretch + k)];
                const Vector3d u = velocity(at, s);
                const double l = u.norm();
                const Vector3d pull = s.weight * (l / s.sigma - 1.0) / (s.sigma * l) * u;
                add_scaled(s.first, pull, forces);
            }
            Pull pull;
            if (parts_.has_twist)
                pull.add_twist(*this,
                               span.twist_stiffness * (state.twist(e) - span.rest_twist));
            for (int g = 0; parts_.has_bending && g < kInside; ++g)
            {
                const Bending& b = span.bending[idx(g)];
                const Strain s = strain_of(at, span, g);
                if (is_plain_)
                {
                    pull_back(at, g, s, b.weight * b.stiffness[0] * s.K, pull);
                    continue;
                }
                const auto [m1, m2] = directions(state, e, at, g);
                const double k1 = s.K.dot(m1), k2 = s.K.dot(m2);
                const double S1 = b.weight * b.stiffness[0] * (k1 - b.rest[0]);
                const double S2 = b.weight * b.stiffness[1] * (k2 - b.rest[1]);
                pull_back(at, g, s, S1 * m1 + S2 * m2, pull);
                pull.add_spin(*this, b.place, g, S1 * k2 - S2 * k1);
            }
            add_hops(at, pull);
            spread(span, pull, forces);
            for (int j = 0; j < M; ++j)
                for (int c = 0; c < 3; ++c)
                    out[span.control[idx(j)] + c] += forces[idx(3 * j + c)];
            out[span.angle[0]] += pull.on_near;
            out[span.angle[1]] += pull.on_far;
        }
    }

    void add_hessian(const RodState& state, RodHessian how,
                     BandMatrix& out) const override
    {
        const bool is_exact = how != RodHessian::Definite;
        Square H;
        // The lower triangle is enough: += x v v^T.
        const auto add_square = [&H](const Local& v, double x)
        {
            for (int j = 0; j < kLocal; ++j)
            {
                const double y = x * v[j];
                for (int i = j; i < kLocal; ++i)
                    H(i, j) += y * v[i];
            }
        };
        for (std::size_t e = 0; e < spans_.size(); ++e)
        {
            const Span& span = spans_[e];
            const Look at = look(state, span, e);
            H.setZero();
            for (int k = 0; parts_.has_stretch && k < span.num_stretch; ++k)
            {
                const Stretch& s = stretch_[idx(span.first_stretch + k)];
                const Vector3d u = velocity(at, s);
                const double l = u.norm();
                double force = is_predicted_ ? s.force : s.weight * (l / s.sigma - 1.0);
                if (how != RodHessian::Exact)
                    force = std::max(force, 0.0);
                const Vector3d t = u / l;
                const double along = s.weight / (s.sigma * s.sigma),
                             across = force / (l * s.sigma);
                Matrix3d B = (along - across) * t * t.transpose();
                B.diagonal().array() += across;
                for (int j = 0; j < M; ++j)
                    add_column(s.first, j, s.first[idx(j)] * B, H);
            }
            const double moment =
                parts_.has_twist
                    ? span.twist_stiffness * (state.twist(e) - span.rest_twist)
                    : 0.0;
            Blocks blocks(parts_.has_bending);
            std::array<Hop, kPlaces> hops;
            std::array<double, kPlaces> hop_force = {};
            Local of_twist = Local::Zero();
            if (parts_.has_twist || !is_plain_)
            {
                find_hops(at, hops);
                of_twist = twist_form(span, at);
            }
            if (parts_.has_twist)
            {
                add_square(of_twist, span.twist_stiffness);
                for (int k = 0; k < kPlaces; ++k)
                    hop_force[idx(k)] += moment * hop_share(k);
            }
            for (int p = 0; parts_.has_bending && p < kInside; ++p)
            {
                const Bending& b = span.bending[idx(p)];
                const Strain s = strain_of(at, span, p);
                const std::array<double, M>& c1 = span.first[idx(p) + 1];
                const std::array<double, M>& c2 = span.second[idx(p)];
                const Vector3d &u = at.at[p + 1].first, &t = at.at[p + 1].tangent;
                const double l = at.at[p + 1].length;
                const Vector3d& w = at.w[idx(p)];
                const Matrix3d A =
                    -s.f * cross_matrix(w) - (2.0 / l) * s.K * t.transpose();
                const Matrix3d B = s.f * cross_matrix(u);
                Matrix3d uu = Matrix3d::Zero(), uw = Matrix3d::Zero(),
                         ww = Matrix3d::Zero();
                // sum of second derivatives of p . K and of what moves with the tangent.
                const auto add_curvature = [&](const Vector3d& force)
                {
                    const Vector3d pw = force.cross(w), pu = force.cross(u);
                    const Vector3d C = s.K / s.f;
                    uu += (2.0 * s.f / l) * (t * pw.transpose() + pw * t.transpose());
                    uu += force.dot(C) * s.f / (l * l) * (8.0 * t * t.transpose());
                    uu.diagonal().array() -= 2.0 * force.dot(C) * s.f / (l * l);
                    uw -=
                        s.f * cross_matrix(force) + (2.0 * s.f / l) * t * pu.transpose();
                };
                if (is_plain_)
                {
                    const double k = b.weight * b.stiffness[0];
                    uu = A.transpose().lazyProduct(A);
                    uw = A.transpose().lazyProduct(B);
                    ww = B.transpose().lazyProduct(B);
                    if (is_exact)
                        add_curvature(s.K);
                    uu *= k;
                    uw *= k;
                    ww *= k;
                }
                else
                {
                    const auto [m1, m2] = directions(state, e, at, p);
                    const double k1 = s.K.dot(m1), k2 = s.K.dot(m2);
                    const double Y1 = b.weight * b.stiffness[0],
                                 Y2 = b.weight * b.stiffness[1];
                    const double S1 = Y1 * (k1 - b.rest[0]), S2 = Y2 * (k2 - b.rest[1]);
                    const Local spin = spin_form(span, at, p);
                    const auto form = [&](const Vector3d& m)
                    {
                        Local v = Local::Zero();
                        const Vector3d on_u = A.transpose() * m, on_w = B.transpose() * m;
                        for (int j = 0; j < M; ++j)
                            v.template segment<3>(3 * j) =
                                c1[idx(j)] * on_u + c2[idx(j)] * on_w;
                        return v;
                    };
                    const Local K1 = form(m1), K2 = form(m2);
                    add_square(K1 + k2 * spin, Y1);
                    add_square(K2 - k1 * spin, Y2);
                    if (is_exact)
                    {
                        const Vector3d force = S1 * m1 + S2 * m2;
                        add_curvature(force);
                        uu += (force * s.K.transpose() + s.K * force.transpose()) /
                              (2.0 * l * l);
                        const double turn = S1 * k2 - S2 * k1;
                        for (int k = 0; k < kPlaces; ++k)
                            hop_force[idx(k)] +=
                                turn * (b.place * hop_share(k) - (k < p + 1 ? 1.0 : 0.0));
                        // 2 (r . dK) dphi = 1/2 [(r.dK + dphi)^2 - (r.dK - dphi)^2]
                        const Local rK = S1 * K2 - S2 * K1;
                        const double scale = std::sqrt(std::max(rK.norm(), 1e-300) /
                                                       std::max(spin.norm(), 1e-300));
                        add_square(rK / scale + scale * spin, 0.5);
                        add_square(rK / scale - scale * spin, -0.5);
                        add_square(spin, -(S1 * k1 + S2 * k2));
                    }
                }
                blocks.uu[idx(p) + 1] = uu;
                blocks.uw[idx(p)] = uw;
                blocks.ww[idx(p)] = ww;
            }
            if (is_exact)
                add_hops(at, hops, hop_force, blocks);
            blocks.spread(span, H);
            add_to_band(span, H, out);
        }
    }

    void predict(const RodState& state, const Eigen::VectorXd* step) override
    {
        is_predicted_ = step != nullptr;
        if (!step)
            return;
        for (std::size_t e = 0; e < spans_.size(); ++e)
        {
            const Span& span = spans_[e];
            const Look at = look(state, span, e);
            for (int k = 0; k < span.num_stretch; ++k)
            {
                Stretch& s = stretch_[idx(span.first_stretch + k)];
                const Vector3d u = velocity(at, s);
                const double l = u.norm();
                s.force = s.weight * (l / s.sigma - 1.0 +
                                      u.dot(change(span, s, *step)) / (l * s.sigma));
            }
        }
    }

    void add_correction(const RodState& before, const RodState& after,
                        const Eigen::VectorXd& step, Eigen::VectorXd& out) const override
    {
        if (!parts_.has_stretch)
            return;
        for (std::size_t e = 0; e < spans_.size(); ++e)
        {
            const Span& span = spans_[e];
            const Look old = look(before, span, e), now = look(after, span, e);
            for (int k = 0; k < span.num_stretch; ++k)
            {
                const Stretch& s = stretch_[idx(span.first_stretch + k)];
                const Vector3d u = velocity(old, s);
                const double l = u.norm();
                const double left = strain(now, s) - strain(old, s) -
                                    u.dot(change(span, s, step)) / (l * s.sigma);
                const Vector3d pull = -s.weight * left / (l * s.sigma) * u;
                for (int j = 0; j < M; ++j)
                    out.template segment<3>(span.control[idx(j)]) +=
                        s.first[idx(j)] * pull;
            }
        }
    }

private:
    static double square(double x) { return x * x; }

    void add_stretch(std::size_t e, double h)
    {
        const RodSpan& of = rod_.spans()[e];
        // As many points as u has dimensions: one a span, more at ends and unsmooth
        // knots.
        const int degree = rod_.basis().degree();
        const int num_ends = !of.is_smooth[0] + !of.is_smooth[1];
        const int count = num_ends == 0   ? 1
                          : num_ends == 1 ? (degree + 2) / 2
                                          : std::min(degree, kMaxGaussPlaces);
        Span& span = spans_[e];
        span.first_stretch = static_cast<int>(stretch_.size());
        span.num_stretch = count;
        const std::span<const double> places = gauss_places(count),
                                      weights = gauss_weights(count);
        for (int k = 0; k < count; ++k)
        {
            const double at = of.begin + places[idx(k)] * h;
            const BasisValues values = rod_.basis().values_in(static_cast<int>(e), at);
            Stretch s;
            std::copy_n(values.value[1].begin(), M, s.first.begin());
            s.sigma = rod_.rest().combined(values).first.norm();
            s.weight = weights[idx(k)] * h * s.sigma * rod_.section_at(at).stretch;
            stretch_.push_back(s);
        }
    }

    Look look(const RodState& state, const Span& span, std::size_t e) const
    {
        Look at;
        for (int j = 0; j < M; ++j)
            at.q[idx(j)] = state.x().template segment<3>(span.control[idx(j)]);
        at.at = state.velocities(e);
        for (int g = 0; g < kInside; ++g)
        {
            Vector3d w = Vector3d::Zero();
            for (int j = 0; j < M; ++j)
                w += span.second[idx(g)][idx(j)] * at.q[idx(j)];
            at.w[idx(g)] = w;
        }
        return at;
    }

    Vector3d velocity(const Look& at, const Stretch& s) const
    {
        Vector3d u = Vector3d::Zero();
        for (int j = 0; j < M; ++j)
            u += s.first[idx(j)] * at.q[idx(j)];
        return u;
    }
    double strain(const Look& at, const Stretch& s) const
    {
        return velocity(at, s).norm() / s.sigma - 1.0;
    }
    /// du at a place of stretch by a step.
    Vector3d change(const Span& span, const Stretch& s, const Eigen::VectorXd& step) const
    {
        Vector3d du = Vector3d::Zero();
        for (int j = 0; j < M; ++j)
            du += s.first[idx(j)] * step.template segment<3>(span.control[idx(j)]);
        return du;
    }

    Strain strain_of(const Look& at, const Span& span, int g) const
    {
        const auto& [u, t, l] = at.at[g + 1];
        const double f = 1.0 / (l * l * span.bending[idx(g)].sigma);
        return {f * u.cross(at.w[idx(g)]), f};
    }

    /// m_1 and m_2 at an inner place.
    std::pair<Vector3d, Vector3d> directions(const RodState& state, std::size_t e,
                                             const Look& at, int g) const
    {
        const Span& span = spans_[e];
        Vector3d a = state.reference(span.station[0]);
        for (int p = 0; p <= g; ++p)
            a = transported(at.at[p].tangent, at.at[p + 1].tangent, a);
        const double psi =
            state.angle(span.station[0]) + span.bending[idx(g)].place * state.twist(e);
        const Vector3d& t = at.at[g + 1].tangent;
        const Vector3d m1 = std::cos(psi) * a + std::sin(psi) * t.cross(a);
        return {m1, t.cross(m1)};
    }

    /// Places that a hop goes from and to: those of the chain, and at the end the one at
    /// once.
    static std::pair<int, int> ends_of_hop(int k)
    {
        return k + 1 < kPlaces ? std::pair(k, k + 1) : std::pair(0, kPlaces - 1);
    }
    void find_hops(const Look& at, std::array<Hop, kPlaces>& hops) const
    {
        for (int k = 0; k < kPlaces; ++k)
        {
            Hop& hop = hops[idx(k)];
            std::tie(hop.a, hop.b) = ends_of_hop(k);
            const Vector3d &a = at.at[hop.a].tangent, &b = at.at[hop.b].tangent;
            hop.beta = turn_of_hop(a, b);
            hop.tt = (a + b) / hop_scale(a, b);
        }
    }
    /// Of hop \p k in the winding of the span.
    double hop_share(int k) const
    {
        return (k + 1 < kPlaces ? 1.0 : -cubes_) / (1.0 - cubes_);
    }
    /// Moments on hops become forces on u.
    static void add_hops(const Look& at, Pull& pull)
    {
        for (int k = 0; k < kPlaces; ++k)
        {
            if (pull.on_hop[idx(k)] == 0.0)
                continue;
            const auto [a, b] = ends_of_hop(k);
            const Vector3d turn = 0.5 * pull.on_hop[idx(k)] *
                                  turn_of_hop(at.at[a].tangent, at.at[b].tangent);
            pull.on_u[idx(a)] += turn / at.at[a].length;
            pull.on_u[idx(b)] += turn / at.at[b].length;
        }
    }
    /// Three of each control point.
    using Forces = std::array<double, idx(3 * M)>;
    static void add_scaled(const std::array<double, M>& share, const Vector3d& force,
                           Forces& out)
    {
        for (int j = 0; j < M; ++j)
            for (int c = 0; c < 3; ++c)
                out[idx(3 * j + c)] += share[idx(j)] * force[c];
    }
    /// Forces on control points.
    static void spread(const Span& span, const Pull& pull, Forces& out)
    {
        for (int p = 0; p < kPlaces; ++p)
            add_scaled(span.first[idx(p)], pull.on_u[idx(p)], out);
        for (int g = 0; g < kInside; ++g)
            add_scaled(span.second[idx(g)], pull.on_w[idx(g)], out);
    }
    static Local form_of(const Span& span, const Look& at, Pull& pull)
    {
        add_hops(at, pull);
        Forces forces = {};
        spread(span, pull, forces);
        Local form;
        for (int i = 0; i < 3 * M; ++i)
            form[i] = forces[idx(i)];
        form[3 * M] = pull.on_near;
        form[3 * M + 1] = pull.on_far;
        return form;
    }
    /// dDelta
    Local twist_form(const Span& span, const Look& at) const
    {
        Pull pull;
        pull.add_twist(*this, 1.0);
        return form_of(span, at, pull);
    }
    /// dphi at an inner place
    Local spin_form(const Span& span, const Look& at, int g) const
    {
        Pull pull;
        pull.add_spin(*this, span.bending[idx(g)].place, g, 1.0);
        return form_of(span, at, pull);
    }

    /// The gradient of force . K by u and w.
    static void pull_back(const Look& at, int g, const Strain& s, const Vector3d& force,
                          Pull& pull)
    {
        const auto& [u, t, l] = at.at[g + 1];
        pull.on_u[idx(g) + 1] +=
            s.f * at.w[idx(g)].cross(force) - 2.0 * s.K.dot(force) / l * t;
        pull.on_w[idx(g)] -= s.f * u.cross(force);
    }

    using Square = Eigen::Matrix<double, kLocal, kLocal>;
    /// Adds the blocks (i, j) of control points, i >= j: a_i X.
    static void add_column(const std::array<double, M>& a, int j, const Matrix3d& X,
                           Square& H)
    {
        for (int c = 0; c < 3; ++c)
        {
            double* const column = &H(0, 3 * j + c);
            for (int i = j; i < M; ++i)
                for (int r = 0; r < 3; ++r)
                    column[3 * i + r] += a[idx(i)] * X(r, c);
        }
    }

    /// Second derivatives of a span where they arise: by u and w of its places, and by u
    /// of both ends of a hop.
    struct Blocks
    {
        std::array<Matrix3d, kPlaces> uu, hop;
        std::array<Matrix3d, kInside> uw, ww;
        bool bends, hops = false;

        explicit Blocks(bool has_bending) : bends(has_bending)
        {
            for (Matrix3d& block : uu)
                block.setZero();
        }
        /// Onto the control points, the lower triangle.
        void spread(const Span& span, Square& H) const
        {
            for (int p = 0; p < kPlaces; ++p)
            {
                const bool is_inside = p > 0 && p + 1 < kPlaces;
                if (!hops && !(bends && is_inside))
                    continue;
                for (int j = 0; j < M; ++j)
                {
                    Matrix3d X = span.first[idx(p)][idx(j)] * uu[idx(p)];
                    if (bends && is_inside)
                        X += span.second[idx(p) - 1][idx(j)] * uw[idx(p) - 1];
                    for (int k = 0; hops && k < kPlaces; ++k)
                    {
                        const auto [a, b] = ends_of_hop(k);
                        if (a == p)
                            X += span.first[idx(b)][idx(j)] * hop[idx(k)];
                        else if (b == p)
                            X += span.first[idx(a)][idx(j)] * hop[idx(k)].transpose();
                    }
                    add_column(span.first[idx(p)], j, X, H);
                }
            }
            for (int g = 0; bends && g < kInside; ++g)
                for (int j = 0; j < M; ++j)
                    add_column(span.second[idx(g)], j,
                               span.first[idx(g) + 1][idx(j)] * uw[idx(g)].transpose() +
                                   span.second[idx(g)][idx(j)] * ww[idx(g)],
                               H);
        }
    };

    static void add_hops(const Look& at, const std::array<Hop, kPlaces>& hops,
                         const std::array<double, kPlaces>& force, Blocks& blocks)
    {
        for (int k = 0; k < kPlaces; ++k)
        {
            blocks.hop[idx(k)].setZero();
            if (force[idx(k)] == 0.0)
                continue;
            blocks.hops = true;
            const Hop& hop = hops[idx(k)];
            const double la = at.at[hop.a].length, lb = at.at[hop.b].length;
            const auto own = [&](const Vector3d& t, double l) -> Matrix3d
            {
                const Vector3d s = t + hop.tt;
                return -force[idx(k)] / (4.0 * l * l) *
                       (hop.beta * s.transpose() + s * hop.beta.transpose());
            };
            blocks.uu[idx(hop.a)] += own(at.at[hop.a].tangent, la);
            blocks.uu[idx(hop.b)] += own(at.at[hop.b].tangent, lb);
            blocks.hop[idx(k)] =
                force[idx(k)] / (2.0 * la * lb) *
                (cross_matrix(hop.tt) -
                 0.5 * (hop.beta * hop.tt.transpose() + hop.tt * hop.beta.transpose()));
        }
    }

    /// Where the lower triangle of a span's matrix stands in the band, from the entry of
    /// its first unknown on.
    using Pattern = std::array<int, idx(kLocal*(kLocal + 1) / 2)>;

    void find_pattern(Span& span)
    {
        std::array<int, idx(kLocal)> place;
        for (int j = 0; j < M; ++j)
            for (int c = 0; c < 3; ++c)
                place[idx(3 * j + c)] = span.control[idx(j)] + c;
        place[idx(3 * M)] = span.angle[0];
        place[idx(3 * M + 1)] = span.angle[1];
        const int first = *std::min_element(place.begin(), place.end());
        const int width = rod_.layout().half_band + 1;
        Pattern pattern;
        auto next = pattern.begin();
        for (int j = 0; j < kLocal; ++j)
            for (int i = j; i < kLocal; ++i)
            {
                const auto [low, high] = std::minmax(place[idx(i)], place[idx(j)]);
                *next++ = (low - first) * width + high - low;
            }
        span.first_unknown = first;
        // Along a rod they are all alike but at its ends.
        if (patterns_.empty() || patterns_.back() != pattern)
            patterns_.push_back(pattern);
        span.pattern = patterns_.size() - 1;
    }

    void add_to_band(const Span& span, const Square& H, BandMatrix& out) const
    {
        double* const to = &out.lower(span.first_unknown, span.first_unknown);
        const int* at = patterns_[span.pattern].data();
        for (int j = 0; j < kLocal; ++j)
            for (int i = j; i < kLocal; ++i)
                to[*at++] += H(i, j);
    }

    const Rod& rod_;
    ElasticParts parts_;
    double cubes_ = 0.0;
    bool is_plain_ = false;     ///< round everywhere, and straight at rest
    bool is_predicted_ = false; ///< the stretch forces
    std::vector<Span> spans_;
    std::vector<Stretch> stretch_;
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

} // namespace cellwarp
