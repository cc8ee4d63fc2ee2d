// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp edit with a copy of the program, so that a stand-in can be its editor.
#include <filesystem>

#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::Result;
using support::run_program;

namespace
{

namespace fs = std::filesystem;

struct Programs
{
    support::Folder folder;
    std::string program = folder / "cellwarp";

    Programs() { fs::copy_file(CELLWARP_BINARY, program); }
    /// An editor that says its arguments and ends with 7.
    void add_editor() const
    {
        fs::permissions(
            folder.write("cellwarp-editor", "#!/bin/sh\nprintf '<%s>' \"$@\"\nexit 7\n"),
            fs::perms::owner_all);
    }
    Result edit(std::vector<std::string> arguments) const
    {
        arguments.insert(arguments.begin(), "edit");
        return run_program(program, arguments);
    }
};

} // namespace

TEST(Edit, becomes_the_editor_beside_the_program)
{
    const Programs programs;
    programs.add_editor();
    const Result bare = programs.edit({});
    EXPECT_EQ(bare.code, 7);
    EXPECT_EQ(bare.out, "<>"); // printf's way with nothing
    for (const std::string name :
         {"bar.json", "a b.obj", "[a,b].obj", "{x}", "a=b", "deform", "new\nline", "\xff",
          "\"q\"", "'q'", "$HOME", "", "../x", "/x"})
    {
        const Result result = programs.edit({name});
        EXPECT_EQ(result.code, 7) << name << result.err;
        EXPECT_EQ(result.out, "<" + name + ">");
    }
    EXPECT_EQ(programs.edit({"bar.json", "--threads", "3"}).out,
              "<--threads><3><bar.json>");
    // Through a link it is still the editor of the program itself.
    const support::Folder elsewhere;
    fs::create_symlink(programs.program, elsewhere / "cw");
    EXPECT_EQ(run_program(elsewhere / "cw", {"edit", "x"}).out, "<x>");
}

TEST(Edit, passes_on_names_that_look_like_options)
{
    const Programs programs;
    programs.add_editor();
    for (const std::string name : {"-x.obj", "--help", "--threads", "-", "--"})
    {
        const Result result = programs.edit({"--", name});
        EXPECT_EQ(result.code, 7) << result.err;
        EXPECT_EQ(result.out, "<--><" + name + ">");
    }
}

TEST(Edit, without_an_editor_it_is_a_usage_error)
{
    const Programs programs;
    const Result result = programs.edit({"bar.json"});
    EXPECT_EQ(result.code, 2);
    EXPECT_EQ(result.out, "");
    EXPECT_TRUE(contains(result.err, "error: this build has no editor: "));
    EXPECT_TRUE(contains(result.err, "/cellwarp-editor is missing (CMake option "
                                     "CELLWARP_WINDOW)"));
}

TEST(Edit, an_editor_that_cannot_be_started_is_a_file_error)
{
    const Programs programs;
    programs.folder.write("cellwarp-editor", "");
    const Result result = programs.edit({});
    EXPECT_EQ(result.code, 4);
    EXPECT_TRUE(contains(result.err, "cellwarp-editor: cannot start: "));
}

TEST(Edit, takes_one_file_and_explains_itself)
{
    const Programs programs;
    programs.add_editor();
    EXPECT_EQ(programs.edit({"a", "b"}).code, 2);
    EXPECT_EQ(programs.edit({"--frobnicate"}).code, 2);
    EXPECT_EQ(programs.edit({"a", "--json"}).code, 2);
    const Result help = programs.edit({"--help"});
    EXPECT_EQ(help.code, 0);
    const std::size_t usage = help.out.find("Usage:");
    EXPECT_LT(help.out.find("  cellwarp edit samples/creature.json\n"), usage);
    EXPECT_LT(help.out.find("  cellwarp edit scan.ply\n"), usage);
}

} // namespace cellwarp::core
