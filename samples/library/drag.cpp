// SPDX-License-Identifier: GPL-3.0-or-later
// A handle in the hand: `drag MODEL RESULT` lifts the upper end of a model in 60 frames,
// as an editor shows them, and solves where it is let go. docs/library.md explains it.
#include <cstdio>

#include <cellwarp/cellwarp.h>

using namespace cellwarp;

int main(int count, char** names)
try
{
    if (count != 3)
        throw Error(Fault::Usage, "usage: drag MODEL RESULT");
    const Model model = Model::read(names[1]);
    Edit edit;
    edit.use_relative_units()
        .fixed("foot", Selector::box({0, 0, 0}, {1, 1, 0.1}))
        .handle("head", Selector::box({0, 0, 0.9}, {1, 1, 1}));
    Edit rest = edit;
    Session session(model, rest.frame(1));
    Drag drag(session);
    std::vector<float> shown(3 * model.num_samples()); // a vertex buffer
    double solve_ms = 0.0;
    for (int k = 1; k <= 60; ++k)
    {
        Mat4 motion = kIdentity;
        motion[2][3] = 0.3 * model.diagonal() * k / 60;
        drag.move("head", motion);
        solve_ms += drag.frame().solve_ms;
        drag.copy_samples(shown);
    }
    std::printf("60 frames, %.1f ms each\n", solve_ms / 60);

    edit.frame(1);
    for (const auto& [region, operation] : drag.moves())
        edit.move(region, {operation});
    session.set_edit(edit);
    session.next();
    write(names[2], model, session.deformed(), Overwrite::Yes);
    return session.frames().back().is_converged() ? 0 : 7;
}
catch (const Error& error)
{
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.fault());
}
