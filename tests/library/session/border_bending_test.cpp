// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/border_bending.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "library/session/session.h"
#include "tests/support/rest_model.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

constexpr double kHandleRadius = 0.12;
const Eigen::Vector3d kMiddle(1.0, 1.0, 0.0);

CellSettings cells_across(int across)
{
    CellSettings cells;
    cells.across = across;
    return cells;
}

/// A body with its regions, and what their borders add to its faces.
struct Bent : support::RestModel
{
    Body body;
    std::vector<double> bending;

    Bent(const Shape& shape, const std::string& statements, int across = 40)
        : RestModel(shape, statements, cells_across(across)),
          body(build_body(rest, settings)),
          bending(border_bending(body, *regions, regions->shares(body)))
    {
    }
    Eigen::Vector3d centre(std::size_t face) const
    {
        return rest->frame.to_model(body.cells.faces[face].centre);
    }
};

Shape square()
{
    return support::sheet_shape(2.0, 2.0, 40);
}

std::string sphere(const Eigen::Vector3d& x, double radius)
{
    return fmt::format("sphere {:.9g} {:.9g} {:.9g} {:.9g}\n", x.x(), x.y(), x.z(),
                       radius);
}

enum class Way
{
    Up,
    InPlane
};

/// The square with its edges fixed, turned, its middle moved by twice the handle's
/// radius; samples turned back.
std::vector<Eigen::Vector3d> moved(Way way, const Eigen::Matrix3d& turn,
                                   bool has_smooth_borders)
{
    Shape shape = square();
    for (Eigen::Vector3d& x : shape.samples)
        x = turn * x;
    std::string text =
        "cellwarp-handles 1\nhandle h " + sphere(turn * kMiddle, kHandleRadius + 1e-6);
    for (double along = 0.0; along <= 2.0; along += 0.2)
        for (const double at : {0.0, 2.0})
            for (const Eigen::Vector3d& x :
                 {Eigen::Vector3d(along, at, 0), Eigen::Vector3d(at, along, 0)})
                text += "fixed f " + sphere(turn * x, 0.300001);
    const Eigen::Vector3d by = 2.0 * kHandleRadius * turn.col(way == Way::Up ? 2 : 0);
    text += fmt::format("frame 1\nmove h translate {:.9g} {:.9g} {:.9g}\n", by.x(),
                        by.y(), by.z());
    SessionSettings settings;
    settings.cells = cells_across(40);
    settings.cells.is_flat = way == Way::InPlane;
    settings.departures.smooth_borders = has_smooth_borders;
    settings.gradient_tolerance = 1e-10; // near a minimum it is not yet symmetric
    Session session(scan_geometry("model.obj", support::obj_text(shape)).geometry,
                    parse_handles("h.handles", text), settings);
    while (session.next_frame(true))
        EXPECT_EQ(session.frames().back().solve.stop, Stop::Converged);
    std::vector<Eigen::Vector3d> samples = session.deformed().samples;
    for (Eigen::Vector3d& x : samples)
        x = turn.transpose() * x;
    return samples;
}

/// The largest angle between neighbouring triangles near the handle [rad].
double sharpest_fold(const std::vector<Eigen::Vector3d>& samples)
{
    std::map<std::pair<std::uint32_t, std::uint32_t>, Eigen::Vector3d> normals;
    double sharpest = 0.0;
    const Shape rest = square();
    for (const Triangle& t : rest.triangles)
    {
        if ((rest.samples[t[0]] - kMiddle).norm() > 3.0 * kHandleRadius)
            continue;
        const Eigen::Vector3d n = (samples[t[1]] - samples[t[0]])
                                      .cross(samples[t[2]] - samples[t[0]])
                                      .normalized();
        for (std::size_t k = 0; k < 3; ++k)
        {
            const auto edge = std::minmax(t[k], t[(k + 1) % 3]);
            const auto [other, is_new] = normals.emplace(edge, n);
            if (!is_new)
                sharpest = std::max(sharpest, std::atan2(other->second.cross(n).norm(),
                                                         other->second.dot(n)));
        }
    }
    return sharpest;
}

} // namespace

TEST(BorderBending, is_that_of_a_plate_as_thick_as_the_handle_is_wide_and_ends)
{
    const Bent bent(square(), "handle h " + sphere(kMiddle, kHandleRadius));
    ASSERT_EQ(bent.bending.size(), bent.body.cells.faces.size());
    const double scale = bent.rest->frame.diagonal() / std::sqrt(8.0);
    const double most = std::pow(2.0 * kHandleRadius * scale, 2) / 12.0;
    double largest = 0.0;
    for (std::size_t f = 0; f < bent.bending.size(); ++f)
    {
        const double from = (bent.centre(f) - kMiddle).norm();
        EXPECT_GE(bent.bending[f], 0.0);
        EXPECT_LT(bent.bending[f], 1.1 * most);
        if (from > 6.1 * kHandleRadius)
        {
            EXPECT_EQ(bent.bending[f], 0.0) << from;
        }
        else if (from < 3.0 * kHandleRadius)
        {
            EXPECT_GT(bent.bending[f], 0.1 * most) << from;
        }
        largest = std::max(largest, bent.bending[f]);
    }
    EXPECT_GT(largest, 0.85 * most);
}

TEST(BorderBending, leaves_a_sheet_alone_that_only_lies_near)
{
    Shape above = square();
    for (Eigen::Vector3d& x : above.samples)
        x.z() += 0.15;
    const Bent bent(support::joined(square(), above),
                    "handle h " + sphere(kMiddle, kHandleRadius));
    ASSERT_FALSE(bent.bending.empty());
    for (std::size_t f = 0; f < bent.bending.size(); ++f)
    {
        if (bent.centre(f).z() > 0.075)
        {
            EXPECT_EQ(bent.bending[f], 0.0);
        }
    }
}

TEST(BorderBending, leaves_strips_large_handles_and_what_is_solid_as_they_are)
{
    EXPECT_TRUE(Bent(support::sheet_shape(4.0, 0.2, 4),
                     "fixed f box -1 -1 -1 0.2 1 1\nhandle h box 3.8 -1 -1 5 1 1\n")
                    .bending.empty());
    EXPECT_TRUE(Bent(square(), "handle h " + sphere(kMiddle, 0.4)).bending.empty());
    EXPECT_TRUE(Bent(support::box_shape({0, 0, 0}, {2, 2, 0.4}, 40),
                     "handle h " + sphere(kMiddle, kHandleRadius))
                    .bending.empty());
}

TEST(BorderBending, leaves_a_ring_around_a_tube_as_it_is)
{
    // Of its area, as spread as a disc of it, but open in its middle.
    constexpr double kRadius = 0.1, kLength = 2.0;
    constexpr int kAround = 32, kAlong = 40;
    Shape tube;
    for (int i = 0; i <= kAlong; ++i)
        for (int j = 0; j < kAround; ++j)
        {
            const double angle = 2.0 * std::numbers::pi * j / kAround;
            tube.samples.emplace_back(kRadius * std::cos(angle),
                                      kRadius * std::sin(angle), kLength * i / kAlong);
        }
    for (std::uint32_t i = 0; i < kAlong; ++i)
        for (std::uint32_t j = 0; j < kAround; ++j)
        {
            const std::uint32_t a = i * kAround + j, b = i * kAround + (j + 1) % kAround;
            tube.triangles.push_back({a, b, b + kAround});
            tube.triangles.push_back({a, b + kAround, a + kAround});
        }
    for (const double half : {0.025, 0.05, 0.1, 0.2})
        EXPECT_TRUE(
            Bent(tube, fmt::format("handle h box -1 -1 {} 1 1 {}\n", 1 - half, 1 + half))
                .bending.empty())
            << half;
}

TEST(BorderBending, leaves_pins_of_one_place_as_they_are)
{
    EXPECT_TRUE(Bent(square(), "pin p " + sphere(kMiddle, 0.001)).bending.empty());
}

TEST(BorderBending, is_the_same_in_cells_of_all_sizes)
{
    // At the handle's border.
    const auto largest = [](int across)
    {
        const Bent bent(square(), "handle h " + sphere(kMiddle, kHandleRadius), across);
        EXPECT_FALSE(bent.bending.empty()) << across;
        const double scale = bent.rest->frame.diagonal();
        double found = 0.0;
        for (const double bending : bent.bending)
            found = std::max(found, bending / (scale * scale));
        return found;
    };
    const double fine = largest(40);
    EXPECT_NEAR(largest(20), fine, 0.1 * fine);
    EXPECT_NEAR(largest(10), fine, 0.3 * fine);
}

TEST(BorderBending, changes_nothing_in_the_plane)
{
    const Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    const std::vector<Eigen::Vector3d> with = moved(Way::InPlane, turn, true);
    const std::vector<Eigen::Vector3d> without = moved(Way::InPlane, turn, false);
    for (std::size_t i = 0; i < with.size(); ++i)
        EXPECT_LT((with[i] - without[i]).norm(), 1e-9);
}

TEST(BorderBending, lets_a_small_handle_raise_a_bulge_and_no_tent)
{
    const Eigen::Matrix3d turns[] = {
        Eigen::Matrix3d::Identity(),
        Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix()};
    for (const Eigen::Matrix3d& turn : turns)
    {
        const double smooth = sharpest_fold(moved(Way::Up, turn, true));
        const double creased = sharpest_fold(moved(Way::Up, turn, false));
        EXPECT_LT(smooth, 0.7 * creased) << smooth << " " << creased;
    }
}

TEST(BorderBending, makes_what_is_symmetric_a_symmetric_bulge)
{
    const std::vector<Eigen::Vector3d> samples =
        moved(Way::Up, Eigen::Matrix3d::Identity(), true);
    const Shape rest = square();
    std::map<std::pair<long, long>, double> heights;
    const auto key = [](const Eigen::Vector3d& x)
    { return std::pair(std::lround(1e6 * x.x()), std::lround(1e6 * x.y())); };
    for (std::size_t i = 0; i < samples.size(); ++i)
        heights[key(rest.samples[i])] = samples[i].z();
    for (std::size_t i = 0; i < samples.size(); ++i)
    {
        const Eigen::Vector3d& x = rest.samples[i];
        EXPECT_NEAR(samples[i].z(), heights.at(key({2.0 - x.x(), x.y(), 0.0})), 1e-7);
        EXPECT_NEAR(samples[i].z(), heights.at(key({x.y(), x.x(), 0.0})), 1e-7);
    }
}

} // namespace cellwarp::core
