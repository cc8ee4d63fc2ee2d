// SPDX-License-Identifier: GPL-3.0-or-later
// A rod at rest, and where it is. Between two knots lies a span; at each knot stands a
// station, which keeps a unit vector across the curve and an angle of the material about
// it. theory of the frames: rod.cpp.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "solver/rods/gauss.h"
#include "solver/rods/spline.h"

namespace cellwarp::core
{

/// What a cross section withstands and weighs, at one place of the rod.
struct Section
{
    double stretch = 0.0; ///< YA [N]
    std::array<double, 2> bending =
        {};              ///< YI about both directions of the section [N m^2]
    double twist = 0.0;  ///< GJ [N m^2]
    double mass = 0.0;   ///< rho A [kg/m]
    double spin = 0.0;   ///< rho (I_1 + I_2) [kg m]
    double radius = 0.0; ///< [m]

    /// A full circle: \p young [Pa], \p poisson, \p density [kg/m^3].
    static Section round(double radius, double young, double poisson, double density);
};

/// What the rod is like where nothing acts on it.
enum class RodRest
{
    Given,   ///< as its control points say
    Straight ///< of the same lengths
};

struct RodSettings
{
    RodRest rest = RodRest::Given;
    double rest_twist = 0.0; ///< [rad/m], beside that of the rest shape
    double link = 0.0;       ///< turns put into a closed rod before it was joined
    int coupled_spans = 1;   ///< successive ones that an energy couples: 1 or 2
    /// Direction 1 of the section at the begin is the part of this across the rod;
    /// nothing: any direction.
    std::optional<Eigen::Vector3d> normal = {};
};

/// Where the unknowns of a rod stand in vectors, so that neighbours along it are
/// neighbours there: 3 of each control point, 1 angle of each station.
struct RodLayout
{
    std::vector<int> control; ///< first of three
    std::vector<int> angle;   ///< of each station
    int num_unknowns = 0;
    int half_band = 0; ///< of what RodSettings::coupled_spans couple
};

/// What a rod weighs by its parameter, between two of them: cubics, so that the mass of
/// parts that are cut out is that of the whole to the last digit.
struct Weight
{
    double begin = 0.0, end = 0.0;   ///< parameters
    std::array<double, 4> mass = {}; ///< rho A sigma at Gauss points [kg]
    std::array<double, 4> spin = {}; ///< rho (I_1 + I_2) sigma there [kg m^2]
    double mass_at(double s) const { return at(mass, s); }
    double spin_at(double s) const { return at(spin, s); }

private:
    double at(const std::array<double, 4>& values, double s) const;
};

/// One span, between two different knots.
struct RodSpan
{
    double begin = 0.0, end = 0.0;      ///< parameter
    std::array<int, 2> station = {};    ///< at both ends
    double length = 0.0;                ///< at rest [m]
    std::array<bool, 2> is_smooth = {}; ///< false: an end, or a knot of less than C^(d-1)
};

/// A knot that came into a rod or went, and which spans and stations are still the same.
/// Numbers before the change are -1 for what was not there.
struct RodChange
{
    bool is_insertion = true;
    std::vector<int> span_from; ///< of each span
    std::vector<int> station_from;
    /// The first half of a span that was cut in two, or the span that two have become;
    /// -1: the knot has only become more or less smooth.
    int span = -1;
    RodLayout before;
    KnotChange knot;
};

/// Changed by knots alone; its states, and all that is built on it, refer to it and
/// follow.
class Rod
{
public:
    /// \p section: at a share of the rest length in [0, 1]. Throws std::invalid_argument
    /// for a curve without length, and for a normal along it.
    Rod(Spline rest, const std::function<Section(double)>& section,
        const RodSettings& settings);

    /// One knot more. Rest curve and mass stay the same.
    /// Throws std::invalid_argument at the ends.
    RodChange insert_knot(double s);
    /// One knot less: that of \p removal, of this basis.
    RodChange remove_knot(const KnotRemoval& removal);
    /// Parts that cuts have left, parameters of each from begin to end; of a closed rod
    /// the end of one may be a turn further.
    std::vector<std::array<double, 2>> pieces() const;

    const Spline& rest() const { return rest_; }
    const SplineBasis& basis() const { return rest_.basis; }
    const ArcLength& arc_length() const { return arc_length_; }
    /// At rest, but for what rounding makes of a straight line.
    bool is_straight() const { return is_straight_; }
    const RodSettings& settings() const { return settings_; }
    const RodLayout& layout() const { return layout_; }
    std::span<const RodSpan> spans() const { return spans_; }
    int num_controls() const { return rest_.basis.num_controls(); }
    int num_stations() const { return num_stations_; }
    /// By how much the angle of span \p e's far station is larger than that station's
    /// own: the turns of a closed rod, at its seam.
    double seam_turn(std::size_t span) const
    {
        return rest_.basis.is_closed() && span + 1 == spans_.size() ? seam_turn_ : 0.0;
    }
    /// How many control points act in a span, and how many places it is looked at:
    /// station, bending places, station.
    int order() const { return order_; }
    int num_places() const { return num_bending_ + 2; }
    /// Where bending is measured: Gauss points of a span, degree - 1 of them.
    std::span<const double> bending_places() const { return gauss_places(num_bending_); }
    std::span<const double> bending_weights() const
    {
        return gauss_weights(num_bending_);
    }
    /// The places of a span at which stretch is measured, as shares of it, and their
    /// weights, whose sum is 1: elasticity.cpp.
    std::span<const double> stretch_places(std::size_t span) const;
    std::span<const double> stretch_weights(std::size_t span) const;
    /// A place of a span as a share of it.
    double place(int k) const
    {
        return k == 0 ? 0.0 : k > num_bending_ ? 1.0 : bending_places()[idx(k) - 1];
    }
    /// The sum of the cubes of the steps from place to place, c_0 in rod.cpp.
    double cubes_of_steps() const { return cubes_of_steps_; }
    /// order() of them.
    const int* controls(std::size_t span) const { return &controls_[span * idx(order_)]; }
    /// db_k/ds and d2b_k/ds2 at a place of a span, order() of them.
    const double* first(std::size_t span, int place) const
    {
        return &first_[(span * idx(num_places()) + idx(place)) * idx(order_)];
    }
    const double* second(std::size_t span, int place) const
    {
        return &second_[(span * idx(num_places()) + idx(place)) * idx(order_)];
    }
    /// Of a span, as it was before knots came in.
    const Weight& weight(std::size_t span) const { return weights_[span]; }
    Section section(double share) const { return section_(share); }
    Section section_at(double s) const
    {
        return section_(arc_length_.at(s) / arc_length_.total());
    }

private:
    void find_spans();
    bool is_between_c1(std::size_t span) const;
    int num_stretch(std::size_t span) const;
    void find_places();
    Weight weighed(std::size_t span) const;
    void find_layout();
    RodChange change_to(Spline rest, const KnotChange& knot, bool is_insertion);

    Spline rest_;
    ArcLength arc_length_;
    std::function<Section(double)> section_;
    RodSettings settings_;
    std::vector<RodSpan> spans_;
    int num_stations_ = 0;
    double seam_turn_ = 0.0;
    bool is_straight_ = true;
    int order_ = 0, num_bending_ = 0;
    double cubes_of_steps_ = 0.0;
    std::vector<int> controls_;
    std::vector<double> first_, second_;
    std::vector<Weight> weights_; ///< of the spans
    RodLayout layout_;
};

/// Where a place that slides (slide.h) is, and what it does.
struct Sliding
{
    enum class Mode
    {
        Slips,
        Sticks,
        AtBegin, ///< stopped at an end of its range
        AtEnd,
        Gone ///< released there
    };
    double s = 0.0;     ///< parameter of the curve
    double speed = 0.0; ///< ds/dt
    Mode mode = Mode::Slips;
    double drive = 0.0; ///< tau: friction against s while a step is solved for [N by ds]
    double weight = 0.0, from = 0.0; ///< inertia of the step, and where it leads to alone

    bool is_free() const { return mode == Mode::Slips; }
};

/// Where a rod is: control points and angles, the unit vectors of its stations.
class RodState
{
public:
    std::vector<Sliding> sliding; ///< of the slides of its model
    std::vector<char> touches;    ///< gaps of its model that are closed

    /// At rest; turns put into a closed rod are spread evenly. The rod must outlive it.
    explicit RodState(const Rod& rod);

    const Rod& rod() const { return *rod_; }
    /// Control points [m] and angles [rad], see RodLayout.
    const Eigen::VectorXd& x() const { return x_; }
    Eigen::Vector3d control(int k) const
    {
        return x_.segment<3>(rod_->layout().control[idx(k)]);
    }
    double angle(int station) const { return x_[rod_->layout().angle[idx(station)]]; }
    /// The vector that the angle of a station counts from.
    const Eigen::Vector3d& reference(int station) const
    {
        return reference_[idx(station)];
    }
    /// How far the stations' vectors are wound against each other, m_e in rod.cpp.
    double winding(std::size_t span) const { return winding_[span]; }
    /// Delta_e: how far the material of a span is twisted [rad].
    double twist(std::size_t span) const;

    /// x += length * step, and what follows in \p step moves what slides. Vectors of the
    /// stations go along without spinning.
    void move(const Eigen::VectorXd& step, double length = 1.0);
    /// To other places, by the shortest turn of each station.
    void move_to(const Eigen::VectorXd& x);
    /// The rod has another knot: to these control points, stations as they were. Where
    /// one came it is twisted as evenly as the span was.
    void follow(const RodChange& change, std::span<const Eigen::Vector3d> controls);

    /// P' at a place of a span, its direction and length.
    struct Velocity
    {
        Eigen::Vector3d first, tangent;
        double length;
    };
    /// Of all places of a span, num_places() of them.
    const Velocity* velocities(std::size_t span) const
    {
        return &velocity_[span * idx(rod_->num_places())];
    }
    const Velocity& velocity(std::size_t span, int place) const
    {
        return velocities(span)[place];
    }
    CurvePoint at(double s) const { return at(rod_->basis().values(s)); }
    CurvePoint at(const BasisValues& values) const;
    /// Material frame at a parameter: columns m_1, m_2, tangent.
    Eigen::Matrix3d frame(double s) const;
    /// The same in a span, both ends included: at a cut this tells of which side.
    Eigen::Matrix3d frame_in(std::size_t span, double s) const;
    Spline curve() const;

private:
    void find_velocities();
    template <class Order>
    void find_velocities(Order order);
    void find_windings();
    void turn_stations();

    const Rod* rod_;
    Eigen::VectorXd x_;
    std::vector<Velocity> velocity_;                   ///< of all places of all spans
    std::vector<Eigen::Vector3d> tangent_, reference_; ///< of the stations
    std::vector<double> chain_, winding_;              ///< of the spans
};

} // namespace cellwarp::core
