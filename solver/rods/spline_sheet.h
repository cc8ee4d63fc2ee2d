// SPDX-License-Identifier: GPL-3.0-or-later
// Surfaces and volumes of splines, P(a, b) = sum q_ij b_i(a) c_j(b) and likewise with
// three, held together by springs between samples: cloth, pads, blocks. [Lenoir04]
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "solver/dynamics/spring_object.h"
#include "solver/rods/spline_basis.h"

namespace cellwarp::core
{

/// At rest a parallelogram, or a box of three sides.
struct SheetShape
{
    Eigen::Vector3d corner = Eigen::Vector3d::Zero(); ///< [m]
    std::vector<Eigen::Vector3d> sides;               ///< two, or three [m]
    std::vector<int> counts;                          ///< of control points along each
    int degree = 3;
    double young = 1e6;      ///< [Pa]; Poisson's ratio is 1/3 of sheets, 1/4 of blocks
    double thickness = 1e-3; ///< of sheets [m]
    double density = 1000.0; ///< [kg/m^3]
};

/// Shares of the sides; the third is of blocks.
using SheetPlace = std::array<double, 3>;

class SplineSheet : public SpringObject
{
public:
    /// Throws std::invalid_argument for sides that span nothing, and for fewer control
    /// points than the degree needs.
    explicit SplineSheet(const SheetShape& shape);

    double viscosity = 0.0; ///< of the velocity [1/s]

    /// A number for joints.
    int add_place(const SheetPlace& place);
    /// That place stays where it is.
    void fix(const SheetPlace& place);
    /// The sheet keeps to \p point wherever that is on it, and slides; at its edges it
    /// comes off. Throws std::invalid_argument for blocks.
    void slide_over(const Eigen::Vector3d& point);

    bool is_block() const { return bases_.size() == 3; }
    int num_controls() const { return static_cast<int>(x.size() / 3); }
    Eigen::Vector3d at(const SheetPlace& place) const
    {
        return along(weights(ordered(place)), x);
    }
    /// Shares where it slides.
    SheetPlace sliding(std::size_t k) const;
    bool has_left(std::size_t k) const { return slides_[k].has_left; }
    std::size_t num_slides() const { return slides_.size(); }
    /// M v by the factors of the mass, M = M_a x M_b (x M_c): along one index after the
    /// other.
    Eigen::VectorXd times_mass(const Eigen::VectorXd& v) const;
    double mass() const { return mass_; } ///< [kg]
    double kinetic() const override { return 0.5 * velocity.dot(times_mass(velocity)); }
    double weight_energy() const { return weight(x); }
    Eigen::Vector3d momentum() const;
    Eigen::Vector3d angular_momentum() const; ///< about the origin

    double own_violation() const override;
    Eigen::Vector3d place(int place, bool of_trial) const override;
    void add_moved(int place, const Eigen::Vector3d& n, SparseRow& out) const override;
    void measure(bool of_trial, Measure& out) override;
    double linearise(Eigen::VectorXd& gradient, Measure& here) override;
    void add_own_forces(const Eigen::VectorXd& lambda, double scale,
                        Eigen::VectorXd& out) const override;
    SaddleSolver::Report factorize(const Eigen::VectorXd& lambda, int& level) override;
    void take_off_contradiction(Measure& here) override;
    void solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const override
    {
        saddle_.solve(r, g);
    }
    double stiffness_of(int unknown) const override
    {
        return matrix_.lower(unknown, unknown);
    }
    Again again(const Eigen::VectorXd&, bool) override;
    bool is_beyond() const override;
    void start(double step) override;
    void finish() override;
    void undo() override;

private:
    struct Fixed
    {
        PointShares at;
        Eigen::Vector3d point;
    };
    struct Slide
    {
        Eigen::Vector3d point;
        SheetPlace foot;
        bool has_left = false;
    };
    /// From the order of the statement to that of the sides within: those with the fewest
    /// control points stand closest in the band.
    SheetPlace ordered(const SheetPlace& place) const;
    /// How often derived along each side.
    using Orders = std::array<std::size_t, 3>;
    PointShares weights(const SheetPlace& place, const Orders& orders = {}) const;
    void add_springs(const SheetShape& shape);
    void add_curvature(const Slide& slide, double pressed);
    void find_mass();
    /// Where a sheet is nearest to a point, from \p foot on, and its normal there.
    Eigen::Vector3d seek(const Eigen::VectorXd& at, const Eigen::Vector3d& point,
                         SheetPlace& foot) const;
    /// Whether a place that slides is behind an edge by a share of the size.
    bool is_off(const Slide& slide, double share) const;
    Eigen::VectorXd violations(const Eigen::VectorXd& at) const;

    std::vector<std::size_t> order_; ///< of each side its number in the statement
    std::vector<SplineBasis> bases_;
    std::vector<Eigen::MatrixXd> masses_; ///< of each index alone, their sums 1
    double mass_ = 0.0;
    std::vector<PointShares> places_;
    std::vector<Fixed> fixed_;
    std::vector<Slide> slides_, slides_before_;

    // One step.
    Eigen::VectorXd momentum_;
    std::vector<SparseRow> rows_;
    Eigen::VectorXd rows_off_, contradiction_;
    BandMatrix matrix_, mass_band_;
    SaddleSolver saddle_;
};

} // namespace cellwarp::core
