// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/interface.h"

#include <map>

namespace cellwarp::support
{

Bar::Bar(int across)
{
    const std::array<int, 3> counts = {across, across, 5 * across};
    std::map<std::array<int, 3>, std::uint32_t> numbers;
    const auto sample_at = [&](const std::array<int, 3>& at)
    {
        const auto [found, is_new] =
            numbers.try_emplace(at, static_cast<std::uint32_t>(samples.size()));
        if (is_new)
            samples.push_back(
                {double(at[0]) / across, double(at[1]) / across, double(at[2]) / across});
        return found->second;
    };
    for (std::size_t axis = 0; axis < 3; ++axis)
        for (const bool is_upper : {false, true})
        {
            const std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
            for (int i = 0; i < counts[u]; ++i)
                for (int j = 0; j < counts[v]; ++j)
                {
                    std::array<std::uint32_t, 4> face{};
                    for (std::size_t k = 0; k < 4; ++k)
                    {
                        std::array<int, 3> at{};
                        at[axis] = is_upper ? counts[axis] : 0;
                        at[u] = i + (k == 1 || k == 2);
                        at[v] = j + (k >= 2);
                        face[is_upper ? k : 3 - k] = sample_at(at);
                    }
                    faces.push_back(face);
                }
        }
}

Edit bend(double degrees)
{
    Edit edit;
    edit.use_relative_units()
        .fixed("foot", Selector::box({0, 0, 0}, {1, 1, 0.1}))
        .handle("head", Selector::box({0, 0, 0.9}, {1, 1, 1}))
        .frame(1)
        .move("head", {rotate_about_border({1, 0, 0}, degrees)});
    return edit;
}

Settings coarse()
{
    Settings settings;
    settings.cells.across = 8;
    settings.cells.max_depth = 0;
    return settings;
}

} // namespace cellwarp::support
