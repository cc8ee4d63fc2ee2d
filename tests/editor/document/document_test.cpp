// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/document.h"

#include <cmath>
#include <filesystem>
#include <random>
#include <tuple>
#include <utility>

#include <gtest/gtest.h>

#include "editor/document/edit.h"
#include "editor/document/history.h"
#include "editor/document/journal_header.h"
#include "io/formats/geometry_file.h"
#include "io/journal/journal.h"
#include "library/session/session.h"
#include "octree/base/index.h"
#include "tests/editor/document/random_edits.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::between;
using support::contains;
using support::contents;
using support::edit_at_random;
using support::error_of;
using support::hold_ends;

namespace
{

struct Bar : support::BarDocument
{
    /// A scene of the bar whose handle file has these statements.
    std::string write_scene(const std::string& statements) const
    {
        folder.write("s.handles", "cellwarp-handles 1\n" + statements);
        return folder.write(
            "s.json", R"({"cellwarp": 1, "model": "bar.obj", "handles": "s.handles"})");
    }
};

RigidMove shifted(double x)
{
    RigidMove placement;
    placement.translation.x() = x;
    return placement;
}

} // namespace

TEST(Document, edits_of_rods_and_curves_read_back_the_same)
{
    const HandleFile file = parse_handles(
        "h.handles",
        "cellwarp-handles 1\nrod \"my spine\" through 0 0 0  0 0.1 1  0 0 2 closed spans "
        "2 "
        "radius 0.3 exact\ncurve rail points 0 0 0  1 0 0  2 0 0  3 1 0\n"
        "frame 1\nmove \"my spine\" point 1 translate 0 1 0 turn 30 tangent 0 0 1\n"
        "release \"my spine\" start twist\nmove rail rotate 0 0 1 20\n");
    Edit edit;
    edit.name = "Draw";
    edit.changes = {RegionChange{0, {}, file.stages[0].regions},
                    FramesAdded{file.stages[0].frames}};
    Edited edited;
    edited.handles.path = file.path;
    edited.handles.stages.resize(1);
    apply(parse_edit(edit_text(edit), "journal"), edited);
    EXPECT_EQ(handle_text(edited.handles), handle_text(file));
    take_back(edit, edited);
    EXPECT_TRUE(edited.handles.stages[0].regions.empty());
}

TEST(Document, edits_of_all_statements_read_back_the_same)
{
    Edit edit;
    edit.name = "All";
    Stage part;
    // A list that a handle file would break into several lines is one statement here.
    RegionStatement list{Role::Stiff, "my list", {}, 20.0};
    list.selector.kind = Selector::Kind::Indices;
    for (std::int64_t k = 0; k < 400; ++k)
        list.selector.ranges.emplace_back(3 * k, 3 * k + k % 2);
    RegionStatement labels{Role::Pin, "tip", {}};
    labels.selector.kind = Selector::Kind::Labels;
    labels.selector.name = "/elsewhere/../a folder/x.sel";
    labels.selector.label = -3;
    const HandleFile file = parse_handles(
        "h.handles",
        "cellwarp-handles 1\nfixed foot box 0 0 0 1 1 0.1\nhandle head sphere 0 0 3 0.1\n"
        "handle end capsule 0 0 0 1 1 1 0.2\nhandle half halfspace 0 0 1 0.3\n"
        "fixed g group \"a b\"\nfixed rest all\npin p indices 3\ncurve rail through 0 0 "
        "0  1 0 0\non p rail at 0.25\njoint root at 0 0 0\njoint hand at 0 0 1 parent "
        "root\nframe 1\nmove head translate 0.1 0 0 rotate 0 0 1 30 about 1 2 3\n"
        "move end matrix 1 0 0 1 0 1 0 2 0 0 1 3 0 0 0 1\nmove hand to 0 0 2 from root\n"
        "frame 7\nrelease hand\n");
    part = file.stages[0];
    part.regions.push_back(list);
    part.regions.push_back(labels);
    edit.changes = {RegionChange{2, {}, part.regions}, FramesAdded{part.frames},
                    OnsChange{part.ons, {}}, StageAdded{part.regions}};
    const Edit again = parse_edit(edit_text(edit), "journal");
    EXPECT_EQ(edit_text(again), edit_text(edit));
    const auto& regions = std::get<RegionChange>(again.changes[0]).after;
    ASSERT_EQ(regions.size(), part.regions.size());
    EXPECT_EQ(regions[regions.size() - 2].selector.ranges, list.selector.ranges);
    EXPECT_EQ(regions[regions.size() - 2].factor, 20.0);
    EXPECT_EQ(regions.back().selector.name, labels.selector.name);
    EXPECT_EQ(regions.back().selector.label, -3);
    EXPECT_EQ(std::get<OnsChange>(again.changes[2]).before[0].at, 0.25);
    const auto& frames = std::get<FramesAdded>(again.changes[1]).frames;
    EXPECT_EQ(frames[0].moves[2].chain, "root");
    EXPECT_EQ((*frames[0].moves[1].operations[0].matrix)(2, 3), 3.0);
    EXPECT_EQ(frames[1].number, 7);
    EXPECT_TRUE(frames[1].moves[0].released);
}

TEST(Document, names_the_selection_and_takes_it_from_other_regions)
{
    const Bar bar;
    Document document = bar.open();
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, [&] { document.add_region(Role::Fixed); }),
                 "nothing is selected"));
    hold_ends(document);
    const std::size_t foot = document.regions()[0].samples.size();
    document.select(between(document, 0, 0), "Select by box");
    EXPECT_EQ(document.add_region(Role::Pin), "pin");
    EXPECT_EQ(document.regions().size(), 3u);
    EXPECT_EQ(document.region("foot")->samples.size() +
                  document.region("pin")->samples.size(),
              foot);
    EXPECT_TRUE(document.selection().empty());
    document.undo();
    EXPECT_FALSE(document.selection().empty());
    document.redo();
    document.select(between(document, 0, 0), "Select by box");
    EXPECT_EQ(document.add_region(Role::Stiff), "stiff");
    EXPECT_EQ(document.region("pin")->samples, document.region("stiff")->samples);
    EXPECT_EQ(
        document.regions()[idx(document.region_of(document.region("pin")->samples[0]))]
            .name,
        "pin");
    document.select(between(document, 0, 0), "Select by box");
    EXPECT_EQ(document.add_region(Role::Fixed, "floor"), "floor");
    EXPECT_EQ(document.region("pin"), nullptr); // all of it went
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, [&] { document.rename_region("floor", "head"); }),
                 "already"));
    error_of(Fault::Usage, [&] { document.rename_region("floor", "a\nb"); });
    error_of(Fault::Usage, [&] { document.move_region("floor", shifted(1)); });
}

TEST(Document, moves_keep_their_turns_and_write_what_a_file_means)
{
    const Bar bar;
    Document document = bar.open();
    hold_ends(document);
    RigidMove to = shifted(0.5);
    document.move_region("head", to);
    to.axis = Eigen::Vector3d::UnitZ();
    to.degrees = 400;
    document.move_region("head", to);
    EXPECT_EQ(document.region("head")->placement, to);
    // The turn is more than half of one about a new axis: it is told in two frames.
    ASSERT_EQ(document.handles().stages[0].frames.size(), 3u);
    to.degrees = 800;
    document.move_region("head", to);
    ASSERT_EQ(document.handles().stages[0].frames.size(), 4u);
    document.undo();
    document.undo();
    EXPECT_EQ(document.handles().stages[0].frames.size(), 1u);
    EXPECT_EQ(document.region("head")->placement, shifted(0.5));
}

TEST(Document, reads_placements_from_any_operations)
{
    const Bar bar;
    write_file(bar.folder / "s.handles",
               "cellwarp-handles 1\nhandle head box -1 -1 3.4 2 2 5\nframe 1\n"
               "move head translate 0 0 1 rotate 0 0 1 90 about 0 0 0\n",
               Overwrite::No);
    write_file(bar.folder / "s.json",
               "{\"cellwarp\": 1, \"model\": \"bar.obj\", \"handles\": \"s.handles\"}",
               Overwrite::No);
    const Document document(bar.folder / "s.json", "");
    const RigidMove& placement = document.region("head")->placement;
    EXPECT_NEAR(placement.degrees, 90, 1e-9);
    EXPECT_LT((placement.axis - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
    // The centre (0.5, 0.5, 3.5) goes to (-0.5, 0.5, 4.5).
    EXPECT_LT((placement.translation - Eigen::Vector3d(-1, 0, 1)).norm(), 1e-12);
    EXPECT_TRUE(document.is_saved());
}

TEST(Document, reads_and_writes_pivots_in_the_units_of_the_file)
{
    const Bar bar;
    for (const std::string units : {"model", "relative"})
    {
        SCOPED_TRACE(units);
        // The bar is 1 x 1 x 4.
        const std::string pivot = units == "model" ? "0.5 1 3" : "0.5 1 0.75";
        Document document(
            bar.write_scene(std::string(units == "model" ? "" : "units relative\n") +
                            "handle head indices 0 1 2 3\nframe 1\n"
                            "move head rotate 1 0 0 90 about " +
                            pivot + "\n"),
            "");
        RigidMove to = document.region("head")->placement;
        EXPECT_EQ(to.pivot, Eigen::Vector3d(0.5, 1, 3));
        EXPECT_EQ(to.translation, Eigen::Vector3d::Zero());
        EXPECT_EQ(document.region("head")->pivot(), Eigen::Vector3d(0.5, 1, 3));
        to.degrees = 100;
        document.move_region("head", to);
        EXPECT_EQ(document.region("head")->placement, to);
        const std::string text = handle_text(document.handles());
        EXPECT_TRUE(contains(text, "rotate 1 0 0 100 about " + pivot)) << text;
    }
}

TEST(Document, a_pivot_of_a_flat_box_is_told_in_shares_where_it_lies_in_its_plane)
{
    const Bar bar;
    bar.folder.write("bar.obj", "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\nf 1 2 3 4\n");
    const std::string scene = bar.write_scene("units relative\nfixed foot indices 0 1\n"
                                              "handle head indices 2 3\n");
    Document document(scene, "");
    RigidMove to;
    to.pivot = Eigen::Vector3d(0.5, 1, 0);
    to.axis = Eigen::Vector3d::UnitZ();
    to.degrees = 180;
    document.move_region("head", to);
    EXPECT_EQ(document.region("head")->placement, to);
    to.pivot->x() = NAN;
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, [&] { document.move_region("head", to); }),
                 "a pivot needs finite numbers"));
    document.undo();
    to.pivot = Eigen::Vector3d(0.5, 1, 0.25); // beside it
    to.axis = Eigen::Vector3d::UnitX();
    to.degrees = 90;
    document.move_region("head", to);
    const EditedRegion& head = *document.region("head");
    EXPECT_FALSE(head.placement.pivot);
    // The centre (0.5, 2, 0) turns about a line at (y, z) = (1, 0.25): to (1.25, 1.25).
    // It leaves the plane of the box, which such units cannot tell either.
    EXPECT_LT((motion_of(head)(head.centre) - Eigen::Vector3d(0.5, 1.25, 0)).norm(),
              1e-12);
}

TEST(Document, a_pivot_changes_while_its_region_stands_still)
{
    const Bar bar;
    Document document = bar.open(false);
    hold_ends(document);
    RigidMove to;
    to.axis = Eigen::Vector3d::UnitZ();
    to.degrees = 60;
    document.move_region("head", to);
    const Motion before = motion_of(*document.region("head"));
    EditedRegion head = *document.region("head");
    to = about({2, 0.5, 3.5}, head);
    const std::size_t before_it = document.history().position();
    document.move_region("head", to); // that is where it is
    EXPECT_EQ(document.history().position(), before_it);
    to.degrees = 150;
    document.move_region("head", to);
    const std::vector<FrameStatement>& frames = document.handles().stages[0].frames;
    ASSERT_EQ(frames.size(), 3u);
    document.undo();
    // The frame between says the same about the new pivot.
    HandleFile file = document.handles();
    EXPECT_EQ(file.stages[0].frames.size(), 1u);
    document.redo();
    head.placement = about({2, 0.5, 3.5}, head);
    const Motion between = motion_of(head);
    EXPECT_LT((before.R - between.R).norm() + (before.t - between.t).norm(), 1e-12);
    const Operation& turn = document.handles().stages[0].frames[1].moves[0].operations[0];
    EXPECT_EQ(turn.move.degrees, 60);
    EXPECT_EQ(turn.move.pivot, head.placement.pivot);
}

TEST(Document, a_turn_about_a_border_is_placed_when_the_border_is_known)
{
    const Bar bar;
    Document document(bar.write_scene("fixed foot box -1 -1 -1 2 2 0.6\n"
                                      "handle head box -1 -1 3.4 2 2 5\nframe 1\n"
                                      "move head rotate 1 0 0 90 about border\n"),
                      "");
    const auto move = [&] { document.move_region("head", shifted(0.5)); };
    EXPECT_FALSE(document.region("head")->knows_placement);
    EXPECT_TRUE(contains(error_of(Fault::Usage, move), "turns about its border"));
    const Eigen::Vector3d border(0.5, 0.5, 3.25);
    document.set_borders({{"head", border}});
    EXPECT_TRUE(document.region("head")->knows_placement);
    RigidMove to = document.region("head")->placement;
    EXPECT_EQ(to.pivot, border);
    EXPECT_EQ(to.degrees, 90);
    to.degrees = 60;
    document.move_region("head", to);
    EXPECT_TRUE(
        contains(handle_text(document.handles()), "rotate 1 0 0 60 about 0.5 0.5 3.25"));
    document.undo();
    // Other cells have another border.
    SceneSettings settings = document.settings();
    settings.cells.across = 9;
    document.change_settings(settings);
    EXPECT_FALSE(document.region("head")->border);
    EXPECT_FALSE(document.region("head")->knows_placement);
}

TEST(Document, a_commit_keeps_a_region_without_samples_by_its_shape)
{
    const Bar bar;
    const std::string path = bar.write_scene(
        "fixed foot box -1 -1 -1 2 2 0.6\nhandle head box -1 -1 3.4 2 2 5\n"
        "stiff core box 0.3 0.3 1 0.7 0.7 3 20\nframe 1\nmove head translate 0.1 0 0\n");
    Document document(path, "");
    ASSERT_TRUE(document.region("core")->samples.empty());
    document.set_role("foot", Role::Pin);
    ASSERT_EQ(document.handles().stages.size(), 2u);
    document.save(path);
    const Document again(path, "");
    const RegionStatement& core = again.handles().stages[1].regions[2];
    EXPECT_EQ(core.name, "core");
    EXPECT_EQ(core.factor, 20.0);
    ASSERT_EQ(core.selector.kind, Selector::Kind::Box);
    EXPECT_EQ(core.selector.numbers, (std::vector<double>{0.3, 0.3, 1, 0.7, 0.7, 3}));
}

TEST(Document, regions_of_a_stage_wait_for_its_rest_shape_where_they_depend_on_it)
{
    // The first stage moves everything up by 10: the boxes of the second one hold
    // nothing, or something else, of the model.
    const Bar bar;
    const std::string stages =
        "handle all all\nframe 1\nmove all translate 0 0 10\ncommit\n"
        "fixed foot box -1 -1 9 2 2 10.6\nhandle head box -1 -1 13.4 2 2 15\n"
        "handle tip indices 0\n";
    const auto lift = [](const Document& document)
    {
        std::vector<Eigen::Vector3d> rest = document.model()->geometry.samples;
        for (Eigen::Vector3d& x : rest)
            x.z() += 10;
        return std::make_shared<const std::vector<Eigen::Vector3d>>(rest);
    };
    const auto expect_wait = [](const auto& command)
    { EXPECT_TRUE(contains(error_of(Fault::Usage, command), "wait for the result")); };
    for (const char* const frame : {"", "frame 2\nmove head translate 0 0 1\n"})
    {
        SCOPED_TRACE(frame);
        Document document(bar.write_scene(stages + frame), "");
        const std::string before = contents(document);
        expect_wait([&] { document.set_role("head", Role::Fixed); });
        document.select(between(document, 0, 0.6), "Select by box");
        expect_wait([&] { document.add_region(Role::Pin, "floor"); });
        if (*frame)
            expect_wait([&] { document.remove_region("tip"); });
        document.undo();
        EXPECT_EQ(contents(document), before);
        document.move_region("tip", shifted(0.5)); // the same on any shape
        document.undo();
        document.set_rest(document.stage_fingerprint(), lift(document));
        EXPECT_FALSE(document.region("head")->samples.empty());
        EXPECT_EQ(document.region("head")->centre, Eigen::Vector3d(0.5, 0.5, 13.75));
        document.select(between(document, 0, 0.6), "Select by box");
        document.add_region(Role::Pin, "floor");
        EXPECT_EQ(document.region("foot"), nullptr); // all of it went
        if (*frame)
        {
            const RegionStatement& head = document.handles().stages.back().regions[0];
            EXPECT_EQ(head.name, "head");
            EXPECT_EQ(head.selector.kind, Selector::Kind::Indices);
        }
    }
}

TEST(Document, places_in_a_box_wait_for_the_rest_shape_that_has_it)
{
    const Bar bar;
    Document document(
        bar.write_scene("units relative\nhandle all all\nframe 1\n"
                        "move all rotate 0 1 0 90\ncommit\nhandle tip indices 0\n"),
        "");
    error_of(Fault::Usage, [&] { document.move_region("tip", shifted(1)); });
    std::vector<Eigen::Vector3d> rest = document.model()->geometry.samples;
    for (Eigen::Vector3d& x : rest)
        x = {x.z(), x.y(), -x.x()};
    document.set_rest(document.stage_fingerprint(),
                      std::make_shared<const std::vector<Eigen::Vector3d>>(rest));
    document.move_region("tip", shifted(1));
    // A quarter of the box, which lies along x now.
    EXPECT_EQ(
        document.handles().stages[1].frames[0].moves[0].operations[0].move.translation,
        Eigen::Vector3d(0.25, 0, 0));
}

TEST(Document, label_files_are_read_once)
{
    const Bar bar;
    std::string labels;
    for (const Eigen::Vector3d& x : read_geometry(bar.model).geometry.samples)
        labels += x.z() < 0.6 ? "1\n" : x.z() > 3.4 ? "2\n" : "0\n";
    const std::string file = bar.folder.write("parts.sel", labels);
    Document document(bar.write_scene("fixed foot labels parts.sel 1\n"
                                      "handle head labels parts.sel 2\n"),
                      bar.journals);
    const std::vector<std::uint32_t> head = document.region("head")->samples;
    std::filesystem::remove(file);
    document.set_role("foot", Role::Pin);
    document.undo(); // its statements come back from the journal
    document.rename_region("head", "top");
    EXPECT_EQ(document.region("top")->samples, head);
    Session session(geometry_of(document.model()), document.handles(), {});
    EXPECT_EQ(resolve_regions(document.handles().stages[0].regions,
                              document.model()->geometry,
                              document.model()->geometry.samples,
                              {automatic_frame(document.box()), false, document.box()},
                              document.handles())[1]
                  .samples,
              head);
}

TEST(Document, undo_goes_back_to_the_start_and_redo_to_the_end_whatever_was_done)
{
    const Bar bar;
    Document document = bar.open();
    const std::string start = contents(document);
    hold_ends(document);
    std::mt19937 rng(7);
    std::vector<std::string> after;
    for (int k = 0; k < 300; ++k)
    {
        edit_at_random(document, rng);
        after.resize(document.history().position());
        after.push_back(contents(document)); // of after position edits
    }
    const std::string end = contents(document);
    const std::size_t edits = document.history().size();
    EXPECT_GT(edits, 200u);
    EXPECT_GT(document.handles().stages.size(), 3u);
    while (document.can_undo())
        document.undo();
    EXPECT_EQ(contents(document), start);
    while (document.can_redo())
    {
        document.redo();
        if (const std::size_t position = document.history().position();
            position < after.size() && !after[position].empty())
        {
            EXPECT_EQ(contents(document), after[position]);
        }
    }
    EXPECT_EQ(contents(document), end);
    document.go_to(edits / 2);
    document.go_to(edits);
    EXPECT_EQ(contents(document), end);
}

TEST(Document, a_new_edit_takes_the_place_of_what_was_undone)
{
    const Bar bar;
    Document document = bar.open();
    hold_ends(document);
    document.move_region("head", shifted(1));
    document.undo();
    document.move_region("head", shifted(2));
    EXPECT_FALSE(document.can_redo());
    EXPECT_EQ(document.region("head")->placement, shifted(2));
    EXPECT_EQ(document.history().name(document.history().size() - 1), "Move head");
}

TEST(Document, knows_whether_it_is_saved)
{
    const Bar bar;
    Document document = bar.open();
    EXPECT_TRUE(document.is_saved());
    hold_ends(document);
    EXPECT_FALSE(document.is_saved());
    document.save(bar.folder / "scene.json");
    EXPECT_TRUE(document.is_saved());
    document.select(Selection(document.selection().num_samples()), "Select none");
    EXPECT_TRUE(document.is_saved());
    document.move_region("head", shifted(1));
    EXPECT_FALSE(document.is_saved());
    document.undo();
    EXPECT_TRUE(document.is_saved());
    document.undo();
    document.undo();
    EXPECT_FALSE(document.is_saved());
    error_of(Fault::Usage, [&] { document.save(bar.folder / "scene.obj"); });
    Document other = bar.open(false);
    error_of(Fault::File, [&] { other.save(bar.folder / "scene.json"); });
    const Document again(bar.folder / "scene.json", "");
    EXPECT_EQ(again.regions().size(), 2u);
}

TEST(Document, a_save_that_ended_between_its_two_files_is_noticed)
{
    const Bar bar;
    const std::string path = bar.folder / "scene.json";
    Document document = bar.open();
    hold_ends(document);
    document.save(path);
    const std::string scene = support::bytes_of(path);
    document.move_region("head", shifted(1));
    document.save(path);
    EXPECT_TRUE(Document(path, "").warnings().empty());
    write_file(path, scene, Overwrite::Yes); // as if its rename had never been
    const std::vector<std::string> warnings = Document(path, "").warnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_TRUE(contains(warnings[0], "from another save")) << warnings[0];
    // Also over a scene that was written by hand.
    write_file(path, R"({"cellwarp": 1, "model": "bar.obj", "handles": "scene.handles"})",
               Overwrite::Yes);
    EXPECT_EQ(Document(path, "").warnings().size(), 1u);
    // Another scene may use the handles.
    std::filesystem::rename(path, bar.folder / "other.json");
    EXPECT_TRUE(Document(bar.folder / "other.json", "").warnings().empty());
    Document other(bar.folder / "other.json", "");
    other.save(path, Overwrite::Yes);
    EXPECT_TRUE(Document(path, "").warnings().empty());
}

TEST(Document, does_not_overwrite_unasked_what_another_program_has_written)
{
    const Bar bar;
    const std::string scene = bar.folder / "scene.json",
                      handles = bar.folder / "scene.handles";
    {
        Document first = bar.open();
        hold_ends(first);
        first.save(scene);
        // Its own saves are no changes of another program.
        first.move_region("head", shifted(1));
        first.save(scene);
    }
    const std::string scene_bytes = support::bytes_of(scene),
                      handle_bytes = support::bytes_of(handles);
    const std::string more = handle_bytes + "frame 7\nmove head translate 0 0 3\n";
    for (const auto& [file, theirs] :
         {std::pair(handles, more), {scene, scene_bytes + "\n"}})
    {
        SCOPED_TRACE(file);
        Document document(scene, "");
        document.move_region("head", shifted(0.5));
        write_file(file, theirs, Overwrite::Yes);
        const auto said = [&]
        {
            try
            {
                document.save(scene);
            }
            catch (const ChangedOnDisk& error)
            {
                EXPECT_EQ(error.fault(), Fault::File);
                EXPECT_EQ(error.file(), file);
                return std::string(error.what());
            }
            return std::string();
        };
        EXPECT_TRUE(contains(said(), "another program has changed it"));
        EXPECT_FALSE(document.is_saved());
        EXPECT_EQ(support::bytes_of(file), theirs);
        // Another name is free, and the question stands.
        document.save(bar.folder / "other.json", Overwrite::Yes);
        EXPECT_EQ(support::bytes_of(file), theirs);
        Document again(scene, "");
        again.move_region("head", shifted(0.25));
        again.save(scene); // it has read what is there
        write_file(file, theirs, Overwrite::Yes);
        again.move_region("head", shifted(0.125));
        EXPECT_THROW(again.save(scene), ChangedOnDisk);
        again.save(scene, Overwrite::Yes);
        again.save(scene);
        EXPECT_TRUE(again.is_saved());
        // The same bytes again, or no file, are nothing that could be lost.
        write_file(file, support::bytes_of(file), Overwrite::Yes);
        again.save(scene);
        std::filesystem::remove(file);
        again.save(scene);
        write_file(scene, scene_bytes, Overwrite::Yes);
        write_file(handles, handle_bytes, Overwrite::Yes);
    }
}

TEST(Document, a_file_that_cannot_be_read_at_the_moment_is_not_overwritten_unasked)
{
    const Bar bar;
    const std::string scene = bar.folder / "scene.json",
                      handles = bar.folder / "scene.handles";
    Document document = bar.open();
    hold_ends(document);
    document.save(scene);
    for (const std::string& file : {scene, handles})
    {
        document.move_region("head", shifted(0.5));
        std::filesystem::resize_file(file, kMaxFileBytes + 1); // takes no room
        EXPECT_THROW(document.save(scene), ChangedOnDisk);
        EXPECT_EQ(std::filesystem::file_size(file), kMaxFileBytes + 1);
        document.save(scene, Overwrite::Yes);
        document.save(scene);
        EXPECT_TRUE(document.is_saved());
    }
}

TEST(Document, a_handle_file_that_it_has_not_read_is_not_overwritten_unasked)
{
    const Bar bar;
    const std::string scene = bar.folder / "scene.json";
    write_file(scene, R"({"cellwarp": 1, "model": "bar.obj"})", Overwrite::No);
    write_file(bar.folder / "scene.handles", "cellwarp-handles 1\n", Overwrite::No);
    Document document(scene, "");
    hold_ends(document);
    EXPECT_THROW(document.save(scene), ChangedOnDisk);
    document.save(scene, Overwrite::Yes);
    document.save(scene);
}

TEST(Document, edits_that_were_recovered_onto_other_files_are_not_saved_unasked)
{
    const Bar bar;
    const std::string scene = bar.folder / "scene.json",
                      handles = bar.folder / "scene.handles",
                      journals = bar.folder / "journals", others = bar.folder / "others";
    std::filesystem::create_directory(journals);
    std::filesystem::create_directory(others);
    {
        Document first = bar.open(false);
        hold_ends(first);
        first.save(scene);
    }
    const auto crash = [&](const std::string& folder, bool saves)
    {
        Document document(scene, folder);
        document.move_region("head", shifted(0.5));
        if (saves)
            document.save(scene, Overwrite::Yes);
        document.move_region("head", shifted(0.25));
    };
    crash(journals, true);
    {
        Document document(scene, journals);
        ASSERT_GT(document.num_recoverable(), 0u);
        document.recover();
        document.save(scene); // its own save is there
    }
    crash(others, false);
    write_file(handles,
               support::bytes_of(handles) + "frame 70\nmove head translate 0 0 3\n",
               Overwrite::Yes);
    Document document(scene, others);
    ASSERT_GT(document.num_recoverable(), 0u);
    document.recover();
    EXPECT_THROW(document.save(scene), ChangedOnDisk);
}

TEST(Document, keeps_what_it_does_not_know_in_a_scene)
{
    const Bar bar;
    const std::string path = bar.folder / "s.json";
    write_file(path,
               R"({"note": [1, "two"], "cellwarp": 1, "model": "bar.obj",
  "rods": [{"radius": 0.25, "through": [[0, 0, 1], [0, 0, 2]]}], "cells": {"gap": 0.03, "colour": "red", "across": 9,
  "frame": {"origin": [0, 0, 0], "size": [1, 1, 4], "by": "hand"}},
  "field": {"drag": "blend", "speed": 7}, "simulate": {"dt": 0.01}})",
               Overwrite::No);
    Document document(path, "");
    EXPECT_EQ(document.warnings().size(), 6u);
    hold_ends(document);
    SceneSettings settings = document.settings();
    settings.cells.gap = 0.05;
    settings.cells.across.reset();
    settings.field.drag.reset();
    settings.field.release = "blend";
    document.change_settings(settings);
    document.save(path);
    const std::string saved = support::bytes_of(path);
    const std::string fingerprint = saved.substr(saved.rfind(' '));
    EXPECT_EQ(saved.substr(0, saved.size() - fingerprint.size()), R"({
  "note": [
    1,
    "two"
  ],
  "cellwarp": 1,
  "model": "bar.obj",
  "rods": [
    {
      "radius": 0.25,
      "through": [
        [
          0,
          0,
          1
        ],
        [
          0,
          0,
          2
        ]
      ]
    }
  ],
  "cells": {
    "gap": 0.05,
    "colour": "red",
    "frame": {
      "origin": [
        0.0,
        0.0,
        0.0
      ],
      "size": [
        1.0,
        1.0,
        4.0
      ],
      "by": "hand",
      "axes": [
        [
          1.0,
          0.0,
          0.0
        ],
        [
          0.0,
          1.0,
          0.0
        ],
        [
          0.0,
          0.0,
          1.0
        ]
      ]
    }
  },
  "field": {
    "speed": 7,
    "release": "blend"
  },
  "simulate": {
    "dt": 0.01
  },
  "handles": "s.handles",
  "save":)");
    EXPECT_EQ(Document(path, "").settings(), settings);
}

TEST(Document, settings_that_a_file_may_not_say_are_refused)
{
    const Bar bar;
    Document document = bar.open();
    SceneSettings settings;
    settings.cells.threshold = -1.0;
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, [&] { document.change_settings(settings); }),
                 "threshold"));
    settings.cells.threshold = 1e-3;
    document.change_settings(settings);
    EXPECT_EQ(document.scene().settings.cells.threshold, 1e-3);
    document.undo();
    EXPECT_FALSE(document.scene().settings.cells.threshold);
}

TEST(Document, what_a_run_left_is_recovered_edit_by_edit)
{
    const Bar bar;
    std::string before;
    {
        Document document = bar.open();
        hold_ends(document);
        document.move_region("head", shifted(1));
        document.move_region("head", shifted(2));
        document.undo();
        before = contents(document);
        // It ends here without close(), as by kill -9.
    }
    Document document = bar.open();
    EXPECT_EQ(document.num_recoverable(), 7u); // edits and the undo
    error_of(Fault::Usage,
             [&] { document.select(between(document, 0, 1), "Select by box"); });
    EXPECT_TRUE(document.recover().empty());
    EXPECT_EQ(contents(document), before);
    EXPECT_TRUE(document.can_redo());
    EXPECT_FALSE(document.is_saved());
    document.close();
    EXPECT_EQ(bar.open().num_recoverable(), 0u);
}

TEST(Document, a_saved_scene_opens_with_its_history_and_the_last_view)
{
    const Bar bar;
    const std::string scene = bar.folder / "scene.json";
    const auto state = [](const Document& document)
    {
        return handle_text(document.handles()) +
               std::to_string(document.selection().count());
    };
    std::vector<std::string> states;
    {
        Document document = bar.open();
        EXPECT_EQ(document.last_view(), "");
        hold_ends(document);
        for (const double x : {1.0, 2.0, 3.0})
        {
            states.push_back(state(document));
            document.move_region("head", shifted(x));
        }
        document.undo();
        states.push_back(state(document));
        document.save(scene);
        document.select(between(document, 0, 1), "Select by box"); // no file tells that
        document.close("from the left");
    }
    for (int run = 0; run < 3; ++run)
    {
        SCOPED_TRACE(run);
        Document document(scene, bar.journals);
        EXPECT_EQ(document.num_recoverable(), 0u);
        EXPECT_EQ(document.last_view(), "from the left");
        EXPECT_TRUE(document.is_saved());
        EXPECT_FALSE(document.selection().empty());
        document.undo();
        for (const std::size_t k : {2u, 1u, 0u})
        {
            EXPECT_EQ(state(document), states[k + (k == 2)]) << k;
            EXPECT_EQ(document.is_saved(), k == 2);
            document.undo();
        }
        document.go_to(document.history().size());
        EXPECT_TRUE(document.is_saved());
        if (run < 2) // the last one ends as by kill -9
            document.close("from the left");
    }
    Document document(scene, bar.journals);
    EXPECT_EQ(document.num_recoverable(), 5u); // four undone, and all done again
    document.recover();
    EXPECT_EQ(document.history().position(), 7u);
    document.save(scene);
}

TEST(Document, has_no_history_of_a_file_that_says_something_else_now)
{
    const Bar bar;
    const std::string scene = bar.folder / "scene.json";
    const auto close_saved = [&](Document document)
    {
        hold_ends(document);
        document.move_region("head", shifted(1));
        document.save(scene, Overwrite::Yes);
        document.close("from the left");
    };
    const auto expect_none = [&]
    {
        Document document(scene, bar.journals);
        EXPECT_EQ(document.num_recoverable(), 0u);
        EXPECT_FALSE(document.can_undo());
        EXPECT_TRUE(document.is_saved());
        EXPECT_EQ(document.last_view(), "from the left");
        document.close();
    };
    close_saved(bar.open());
    bar.folder.write("scene.handles",
                     "cellwarp-handles 1\nfixed foot box -1 -1 -1 2 2 0.6\n");
    expect_none();
    std::filesystem::remove(scene);
    std::filesystem::remove(bar.folder / "scene.handles");
    close_saved(bar.open());
    write_file(bar.model, support::obj_text(support::box_shape({0, 0, 0}, {1, 2, 4}, 4)),
               Overwrite::Yes);
    expect_none();
    // What was not saved is not there, and can be done again.
    {
        Document document(scene, bar.journals);
        document.move_region("head", shifted(2));
        document.close("from the right");
    }
    Document document(scene, bar.journals);
    EXPECT_FALSE(document.can_undo());
    EXPECT_TRUE(document.is_saved());
    EXPECT_EQ(document.last_view(), "from the right");
    document.redo();
    EXPECT_EQ(document.region("head")->placement, shifted(2));
    EXPECT_FALSE(document.can_redo());
}

TEST(Document, dropping_what_a_crash_left_keeps_the_history_of_what_was_saved)
{
    const Bar bar;
    const std::string scene = bar.folder / "scene.json";
    {
        Document document = bar.open();
        hold_ends(document);
        document.move_region("head", shifted(1));
        document.save(scene);
        document.close("from the left");
    }
    {
        Document document(scene, bar.journals);
        document.move_region("head", shifted(2)); // and it ends as by kill -9
    }
    {
        Document document(scene, bar.journals);
        ASSERT_EQ(document.num_recoverable(), 1u);
        document.drop_recoverable();
        EXPECT_TRUE(document.is_saved());
        EXPECT_EQ(document.region("head")->placement, shifted(1));
        EXPECT_TRUE(document.can_undo());
        EXPECT_TRUE(document.can_redo());
        document.undo();
        EXPECT_FALSE(document.is_saved());
        document.close(); // unsaved: the file's state is the last but one
    }
    {
        Document document(scene, bar.journals);
        EXPECT_TRUE(document.is_saved());
        EXPECT_EQ(document.region("head")->placement, shifted(1));
        document.save(bar.folder / "other.json");
        document.close();
    }
    // Saved over another scene, a journal that was closed is not kept aside.
    Document again = bar.open();
    hold_ends(again);
    again.save(bar.folder / "other.json", Overwrite::Yes);
    for (const auto& entry : std::filesystem::directory_iterator(bar.journals))
        EXPECT_FALSE(contains(entry.path().string(), ".kept")) << entry.path();
}

TEST(Document, any_edits_are_gone_back_through_when_their_scene_is_opened_again)
{
    const Bar bar;
    for (unsigned seed = 0; seed < 6; ++seed)
    {
        SCOPED_TRACE(seed);
        const std::string scene = bar.folder / ("s" + std::to_string(seed) + ".json");
        std::mt19937 rng(seed);
        std::string before;
        std::size_t count = 0;
        {
            Document document = bar.open();
            hold_ends(document);
            for (int k = 0; k < 40; ++k)
                edit_at_random(document, rng);
            document.save(scene);
            before = contents(document);
            count = document.history().position();
            document.close();
        }
        Document document(scene, bar.journals);
        EXPECT_EQ(document.num_recoverable(), 0u);
        ASSERT_EQ(document.history().position(), count);
        EXPECT_EQ(contents(document), before);
        document.go_to(0);
        EXPECT_TRUE(document.regions().empty());
        document.go_to(count);
        EXPECT_EQ(contents(document), before);
    }
}

TEST(Document, recovers_from_the_scene_as_it_was_when_the_edits_began)
{
    const Bar bar;
    const std::string scene = bar.folder / "scene.json";
    {
        Document document = bar.open(false);
        hold_ends(document);
        document.save(scene);
    }
    std::string before;
    {
        Document document(scene, bar.journals);
        document.move_region("head", shifted(1));
        document.save(scene);
        document.move_region("head", shifted(2));
        before = contents(document);
    }
    Document document(scene, bar.journals);
    document.recover();
    EXPECT_EQ(contents(document), before);
}

TEST(Document, says_what_has_changed_since_and_drops_what_is_not_wanted)
{
    const Bar bar;
    {
        Document document = bar.open();
        hold_ends(document);
    }
    write_file(bar.model, support::obj_text(support::box_shape({0, 0, 0}, {1, 2, 4}, 4)),
               Overwrite::Yes);
    {
        Document document = bar.open();
        const std::vector<std::string> warnings = document.recover();
        ASSERT_EQ(warnings.size(), 1u);
        EXPECT_TRUE(contains(warnings[0], "checksum")) << warnings[0];
    }
    Document document = bar.open();
    document.drop_recoverable();
    EXPECT_EQ(document.num_recoverable(), 0u);
    hold_ends(document);
}

TEST(Document, takes_its_journal_along_to_the_scene_it_is_saved_as)
{
    const Bar bar;
    const std::string scene = bar.folder / "elsewhere.json";
    std::string before;
    {
        Document document = bar.open();
        hold_ends(document);
        document.save(scene);
        error_of(Fault::File, [&] { Document(scene, bar.journals); });
        document.move_region("head", shifted(1));
        before = contents(document);
    }
    EXPECT_EQ(bar.open().num_recoverable(), 0u);
    Document document(scene, bar.journals);
    ASSERT_EQ(document.num_recoverable(), 5u);
    document.recover();
    EXPECT_EQ(contents(document), before);
}

TEST(Document, opens_where_no_journal_can_be_kept_and_says_so)
{
    const Bar bar;
    {
        Document document = bar.open();
        hold_ends(document);
    }
    const auto journal = std::filesystem::directory_iterator(bar.journals)->path();
    std::filesystem::remove(journal);
    std::filesystem::create_directory(journal);
    const Document document = bar.open();
    ASSERT_FALSE(document.warnings().empty());
    EXPECT_TRUE(contains(document.warnings().back(), "no journal is kept"));
}

TEST(Document, one_process_edits_a_file_at_a_time)
{
    const Bar bar;
    const Document document = bar.open();
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { bar.open(); }), "in use by"));
}

TEST(Document, kept_edits_are_there_the_next_time_and_not_asked_for)
{
    const support::Folder folder;
    const std::string model = folder.write(
        "bar.obj", support::obj_text(support::box_shape({0, 0, 0}, {3, 1, 1}, 4)));
    for (std::size_t k = 1; k <= 2; ++k)
    {
        Document document(model, folder.path());
        Selection selection(document.selection().num_samples());
        selection.add(k);
        document.select(selection, "One");
        document.add_region(Role::Stiff, "part" + std::to_string(k));
        document.close("", Unsaved::Keep);
    }
    {
        Document document(model, folder.path());
        EXPECT_EQ(document.num_recoverable(), 0u);
        EXPECT_EQ(document.warnings(), std::vector<std::string>{});
        EXPECT_EQ(document.history().size(), 4u);
        EXPECT_EQ(document.regions().size(), 2u);
        EXPECT_FALSE(document.is_saved());
        // A saved document leaves nothing to keep.
        document.save(folder / "s.json");
        document.close("", Unsaved::Keep);
    }
    const Document again(folder / "s.json", folder.path());
    EXPECT_EQ(again.num_recoverable(), 0u);
    EXPECT_TRUE(again.is_saved());
    EXPECT_EQ(again.history().size(), 4u);
}

TEST(Document, a_change_of_settings_survives_the_journal)
{
    Edited edited;
    edited.settings.energy = "botsch07";
    edited.settings.cells.thickness = 0.03;
    edited.settings.cells.across = 8;
    edited.settings.cells.gap = 0.02;
    const SceneSettings before = edited.settings;
    SceneSettings after = before;
    after.cells.across = 12;
    after.cells.gap.reset();
    after.cells.flat = false;
    const Edit edit = parse_edit(
        edit_text({"Change settings", {SettingsChange{before, after}}}), "journal");
    apply(edit, edited);
    EXPECT_EQ(edited.settings, after);
    take_back(edit, edited);
    EXPECT_EQ(edited.settings, before);
}

TEST(Document, records_of_no_known_change_are_malformed)
{
    for (const auto& [change, words] :
         {std::pair<std::string, std::string>{R"({"dance": {}})", "unknown change"},
          {R"({"toggle": [], "rename": {}})", "needs one key"},
          {"7", "needs one key"},
          {R"({"toggle": [[0, 9]]})", "runs come in pairs"},
          {R"({"commit": "dance 1"})", "unknown statement"},
          {R"({"frames": "move head translate 1 0 0"})", "unknown statement"},
          {R"({"commit": []})", "must be string"}})
        EXPECT_TRUE(contains(
            error_of(Fault::Malformed,
                     [&, text = "{\"name\": \"x\", \"changes\": [" + change + "]}"]
                     { parse_edit(text, "bar.journal"); }),
            words))
            << change;
}

TEST(Document, commands_that_cannot_be_are_told)
{
    const Bar bar;
    Document document = bar.open();
    hold_ends(document);
    const std::size_t edits = document.revision();
    const auto told = [&](const auto& command)
    { return error_of(Fault::Usage, command); };
    EXPECT_TRUE(contains(told([&] { document.rename_region("tail", "x"); }),
                         "there is no region 'tail'"));
    for (const double factor : {0.0, -1.0, std::nan("")})
        EXPECT_TRUE(contains(
            told([&]
                 { document.set_role(document.regions()[0].name, Role::Stiff, factor); }),
            "above 0"));
    EXPECT_TRUE(
        contains(told([&] { document.move_region("head", shifted(std::nan(""))); }),
                 "a place needs finite numbers"));
    EXPECT_EQ(document.revision(), edits);
    document.select(between(document, 0, 0), "Select by box");
    EXPECT_TRUE(
        contains(told([&] { document.add_region(Role::Pin, "\xff"); }), "no UTF-8"));
}

TEST(Document, no_frame_comes_after_the_last_number)
{
    const Bar bar;
    const std::string scene = bar.write_scene(
        "fixed foot box -1 -1 -1 2 2 0.6\nhandle head box -1 -1 3.4 2 2 5\n"
        "frame 999999999\nmove head translate 0 0 1\n");
    Document document(scene, "");
    EXPECT_TRUE(contains(
        error_of(Fault::Usage, [&] { document.move_region("head", shifted(1)); }),
        "has no frame after 999999999"));
}

TEST(Document, edits_of_another_document_do_not_fit)
{
    for (const auto& [change, way_back, words] :
         {std::tuple<std::string, bool, std::string>{R"({"toggle": [0, 9]})", false,
                                                     "the model has other samples"},
          {R"({"region": {"index": 3, "before": "", "after": ""}})", false,
           "the regions are others"},
          {R"({"frames": "frame 1"})", true, "its frames are not there"},
          {R"({"commit": ""})", true, "its commit is not there"}})
    {
        SCOPED_TRACE(change);
        const Edit edit =
            parse_edit("{\"name\": \"x\", \"changes\": [" + change + "]}", "bar.journal");
        Edited edited;
        edited.handles.stages.emplace_back();
        edited.selection = Selection(5);
        EXPECT_TRUE(
            contains(error_of(Fault::Malformed, [&, back = way_back]
                              { back ? take_back(edit, edited) : apply(edit, edited); }),
                     "the edit 'x' does not fit: " + words));
    }
}

TEST(Document, a_journal_that_tells_no_place_or_no_beginning_is_malformed)
{
    const support::Folder folder;
    for (const std::string place : {"", "x", "1", "99999999999999999999", "0 "})
    {
        const std::string path = folder / "places.journal";
        Journal::create(path, "header").append("at " + place);
        JournalContents contents;
        Journal journal = Journal::open(path, contents);
        EXPECT_TRUE(
            contains(error_of(Fault::Malformed, [&]
                              { const History history(std::move(journal), contents); }),
                     "is no place in the history"))
            << place;
        std::filesystem::remove(path);
    }
    const JournalHeader header{"bar.obj",   "", "cellwarp-handles 1\n",
                               "s.handles", 12, 34};
    const std::string text = header_text(header);
    EXPECT_EQ(parse_header(text, "j").handles_path, "s.handles");
    EXPECT_EQ(parse_header(text, "j").model_checksum, 34u);
    for (std::size_t size = 0; size < text.size(); ++size)
        error_of(Fault::Malformed, [&] { parse_header(text.substr(0, size), "j"); });
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed,
                 [&] { parse_header(text.substr(0, text.size() - 4) + "2 3x", "j"); }),
        "header: does not tell what was edited"));
}

} // namespace cellwarp::core
