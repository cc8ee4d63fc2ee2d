// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/program.h"

#include "octree/wrap/skeleton.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

Result run(const std::vector<std::string>& arguments, const InChild& in_child)
{
    return run_program(CELLWARP_BINARY, arguments, in_child);
}

bool can_run(const std::string& command)
{
    return run({"help", command}).code == 0 &&
           (command != "skeleton" || has_curve_skeleton());
}

pid_t start(const std::vector<std::string>& arguments)
{
    return start_program(CELLWARP_BINARY, arguments);
}

BarFiles::BarFiles()
{
    model =
        folder.write("bar.obj", obj_text(box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 4)));
    handles = folder.write("bar.handles",
                           "cellwarp-handles 1\nfixed foot box -1 -1 -1 1 1 0.3\n"
                           "handle head box -1 -1 3.7 1 1 5\n"
                           "frame 1\nmove head rotate 0 0 1 30\n"
                           "frame 12\nmove head rotate 0 0 1 60\n");
    out = folder / "out.obj";
}

std::vector<std::string> BarFiles::deform_arguments(const std::vector<std::string>& more,
                                                    const std::string& across) const
{
    std::vector<std::string> arguments = {"deform", model, "--handles", handles,
                                          "-o",     out,   "--across",  across};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
}

} // namespace cellwarp::core::support
