// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled once for each instruction set, into the namespace CELLWARP_LANES_FOR; see
// blend_lanes.cpp for what it must not use.
#include "solver/field/influence_kernel.h"

#include "octree/base/lanes.h"

namespace cellwarp::core::CELLWARP_LANES_FOR
{

namespace
{

/// What is within the box stays itself to the bit, as nearest_in_box() has it.
inline void clamp_to_box(const PlaceWeights& p, std::size_t row)
{
    const CellBox& box = p.boxes[p.own];
    const double half = (0.5 + p.slack) * box.edge;
    const Lanes zero{}, high = zero + half, low = zero - half;
    for (std::size_t l = row; l < row + kPlaceLanes; l += CELLWARP_WIDTH)
    {
        const Lanes x = load(p.places + l);
        const Lanes from_centre = x - box.centre[row / kPlaceLanes];
        const Lanes raised = larger(from_centre, low);
        const Lanes clamped = raised < high ? raised : high;
        const Lanes moved = box.centre[row / kPlaceLanes] + clamped;
        const Lanes inside = clamped == from_centre ? x : moved;
        store(p.inside + l, inside);
        store(p.is_within + l, inside == x ? zero + 1.0 : zero);
    }
}

template <bool wants_slopes>
void find_weights(const PlaceWeights& p)
{
    constexpr std::size_t n = kPlaceLanes;
    for (std::size_t row = 0; row < 3 * n; row += n)
        clamp_to_box(p, row);
    const Lanes zero{};
    for (std::size_t l = 0; l < n; l += CELLWARP_WIDTH)
    {
        const Lanes x = load(p.inside + l), y = load(p.inside + n + l),
                    z = load(p.inside + 2 * n + l);
        Lanes sum{}, sums[3] = {};
        for (std::size_t i = 0; i < p.num_boxes; ++i)
        {
            const CellBox& box = p.boxes[i];
            const Lanes arm[3] = {x - box.centre[0], y - box.centre[1],
                                  z - box.centre[2]};
            const Lanes distance =
                square_root(arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2]);
            const Lanes rest = larger(1.0 - distance / box.edge, zero);
            const Lanes weight = rest * rest;
            store(p.rests + i * n + l, rest);
            store(p.weights + i * p.stride + l, weight);
            sum += weight;
            if (!wants_slopes)
                continue;
            const Lanes quotient =
                -2.0 * rest / (box.edge * larger(distance, zero + 1e-300));
            const Lanes gain = distance > zero ? quotient : zero;
            for (std::size_t k = 0; k < 3; ++k)
            {
                const Lanes slope = gain * arm[k] * load(p.is_within + k * n + l);
                store(p.slopes + i * p.stride + k * n + l, slope);
                sums[k] += slope;
            }
        }
        for (std::size_t i = 0; i < p.num_boxes; ++i)
        {
            double* const at = p.weights + i * p.stride + l;
            const Lanes weight = load(at) / sum;
            store(at, weight);
            for (std::size_t k = 0; k < 3 && wants_slopes; ++k)
            {
                double* const slope = p.slopes + i * p.stride + k * n + l;
                store(slope, (load(slope) - weight * sums[k]) / sum);
            }
        }
    }
}

void weights(const PlaceWeights& p)
{
    p.slopes ? find_weights<true>(p) : find_weights<false>(p);
}

template <bool wants_slopes>
void sum_maps(const PlaceBlend& p)
{
    constexpr std::size_t n = kPlaceLanes;
    for (std::size_t l = 0; l < n; l += CELLWARP_WIDTH)
    {
        const Lanes x = load(p.places + l), y = load(p.places + n + l),
                    z = load(p.places + 2 * n + l);
        Lanes sums[3] = {}, along[9] = {};
        for (std::size_t i = 0; i < p.num_cells; ++i)
        {
            const CellMap& map = p.maps[p.cells[i * p.cell_stride]];
            const double* const A = map.turn;
            const Lanes weight = load(p.weights + i * p.stride + l);
            const Lanes arm[3] = {x - map.centre[0], y - map.centre[1],
                                  z - map.centre[2]};
            Lanes slopes[3] = {};
            for (std::size_t axis = 0; axis < 3 && wants_slopes; ++axis)
                slopes[axis] = load(p.slopes + i * p.stride + axis * n + l);
            for (std::size_t k = 0; k < 3; ++k)
            {
                const Lanes moved = A[3 * k] * arm[0] + A[3 * k + 1] * arm[1] +
                                    A[3 * k + 2] * arm[2] + map.shift[k];
                sums[k] += weight * moved;
                for (std::size_t axis = 0; axis < 3 && wants_slopes; ++axis)
                    along[3 * axis + k] +=
                        weight * A[3 * k + axis] + moved * slopes[axis];
            }
        }
        for (std::size_t k = 0; k < 3; ++k)
            store(p.displacement + k * n + l, sums[k]);
        for (std::size_t k = 0; k < 9 && wants_slopes; ++k)
            store(p.along + k * n + l, along[k]);
    }
}

void blend(const PlaceBlend& p)
{
    p.slopes ? sum_maps<true>(p) : sum_maps<false>(p);
}

double squares(const NodeSquares& p)
{
    const double *x = p.nodes, *y = x + p.stride, *z = y + p.stride;
    Lanes least = Lanes{} + __builtin_inf();
    for (std::size_t i = 0; i < p.num_nodes; i += CELLWARP_WIDTH)
    {
        const Lanes dx = load(x + i) - p.place[0], dy = load(y + i) - p.place[1],
                    dz = load(z + i) - p.place[2];
        // The tree's sums, in its order.
        const Lanes squared = dx * dx + dy * dy + dz * dz;
        store(p.squares + i, squared);
        least = squared < least ? squared : least;
    }
    double result = least[0];
    for (int l = 1; l < CELLWARP_WIDTH; ++l)
        result = least[l] < result ? least[l] : result;
    return result;
}

void ranks(const double* numbers, std::size_t count, std::int64_t* out)
{
    using Counts = std::int64_t __attribute__((vector_size(sizeof(Lanes))));
    for (std::size_t i = 0; i < count; i += CELLWARP_WIDTH)
    {
        const Lanes own = load(numbers + i);
        Counts less = {};
        for (std::size_t k = 0; k < count; ++k)
            less -= (Lanes{} + numbers[k]) < own; // -1 where it is
        __builtin_memcpy(out + i, &less, sizeof less);
    }
}

} // namespace

InfluenceKernels influence_kernels();

InfluenceKernels influence_kernels()
{
    return {weights, blend, squares, ranks};
}

} // namespace cellwarp::core::CELLWARP_LANES_FOR
