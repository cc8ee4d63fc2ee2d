// SPDX-License-Identifier: GPL-3.0-or-later
// A rod of a scene, built from its statement.
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "io/scene/rod_scene.h"
#include "library/time/object_in_time.h"
#include "octree/base/rigid_motion.h"
#include "solver/contact/rod_contacts.h"
#include "solver/rods/inner_forces.h"
#include "solver/rods/point_springs.h"
#include "solver/rods/rod_object.h"
#include "solver/rods/rod_refinement.h"

namespace cellwarp::core
{

class RodPart final : public ObjectInTime
{
public:
    /// Number \p index of the scene, seen from \p origin, as it is at the start, but for
    /// what is on other rods. Throws Fault::Malformed with the key that cannot be.
    RodPart(const RodScene& scene, std::size_t index, const Eigen::Vector3d& origin);

    JointEnd::Kind kind() const override { return JointEnd::Kind::Rod; }
    std::string name() const override { return statement_.name; }
    bool carries() const { return statement_.carries; }
    double radius() const ///< the largest [m]
    {
        return *std::max_element(statement_.line.radii.begin(),
                                 statement_.line.radii.end());
    }
    const Eigen::Vector3d& origin() const { return origin_; } ///< of its places [m]
    Rod rod;
    RodModel model;
    RodState state;
    Eigen::VectorXd velocity;
    std::vector<std::string> warnings; ///< what a user may not expect of the start

    double parameter(double share) const { return rod.arc_length().parameter(share); }
    /// A place that slides; where it starts is the nearest to \p point, unless the
    /// statement tells. \p where is its key.
    int add_slide(const SlideStatement& of, const Eigen::Matrix3d& held,
                  const Eigen::Vector3d& point, const std::string& where);
    /// The last two slides stay so far from each other, of the length.
    void keep_last_two_apart(double share);
    /// After the last slide: on a closed rod the first stays apart from the last, too.
    void close_gaps();
    /// Something holds it, or it needs nothing to.
    bool has_equilibrium() const;
    bool is_held() const override { return !model.is_free() || (springs_ != nullptr); }

    /// Made when it is asked for first: a rod that nothing joins moves without it.
    RodObject& articulable() override;
    Eigen::Vector3d place_of(const JointEnd& end,
                             const std::string& where) const override;
    /// Knots stay where a joint holds it.
    int add_place(const JointEnd& end, const SlideStatement& slide,
                  const std::string& where, const Eigen::Vector3d& other) override;
    /// The end of a joint that was added last, as contacts see it.
    const PlaceOnRod& last_end() const { return last_end_; }

    /// Loads have their values of the time, too.
    void hold_at(double time, double share) override;
    void lead(const KeyTime& from, const KeyTime& to, double duration) override;
    double turned(double begin, double end) const override;
    double first_turn() const override;
    double largest_turn() const override;

    void add_to(SimulationReport& report) const override;
    void add_to(int places, SimulatedObjects& out) const override;
    void add_to(Eigen::AlignedBox3d& box) const override;

    /// Whether knots may come or go, or it may be cut.
    bool may_change() const { return refinement_ || !statement_.cuts.empty(); }
    /// What a step has led to: cuts that are due, knots that come and go. \p touched:
    /// parameters that touch something. False: nothing changed.
    bool change(double time, std::span<const double> touched);

    /// A part that cuts have left: parameters, and the spans between them.
    struct Piece
    {
        std::string name; ///< "rope", of several "rope.1", ...
        double begin = 0.0, end = 0.0;
        std::vector<std::size_t> spans;
        bool is_closed = false;
    };
    std::vector<Piece> pieces() const;
    double length(const Piece& piece) const; ///< now [m]
    /// Shares of the whole rest length where its slides are.
    std::vector<double> sliding(const Piece& piece) const;
    /// Places at equal shares of a piece's rest length.
    std::vector<Eigen::Vector3d> curve(const Piece& piece, int places) const;
    /// Forces of the sections at those places, and their frames.
    std::vector<std::pair<SectionForces, Eigen::Matrix3d>> sections(const Piece& piece,
                                                                    int places) const;
    /// The force and couple of a hold on the rod, with the key of the hold in the scene.
    struct HeldForce
    {
        std::string key;
        Eigen::Vector3d at; ///< [m]
        Wrench wrench;
    };
    std::vector<HeldForce> reactions(const Eigen::VectorXd& multipliers) const;
    /// As tubes, \p around corners on each ring, coloured by which side of the material
    /// they are on; or as the skin that the statement asks for.
    void add_surface(int around, Geometry& out) const override;

private:
    /// Places of curve(): spans and parameters.
    std::vector<std::pair<std::size_t, double>> along(const Piece& piece,
                                                      int places) const;
    void add_tube(int around, Geometry& out) const;
    void add_skin(Geometry& out) const;
    void warn_of_curve();
    void add_holds();
    void add_springs();
    void add_on();

    const RodStatement& statement_;
    const std::string path_, where_; ///< of the scene; "rods[0]"
    const Eigen::Vector3d origin_;
    PointSprings* springs_ = nullptr; ///< of the model's terms
    /// The numbers of a statement's spring and of its drag in springs_; -1: none.
    struct SpringAt
    {
        int spring = -1, drag = -1;
    };
    std::vector<SpringAt> springs_at_;
    /// Of each hold its first constraint, its rest place and frame.
    struct Held
    {
        const MoveKeys* keys;
        const TimeWindow* window; ///< null: always
        std::size_t first, count;
        Eigen::Vector3d place;
        Eigen::Matrix3d frame;
        Eigen::Vector3d second, bend; ///< of the curve: derivative, curvature [1/m]
        std::string key;
        Eigen::Matrix3d R = Eigen::Matrix3d::Identity(); ///< how far keys have turned it
        Motion opened = {}; ///< of its keys where it began; none if it always acts
    };
    Motion motion_of(const Held& held, double time, double share) const;
    void bring(const Held& held, const Eigen::Vector3d& place, const Eigen::Matrix3d& R,
               const Eigen::Vector3d& speed, const Eigen::Vector3d& turning);
    void spin(Held& held, const Eigen::Matrix3d& R);
    void open_holds(double time, double begin);
    void set_loads(double time);
    bool changes_loads() const;
    RodConstraint* spin_of(const Held& held);
    bool has_tangent(double at) const;
    Eigen::Vector3d bend_at(double s) const;
    std::vector<Held> held_;
    /// The slide that the next one with `apart` stays apart from, and by how much.
    std::optional<std::pair<int, double>> last_apart_;
    int first_apart_ = -1;
    std::optional<RodRefinement> refinement_;
    std::vector<char> is_cut_;   ///< those of the statement that are done
    std::vector<double> joined_; ///< parameters
    const std::size_t index_;    ///< of the scene
    PlaceOnRod last_end_;
    std::optional<RodObject> object_;
};

} // namespace cellwarp::core
