// SPDX-License-Identifier: GPL-3.0-or-later
// An edit from another program: `bend MODEL RESULT` turns the upper end of a model over,
// its lower end held. docs/library.md explains it.
#include <cstdio>
#include <memory>
#include <string>

#include "io/base/error.h"
#include "io/formats/geometry_file.h"
#include "io/formats/geometry_output.h"
#include "io/scene/handle_file.h"
#include "library/session/scene_settings.h"
#include "library/session/session.h"

using namespace cellwarp::core;

int main(int count, char** names)
try
{
    if (count != 3)
        throw Error(Fault::Usage, "usage: bend MODEL RESULT");
    const auto model = std::make_shared<const GeometryFile>(read_geometry(names[1]));
    const HandleFile handles = parse_handles("", R"(cellwarp-handles 1
units relative
fixed foot box 0 0 0  1 1 0.1
handle head box 0 0 0.9  1 1 1
frame 1
move head rotate 1 0 0 45 about border
)");
    Session session(geometry_of(model), handles, settings_of(SceneFile()));
    session.next_frame(true);
    for (const std::string& warning : session.warnings())
        std::fputs((warning + "\n").c_str(), stderr);
    write_geometry(names[2], *model, session.deformed(), Overwrite::Yes);
    return session.frames().back().solve.stop == Stop::Converged ? 0 : 7;
}
catch (const Error& error)
{
    std::fputs((std::string(error.what()) + "\n").c_str(), stderr);
    return static_cast<int>(error.fault());
}
