// SPDX-License-Identifier: GPL-3.0-or-later
// Rods and curves in a document: drawn, bent point by point, taken back.
#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include "editor/document/editing.h"
#include "io/formats/geometry_file.h"
#include "octree/base/index.h"
#include "tests/editor/document/random_edits.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::contents;
using support::error_of;
using support::replayed;

namespace
{

using Eigen::Vector3d;

struct Bar : support::BarDocument
{
    Bar() : support::BarDocument(6) {}
    Document open_small(bool has_journal = true) const
    {
        Document document = open(has_journal);
        SceneSettings settings;
        settings.cells.across = 12;
        settings.cells.max_depth = 0;
        document.change_settings(settings);
        return document;
    }
};

const RodShape kAxis{{{0.5, 0.5, 0.2}, {0.5, 0.5, 2}, {0.5, 0.5, 3.8}}, false, 0.2};

PointPlacement to(const Vector3d& place)
{
    return {place, std::nullopt};
}

/// From a place [model unit] to where the third point of the only line is shown [view].
double distance(const Editing& editing, const Vector3d& place)
{
    return (editing.shape().lines[0].points[2] - editing.view_frame().to_work(place))
        .norm();
}

/// Until it is shown there, but no longer than a hand would wait.
void drag(Editing& editing, const Vector3d& place)
{
    editing.drag_point_to(to(place));
    for (int k = 0; k < 1000 && distance(editing, place) > 1e-9; ++k)
    {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        editing.update();
    }
}

} // namespace

TEST(Lines, a_rod_is_drawn_bent_and_let_go_and_all_of_it_taken_back)
{
    const Bar bar;
    Document document = bar.open_small();
    std::vector<std::string> states = {contents(document)};
    EXPECT_EQ(document.add_line(Role::Rod, kAxis), "rod");
    states.push_back(contents(document));
    document.move_point("rod", 2, to({0.5, 1.2, 3.6}));
    states.push_back(contents(document));
    document.move_point("rod", 1, {std::nullopt, 30.0});
    states.push_back(contents(document));
    document.release_point("rod", 2, {false, true, true});
    states.push_back(contents(document));
    const EditedRegion& rod = *document.region("rod");
    ASSERT_EQ(rod.points.size(), 3u);
    EXPECT_EQ(rod.points[0].parts, (HoldParts{true, true, true}));
    EXPECT_EQ(rod.points[1].parts, (HoldParts{false, false, true}));
    EXPECT_NEAR(rod.points[1].degrees, 30.0, 1e-12);
    EXPECT_EQ(rod.points[2].parts, (HoldParts{true, false, false}));
    EXPECT_LT((rod.points[2].place - Vector3d(0.5, 1.2, 3.6)).norm(), 1e-12);
    EXPECT_EQ(document.history().name(document.history().position() - 1),
              "Release point 2 of rod");
    for (std::size_t k = states.size(); k-- > 1;)
    {
        EXPECT_EQ(contents(document), states[k]);
        document.undo();
    }
    EXPECT_EQ(contents(document), states[0]);
    for (std::size_t k = 1; k < states.size(); ++k)
        document.redo();
    EXPECT_EQ(contents(document), states.back());
}

TEST(Lines, what_was_saved_is_bent_the_same)
{
    const Bar bar;
    Document document = bar.open_small();
    document.add_line(Role::Curve,
                      {{{0.5, 0.5, 4.2}, {0.5, 1, 4.4}, {0.5, 2, 4}}, false, {}}, "rail");
    document.add_line(Role::Rod, kAxis);
    document.move_point("rod", 2, {Vector3d(0.5, 1.0, 3.6), 20.0});
    document.move_point("rail", 0, to({0.5, 0.4, 4.2}));
    document.save(bar.folder / "saved.json");
    EXPECT_EQ(replayed(Document(bar.folder / "saved.json", "")), replayed(document));
}

TEST(Lines, what_a_run_left_is_recovered)
{
    const Bar bar;
    std::string left;
    {
        Document document = bar.open_small();
        Selection one(document.model()->geometry.samples.size());
        one.add(0);
        document.select(one, "Select by click");
        document.add_region(Role::Pin, "tip");
        document.add_line(Role::Rod, kAxis);
        document.put_on("tip", "rod", 0.3);
        document.put_on("tip", "rod", std::nullopt);
        document.move_point("rod", 2, {Vector3d(0.5, 1.0, 3.6), 20.0});
        document.release_point("rod", 0, {false, true, false});
        left = contents(document);
    }
    Document document = bar.open();
    ASSERT_GT(document.num_recoverable(), 0u);
    EXPECT_TRUE(document.recover().empty());
    EXPECT_EQ(contents(document), left);
}

TEST(Lines, pins_are_put_on_curves_and_taken_off)
{
    const Bar bar;
    Document document = bar.open_small();
    Selection one(document.model()->geometry.samples.size());
    one.add(0);
    document.select(one, "Select by click");
    document.add_region(Role::Pin, "tip");
    document.add_line(Role::Curve, {{{0, 0, 0}, {-0.5, 0, 0.2}}, false, {}}, "rail");
    document.put_on("tip", "rail", 0.25);
    EXPECT_EQ(document.region("tip")->guide, "rail");
    EXPECT_EQ(document.region("tip")->share, 0.25);
    EXPECT_FALSE(document.region("tip")->moves());
    const std::string on = contents(document);
    document.rename_region("rail", "way");
    EXPECT_EQ(document.region("tip")->guide, "way");
    document.undo();
    EXPECT_EQ(contents(document), on);
    // A curve that goes takes what stays on it along.
    document.remove_region("rail");
    EXPECT_TRUE(document.region("tip")->moves());
    document.undo();
    EXPECT_EQ(contents(document), on);
    document.put_on("tip", "rail", std::nullopt);
    EXPECT_FALSE(document.region("tip")->share);
    document.put_on("tip", "", std::nullopt);
    EXPECT_TRUE(document.handles().stages[0].ons.empty());
}

TEST(Lines, says_what_cannot_be)
{
    const Bar bar;
    Document document = bar.open_small();
    document.select(support::between(document, 0, 0.5), "Select by box");
    document.add_region(Role::Fixed, "foot");
    document.add_line(Role::Rod, kAxis);
    const auto says = [&](const char* what, auto&& command)
    {
        const std::string before = contents(document);
        const std::string error = error_of(Fault::Usage, command);
        EXPECT_TRUE(contains(error, what)) << error;
        EXPECT_EQ(contents(document), before);
    };
    says("needs two points",
         [&] {
             document.add_line(Role::Rod, {{{0, 0, 0}}, false, {}});
         });
    says("only rods and curves", [&] { document.add_line(Role::Pin, kAxis); });
    says("is a region", [&] { document.add_line(Role::Rod, kAxis, "foot"); });
    says("has no point 7", [&] { document.move_point("rod", 7, to({0, 0, 0})); });
    says("has no point 0", [&] { document.move_point("foot", 0, to({0, 0, 0})); });
    says("finite", [&] { document.move_point("rod", 1, to({0, NAN, 0})); });
    says("is no rod", [&] { document.set_line("foot", kAxis); });
    says("needs 2 points", [&] { document.set_line("rod", {{{0, 0, 0}}, false, {}}); });
    says("is no pin", [&] { document.put_on("foot", "rod", {}); });
    document.select(support::between(document, 3, 3.5), "Select by box");
    says("told by points, not by samples",
         [&] { document.add_region(Role::Rod, "other"); });
    says("is a rod or a curve", [&] { document.set_role("rod", Role::Fixed, 1.0); });
    says("'rod'", [&] { document.set_samples("rod"); });
    says("has no point 9", [&] { document.release_point("rod", 9, {true, true, true}); });
    document.add_line(Role::Curve, {{{2, 0, 0}, {2, 0, 4}}, false, {}}, "rail");
    says("goes where its points are put",
         [&] {
             document.release_point("rail", 0, {true, true, true});
         });
    document.select(support::between(document, 3.9, 4.1), "Select by box");
    document.add_region(Role::Pin, "tip");
    says("between 0 and 1", [&] { document.put_on("tip", "rail", 2.0); });
    says("'foot' is no rod or curve", [&] { document.put_on("tip", "foot", {}); });
    document.move_point("rod", 1, to({0.6, 0.5, 2}));
    says("something has moved", [&] { document.set_line("rod", kAxis); });
    says("pins can be put on curves before that",
         [&] { document.put_on("tip", "rail", {}); });
    says("a shape that is not there yet", [&] { document.centre_line({}, nullptr); });
}

TEST(Lines, what_waits_for_its_rest_shape_is_told)
{
    // The second stage lies on what the first one makes; shares of its box are unknown.
    const Bar bar;
    bar.folder.write("s.handles", "cellwarp-handles 1\nunits relative\n"
                                  "handle all all\nframe 1\nmove all translate 0 0 1\n"
                                  "commit\nrod r through 0.5 0.5 0.1  0.5 0.5 0.9\n"
                                  "frame 2\nmove r end translate 0 0.1 0\n");
    const std::string scene = bar.folder.write(
        "s.json", R"({"cellwarp": 1, "model": "bar.obj", "handles": "s.handles"})");
    Document document(scene, "");
    EXPECT_TRUE(contains(error_of(Fault::Usage,
                                  [&] {
                                      document.move_point("r", 1, to({0, 0, 4}));
                                  }),
                         "not there yet"));
    document.set_rest(document.stage_fingerprint(),
                      std::make_shared<const std::vector<Vector3d>>(
                          document.model()->geometry.samples));
    EXPECT_TRUE(contains(
        error_of(Fault::Usage, [&] { document.add_line(Role::Curve, kAxis, "rail"); }),
        "in relative units lines are drawn before anything has moved"));
    document.move_point("r", 1, to({0.5, 0.5, 3.5}));
}

TEST(Lines, a_point_in_the_hand_bends_what_is_shown_and_is_solved_on_release)
{
    const Bar bar;
    Editing editing(bar.open_small(false));
    editing.document().add_line(Role::Rod, kAxis);
    editing.wait();
    ASSERT_EQ(editing.shape().lines.size(), 1u);
    EXPECT_EQ(editing.shape().lines[0].name, "rod");
    const Vector3d rest = editing.shape().lines[0].points[2];
    ASSERT_TRUE(editing.begin_point_drag("rod", 2));
    drag(editing, {0.5, 1.2, 3.6});
    const Vector3d wanted = editing.view_frame().to_work({0.5, 1.2, 3.6});
    EXPECT_LT((editing.shape().lines[0].points[2] - wanted).norm(), 1e-9);
    EXPECT_GT((rest - wanted).norm(), 0.05);
    editing.end_drag();
    editing.wait();
    ASSERT_TRUE(editing.result());
    EXPECT_EQ(
        editing.document().history().name(editing.document().history().position() - 1),
        "Move point 2 of rod");
    EXPECT_LT((editing.shape().lines[0].points[2] - wanted).norm(), 1e-9);
    EXPECT_EQ(editing.result()->samples, replayed(editing.document()));
    // Let go where it was taken: no edit.
    const std::size_t edits = editing.document().history().position();
    ASSERT_TRUE(editing.begin_point_drag("rod", 0));
    editing.end_drag();
    EXPECT_EQ(editing.document().history().position(), edits);
    std::string why;
    EXPECT_FALSE(editing.begin_point_drag("rod", 5, &why));
    EXPECT_TRUE(contains(why, "has no point 5"));
}

TEST(Lines, a_rod_in_the_hand_comes_back_from_far_away)
{
    const Bar bar;
    Editing editing(bar.open_small(false));
    editing.document().add_line(Role::Rod, kAxis);
    editing.wait();
    ASSERT_TRUE(editing.begin_point_drag("rod", 2));
    for (const Vector3d& place :
         {Vector3d(0.5, 0.5, 1e6), Vector3d(0.5, 0.5, -1e6), Vector3d(0.5, 0.9, 3.7)})
        drag(editing, place);
    EXPECT_EQ(editing.drag_status().error, "");
    EXPECT_LT(distance(editing, {0.5, 0.9, 3.7}), 1e-9);
    editing.cancel_drag();
}

TEST(Lines, a_rod_that_pushes_back_is_dragged_to_where_it_is_solved_on_release)
{
    const Bar bar;
    Editing editing(bar.open_small(false));
    RodShape stiff = kAxis;
    stiff.stiffness = 5.0;
    editing.document().add_line(Role::Rod, kAxis);
    editing.document().set_line("rod", stiff);
    EXPECT_EQ(shape_of(editing.document().regions()[0]).stiffness, 5.0);
    editing.wait();
    ASSERT_TRUE(editing.begin_point_drag("rod", 2));
    for (const Vector3d& place :
         {Vector3d(0.5, 0.8, 3.8), Vector3d(0.5, 1.0, 3.7), Vector3d(0.5, 1.2, 3.6)})
        drag(editing, place);
    EXPECT_EQ(editing.drag_status().error, "");
    editing.end_drag();
    editing.wait();
    ASSERT_TRUE(editing.result());
    EXPECT_LT(distance(editing, {0.5, 1.2, 3.6}), 1e-9);
    EXPECT_EQ(editing.result()->samples, replayed(editing.document()));
    editing.document().undo();
    EXPECT_EQ(shape_of(editing.document().regions()[0]).stiffness, 5.0);
}

TEST(Lines, a_rod_is_drawn_along_the_middle_of_the_shape)
{
    const Bar bar;
    Editing editing(bar.open_small(false));
    editing.draw_centre_line({});
    EXPECT_TRUE(contains(error_of(Fault::Usage, [&] { editing.draw_centre_line({}); }),
                         "is looked for already"));
    EXPECT_TRUE(editing.is_drawing());
    editing.wait();
    EXPECT_FALSE(editing.is_drawing());
    const std::optional<DrawnLine> drawn = editing.take_drawn();
    ASSERT_TRUE(drawn);
    EXPECT_EQ(drawn->error, "");
    EXPECT_EQ(drawn->name, "rod");
    EXPECT_FALSE(editing.take_drawn());
    // What has changed meanwhile has no such rod, and that is said.
    editing.draw_centre_line({});
    editing.document().remove_region("rod");
    editing.wait();
    EXPECT_TRUE(contains(editing.take_drawn()->error, "changed meanwhile"));
    EXPECT_EQ(editing.document().region("rod"), nullptr);
    editing.document().undo();
    const EditedRegion* const rod = editing.document().region("rod");
    ASSERT_NE(rod, nullptr);
    for (const EditedPoint& point : rod->points)
        EXPECT_LT((point.rest - Vector3d(0.5, 0.5, point.rest.z())).norm(), 0.3);
    EXPECT_EQ(rod->line->form, SplineStatement::Form::Through);
}

} // namespace cellwarp::core
