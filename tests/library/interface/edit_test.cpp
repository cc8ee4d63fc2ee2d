// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/edit.h>

#include <cmath>
#include <limits>

#include "tests/support/files.h"
#include "tests/support/interface.h"

namespace cellwarp
{

using support::contains;
using support::error_of;

namespace
{

const double kNan = std::numeric_limits<double>::quiet_NaN();

/// A statement that is refused leaves the edit as it was.
template <class Add>
std::string refused(Edit edit, Add&& add)
{
    const std::string before = edit.text();
    const std::string error = error_of(Fault::Malformed, [&] { add(edit); });
    EXPECT_EQ(edit.text(), before);
    return error;
}

Edit of_all_statements()
{
    Edit edit;
    const std::vector<std::uint32_t> few = {7, 3, 4, 5, 9};
    edit.fixed("foot", Selector::sphere({0, 0.1, 0}, 0.25))
        .handle("head", Selector::indices(few))
        .handle("head", Selector::capsule({0, 0, 1}, {0, 0, 2}, 0.5))
        .pin("pin", Selector::box({1, 2, 3}, {1, 2, 3}))
        .stiff("plate", Selector::halfspace({0, 0, 1}, 0.5), 3.0)
        .stiff("list", Selector::indices(few), 2.0)
        .fixed("a name", Selector::group("of #faces"))
        .rod("rod", {.points = {{0, 0, 0}, {0, 0, 1}, {0, 1, 2}},
                     .spans = 3,
                     .radius = 0.3,
                     .stiffness = 2.0,
                     .is_exact = true})
        .curve("curve", {.points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}}, .is_closed = true})
        .on("pin", "curve", 0.25);
    edit.frame(1)
        .move("head", {translate({0.1, 0, 1.0 / 3.0}), rotate({0, 0, 1}, 30),
                       rotate_about({1, 0, 0}, 400, {1, 2, 3}),
                       rotate_about_border({0, 1, 0}, -5), matrix(kIdentity)})
        .move("rod", kEnd, {to({0, 0, 2})})
        .move("rod", 1, {translate({0, 0.5, 0})});
    edit.frame(5).release("rod", 1).release("rod", kEnd,
                                            {.place = false, .twist = false});
    edit.commit().fixed("foot", Selector::all()).frame(9);
    return edit;
}

} // namespace

TEST(Edit, writes_all_statements_as_text_that_parses_to_the_same)
{
    const std::string text = of_all_statements().text();
    EXPECT_TRUE(contains(text, "handle head indices 3-5 7 9\n")) << text;
    EXPECT_TRUE(contains(text, "release rod end tangent\n")) << text;
    EXPECT_EQ(Edit::parse(text).text(), text);
    EXPECT_EQ(of_all_statements().num_frames(), 3u);
    EXPECT_EQ(of_all_statements().regions(), std::vector<std::string>{"foot"});
}

TEST(Edit, goes_on_behind_text)
{
    Edit edit = Edit::parse("cellwarp-handles 1\nfixed foot all\nhandle head group a\n"
                            "frame 3\nmove head translate 1 0 0\n");
    EXPECT_TRUE(contains(refused(edit, [](Edit& e) { e.frame(3); }), "frame number"));
    EXPECT_TRUE(contains(refused(edit,
                                 [](Edit& e) {
                                     e.move("head", {translate({0, 0, 1})});
                                 }),
                         "twice"));
    edit.frame(4).move("head", {translate({0, 0, 1})});
    EXPECT_TRUE(contains(edit.text(), "frame 4\nmove head translate 0 0 1\n"));
}

TEST(Edit, checks_each_statement_when_it_is_added)
{
    const Edit base = support::bend();
    Edit regions;
    regions.fixed("foot", Selector::all()).handle("head", Selector::all());
    const auto box = [](double number) {
        return Selector::box({0, 0, 0}, {1, number, 1});
    };
    EXPECT_TRUE(contains(refused(regions, [&](Edit& e) { e.fixed("x", box(kNan)); }),
                         "box number 5: got 'nan'"));
    EXPECT_TRUE(contains(refused(regions, [&](Edit& e) { e.fixed("x", box(-1.0)); }),
                         "lower corner is above"));
    EXPECT_TRUE(contains(
        refused(regions, [](Edit& e) { e.fixed("x", Selector::sphere({}, -1.0)); }),
        "radius"));
    EXPECT_TRUE(contains(
        refused(regions, [](Edit& e) { e.fixed("x", Selector::halfspace({}, 0.0)); }),
        "normal"));
    EXPECT_TRUE(contains(
        refused(regions, [](Edit& e) { e.stiff("x", Selector::all(), 0.0); }), "factor"));
    EXPECT_TRUE(contains(
        refused(regions, [](Edit& e) { e.handle("foot", Selector::all()); }), "already"));
    const std::vector<std::int64_t> negative = {3, -1};
    EXPECT_TRUE(contains(
        refused(regions, [&](Edit& e) { e.fixed("x", Selector::indices(negative)); }),
        "index: got -1"));
    const std::vector<std::uint8_t> nothing(10, 0);
    EXPECT_TRUE(contains(
        refused(regions, [&](Edit& e) { e.fixed("x", Selector::mask(nothing)); }),
        "indices: there is none"));
    EXPECT_TRUE(contains(
        refused(regions, [](Edit& e) { e.move("head", {translate({})}); }), "no frame"));
    EXPECT_TRUE(contains(refused(base, [](Edit& e) { e.fixed("x", Selector::all()); }),
                         "before the frames"));
    Edit framed = regions;
    framed.frame(1);
    EXPECT_TRUE(contains(refused(framed,
                                 [](Edit& e) {
                                     e.move("hed", {translate({0, 0, 1})});
                                 }),
                         "hed"));
    EXPECT_TRUE(contains(refused(framed,
                                 [](Edit& e) {
                                     e.move("foot", {translate({0, 0, 1})});
                                 }),
                         "fixed"));
    EXPECT_TRUE(contains(refused(framed,
                                 [](Edit& e) {
                                     e.move("head", {translate({kNan, 0, 0})});
                                 }),
                         "translate number 1: got 'nan'"));
    EXPECT_TRUE(contains(
        refused(framed, [](Edit& e) { e.move("head", {rotate({}, 5.0)}); }), "axis"));
    EXPECT_TRUE(contains(refused(framed,
                                 [](Edit& e) {
                                     e.move("head", {rotate({0, 0, 1}, INFINITY)});
                                 }),
                         "degrees"));
    EXPECT_TRUE(contains(refused(framed, [](Edit& e) { e.move("head", {to({})}); }),
                         "'to' is for a pin"));
    EXPECT_TRUE(contains(refused(framed, [](Edit& e)
                                 { e.move("head", std::initializer_list<Operation>{}); }),
                         "operation"));
    Mat4 last_row = kIdentity;
    last_row[3][0] = 1.0;
    EXPECT_TRUE(
        contains(refused(framed, [&](Edit& e) { e.move("head", {matrix(last_row)}); }),
                 "last row"));
    EXPECT_TRUE(contains(refused(framed, [](Edit& e) { e.frame(-1); }), "frame number"));
    EXPECT_TRUE(contains(refused(regions, [](Edit& e) { e.commit(); }), "commit"));
    EXPECT_TRUE(contains(refused(regions, [](Edit& e) { e.use_relative_units(); }),
                         "before the first region"));
    EXPECT_TRUE(contains(refused(regions,
                                 [](Edit& e) {
                                     e.rod("r", {.points = {{0, 0, 0}}});
                                 }),
                         "points"));
    EXPECT_TRUE(
        contains(refused(regions,
                         [](Edit& e) {
                             e.rod("r", {.points = {{0, 0, 0}, {0, 0, 1}}, .spans = 65});
                         }),
                 "spans"));
    EXPECT_TRUE(
        contains(refused(regions, [](Edit& e) { e.on("head", "foot"); }), "only a pin"));
}

TEST(Edit, a_refused_move_may_be_made_in_another_way)
{
    Edit edit;
    edit.handle("head", Selector::all()).frame(1);
    refused(edit, [](Edit& e) { e.move("head", {to({0, 0, 1})}); });
    edit.move("head", {translate({0, 0, 1})});
    EXPECT_EQ(edit.num_frames(), 1u);
}

TEST(Edit, joints_are_taken_all_or_none)
{
    Edit edit;
    const std::vector<Joint> good = {{.name = "root"},
                                     {.name = "tip", .parent = "root", .at = {0, 0, 1}}};
    std::vector<Joint> wrong = good;
    wrong.push_back({.name = "far", .parent = "none", .at = {0, 0, 2}});
    EXPECT_TRUE(contains(refused(edit, [&](Edit& e) { e.skeleton(wrong); }), "none"));
    edit.skeleton(good).frame(1);
    const Operation turn = rotate({1, 0, 0}, 30);
    edit.pose("tip", {&turn, 1});
    EXPECT_TRUE(contains(edit.text(), "joint tip at 0 0 1 parent root\n"));
    EXPECT_TRUE(contains(edit.text(), "move tip rotate 1 0 0 30\n"));
}

TEST(Edit, refuses_names_that_no_file_can_hold)
{
    Edit edit;
    EXPECT_TRUE(contains(
        error_of(Fault::Usage, [&] { edit.fixed("two\nlines", Selector::all()); }),
        "line break"));
    EXPECT_EQ(edit.text(), Edit().text());
    edit.fixed("# commit \t", Selector::all());
    EXPECT_EQ(Edit::parse(edit.text()).regions(),
              std::vector<std::string>{"# commit \t"});
}

TEST(Edit, copies_are_independent)
{
    Edit edit = support::bend();
    const Edit copy = edit;
    edit.frame(2).move("head", {translate({0, 0, 0.1})});
    EXPECT_EQ(copy.num_frames(), 1u);
    EXPECT_EQ(edit.num_frames(), 2u);
}

TEST(Edit, names_the_line_of_a_wrong_file)
{
    const core::support::Folder folder;
    const std::string path =
        folder.write("wrong.handles", "cellwarp-handles 1\nfixed foot bx 0 0 0 1 1 1\n");
    try
    {
        Edit::read(path);
        FAIL();
    }
    catch (const Error& error)
    {
        EXPECT_EQ(error.fault(), Fault::Malformed);
        EXPECT_EQ(error.where().file, path);
        EXPECT_EQ(error.where().line, 2);
        EXPECT_EQ(error.where().field, "selector");
        EXPECT_TRUE(contains(error.message(), "got 'bx'"));
    }
}

} // namespace cellwarp
