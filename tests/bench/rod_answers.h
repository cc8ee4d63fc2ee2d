// SPDX-License-Identifier: GPL-3.0-or-later
// Rods against numbers that exact theory knows: a table, one row a number.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "solver/rods/elasticity.h"
#include "solver/rods/rod_model.h"
#include "solver/rods/rod_newton.h"

namespace cellwarp::core
{

class Answers
{
public:
    /// A new table.
    void begin(const std::string& title);
    /// \p run gives our number; its time is taken. \p of: what the error is a share of;
    /// 0: of the exact number. \p points: control points.
    void add(const std::string& what, double exact, int points,
             const std::function<double()>& run, double of = 0.0);
    void print() const;

private:
    struct Row
    {
        std::string what;
        double exact, ours, error;
        int points;
        double seconds;
    };
    struct Table
    {
        std::string title;
        std::vector<Row> rows;
    };
    std::vector<Table> tables_;
};

/// A rod with its model and state.
struct RodCase
{
    Rod rod;
    RodModel model;
    RodState state;

    explicit RodCase(Rod of) : rod(std::move(of)), model(rod), state(rod)
    {
        model.terms.push_back(exact_elasticity(rod));
    }
    double begin() const { return rod.basis().begin(); }
    double end() const { return rod.basis().end(); }
    void pull(const Eigen::Vector3d& force)
    {
        model.loads.push_back({end(), force, Eigen::Vector3d::Zero()});
    }
    void hold(HoldKind what, double s, const Eigen::Vector3d& direction);
    /// Place, tangent and twist, as they are.
    void clamp(double s);
    /// Throws std::runtime_error where it does not converge.
    MotionReport settle();
    /// Whether no step that the holds leave free lowers the energy.
    bool is_stable();
};

/// The largest value up to which \p is_stable, between two.
double bisected(double low, double high, const std::function<bool(double)>& is_stable);

/// Slender: stretch is this much stiffer than bending.
inline constexpr double kSlender = 1e9;

Section slender_section(double bending, double twist);
/// Along x from the origin, control points in number.
Rod straight_case(double length, int points, const Section& section,
                  const RodSettings& settings = {});
/// A circle of radius 1 about z.
Rod ring_case(int points, const Section& section, const RodSettings& settings);

void add_statics(Answers& answers);
void add_stability(Answers& answers);
void add_vibrations(Answers& answers);
void add_motion(Answers& answers);
void add_sliding(Answers& answers);

} // namespace cellwarp::core
