// SPDX-License-Identifier: GPL-3.0-or-later
// Springs between neighbouring samples, as many as control points and at even shares,
// along rows and columns and along both diagonals of each face of a cell. Two diagonals
// of stiffness k of a face l_a x l_b add, with D^2 = l_a^2 + l_b^2 and the depth t,
//   C12 = C66 = 2 k l_a l_b / (D^2 t),   C11 = C12 l_a^2 / l_b^2.
// An even sheet with C12 = C66 = G has C11 = 3 G, G = 3 E / 8 and Poisson's ratio 1/3; an
// even block has G = 2 E / 5 and 1/4: edges add what the diagonals leave of C11. Cells
// longer than 1.7 times their width have no such edges; theirs are kept above 0. Sheets
// do not resist bending.
//
// Mass: of even density M = M_a x M_b x M_c, products go along one index after the other
// with the small factors.
//
// What slides over a point p: with the place (a, b) nearest to p, its normal n and
// d = n . (P(a, b) - p), the row is d = 0; as the place is the nearest, its own move does
// not change d to first order: dd = n . sum b_i c_j dq_ij. Behind an edge n is the way
// from p to that.
#include "solver/rods/spline_sheet.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "solver/dynamics/contradiction.h"
#include "solver/rods/gauss.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
/// G / E, see above.
constexpr double kSheet = 0.375, kBlock = 0.4;
/// Behind an edge, of the size: after a step, and so far that a solve ends.
constexpr double kOff = 1e-6, kFarOff = 1e-3;
constexpr double kLeast = 0.05; ///< of C11 / G that edges are to have

/// Means of the knots of each control point, as shares.
std::vector<double> means_of(const SplineBasis& basis)
{
    std::vector<double> means;
    const double length = basis.end() - basis.begin();
    for (int i = 0; i < basis.num_controls(); ++i)
    {
        double sum = 0.0;
        for (int k = 1; k <= basis.degree(); ++k)
            sum += basis.knots()[idx(i + k)];
        means.push_back((sum / basis.degree() - basis.begin()) / length);
    }
    return means;
}

} // namespace

SplineSheet::SplineSheet(const SheetShape& of) : order_(of.sides.size())
{
    const std::size_t count = of.sides.size();
    if ((count != 2 && count != 3) || of.counts.size() != count)
        throw std::invalid_argument("needs two or three sides, and a count for each");
    std::iota(order_.begin(), order_.end(), std::size_t(0));
    std::stable_sort(order_.begin(), order_.end(),
                     [&](std::size_t a, std::size_t b)
                     { return of.counts[a] < of.counts[b]; });
    SheetShape shape = of;
    for (std::size_t a = 0; a < count; ++a)
    {
        shape.sides[a] = of.sides[order_[a]];
        shape.counts[a] = of.counts[order_[a]];
    }
    const double area = shape.sides[0].cross(shape.sides[1]).norm();
    const double volume =
        count == 2 ? area * shape.thickness
                   : std::abs(shape.sides[0].cross(shape.sides[1]).dot(shape.sides[2]));
    double longest = 0.0;
    for (const Vector3d& side : shape.sides)
        longest = std::max(longest, side.norm());
    if (!(area > 1e-9 * longest * longest) || !(volume > 0.0) ||
        (count == 3 && !(volume > 1e-12 * std::pow(longest, 3))))
        throw std::invalid_argument("its sides span nothing");
    int num_controls = 1;
    for (std::size_t a = 0; a < count; ++a)
    {
        bases_.push_back(SplineBasis::open(
            shape.degree, SplineBasis::clamped_knots(shape.degree, shape.counts[a])));
        num_controls *= shape.counts[a];
    }
    mass_ = shape.density * volume;
    Eigen::VectorXd controls(3 * num_controls);
    // Control points at the means of their knots make the parallelogram itself.
    for (int k = 0; k < num_controls; ++k)
    {
        Vector3d q = shape.corner;
        int rest = k;
        for (std::size_t a = 0; a < count; ++a)
        {
            q += means_of(bases_[a])[idx(rest % shape.counts[a])] * shape.sides[a];
            rest /= shape.counts[a];
        }
        controls.segment<3>(3 * k) = q;
    }
    stand_at(std::move(controls));
    for (const Vector3d& side : shape.sides)
        size_ += side.norm();
    int reach = 0, stride = 1;
    for (const SplineBasis& basis : bases_)
    {
        reach += stride * std::min(basis.degree() + 1, basis.num_controls() - 1);
        stride *= basis.num_controls();
    }
    const int half_band = std::min(3 * reach + 2, 3 * num_controls - 1);
    matrix_ = mass_band_ = BandMatrix(3 * num_controls, half_band);
    find_mass();
    add_springs(shape);
}

PointShares SplineSheet::weights(const SheetPlace& place, const Orders& orders) const
{
    PointShares out = {{0, 1.0}};
    int stride = 1;
    for (std::size_t a = 0; a < bases_.size(); ++a)
    {
        const SplineBasis& basis = bases_[a];
        const double length = basis.end() - basis.begin();
        const BasisValues values = basis.values(basis.begin() + place[a] * length);
        PointShares next;
        for (int j = 0; j < values.count; ++j)
            for (const auto& [control, share] : out)
                if (const double value = values.value[orders[a]][idx(j)] *
                                         std::pow(length, static_cast<double>(orders[a]));
                    value != 0.0)
                    next.emplace_back(control + 3 * stride * values.control[idx(j)],
                                      share * value);
        out = std::move(next);
        stride *= basis.num_controls();
    }
    std::sort(out.begin(), out.end());
    return out;
}

void SplineSheet::add_springs(const SheetShape& shape)
{
    const std::size_t count = bases_.size();
    const bool is_solid = count == 3;
    std::array<int, 3> size = {1, 1, 1};
    std::array<double, 3> length = {1.0, 1.0, is_solid ? 1.0 : shape.thickness};
    for (std::size_t a = 0; a < count; ++a)
    {
        size[a] = bases_[a].num_controls();
        length[a] = shape.sides[a].norm() / (size[a] - 1);
    }
    const auto place = [&](const std::array<int, 3>& i)
    {
        SheetPlace out = {};
        for (std::size_t a = 0; a < count; ++a)
            out[a] = double(i[a]) / (size[a] - 1);
        return out;
    };
    const double shear = shape.young * (is_solid ? kBlock : kSheet);
    // Springs of cells that share them are one.
    std::map<std::pair<std::array<int, 3>, std::array<int, 3>>, double> stiffness;
    const auto add = [&](const std::array<int, 3>& i, const std::array<int, 3>& j,
                         double k) {
        stiffness[{i, j}] += k;
    };
    std::array<int, 3> n = {};
    for (n[2] = 0; n[2] < std::max(1, size[2] - 1); ++n[2])
        for (n[1] = 0; n[1] + 1 < size[1]; ++n[1])
            for (n[0] = 0; n[0] + 1 < size[0]; ++n[0])
                for (std::size_t a = 0; a < count; ++a)
                {
                    // What the diagonals along a leave of C11 to its edges.
                    double left = 3.0;
                    for (std::size_t b = 0; b < count; ++b)
                        if (b != a)
                            left -= length[a] * length[a] / (length[b] * length[b]);
                    const double of_edges = shear * std::max(left, kLeast) / length[a];
                    const std::size_t b = (a + 1) % 3, c = (a + 2) % 3;
                    const int edges = is_solid ? 4 : 2;
                    for (int corner = 0; corner < 4; ++corner)
                    {
                        std::array<int, 3> from = n;
                        from[b] += corner & 1;
                        from[c] += corner >> 1;
                        if (from[b] >= size[b] || from[c] >= size[c])
                            continue;
                        std::array<int, 3> to = from;
                        ++to[a];
                        add(from, to, of_edges * length[b] * length[c] / edges);
                    }
                    // Diagonals of the faces across c; a sheet has one.
                    if (!is_solid && c != 2)
                        continue;
                    const double la = length[a], lb = length[b];
                    const double of_diagonals =
                        shear * length[c] * (la * la + lb * lb) / (2.0 * la * lb);
                    for (int side = 0; side < (is_solid ? 2 : 1); ++side)
                    {
                        std::array<int, 3> near = n;
                        near[c] += side;
                        std::array<int, 3> along = near, across = near;
                        ++along[a];
                        ++across[b];
                        std::array<int, 3> far = along;
                        ++far[b];
                        const double k = is_solid ? 0.5 * of_diagonals : of_diagonals;
                        add(near, far, k);
                        add(std::min(along, across), std::max(along, across), k);
                    }
                }
    for (const auto& [ends, k] : stiffness)
    {
        DistanceSpring spring{
            way_between(weights(place(ends.first)), weights(place(ends.second))), k};
        spring.length = along(spring.way, x).norm();
        springs_.add(std::move(spring));
    }
}

void SplineSheet::find_mass()
{
    for (const SplineBasis& basis : bases_)
    {
        const int n = basis.num_controls();
        Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
        const double length = basis.end() - basis.begin();
        const int count = basis.degree() + 1;
        for (std::size_t e = 0; e < basis.spans().size(); ++e)
            for (std::size_t g = 0; g < idx(count); ++g)
            {
                const SplineSpan& span = basis.spans()[e];
                const BasisValues values =
                    basis.values_in(static_cast<int>(e),
                                    span.begin + gauss_places(count)[g] * span.length());
                for (int i = 0; i < values.count; ++i)
                    for (int j = 0; j < values.count; ++j)
                        M(values.control[idx(i)], values.control[idx(j)]) +=
                            gauss_weights(count)[g] * span.length() / length *
                            values.value[0][idx(i)] * values.value[0][idx(j)];
            }
        masses_.push_back(std::move(M));
    }
    weights_ = times_mass(Eigen::VectorXd::Ones(x.size()))(
        Eigen::seqN(0, num_controls(), Eigen::fix<3>));
    for (int k = 0; k < num_controls(); ++k)
    {
        // Column k of M, by its factors.
        for (int other = k; other < num_controls(); ++other)
        {
            double value = mass_;
            int a = k, b = other;
            for (const Eigen::MatrixXd& M : masses_)
            {
                const int n = static_cast<int>(M.rows());
                value *= M(a % n, b % n);
                a /= n;
                b /= n;
            }
            if (value != 0.0)
                for (int c = 0; c < 3; ++c)
                    mass_band_.lower(3 * other + c, 3 * k + c) = value;
        }
    }
}

Eigen::VectorXd SplineSheet::times_mass(const Eigen::VectorXd& v) const
{
    Eigen::VectorXd out = v;
    int stride = 1;
    for (const Eigen::MatrixXd& M : masses_)
    {
        const int n = static_cast<int>(M.rows());
        Eigen::VectorXd line(n);
        for (int first = 0; first < num_controls(); ++first)
        {
            if (first / stride % n != 0)
                continue;
            for (int c = 0; c < 3; ++c)
            {
                for (int i = 0; i < n; ++i)
                    line[i] = out[3 * (first + i * stride) + c];
                line = M * line;
                for (int i = 0; i < n; ++i)
                    out[3 * (first + i * stride) + c] = line[i];
            }
        }
        stride *= n;
    }
    return mass_ * out;
}

Vector3d SplineSheet::momentum() const
{
    const Eigen::VectorXd p = times_mass(velocity);
    Vector3d sum = Vector3d::Zero();
    for (int k = 0; k < num_controls(); ++k)
        sum += p.segment<3>(3 * k);
    return sum;
}

Vector3d SplineSheet::angular_momentum() const
{
    const Eigen::VectorXd p = times_mass(velocity);
    Vector3d sum = Vector3d::Zero();
    for (int k = 0; k < num_controls(); ++k)
        sum += Vector3d(x.segment<3>(3 * k)).cross(Vector3d(p.segment<3>(3 * k)));
    return sum;
}

// Places.

SheetPlace SplineSheet::ordered(const SheetPlace& place) const
{
    SheetPlace out = {};
    for (std::size_t a = 0; a < order_.size(); ++a)
        out[a] = place[order_[a]];
    return out;
}

SheetPlace SplineSheet::sliding(std::size_t k) const
{
    SheetPlace out = {};
    for (std::size_t a = 0; a < order_.size(); ++a)
        out[order_[a]] = slides_[k].foot[a];
    return out;
}

int SplineSheet::add_place(const SheetPlace& place)
{
    places_.push_back(weights(ordered(place)));
    return static_cast<int>(places_.size()) - 1;
}

void SplineSheet::fix(const SheetPlace& place)
{
    PointShares at = weights(ordered(place));
    const Vector3d point = along(at, x);
    fixed_.push_back({std::move(at), point});
}

void SplineSheet::slide_over(const Vector3d& point)
{
    if (is_block())
        throw std::invalid_argument("a point within a block holds nothing");
    constexpr int kTries = 40;
    Slide slide{point, {}};
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= kTries; ++i)
        for (int j = 0; j <= kTries; ++j)
        {
            const SheetPlace place = {double(i) / kTries, double(j) / kTries, 0.0};
            if (const double away = (along(weights(place), x) - point).norm();
                away < least)
            {
                least = away;
                slide.foot = place;
            }
        }
    seek(x, point, slide.foot);
    slides_.push_back(slide);
}

Vector3d SplineSheet::place(int place, bool of_trial) const
{
    return along(places_[idx(place)], of_trial ? trial_ : x);
}

void SplineSheet::add_moved(int place, const Vector3d& n, SparseRow& out) const
{
    for (const auto& [control, share] : places_[idx(place)])
        for (int c = 0; c < 3; ++c)
            out.emplace_back(control + c, share * n[c]);
}

Vector3d SplineSheet::seek(const Eigen::VectorXd& x_at, const Vector3d& point,
                           SheetPlace& foot) const
{
    Vector3d normal = Vector3d::Zero();
    constexpr int kSteps = 30;
    for (int step = 0; step < kSteps; ++step)
    {
        const Vector3d off = along(weights(foot), x_at) - point,
                       u = along(weights(foot, {1, 0, 0}), x_at),
                       v = along(weights(foot, {0, 1, 0}), x_at);
        normal = u.cross(v).normalized();
        // Gauss-Newton, within the sides.
        Eigen::Matrix2d A;
        A << u.dot(u), u.dot(v), u.dot(v), v.dot(v);
        Eigen::Vector2d by = -A.ldlt().solve(Eigen::Vector2d(u.dot(off), v.dot(off)));
        for (const int c : {0, 1})
        {
            const double now = foot[idx(c)];
            const bool is_stopped =
                (now <= 0.0 && by[c] < 0.0) || (now >= 1.0 && by[c] > 0.0);
            if (is_stopped)
            {
                const Vector3d& along = c == 0 ? v : u;
                by[c] = 0.0;
                by[1 - c] = -along.dot(off) / along.squaredNorm();
            }
        }
        double most = 0.0;
        for (const int c : {0, 1})
        {
            const double next = std::clamp(foot[idx(c)] + by[c], 0.0, 1.0);
            most = std::max(most, std::abs(next - foot[idx(c)]));
            foot[idx(c)] = next;
        }
        if (most < 1e-14)
            break;
    }
    return normal;
}

Eigen::VectorXd SplineSheet::violations(const Eigen::VectorXd& x_at) const
{
    const auto is_on = [](const Slide& slide) { return !slide.has_left; };
    const auto num_on = std::count_if(slides_.begin(), slides_.end(), is_on);
    Eigen::VectorXd out(static_cast<Eigen::Index>(3 * fixed_.size()) + num_on);
    Eigen::Index row = 0;
    for (const Fixed& fixed : fixed_)
    {
        out.segment<3>(row) = along(fixed.at, x_at) - fixed.point;
        row += 3;
    }
    for (const Slide& slide : slides_)
    {
        if (slide.has_left)
            continue;
        SheetPlace foot = slide.foot;
        const Vector3d normal = seek(x_at, slide.point, foot);
        out[row++] = normal.dot(along(weights(foot), x_at) - slide.point);
    }
    return out;
}

double SplineSheet::own_violation() const
{
    const Eigen::VectorXd off = violations(x);
    return off.size() > 0 ? off.cwiseAbs().maxCoeff() : 0.0;
}

// One solve.

void SplineSheet::start(double step)
{
    SpringObject::start(step);
    pull_ += viscosity / step;
    momentum_ = times_mass(velocity) / step;
    slides_before_ = slides_;
}

void SplineSheet::finish()
{
    SpringObject::finish();
    for (Slide& slide : slides_)
    {
        seek(x, slide.point, slide.foot);
        slide.has_left = slide.has_left || is_off(slide, kOff);
    }
}

bool SplineSheet::is_off(const Slide& slide, double share) const
{
    SheetPlace foot = slide.foot;
    const Vector3d normal = seek(x, slide.point, foot),
                   off = along(weights(foot), x) - slide.point;
    return (off - normal.dot(off) * normal).norm() > share * size_;
}

bool SplineSheet::is_beyond() const
{
    return std::any_of(slides_.begin(), slides_.end(),
                       [this](const Slide& slide)
                       { return !slide.has_left && is_off(slide, kFarOff); });
}

ArticulableObject::Again SplineSheet::again(const Eigen::VectorXd&, bool)
{
    Again out = Again::No;
    for (Slide& slide : slides_)
        if (!slide.has_left && is_off(slide, kFarOff))
        {
            slide.has_left = true;
            out = Again::FromBegin;
        }
    return out;
}

void SplineSheet::undo()
{
    SpringObject::undo();
    slides_ = slides_before_;
}

void SplineSheet::measure(bool of_trial, Measure& out)
{
    const Eigen::VectorXd& x_at = of_trial ? trial_ : x;
    const Eigen::VectorXd way = x_at - start_;
    out.value = springs_.step_energy(x_at) + weight(x_at) +
                0.5 * pull_ * way.dot(times_mass(way)) - momentum_.dot(way);
    out.violation = violations(x_at);
    if (contradiction_.size() == out.violation.size())
        out.violation -= contradiction_;
}

double SplineSheet::linearise(Eigen::VectorXd& gradient, Measure& here)
{
    gradient = pull_ * times_mass(x - start_) - momentum_;
    double at_work = gradient.cwiseAbs().maxCoeff();
    for (int k = 0; k < num_controls(); ++k)
        gradient.segment<3>(3 * k) -= weights_[k] * gravity;
    at_work = std::max(at_work, weights_.maxCoeff() * gravity.norm());
    at_work = std::max(at_work, springs_.add_gradient(x, gradient));
    rows_.clear();
    const auto add_row = [&](const PointShares& weights, const Vector3d& n)
    {
        SparseRow& row = rows_.emplace_back();
        for (const auto& [control, share] : weights)
            for (int c = 0; c < 3; ++c)
                if (share * n[c] != 0.0)
                    row.emplace_back(control + c, share * n[c]);
    };
    for (const Fixed& fixed : fixed_)
        for (int c = 0; c < 3; ++c)
            add_row(fixed.at, Vector3d::Unit(c));
    for (Slide& slide : slides_)
        if (!slide.has_left)
        {
            const Vector3d normal = seek(x, slide.point, slide.foot);
            add_row(weights(slide.foot), normal);
        }
    contradiction_.resize(0);
    rows_off_ = here.violation = violations(x);
    return at_work;
}

void SplineSheet::add_own_forces(const Eigen::VectorXd& lambda, double scale,
                                 Eigen::VectorXd& out) const
{
    for (std::size_t r = 0; r < rows_.size(); ++r)
        for (const auto& [unknown, value] : rows_[r])
            out[unknown] += scale * lambda[static_cast<Eigen::Index>(r)] * value;
}

void SplineSheet::take_off_contradiction(Measure& here)
{
    contradiction_ = contradiction(rows_, rows_off_);
    here.violation = rows_off_ - contradiction_;
}

/// Takes pressed * d2d off the matrix.
void SplineSheet::add_curvature(const Slide& slide, double pressed)
{
    const PointShares all = weights(slide.foot);
    const std::array<PointShares, 2> derived = {weights(slide.foot, {1, 0, 0}),
                                                weights(slide.foot, {0, 1, 0})};
    const Vector3d u = along(derived[0], x), v = along(derived[1], x),
                   normal = u.cross(v).normalized();
    Eigen::Matrix2d A, bends;
    A << u.dot(u), u.dot(v), u.dot(v), v.dot(v);
    const double mixed = normal.dot(along(weights(slide.foot, {1, 1, 0}), x));
    bends << normal.dot(along(weights(slide.foot, {2, 0, 0}), x)), mixed, mixed,
        normal.dot(along(weights(slide.foot, {0, 2, 0}), x));
    Eigen::Matrix<double, 3, 2> S;
    S << u, v;
    const Eigen::Matrix<double, 2, 3> to_foot = -A.inverse() * S.transpose();
    // f and n . dP_a as sums over unknowns.
    struct Entry
    {
        int unknown;
        Eigen::Vector2d foot, turned;
    };
    std::vector<Entry> entries;
    for (const auto& [control, share] : all)
        for (int c = 0; c < 3; ++c)
            entries.push_back({control + c, share * to_foot.col(c), {0.0, 0.0}});
    for (const std::size_t a : {0u, 1u})
        for (const auto& [control, share] : derived[a])
        {
            const auto at_control = std::find_if(entries.begin(), entries.end(),
                                                 [first = control](const Entry& one)
                                                 { return one.unknown == first; });
            for (int c = 0; c < 3 && at_control != entries.end(); ++c)
                (at_control + c)->turned[static_cast<Eigen::Index>(a)] =
                    share * normal[c];
        }
    for (const Entry& i : entries)
        for (const Entry& j : entries)
            if (i.unknown >= j.unknown)
                matrix_.lower(i.unknown, j.unknown) -=
                    pressed * (i.turned.dot(j.foot) + j.turned.dot(i.foot) +
                               i.foot.dot(bends * j.foot));
}

SaddleSolver::Report SplineSheet::factorize(const Eigen::VectorXd& lambda, int& level)
{
    const std::vector<int> groups = [&]
    {
        std::vector<int> out(fixed_.size(), 3);
        out.insert(out.end(), rows_.size() - 3 * fixed_.size(), 1);
        return out;
    }();
    for (;; ++level)
    {
        const double share = std::pow(4.0, std::max(level - 1, 0)) * pull_;
        matrix_ = mass_band_;
        for (int j = 0; j < matrix_.rows(); ++j)
            for (int i = j; i <= std::min(j + matrix_.half_band(), matrix_.rows() - 1);
                 ++i)
                matrix_.lower(i, j) *= share;
        springs_.for_each_block(x,
                                level == 0 ? DistanceSprings::Curvature::Exact
                                           : DistanceSprings::Curvature::WithoutPushes,
                                [&](int first, int column, const Eigen::Matrix3d& B)
                                {
                                    for (int a = 0; a < 3; ++a)
                                        for (int b = 0; b < 3; ++b)
                                            if (first + a >= column + b)
                                                matrix_.lower(first + a, column + b) +=
                                                    B(a, b);
                                });
        Eigen::Index row = static_cast<Eigen::Index>(3 * fixed_.size());
        for (const Slide& slide : slides_)
            if (level == 0 && !slide.has_left)
                add_curvature(slide, lambda[row++]);
        const SaddleSolver::Report told = saddle_.factorize(matrix_, rows_, groups);
        if (!told.is_finite || told.num_negative == 0 || level >= kMostLevel)
            return told;
    }
}

} // namespace cellwarp::core
