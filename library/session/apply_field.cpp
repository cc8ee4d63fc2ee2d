// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/apply_field.h"

#include "octree/base/parallel.h"
#include "solver/field/turning.h"

namespace cellwarp::core
{

namespace
{

/// Jobs shorter than this are not worth a thread [place].
constexpr std::size_t kGrain = 1024;

template <class Vector, class Turned>
void turn(const AtPlaces<Vector>& some, std::span<const FieldValue> values,
          const Eigen::Matrix3d& axes, Turned&& turned)
{
    parallel_ranges(some.vectors.size(), kGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t k = begin; k < end; ++k)
                        {
                            const Eigen::Matrix3d& gradient =
                                values[some.places[k]].gradient;
                            if (!gradient.isZero(0))
                                some.vectors[k] =
                                    turned(Eigen::Matrix3d::Identity() +
                                               axes.transpose() * gradient * axes,
                                           some.vectors[k]);
                        }
                    });
}

/// \p displacement(i) of place i [work].
template <class Displacement>
void shift(const WorkFrame& frame, std::span<Eigen::Vector3d> places,
           const Displacement& displacement)
{
    parallel_ranges(places.size(), kGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                            places[i] += frame.vector_to_model(displacement(i));
                    });
}

} // namespace

void carry(const WorkFrame& frame, std::span<const FieldValue> values,
           const Carried& carried)
{
    shift(frame, carried.places,
          [&](std::size_t i) -> const Eigen::Vector3d&
          { return values[i].displacement; });
    turn(carried.normals, values, frame.axes, turned_normal);
    turn(carried.tangents, values, frame.axes, turned_tangent);
    turn(carried.rotations, values, frame.axes, turned_rotation);
}

std::vector<Eigen::Vector3d> apply_field(const Field& field, const WorkFrame& frame,
                                         std::span<const Eigen::Vector3d> work,
                                         std::span<const int> own, const Carried& carried)
{
    std::vector<Eigen::Vector3d> displacements;
    if (carried.has_directions())
    {
        const std::vector<FieldValue> values = field.values(work, own);
        for (const FieldValue& value : values)
            displacements.push_back(value.displacement);
        carry(frame, values, carried);
    }
    else
    {
        displacements = field.displacements(work, own);
        shift(frame, carried.places,
              [&](std::size_t i) -> const Eigen::Vector3d& { return displacements[i]; });
    }
    return displacements;
}

std::vector<Eigen::Vector3d> moved_places(const WorkFrame& frame,
                                          std::span<const Eigen::Vector3d> rest,
                                          std::vector<Eigen::Vector3d> displacements)
{
    parallel_for(displacements.size(), kGrain,
                 [&](std::size_t i) {
                     displacements[i] = rest[i] + frame.vector_to_model(displacements[i]);
                 });
    return displacements;
}

} // namespace cellwarp::core
