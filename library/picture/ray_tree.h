// SPDX-License-Identifier: GPL-3.0-or-later
// Rays against triangles, quadrilaterals and balls, in single precision (Embree).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include <Eigen/Core>

namespace cellwarp::core
{

/// Makes trees, each in the thread that asks for it. Outlives them.
class RayDevice
{
public:
    /// Throws std::bad_alloc, std::runtime_error of any other fault.
    RayDevice();
    ~RayDevice();
    RayDevice(const RayDevice&) = delete;
    RayDevice& operator=(const RayDevice&) = delete;

private:
    friend class RayTree;
    struct State;
    std::unique_ptr<State> state_;
};

/// Where a ray meets something first.
struct RayHit
{
    std::uint32_t body = 0;    ///< which of those that were added
    std::uint32_t element = 0; ///< face or ball of that body
    float distance = 0;        ///< [length of the ray's direction]
    /// Of a triangle the weights of its second and third corner, of a quadrilateral its
    /// two parameters, of a ball nothing.
    float u = 0, v = 0;
    Eigen::Vector3f normal = Eigen::Vector3f::Zero(); ///< of any length
};

/// What rays are traced against: bodies are added, then it is committed, once. Rays may
/// come from many threads at a time.
class RayTree
{
public:
    enum class Making
    {
        Quick, ///< in a quarter of the time; rays pass between no two faces
        Best   ///< for many rays
    };

    /// Throws as RayDevice() does, and so do the functions that add bodies and commit().
    RayTree(const RayDevice& device, Making making);
    ~RayTree();
    RayTree(const RayTree&) = delete;
    RayTree& operator=(const RayTree&) = delete;

    /// Bodies are numbered as they are added. Gives 3 numbers a point (x, y, z), to be
    /// written before commit() and to be read as long as the tree stands.
    /// \param corners points of the faces, three each; they outlive the tree.
    float* add_triangles(std::size_t num_points, std::span<const std::uint32_t> corners);
    /// The same with four corners a face.
    float* add_quadrilaterals(std::size_t num_points,
                              std::span<const std::uint32_t> corners);
    /// Gives 4 numbers a ball (x, y, z, radius).
    float* add_balls(std::size_t num_balls);

    void commit();

    std::optional<RayHit> first_hit(const Eigen::Vector3f& origin,
                                    const Eigen::Vector3f& direction) const;
    /// Whether anything lies between the distances \p near and \p far [length of the
    /// direction].
    bool is_blocked(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                    float near, float far) const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
