// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/rod_mass.h"

#include <algorithm>
#include <numeric>

#include <Eigen/Geometry>

namespace cellwarp::core
{

namespace
{

/// Places in the order of the unknowns.
std::vector<int> ranks(const std::vector<int>& unknown)
{
    std::vector<int> order(unknown.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(),
              [&](int a, int b) { return unknown[idx(a)] < unknown[idx(b)]; });
    std::vector<int> rank(unknown.size());
    for (std::size_t k = 0; k < order.size(); ++k)
        rank[idx(order[k])] = static_cast<int>(k);
    return rank;
}

/// out += A v of a band, where row k of it stands for \p width unknowns from
/// unknown[k] on.
template <int width>
void add_product(const BandMatrix& A, const std::vector<int>& unknown,
                 const Eigen::VectorXd& v, Eigen::VectorXd& out)
{
    const double* const x = v.data();
    double* const y = out.data();
    for (int j = 0; j < A.rows(); ++j)
    {
        const double* const entry = A.column(j).data();
        const double* const from = x + unknown[idx(j)];
        double sum[width];
        for (int c = 0; c < width; ++c)
            sum[c] = entry[0] * from[c];
        for (int i = 1; i <= std::min(A.half_band(), A.rows() - 1 - j); ++i)
        {
            const int other = unknown[idx(j + i)];
            for (int c = 0; c < width; ++c)
            {
                sum[c] += entry[i] * x[other + c];
                y[other + c] += entry[i] * from[c];
            }
        }
        for (int c = 0; c < width; ++c)
            y[unknown[idx(j)] + c] += sum[c];
    }
}

} // namespace

RodMass::RodMass(const Rod& rod) : rod_(rod)
{
    find();
}

void RodMass::find()
{
    lay_out();
    weights_.setZero(rod_.num_controls());
    for (std::size_t e = 0; e < rod_.spans().size(); ++e)
        add_span(e);
    place_factor_.factorize(place_);
    spin_factor_.factorize(spin_);
}

void RodMass::lay_out()
{
    control_ = rod_.layout().control;
    station_ = rod_.layout().angle;
    rank_ = ranks(control_);
    spin_rank_ = ranks(station_);
    std::sort(control_.begin(), control_.end());
    std::sort(station_.begin(), station_.end());
    int half_band = 0, spin_band = 1;
    for (std::size_t e = 0; e < rod_.spans().size(); ++e)
    {
        for (int i = 0; i < rod_.order(); ++i)
            for (int j = 0; j < i; ++j)
                half_band =
                    std::max(half_band, std::abs(rank_[idx(rod_.controls(e)[i])] -
                                                 rank_[idx(rod_.controls(e)[j])]));
        const auto [near, far] = rod_.spans()[e].station;
        spin_band =
            std::max(spin_band, std::abs(spin_rank_[idx(near)] - spin_rank_[idx(far)]));
    }
    place_ = BandMatrix(rod_.num_controls(), half_band);
    spin_ = BandMatrix(rod_.num_stations(), spin_band);
}

void RodMass::add_span(std::size_t e)
{
    // Exact for the product of two functions and a cubic weight.
    const int count = rod_.basis().degree() + 2;
    const std::span<const double> places = gauss_places(count),
                                  weights = gauss_weights(count);
    const RodSpan& span = rod_.spans()[e];
    double of_near = 0.0, of_far = 0.0, of_both = 0.0;
    for (std::size_t g = 0; g < places.size(); ++g)
    {
        const double h = span.end - span.begin, s = span.begin + places[g] * h;
        const BasisValues values = rod_.basis().values_in(static_cast<int>(e), s);
        const double mass = weights[g] * h * rod_.weight(e).mass_at(s);
        for (int i = 0; i < values.count; ++i)
        {
            const double bi = values.value[0][idx(i)];
            const int control = values.control[idx(i)];
            weights_[control] += mass * bi;
            for (int j = 0; j <= i; ++j)
                place_.add(rank_[idx(control)], rank_[idx(values.control[idx(j)])],
                           mass * bi * values.value[0][idx(j)]);
        }
        const double x = places[g], spin = weights[g] * h * rod_.weight(e).spin_at(s);
        of_near += spin * (1 - x) * (1 - x);
        of_far += spin * x * x;
        of_both += spin * x * (1 - x);
    }
    const int near = spin_rank_[idx(span.station[0])],
              far = spin_rank_[idx(span.station[1])];
    spin_.lower(near, near) += of_near;
    spin_.lower(far, far) += of_far;
    spin_.add(near, far, of_both);
}

void RodMass::add_to(BandMatrix& out, double scale) const
{
    for (int j = 0; j < place_.rows(); ++j)
        for (int i = j; i <= std::min(j + place_.half_band(), place_.rows() - 1); ++i)
            if (const double value = scale * place_.lower(i, j); value != 0.0)
                for (int c = 0; c < 3; ++c)
                    out.add(control_[idx(i)] + c, control_[idx(j)] + c, value);
    for (int j = 0; j < spin_.rows(); ++j)
        for (int i = j; i <= std::min(j + spin_.half_band(), spin_.rows() - 1); ++i)
            if (const double value = scale * spin_.lower(i, j); value != 0.0)
                out.add(station_[idx(i)], station_[idx(j)], value);
}

Eigen::VectorXd RodMass::times(const Eigen::VectorXd& v) const
{
    Eigen::VectorXd out = Eigen::VectorXd::Zero(v.size());
    add_product<3>(place_, control_, v, out);
    add_product<1>(spin_, station_, v, out);
    return out;
}

Eigen::VectorXd RodMass::solved(const Eigen::VectorXd& b) const
{
    Eigen::VectorXd out(b.size()), x(spin_.rows());
    Eigen::MatrixX3d places(place_.rows(), 3);
    for (int k = 0; k < place_.rows(); ++k)
        places.row(k) = b.segment<3>(control_[idx(k)]);
    place_factor_.solve(places);
    for (int k = 0; k < place_.rows(); ++k)
        out.segment<3>(control_[idx(k)]) = places.row(k);
    for (int k = 0; k < spin_.rows(); ++k)
        x[k] = b[station_[idx(k)]];
    spin_factor_.solve(x);
    for (int k = 0; k < spin_.rows(); ++k)
        out[station_[idx(k)]] = x[k];
    return out;
}

Eigen::Vector3d RodMass::momentum(const Eigen::VectorXd& velocity) const
{
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = 0; k < rod_.num_controls(); ++k)
        sum += weights_[k] * velocity.segment<3>(rod_.layout().control[idx(k)]);
    return sum;
}

Eigen::Vector3d RodMass::angular_momentum(const RodState& state,
                                          const Eigen::VectorXd& velocity) const
{
    const Eigen::VectorXd p = times(velocity);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (int k = 0; k < rod_.num_controls(); ++k)
        sum += state.control(k).cross(p.segment<3>(rod_.layout().control[idx(k)]));
    for (std::size_t e = 0; e < rod_.spans().size(); ++e)
        for (const std::size_t end : {0u, 1u})
        {
            // Each station's spin momentum once, along its tangent.
            const int station = rod_.spans()[e].station[end];
            const bool is_first =
                end == 0 ? e == 0 || rod_.spans()[e - 1].station[1] != station
                         : station != 0;
            if (is_first)
                sum += p[rod_.layout().angle[idx(station)]] *
                       state.velocity(e, end == 0 ? 0 : rod_.num_places() - 1).tangent;
        }
    return sum;
}

} // namespace cellwarp::core
