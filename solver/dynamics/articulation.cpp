// SPDX-License-Identifier: GPL-3.0-or-later
// What is minimised is the sum of the objects' values, subject to their own rows and to
// those of joints. A slender rod is millions of times stiffer along itself than across.
// Plain Newton steps stretch it to second order, which a line search cannot allow: it
// crawls. Hence
//  - nothing turns by more than kTurn in a step;
//  - what a step stretches to second order is taken back with the same factors, again and
//    again until only rounding is left. The stretch that is left counts from the step
//    itself, not from what the corrections have made of it: with the latter the rod
//    creeps;
//  - where pivots show that the second derivatives are not definite on what the rows
//    leave free, objects are asked for more definite ones.
//
// Joints. Object a has A_a x_a - N_a m = r_a, and each row of a joint says sum_a L_a x_a
// = -g, so N_a = L_a^T and
//   (sum_a L_a A_a^-1 L_a^T) m = -g - sum_a L_a A_a^-1 r_a.
// An unknown u that an object has made stiffer by sigma has a column of its own, N = e_u:
// its m = sigma x_u takes the addition off again, by the row x_u - m / sigma = 0. A_a is
// to be definite, the sums above then are, and with the rows of the unknowns, which come
// last, there is one pivot of the other sign for each of those.
#include "solver/dynamics/articulation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <Eigen/Geometry>

#include "solver/linear/rounding.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Each takes back all but an eighth or less of what is left, down to where only rounding
/// is.
constexpr int kCorrections = 12;
constexpr double kCorrected = 1e-10, kWorse = 2.0;
/// Of constraints, of the size of the objects.
constexpr double kViolation = 1e-11;
/// A residual that stays above this share of the last one no longer falls.
constexpr double kStill = 0.9;
/// Of constraints, of the size: more of what contradicts is no rounding.
constexpr double kContradiction = 1e-9;
constexpr double kSmallTurn = 0.01; ///< [rad]
constexpr int kHalvings = 30;
/// A joint that its objects can follow by less than this share of what each unknown
/// could alone says nothing new.
constexpr double kStiff = 1e-10;
/// How often a solve is tried where things slide, and up to when what sticks may change.
constexpr int kTries = 30, kModeChanges = 6;

double largest(const Eigen::VectorXd& v)
{
    return v.size() > 0 ? v.cwiseAbs().maxCoeff() : 0.0;
}

int num_rows(const Joint& joint)
{
    return joint.kind == Joint::Kind::Distance ? 1 : 3;
}

/// Directions of a joint's rows: of forces, or axes of couples, on the first object.
std::array<Vector3d, 3> directions(const Joint& joint, const ArticulableObject& a,
                                   const ArticulableObject& b)
{
    if (joint.kind == Joint::Kind::Point)
        return {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()};
    if (joint.kind == Joint::Kind::Distance)
    {
        const Vector3d way =
            a.place(joint.place[0], false) - b.place(joint.place[1], false);
        return {Vector3d(way / joint.distance), Vector3d::Zero(), Vector3d::Zero()};
    }
    const Eigen::Matrix3d A = a.frame(joint.place[0], false) * joint.frame,
                          B = b.frame(joint.place[1], false);
    std::array<Vector3d, 3> out;
    for (int k = 0; k < 3; ++k)
        out[idx(k)] = Vector3d(A.col((k + 1) % 3)).cross(Vector3d(B.col((k + 2) % 3)));
    return out;
}

} // namespace

Articulation::Articulation(std::vector<ArticulableObject*> objects,
                           std::vector<Joint> joints, Coupling* coupling)
    : objects_(std::move(objects)), joints_(std::move(joints)), coupling_(coupling),
      lambda_(objects_.size())
{
}

/// One solve.
class Articulation::Run
{
public:
    Run(Articulation& of, const MotionOptions& options);
    MotionReport operator()();

private:
    struct JointRow
    {
        std::size_t joint = 0;
        int of_joint = 0;
        std::array<SparseRow, 2> entries; ///< of both objects; the second empty if one
    };
    void find_joint_rows();
    void press_joints(const Eigen::VectorXd& lambda);
    void add_joint_forces(const Eigen::VectorXd& lambda, double scale,
                          std::vector<Eigen::VectorXd>& out) const;
    void measure(bool of_trial, std::vector<ArticulableObject::Measure>& out,
                 Eigen::VectorXd& joints);
    void take_off_idle(Eigen::VectorXd& joints) const;
    double merit(const std::vector<ArticulableObject::Measure>& of,
                 const Eigen::VectorXd& joints, double coupled) const;
    bool keeps_constraints() const;
    MotionStop converged() const;
    bool look();
    bool factorize();
    bool factorize_joints(int& negative);
    void solve(std::vector<Eigen::VectorXd>& r, std::vector<Eigen::VectorXd>& own,
               Eigen::VectorXd& joints) const;
    void solve_coupled();
    bool advance();
    bool try_length(double length);
    void correct(double length);
    template <class Each>
    void each(Each&& act)
    {
        for (std::size_t a = 0; a < objects_.size(); ++a)
            act(a, *objects_[a]);
    }

    Articulation& all_;
    const MotionOptions& options_;
    const std::vector<ArticulableObject*>& objects_;
    const std::vector<Joint>& joints_;
    double size_ = 0.0;    ///< of the largest object [m]
    double penalty_ = 0.0; ///< of what constraints are violated by [N]
    MotionReport report_;
    bool is_balanced_ = false;
    double last_residual_ = std::numeric_limits<double>::infinity();

    // Of this iteration.
    std::vector<ArticulableObject::Measure> here_, there_; ///< of states and trials
    Eigen::VectorXd joints_here_, joints_there_;           ///< their violations
    std::vector<Eigen::VectorXd> gradient_, step_, next_lambda_, right_, values_;
    Eigen::VectorXd next_joint_lambda_;
    std::vector<char> is_contradictory_; ///< of objects
    double reach_ = 1.0; ///< of the whole step that the cap on turns allows
    double turn_ = 0.0;  ///< largest in the whole step [rad]
    double before_ = 0.0, slope_ = 0.0, noise_ = 0.0;
    double coupled_here_ = 0.0, coupled_there_ = 0.0; ///< values of what couples [J]

    // Joints.
    std::vector<JointRow> rows_;
    struct Column
    {
        int number;
        const SparseRow* entries;
        Eigen::VectorXd moved, own; ///< A^-1 N, and multipliers of the object's own rows
    };
    std::vector<std::vector<Column>> columns_; ///< of each object
    std::vector<SparseRow> of_added_;
    std::vector<char> is_idle_; ///< rows of joints that say nothing new
    BandFactor joint_factor_;
    Eigen::Index num_columns_ = 0;
};

Articulation::Run::Run(Articulation& of, const MotionOptions& options)
    : all_(of), options_(options), objects_(of.objects_), joints_(of.joints_),
      here_(objects_.size()), there_(objects_.size()), gradient_(objects_.size()),
      step_(objects_.size()), next_lambda_(objects_.size()), right_(objects_.size()),
      values_(objects_.size()), is_contradictory_(objects_.size(), 0)
{
    for (const ArticulableObject* object : objects_)
        size_ = std::max(size_, object->size());
    report_.iterations = 0;
}

bool Articulation::is_held(const Joint& joint) const
{
    return objects_[idx(joint.object[0])]->is_held(joint.place[0]) &&
           objects_[idx(joint.object[1])]->is_held(joint.place[1]);
}

Eigen::VectorXd Articulation::joint_violations(bool of_trial) const
{
    std::vector<double> out;
    for (const Joint& joint : joints_)
    {
        if (!is_held(joint))
            continue;
        const ArticulableObject &a = *objects_[idx(joint.object[0])],
                                &b = *objects_[idx(joint.object[1])];
        if (joint.kind == Joint::Kind::Frame)
        {
            const Eigen::Matrix3d A = a.frame(joint.place[0], of_trial) * joint.frame,
                                  B = b.frame(joint.place[1], of_trial);
            for (int k = 0; k < 3; ++k)
                out.push_back(A.col((k + 1) % 3).dot(B.col((k + 2) % 3)));
            continue;
        }
        const Vector3d way =
            a.place(joint.place[0], of_trial) - b.place(joint.place[1], of_trial);
        if (joint.kind == Joint::Kind::Distance)
            out.push_back((way.squaredNorm() - joint.distance * joint.distance) /
                          (2.0 * joint.distance));
        else
            out.insert(out.end(), {way[0], way[1], way[2]});
    }
    return Eigen::Map<const Eigen::VectorXd>(out.data(),
                                             static_cast<Eigen::Index>(out.size()));
}

void Articulation::Run::find_joint_rows()
{
    rows_.clear();
    for (std::size_t j = 0; j < joints_.size(); ++j)
    {
        const Joint& joint = joints_[j];
        if (!all_.is_held(joint))
            continue;
        const ArticulableObject &a = *objects_[idx(joint.object[0])],
                                &b = *objects_[idx(joint.object[1])];
        const std::array<Vector3d, 3> n = directions(joint, a, b);
        for (int k = 0; k < num_rows(joint); ++k)
        {
            JointRow row{j, k, {}};
            const bool is_same = joint.object[0] == joint.object[1];
            SparseRow &first = row.entries[0], &second = row.entries[is_same ? 0 : 1];
            if (joint.kind == Joint::Kind::Frame)
            {
                a.add_turned(joint.place[0], n[idx(k)], first);
                b.add_turned(joint.place[1], -n[idx(k)], second);
            }
            else
            {
                a.add_moved(joint.place[0], n[idx(k)], first);
                b.add_moved(joint.place[1], -n[idx(k)], second);
            }
            sort_and_add_up(first);
            sort_and_add_up(row.entries[1]);
            rows_.push_back(std::move(row));
        }
    }
}

void Articulation::Run::press_joints(const Eigen::VectorXd& lambda)
{
    each([](std::size_t, ArticulableObject& object) { object.forget_presses(); });
    for (std::size_t r = 0; r < rows_.size(); ++r)
    {
        const Joint& joint = joints_[rows_[r].joint];
        if (joint.kind == Joint::Kind::Frame)
            continue;
        ArticulableObject &a = *objects_[idx(joint.object[0])],
                          &b = *objects_[idx(joint.object[1])];
        const Vector3d force = lambda[static_cast<Eigen::Index>(r)] *
                               directions(joint, a, b)[idx(rows_[r].of_joint)];
        a.press(joint.place[0], force);
        b.press(joint.place[1], -force);
    }
}

void Articulation::Run::add_joint_forces(const Eigen::VectorXd& lambda, double scale,
                                         std::vector<Eigen::VectorXd>& out) const
{
    for (std::size_t r = 0; r < rows_.size(); ++r)
        for (const std::size_t end : {0u, 1u})
            for (const auto& [unknown, value] : rows_[r].entries[end])
                out[idx(joints_[rows_[r].joint].object[end])][unknown] +=
                    scale * lambda[static_cast<Eigen::Index>(r)] * value;
}

void Articulation::Run::measure(bool of_trial,
                                std::vector<ArticulableObject::Measure>& out,
                                Eigen::VectorXd& joints)
{
    each([&](std::size_t a, ArticulableObject& object)
         { object.measure(of_trial, out[a]); });
    joints = all_.joint_violations(of_trial);
    take_off_idle(joints);
    if (all_.coupling_)
        (of_trial ? coupled_there_ : coupled_here_) = all_.coupling_->value(of_trial);
}

/// Of rows that say nothing new no violation is solved for.
void Articulation::Run::take_off_idle(Eigen::VectorXd& joints) const
{
    for (Eigen::Index r = 0; r < joints.size(); ++r)
        if (static_cast<std::size_t>(r) < is_idle_.size() &&
            is_idle_[static_cast<std::size_t>(r)])
            joints[r] = 0.0;
}

/// What a step must lower.
double Articulation::Run::merit(const std::vector<ArticulableObject::Measure>& of,
                                const Eigen::VectorXd& joints, double coupled) const
{
    double sum = coupled + penalty_ * joints.cwiseAbs().sum();
    for (const ArticulableObject::Measure& one : of)
        sum += one.value - one.work + penalty_ * one.violation.cwiseAbs().sum();
    return sum;
}

bool Articulation::Run::keeps_constraints() const
{
    double most = largest(joints_here_);
    for (const ArticulableObject::Measure& one : here_)
        most = std::max(most, largest(one.violation));
    return most <= kViolation * std::max(size_, 1.0);
}

MotionStop Articulation::Run::converged() const
{
    return report_.violation > kContradiction * std::max(size_, 1.0)
               ? MotionStop::Contradiction
               : MotionStop::Converged;
}

/// Gradients, rows and report of the states. False where the solve ends here.
bool Articulation::Run::look()
{
    double at_work = 0.0;
    each([&](std::size_t a, ArticulableObject& object)
         { at_work = std::max(at_work, object.linearise(gradient_[a], here_[a])); });
    if (all_.coupling_)
        at_work = std::max(at_work, all_.coupling_->linearise(gradient_));
    joints_here_ = all_.joint_violations(false);
    report_.violation = largest(joints_here_);
    take_off_idle(joints_here_);
    right_ = gradient_;
    each(
        [&](std::size_t a, ArticulableObject& object)
        {
            Eigen::VectorXd& lambda = all_.lambda_[a];
            report_.violation = std::max(report_.violation, largest(here_[a].violation));
            if (is_contradictory_[a])
                object.take_off_contradiction(here_[a]);
            if (lambda.size() != here_[a].violation.size())
                lambda = Eigen::VectorXd::Zero(here_[a].violation.size());
            at_work = std::max(at_work, largest(lambda));
            object.add_own_forces(lambda, -1.0, right_[a]);
        });
    find_joint_rows();
    Eigen::VectorXd& joint_lambda = all_.joint_lambda_;
    if (joint_lambda.size() != joints_here_.size())
        joint_lambda = Eigen::VectorXd::Zero(joints_here_.size());
    at_work = std::max(at_work, largest(joint_lambda));
    add_joint_forces(joint_lambda, -1.0, right_);
    report_.residual = 0.0;
    // Down to the noise the residual may still fall: forces across a slender rod are
    // small beside what rounding does to those along it.
    bool is_noise = true;
    each(
        [&](std::size_t a, ArticulableObject& object)
        {
            const double residual = largest(right_[a]);
            is_noise = is_noise && residual <= object.noise_of_forces();
            // Not a number stays.
            if (!(residual <= report_.residual))
                report_.residual = residual;
        });
    const bool is_done = report_.residual <= options_.tolerance * at_work;
    const bool falls = report_.residual < kStill * last_residual_;
    last_residual_ = report_.residual;
    is_balanced_ = is_done || is_noise;
    if (!std::isfinite(report_.residual) || !std::isfinite(report_.violation))
        report_.stop = MotionStop::NotFinite;
    else if (report_.iterations > 0 && is_balanced_ && (is_done || !falls) &&
             keeps_constraints())
        report_.stop = converged();
    else if (report_.iterations >= options_.max_iterations || all_.is_beyond())
        report_.stop = MotionStop::IterationLimit;
    return report_.stop == MotionStop::NotRun;
}

/// False if it is not finite.
bool Articulation::Run::factorize()
{
    if (!rows_.empty())
        press_joints(all_.joint_lambda_);
    for (int least = 0;; ++least)
    {
        bool is_finite = true;
        report_.num_dropped = 0;
        each(
            [&](std::size_t a, ArticulableObject& object)
            {
                int level = least;
                const SaddleSolver::Report told =
                    object.factorize(all_.lambda_[a], level);
                is_finite = is_finite && told.is_finite && told.num_negative == 0;
                report_.num_dropped += told.num_dropped;
                if (told.num_dropped > 0 && !is_contradictory_[a])
                {
                    is_contradictory_[a] = 1;
                    object.take_off_contradiction(here_[a]);
                }
            });
        if (!is_finite)
            return false;
        int negative = 0;
        if (rows_.empty())
            return true;
        if (!factorize_joints(negative))
            return false;
        if (negative == 0 || least == ArticulableObject::kMostLevel)
            return negative == 0;
    }
}

/// False if it is not finite. \p negative: directions that the joints leave free in which
/// the whole is not definite.
bool Articulation::Run::factorize_joints(int& negative)
{
    const std::size_t num_rows = rows_.size();
    columns_.assign(objects_.size(), {});
    of_added_.clear();
    std::vector<double> subtract;
    std::vector<std::size_t> owner;
    each(
        [&](std::size_t a, ArticulableObject& object)
        {
            for (const ArticulableObject::Added& added : object.added())
            {
                of_added_.push_back({{added.unknown, 1.0}});
                subtract.push_back(1.0 / added.stiffness);
                owner.push_back(a);
            }
        });
    num_columns_ = static_cast<Eigen::Index>(num_rows + of_added_.size());
    std::vector<double> alone(num_rows, 0.0);
    const auto add_column = [&](std::size_t a, std::size_t number, const SparseRow& row)
    {
        Column column{static_cast<int>(number), &row, {}, {}};
        column.moved.setZero(objects_[a]->num_unknowns());
        for (const auto& [unknown, value] : row)
            column.moved[unknown] = value;
        column.own.setZero(here_[a].violation.size());
        objects_[a]->solve(column.moved, column.own);
        columns_[a].push_back(std::move(column));
    };
    for (std::size_t r = 0; r < num_rows; ++r)
        for (const std::size_t end : {0u, 1u})
        {
            const SparseRow& row = rows_[r].entries[end];
            const std::size_t a = idx(joints_[rows_[r].joint].object[end]);
            if (row.empty())
                continue;
            add_column(a, r, row);
            for (const auto& [unknown, value] : row)
                if (const double k = objects_[a]->stiffness_of(unknown); k > 0.0)
                    alone[r] = std::max(alone[r], value * value / k);
        }
    for (std::size_t k = 0; k < of_added_.size(); ++k)
        add_column(owner[k], num_rows + k, of_added_[k]);
    const int count = static_cast<int>(num_columns_);
    // With the other sign, so that rows of joints look like rows of constraints.
    BandMatrix S(count, count - 1);
    for (const std::vector<Column>& columns : columns_)
        for (const Column& i : columns)
            for (const Column& j : columns)
            {
                if (i.number < j.number)
                    continue;
                double sum = 0.0;
                for (const auto& [unknown, value] : *i.entries)
                    sum += value * j.moved[unknown];
                S.lower(i.number, j.number) -= sum;
            }
    for (std::size_t k = 0; k < of_added_.size(); ++k)
        S.lower(static_cast<int>(num_rows + k), static_cast<int>(num_rows + k)) +=
            subtract[k];
    for (std::size_t r = 0; r < num_rows; ++r)
        if (const int at = static_cast<int>(r);
            std::abs(S.lower(at, at)) <= kStiff * alone[r])
            for (int other = 0; other < count; ++other)
                S.lower(std::max(at, other), std::min(at, other)) = 0.0;
    std::vector<char> is_row(idx(count), 0);
    std::fill_n(is_row.begin(), num_rows, 1);
    const BandFactor::Report told = joint_factor_.factorize(S, is_row);
    report_.num_dropped += told.num_dropped;
    negative = told.num_negative;
    is_idle_.assign(num_rows, 0);
    for (std::size_t r = 0; r < num_rows; ++r)
        if (joint_factor_.is_left_out(static_cast<int>(r)))
        {
            is_idle_[r] = 1;
            joints_here_[static_cast<Eigen::Index>(r)] = 0.0;
        }
    return told.is_finite;
}

/// Steps and multipliers from forces and violations.
void Articulation::Run::solve(std::vector<Eigen::VectorXd>& r,
                              std::vector<Eigen::VectorXd>& own,
                              Eigen::VectorXd& joints) const
{
    for (std::size_t a = 0; a < objects_.size(); ++a)
        objects_[a]->solve(r[a], own[a]);
    if (rows_.empty())
        return;
    Eigen::VectorXd m = Eigen::VectorXd::Zero(num_columns_);
    m.head(joints.size()) = joints;
    for (std::size_t a = 0; a < objects_.size(); ++a)
        for (const Column& column : columns_[a])
            for (const auto& [unknown, value] : *column.entries)
                m[column.number] += value * r[a][unknown];
    joint_factor_.solve(m);
    for (std::size_t a = 0; a < objects_.size(); ++a)
        for (const Column& column : columns_[a])
        {
            r[a] += m[column.number] * column.moved;
            own[a] += m[column.number] * column.own;
        }
    joints = m.head(joints.size());
}

/// Goes on from the step that leaves out what is of two objects, C, by conjugate
/// gradients with that solve as preconditioner. Steps p after the first keep the rows, L
/// p = 0; with A p - L^T m = a, which follows from the residuals, p . (A + C) p = p . (a
/// + C p).
void Articulation::Run::solve_coupled()
{
    constexpr int kMost = 300;
    constexpr double kTolerance = 1e-6; // of the square of the first residual
    using Parts = std::vector<Eigen::VectorXd>;
    const auto zero_like = [](Parts parts)
    {
        for (Eigen::VectorXd& part : parts)
            part.setZero();
        return parts;
    };
    const auto dot = [](const Parts& a, const Parts& b)
    {
        double sum = 0.0;
        for (std::size_t k = 0; k < a.size(); ++k)
            sum += a[k].dot(b[k]);
        return sum;
    };
    const auto add = [](Parts& to, double scale, const Parts& parts)
    {
        for (std::size_t k = 0; k < to.size(); ++k)
            to[k] += scale * parts[k];
    };
    const Parts none = zero_like(step_), no_own = zero_like(next_lambda_);
    Parts product = none;
    all_.coupling_->add_product(step_, product);
    Parts residual = none;
    add(residual, -1.0, product);
    Parts a = residual, p = residual, own = no_own;
    Eigen::VectorXd joints = Eigen::VectorXd::Zero(next_joint_lambda_.size());
    solve(p, own, joints);
    double square = dot(residual, p);
    const double enough = kTolerance * square;
    for (int k = 0; k < kMost && square > enough; ++k)
    {
        product = none;
        all_.coupling_->add_product(p, product);
        const double curvature = dot(p, a) + dot(p, product);
        if (!(curvature > 0.0))
            return;
        const double length = square / curvature;
        add(step_, length, p);
        add(next_lambda_, length, own);
        next_joint_lambda_ += length * joints;
        add(residual, -length, a);
        add(residual, -length, product);
        Parts z = residual, of_z = no_own;
        Eigen::VectorXd joints_of_z = Eigen::VectorXd::Zero(joints.size());
        solve(z, of_z, joints_of_z);
        const double next = dot(residual, z), share = next / square;
        square = next;
        const auto go_on = [share](Parts& direction, const Parts& by)
        {
            for (std::size_t i = 0; i < by.size(); ++i)
                direction[i] = by[i] + share * direction[i];
        };
        go_on(p, z);
        go_on(own, of_z);
        go_on(a, residual);
        joints = joints_of_z + share * joints;
    }
}

/// Takes back what a part of the step stretches to second order.
void Articulation::Run::correct(double length)
{
    double most = 0.0;
    for (const Eigen::VectorXd& step : step_)
        most = std::max(most, largest(step));
    const double left = 1.0 - length * reach_;
    double last = std::numeric_limits<double>::infinity();
    for (int correction = 0; correction < kCorrections; ++correction)
    {
        each(
            [&](std::size_t a, ArticulableObject& object)
            {
                right_[a].setZero(step_[a].size());
                object.add_correction(length * step_[a], right_[a]);
                object.measure(true, there_[a]);
                values_[a] = there_[a].violation - left * here_[a].violation;
            });
        Eigen::VectorXd joints = all_.joint_violations(true);
        for (Eigen::Index r = 0; r < joints.size(); ++r)
            joints[r] = is_idle_[static_cast<std::size_t>(r)]
                            ? 0.0
                            : joints[r] - left * joints_here_[r];
        solve(right_, values_, joints);
        double now = 0.0;
        bool is_finite = true;
        for (const Eigen::VectorXd& right : right_)
        {
            now = std::max(now, largest(right));
            is_finite = is_finite && right.allFinite();
        }
        if (!is_finite || now > kWorse * last)
        {
            // Corrections that grow are none: joints that nearly say the same.
            each([&](std::size_t a, ArticulableObject& object)
                 { object.try_step(step_[a], length); });
            return;
        }
        last = now;
        each([&](std::size_t a, ArticulableObject& object)
             { object.try_more(right_[a]); });
        if (now <= kCorrected * most)
            return;
    }
}

/// Whether a part of the step lowers the merit enough. The trials become its end.
bool Articulation::Run::try_length(double length)
{
    const auto is_lower = [&]
    {
        measure(true, there_, joints_there_);
        return merit(there_, joints_there_, coupled_there_) <=
               before_ + 1e-4 * length * std::min(slope_, 0.0) + noise_;
    };
    each([&](std::size_t a, ArticulableObject& object)
         { object.try_step(step_[a], length); });
    // Small steps of soft rods need no correction.
    if (length * reach_ * turn_ < kSmallTurn && is_lower())
        return true;
    correct(length);
    return is_lower();
}

/// Goes on by one step. False where none lowers the merit.
bool Articulation::Run::advance()
{
    turn_ = 0.0;
    each([&](std::size_t a, ArticulableObject& object)
         { turn_ = std::max(turn_, object.turn(step_[a])); });
    const bool is_capped = turn_ > ArticulableObject::kTurn;
    reach_ = is_capped ? ArticulableObject::kTurn / turn_ : 1.0;
    double presses = largest(next_joint_lambda_),
           violated = joints_here_.cwiseAbs().sum();
    double scale = size_, cancelled = 0.0;
    slope_ = 0.0;
    each(
        [&](std::size_t a, ArticulableObject& object)
        {
            step_[a] *= reach_;
            presses = std::max(presses, largest(next_lambda_[a]));
            violated += here_[a].violation.cwiseAbs().sum();
            slope_ += gradient_[a].dot(step_[a]);
            scale = std::max(scale, object.extent());
            cancelled += object.cancelled();
        });
    const bool has_rows = presses > 0.0 || violated > 0.0;
    // The penalty may fall again, slowly: where the first steps are wild it is huge.
    if (has_rows)
        penalty_ = std::max(1.5 * presses, std::sqrt(penalty_ * 1.5 * presses));
    before_ = merit(here_, joints_here_, coupled_here_);
    slope_ -= penalty_ * reach_ * violated;
    // What rounding makes of the sums.
    noise_ = all_.rounding_ =
        64.0 * kRounding * (std::abs(before_) + cancelled + penalty_ * scale);
    double length = 1.0;
    for (int halving = 0; !try_length(length); length *= 0.5)
        if (++halving == kHalvings)
            return false;
    const bool is_whole = !is_capped && length >= 0.25;
    each([&](std::size_t a, ArticulableObject& object)
         { object.accept(is_whole ? &step_[a] : nullptr); });
    std::swap(all_.lambda_, next_lambda_);
    std::swap(all_.joint_lambda_, next_joint_lambda_);
    std::swap(here_, there_);
    for (ArticulableObject::Measure& one : here_)
        one.work = 0.0;
    std::swap(joints_here_, joints_there_);
    std::swap(coupled_here_, coupled_there_);
    return true;
}

MotionReport Articulation::Run::operator()()
{
    each([](std::size_t, ArticulableObject& object) { object.begin(); });
    measure(false, here_, joints_here_);
    for (; look(); ++report_.iterations)
    {
        if (!factorize())
        {
            report_.stop = MotionStop::NotFinite;
            break;
        }
        each(
            [&](std::size_t a, ArticulableObject&)
            {
                step_[a] = -gradient_[a];
                next_lambda_[a] = here_[a].violation;
            });
        next_joint_lambda_ = joints_here_;
        solve(step_, next_lambda_, next_joint_lambda_);
        if (all_.coupling_ && all_.coupling_->has_product())
            solve_coupled();
        if (!std::all_of(step_.begin(), step_.end(),
                         [](const Eigen::VectorXd& step) { return step.allFinite(); }))
        {
            report_.stop = MotionStop::NotFinite;
            break;
        }
        if (!advance())
        {
            report_.stop =
                is_balanced_ && keeps_constraints() ? converged() : MotionStop::NoDescent;
            break;
        }
    }
    if (!rows_.empty())
        press_joints(all_.joint_lambda_);
    return report_;
}

std::vector<Wrench> Articulation::joint_wrenches() const
{
    std::vector<Wrench> out(joints_.size());
    Eigen::Index next = 0;
    for (std::size_t j = 0; j < joints_.size(); ++j)
    {
        const Joint& joint = joints_[j];
        if (!is_held(joint) || next + num_rows(joint) > joint_lambda_.size())
            continue;
        const std::array<Vector3d, 3> n = directions(
            joint, *objects_[idx(joint.object[0])], *objects_[idx(joint.object[1])]);
        Vector3d& to = joint.kind == Joint::Kind::Frame ? out[j].couple : out[j].force;
        for (int k = 0; k < num_rows(joint); ++k)
            to += joint_lambda_[next++] * n[idx(k)];
    }
    return out;
}

bool Articulation::is_pulled() const
{
    constexpr double kKept = 1e-9;
    double size = 1.0, most = largest(joint_violations(false));
    for (const ArticulableObject* const object : objects_)
    {
        size = std::max(size, object->size());
        most = std::max(most, object->own_violation());
    }
    return most > kKept * size;
}

bool Articulation::is_beyond() const
{
    return std::any_of(objects_.begin(), objects_.end(),
                       [](const ArticulableObject* one) { return one->is_beyond(); });
}

MotionReport Articulation::solve(const MotionOptions& options)
{
    MotionReport report;
    report.iterations = 0;
    // What sticks, what slips, and how strong friction is, is told by multipliers.
    for (int tries = 0; tries < kTries; ++tries)
    {
        const int before = report.iterations;
        report = Run(*this, options)();
        report.iterations += before;
        if (!is_solved(report.stop) && !is_beyond())
            break;
        using Again = ArticulableObject::Again;
        Again again = Again::No;
        for (std::size_t a = 0; a < objects_.size(); ++a)
            again =
                std::max(again, objects_[a]->again(lambda_[a], tries >= kModeChanges));
        if (coupling_)
            again = std::max(again, coupling_->again(tries >= kModeChanges));
        if (again == Again::No)
            break;
        if (again == Again::FromBegin)
            for (ArticulableObject* const object : objects_)
                object->go_back();
    }
    return report;
}

} // namespace cellwarp::core
