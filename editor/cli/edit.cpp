// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp edit: becomes the editor, a program of its own beside this one, so that the
// command line needs no window library.
#include <cerrno>
#include <cstring>
#include <memory>

#include <unistd.h>

#include <CLI/CLI.hpp>

#include "editor/cli/command.h"
#include "io/base/error.h"
#include "octree/base/helper.h"

namespace cellwarp::core
{

namespace
{

/// Comes back only by an error.
[[noreturn]] void run(const std::vector<std::string>& file, const CommonFlags& common)
{
    if (common.is_json)
        throw Error(Fault::Usage, "edit prints nothing: it takes no --json");
    std::vector<std::string> words = {program_folder() + "/cellwarp-editor"};
    const std::string& program = words[0];
    if (::access(program.c_str(), F_OK) != 0)
        throw Error(Fault::Usage, "this build has no editor: " + program +
                                      " is missing (CMake option CELLWARP_WINDOW)");
    if (common.threads > 0)
        words.insert(words.end(), {"--threads", std::to_string(common.threads)});
    if (!file.empty() && file[0].starts_with('-'))
        words.emplace_back("--");
    words.insert(words.end(), file.begin(), file.end());
    std::vector<char*> argv;
    for (std::string& word : words)
        argv.push_back(word.data());
    argv.push_back(nullptr);
    ::execv(argv[0], argv.data());
    throw Error(Fault::File, at({words[0], 0, ""},
                                std::string("cannot start: ") + std::strerror(errno)));
}

} // namespace

void add_edit(CLI::App& app, CommonFlags& common)
{
    // A list of at most one: a name that is given is told from an empty one.
    const auto file = std::make_shared<std::vector<std::string>>();
    CLI::App* command = app.add_subcommand(
        "edit", "Starts the editor: grab a shape and bend it by hand.\n\n"
                "  cellwarp edit samples/creature.json\n"
                "  cellwarp edit scan.ply\n");
    command
        ->add_option("file", *file,
                     "model or scene (*.json) to begin with; after -- also a name that "
                     "begins with -")
        ->expected(1);
    command->callback([file, &common] { run(*file, common); });
}

} // namespace cellwarp::core
