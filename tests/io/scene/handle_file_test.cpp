// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/handle_file.h"

#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

const std::string kHead = "cellwarp-handles 1\n";

std::string refused(const std::string& text)
{
    return error_of(Fault::Malformed, [&] { parse_handles("h.handles", text); });
}

/// \p statements: behind the first line.
void expect_refused(const std::string& statements, const std::string& what)
{
    const std::string said = refused(kHead + statements);
    EXPECT_TRUE(contains(said, what)) << statements << said;
}

} // namespace

TEST(HandleFile, reads_every_statement)
{
    const HandleFile file = parse_handles(
        "dir/h.handles",
        "# c\ncellwarp-handles 1\nunits relative\n"
        "fixed base box 0 0 0 1 0.1 1 # c\nhandle head sphere 0.5 0.9 0.5 0.15\n"
        "pin tip indices 17 20-22\nstiff plate capsule 0 0 0 1 1 1 0.1 20\n"
        "fixed base halfspace 0 1 0 0.5\nhandle head labels \"a b.sel\" 2\n"
        "fixed rest group \"left arm\"\nfixed every all\n"
        "stiff ring indices 3 5-9 factor 0.5\n"
        "frame 1\nmove head rotate 0 1 0 45 about 1 2 3 translate 0 0.2 0\n"
        "move tip to 0.1 0.2 0.3\nframe 7\ncommit\nhandle other all\nframe 9\n"
        "move other matrix 1 0 0 0  0 1 0 0.2  0 0 1 0  0 0 0 1\n");
    EXPECT_TRUE(file.is_relative);
    ASSERT_EQ(file.stages.size(), 2u);
    const Stage& stage = file.stages[0];
    ASSERT_EQ(stage.regions.size(), 9u);
    EXPECT_EQ(stage.regions[8].selector.ranges.size(), 2u);
    EXPECT_EQ(stage.regions[8].factor, 0.5);
    EXPECT_EQ(stage.regions[2].selector.ranges[1].second, 22);
    EXPECT_EQ(stage.regions[3].factor, 20.0);
    EXPECT_EQ(stage.regions[5].selector.name, "dir/a b.sel");
    EXPECT_EQ(stage.regions[6].selector.name, "left arm");
    ASSERT_EQ(stage.frames.size(), 2u);
    const Move& move = stage.frames[0].moves[0];
    ASSERT_EQ(move.operations.size(), 2u);
    EXPECT_EQ(move.operations[0].move.degrees, 45.0);
    EXPECT_EQ(*move.operations[0].move.pivot, Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ((*file.stages[1].frames[0].moves[0].operations[0].matrix)(1, 3), 0.2);
}

TEST(HandleFile, reads_a_rotation_about_the_border_of_its_region)
{
    const HandleFile file =
        parse_handles("h", "cellwarp-handles 1\nhandle head all\nframe 1\n"
                           "move head rotate 0 1 0 45 about border translate 0 1 0\n");
    const Operation& turn = file.stages[0].frames[0].moves[0].operations[0];
    EXPECT_TRUE(turn.is_about_border);
    EXPECT_FALSE(turn.move.pivot);
    EXPECT_EQ(file.stages[0].frames[0].moves[0].operations.size(), 2u);
}

TEST(HandleFile, names_line_and_field_of_what_is_wrong)
{
    EXPECT_TRUE(contains(refused(""), "empty"));
    EXPECT_TRUE(contains(refused("hello\n"), "h.handles:1"));
    EXPECT_TRUE(contains(refused("cellwarp-handles 2\n"), "h.handles:1"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a box 0 0 0 1 1\n"),
                         "h.handles:2: box number 6"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a box 0 0 0 1 1 nan\n"), "h.handles:2"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a box 1 0 0 0 1 1\n"), "above"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a box 0 0 0 1 1 1 7\n"), "too many"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a sphere 0 0 0 -1\n"), "radius"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a blob\n"), "selector"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a indices 1x\n"), "index"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a indices 5-2\n"), "index"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a halfspace 0 0 0 1\n"), "normal"));
    for (const char* factor : {"", "0", "-2", "nan", "1e-310", "1e-101", "1e300"})
        EXPECT_TRUE(contains(refused(kHead + "stiff a all " + factor + "\n"),
                             "h.handles:2: factor"))
            << factor;
    EXPECT_TRUE(contains(refused(kHead + "stiff a indices 0 20\n"),
                         "h.handles:2: factor: is missing"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a all\nhandle a all\n"), "line 2"));
    EXPECT_TRUE(contains(refused(kHead + "grab a all\n"), "unknown statement"));
    EXPECT_TRUE(contains(refused(kHead + "fixed \"a all\n"), "double quote"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a all\nunits relative\n"), "units"));
    EXPECT_TRUE(contains(refused(kHead + "units metres\n"),
                         "h.handles:2: units: got 'metres', need relative"));
    EXPECT_TRUE(contains(refused(kHead + "fixed a indices 0 factor 2\n"), "too many"));
    EXPECT_TRUE(contains(refused(kHead + "stiff a indices factor 2\n"), "index"));
    EXPECT_TRUE(contains(refused("# <html>\n"), "looks like an HTML"));
    EXPECT_TRUE(
        contains(refused("PK\x03\x04zip"), "h.handles: this looks like a ZIP archive"));
}

TEST(HandleFile, frames_and_moves_must_make_sense)
{
    const std::string regions = kHead + "handle h all\nfixed f all\npin p indices 0\n";
    EXPECT_TRUE(
        contains(refused(regions + "frame 2\nframe 2\n"), "h.handles:6: frame number"));
    EXPECT_TRUE(contains(refused(regions + "frame one\n"),
                         "h.handles:5: frame number: got 'one', need an integer"));
    EXPECT_TRUE(contains(refused(regions + "frame 1\nmove p translate 1 0 0 to 0 0 0\n"),
                         "h.handles:6: p: 'to' must be a pin's first operation"));
    for (const std::string number : {"-1", "1000000000"})
        EXPECT_TRUE(contains(refused(regions + "frame " + number + "\n"),
                             "h.handles:5: frame number: got " + number + ", need 0 to"));
    EXPECT_TRUE(contains(refused(regions + "move h translate 0 0 0\n"), "no frame"));
    EXPECT_TRUE(contains(refused(regions + "frame 1\nmove x translate 0 0 0\n"), "x"));
    EXPECT_TRUE(
        contains(refused(regions + "frame 1\nmove f translate 0 0 0\n"), "fixed"));
    EXPECT_TRUE(contains(refused(regions + "frame 1\nmove h to 0 0 0\n"), "pin"));
    EXPECT_TRUE(contains(refused(regions + "frame 1\nmove p rotate 0 0 1 3\n"), "pin"));
    EXPECT_TRUE(contains(refused(regions + "frame 1\nmove h rotate 0 0 0 3\n"), "axis"));
    EXPECT_TRUE(contains(refused(regions + "frame 1\nmove h\n"),
                         "h.handles:6: operation: is missing"));
    EXPECT_TRUE(
        contains(refused(regions + "frame 1\nmove h scale 2 2 2\n"),
                 "h.handles:6: operation: got 'scale', need translate, rotate, matrix"));
    EXPECT_TRUE(
        contains(refused(regions + "frame 1\nmove h translate 0 0\n"), "translate"));
    EXPECT_TRUE(
        contains(refused(regions + "frame 1\nmove h translate 0 0 0\nmove h translate 1 "
                                   "0 0\n"),
                 "twice"));
    EXPECT_TRUE(
        contains(refused(regions + "frame 1\nmove h matrix 1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 "
                                   "1\n"),
                 "last row"));
    EXPECT_TRUE(
        contains(refused(regions + "frame 1\nmove h matrix 1 0 0 0 0 1 0 0 0 0 1 0 0 0 "
                                   "0\n"),
                 "number 16"));
    EXPECT_TRUE(
        contains(refused(regions + "frame 1\nfixed g all\n"), "before the frames"));
    EXPECT_TRUE(contains(refused(regions + "commit\n"), "commit"));
}

TEST(HandleFile, reads_the_label_files)
{
    const support::Folder folder;
    EXPECT_EQ(read_labels(folder.write("a.sel", "# c\n# d\n0\n1\n2\n")),
              (std::vector<std::int64_t>{0, 1, 2}));
    EXPECT_EQ(read_labels(folder.write("a.dmat", "1 3\n-1\n0\n7\n")),
              (std::vector<std::int64_t>{-1, 0, 7}));
    std::string binary = "0 0\n1 2\n";
    for (const double value : {-1.0, 4.0})
        binary.append(reinterpret_cast<const char*>(&value), sizeof value);
    EXPECT_EQ(read_labels(folder.write("b.dmat", binary)),
              (std::vector<std::int64_t>{-1, 4}));
    for (const char* bad :
         {"1 3\n0\n1\n", "2 2\n0\n0\n0\n0\n", "x\n", "", "1 1\n0.5\n", "0 0\n1 1\nabc"})
        error_of(Fault::Malformed, [&] { read_labels(folder.write("c.dmat", bad)); });
    const auto refused = [&](const std::string& name, const std::string& bytes) {
        return error_of(Fault::Malformed,
                        [&] { read_labels(folder.write(name, bytes)); });
    };
    EXPECT_TRUE(contains(refused("b.sel", "0\nx\n"), "b.sel:2"));
    EXPECT_TRUE(
        contains(refused("b.sel", "PK\x03\x04zip"), "b.sel: this looks like a ZIP"));
    for (const std::string header : {"3", "1 2 3", "1.5 3", "1 -3"})
        EXPECT_TRUE(contains(refused("d.dmat", header + "\n0\n"),
                             "d.dmat:1: header: got '" + header + "', need 'cols rows'"))
            << header;
}

TEST(HandleFile, reads_joints_and_what_moves_them)
{
    const HandleFile file = parse_handles(
        "a.handles", "cellwarp-handles 1\n"
                     "joint root at 0 1 0 radius 0.2\n"
                     "joint \"left arm\" at 1 1 0 parent root hinge 0 0 1 twist -10 140\n"
                     "joint hand at 2 1 0 parent \"left arm\" swing 60\n"
                     "frame 1\n"
                     "move root translate 0 0 1 rotate 0 1 0 90\n"
                     "move hand to 1 2 0 from root\n"
                     "frame 2\n"
                     "release hand\n");
    const Stage& stage = file.stages[0];
    ASSERT_EQ(stage.joints.size(), 3u);
    EXPECT_EQ(stage.joints[0].radius, 0.2);
    EXPECT_EQ(stage.joints[1].parent, "root");
    EXPECT_EQ((*stage.joints[1].twist)[1], 140.0);
    EXPECT_EQ(stage.joints[2].swing, 60.0);
    EXPECT_EQ(stage.frames[0].moves[0].operations.size(), 2u);
    EXPECT_EQ(stage.frames[0].moves[1].chain, "root");
    EXPECT_TRUE(stage.frames[1].moves[0].released);
}

TEST(HandleFile, reads_a_skeleton_from_a_file_beside_it)
{
    const support::Folder folder;
    folder.write("arm.tgf", "1 0 0 0\n2 1 0 0\n3 2 0 0\n#\n1 2\n2 3\n");
    const std::string path =
        folder.write("a.handles", "cellwarp-handles 1\n"
                                  "skeleton arm.tgf scale 2 root 3 translate 0 1 0\n"
                                  "frame 1\nmove 2 rotate 0 0 1 30\n");
    const HandleFile file = read_handles(path);
    ASSERT_EQ(file.stages[0].joints.size(), 3u);
    EXPECT_EQ(file.stages[0].joints[0].name, "3");
    EXPECT_EQ(file.stages[0].joints[0].at, Eigen::Vector3d(4, 1, 0));
}

TEST(HandleFile, refuses_joints_that_cannot_be)
{
    const auto refused_joints = [](const std::string& text)
    {
        return error_of(Fault::Malformed,
                        [&]
                        {
                            parse_handles("a.handles",
                                          "cellwarp-handles 1\n"
                                          "joint root at 0 0 0\n"
                                          "joint arm at 1 0 0 parent root\n" +
                                              text);
                        });
    };
    const auto tells = [&](const std::string& text, const std::string& what)
    {
        const std::string said = refused_joints(text);
        EXPECT_TRUE(contains(said, what)) << said;
    };
    tells("joint arm at 2 0 0 parent root\n", "is already a bone (line 3)");
    tells("fixed arm all\n", "arm: is already a bone");
    tells("joint other at 2 0 0\n", "is a second root; the first one is root");
    tells("joint hand at 2 0 0 parent leg\n", "leg: is no joint that was told of before");
    tells("joint hand at 1 0 0 parent arm\n", "the bone from arm to it has no length");
    tells("joint hand at 2 0 0 parent arm twist 20 10\n", "its least angle is 20");
    tells("joint hand at 2 0 0 parent arm hinge 0 0 0\n", "need a direction");
    tells("joint hand at 2 0 0 parent arm swing -1\n", "need >= 0");
    tells("joint hand at 2 0 0 parent arm radius 0\n", "radius: got 0");
    tells("joint hand at 2 0 0 parent arm colour 0\n", "need parent, hinge");
    tells("joint hand 2 0 0\n", "need 'at' and a place");
    tells("frame 1\njoint hand at 2 0 0 parent arm\n", "comes before the frames");
    tells("frame 1\nmove arm translate 1 0 0\n", "hangs on root: only a root");
    tells("frame 1\nmove arm rotate 0 0 1 20 about 0 0 0\n", "leave out 'about'");
    tells("frame 1\nmove arm turn 20\n", "a joint takes rotate or to");
    tells("frame 1\nmove root to 1 0 0\n", "is a root");
    tells("frame 1\nmove arm to 1 0 0 from arm\n", "arm: is no joint above arm");
    tells("frame 1\nmove arm to 1 0 0 rotate 0 0 1 5\n", "is the only operation");
    tells("frame 1\nmove arm rotate 0 0 1 5 to 1 0 0\n", "'to' must be the first");
    tells("frame 1\nrelease arm place\n", "one word too many");
    tells("skeleton a.tgf\n", "there are joints already");
    tells("units relative\n", "are in the model's units");
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, []
                 { parse_handles("a.handles", "cellwarp-handles 1\nskeleton a.fbx\n"); }),
        "need .tgf, .bvh, .gltf or .glb"));
}

TEST(HandleFile, refuses_rods_and_curves_that_cannot_be)
{
    const auto tells = [](const std::string& text, const std::string& what)
    { expect_refused("pin p indices 0\nhandle h all\n" + text, what); };
    const std::string points = "0 0 0 1 0 0 2 0 0";
    tells("rod r through 0 0 0\n", "got 1 points, need 2 to 1000");
    tells("curve r points " + points + "\n", "got 3 points, need 4 to 1000");
    tells("rod r from here\n", "need 'from skeleton'");
    tells("rod r along 0 0 0\n", "need through, points or from skeleton");
    tells("curve r from skeleton\n", "need through or points");
    tells("rod r through " + points + " radius 0\n", "radius: got 0, need");
    tells("rod r through " + points + " spans 65\n", "spans: got 65, need 1 to 64");
    tells("rod r through " + points + " thick\n",
          "need closed, spans, radius, stiffness or exact");
    tells("curve r through " + points + " radius 1\n", "need closed or spans");
    tells("rod r through 0 0 0 1 0 0 closed\n", "a closed one needs 3 points");
    tells("rod r through 0 0 0 0 0 0\n", "point 1: is where the one before is");
    const std::string rod =
        "rod r through " + points + "\ncurve c through " + points + "\n";
    tells(rod + "rod r through " + points + "\n", "r: is already told of (line 4)");
    tells(rod + "on p c by 0.5\n", "need 'at' and a share of the length");
    tells(rod + "on p c at 2\n", "at: got 2, need 0 to 1");
    tells(rod + "on h c\n", "h: is a handle region, only a pin");
    tells(rod + "on p h\n", "h: is no curve or rod");
    tells(rod + "on p c\non p r\n", "p: is already on a curve (line 6)");
    tells(rod + "frame 1\non p c\n", "on: comes before the frames");
    const std::string moved = rod + "frame 1\n";
    tells(moved + "move r point 1 tangent 0 0 0\n",
          "tangent: got 0 0 0, need a direction");
    tells(moved + "move r point 1 rotate 0 0 1 20\n",
          "takes translate, to, turn or tangent");
    tells(moved + "move c point 1 turn 20\n", "a curve has no twist");
    tells(moved + "move r turn 20\n", "are for points of a rod");
    tells(moved + "move h point 1 translate 1 0 0\n", "h: has no points");
    tells(moved + "move r point 3 translate 1 0 0\n", "point: got 3, need 0 to 2");
    tells(moved + "release r point 1 colour\n", "need place, tangent or twist");
    tells(moved + "release r\n", "only a joint, or a point, start or end of a rod");
    tells(moved + "release h twist\n", "only a joint, or a point, start or end of a rod");
    tells(moved + "release r twist\nrelease r tangent\n", "r: is released twice");
    tells(moved + "move h translate 1 0 0 from r\n",
          "from: comes after the 'to' of a joint");
    tells("rod r through " + points +
              " 0 1 0 closed\nframe 1\nmove r end translate 1 0 0\n",
          "is closed: it has no end");
}

TEST(HandleFile, refuses_skeletons_that_are_placed_in_no_way)
{
    expect_refused("skeleton a.tgf scale 0\n", "scale: got 0, need");
    expect_refused("skeleton a.tgf up w\n", "up: got 'w', need x, y or z");
    expect_refused("skeleton a.tgf colour\n", "need root, scale, up or translate");
    expect_refused("units relative\nskeleton a.tgf\n", "leave out 'units relative'");
    expect_refused("joint \"\" at 0 0 0\n", "joint name");
    std::string chain = "joint j0 at 0 0 0\n";
    for (int k = 1; k <= 10000; ++k)
        chain += "joint j" + std::to_string(k) + " at " + std::to_string(k) +
                 " 0 0 parent j" + std::to_string(k - 1) + "\n";
    expect_refused(chain, "joint: more than 10000 joints");
}

TEST(HandleFile, reads_the_survey_pair)
{
    const support::Folder folder;
    const std::string sel = folder.write("a.sel", "0\n1\n2\n");
    const HandleFile file = read_survey_pair(
        sel, folder.write("a.def", "1 0 0 0.5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"));
    ASSERT_EQ(file.stages.size(), 1u);
    EXPECT_EQ(file.stages[0].regions[1].selector.label, 2);
    EXPECT_EQ((*file.stages[0].frames[0].moves[0].operations[0].matrix)(0, 3), 0.5);
}

TEST(HandleFile, tells_which_file_of_the_survey_pair_is_wrong)
{
    const support::Folder folder;
    const auto refused = [&](const std::string& sel, const std::string& def)
    {
        return error_of(Fault::Malformed,
                        [&] {
                            read_survey_pair(folder.write("a.sel", sel),
                                             folder.write("a.def", def));
                        });
    };
    const std::string one = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
    EXPECT_TRUE(
        contains(refused("2\n", "1 0 0 0\n"), "a.def: matrix: got 4 numbers, need 16"));
    EXPECT_TRUE(contains(refused("2\n", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 2\n"),
                         "a.def: matrix: its last row is not 0 0 0 1"));
    EXPECT_TRUE(contains(refused("2\n3\n", one), "a.sel: label 1: got 3, need 0"));
    EXPECT_TRUE(contains(refused("2\n-1\n", one), "a.sel: label 1: got -1, need 0"));
    EXPECT_TRUE(contains(refused("0\n1\n", one), "a.sel: no label is 2 (handle)"));
}

} // namespace cellwarp::core
