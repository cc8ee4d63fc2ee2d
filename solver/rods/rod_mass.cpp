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
    lay_out();
    weights_.setZero(rod.num_controls());
    const std::vector<char> all(idx(rod.num_controls()), 1);
    for (std::size_t e = 0; e < rod.spans().size(); ++e)
        add_span(e, all);
    factorize();
}

void RodMass::factorize()
{
    for (std::size_t e = 0; e < spins_.size(); ++e)
    {
        const auto [near, far] = rod_.spans()[e].station;
        const int a = spin_rank_[idx(near)], b = spin_rank_[idx(far)];
        spin_.lower(a, a) += spins_[e][0];
        spin_.lower(b, b) += spins_[e][1];
        spin_.add(a, b, spins_[e][2]);
    }
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
    spins_.assign(rod_.spans().size(), {});
}

/// What a span adds to entries of which a control point \p is_other, and its spin.
void RodMass::add_span(std::size_t e, const std::vector<char>& is_other)
{
    // Exact for the product of two functions and a cubic weight.
    const int count = rod_.basis().degree() + 2;
    const std::span<const double> places = gauss_places(count),
                                  weights = gauss_weights(count);
    const RodSpan& span = rod_.spans()[e];
    for (std::size_t g = 0; g < places.size(); ++g)
    {
        const double h = span.end - span.begin, s = span.begin + places[g] * h;
        const BasisValues values = rod_.basis().values_in(static_cast<int>(e), s);
        const double mass = weights[g] * h * rod_.weight(e).mass_at(s);
        for (int i = 0; i < values.count; ++i)
        {
            const double bi = values.value[0][idx(i)];
            const int control = values.control[idx(i)];
            if (is_other[idx(control)])
                weights_[control] += mass * bi;
            for (int j = 0; j <= i; ++j)
                if (is_other[idx(control)] || is_other[idx(values.control[idx(j)])])
                    place_.add(rank_[idx(control)], rank_[idx(values.control[idx(j)])],
                               mass * bi * values.value[0][idx(j)]);
        }
        const double x = places[g], spin = weights[g] * h * rod_.weight(e).spin_at(s);
        spins_[e][0] += spin * (1 - x) * (1 - x);
        spins_[e][1] += spin * x * x;
        spins_[e][2] += spin * x * (1 - x);
    }
}

// Entries of functions that have stayed move; those of the others are of the spans where
// such act.
void RodMass::follow(const RodChange& change)
{
    const BandMatrix place = std::move(place_);
    const Eigen::VectorXd weights = std::move(weights_);
    const std::vector<int> rank = std::move(rank_);
    const std::vector<std::array<double, 3>> spins = std::move(spins_);
    lay_out();
    std::vector<char> is_other(idx(rod_.num_controls()), 0);
    std::vector<int> from(is_other.size()); // by rank, old rank
    weights_.setZero(rod_.num_controls());
    for (std::size_t k = 0; k < is_other.size(); ++k)
    {
        const int was = change.control_from[k];
        is_other[k] = was < 0;
        from[idx(rank_[k])] = was < 0 ? -1 : rank[idx(was)];
        if (was >= 0)
            weights_[static_cast<Eigen::Index>(k)] = weights[was];
    }
    for (int j = 0; j < place_.rows(); ++j)
        for (int i = j; i <= std::min(j + place_.half_band(), place_.rows() - 1); ++i)
        {
            const auto [low, high] = std::minmax(from[idx(i)], from[idx(j)]);
            if (low >= 0 && high - low <= place.half_band())
                place_.lower(i, j) = place.lower(high, low);
        }
    for (std::size_t e = 0; e < spins_.size(); ++e)
        if (change.keeps_basis[e])
            spins_[e] = spins[idx(change.span_from[e])];
        else
            add_span(e, is_other);
    factorize();
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
