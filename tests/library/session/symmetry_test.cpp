// SPDX-License-Identifier: GPL-3.0-or-later
// What turns or mirrors a shape turns or mirrors its material, its cells and the result.
#include "library/session/session.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

#include "io/base/number.h"
#include "io/formats/geometry_file.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
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

/// A shape of blocks that is its own image in x, and what is held and moved on its right:
/// its left has the same.
struct OwnImage
{
    const char* name;
    Shape shape;
    Box fixed, right;
};

std::vector<double> lines_to(int count, double width, double from)
{
    std::vector<double> lines;
    for (int i = 0; i <= count; ++i)
        lines.push_back(from + width * i);
    return lines;
}

/// A trunk with two arms, whose undersides lie in the middle of leaves where 36 are
/// across; the arms are held where samples are, or between them.
OwnImage tee(double held_from)
{
    return {"tee",
            support::blocks_shape(
                {lines_to(24, 0.1, -1.2), lines_to(14, 0.1, 0.0), lines_to(4, 0.1, 0.0)},
                [](int i, int j, int)
                { return (i >= 10 && i < 14) || (j >= 9 && j < 12); }),
            {{-1, -0.1, -1}, {1, 0.25, 1}},
            {{held_from, 0, -1}, {1.3, 2, 1}}};
}

/// A back with ten teeth; \p held_from: where the held part of the right ones begins.
OwnImage two_combs(double held_from)
{
    return {"two combs",
            support::blocks_shape({lines_to(18, 0.13, -1.17), lines_to(6, 0.13, 0.0),
                                   lines_to(2, 0.13, 0.0)},
                                  [](int i, int j, int)
                                  { return j < 2 || (i < 9 ? i % 2 == 0 : i % 2 == 1); }),
            {{-0.2457, -1, -1}, {0.2457, 2, 1}},
            {{held_from, -1, -1}, {2, 2, 1}}};
}

/// How far the edited shape is from its own image [diagonal], laid along the axes by \p
/// G.
double asymmetry_of(const OwnImage& scene, const Eigen::Matrix3d& G,
                    const SessionSettings& settings)
{
    const Eigen::Matrix3d M = Eigen::Vector3d(-1, 1, 1).asDiagonal();
    Shape shape = scene.shape;
    for (Eigen::Vector3d& x : shape.samples)
        x = G * x;
    if (G.determinant() < 0)
        for (Triangle& triangle : shape.triangles)
            std::swap(triangle[1], triangle[2]);
    const Eigen::Vector3d z = G.determinant() * (G * Eigen::Vector3d::UnitZ()),
                          step(0.05, 0.02, 0.03), middle(0.4, 1.0, 0.2);
    const auto moves = [&](const std::string& name, const Eigen::Matrix3d& side,
                           const std::string& degrees)
    {
        return "move " + name + " rotate" + text_of(z) + " " + degrees + " about" +
               text_of(G * side * middle) + " translate" + text_of(G * side * step) +
               "\n";
    };
    Session session(
        scan_geometry("model.obj", support::obj_text(shape)).geometry,
        parse_handles("h.handles", "cellwarp-handles 1\nfixed foot" +
                                       box_text(scene.fixed, G) + "handle left" +
                                       box_text(scene.right, G * M) + "handle right" +
                                       box_text(scene.right, G) + "frame 1\n" +
                                       moves("left", M, "-10") +
                                       moves("right", Eigen::Matrix3d::Identity(), "10")),
        settings);
    while (session.next_frame(true))
        ;
    const std::vector<Eigen::Vector3d>& moved = session.deformed().samples;
    const Eigen::Matrix3d mirrored = G * M * G.transpose();
    double worst = 0.0, diagonal = 0.0;
    for (std::size_t i = 0; i < moved.size(); ++i)
    {
        const Eigen::Vector3d image = mirrored * shape.samples[i];
        const auto other = std::min_element(
            shape.samples.begin(), shape.samples.end(),
            [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b)
            { return (a - image).squaredNorm() < (b - image).squaredNorm(); });
        const std::size_t j = static_cast<std::size_t>(other - shape.samples.begin());
        worst = std::max(worst, (moved[j] - mirrored * moved[i]).norm());
        diagonal = std::max(diagonal, (shape.samples[i] - shape.samples[j]).norm());
    }
    return worst / diagonal;
}

SessionSettings tight(int across, int depth)
{
    SessionSettings settings;
    settings.cells.across = across;
    settings.cells.max_depth = depth;
    settings.gradient_tolerance = 1e-10;
    return settings;
}

/// A prism over a T, whose two caps are one face each.
struct Prism
{
    std::vector<Eigen::Vector3d> samples;
    std::vector<std::vector<std::size_t>> faces;
};

Prism t_prism()
{
    const std::vector<Eigen::Vector2d> outline = {{0, 0},   {4, 0},   {4, 1},   {2.5, 1},
                                                  {2.5, 3}, {1.5, 3}, {1.5, 1}, {0, 1}};
    const std::size_t n = outline.size();
    Prism prism;
    prism.faces.resize(2);
    for (const double z : {0.0, 1.0})
        for (const Eigen::Vector2d& x : outline)
            prism.samples.emplace_back(x.x(), x.y(), z);
    for (std::size_t k = 0; k < n; ++k)
    {
        prism.faces[0].push_back(n - 1 - k);
        prism.faces[1].push_back(n + k);
        prism.faces.push_back({k, (k + 1) % n, n + (k + 1) % n, n + k});
    }
    return prism;
}

/// The deformed samples, in their order, of the prism that is turned or mirrored by \p G,
/// whose faces begin \p first corners later and whose vertices are shuffled.
Result played(const Prism& prism, const Eigen::Matrix3d& G, std::size_t first,
              unsigned seed)
{
    std::vector<std::size_t> order(prism.samples.size());
    std::iota(order.begin(), order.end(), std::size_t(0));
    std::mt19937 rng(seed);
    if (seed != 0)
        std::shuffle(order.begin(), order.end(), rng);
    std::string obj;
    std::vector<std::size_t> number(order.size());
    for (std::size_t i = 0; i < order.size(); ++i)
    {
        number[order[i]] = i + 1;
        obj += "v" + text_of(G * prism.samples[order[i]]) + "\n";
    }
    for (std::vector<std::size_t> face : prism.faces)
    {
        std::rotate(face.begin(),
                    face.begin() + static_cast<std::ptrdiff_t>(first % face.size()),
                    face.end());
        if (G.determinant() < 0.0)
            std::reverse(face.begin(), face.end());
        obj += "f";
        for (const std::size_t corner : face)
            obj += " " + std::to_string(number[corner]);
        obj += "\n";
    }
    const std::string handles =
        "cellwarp-handles 1\nfixed foot" + box_text({{-1, -1, -1}, {0.3, 4, 2}}, G) +
        "handle head" + box_text({{3.7, -1, -1}, {5, 4, 2}}, G) +
        "frame 1\nmove head translate" + text_of(G * Eigen::Vector3d(0, 0.5, 0.3)) + "\n";
    Session session(scan_geometry("t.obj", obj).geometry,
                    parse_handles("h.handles", handles), tight(8, 0));
    while (session.next_frame(true))
        ;
    Result result{{},
                  session.system()->body().cells.size(),
                  session.system()->body().cells.faces.size()};
    for (std::size_t i = 0; i < prism.samples.size(); ++i)
        result.samples.push_back(G.transpose() *
                                 session.deformed().samples[number[i] - 1]);
    return result;
}

} // namespace

TEST(Symmetry, a_concave_face_begins_at_any_corner_and_turns_and_mirrors)
{
    const Prism prism = t_prism();
    const Result plain = played(prism, Eigen::Matrix3d::Identity(), 0, 0);
    // Two by eight cells lie in the bar, two by four in the stem, in each of two layers.
    EXPECT_EQ(plain.cells, 48u);
    const auto expect_same =
        [&](const Eigen::Matrix3d& G, std::size_t first, unsigned seed)
    {
        SCOPED_TRACE(first);
        const Result other = played(prism, G, first, seed);
        EXPECT_EQ(other.cells, plain.cells);
        EXPECT_EQ(other.faces, plain.faces);
        for (std::size_t i = 0; i < plain.samples.size(); ++i)
            EXPECT_LT((other.samples[i] - plain.samples[i]).norm(), 5e-9); // of 5.1
    };
    for (std::size_t first = 1; first < 8; ++first)
        expect_same(Eigen::Matrix3d::Identity(), first, 0);
    for (const Eigen::Matrix3d& G :
         {kHalfTurn, kQuarterTurn, kMirrorX, kMirrorY, kRoundTheDiagonal})
        expect_same(G, 0, 0);
    expect_same(Eigen::Matrix3d::Identity(), 0, 1);
    expect_same(kMirrorX, 5, 2);
}

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

TEST(Symmetry, a_symmetric_edit_of_a_symmetric_shape_is_symmetric_in_any_cells)
{
    // 0.9009 is in the middle of a layer of voxels where 12 are across, and 28 leave a
    // part of a leaf over on either side.
    for (const OwnImage& scene : {tee(1.0), tee(0.95), two_combs(0.9009)})
        for (const int across : {0, 12, 24, 28, 36})
            for (const Eigen::Matrix3d& G : {Eigen::Matrix3d(Eigen::Matrix3d::Identity()),
                                             kQuarterTurn, kRoundTheDiagonal, kMirrorY})
                EXPECT_LT(asymmetry_of(scene, G, tight(across, 0)), 1e-9)
                    << scene.name << " " << across;
}

TEST(Symmetry, a_symmetric_edit_of_a_shell_is_symmetric)
{
    for (const OwnImage& scene : {tee(1.0), two_combs(0.9009)})
        for (const int across : {16, 30})
        {
            SessionSettings settings = tight(across, 1);
            settings.cells.fill = Fill::Shell;
            for (const Eigen::Matrix3d& G :
                 {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), kRoundTheDiagonal})
                EXPECT_LT(asymmetry_of(scene, G, settings), 1e-8)
                    << scene.name << " " << across;
        }
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

} // namespace cellwarp::core
