// SPDX-License-Identifier: GPL-3.0-or-later
// Rods that touch each other, themselves and obstacles: balls along them that press each
// other apart. rod_contacts.cpp has the law. [Lenoir04]
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "solver/contact/ball_grid.h"
#include "solver/contact/obstacle.h"
#include "solver/dynamics/coupling.h"
#include "solver/rods/rod_object.h"

namespace cellwarp::core
{

struct ContactSettings
{
    double friction = 0.0;           ///< Coulomb's mu
    double damping = 1.0;            ///< of the bounce; 1: critical
    std::optional<double> stiffness; ///< of a ball [N/m]; else that of its material
    bool between_rods = true, with_itself = true;
};

/// A place of a rod: a parameter, or what slides.
struct PlaceOnRod
{
    std::size_t rod = 0;
    double s = 0.0;
    int slide = -1;
};

/// What touches at the end of a step.
struct ContactReport
{
    int count = 0; ///< pairs of balls, and of balls and obstacles
    /// Smallest distance, of the thickness; nothing: none are near.
    std::optional<double> least;
};

class RodContacts final : public Coupling
{
public:
    explicit RodContacts(const ContactSettings& settings) : settings_(settings) {}

    /// All must outlive it. \p radius [m]; else that of the section. \p object: the
    /// number that it has in an articulation, where it steps implicitly.
    struct Member
    {
        RodModel* model;
        RodState* state;
        const Eigen::VectorXd* velocity;
        std::optional<double> radius;
        RodObject* object = nullptr;
        std::size_t number = 0;
    };
    void add_rod(const Member& rod);
    void add_obstacle(std::unique_ptr<Obstacle> obstacle);
    /// Around two places that are joined nothing touches.
    void exempt(const PlaceOnRod& a, const PlaceOnRod& b);

    // Implicit steps.

    bool start(double step) override;
    double value(bool of_trial) override;
    double linearise(std::vector<Eigen::VectorXd>& gradient) override;
    bool has_product() const override { return has_product_; }
    void add_product(const std::vector<Eigen::VectorXd>& x,
                     std::vector<Eigen::VectorXd>& out) const override;
    ArticulableObject::Again again(bool is_last) override;
    void finish() override;
    void undo() override { grips_ = grips_before_; }
    bool is_beyond() override;
    double energy() const override;

    // Explicit steps.

    /// The forces of a step from the states on [N], for each rod.
    std::vector<Eigen::VectorXd> forces(double step);
    /// Of how many parts a step must be, so that nothing goes through anything.
    int parts(double step);

    // Of the last step's begin and the states now.

    ContactReport report() const;
    /// The force of a contact at its place.
    struct Force
    {
        std::size_t a = 0;
        std::ptrdiff_t b = -1;       ///< rods; -1: an obstacle
        double s_a = 0.0, s_b = 0.0; ///< parameters of them
        Eigen::Vector3d place;       ///< [m]
        Eigen::Vector3d force;       ///< on a [N]
    };
    const std::vector<Force>& acting() const { return acting_; }
    /// Parameters of a rod that touch something, ascending.
    std::vector<double> touched(std::size_t rod) const;
    int num_balls() const { return static_cast<int>(balls_.size()); }

private:
    struct Ball
    {
        std::size_t rod = 0;
        double s = 0.0, along = 0.0; ///< parameter, length at rest up to there
        double radius = 0.0, stiffness = 0.0;
        double loose = 0.0; ///< how far a force moves it, the inverse of a mass [1/kg]
        int count = 0;
        std::array<int, kMaxOrder> unknown = {};
        std::array<double, kMaxOrder> share = {};
    };
    struct Contact
    {
        std::size_t a = 0;
        std::ptrdiff_t b = -1;  ///< the other ball; -1: an obstacle
        Eigen::Vector3d normal; ///< towards a
        Eigen::Vector3d place;  ///< of the obstacle; else 0
        Eigen::Vector3d begin;  ///< a - b then
        double reach = 0.0;     ///< where both touch
        double mass = 0.0;      ///< of both against each other [kg]
        double stiffness = 0.0; ///< [N/m]
        // Of an implicit step.
        double whole = 0.0, shift = 0.0; ///< with damping
        double grip = 0.0;               ///< most that friction holds [N]
        /// How far friction had stretched the tangential spring at the begin [m].
        Eigen::Vector3d stretch = Eigen::Vector3d::Zero();
        Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
        bool is_pressed = false; ///< second is not zero
    };

    /// The friction of a contact, kept for the next step.
    struct Grip
    {
        std::size_t a = 0;
        std::ptrdiff_t b = -1;               ///< rods; -1: an obstacle
        double along_a = 0.0, along_b = 0.0; ///< lengths at rest up to the balls [m]
        double radius = 0.0;
        Eigen::Vector3d normal;
        double press = 0.0;    ///< [N]
        Eigen::Vector3d force; ///< of friction on a [N]
    };
    const Grip* grip_of(const Contact& contact) const;
    void add_acting(const Contact& contact, const Eigen::Vector3d& at,
                    const Eigen::Vector3d& force);
    double press(const Contact& contact, const Eigen::Vector3d& y) const;
    Eigen::Vector3d slip(const Contact& contact, const Eigen::Vector3d& y) const;

    static double least_radius(const Member& of);
    void place_balls();
    void place_balls_on(std::size_t rod);
    /// All contacts, or as many as a limit allows: false where there are more.
    enum class Limit
    {
        None,
        OfBalls ///< so many for each ball
    };
    bool find_contacts(double margin, Limit limit);
    bool is_exempt(const Ball& a, const Ball& b) const;
    Eigen::Vector3d place(const Ball& ball, const Eigen::VectorXd& x) const;
    Eigen::Vector3d between(const Contact& contact, bool of_trial) const;
    const Eigen::VectorXd& x_of(std::size_t rod, bool of_trial) const;
    void push(const Ball& ball, const Eigen::Vector3d& force, Eigen::VectorXd& out) const;
    double largest_way(double step) const;
    bool is_too_fast(double step) const;

    ContactSettings settings_;
    std::vector<Member> rods_;
    std::vector<std::unique_ptr<Obstacle>> obstacles_;
    std::vector<std::pair<PlaceOnRod, PlaceOnRod>> exempt_;

    std::vector<std::vector<int>> counts_;    ///< of balls, of each span of each rod
    std::vector<std::vector<char>> is_dense_; ///< spans that bend sharply
    std::vector<Ball> balls_;
    std::vector<Eigen::Vector3d> centres_; ///< at the begin of the step
    std::vector<double> radii_;            ///< of the balls
    std::vector<Contact> contacts_;
    /// After the last step and before it, in the order of rods and lengths.
    std::vector<Grip> grips_, grips_before_;
    std::vector<Force> acting_;
    BallGrid grid_;
    double margin_ = 0.0, largest_radius_ = 0.0;
    double last_way_ = 0.0; ///< of the balls in the last step [m]
    bool has_product_ = false;
    std::vector<std::vector<RodTouch>> touches_; ///< of each rod
};

} // namespace cellwarp::core
