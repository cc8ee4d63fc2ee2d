// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes from a seed: any shape, any scale, any selector, role, move and flag. Most have
// a solution; all must end in a documented state.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::support
{

struct RandomScene
{
    /// Where a sample must end, because a region that prescribes holds it.
    struct Target
    {
        std::size_t sample;
        Eigen::Vector3d place; ///< [model unit]
    };

    std::string model_name, model_text; ///< OBJ or XYZ
    std::string handles_text;
    std::vector<std::string> arguments;    ///< besides the files
    std::vector<Eigen::Vector3d> samples;  ///< at rest
    std::vector<std::vector<Target>> ends; ///< in the last frame, of each region
    double diagonal = 0.0;                 ///< of the samples' box [model unit]
    double travel = 0.0;                   ///< farthest of the targets [diagonal]
    bool is_limited = false; ///< in iterations or time: it need not converge

    /// For messages: how it can be seen again.
    std::string describe() const;
};

RandomScene random_scene(std::uint32_t seed);
/// One with coarse voxels and few cells, so that a core runs dozens in a second.
RandomScene small_random_scene(std::uint32_t seed);

} // namespace cellwarp::support
