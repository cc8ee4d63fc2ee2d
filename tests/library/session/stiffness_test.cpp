// SPDX-License-Identifier: GPL-3.0-or-later
// Known answers of thin material: whole sessions, from a file to their energy. The
// material has E = 2 and nu = 0, and the energy is the work done on it.
#include "library/session/session.h"

#include <cmath>
#include <cstdio>
#include <numbers>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

constexpr double kLength = 4.0, kClamped = 0.5; ///< of strips and bars
constexpr double kFree = kLength - kClamped;
constexpr double kDeflection = 0.02 * kFree;

Eigen::Matrix3d turned(const Eigen::Vector3d& axis)
{
    return rotation_about(axis, std::numbers::pi / 6.0);
}
const Eigen::Matrix3d kAlong = Eigen::Matrix3d::Identity();
const Eigen::Matrix3d kInPlane = turned(Eigen::Vector3d::UnitZ());
const Eigen::Matrix3d kTwice = kInPlane * turned(Eigen::Vector3d::UnitY());
const Eigen::Matrix3d kAskew =
    turned(Eigen::Vector3d::UnitX()) * turned(Eigen::Vector3d::UnitY());

const Eigen::Vector3d kPlace(0.137, 0.211, 0.093);

Shape placed(Shape shape, const Eigen::Matrix3d& R)
{
    for (Eigen::Vector3d& x : shape.samples)
        x = R * x + kPlace;
    return shape;
}

double diagonal_of(const Shape& shape)
{
    Eigen::Vector3d low = shape.samples.front(), high = low;
    for (const Eigen::Vector3d& x : shape.samples)
    {
        low = low.cwiseMin(x);
        high = high.cwiseMax(x);
    }
    return (high - low).norm();
}

std::string text_of(const Eigen::Vector3d& v)
{
    char text[100];
    std::snprintf(text, sizeof(text), "%.17g %.17g %.17g ", v.x(), v.y(), v.z());
    return text;
}

/// The end at 0 is fixed, the middle of the far end pinned and moved along the turned z
/// axis, and inwards by what a bent beam becomes shorter: else it would be stretched,
/// which takes five times the energy of bending it.
std::string cantilever(const Eigen::Matrix3d& R, const Eigen::Vector3d& tip)
{
    const Eigen::Vector3d along = R.col(0);
    const double shorter = 0.6 * kDeflection * kDeflection / kFree;
    return "cellwarp-handles 1\nfixed root halfspace " + text_of(-along) +
           std::to_string(-(along.dot(kPlace) + kClamped)) + "\npin tip sphere " +
           text_of(R * tip + kPlace) + "0.001\nframe 1\nmove tip translate " +
           text_of(kDeflection * R.col(2) - shorter * along) + "\n";
}
std::string cantilever(const Eigen::Matrix3d& R)
{
    return cantilever(R, {kLength, 0.5, 0.0});
}

double energy_of(const Shape& shape, const std::string& handles,
                 const CellSettings& cells)
{
    SessionSettings settings;
    settings.cells = cells;
    settings.gradient_tolerance = 1e-10;
    settings.field = FieldKind::Blend;
    Session session(scan_geometry("strip.obj", support::obj_text(shape)).geometry,
                    parse_handles("strip.handles", handles), settings);
    while (session.next_frame(false))
        ;
    const double unit = session.system()->rest().frame.length_to_model(1.0);
    return std::pow(unit, 3) * session.system()->energy();
}

CellSettings cells_of(int across, Fill fill = Fill::Solid)
{
    CellSettings cells;
    cells.across = across;
    cells.fill = fill;
    return cells;
}

/// 3 EI d^2 / 2 L^3
double cantilever_energy(double second_moment)
{
    return 3.0 * 2.0 * second_moment * std::pow(kDeflection, 2) /
           (2.0 * std::pow(kFree, 3));
}

double strip_energy(const Eigen::Matrix3d& R, int across)
{
    const Shape strip = placed(support::sheet_shape(kLength, 1.0, 20), R);
    const double t = 0.01 * diagonal_of(strip);
    return energy_of(strip, cantilever(R), cells_of(across)) /
           cantilever_energy(t * t * t / 12.0);
}

} // namespace

TEST(Stiffness, of_a_strip_is_that_of_a_plate_of_its_thickness)
{
    for (const int across : {16, 32})
        EXPECT_NEAR(strip_energy(kAlong, across), 1.0, 0.05) << across;
}

TEST(Stiffness, of_a_strip_is_the_same_when_it_is_turned_in_its_plane)
{
    for (const int across : {16, 32})
        EXPECT_NEAR(strip_energy(kInPlane, across), 1.0, 0.05) << across;
}

TEST(Stiffness, of_a_strip_is_the_same_when_it_lies_askew_to_all_axes)
{
    for (const int across : {24, 32})
        for (const Eigen::Matrix3d& R : {kTwice, kAskew})
            EXPECT_NEAR(strip_energy(R, across), 1.0, 0.05) << across;
}

TEST(Stiffness, of_a_strip_grows_with_the_third_power_of_its_thickness)
{
    const Shape strip = placed(support::sheet_shape(kLength, 1.0, 20), kAlong);
    CellSettings cells = cells_of(16);
    const double once = energy_of(strip, cantilever(kAlong), cells);
    cells.thickness *= 2.0;
    EXPECT_NEAR(energy_of(strip, cantilever(kAlong), cells), 8.0 * once, 0.1 * once);
}

TEST(Stiffness, of_a_strip_does_not_change_for_a_closed_box_beside_it)
{
    // The thickness is given so that it is the same length in both files.
    const Shape strip = placed(support::sheet_shape(kLength, 1.0, 20), kAlong);
    const Shape box = support::box_shape({0.5, 2.0, -0.5}, {1.5, 3.0, 0.5}, 1);
    const Shape both = support::joined(strip, placed(box, kAlong));
    CellSettings cells = cells_of(16);
    const double alone = energy_of(strip, cantilever(kAlong), cells);
    cells.thickness = 0.01 * diagonal_of(strip) / diagonal_of(both);
    EXPECT_NEAR(energy_of(both, cantilever(kAlong), cells), alone, 0.02 * alone);
}

TEST(Stiffness, of_a_bent_sheet_does_not_depend_on_its_cells)
{
    const Shape sheet = support::sheet_shape(3.0, 1.0, 20);
    const std::string bend = "cellwarp-handles 1\nfixed a box -1 -1 -1 0.3 2 1\n"
                             "handle b box 2.7 -1 -1 4 2 1\nframe 1\n"
                             "move b rotate 0 1 0 70 about 1.5 0.5 0\n";
    double least = INFINITY, most = 0.0;
    for (const int across : {16, 24, 32, 48})
    {
        const double energy = energy_of(sheet, bend, cells_of(across));
        least = std::min(least, energy);
        most = std::max(most, energy);
    }
    EXPECT_LT(most, 1.1 * least);
}

TEST(Stiffness, of_a_solid_cantilever_is_that_of_a_beam)
{
    const Shape bar =
        placed(support::box_shape({0, 0, 0}, {kLength, 0.25, 0.25}, 20), kAlong);
    for (const int across : {4, 8})
    {
        const double energy = energy_of(bar, cantilever(kAlong, {kLength, 0.125, 0.125}),
                                        cells_of(16 * across)) /
                              cantilever_energy(std::pow(0.25, 4) / 12.0);
        EXPECT_NEAR(energy, 1.0, 0.05) << across;
    }
}

} // namespace cellwarp::core
