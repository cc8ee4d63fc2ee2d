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
    };

    /// What the derivatives of one span are made of.
    struct Look
    {
        std::array<Vector3d, M> q;
        std::array<Vector3d, kPlaces> u, t;
        std::array<double, kPlaces> l;
        std::array<Vector3d, kInside> w;
    };
    /// One hop from tangent to tangent.
    struct Hop
    {
        int a = 0, b = 0;
        Vector3d beta, tt;
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
                b.sigma = rest.first(e, g + 1).norm();
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
            spans_.push_back(span);
            add_stretch(e, h);
        }
        if (is_given)
            for (std::size_t e = 0; e < spans_.size(); ++e)
            {
                Span& span = spans_[e];
                const Look at = look(rest, span);
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
            const Look at = look(state, span);
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
            const Look at = look(state, span);
            Local g = Local::Zero();
            for (int k = 0; parts_.has_stretch && k < span.num_stretch; ++k)
            {
                const Stretch& s = stretch_[idx(span.first_stretch + k)];
                const Vector3d u = velocity(at, s);
                const double l = u.norm();
                const Vector3d pull = s.weight * (l / s.sigma - 1.0) / (s.sigma * l) * u;
                for (int j = 0; j < M; ++j)
                    g.template segment<3>(3 * j) += s.first[idx(j)] * pull;
            }
            std::array<Hop, kPlaces> hops;
            const double moment =
                parts_.has_twist
                    ? span.twist_stiffness * (state.twist(e) - span.rest_twist)
                    : 0.0;
            const bool needs_frames = parts_.has_bending && !is_plain_;
            Local of_twist = Local::Zero();
            if (moment != 0.0 || needs_frames)
            {
                find_hops(at, hops);
                of_twist = twist_form(span, at, hops);
                g += moment * of_twist;
            }
            for (int p = 0; parts_.has_bending && p < kInside; ++p)
            {
                const Bending& b = span.bending[idx(p)];
                const Strain s = strain_of(at, span, p);
                Vector3d on_u, on_w;
                if (is_plain_)
                {
                    pull_back(at, p, s, b.weight * b.stiffness[0] * s.K, on_u, on_w);
                }
                else
                {
                    const auto [m1, m2] = directions(state, e, at, p);
                    const double k1 = s.K.dot(m1), k2 = s.K.dot(m2);
                    const double S1 = b.weight * b.stiffness[0] * (k1 - b.rest[0]);
                    const double S2 = b.weight * b.stiffness[1] * (k2 - b.rest[1]);
                    pull_back(at, p, s, S1 * m1 + S2 * m2, on_u, on_w);
                    g += (S1 * k2 - S2 * k1) * spin_form(span, at, hops, of_twist, p);
                }
                for (int j = 0; j < M; ++j)
                    g.template segment<3>(3 * j) +=
                        span.first[idx(p) + 1][idx(j)] * on_u +
                        span.second[idx(p)][idx(j)] * on_w;
            }
            for (int j = 0; j < M; ++j)
                out.template segment<3>(span.control[idx(j)]) +=
                    g.template segment<3>(3 * j);
            out[span.angle[0]] += g[3 * M];
            out[span.angle[1]] += g[3 * M + 1];
        }
    }

    void add_hessian(const RodState& state, RodHessian how,
                     BandMatrix& out) const override
    {
        const bool is_exact = how != RodHessian::Definite;
        using Square = Eigen::Matrix<double, kLocal, kLocal>;
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
            const Look at = look(state, span);
            H.setZero();
            const auto add_block = [&H](const std::array<double, M>& a,
                                        const std::array<double, M>& b, const Matrix3d& B)
            {
                for (int j = 0; j < M; ++j)
                    for (int i = j; i < M; ++i)
                        H.template block<3, 3>(3 * i, 3 * j) +=
                            (a[idx(i)] * b[idx(j)]) * B;
            };
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
                add_block(s.first, s.first, B);
            }
            const double moment =
                parts_.has_twist
                    ? span.twist_stiffness * (state.twist(e) - span.rest_twist)
                    : 0.0;
            std::array<Hop, kPlaces> hops;
            std::array<double, kPlaces> hop_force = {};
            Local of_twist = Local::Zero();
            if (parts_.has_twist || !is_plain_)
            {
                find_hops(at, hops);
                of_twist = twist_form(span, at, hops);
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
                const Vector3d &u = at.u[idx(p) + 1], &t = at.t[idx(p) + 1],
                               &w = at.w[idx(p)];
                const double l = at.l[idx(p) + 1];
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
                    uu = A.transpose() * A;
                    uw = A.transpose() * B;
                    ww = B.transpose() * B;
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
                    const Local spin = spin_form(span, at, hops, of_twist, p);
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
                for (int j = 0; j < M; ++j)
                    for (int i = j; i < M; ++i)
                        H.template block<3, 3>(3 * i, 3 * j) +=
                            (c1[idx(i)] * c1[idx(j)]) * uu +
                            (c1[idx(i)] * c2[idx(j)]) * uw +
                            (c2[idx(i)] * c1[idx(j)]) * uw.transpose() +
                            (c2[idx(i)] * c2[idx(j)]) * ww;
            }
            if (is_exact)
                add_hops(span, at, hops, hop_force, H);
            add_to_band(span, H, out);
        }
    }

    void predict(const RodState& state, const Eigen::VectorXd* step) override
    {
        is_predicted_ = step != nullptr;
        if (!step)
            return;
        for (const Span& span : spans_)
        {
            const Look at = look(state, span);
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
        for (const Span& span : spans_)
        {
            const Look old = look(before, span), now = look(after, span);
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

    Look look(const RodState& state, const Span& span) const
    {
        Look at;
        for (int j = 0; j < M; ++j)
            at.q[idx(j)] = state.x().template segment<3>(span.control[idx(j)]);
        for (int p = 0; p < kPlaces; ++p)
        {
            Vector3d u = Vector3d::Zero();
            for (int j = 0; j < M; ++j)
                u += span.first[idx(p)][idx(j)] * at.q[idx(j)];
            at.u[idx(p)] = u;
            at.l[idx(p)] = u.norm();
            at.t[idx(p)] = u / at.l[idx(p)];
        }
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
        const double l = at.l[idx(g) + 1];
        const double f = 1.0 / (l * l * span.bending[idx(g)].sigma);
        return {f * at.u[idx(g) + 1].cross(at.w[idx(g)]), f};
    }

    /// m_1 and m_2 at an inner place.
    std::pair<Vector3d, Vector3d> directions(const RodState& state, std::size_t e,
                                             const Look& at, int g) const
    {
        const Span& span = spans_[e];
        Vector3d a = state.reference(span.station[0]);
        for (int p = 0; p <= g; ++p)
            a = transported(at.t[idx(p)], at.t[idx(p) + 1], a);
        const double psi =
            state.angle(span.station[0]) + span.bending[idx(g)].place * state.twist(e);
        const Vector3d& t = at.t[idx(g) + 1];
        const Vector3d m1 = std::cos(psi) * a + std::sin(psi) * t.cross(a);
        return {m1, t.cross(m1)};
    }

    /// The hops of the chain, and at the end the one at once.
    void find_hops(const Look& at, std::array<Hop, kPlaces>& hops) const
    {
        for (int k = 0; k < kPlaces; ++k)
        {
            Hop& hop = hops[idx(k)];
            hop.a = k + 1 < kPlaces ? k : 0;
            hop.b = k + 1 < kPlaces ? k + 1 : kPlaces - 1;
            const Vector3d &a = at.t[idx(hop.a)], &b = at.t[idx(hop.b)];
            hop.beta = turn_of_hop(a, b);
            hop.tt = (a + b) / hop_scale(a, b);
        }
    }
    /// Of hop \p k in the winding of the span.
    double hop_share(int k) const
    {
        return (k + 1 < kPlaces ? 1.0 : -cubes_) / (1.0 - cubes_);
    }

    /// out += share * dm of a hop.
    void add_hop(const Span& span, const Look& at, const Hop& hop, double share,
                 Local& out) const
    {
        const Vector3d on_a = share / (2.0 * at.l[idx(hop.a)]) * hop.beta;
        const Vector3d on_b = share / (2.0 * at.l[idx(hop.b)]) * hop.beta;
        for (int j = 0; j < M; ++j)
            out.template segment<3>(3 * j) += span.first[idx(hop.a)][idx(j)] * on_a +
                                              span.first[idx(hop.b)][idx(j)] * on_b;
    }
    /// dDelta
    Local twist_form(const Span& span, const Look& at,
                     const std::array<Hop, kPlaces>& hops) const
    {
        Local form = Local::Zero();
        for (int k = 0; k < kPlaces; ++k)
            add_hop(span, at, hops[idx(k)], hop_share(k), form);
        form[3 * M] = -1.0;
        form[3 * M + 1] = 1.0;
        return form;
    }
    /// dphi at an inner place
    Local spin_form(const Span& span, const Look& at,
                    const std::array<Hop, kPlaces>& hops, const Local& of_twist,
                    int g) const
    {
        Local form = span.bending[idx(g)].place * of_twist;
        for (int k = 0; k <= g; ++k)
            add_hop(span, at, hops[idx(k)], -1.0, form);
        form[3 * M] += 1.0;
        return form;
    }

    /// The gradient of force . K by u and w.
    void pull_back(const Look& at, int g, const Strain& s, const Vector3d& force,
                   Vector3d& on_u, Vector3d& on_w) const
    {
        const Vector3d &u = at.u[idx(g) + 1], &t = at.t[idx(g) + 1], &w = at.w[idx(g)];
        on_u = s.f * w.cross(force) - 2.0 * s.K.dot(force) / at.l[idx(g) + 1] * t;
        on_w = -s.f * u.cross(force);
    }

    template <class Square>
    void add_hops(const Span& span, const Look& at, const std::array<Hop, kPlaces>& hops,
                  const std::array<double, kPlaces>& force, Square& H) const
    {
        for (int k = 0; k < kPlaces; ++k)
        {
            if (force[idx(k)] == 0.0)
                continue;
            const Hop& hop = hops[idx(k)];
            const double la = at.l[idx(hop.a)], lb = at.l[idx(hop.b)];
            const auto own = [&](const Vector3d& t, double l) -> Matrix3d
            {
                const Vector3d s = t + hop.tt;
                return -force[idx(k)] / (4.0 * l * l) *
                       (hop.beta * s.transpose() + s * hop.beta.transpose());
            };
            const Matrix3d aa = own(at.t[idx(hop.a)], la), bb = own(at.t[idx(hop.b)], lb);
            const Matrix3d ab =
                force[idx(k)] / (2.0 * la * lb) *
                (cross_matrix(hop.tt) -
                 0.5 * (hop.beta * hop.tt.transpose() + hop.tt * hop.beta.transpose()));
            const std::array<double, M>&ca = span.first[idx(hop.a)],
                                     &cb = span.first[idx(hop.b)];
            for (int j = 0; j < M; ++j)
                for (int i = j; i < M; ++i)
                    H.template block<3, 3>(3 * i, 3 * j) +=
                        (ca[idx(i)] * ca[idx(j)]) * aa + (ca[idx(i)] * cb[idx(j)]) * ab +
                        (cb[idx(i)] * ca[idx(j)]) * ab.transpose() +
                        (cb[idx(i)] * cb[idx(j)]) * bb;
        }
    }

    template <class Square>
    void add_to_band(const Span& span, const Square& H, BandMatrix& out) const
    {
        std::array<int, kLocal> place;
        for (int j = 0; j < M; ++j)
            for (int c = 0; c < 3; ++c)
                place[idx(3 * j + c)] = span.control[idx(j)] + c;
        place[idx(3 * M)] = span.angle[0];
        place[idx(3 * M + 1)] = span.angle[1];
        for (int j = 0; j < kLocal; ++j)
            for (int i = j; i < kLocal; ++i)
                out.add(place[idx(i)], place[idx(j)], H(i, j));
    }

    const Rod& rod_;
    ElasticParts parts_;
    double cubes_ = 0.0;
    bool is_plain_ = false;     ///< round everywhere, and straight at rest
    bool is_predicted_ = false; ///< the stretch forces
    std::vector<Span> spans_;
    std::vector<Stretch> stretch_;
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
