// SPDX-License-Identifier: GPL-3.0-or-later
// An edit from another program: `bend MODEL RESULT` turns the upper end of a model over,
// its lower end held. docs/library.md explains it.
#include <cstdio>

#include <cellwarp/cellwarp.h>

using namespace cellwarp;

int main(int count, char** names)
try
{
    if (count != 3)
        throw Error(Fault::Usage, "usage: bend MODEL RESULT");
    const Model model = Model::read(names[1]);
    Edit edit;
    edit.use_relative_units()
        .fixed("foot", Selector::box({0, 0, 0}, {1, 1, 0.1}))
        .handle("head", Selector::box({0, 0, 0.9}, {1, 1, 1}))
        .frame(1)
        .move("head", {rotate_about_border({1, 0, 0}, 45)});
    const Result result = deform(model, edit);
    for (const std::string& warning : result.warnings)
        std::fprintf(stderr, "%s\n", warning.c_str());
    write(names[2], model, result.deformed, Overwrite::Yes);
    return result.is_converged() ? 0 : 7;
}
catch (const Error& error)
{
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.fault());
}
