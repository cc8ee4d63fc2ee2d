// SPDX-License-Identifier: GPL-3.0-or-later
// Plays a scene by the interface of the library: an edit by `play SCENE MODEL RESULT`, a
// scene in time by `play SCENE RESULT`, which writes its last frame.
#include <cstdio>
#include <fstream>
#include <iterator>

#include <cellwarp/cellwarp.h>

using namespace cellwarp;

namespace
{

int play_in_time(const std::string& scene, const std::string& result)
{
    Simulation simulation = Simulation::read(scene);
    bool is_converged = true;
    while (simulation.next())
        is_converged = is_converged && simulation.report().is_converged;
    if (const std::optional<Model> model = simulation.model())
        write(result, *model, simulation.deformed());
    else
        write(result, simulation.surface(12));
    return is_converged ? 0 : 7;
}

} // namespace

int main(int count, char** names)
try
{
    if (count == 3)
        return play_in_time(names[1], names[2]);
    std::ifstream file(names[1]);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    const Model model = Model::read(names[2]);
    const Result result =
        deform(model, Edit::read_scene(names[1]), Settings::parse(text));
    write(names[3], model, result.deformed);
    return result.is_converged() ? 0 : 7;
}
catch (const Error& error)
{
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.fault());
}
