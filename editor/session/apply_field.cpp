// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/apply_field.h"

#include "octree/base/parallel.h"
#include "solver/field/turning.h"

namespace cellwarp
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

} // namespace

std::vector<Eigen::Vector3d> apply_field(const Field& field, const WorkFrame& frame,
                                         std::span<const Eigen::Vector3d> work,
                                         std::span<const int> own, const Carried& carried)
{
    std::vector<Eigen::Vector3d> displacements;
    std::vector<FieldValue> values;
    if (carried.has_directions())
    {
        values = field.values(work, own);
        for (const FieldValue& value : values)
            displacements.push_back(value.displacement);
    }
    else
        displacements = field.displacements(work, own);
    parallel_ranges(work.size(), kGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                            carried.places[i] += frame.vector_to_model(displacements[i]);
                    });
    turn(carried.normals, values, frame.axes, turned_normal);
    turn(carried.tangents, values, frame.axes, turned_tangent);
    turn(carried.rotations, values, frame.axes, turned_rotation);
    return displacements;
}

} // namespace cellwarp
