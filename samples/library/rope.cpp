// SPDX-License-Identifier: GPL-3.0-or-later
// A rope in time: `rope RESULT` lets a rope that is held at one end fall for a second,
// and writes its last shape. docs/library.md explains it.
#include <cstdio>

#include <cellwarp/cellwarp.h>

using namespace cellwarp;

int main(int count, char** names)
try
{
    if (count != 2)
        throw Error(Fault::Usage, "usage: rope RESULT");
    Simulation simulation = Simulation::parse(R"({
        "cellwarp": 1,
        "rods": [{"name": "rope", "through": [[0, 2, 0], [1, 2, 0]], "spans": 12,
                  "radius": 0.01, "E": 1e6, "fixed": [{"at": 0}]}],
        "simulate": {"duration": 1, "dt": 0.005, "every": 0.05}
    })");
    while (simulation.next())
    {
        const MovingRod rope = simulation.rods(20).front();
        std::printf("%.2f s: its end is at %.3f %.3f\n", simulation.time(),
                    rope.places[57], rope.places[58]);
        if (!simulation.report().is_converged)
            return 7;
    }
    write(names[1], simulation.surface(), Overwrite::Yes);
    return 0;
}
catch (const Error& error)
{
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.fault());
}
