// SPDX-License-Identifier: GPL-3.0-or-later
// With the legs d_k = q_k+1 - q_k of the control polygon, u = P' = sum c_k d_k, where
// c_k = -sum_{j <= k} b'_j. l^2 = u . u is of second degree in them and
// eps = 1/2 (l^2 / sigma^2 - 1), so that the energy is of fourth degree:
//   U = 1/8 [ sum N_ijkl (d_i . d_j)(d_k . d_l) - 2 sum N_ij d_i . d_j + int YA sigma ds
//   ] N_ijkl = int YA c_i c_j c_k c_l / sigma^3 ds,   N_ij = int YA c_i c_j / sigma ds
// The integrals do not change. [Nocent01] writes this in the control points themselves;
// there the terms grow with the fourth power of their distance from the origin, and
// cancel. Legs are short, and one fewer of them acts at a place.
//
// An entry of the packed tensor stands for all orders of its indices, p in number; with
// w = p N / 3 and positions 0 ... 3 it gives
//   w/8 [ (d_0.d_1)(d_2.d_3) + (d_0.d_2)(d_1.d_3) + (d_0.d_3)(d_1.d_2) ].
// By position x, the other three being y, z, v:
//   gradient   w/8 [ d_y (d_z.d_v) + d_z (d_y.d_v) + d_v (d_y.d_z) ]
//   second derivatives by x and y   w/8 [ (d_z.d_v) I + d_z d_v^T + d_v d_z^T ]
// Positions that are one leg add up.
#include "solver/rods/tensor_stretch.h"

#include <algorithm>
#include <cmath>

#include "solver/rods/gauss.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Exact for cubics that pass through their length evenly, and nearly so for others.
constexpr int kCount = 5;

/// In how many orders a, b, c, d can stand. \pre ascending
int num_orders(int a, int b, int c, int d)
{
    int orders = 24, run = 1;
    const int all[4] = {a, b, c, d};
    for (int k = 1; k < 4; ++k)
    {
        run = all[k] == all[k - 1] ? run + 1 : 1;
        orders /= run;
    }
    return orders;
}

class TensorStretch final : public RodTerm
{
public:
    explicit TensorStretch(const Rod& rod) : rod_(rod), tensor_(0, 0, false) { find(); }

    double value(const RodState& state) const override;
    double cancelled() const override { return constant_; }
    void add_gradient(const RodState& state, Eigen::VectorXd& out) const override;
    void add_hessian(const RodState& state, RodHessian how,
                     BandMatrix& out) const override;

    void follow(const RodChange&) override { find(); }

private:
    /// One place of quadrature.
    struct Place
    {
        std::size_t span = 0;
        std::array<double, kMaxOrder> share = {}; ///< c_k of its legs
        double sigma = 0.0, weight = 0.0;         ///< YA W [N]
    };
    /// A leg and those behind it that act together with it, and their products.
    struct Window
    {
        int count = 0;
        std::array<Vector3d, kMaxOrder> leg;
        std::array<std::array<double, kMaxOrder>, kMaxOrder> dot;
    };
    /// How many legs act at a place.
    int order() const { return rod_.order() - 1; }
    int num_legs() const
    {
        return rod_.num_controls() - (rod_.basis().is_closed() ? 0 : 1);
    }
    /// First unknown of the control point where a leg begins; that of the next one is
    /// where it ends.
    int begin_of(int leg) const
    {
        return rod_.layout().control[idx(leg % rod_.num_controls())];
    }
    Vector3d leg(const RodState& state, int k) const
    {
        return state.x().segment<3>(begin_of(k + 1)) - state.x().segment<3>(begin_of(k));
    }
    void find();
    void add_span(std::size_t span);
    void add_block(int j, int k, const Matrix3d& B, BandMatrix& out) const;
    Window window(const RodState& state, int i) const;
    /// each(w / 8, {0, a, b, c}) for the entries that begin with i.
    template <class Each>
    void for_each_entry(int i, const Each& each) const;
    double& pair(int i, int offset)
    {
        return pairs_[idx(i) * idx(order()) + idx(offset)];
    }
    double pair(int i, int offset) const
    {
        return pairs_[idx(i) * idx(order()) + idx(offset)];
    }

    const Rod& rod_;
    std::vector<Place> places_;
    PackedTensor tensor_;
    std::vector<double> pairs_; ///< N_ij of i and what stands behind it
    double constant_ = 0.0;     ///< int YA sigma ds [N m]
};

void TensorStretch::find()
{
    tensor_ = PackedTensor(num_legs(), order(), rod_.basis().is_closed());
    pairs_.assign(idx(num_legs()) * idx(order()), 0.0);
    places_.resize(rod_.spans().size() * kCount);
    for (std::size_t e = 0; e < rod_.spans().size(); ++e)
        add_span(e);
    constant_ = 0.0;
    for (const Place& place : places_)
        constant_ += place.weight * place.sigma;
}

/// The places of a span, and what they add.
void TensorStretch::add_span(std::size_t e)
{
    for (std::size_t g = 0; g < kCount; ++g)
    {
        const RodSpan& span = rod_.spans()[e];
        const double h = span.end - span.begin;
        const double s = span.begin + gauss_places(kCount)[g] * h;
        const BasisValues values = rod_.basis().values_in(static_cast<int>(e), s);
        Place& place = places_[e * kCount + g];
        place.span = e;
        double sum = 0.0;
        for (int k = 0; k < order(); ++k)
            place.share[idx(k)] = sum -= values.value[1][idx(k)];
        place.sigma = rod_.rest().combined(values).first.norm();
        place.weight = gauss_weights(kCount)[g] * h * rod_.section_at(s).stretch;
        const double of_four = place.weight / std::pow(place.sigma, 3),
                     of_two = place.weight / place.sigma;
        const std::array<double, kMaxOrder>& c = place.share;
        for (int i = 0; i < order(); ++i)
            for (int j = i; j < order(); ++j)
            {
                const int first = (rod_.controls(e)[0] + i) % num_legs();
                pair(first, j - i) += of_two * c[idx(i)] * c[idx(j)];
                for (int k = j; k < order(); ++k)
                    for (int l = k; l < order(); ++l)
                        tensor_.at(first, first + j - i, first + k - i, first + l - i) +=
                            of_four * c[idx(i)] * c[idx(j)] * c[idx(k)] * c[idx(l)];
            }
    }
}

TensorStretch::Window TensorStretch::window(const RodState& state, int i) const
{
    Window out;
    out.count = tensor_.reach(i);
    for (int j = 0; j < out.count; ++j)
    {
        out.leg[idx(j)] = leg(state, i + j);
        for (int k = 0; k <= j; ++k)
            out.dot[idx(j)][idx(k)] = out.dot[idx(k)][idx(j)] =
                out.leg[idx(j)].dot(out.leg[idx(k)]);
    }
    return out;
}

/// out += B by legs j and k, and its mirror image. \pre B symmetric
void TensorStretch::add_block(int j, int k, const Matrix3d& B, BandMatrix& out) const
{
    for (const int end : {0, 1})
        for (const int other : {0, 1})
        {
            const int row = begin_of(j + end), column = begin_of(k + other);
            if (j == k && end < other)
                continue;
            // Two legs that meet at a control point: B and its mirror image are one.
            const double share =
                (end == other ? 1.0 : -1.0) * (j != k && row == column ? 2.0 : 1.0);
            for (int a = 0; a < 3; ++a)
                for (int b = 0; b < 3; ++b)
                    if (row != column)
                        out.add(row + a, column + b, share * B(a, b));
                    else if (a >= b)
                        out.lower(row + a, column + b) += share * B(a, b);
        }
}

template <class Each>
void TensorStretch::for_each_entry(int i, const Each& each) const
{
    const double* entry = tensor_.from(i);
    for (int c = 0; c < tensor_.reach(i); ++c)
        for (int b = 0; b <= c; ++b)
            for (int a = 0; a <= b; ++a, ++entry)
                each(*entry * num_orders(0, a, b, c) / 24.0,
                     std::array<std::size_t, 4>{0, idx(a), idx(b), idx(c)});
}

double TensorStretch::value(const RodState& state) const
{
    double sum = constant_ / 8.0;
    for (int i = 0; i < num_legs(); ++i)
    {
        const Window w = window(state, i);
        for_each_entry(i,
                       [&](double share, const std::array<std::size_t, 4>& p)
                       {
                           sum += share * (w.dot[p[0]][p[1]] * w.dot[p[2]][p[3]] +
                                           w.dot[p[0]][p[2]] * w.dot[p[1]][p[3]] +
                                           w.dot[p[0]][p[3]] * w.dot[p[1]][p[2]]);
                       });
        for (int j = 0; j < w.count; ++j)
            sum -= (j == 0 ? 0.25 : 0.5) * pair(i, j) * w.dot[0][idx(j)];
    }
    return sum;
}

void TensorStretch::add_gradient(const RodState& state, Eigen::VectorXd& out) const
{
    for (int i = 0; i < num_legs(); ++i)
    {
        const Window w = window(state, i);
        std::array<Vector3d, kMaxOrder> pull;
        pull.fill(Vector3d::Zero());
        for_each_entry(i,
                       [&](double share, const std::array<std::size_t, 4>& p)
                       {
                           for (std::size_t x = 0; x < 4; ++x)
                           {
                               const std::size_t y = p[(x + 1) % 4], z = p[(x + 2) % 4],
                                                 v = p[(x + 3) % 4];
                               pull[p[x]] += share * (w.dot[z][v] * w.leg[y] +
                                                      w.dot[y][v] * w.leg[z] +
                                                      w.dot[y][z] * w.leg[v]);
                           }
                       });
        for (int j = 0; j < w.count; ++j)
        {
            pull[0] -= 0.5 * pair(i, j) * w.leg[idx(j)];
            if (j > 0)
                pull[idx(j)] -= 0.5 * pair(i, j) * w.leg[0];
        }
        for (int j = 0; j < w.count; ++j)
        {
            out.segment<3>(begin_of(i + j + 1)) += pull[idx(j)];
            out.segment<3>(begin_of(i + j)) -= pull[idx(j)];
        }
    }
}

void TensorStretch::add_hessian(const RodState& state, RodHessian how,
                                BandMatrix& out) const
{
    if (how != RodHessian::Exact)
    {
        // The tensor does not tell where the rod is pressed; the places do.
        for (const Place& place : places_)
        {
            const int first = rod_.controls(place.span)[0];
            Vector3d u = Vector3d::Zero();
            for (int k = 0; k < order(); ++k)
                u += place.share[idx(k)] * leg(state, first + k);
            const double s2 = place.sigma * place.sigma;
            const double eps = 0.5 * (u.squaredNorm() / s2 - 1.0);
            const double weight = place.weight * place.sigma;
            Matrix3d B = weight / (s2 * s2) * u * u.transpose();
            B.diagonal().array() += weight * std::max(eps, 0.0) / s2;
            for (int j = 0; j < order(); ++j)
                for (int k = 0; k <= j; ++k)
                    add_block(first + j, first + k,
                              place.share[idx(j)] * place.share[idx(k)] * B, out);
        }
        return;
    }
    for (int i = 0; i < num_legs(); ++i)
    {
        const Window w = window(state, i);
        std::array<std::array<Matrix3d, kMaxOrder>, kMaxOrder> B;
        for (int j = 0; j < w.count; ++j)
            for (int k = 0; k <= j; ++k)
                B[idx(j)][idx(k)].setZero();
        for_each_entry(
            i,
            [&](double share, const std::array<std::size_t, 4>& p)
            {
                for (std::size_t x = 0; x < 4; ++x)
                    for (std::size_t y = 0; y < x; ++y)
                    {
                        // The two positions that are left.
                        std::size_t z = 0;
                        while (z == x || z == y)
                            ++z;
                        const Vector3d &dz = w.leg[p[z]], &dv = w.leg[p[6 - x - y - z]];
                        const double twice = p[x] == p[y] ? 2.0 * share : share;
                        Matrix3d& block = B[std::max(p[x], p[y])][std::min(p[x], p[y])];
                        block += twice * (dz * dv.transpose() + dv * dz.transpose());
                        block.diagonal().array() += twice * dz.dot(dv);
                    }
            });
        for (int j = 0; j < w.count; ++j)
            B[idx(j)][0].diagonal().array() -= 0.5 * pair(i, j);
        for (int j = 0; j < w.count; ++j)
            for (int k = 0; k <= j; ++k)
                add_block(i + j, i + k, B[idx(j)][idx(k)], out);
    }
}

} // namespace

PackedTensor::PackedTensor(int count, int order, bool is_closed)
{
    std::size_t size = 0;
    for (int i = 0; i < count; ++i)
    {
        first_.push_back(size);
        reach_.push_back(is_closed ? order : std::min(order, count - i));
        size += address(0, 0, reach_.back());
    }
    values_.assign(size, 0.0);
}

std::unique_ptr<RodTerm> tensor_stretch(const Rod& rod)
{
    return std::make_unique<TensorStretch>(rod);
}

} // namespace cellwarp::core
