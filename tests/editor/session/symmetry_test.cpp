// SPDX-License-Identifier: GPL-3.0-or-later
// What turns or mirrors a shape turns or mirrors its material, its cells and the result.
#include "editor/session/session.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "io/geometry_file.h"
#include "io/number.h"
#include "tests/support/shapes.h"

namespace cellwarp
{

namespace
{

/// A signed permutation of the axes.
Eigen::Matrix3d symmetry(const Eigen::Vector3i& axes, const Eigen::Vector3d& signs)
{
    Eigen::Matrix3d G = Eigen::Matrix3d::Zero();
    for (int k = 0; k < 3; ++k)
        G(k, axes[k]) = signs[k];
    return G;
}

const Eigen::Matrix3d kHalfTurn = symmetry({0, 1, 2}, {-1, -1, 1});
const Eigen::Matrix3d kQuarterTurn = symmetry({1, 0, 2}, {-1, 1, 1});
const Eigen::Matrix3d kMirrorX = symmetry({0, 1, 2}, {-1, 1, 1});
const Eigen::Matrix3d kMirrorY = symmetry({0, 1, 2}, {1, -1, 1});
const Eigen::Matrix3d kRoundTheDiagonal = symmetry({1, 2, 0}, {1, 1, 1});

struct Box
{
    Eigen::Vector3d low, high;
};

/// One end held, another moved.
struct Scene
{
    const char* name;
    Shape shape;
    Box fixed, handle;
    Eigen::Vector3d step;
};

std::vector<Scene> scenes()
{
    return {{"L-prism",
             support::l_prism(),
             {{3.7, -1, -1}, {5, 3, 2}},
             {{-1, 1.7, -1}, {3, 3, 2}},
             {0.4, 0.3, 0.2}},
            {"comb",
             support::comb(),
             {{-1, -1, -1}, {0.26, 2, 2}},
             {{3.8, 0.5, -1}, {5, 2, 2}},
             {-0.1, 0.4, 0.3}},
            {"steps",
             support::steps(),
             {{-1, -1, -1}, {0.3, 5, 2}},
             {{3.7, 3.2, -1}, {5, 5, 2}},
             {0.2, 0.5, 0.4}}};
}

/// An open sheet whose crease lies in a plane between leaves.
Scene roof()
{
    Shape shape;
    for (int i = 0; i <= 16; ++i)
        for (int j = 0; j <= 4; ++j)
            shape.samples.emplace_back(0.25 * i, 0.25 * j, 0.25 * std::min(i, 16 - i));
    for (std::uint32_t i = 0; i < 16; ++i)
        for (std::uint32_t j = 0; j < 4; ++j)
        {
            const std::uint32_t a = 5 * i + j;
            shape.triangles.insert(shape.triangles.end(),
                                   {{a, a + 5, a + 6}, {a, a + 6, a + 1}});
        }
    return {"roof",
            shape,
            {{-1, -1, -1}, {0.3, 2, 3}},
            {{3.7, -1, -1}, {5, 2, 3}},
            {-0.1, 0.2, 0.3}};
}

std::string text_of(const Eigen::Vector3d& x)
{
    return " " + shortest(x[0]) + " " + shortest(x[1]) + " " + shortest(x[2]);
}

std::string box_text(const Box& box, const Eigen::Matrix3d& G)
{
    const Eigen::Vector3d a = G * box.low, b = G * box.high;
    return " box" + text_of(a.cwiseMin(b)) + text_of(a.cwiseMax(b)) + "\n";
}

struct Result
{
    std::vector<Eigen::Vector3d> samples;
    std::size_t cells = 0, faces = 0;
};

Result played(const Scene& scene, const Eigen::Matrix3d& G, const SessionSettings& with)
{
    Shape shape = scene.shape;
    for (Eigen::Vector3d& x : shape.samples)
        x = G * x;
    if (G.determinant() < 0)
        for (Triangle& triangle : shape.triangles)
            std::swap(triangle[1], triangle[2]);
    const std::string text = "cellwarp-handles 1\nfixed foot" + box_text(scene.fixed, G) +
                             "handle head" + box_text(scene.handle, G) +
                             "frame 1\nmove head translate" + text_of(G * scene.step) +
                             "\n";
    Session session(scan_geometry("model.obj", support::obj_text(shape)).geometry,
                    parse_handles("h.handles", text), with);
    while (session.next_frame(true))
        ;
    return {session.deformed().samples, session.system()->body().cells.size(),
            session.system()->body().cells.faces.size()};
}

/// \p tolerance [diagonal].
void expect_all_commute(const std::vector<Scene>& of, const SessionSettings& settings,
                        double tolerance = 1e-9)
{
    for (const Scene& scene : of)
    {
        SCOPED_TRACE(scene.name);
        const Result plain = played(scene, Eigen::Matrix3d::Identity(), settings);
        double diagonal = 0.0, moved = 0.0;
        for (std::size_t i = 0; i < plain.samples.size(); ++i)
        {
            diagonal = std::max(diagonal,
                                (scene.shape.samples[i] - scene.shape.samples[0]).norm());
            moved = std::max(moved, (plain.samples[i] - scene.shape.samples[i]).norm());
        }
        EXPECT_GT(moved, 0.05 * diagonal);
        for (const Eigen::Matrix3d& G :
             {kHalfTurn, kQuarterTurn, kMirrorX, kMirrorY, kRoundTheDiagonal})
        {
            const Result other = played(scene, G, settings);
            EXPECT_EQ(other.cells, plain.cells);
            EXPECT_EQ(other.faces, plain.faces);
            double worst = 0.0;
            for (std::size_t i = 0; i < plain.samples.size(); ++i)
                worst = std::max(worst, (other.samples[i] - G * plain.samples[i]).norm());
            EXPECT_LT(worst, tolerance * diagonal);
        }
    }
}

SessionSettings tight(int across, int depth)
{
    SessionSettings settings;
    settings.cells.across = across;
    settings.cells.max_depth = depth;
    settings.gradient_tolerance = 1e-10;
    return settings;
}

} // namespace

TEST(Symmetry, turns_and_mirror_images_of_prisms_combs_and_steps_commute)
{
    for (const int across : {8, 16})
    {
        SCOPED_TRACE(across);
        expect_all_commute(scenes(), tight(across, 0));
    }
}

TEST(Symmetry, refined_cells_turn_and_mirror_too)
{
    SessionSettings settings = tight(8, 2);
    settings.cells.threshold = 3e-3;
    expect_all_commute(scenes(), settings);
}

TEST(Symmetry, open_sheets_turn_and_mirror_too)
{
    // A sheet bends so easily that a gradient of 1e-10 leaves more.
    expect_all_commute({roof()}, tight(16, 0), 1e-8);
}

TEST(Symmetry, sheets_get_the_cells_of_their_mirror_images)
{
    // The gradient that ends a solve on the way leaves a sheet a hundredth of the
    // diagonal from its end: cells chosen there would depend on the way.
    SessionSettings settings;
    settings.cells.across = 12;
    settings.cells.max_depth = 2;
    for (const double threshold : {2e-3, 1e-3})
    {
        settings.cells.threshold = threshold;
        expect_all_commute({roof()}, settings, 1e-8);
    }
}

TEST(Symmetry, a_triangle_that_buckles_is_scaled_with_its_scene)
{
    const auto bent = [](double scale)
    {
        const Shape shape{{{0, 0, 0},
                           {2 * scale, 0.3 * scale, 0.1 * scale},
                           {0.5 * scale, 1.5 * scale, 0.2 * scale}},
                          {{0, 1, 2}}};
        const auto number = [&](double x) { return " " + shortest(scale * x); };
        Session session(
            scan_geometry("t.obj", support::obj_text(shape)).geometry,
            parse_handles("t.handles", "cellwarp-handles 1\nfixed a halfspace -1 0 0" +
                                           number(-0.2) + "\nhandle b halfspace 1 0 0" +
                                           number(1.8) +
                                           "\nframe 1\nmove b rotate 0 0 1 40 about" +
                                           number(1.8) + number(0.3) + number(0.1) +
                                           " translate" + number(-0.4) + " 0 0\n"),
            SessionSettings());
        while (session.next_frame(true))
            ;
        EXPECT_EQ(session.frames().back().solve.stop, Stop::Converged);
        return session.deformed().samples;
    };
    const std::vector<Eigen::Vector3d> one = bent(1.0), three = bent(3.0);
    for (std::size_t i = 0; i < one.size(); ++i)
        EXPECT_LT((three[i] / 3.0 - one[i]).norm(), 1e-7) << i;
}

} // namespace cellwarp
