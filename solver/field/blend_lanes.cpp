// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled once for each instruction set, into the namespace CELLWARP_LANES_FOR. It uses
// no template or inline function of others: the linker keeps one copy of those, which
// could be one that not every processor understands.
//
// The weights of a sample sum to 1, so that of the first cell is not needed: with D_i the
// map of cell i less that of the first, d = D_0 + sum w_i D_i. Cells that move as one
// have D_i = 0 and are followed exactly.
//
// Of a normal n = t1 x t2 the tangents are turned: J t1 x J t2 is the cofactor matrix of
// J times n, and two directions need less of the weights' slopes than three.
#include "solver/field/blend_kernel.h"

#if defined(__AVX512F__)
#define CELLWARP_WIDTH 16
#elif defined(__AVX2__)
#define CELLWARP_WIDTH 8
#else
#define CELLWARP_WIDTH 4
#endif

namespace cellwarp::core::CELLWARP_LANES_FOR
{

namespace
{

using Lanes = float __attribute__((vector_size(4 * CELLWARP_WIDTH)));

template <class Value>
inline Value load(const float* numbers)
{
    Value value;
    __builtin_memcpy(&value, numbers, sizeof value);
    return value;
}

template <class Value>
inline void store(float* numbers, const Value& value)
{
    __builtin_memcpy(numbers, &value, sizeof value);
}

inline Lanes load(const Row& row, std::size_t part)
{
    return load<Lanes>(row.lane + part);
}

inline void store(Row& row, std::size_t part, const Lanes& value)
{
    store(row.lane + part, value);
}

inline Lanes square_root(const Lanes& value)
{
    Lanes root = value;
    for (int l = 0; l < CELLWARP_WIDTH; ++l)
        root[l] = __builtin_sqrtf(root[l]);
    return root;
}

struct Vector
{
    Lanes x, y, z;
};

inline Vector cross(const Vector& a, const Vector& b)
{
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

inline Lanes dot(const Vector& a, const Vector& b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

inline Vector load_vector(const Row* rows, std::size_t part)
{
    return {load(rows[0], part), load(rows[1], part), load(rows[2], part)};
}

/// Displacement by a map with the same numbers for all lanes.
inline Vector moved(const float* map, const Vector& u)
{
    return {map[0] * u.x + map[1] * u.y + map[2] * u.z + map[9],
            map[3] * u.x + map[4] * u.y + map[5] * u.z + map[10],
            map[6] * u.x + map[7] * u.y + map[8] * u.z + map[11]};
}

/// The linear part of a map of each lane's own.
inline Vector turned(const Lanes* A, const Vector& u)
{
    return {A[0] * u.x + A[1] * u.y + A[2] * u.z, A[3] * u.x + A[4] * u.y + A[5] * u.z,
            A[6] * u.x + A[7] * u.y + A[8] * u.z};
}

inline Vector sum(const Vector& a, const Vector& b)
{
    return {a.x + b.x, a.y + b.y, a.z + b.z};
}

inline Vector from_reference(const Vector& x, const BlendRun& run)
{
    return {x.x - run.reference[0], x.y - run.reference[1], x.z - run.reference[2]};
}

/// The first \p count lanes, sample by sample.
inline void put(const Row* vectors, std::size_t count, float* out)
{
    const auto put_lane = [&](std::size_t l)
    {
        out[3 * l] = vectors[0].lane[l];
        out[3 * l + 1] = vectors[1].lane[l];
        out[3 * l + 2] = vectors[2].lane[l];
    };
    // A count known beforehand lets the compiler interleave whole vectors.
    if (count == kLanes)
        for (std::size_t l = 0; l < kLanes; ++l)
            put_lane(l);
    else
        for (std::size_t l = 0; l < count; ++l)
            put_lane(l);
}

inline void store_vector(Row* rows, std::size_t part, const Vector& value)
{
    store(rows[0], part, value.x);
    store(rows[1], part, value.y);
    store(rows[2], part, value.z);
}

inline Vector place(const BlendRun& run, const Row* rows, const Row* corrections,
                    std::size_t part)
{
    const Vector x = load_vector(rows, part), u = from_reference(x, run);
    Lanes map[kMapSize];
    for (std::size_t k = 0; k < kMapSize; ++k)
        map[k] = Lanes{} + run.maps[k];
    for (std::size_t i = 1; i < run.num_maps; ++i)
    {
        const Lanes weight = load(rows[kPlaceRows + i - 1], part);
        const float* difference = run.maps + i * kMapSize;
        for (std::size_t k = 0; k < kMapSize; ++k)
            map[k] += weight * difference[k];
    }
    Vector d = sum(turned(map, u), {map[9], map[10], map[11]});
    if (corrections)
        d = sum(d, load_vector(corrections, part));
    return sum(x, d);
}

/// The tangents t1, t2 with t1 x t2 = n, as unit_tangents() of the table.
inline void find_tangents(const Vector& n, Vector& first, Vector& second)
{
    const Lanes one = Lanes{} + 1.0f;
    const Lanes sign = n.z < 0.0f ? -one : one;
    const Lanes a = -one / (sign + n.z), b = n.x * n.y * a;
    first = {one + sign * (n.x * n.x * a), sign * b, -(sign * n.x)};
    second = {b, sign + n.y * n.y * a, -n.y};
}

inline Vector normal(const BlendRun& run, const Row* rows, const Row* corrections,
                     std::size_t part)
{
    const Vector u = from_reference(load_vector(rows, part), run);
    const Vector n = load_vector(rows + 3, part);
    Vector t1, t2;
    find_tangents(n, t1, t2);
    Lanes A[9];
    for (std::size_t k = 0; k < 9; ++k)
        A[k] = Lanes{} + run.maps[k];
    Vector slope1{}, slope2{};
    for (std::size_t i = 1; i < run.num_maps; ++i)
    {
        const Row* of_cell = rows + kNormalRows + kNormalWeightRows * (i - 1);
        const Lanes weight = load(of_cell[0], part);
        const Lanes along1 = load(of_cell[1], part), along2 = load(of_cell[2], part);
        const float* difference = run.maps + i * kMapSize;
        for (std::size_t k = 0; k < 9; ++k)
            A[k] += weight * difference[k];
        const Vector d = moved(difference, u);
        slope1 = sum(slope1, {along1 * d.x, along1 * d.y, along1 * d.z});
        slope2 = sum(slope2, {along2 * d.x, along2 * d.y, along2 * d.z});
    }
    slope1 = sum(slope1, turned(A, t1));
    slope2 = sum(slope2, turned(A, t2));
    if (corrections)
    {
        slope1 = sum(slope1, load_vector(corrections, part));
        slope2 = sum(slope2, load_vector(corrections + 3, part));
    }
    const Vector result = cross(sum(t1, slope1), sum(t2, slope2));
    const Lanes squared = dot(result, result);
    // Where nothing turns, and where nothing is left of it, the normal stays: as
    // turned_normal() does.
    const Lanes change = dot(slope1, slope1) + dot(slope2, slope2);
    const Lanes is_turned = change > 0.0f ? squared : Lanes{};
    const Lanes scale = 1.0f / square_root(squared);
    return {is_turned > 0.0f ? result.x * scale : n.x,
            is_turned > 0.0f ? result.y * scale : n.y,
            is_turned > 0.0f ? result.z * scale : n.z};
}

template <auto of_part, std::size_t rows_before, std::size_t rows_a_weight,
          std::size_t correction_rows>
void run_blocks(const BlendRun& run)
{
    const Row* rows = run.rows;
    const Row* corrections = run.corrections;
    const std::size_t num_rows = rows_before + rows_a_weight * (run.num_maps - 1);
    for (std::size_t done = 0; done < run.num_samples; done += kLanes)
    {
        Row result[3];
        for (std::size_t part = 0; part < kLanes; part += CELLWARP_WIDTH)
            store_vector(result, part, of_part(run, rows, corrections, part));
        const std::size_t left = run.num_samples - done;
        put(result, left < kLanes ? left : kLanes, run.out + 3 * done);
        rows += num_rows;
        corrections += corrections ? correction_rows : 0;
    }
}

// Of corrections the lanes are the numbers of a node. More than eight at once would only
// wait for their factors.
constexpr std::size_t kNodeLanes = CELLWARP_WIDTH > 4 ? 8 : 4,
                      kNodeParts = 16 / kNodeLanes;
using NodeLanes = float __attribute__((vector_size(4 * kNodeLanes)));
using Factors = float __attribute__((vector_size(16)));

/// Each of the factors for the four numbers of its column; those of one part.
inline NodeLanes spread(const Factors& f, std::size_t part)
{
#if CELLWARP_WIDTH > 4
    return part == 0 ? __builtin_shufflevector(f, f, 0, 0, 0, 0, 1, 1, 1, 1)
                     : __builtin_shufflevector(f, f, 2, 2, 2, 2, 3, 3, 3, 3);
#else
    return NodeLanes{} + f[part];
#endif
}

/// The columns are summed apart, so that no addition waits for the last one.
void sum_corrections(const FadeRun& run)
{
    for (std::size_t i = 0; i < run.num_blocks * kLanes; ++i)
    {
        NodeLanes sums[kNodeParts] = {};
        const FadeTerm* const end = run.terms + run.first_term[i + 1];
        for (const FadeTerm* term = run.terms + run.first_term[i]; term != end; ++term)
        {
            const Factors factors = load<Factors>(term->factors);
            const float* miss = run.misses[term->node].columns;
            for (std::size_t p = 0; p < kNodeParts; ++p)
                sums[p] += spread(factors, p) * load<NodeLanes>(miss + p * kNodeLanes);
        }
        NodeMiss total;
        for (std::size_t p = 0; p < kNodeParts; ++p)
            store(total.columns + p * kNodeLanes, sums[p]);
        const float* c = total.columns;
        for (std::size_t k = 0; k < 3; ++k)
            run.out[i / kLanes * 3 + k].lane[i % kLanes] =
                (c[k] + c[4 + k]) + (c[8 + k] + c[12 + k]);
    }
}

} // namespace

BlendKernels blend_kernels();

BlendKernels blend_kernels()
{
    return {run_blocks<place, kPlaceRows, kPlaceWeightRows, kPlaceCorrectionRows>,
            run_blocks<normal, kNormalRows, kNormalWeightRows, kNormalCorrectionRows>,
            sum_corrections};
}

} // namespace cellwarp::core::CELLWARP_LANES_FOR
