// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/picture/picture.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/formats/geometry_file.h"
#include "library/picture/figures.h"
#include "octree/base/index.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

Figure cube()
{
    const Shape shape = support::box_shape({0, 0, 0}, {1, 1, 1}, 2);
    Figure figure;
    figure.points = shape.samples;
    figure.triangles = shape.triangles;
    figure.colours.assign(figure.points.size(), {200, 60, 60});
    return figure;
}

PictureOptions small()
{
    PictureOptions options;
    options.width = 80;
    options.height = 60;
    options.occlusion_rays = 4;
    return options;
}

std::array<int, 3> pixel(const Image& image, int x, int y)
{
    const std::size_t at = 3 * idx(y * image.width + x);
    return {image.rgb[at], image.rgb[at + 1], image.rgb[at + 2]};
}

} // namespace

TEST(Picture, shows_the_figure_on_white)
{
    const Image image = draw({cube()}, small());
    EXPECT_EQ(pixel(image, 0, 0), (std::array<int, 3>{255, 255, 255}));
    const std::array<int, 3> middle = pixel(image, 40, 30);
    EXPECT_GT(middle[0], 2 * middle[1]);
    EXPECT_LT(middle[1], 100);
}

TEST(Picture, stands_figures_side_by_side)
{
    const Image image = draw({cube(), cube()}, small());
    EXPECT_EQ(image.width, 160);
    EXPECT_LT(pixel(image, 40, 30)[1], 100);
    EXPECT_LT(pixel(image, 120, 30)[1], 100);
}

TEST(Picture, of_a_hollow_has_neither_grain_nor_patches)
{
    // A bowl of coarse faces, seen from above: each of them lies in the shade of others.
    constexpr int kRings = 12, kAround = 36;
    Figure bowl;
    bowl.points.push_back({0, -1, 0});
    for (int ring = 1; ring <= kRings; ++ring)
        for (int k = 0; k < kAround; ++k)
        {
            const double down = 0.5 * std::numbers::pi * ring / kRings;
            const double about = 2.0 * std::numbers::pi * k / kAround;
            bowl.points.push_back({std::sin(down) * std::cos(about), -std::cos(down),
                                   std::sin(down) * std::sin(about)});
        }
    const auto at = [](int ring, int k)
    {
        return ring == 0
                   ? 0u
                   : static_cast<std::uint32_t>(1 + (ring - 1) * kAround + k % kAround);
    };
    for (int ring = 0; ring < kRings; ++ring)
        for (int k = 0; k < kAround; ++k)
        {
            bowl.triangles.push_back({at(ring, k), at(ring + 1, k), at(ring + 1, k + 1)});
            if (ring > 0)
                bowl.triangles.push_back(
                    {at(ring, k), at(ring + 1, k + 1), at(ring, k + 1)});
        }
    bowl.colours.assign(bowl.points.size(), {200, 200, 200});
    PictureOptions from_above;
    from_above.width = from_above.height = 200;
    from_above.elevation = 89.0;
    const Image image = draw({bowl}, from_above);
    int largest = 0;
    double sum = 0.0;
    for (int y = 50; y < 150; ++y)
        for (int x = 50; x < 150; ++x)
        {
            const int around = pixel(image, x - 1, y)[0] + pixel(image, x + 1, y)[0] +
                               pixel(image, x, y - 1)[0] + pixel(image, x, y + 1)[0];
            const int off = std::abs(4 * pixel(image, x, y)[0] - around);
            largest = std::max(largest, off);
            sum += off;
        }
    EXPECT_LT(largest, 24);
    EXPECT_LT(sum / 1e4, 4.0);
}

TEST(Picture, is_the_same_every_time)
{
    EXPECT_EQ(draw({cube()}, small()).rgb, draw({cube()}, small()).rgb);
}

TEST(Picture, draws_points_as_balls_and_boxes_as_glass)
{
    Figure cloud;
    cloud.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    cloud.colours.assign(3, {20, 20, 220});
    cloud.point_radius = 0.3;
    const Image balls = draw({cloud}, small());
    int blue = 0, tinted = 0;
    for (int y = 0; y < 60; ++y)
        for (int x = 0; x < 80; ++x)
            blue += pixel(balls, x, y)[2] > pixel(balls, x, y)[0] + 30;
    EXPECT_GT(blue, 100);
    Figure glass = cloud;
    std::array<Eigen::Vector3d, 8> box;
    for (std::size_t k = 0; k < 8; ++k)
        box[k] = Eigen::Vector3d(k & 1 ? 1.5 : -0.5, k & 2 ? 1.5 : -0.5, k & 4 ? 1 : -1);
    glass.boxes = {box};
    glass.box_colours = {{250, 150, 50}};
    const Image through = draw({glass}, small());
    for (int y = 0; y < 60; ++y)
        for (int x = 0; x < 80; ++x)
            tinted += pixel(through, x, y)[0] > pixel(through, x, y)[2] + 30;
    EXPECT_GT(tinted, 500);
}

TEST(Picture, draws_lines_of_a_file_as_solid_threads)
{
    Geometry geometry;
    geometry.samples = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    geometry.lines = {{0, 1}, {0, 2}};
    geometry.colours.assign(3, {20, 20, 220});
    const Figure lines = figure_of(geometry);
    EXPECT_GT(lines.balls.size(), 100u);
    EXPECT_EQ(lines.point_radius, 0.0); // the samples are on lines
    const auto count_blue = [](const Image& image)
    {
        int blue = 0;
        for (int y = 0; y < 60; ++y)
            for (int x = 0; x < 80; ++x)
                blue += pixel(image, x, y)[2] > pixel(image, x, y)[0] + 30;
        return blue;
    };
    const int seen = count_blue(draw({lines}, small()));
    EXPECT_GT(seen, 30);
    // What stands before them hides them.
    Figure hidden = lines;
    for (const double z : {-0.2, 0.2})
        for (const auto& [x, y] : {std::pair(-2.0, -2.0), {4.0, -2.0}, {1.0, 4.0}})
            hidden.points.emplace_back(x, y, z);
    hidden.triangles = {{3, 4, 5}, {6, 7, 8}};
    hidden.colours.resize(9, {200, 200, 200});
    EXPECT_EQ(count_blue(draw({hidden}, small())), 0);
}

TEST(Picture, of_a_single_point_is_no_problem)
{
    Figure one;
    one.points = {{3, 3, 3}};
    one.colours = {{10, 10, 10}};
    one.point_radius = 0.001;
    EXPECT_LT(pixel(draw({one}, small()), 40, 30)[0], 200);
}

TEST(Picture, shows_what_is_in_focus_alone)
{
    PictureOptions options = small();
    options.elevation = 0.0;
    // The upper corner that is nearest to the viewer.
    options.focus.emplace(Eigen::Vector3d(0.9, 0.9, 0.9), Eigen::Vector3d(1, 1, 1));
    const Image near = draw({cube()}, options);
    // The corner is in the middle; the cube goes on beyond the lower edge.
    EXPECT_LT(pixel(near, 40, 59)[1], 200);
    EXPECT_EQ(pixel(draw({cube()}, small()), 40, 59)[1], 255);
    EXPECT_EQ(pixel(near, 40, 0), (std::array<int, 3>{255, 255, 255}));
}

TEST(Picture, leaves_room_for_axes_and_labels)
{
    PictureOptions options = small();
    options.width = options.height = 200;
    const auto height_of_cube = [&](const Image& image)
    {
        int rows = 0;
        for (int y = 0; y < options.height; ++y)
            for (int x = 0; x < options.width; ++x)
                if (const auto seen = pixel(image, x, y); seen[0] > seen[1] + 60)
                {
                    ++rows;
                    break;
                }
        return rows;
    };
    const Image plain = draw({cube()}, options);
    Figure named = cube();
    named.label = "cube.obj";
    const Image labelled = draw({named}, options);
    EXPECT_LT(height_of_cube(labelled), height_of_cube(plain));
    int ink = 0;
    for (int y = 0; y < 20; ++y)
        for (int x = 0; x < options.width; ++x)
            ink += pixel(labelled, x, y)[0] < 160;
    EXPECT_GT(ink, 20);
    options.shows_axes = true;
    const Image with_axes = draw({cube()}, options);
    EXPECT_LT(height_of_cube(with_axes), height_of_cube(labelled));
    EXPECT_GT(height_of_cube(with_axes), 60);
}

TEST(Picture, is_seen_from_the_front_and_its_right)
{
    // From the right the front is to the left of what is behind.
    const auto column = [](const Eigen::Vector3d& front, int up)
    {
        Figure two;
        two.points = {front, -front};
        two.colours = {{200, 0, 0}, {0, 0, 200}};
        two.point_radius = 0.2;
        PictureOptions options = small();
        options.up = up;
        const Image image = draw({two}, options);
        int sum = 0, count = 0;
        for (int y = 0; y < image.height; ++y)
            for (int x = 0; x < image.width; ++x)
                if (const auto seen = pixel(image, x, y); seen[0] > seen[2] + 60)
                {
                    sum += x;
                    ++count;
                }
        return count > 0 ? double(sum) / count : 1e9;
    };
    EXPECT_LT(column({0, 0, 1}, 1), 35.0);
    EXPECT_LT(column({0, -1, 0}, 2), 35.0);
    EXPECT_LT(column({0, 1, 0}, 0), 35.0);
}

TEST(Picture, is_a_png)
{
    EXPECT_EQ(png_bytes(draw({cube()}, small())).substr(0, 8), "\x89PNG\r\n\x1a\n");
}

TEST(Figures, faces_of_four_corners_fold_along_the_shorter_diagonal)
{
    Geometry geometry;
    geometry.samples = {{0, 0, 1}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    geometry.corners = {0, 1, 2, 3};
    geometry.face_ends.push_back(4);
    // One corner is raised: what stays flat is one triangle.
    const Figure raised = figure_of(geometry);
    ASSERT_EQ(raised.triangles.size(), 2u);
    EXPECT_EQ(raised.triangles[1], (Triangle{1, 2, 3}));
    // A square is cut from its first corner, and a face from a corner that points
    // inwards.
    geometry.samples[0] = {0, 0, 0};
    EXPECT_EQ(figure_of(geometry).triangles[1], (Triangle{0, 2, 3}));
    geometry.samples = {{0.7, 0.7, 0}, {1.2, -0.2, 0}, {3, 3, 0}, {-0.2, 1.2, 0}};
    EXPECT_EQ(figure_of(geometry).triangles[1], (Triangle{0, 2, 3}));
}

TEST(Figures, nothing_is_drawn_across_the_notches_of_a_face)
{
    // A T, from in front: its colour is nowhere beside its stem, whatever comes first.
    const std::vector<Eigen::Vector3d> outline = {{0, 0, 0},   {4, 0, 0},   {4, 1, 0},
                                                  {2.5, 1, 0}, {2.5, 3, 0}, {1.5, 3, 0},
                                                  {1.5, 1, 0}, {0, 1, 0}};
    PictureOptions options = small();
    options.up = 1;
    std::optional<Image> known;
    for (std::uint32_t first = 0; first < 8; ++first)
    {
        Geometry geometry;
        geometry.samples = outline;
        for (std::uint32_t k = 0; k < 8; ++k)
            geometry.corners.push_back((first + k) % 8);
        geometry.face_ends.push_back(8);
        const Figure figure = figure_of(geometry);
        double area = 0.0;
        for (const auto& [a, b, c] : figure.triangles)
            area += 0.5 * (outline[b] - outline[a]).cross(outline[c] - outline[a]).norm();
        EXPECT_NEAR(area, 6.0, 1e-12);
        const Image image = draw({figure}, options);
        if (!known)
            known = image;
        EXPECT_EQ(image.rgb, known->rgb);
    }
}

TEST(Figures, show_regions_in_colour_and_cells_where_they_are)
{
    const Shape bar = support::box_shape({0, 0, 0}, {1, 1, 4}, 4);
    SessionSettings settings;
    settings.cells.across = 8;
    Session session(scan_geometry("m.obj", support::obj_text(bar)).geometry,
                    parse_handles("h", "cellwarp-handles 1\nfixed a box 0 0 0 1 1 0.5\n"
                                       "handle b box 0 0 3.5 1 1 4\nframe 1\n"
                                       "move b translate 1 0 0\n"),
                    settings);
    session.next_frame(true);
    Figure figure = figure_of(session);
    EXPECT_EQ(figure.points, session.deformed().samples);
    EXPECT_NE(figure.colours.front(), figure.colours.back());
    const Eigen::AlignedBox3d head = box_of_region(session, "b");
    EXPECT_TRUE(head.min().isApprox(Eigen::Vector3d(1, 0, 3.5)));
    EXPECT_TRUE(head.max().isApprox(Eigen::Vector3d(2, 1, 4)));
    EXPECT_THROW(box_of_region(session, "c"), Error);
    add_cells(figure, session);
    EXPECT_EQ(figure.boxes.size(), session.system()->body().cells.size());
}

} // namespace cellwarp::core
