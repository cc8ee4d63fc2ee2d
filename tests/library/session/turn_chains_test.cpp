// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/turn_chains.h"

#include <cmath>
#include <map>
#include <numbers>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "library/session/session.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

constexpr double kDegree = std::numbers::pi / 180.0;

/// A bar along z, fixed at its foot; the head is turned about the axis.
struct WoundBar
{
    Session session;

    WoundBar(int across, const std::string& frames)
        : session(scan_geometry("bar.obj", support::obj_text(support::box_shape(
                                               {-0.5, -0.5, 0}, {0.5, 0.5, 4}, 8)))
                      .geometry,
                  parse_handles("bar.handles",
                                "cellwarp-handles 1\nfixed foot box -1 -1 -1 1 1 0.25\n"
                                "handle head box -1 -1 3.75 1 1 5\n" +
                                    frames),
                  settings_of(across))
    {
        while (session.next_frame(true))
            ;
    }

    static SessionSettings settings_of(int across)
    {
        SessionSettings settings;
        settings.cells.across = across;
        return settings;
    }

    /// Turns about the axis from ring to ring of the side's samples, added [degree]; and
    /// the largest of them.
    std::pair<double, double> winding() const
    {
        std::map<double, std::array<double, 2>> rings; // cosine, sine
        const std::vector<Eigen::Vector3d>& rest = session.geometry().samples;
        const std::vector<Eigen::Vector3d>& now = session.deformed().samples;
        std::map<double, std::pair<Eigen::Vector3d, int>> middles;
        for (std::size_t i = 0; i < rest.size(); ++i)
        {
            auto& [sum, count] =
                middles.try_emplace(rest[i].z(), Eigen::Vector3d::Zero(), 0)
                    .first->second;
            sum += now[i];
            ++count;
        }
        for (std::size_t i = 0; i < rest.size(); ++i)
        {
            const auto& [sum, count] = middles.at(rest[i].z());
            const Eigen::Vector3d arm = now[i] - sum / count;
            auto& [cosine, sine] = rings[rest[i].z()];
            cosine += rest[i].x() * arm.x() + rest[i].y() * arm.y();
            sine += rest[i].x() * arm.y() - rest[i].y() * arm.x();
        }
        double whole = 0.0, largest = 0.0, last = 0.0;
        for (const auto& [z, turn] : rings)
        {
            const double angle = std::atan2(turn[1], turn[0]);
            const double step =
                std::remainder(angle - last, 2.0 * std::numbers::pi) / kDegree;
            whole += step;
            largest = std::max(largest, std::abs(step));
            last = angle;
        }
        return {whole, largest};
    }
};

std::string turned_by(int degrees)
{
    return "frame 1\nmove head rotate 0 0 1 " + std::to_string(degrees) + "\n";
}

} // namespace

TEST(TurnChains, of_a_chain_of_cells_is_the_sum_of_its_turns)
{
    const support::Built bar = support::bar(2, 2, 8);
    std::vector<int> region(bar.cells.size(), -1);
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < bar.cells.size(); ++i)
    {
        const Cell& cell = bar.cells.cells[i];
        const double layer = cell.centre.z() / cell.edge - 0.5;
        region[i] = layer < 0.5 ? 0 : layer > 6.5 ? 1 : -1;
        poses.push_back({rotation_about(Eigen::Vector3d::UnitZ(), 100 * kDegree * layer),
                         cell.centre});
    }
    const Eigen::Matrix3Xd turns = TurnChains(bar.cells, region).turns(poses);
    ASSERT_EQ(turns.cols(), 1);
    EXPECT_NEAR(turns(2, 0) / kDegree, -700.0, 1e-9);
    EXPECT_NEAR(turns.col(0).norm() / kDegree, 700.0, 1e-9);
}

TEST(TurnChains, of_a_bar_turned_by_less_than_it_bears_is_a_solution)
{
    const WoundBar bar(32, turned_by(360));
    EXPECT_EQ(bar.session.frames().back().solve.stop, Stop::Converged);
    EXPECT_NEAR(bar.winding().first, 360.0, 1e-6);
}

TEST(TurnChains, of_a_bar_is_kept_however_far_it_is_turned)
{
    for (const int degrees : {540, 900, 1440, -1440})
    {
        const WoundBar bar(32, turned_by(degrees));
        EXPECT_NEAR(bar.winding().first, degrees, 1e-6);
        EXPECT_LT(bar.winding().second, 90.0) << degrees;
        // Nobody is told that this is a solution if it is none.
        const SolveReport& solve = bar.session.frames().back().solve;
        EXPECT_TRUE(solve.stop == Stop::Converged ||
                    bar.session.warnings().back().find("wound farther") !=
                        std::string::npos);
    }
}

TEST(TurnChains, that_a_solve_loses_whatever_it_does_end_the_frame_where_they_were_right)
{
    // A full turn about the middle, across the bar: the energy falls all the way down to
    // the straight bar, whose ends are where they are asked to be.
    const WoundBar bar(12, "frame 1\nmove head rotate 1 0 0 360 about 0 0 2\n");
    const SolveReport& solve = bar.session.frames().back().solve;
    EXPECT_EQ(solve.stop, Stop::NoDescent);
    EXPECT_NE(bar.session.warnings().back().find("wound farther"), std::string::npos);
    const CellSystem& system = *bar.session.system();
    EXPECT_EQ(solve.energy_after, system.energy());
    EXPECT_GT(system.energy(), 1e-3);
    const TurnChains chains(system.body().cells, system.region_of_cell());
    const Eigen::Matrix3Xd turns = chains.turns(system.poses());
    ASSERT_EQ(turns.cols(), 1);
    EXPECT_NEAR(std::abs(turns(0, 0)) / kDegree, 360.0, 1.0);
}

TEST(TurnChains, of_small_cells_are_kept_too)
{
    const WoundBar bar(48, turned_by(540));
    EXPECT_NEAR(bar.winding().first, 540.0, 1e-6);
}

TEST(TurnChains, goes_on_from_frame_to_frame_and_back)
{
    const WoundBar there(16, turned_by(300) + "frame 2\nmove head rotate 0 0 1 600\n");
    EXPECT_NEAR(there.winding().first, 600.0, 1e-6);
    const WoundBar back(16, turned_by(540) + "frame 2\nmove head rotate 0 0 1 0\n");
    EXPECT_NEAR(back.winding().first, 0.0, 1e-6);
    EXPECT_LT(back.session.system()->energy(), 1e-9);
}

} // namespace cellwarp::core
