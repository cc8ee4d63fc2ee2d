// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/drag.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/field/field.h"
#include "tests/support/allocations.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

Geometry geometry_of(const Shape& shape)
{
    return scan_geometry("model.obj", support::obj_text(shape)).geometry;
}

/// A bar of 1 x 1 x 4 whose ends are held up to a quarter, and who holds them.
struct Bar
{
    Geometry geometry;
    std::shared_ptr<const Body> body;

    explicit Bar(int across = 16)
        : geometry(geometry_of(support::box_shape({0, 0, 0}, {1, 1, 4}, 8)))
    {
        CellSettings cells;
        cells.across = across;
        body = std::make_shared<const Body>(
            build_body(build_rest_shape(geometry, geometry.samples, cells), cells));
    }
    std::shared_ptr<const RegionSet> regions(const std::string& text) const
    {
        const HandleFile file =
            parse_handles("h.handles", "cellwarp-handles 1\n" + text + "frame 1\n");
        const Units units{body->rest->frame, false, bounding_box(geometry.samples)};
        return std::make_shared<const RegionSet>(
            body->rest,
            resolve_regions(file.stages[0].regions, geometry, geometry.samples, units,
                            file),
            file.path);
    }
    std::shared_ptr<const RegionSet> ends() const
    {
        return regions("fixed foot box 0 0 0 1 1 0.25\nhandle head box 0 0 3.75 1 1 4\n");
    }
    Drag drag() const { return {CellSystem(body, ends(), {}), {}, {}}; }
};

/// The head turned about the bar's axis [work].
std::vector<Motion> turned_head(const Bar& bar, double angle)
{
    const Eigen::Vector3d axis_point = 0.5 * bar.body->rest->frame.size;
    const Eigen::Matrix3d R = rotation_about(Eigen::Vector3d::UnitZ(), angle);
    return {{}, {R, axis_point - R * axis_point}};
}

} // namespace

TEST(Drag, follows_the_hand_and_arrives_where_the_canonical_solve_does)
{
    const Bar bar;
    Drag drag = bar.drag();
    for (int frame = 1; frame <= 20; ++frame)
    {
        const double energy = drag.system().energy();
        const DragReport report = drag.frame(turned_head(bar, 0.05 * frame));
        EXPECT_LE(report.solve.iterations, 2);
        EXPECT_GE(drag.system().energy(), energy); // twisted more and more
    }
    CellSystem system(bar.body, bar.ends(), {});
    const std::vector<Motion> motions = turned_head(bar, 1.0);
    system.move_regions(motions);
    system.carry_others();
    system.solve({.gradient_tolerance = 1e-9});
    double largest = 0.0;
    for (std::size_t c = 0; c < system.poses().size(); ++c)
        largest =
            std::max(largest, (system.poses()[c].p - drag.system().poses()[c].p).norm());
    EXPECT_LT(largest, 2e-3 * bar.body->rest->frame.diagonal());
    // Where the hand rests the frames go on converging.
    for (int frame = 0; frame < 5; ++frame)
        drag.frame(motions);
    for (std::size_t c = 0; c < system.poses().size(); ++c)
        ASSERT_LT((system.poses()[c].p - drag.system().poses()[c].p).norm(),
                  1e-6 * bar.body->rest->frame.diagonal());
}

TEST(Drag, shows_the_blend_of_its_poses)
{
    const Bar bar;
    Drag drag = bar.drag();
    const std::vector<Motion> motions = turned_head(bar, 0.7);
    drag.frame(motions);
    std::vector<MovedRegion> moved;
    for (std::size_t r = 0; r < motions.size(); ++r)
        moved.push_back({drag.system().fade(r), motions[r], false, {}});
    const Field field =
        fit_field(FieldKind::Blend, bar.body->cells, drag.system().poses(),
                  drag.system().constraints(), moved);
    const std::vector<Eigen::Vector3d> wanted =
        field.displacements(bar.body->rest->samples, bar.body->cell_of_sample);
    const std::vector<Eigen::Vector3f> shown = drag.samples().positions_as_given();
    ASSERT_EQ(shown.size(), wanted.size());
    for (std::size_t i = 0; i < shown.size(); ++i)
        ASSERT_LT(
            (shown[i].cast<double>() - bar.body->rest->samples[i] - wanted[i]).norm(),
            2e-6 * bar.body->rest->frame.diagonal());
}

TEST(Drag, a_frame_allocates_nothing)
{
    const Bar bar;
    Drag drag = bar.drag();
    std::vector<std::vector<Motion>> ways;
    for (int frame = 0; frame < 12; ++frame)
        ways.push_back(turned_head(bar, 0.1 * frame));
    for (int frame = 0; frame < 2; ++frame)
        drag.frame(ways[idx(frame)]);
    const std::size_t before = support::num_allocations();
    for (const std::vector<Motion>& motions : ways)
        drag.frame(motions);
    EXPECT_EQ(support::num_allocations(), before);
    // What is counted, vectors included.
    const Eigen::VectorXd vector = Eigen::VectorXd::Ones(30);
    EXPECT_GT(support::num_allocations(), before) << vector.size();
}

TEST(Drag, gives_the_same_bits_for_every_number_of_threads)
{
    const Bar bar;
    std::vector<float> first;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        Drag drag = bar.drag();
        for (int frame = 1; frame <= 4; ++frame)
            drag.frame(turned_head(bar, 0.2 * frame));
        const std::span<const float> shown = drag.samples().positions();
        if (first.empty())
            first.assign(shown.begin(), shown.end());
        ASSERT_TRUE(std::equal(first.begin(), first.end(), shown.begin(), shown.end()));
    }
}

TEST(Drag, a_frame_out_of_time_still_shows_where_the_hand_is)
{
    const Bar bar;
    DragSettings settings;
    settings.time_budget = 1e-12;
    Drag drag(CellSystem(bar.body, bar.ends(), {}), settings, {});
    const std::vector<Motion> motions = turned_head(bar, 0.5);
    EXPECT_EQ(drag.frame(motions).solve.stop, Stop::TimeLimit);
    const std::vector<Eigen::Vector3f> shown = drag.samples().positions_as_given();
    for (const std::uint32_t i : drag.system().regions()[1].samples)
        ASSERT_LT(
            (shown[i].cast<double>() - motions[1](bar.body->rest->samples[i])).norm(),
            1e-6 * bar.body->rest->frame.diagonal());
}

} // namespace cellwarp::core
