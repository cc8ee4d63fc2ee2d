// SPDX-License-Identifier: GPL-3.0-or-later
// Other data in the space of a model: `cloud MODEL POINTS RESULT` bends a model and takes
// a cloud of points along, 10,000 at a time. docs/library.md explains it.
#include <algorithm>
#include <cstdio>

#include <cellwarp/cellwarp.h>

using namespace cellwarp;

int main(int count, char** names)
try
{
    if (count != 4)
        throw Error(Fault::Usage, "usage: cloud MODEL POINTS RESULT");
    Edit edit;
    edit.use_relative_units()
        .fixed("foot", Selector::box({0, 0, 0}, {1, 1, 0.1}))
        .handle("head", Selector::box({0, 0, 0.9}, {1, 1, 1}))
        .frame(1)
        .move("head", {rotate_about_border({1, 0, 0}, 45)});
    Session session(Model::read(names[1]), edit);
    session.next();
    const Field field = session.field();

    const Model points = Model::read(names[2]);
    std::FILE* const file = std::fopen(names[3], "w");
    if (!file)
        throw Error(Fault::File, "cannot be written", {names[3]});
    constexpr std::size_t at_once = 30000; // numbers
    for (std::span<const double> left = points.samples(); !left.empty();)
    {
        const std::size_t size = std::min(at_once, left.size());
        std::vector<double> chunk(left.begin(), left.begin() + std::ptrdiff_t(size));
        left = left.subspan(size);
        field.apply(chunk); // in place; where the arrays are cut changes no bit
        for (std::size_t i = 0; i < size; i += 3)
            std::fprintf(file, "%.17g %.17g %.17g\n", chunk[i], chunk[i + 1],
                         chunk[i + 2]);
    }
    if (std::fclose(file) != 0)
        throw Error(Fault::File, "cannot be written", {names[3]});
    return 0;
}
catch (const Error& error)
{
    std::fprintf(stderr, "%s\n", error.what());
    return static_cast<int>(error.fault());
}
