// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes from a seed: any shape, any scale, any selector, role, move and flag. Most have
// a solution; all must end in a documented state.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "tests/support/files.h"

namespace cellwarp::core::support
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
/// One of few samples, with coarse voxels and few cells: a core runs dozens in a second.
RandomScene small_random_scene(std::uint32_t seed);

/// What is wrong with where the samples of \p scene have ended; empty: nothing.
std::string fault_of_samples(const RandomScene& scene,
                             const std::vector<Eigen::Vector3d>& samples);

/// How many scenes a variable of the environment asks for.
std::uint32_t number_of_scenes(const char* variable, std::uint32_t otherwise);

/// Copies the files of a scene to where they stay, and tells where.
std::string kept_copy(const Folder& folder, std::uint32_t seed);

} // namespace cellwarp::core::support
