// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled once for each instruction set, into the namespace CELLWARP_LANES_FOR; see
// blend_lanes.cpp for what it must not use. Each lane sums every eighth centre; the lanes
// are added in their order at the end.
#include "solver/field/rbf_kernel.h"

#if defined(__AVX512F__)
#define CELLWARP_WIDTH 8
#elif defined(__AVX2__)
#define CELLWARP_WIDTH 4
#else
#define CELLWARP_WIDTH 2
#endif

namespace cellwarp::CELLWARP_LANES_FOR
{

namespace
{

using Lanes =
    double __attribute__((vector_size(8 * CELLWARP_WIDTH), aligned(8), may_alias));
constexpr std::size_t kParts = kCentreLanes / CELLWARP_WIDTH;

inline Lanes load(const double* numbers)
{
    return *reinterpret_cast<const Lanes*>(numbers);
}

inline Lanes square_root(const Lanes& value)
{
    Lanes root;
    for (int l = 0; l < CELLWARP_WIDTH; ++l)
        root[l] = __builtin_sqrt(value[l]);
    return root;
}

/// Sums of one part of the lanes; \p sums 3 or 12 of them.
template <bool wants_slopes>
inline void sum_part(const RbfRun& run, std::size_t part, Lanes* sums)
{
    const std::size_t n = run.num_padded;
    const double* const rows = run.rows + part * CELLWARP_WIDTH;
    for (std::size_t j = 0; j < n; j += kCentreLanes)
    {
        const Lanes dx = run.place[0] - load(rows + j);
        const Lanes dy = run.place[1] - load(rows + n + j);
        const Lanes dz = run.place[2] - load(rows + 2 * n + j);
        const Lanes squared = dx * dx + dy * dy + dz * dz;
        const Lanes length = square_root(squared);
        const Lanes cube = squared * length;
        const Lanes gain = 3.0 * length;
        for (std::size_t k = 0; k < 3; ++k)
        {
            const Lanes weight = load(rows + (3 + k) * n + j);
            sums[k] += cube * weight;
            if (wants_slopes)
            {
                sums[3 + k] += gain * dx * weight;
                sums[6 + k] += gain * dy * weight;
                sums[9 + k] += gain * dz * weight;
            }
        }
    }
}

template <bool wants_slopes>
void sum_centres(RbfRun& run)
{
    constexpr std::size_t kSums = wants_slopes ? 12 : 3;
    double totals[kSums] = {};
    for (std::size_t part = 0; part < kParts; ++part)
    {
        Lanes sums[kSums] = {};
        sum_part<wants_slopes>(run, part, sums);
        for (std::size_t k = 0; k < kSums; ++k)
            for (int l = 0; l < CELLWARP_WIDTH; ++l)
                totals[k] += sums[k][l];
    }
    for (std::size_t k = 0; k < 3; ++k)
        run.displacement[k] = totals[k];
    for (std::size_t k = 3; k < kSums; ++k)
        run.slopes[k - 3] = totals[k];
}

} // namespace

RbfKernels rbf_kernels();

RbfKernels rbf_kernels()
{
    return {sum_centres<false>, sum_centres<true>};
}

} // namespace cellwarp::CELLWARP_LANES_FOR
