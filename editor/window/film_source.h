// SPDX-License-Identifier: GPL-3.0-or-later
// Sources of the frames of a film: each kind of scene has a file of its own.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"
#include "library/session/shape.h"

namespace cellwarp::core
{

class Simulation;

/// What is filmed.
struct FilmScene
{
    std::shared_ptr<const GeometryFile> model;
    HandleFile handles;
    SceneFile scene;
};

/// Stands at frame 0.
class FilmSource
{
public:
    virtual ~FilmSource() = default;
    virtual std::int64_t last() const = 0;
    virtual double seconds_a_frame() const = 0;
    /// Goes on by one; why it did not converge, or nothing. Throws Error.
    virtual std::string next() = 0;
    virtual DeformedSamples deformed() = 0; ///< the model now [model unit]
    virtual std::vector<ShownLine> lines(const WorkFrame& view) const = 0;
};

std::unique_ptr<FilmSource> film_of_rods(const FilmScene& scene);

/// Rods as they are now; \p unit: of the model [m].
std::vector<ShownLine> shown_rods(const Simulation& simulation, double unit,
                                  const WorkFrame& view);

std::unique_ptr<FilmSource> film_of_flesh(const FilmScene& scene);

/// Flesh with rods, bodies and nets.
std::unique_ptr<FilmSource> film_of_joined(const FilmScene& scene);

} // namespace cellwarp::core
