// SPDX-License-Identifier: GPL-3.0-or-later
// What lies under a pixel, and what can be seen: rays against the shape as it is shown.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "editor/tools/camera.h"
#include "library/session/shape.h"

namespace cellwarp::core
{

/// Where a ray meets the shape.
struct Picked
{
    std::uint32_t sample = 0; ///< the nearest of the face that it meets
    Eigen::Vector3d point = Eigen::Vector3d::Zero(); ///< [view]
};

/// Keeps a tree over the shape's faces (a cloud: balls of about its spacing). That of a
/// large shape is made in the background, while the one before it serves.
class Picker
{
public:
    Picker(); ///< throws std::bad_alloc, std::runtime_error of any other fault
    ~Picker();
    Picker(const Picker&) = delete;
    Picker& operator=(const Picker&) = delete;

    /// Takes over a newer shape. Does nothing where it has it, or while it is still busy
    /// with an older one: call it once a frame. Throws as Picker(), as wait() does;
    /// then it is not ready until it is given a newer shape.
    void update(const ShownShape& shape);
    /// Until what it was given last is there.
    void wait();
    bool is_ready() const; ///< there is a tree, of this shape or an older one

    /// Nothing where the ray meets nothing, or while it is not ready.
    std::optional<Picked> pick(const Ray& ray) const;
    /// For each of \p samples: 1 where nothing lies between it and the viewer. All of
    /// them while it is not ready.
    std::vector<std::uint8_t> visible(std::span<const std::uint32_t> samples,
                                      const Camera& camera) const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
