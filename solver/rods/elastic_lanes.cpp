// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled once for each instruction set, into the namespace CELLWARP_LANES_FOR. It uses
// no template or inline function of others: the linker keeps one copy of those, which
// could be one that not every processor understands.
//
// With A = dK/du = -f [w]x - 2/l K t^T and B = dK/dw = f [u]x, y = w x K, z = u x K:
//   A^T A = f^2 (|w|^2 I - w w^T) - (2 f / l) (y t^T + t y^T) + 4/l^2 |K|^2 t t^T
//   A^T B = f^2 (u w^T - (u . w) I) + (2 f / l) t z^T
//   B^T B = f^2 (l^2 I - u u^T)
// The rest is elasticity.cpp's.
#include "solver/rods/elastic_kernel.h"

#include "octree/base/lanes.h"

namespace cellwarp::core::CELLWARP_LANES_FOR
{

namespace
{

inline Lanes load(const SpanNumbers& numbers, int first)
{
    return load(numbers.lane + first);
}

inline void store(SpanNumbers& numbers, int first, const Lanes& value)
{
    store(numbers.lane + first, value);
}

struct Vec
{
    Lanes c[3] = {};
};

inline Vec operator+(const Vec& a, const Vec& b)
{
    return {{a.c[0] + b.c[0], a.c[1] + b.c[1], a.c[2] + b.c[2]}};
}
inline Vec operator-(const Vec& a, const Vec& b)
{
    return {{a.c[0] - b.c[0], a.c[1] - b.c[1], a.c[2] - b.c[2]}};
}
inline Vec operator*(const Lanes& s, const Vec& a)
{
    return {{s * a.c[0], s * a.c[1], s * a.c[2]}};
}
inline void operator+=(Vec& a, const Vec& b)
{
    a = a + b;
}
inline Lanes dot(const Vec& a, const Vec& b)
{
    return a.c[0] * b.c[0] + a.c[1] * b.c[1] + a.c[2] * b.c[2];
}
inline Vec cross(const Vec& a, const Vec& b)
{
    return {{a.c[1] * b.c[2] - a.c[2] * b.c[1], a.c[2] * b.c[0] - a.c[0] * b.c[2],
             a.c[0] * b.c[1] - a.c[1] * b.c[0]}};
}

struct Mat
{
    Lanes m[3][3] = {}; ///< row, column
};

/// A += s x y^T
inline void add_outer(Mat& a, const Lanes& s, const Vec& x, const Vec& y)
{
    for (int r = 0; r < 3; ++r)
    {
        const Lanes sx = s * x.c[r];
        for (int c = 0; c < 3; ++c)
            a.m[r][c] += sx * y.c[c];
    }
}
/// A += s (x y^T + y x^T)
inline void add_both(Mat& a, const Lanes& s, const Vec& x, const Vec& y)
{
    add_outer(a, s, x, y);
    add_outer(a, s, y, x);
}
inline void add_diagonal(Mat& a, const Lanes& s)
{
    for (int k = 0; k < 3; ++k)
        a.m[k][k] += s;
}
/// A += s [x]x
inline void add_cross(Mat& a, const Lanes& s, const Vec& x)
{
    const Vec sx = s * x;
    a.m[0][1] -= sx.c[2];
    a.m[0][2] += sx.c[1];
    a.m[1][0] += sx.c[2];
    a.m[1][2] -= sx.c[0];
    a.m[2][0] -= sx.c[1];
    a.m[2][1] += sx.c[0];
}
/// A += s B, and A += s B^T
inline void add(Mat& a, const Lanes& s, const Mat& b)
{
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
            a.m[r][c] += s * b.m[r][c];
}
inline void add_transposed(Mat& a, const Lanes& s, const Mat& b)
{
    for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c)
            a.m[r][c] += s * b.m[c][r];
}

/// The spans from \p l on, as many as stand side by side.
template <int M>
class Spans
{
protected:
    using Counts = ElasticCounts<M>;
    static constexpr int kLegs = Counts::kLegs, kInside = Counts::kInside,
                         kPlaces = Counts::kPlaces, kLegUnknowns = Counts::kLegUnknowns;

public:
    Spans(const ElasticKind& kind, const ElasticSpans<M>& spans,
          const ElasticPlaces<M>& places, int l)
        : kind_(kind), spans_(spans), places_(places), l_(l)
    {
        for (int j = 0; j < kLegs; ++j)
            for (int c = 0; c < 3; ++c)
                leg_[j].c[c] = load(places.leg[j][c], l);
        for (int p = 0; p < kPlaces; ++p)
        {
            u_[p] = sum(spans.first[p]);
            length_[p] = square_root(dot(u_[p], u_[p]));
            t_[p] = (1.0 / length_[p]) * u_[p];
        }
        for (int g = 0; g < kInside; ++g)
        {
            w_[g] = sum(spans.second[g]);
            const Lanes& length = length_[g + 1];
            f_[g] = 1.0 / (length * length * load(spans.sigma[g], l));
            K_[g] = f_[g] * cross(u_[g + 1], w_[g]);
        }
    }

    Lanes energy() const
    {
        Lanes out = {};
        for (int k = 0; kind_.has_stretch && k < spans_.num_stretch; ++k)
        {
            const Vec u = sum(spans_.stretch_first[k]);
            const Lanes eps = strain(k, square_root(dot(u, u)));
            out += 0.5 * load(spans_.stretch_weight[k], l_) * eps * eps;
        }
        for (int g = 0; kind_.has_bending && g < kInside; ++g)
        {
            if (kind_.is_plain)
            {
                out += 0.5 * load(spans_.stiffness[g][0], l_) * dot(K_[g], K_[g]);
                continue;
            }
            Vec m[2];
            find_directions(g, m);
            for (int i = 0; i < 2; ++i)
            {
                const Lanes bend = dot(K_[g], m[i]) - load(spans_.rest[g][i], l_);
                out += 0.5 * load(spans_.stiffness[g][i], l_) * bend * bend;
            }
        }
        if (kind_.has_twist)
        {
            const Lanes turn = load(places_.twist, l_) - load(spans_.rest_twist, l_);
            out += 0.5 * load(spans_.twist_stiffness, l_) * turn * turn;
        }
        return out;
    }

    void find_strains(ElasticStrains<M>& out) const
    {
        for (int k = 0; k < spans_.num_stretch; ++k)
        {
            const Vec u = sum(spans_.stretch_first[k]);
            store(out.stretch[k], l_,
                  square_root(dot(u, u)) / load(spans_.stretch_sigma[k], l_) - 1.0);
        }
        for (int g = 0; g < kInside; ++g)
        {
            Vec m[2];
            find_directions(g, m);
            for (int i = 0; i < 2; ++i)
                store(out.curvature[g][i], l_, dot(K_[g], m[i]));
        }
        store(out.twist, l_, load(places_.twist, l_));
    }

    void find_rates(const ElasticRates<M>& velocity, ElasticStrains<M>& out) const
    {
        const auto along = [&](const Form& form)
        {
            Lanes rate = {};
            for (int n = 0; n < kLegUnknowns; ++n)
                rate += form.v[n] * load(velocity.of[n], l_);
            return rate;
        };
        for (int k = 0; k < spans_.num_stretch; ++k)
        {
            const Vec u = sum(spans_.stretch_first[k]);
            Form form;
            add_to_legs(
                spans_.stretch_first[k],
                (1.0 / (square_root(dot(u, u)) * load(spans_.stretch_sigma[k], l_))) * u,
                form);
            store(out.stretch[k], l_, along(form));
        }
        Pull turn;
        add_twist(Lanes{} + 1.0, turn);
        store(out.twist, l_, along(form_of(turn)));
        for (int g = 0; g < kInside; ++g)
        {
            Vec m[2];
            Lanes kappa[2];
            Form bends[2], spin;
            find_directions(g, m);
            for (int i = 0; i < 2; ++i)
                kappa[i] = dot(K_[g], m[i]);
            find_bends(g, m, bends, spin);
            for (int i = 0; i < 2; ++i)
                store(out.curvature[g][i], l_,
                      along(bends[i]) + (i == 0 ? kappa[1] : -kappa[0]) * along(spin));
        }
    }

    void find_gradient(SpanNumbers* out) const
    {
        Form force;
        for (int k = 0; kind_.has_stretch && k < spans_.num_stretch; ++k)
        {
            const Lanes sigma = load(spans_.stretch_sigma[k], l_);
            const Vec u = sum(spans_.stretch_first[k]);
            const Lanes length = square_root(dot(u, u));
            const Lanes pull =
                load(spans_.stretch_weight[k], l_) * strain(k, length) / (sigma * length);
            add_to_legs(spans_.stretch_first[k], pull * u, force);
        }
        Pull pull;
        if (kind_.has_twist)
            add_twist(moment(), pull);
        for (int g = 0; kind_.has_bending && g < kInside; ++g)
        {
            if (kind_.is_plain)
            {
                pull_back(g, load(spans_.stiffness[g][0], l_) * K_[g], pull);
                continue;
            }
            Vec m[2];
            find_directions(g, m);
            Lanes kappa[2], S[2];
            find_forces(g, m, kappa, S);
            pull_back(g, S[0] * m[0] + S[1] * m[1], pull);
            add_spin(g, S[0] * kappa[1] - S[1] * kappa[0], pull);
        }
        if (has_hops())
            add_hops(pull);
        spread(pull, force);
        // leg j = point j + 1 - point j
        for (int j = 0; j < M; ++j)
            for (int c = 0; c < 3; ++c)
            {
                Lanes sum_here = {};
                if (j > 0)
                    sum_here += force.v[3 * (j - 1) + c];
                if (j < kLegs)
                    sum_here -= force.v[3 * j + c];
                store(out[3 * j + c], l_, sum_here);
            }
        for (int a = 0; a < 2; ++a)
            store(out[3 * M + a], l_, force.v[3 * kLegs + a]);
    }

protected:
    /// A linear form of legs and angles.
    struct Form
    {
        Lanes v[kLegUnknowns] = {};
    };
    /// Forces on a span, gathered where they act.
    struct Pull
    {
        Vec on_u[kPlaces], on_w[kInside];
        Lanes on_hop[kPlaces] = {}, on_near = {}, on_far = {}; ///< moments
    };

    bool has_hops() const
    {
        return kind_.has_twist || (kind_.has_bending && !kind_.is_plain);
    }
    Vec sum(const SpanNumbers* share) const
    {
        Vec out;
        for (int j = 0; j < kLegs; ++j)
            out += load(share[j], l_) * leg_[j];
        return out;
    }
    /// The strain of a stretch place, less that at rest.
    Lanes strain(int k, const Lanes& length) const
    {
        return length / load(spans_.stretch_sigma[k], l_) - 1.0 -
               load(spans_.stretch_rest[k], l_);
    }
    void add_to_legs(const SpanNumbers* share, const Vec& force, Form& out) const
    {
        for (int j = 0; j < kLegs; ++j)
        {
            const Lanes x = load(share[j], l_);
            for (int c = 0; c < 3; ++c)
                out.v[3 * j + c] += x * force.c[c];
        }
    }
    Lanes moment() const
    {
        return load(spans_.twist_stiffness, l_) *
               (load(places_.twist, l_) - load(spans_.rest_twist, l_));
    }

    /// Places that a hop goes from and to: those of the chain, and at the end the one at
    /// once.
    static constexpr int from(int k) { return k + 1 < kPlaces ? k : 0; }
    static constexpr int to(int k) { return k + 1 < kPlaces ? k + 1 : kPlaces - 1; }
    Lanes scale(int a, int b) const
    {
        return larger(1.0 + dot(t_[a], t_[b]), Lanes{} + 1e-12);
    }
    /// Of hop \p k in the winding of the span.
    double hop_share(int k) const
    {
        return (k + 1 < kPlaces ? 1.0 : -kind_.cubes) / (1.0 - kind_.cubes);
    }

    /// m_1 and m_2 at an inner place.
    void find_directions(int g, Vec* m) const
    {
        Vec a;
        for (int c = 0; c < 3; ++c)
            a.c[c] = load(places_.reference[c], l_);
        for (int p = 0; p <= g; ++p)
        {
            const Lanes size = scale(p, p + 1);
            const Lanes share = dot(t_[p + 1], a) / size;
            a = a - (size > 1e-12 ? share : Lanes{}) * (t_[p] + t_[p + 1]);
        }
        const Vec& t = t_[g + 1];
        m[0] =
            load(places_.turn[g][0], l_) * a + load(places_.turn[g][1], l_) * cross(t, a);
        m[1] = cross(t, m[0]);
    }
    void find_forces(int g, const Vec* m, Lanes* kappa, Lanes* S) const
    {
        for (int i = 0; i < 2; ++i)
        {
            kappa[i] = dot(K_[g], m[i]);
            S[i] = load(spans_.stiffness[g][i], l_) *
                   (kappa[i] - load(spans_.rest[g][i], l_));
        }
    }

    void add_twist(const Lanes& at_work, Pull& pull) const
    {
        for (int k = 0; k < kPlaces; ++k)
            pull.on_hop[k] += at_work * hop_share(k);
        pull.on_near -= at_work;
        pull.on_far += at_work;
    }
    /// On the spin at an inner place.
    void add_spin(int g, const Lanes& at_work, Pull& pull) const
    {
        add_twist(at_work * kind_.place[g], pull);
        for (int k = 0; k <= g; ++k)
            pull.on_hop[k] -= at_work;
        pull.on_near += at_work;
    }
    /// Moments on hops become forces on u.
    void add_hops(Pull& pull) const
    {
        for (int k = 0; k < kPlaces; ++k)
        {
            const int a = from(k), b = to(k);
            const Vec turn = (pull.on_hop[k] / scale(a, b)) * cross(t_[a], t_[b]);
            pull.on_u[a] += (1.0 / length_[a]) * turn;
            pull.on_u[b] += (1.0 / length_[b]) * turn;
        }
    }
    /// The gradient of force . K by u and w.
    void pull_back(int g, const Vec& force, Pull& pull) const
    {
        const Vec &u = u_[g + 1], &t = t_[g + 1];
        pull.on_u[g + 1] +=
            f_[g] * cross(w_[g], force) - (2.0 * dot(K_[g], force) / length_[g + 1]) * t;
        pull.on_w[g] += f_[g] * cross(force, u);
    }
    void spread(const Pull& pull, Form& out) const
    {
        for (int p = 0; p < kPlaces; ++p)
            add_to_legs(spans_.first[p], pull.on_u[p], out);
        for (int g = 0; g < kInside; ++g)
            add_to_legs(spans_.second[g], pull.on_w[g], out);
        out.v[3 * kLegs] += pull.on_near;
        out.v[3 * kLegs + 1] += pull.on_far;
    }
    Form form_of(Pull& pull) const
    {
        add_hops(pull);
        Form out;
        spread(pull, out);
        return out;
    }
    /// m_i . dK, and the spin dphi, at an inner place.
    void find_bends(int g, const Vec* m, Form* of_K, Form& spin) const
    {
        Pull pull;
        add_spin(g, Lanes{} + 1.0, pull);
        spin = form_of(pull);
        for (int i = 0; i < 2; ++i)
        {
            Pull along;
            pull_back(g, m[i], along);
            add_to_legs(spans_.first[g + 1], along.on_u[g + 1], of_K[i]);
            add_to_legs(spans_.second[g], along.on_w[g], of_K[i]);
        }
    }

    const ElasticKind& kind_;
    const ElasticSpans<M>& spans_;
    const ElasticPlaces<M>& places_;
    int l_;
    Vec leg_[kLegs];
    Vec u_[kPlaces], t_[kPlaces];
    Lanes length_[kPlaces];
    Vec w_[kInside], K_[kInside];
    Lanes f_[kInside];
};

/// Their second derivatives.
template <int M>
class CurvedSpans : Spans<M>
{
    using Of = Spans<M>;
    using Of::from, Of::to, Of::scale, Of::sum;
    using Of::kind_, Of::spans_, Of::places_, Of::l_;
    using Of::kInside, Of::kLegs, Of::kLegUnknowns, Of::kPlaces;
    using Of::u_, Of::t_, Of::length_, Of::w_, Of::K_, Of::f_;
    using typename Of::Form, typename Of::Pull;

public:
    using Of::Of;

    void find_hessian(RodHessian how, SpanNumbers* out)
    {
        const bool is_exact = how != RodHessian::Definite;
        if (kind_.has_stretch)
            add_stretch(how);
        Lanes hop_force[kPlaces] = {};
        if (this->has_hops())
            find_hops();
        if (kind_.has_twist)
        {
            Pull pull;
            this->add_twist(Lanes{} + 1.0, pull);
            add_square(this->form_of(pull), load(spans_.twist_stiffness, l_));
            const Lanes at_work = this->moment();
            for (int k = 0; k < kPlaces; ++k)
                hop_force[k] += at_work * this->hop_share(k);
        }
        for (int g = 0; kind_.has_bending && g < kInside; ++g)
        {
            if (kind_.is_plain)
                add_plain_bending(g, is_exact);
            else
                add_bending(g, is_exact, hop_force);
        }
        if (is_exact && this->has_hops())
            add_hop_blocks(hop_force);
        spread_blocks();
        write(out);
    }

private:
    static constexpr int entry(int i, int j) // i >= j
    {
        return j * kLegUnknowns - j * (j - 1) / 2 + i - j;
    }
    void add_square(const Form& a, const Lanes& x)
    {
        for (int j = 0; j < kLegUnknowns; ++j)
        {
            const Lanes y = x * a.v[j];
            for (int i = j; i < kLegUnknowns; ++i)
                H_[entry(i, j)] += y * a.v[i];
        }
    }
    /// H += a b^T + b a^T
    void add_both_forms(const Form& a, const Form& b)
    {
        for (int j = 0; j < kLegUnknowns; ++j)
            for (int i = j; i < kLegUnknowns; ++i)
                H_[entry(i, j)] += a.v[i] * b.v[j] + b.v[i] * a.v[j];
    }
    /// Adds share_i X to the blocks (i, j) of legs, i >= j.
    void add_column(const SpanNumbers* share, int j, const Mat& X)
    {
        for (int i = j; i < kLegs; ++i)
        {
            const Lanes x = load(share[i], l_);
            for (int c = 0; c < 3; ++c)
                for (int r = i == j ? c : 0; r < 3; ++r)
                    H_[entry(3 * i + r, 3 * j + c)] += x * X.m[r][c];
        }
    }
    void add_stretch(RodHessian how)
    {
        for (int k = 0; k < spans_.num_stretch; ++k)
        {
            const SpanNumbers* const share = spans_.stretch_first[k];
            const Lanes sigma = load(spans_.stretch_sigma[k], l_),
                        weight = load(spans_.stretch_weight[k], l_);
            const Vec u = sum(share);
            const Lanes length = square_root(dot(u, u));
            Lanes force = kind_.is_predicted ? load(places_.force[k], l_)
                                             : weight * this->strain(k, length);
            if (how != RodHessian::Exact)
                force = larger(force, Lanes{});
            const Lanes across = force / (length * sigma);
            Mat B;
            add_diagonal(B, across);
            const Vec t = (1.0 / length) * u;
            add_outer(B, weight / (sigma * sigma) - across, t, t);
            for (int j = 0; j < kLegs; ++j)
            {
                Mat X;
                add(X, load(share[j], l_), B);
                add_column(share, j, X);
            }
        }
    }
    void find_hops()
    {
        for (int k = 0; k < kPlaces; ++k)
        {
            const Lanes inverse = 1.0 / scale(from(k), to(k));
            beta_[k] = (2.0 * inverse) * cross(t_[from(k)], t_[to(k)]);
            tt_[k] = inverse * (t_[from(k)] + t_[to(k)]);
        }
    }
    /// Second derivatives of p . K, and of what moves with the tangent.
    void add_curvature(int g, const Vec& force)
    {
        const Vec &u = u_[g + 1], &w = w_[g], &t = t_[g + 1];
        const Lanes &length = length_[g + 1], &f = f_[g];
        const Lanes gain = 2.0 * f / length,
                    turned = 2.0 * dot(force, K_[g]) / (length * length);
        Mat &uu = uu_[g + 1], &uw = uw_[g];
        add_both(uu, gain, t, cross(force, w));
        add_outer(uu, 4.0 * turned, t, t);
        add_diagonal(uu, -turned);
        add_cross(uw, -f, force);
        add_outer(uw, -gain, t, cross(force, u));
    }
    void add_plain_bending(int g, bool is_exact)
    {
        const Vec &u = u_[g + 1], &w = w_[g], &t = t_[g + 1], &K = K_[g];
        const Lanes &length = length_[g + 1], &f = f_[g];
        const Lanes stiffness = load(spans_.stiffness[g][0], l_);
        const Lanes k_f2 = stiffness * f * f, gain = 2.0 * stiffness * f / length;
        Mat &uu = uu_[g + 1], &uw = uw_[g], &ww = ww_[g];
        add_diagonal(uu, k_f2 * dot(w, w));
        add_outer(uu, -k_f2, w, w);
        add_both(uu, -gain, cross(w, K), t);
        add_outer(uu, 4.0 * stiffness * dot(K, K) / (length * length), t, t);
        add_diagonal(uw, -k_f2 * dot(u, w));
        add_outer(uw, k_f2, u, w);
        add_outer(uw, gain, t, cross(u, K));
        add_diagonal(ww, k_f2 * length * length);
        add_outer(ww, -k_f2, u, u);
        if (is_exact)
            add_curvature(g, stiffness * K);
    }
    void add_bending(int g, bool is_exact, Lanes* hop_force)
    {
        const Vec& K = K_[g];
        const Lanes& length = length_[g + 1];
        Vec m[2];
        this->find_directions(g, m);
        Lanes kappa[2], S[2];
        this->find_forces(g, m, kappa, S);
        Form of_K[2], spin;
        this->find_bends(g, m, of_K, spin);
        for (int i = 0; i < 2; ++i)
        {
            const Lanes turn = i == 0 ? kappa[1] : -kappa[0];
            Form whole = of_K[i];
            for (int n = 0; n < kLegUnknowns; ++n)
                whole.v[n] += turn * spin.v[n];
            add_square(whole, load(spans_.stiffness[g][i], l_));
        }
        if (!is_exact)
            return;
        const Vec force = S[0] * m[0] + S[1] * m[1];
        add_curvature(g, force);
        add_both(uu_[g + 1], 0.5 / (length * length), force, K);
        const Lanes turn = S[0] * kappa[1] - S[1] * kappa[0];
        for (int k = 0; k < kPlaces; ++k)
            hop_force[k] +=
                turn * (kind_.place[g] * this->hop_share(k) - (k <= g ? 1.0 : 0.0));
        // 2 (r . dK) dphi - (S_1 kappa_1 + S_2 kappa_2) dphi^2
        const Lanes half = -0.5 * (S[0] * kappa[0] + S[1] * kappa[1]);
        Form r;
        for (int n = 0; n < kLegUnknowns; ++n)
            r.v[n] = S[0] * of_K[1].v[n] - S[1] * of_K[0].v[n] + half * spin.v[n];
        add_both_forms(r, spin);
    }
    void add_hop_blocks(const Lanes* force)
    {
        for (int k = 0; k < kPlaces; ++k)
        {
            const int a = from(k), b = to(k);
            const Lanes &la = length_[a], &lb = length_[b];
            add_both(uu_[a], -0.25 * force[k] / (la * la), beta_[k], t_[a] + tt_[k]);
            add_both(uu_[b], -0.25 * force[k] / (lb * lb), beta_[k], t_[b] + tt_[k]);
            const Lanes across = 0.5 * force[k] / (la * lb);
            add_cross(hop_[k], across, tt_[k]);
            add_both(hop_[k], -0.5 * across, beta_[k], tt_[k]);
        }
        are_hops_exact_ = true;
    }
    /// From derivatives by u and w of places to those by legs.
    void spread_blocks()
    {
        for (int p = 0; p < kPlaces; ++p)
        {
            const bool is_inside = p > 0 && p + 1 < kPlaces && kind_.has_bending;
            if (!are_hops_exact_ && !is_inside)
                continue;
            for (int j = 0; j < kLegs; ++j)
            {
                Mat X;
                add(X, load(spans_.first[p][j], l_), uu_[p]);
                if (is_inside)
                    add(X, load(spans_.second[p - 1][j], l_), uw_[p - 1]);
                for (int k = 0; are_hops_exact_ && k < kPlaces; ++k)
                {
                    if (from(k) == p)
                        add(X, load(spans_.first[to(k)][j], l_), hop_[k]);
                    else if (to(k) == p)
                        add_transposed(X, load(spans_.first[from(k)][j], l_), hop_[k]);
                }
                add_column(spans_.first[p], j, X);
            }
        }
        for (int g = 0; kind_.has_bending && g < kInside; ++g)
            for (int j = 0; j < kLegs; ++j)
            {
                Mat X;
                add_transposed(X, load(spans_.first[g + 1][j], l_), uw_[g]);
                add(X, load(spans_.second[g][j], l_), ww_[g]);
                add_column(spans_.second[g], j, X);
            }
    }
    Lanes symmetric(int i, int j) const { return H_[i >= j ? entry(i, j) : entry(j, i)]; }
    /// From legs to control points.
    void write(SpanNumbers* out) const
    {
        for (int j = 0; j < M; ++j)
            for (int c = 0; c < 3; ++c)
            {
                for (int i = j; i < M; ++i)
                    for (int r = i == j ? c : 0; r < 3; ++r)
                    {
                        Lanes x = {};
                        if (i > 0 && j > 0)
                            x += symmetric(3 * (i - 1) + r, 3 * (j - 1) + c);
                        if (i > 0 && j < kLegs)
                            x -= symmetric(3 * (i - 1) + r, 3 * j + c);
                        if (i < kLegs && j > 0)
                            x -= symmetric(3 * i + r, 3 * (j - 1) + c);
                        if (i < kLegs && j < kLegs)
                            x += symmetric(3 * i + r, 3 * j + c);
                        store(*out++, l_, x);
                    }
                for (int a = 0; a < 2; ++a)
                {
                    Lanes x = {};
                    if (j > 0)
                        x += symmetric(3 * kLegs + a, 3 * (j - 1) + c);
                    if (j < kLegs)
                        x -= symmetric(3 * kLegs + a, 3 * j + c);
                    store(*out++, l_, x);
                }
            }
        store(*out++, l_, symmetric(3 * kLegs, 3 * kLegs));
        store(*out++, l_, symmetric(3 * kLegs + 1, 3 * kLegs));
        store(*out++, l_, symmetric(3 * kLegs + 1, 3 * kLegs + 1));
    }

    Lanes H_[kLegUnknowns * (kLegUnknowns + 1) / 2] = {};
    Mat uu_[kPlaces], uw_[kInside], ww_[kInside]; ///< by u and w of a place
    Mat hop_[kPlaces];                            ///< by u of both ends of a hop
    Vec beta_[kPlaces], tt_[kPlaces];
    bool are_hops_exact_ = false;
};

template <int M>
void energy(const ElasticKind& kind, const ElasticSpans<M>& spans,
            const ElasticPlaces<M>& places, SpanNumbers& out)
{
    for (int l = 0; l < spans.count; l += CELLWARP_WIDTH)
        store(out, l, Spans<M>(kind, spans, places, l).energy());
}

template <int M>
void strains(const ElasticKind& kind, const ElasticSpans<M>& spans,
             const ElasticPlaces<M>& places, ElasticStrains<M>& out)
{
    for (int l = 0; l < spans.count; l += CELLWARP_WIDTH)
        Spans<M>(kind, spans, places, l).find_strains(out);
}

template <int M>
void rates(const ElasticKind& kind, const ElasticSpans<M>& spans,
           const ElasticPlaces<M>& places, const ElasticRates<M>& velocity,
           ElasticStrains<M>& out)
{
    for (int l = 0; l < spans.count; l += CELLWARP_WIDTH)
        Spans<M>(kind, spans, places, l).find_rates(velocity, out);
}

template <int M>
void gradient(const ElasticKind& kind, const ElasticSpans<M>& spans,
              const ElasticPlaces<M>& places, SpanNumbers* out)
{
    for (int l = 0; l < spans.count; l += CELLWARP_WIDTH)
        Spans<M>(kind, spans, places, l).find_gradient(out);
}

template <int M>
void hessian(const ElasticKind& kind, RodHessian how, const ElasticSpans<M>& spans,
             const ElasticPlaces<M>& places, SpanNumbers* out)
{
    for (int l = 0; l < spans.count; l += CELLWARP_WIDTH)
        CurvedSpans<M>(kind, spans, places, l).find_hessian(how, out);
}

template <int M>
constexpr ElasticKernels<M> kKernels = {energy<M>, strains<M>, rates<M>, gradient<M>,
                                        hessian<M>};

} // namespace

void kernels(ElasticKernels<3>& out)
{
    out = kKernels<3>;
}
void kernels(ElasticKernels<4>& out)
{
    out = kKernels<4>;
}
void kernels(ElasticKernels<5>& out)
{
    out = kKernels<5>;
}
void kernels(ElasticKernels<6>& out)
{
    out = kKernels<6>;
}
void kernels(ElasticKernels<7>& out)
{
    out = kKernels<7>;
}
void kernels(ElasticKernels<8>& out)
{
    out = kKernels<8>;
}

} // namespace cellwarp::core::CELLWARP_LANES_FOR
