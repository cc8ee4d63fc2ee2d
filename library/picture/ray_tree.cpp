// SPDX-License-Identifier: GPL-3.0-or-later
// Embree answers null or notes an error where memory ends; here that is an exception.
//
// Embree 3 and 4 differ in the header's name and in how a ray is traced: version 3 is
// given a context, version 4 optional arguments. Version 4 looks at masks of rays and
// geometries; those of new geometries are 1, and a ray's here has every bit. The code for
// version 4 is written by its documentation, and untested.
#include "library/picture/ray_tree.h"

#include <cmath>
#include <new>
#include <stdexcept>
#include <string>
#include <utility>

#if __has_include(<embree3/rtcore.h>)
#include <embree3/rtcore.h>
#else
#include <embree4/rtcore.h>
#endif

namespace cellwarp::core
{

namespace
{

/// What holds one of Embree's objects and lets go of it.
template <class Object, void (*release)(Object*)>
struct Release
{
    void operator()(Object* object) const { release(object); }
};
using DeviceHold = std::unique_ptr<RTCDeviceTy, Release<RTCDeviceTy, rtcReleaseDevice>>;
using SceneHold = std::unique_ptr<RTCSceneTy, Release<RTCSceneTy, rtcReleaseScene>>;
using GeometryHold =
    std::unique_ptr<RTCGeometryTy, Release<RTCGeometryTy, rtcReleaseGeometry>>;

/// Looks at what was \p made and at the errors noted since. Throws std::bad_alloc; of
/// other errors std::runtime_error. An unknown error is one that could not be noted, as
/// that takes memory too.
void check(RTCDevice device, const void* made)
{
    const RTCError error = rtcGetDeviceError(device);
    if (error == RTC_ERROR_OUT_OF_MEMORY || error == RTC_ERROR_UNKNOWN ||
        (error == RTC_ERROR_NONE && !made))
        throw std::bad_alloc();
    if (error != RTC_ERROR_NONE)
        throw std::runtime_error("Embree ended with " + std::to_string(error));
}

RTCRay ray_of(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction)
{
    RTCRay ray{};
    ray.org_x = origin.x();
    ray.org_y = origin.y();
    ray.org_z = origin.z();
    ray.dir_x = direction.x();
    ray.dir_y = direction.y();
    ray.dir_z = direction.z();
    ray.tfar = INFINITY;
    ray.mask = ~0u;
    return ray;
}

#if RTC_VERSION_MAJOR >= 4
void intersect(RTCScene scene, RTCRayHit& met)
{
    rtcIntersect1(scene, &met);
}

void occlude(RTCScene scene, RTCRay& ray)
{
    rtcOccluded1(scene, &ray);
}
#else
void intersect(RTCScene scene, RTCRayHit& met)
{
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcIntersect1(scene, &context, &met);
}

void occlude(RTCScene scene, RTCRay& ray)
{
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, &ray);
}
#endif

} // namespace

struct RayDevice::State
{
    DeviceHold device;
};

RayDevice::RayDevice() : state_(std::make_unique<State>())
{
    // Embree keeps something for each of its threads, and a thread that has met the end
    // of memory hangs in its next tree: only the caller's own thread is used.
    state_->device.reset(rtcNewDevice("threads=1"));
    check(state_->device.get(), state_->device.get());
}

RayDevice::~RayDevice() = default;

struct RayTree::State
{
    RTCDevice device;
    SceneHold scene;
    RTCBuildQuality quality = RTC_BUILD_QUALITY_MEDIUM;
    unsigned num_bodies = 0;

    /// A body of so many points of \p each numbers, and what its numbers are written to.
    std::pair<GeometryHold, float*> new_body(RTCGeometryType type, RTCFormat format,
                                             std::size_t each,
                                             std::size_t num_points) const
    {
        GeometryHold body(rtcNewGeometry(device, type));
        check(device, body.get());
        rtcSetGeometryBuildQuality(body.get(), quality);
        void* const points =
            rtcSetNewGeometryBuffer(body.get(), RTC_BUFFER_TYPE_VERTEX, 0, format,
                                    each * sizeof(float), num_points);
        check(device, points);
        return {std::move(body), static_cast<float*>(points)};
    }

    float* add_faces(RTCGeometryType type, RTCFormat format, std::size_t num_corners,
                     std::size_t num_points, std::span<const std::uint32_t> corners)
    {
        const auto [body, points] = new_body(type, RTC_FORMAT_FLOAT3, 3, num_points);
        rtcSetSharedGeometryBuffer(body.get(), RTC_BUFFER_TYPE_INDEX, 0, format,
                                   corners.data(), 0, num_corners * sizeof(std::uint32_t),
                                   corners.size() / num_corners);
        attach(body);
        return points;
    }

    void attach(const GeometryHold& body)
    {
        rtcAttachGeometry(scene.get(), body.get());
        check(device, body.get());
        ++num_bodies;
    }
};

RayTree::RayTree(const RayDevice& device, Making making)
    : state_(std::make_unique<State>())
{
    state_->device = device.state_->device.get();
    state_->scene.reset(rtcNewScene(state_->device));
    check(state_->device, state_->scene.get());
    if (making == Making::Quick)
    {
        state_->quality = RTC_BUILD_QUALITY_LOW;
        // Compact, for there are two of them while a shape changes; rays are few.
        rtcSetSceneFlags(
            state_->scene.get(),
            static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_COMPACT));
    }
    rtcSetSceneBuildQuality(state_->scene.get(), state_->quality);
}

RayTree::~RayTree() = default;

float* RayTree::add_triangles(std::size_t num_points,
                              std::span<const std::uint32_t> corners)
{
    return state_->add_faces(RTC_GEOMETRY_TYPE_TRIANGLE, RTC_FORMAT_UINT3, 3, num_points,
                             corners);
}

float* RayTree::add_quadrilaterals(std::size_t num_points,
                                   std::span<const std::uint32_t> corners)
{
    return state_->add_faces(RTC_GEOMETRY_TYPE_QUAD, RTC_FORMAT_UINT4, 4, num_points,
                             corners);
}

float* RayTree::add_balls(std::size_t num_balls)
{
    const auto [body, balls] =
        state_->new_body(RTC_GEOMETRY_TYPE_SPHERE_POINT, RTC_FORMAT_FLOAT4, 4, num_balls);
    state_->attach(body);
    return balls;
}

void RayTree::commit()
{
    const RTCScene scene = state_->scene.get();
    for (unsigned body = 0; body < state_->num_bodies; ++body)
        rtcCommitGeometry(rtcGetGeometry(scene, body));
    check(state_->device, scene);
    rtcCommitScene(scene);
    check(state_->device, scene);
}

std::optional<RayHit> RayTree::first_hit(const Eigen::Vector3f& origin,
                                         const Eigen::Vector3f& direction) const
{
    RTCRayHit met{};
    met.ray = ray_of(origin, direction);
    met.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    intersect(state_->scene.get(), met);
    if (met.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return std::nullopt;
    return RayHit{met.hit.geomID, met.hit.primID,
                  met.ray.tfar,   met.hit.u,
                  met.hit.v,      {met.hit.Ng_x, met.hit.Ng_y, met.hit.Ng_z}};
}

bool RayTree::is_blocked(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                         float near, float far) const
{
    RTCRay ray = ray_of(origin, direction);
    ray.tnear = near;
    ray.tfar = far;
    occlude(state_->scene.get(), ray);
    return ray.tfar < 0;
}

} // namespace cellwarp::core
