// SPDX-License-Identifier: GPL-3.0-or-later
// Small vibrations: eigenvalues of the second derivatives and the mass, on what the holds
// leave free.
#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "tests/bench/rod_answers.h"

namespace cellwarp::core
{

namespace
{

using Eigen::MatrixXd;
using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;

MatrixXd dense(const BandMatrix& A)
{
    MatrixXd out = MatrixXd::Zero(A.rows(), A.rows());
    for (int j = 0; j < A.rows(); ++j)
        for (int i = j; i <= std::min(j + A.half_band(), A.rows() - 1); ++i)
            out(i, j) = out(j, i) = A.lower(i, j);
    return out;
}

/// Angular frequencies [1/s], ascending. \p axes: the directions in which it may move;
/// angles if \p spins.
std::vector<double> frequencies(RodCase& rod, const std::vector<int>& axes, bool spins)
{
    const RodLayout& layout = rod.rod.layout();
    BandMatrix H, M(layout.num_unknowns, layout.half_band);
    rod.model.hessian(rod.state, RodHessian::Exact, H);
    rod.model.mass().add_to(M, 1.0);
    std::vector<int> kept;
    for (const int first : layout.control)
        for (const int axis : axes)
            kept.push_back(first + axis);
    if (spins)
        kept.insert(kept.end(), layout.angle.begin(), layout.angle.end());
    MatrixXd L = MatrixXd::Zero(0, static_cast<Eigen::Index>(kept.size()));
    for (const SparseRow& row : rod.model.rows(rod.state).rows)
    {
        Eigen::VectorXd all = Eigen::VectorXd::Zero(layout.num_unknowns);
        for (const auto& [unknown, value] : row)
            all[unknown] = value;
        if (all(kept).isZero(1e-12))
            continue;
        L.conservativeResize(L.rows() + 1, Eigen::NoChange);
        L.row(L.rows() - 1) = all(kept).transpose();
    }
    MatrixXd free = MatrixXd::Identity(static_cast<Eigen::Index>(kept.size()),
                                       static_cast<Eigen::Index>(kept.size()));
    if (L.rows() > 0)
        free = L.fullPivLu().kernel();
    const MatrixXd K = free.transpose() * dense(H)(kept, kept) * free,
                   mass = free.transpose() * dense(M)(kept, kept) * free;
    const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> modes(
        K, mass, Eigen::EigenvaluesOnly);
    std::vector<double> out;
    for (const double value : modes.eigenvalues())
        out.push_back(std::sqrt(std::max(value, 0.0)));
    return out;
}

double nearest(const std::vector<double>& values, double wanted)
{
    return *std::min_element(values.begin(), values.end(),
                             [&](double a, double b)
                             { return std::abs(a - wanted) < std::abs(b - wanted); });
}

void add_beams(Answers& answers)
{
    answers.begin("Beams: k of ω = k² √(EI / ϱA L⁴)");
    constexpr int kPoints = 32;
    const auto modes = [](bool is_clamped, bool is_pinned)
    {
        RodCase rod(straight_case(1.0, kPoints, slender_section(1.0, 1.0)));
        if (is_clamped)
            rod.clamp(rod.begin());
        if (is_pinned)
            for (const double s : {rod.begin(), rod.end()})
                rod.hold(HoldKind::Point, s, Vector3d::UnitZ());
        std::vector<double> k = frequencies(rod, {1}, false);
        for (double& value : k)
            value = std::sqrt(value);
        return k;
    };
    const double clamped[] = {1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349};
    for (std::size_t k = 0; k < 4; ++k)
        answers.add(fmt::format("clamped and free, {}", k + 1), clamped[k], kPoints,
                    [&] { return modes(true, false)[k]; });
    const double free[] = {4.7300407449, 7.8532046241, 10.9956078380};
    for (std::size_t k = 0; k < 3; ++k) // two motions before them are rigid
        answers.add(fmt::format("free, {}", k + 1), free[k], kPoints,
                    [&] { return modes(false, false)[k + 2]; });
    for (std::size_t k = 0; k < 3; ++k)
        answers.add(fmt::format("pinned, {}", k + 1), kPi * static_cast<double>(k + 1),
                    kPoints, [&] { return modes(false, true)[k]; });
    answers.add("stretch, clamped and free: ω L √(ϱ/E)", 0.5 * kPi, kPoints,
                [&]
                {
                    RodCase rod(straight_case(1.0, kPoints, slender_section(1.0, 1.0)));
                    rod.clamp(rod.begin());
                    return frequencies(rod, {0}, false)[0] / std::sqrt(kSlender);
                });
}

void add_rings(Answers& answers)
{
    answers.begin("Ring: ω √(ϱA R⁴ / EI), EI/GJ = 1.3");
    constexpr int kPoints = 32;
    const auto modes = [](const std::vector<int>& axes, bool spins)
    {
        Section section = slender_section(1.0, 1.0 / 1.3);
        section.spin = 1e-9;
        RodCase rod(ring_case(kPoints, section, {}));
        return frequencies(rod, axes, spins);
    };
    for (const double exact : {2.683282, 7.589466, 14.552138})
        answers.add("in its plane", exact, kPoints,
                    [&] {
                        return nearest(modes({0, 1}, false), exact);
                    });
    for (const double exact : {2.606233, 7.478123, 14.425411})
        answers.add("out of its plane", exact, kPoints,
                    [&] { return nearest(modes({2}, true), exact); });
}

void add_chain(Answers& answers)
{
    answers.begin("Hanging chain: ω √(L/g)");
    constexpr int kPoints = 64;
    const double exact[] = {1.2024128, 2.7600391, 4.3268640};
    for (std::size_t k = 0; k < 3; ++k)
        answers.add(fmt::format("mode {}", k + 1), exact[k], kPoints,
                    [&]
                    {
                        RodCase rod(straight_case(
                            1.0, kPoints, {1e6, {1e-8, 1e-8}, 1e-8, 1.0, 1e-6, 0.01}));
                        rod.model.gravity = {1.0, 0, 0};
                        rod.hold(HoldKind::Point, rod.begin(), Vector3d::UnitZ());
                        rod.settle();
                        return frequencies(rod, {1}, false)[k];
                    });
}

} // namespace

void add_vibrations(Answers& answers)
{
    add_beams(answers);
    add_rings(answers);
    add_chain(answers);
}

} // namespace cellwarp::core
