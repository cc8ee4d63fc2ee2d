// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled once for each instruction set, into the namespace CELLWARP_LANES_FOR; see
// blend_lanes.cpp for what it must not use.
//
// The factor of a matrix: every entry is a_ij - l_i0 l_j0 - l_i1 l_j1 - ..., in this
// order whatever the tiles, divided by the root of the diagonal. A dot product has eight
// partial sums, one for every eighth term, added in their order.
#include "solver/field/rbf_kernel.h"

#include "octree/base/lanes.h"

namespace cellwarp::core::CELLWARP_LANES_FOR
{

namespace
{

constexpr std::size_t kParts = kCentreLanes / CELLWARP_WIDTH;

inline Lanes cube_of_distance(const Lanes& dx, const Lanes& dy, const Lanes& dz)
{
    const Lanes squared = dx * dx + dy * dy + dz * dz;
    return squared * square_root(squared);
}

template <bool wants_slopes>
void sum_at_places(const RbfPlaces& p)
{
    constexpr std::size_t kSums = wants_slopes ? 12 : 3;
    for (std::size_t l = 0; l < kPlaceLanes; l += CELLWARP_WIDTH)
    {
        const Lanes x = load(p.places + l), y = load(p.places + kPlaceLanes + l),
                    z = load(p.places + 2 * kPlaceLanes + l);
        Lanes sums[kSums] = {};
        const double* centre = p.centres;
        for (std::size_t j = 0; j < p.num_centres; ++j, centre += 6)
        {
            const Lanes dx = x - centre[0], dy = y - centre[1], dz = z - centre[2];
            const Lanes squared = dx * dx + dy * dy + dz * dz;
            const Lanes length = square_root(squared);
            const Lanes cube = squared * length;
            for (std::size_t k = 0; k < 3; ++k)
                sums[k] += cube * centre[3 + k];
            if (wants_slopes)
            {
                const Lanes gain = 3.0 * length;
                const Lanes along[3] = {gain * dx, gain * dy, gain * dz};
                for (std::size_t axis = 0; axis < 3; ++axis)
                    for (std::size_t k = 0; k < 3; ++k)
                        sums[3 + 3 * axis + k] += along[axis] * centre[3 + k];
            }
        }
        for (std::size_t k = 0; k < 3; ++k)
            store(p.displacement + k * kPlaceLanes + l, sums[k]);
        for (std::size_t k = 3; k < kSums; ++k)
            store(p.slopes + (k - 3) * kPlaceLanes + l, sums[k]);
    }
}

/// out = A w for rows of eight centres at a time.
template <std::size_t kColumns>
void multiply(const RbfProducts& p)
{
    const std::size_t n = p.num_padded;
    const double *x = p.centres, *y = x + n, *z = y + n;
    for (std::size_t i = p.first; i < p.end; i += CELLWARP_WIDTH)
    {
        const Lanes xi = load(x + i), yi = load(y + i), zi = load(z + i);
        Lanes sums[kColumns] = {};
        for (std::size_t j = 0; j < p.num_centres; ++j)
        {
            const Lanes cube = cube_of_distance(xi - x[j], yi - y[j], zi - z[j]);
            for (std::size_t k = 0; k < kColumns; ++k)
                sums[k] += cube * p.weights[k * n + j];
        }
        for (std::size_t k = 0; k < kColumns; ++k)
            store(p.out + k * n + i, sums[k]);
    }
}

void products(const RbfProducts& p, std::size_t num_columns)
{
    num_columns == 3 ? multiply<3>(p) : multiply<kQuadraticTerms>(p);
}

void columns(const RbfColumns& c)
{
    const std::size_t n = c.num_padded;
    const double *x = c.centres, *y = x + n, *z = y + n;
    for (std::size_t j = c.first; j < c.end; ++j)
        for (std::size_t i = c.first; i < n; i += CELLWARP_WIDTH)
        {
            Lanes entry = cube_of_distance(load(x + i) - x[j], load(y + i) - y[j],
                                           load(z + i) - z[j]);
            for (std::size_t k = 0; k < kQuadraticTerms; ++k)
                entry += load(c.left + k * n + i) * c.right[k * n + j] +
                         load(c.right + k * n + i) * c.left[k * n + j];
            store(c.out + (j - c.first) * c.stride + (i - c.first), entry);
        }
}

/// Where column \p k would begin: as packed_column() has it.
inline std::size_t at(std::size_t size, std::size_t k)
{
    const std::size_t first = k / kCentreLanes * kCentreLanes;
    return first * size - first * (first - kCentreLanes) / 2 +
           (k - first) * (size - first) - first;
}

/// Takes from eight columns, in some rows, what the columns before them say.
template <std::size_t kTiles>
inline void eliminate(double* m, std::size_t size, std::size_t first, std::size_t row)
{
    // Half of the columns at a time: the sums then fit the registers.
    constexpr std::size_t kHalf = kCentreLanes / 2;
    for (std::size_t half = 0; half < kCentreLanes; half += kHalf)
    {
        Lanes sums[kHalf][kTiles];
        for (std::size_t c = 0; c < kHalf; ++c)
            for (std::size_t p = 0; p < kTiles; ++p)
                sums[c][p] =
                    load((m + at(size, first + half + c)) + row + p * CELLWARP_WIDTH);
        for (std::size_t k = 0; k < first; ++k)
        {
            const double* const from = (m + at(size, k));
            Lanes own[kTiles];
            for (std::size_t p = 0; p < kTiles; ++p)
                own[p] = load(from + row + p * CELLWARP_WIDTH);
            for (std::size_t c = 0; c < kHalf; ++c)
                for (std::size_t p = 0; p < kTiles; ++p)
                    sums[c][p] -= own[p] * from[first + half + c];
        }
        for (std::size_t c = 0; c < kHalf; ++c)
            for (std::size_t p = 0; p < kTiles; ++p)
                store((m + at(size, first + half + c)) + row + p * CELLWARP_WIDTH,
                      sums[c][p]);
    }
}

/// Factors eight columns that nothing before them changes any more. The entries above
/// the diagonal of their first rows are scratch.
inline bool factorise_block(double* m, std::size_t size, std::size_t first)
{
    for (std::size_t c = first; c < first + kCentreLanes; ++c)
    {
        double* const own = (m + at(size, c));
        if (!(own[c] > 0.0))
            return false;
        const double root = __builtin_sqrt(own[c]), inverse = 1.0 / root;
        for (std::size_t i = first; i < size; i += CELLWARP_WIDTH)
            store(own + i, load(own + i) * inverse);
        own[c] = root;
        for (std::size_t other = c + 1; other < first + kCentreLanes; ++other)
        {
            double* const to = (m + at(size, other));
            const double factor = own[other];
            for (std::size_t i = first; i < size; i += CELLWARP_WIDTH)
                store(to + i, load(to + i) - load(own + i) * factor);
        }
    }
    return true;
}

bool factorise(double* m, std::size_t size)
{
    constexpr std::size_t kTiles = 16 / CELLWARP_WIDTH < 4 ? 16 / CELLWARP_WIDTH : 4;
    constexpr std::size_t kRows = kTiles * CELLWARP_WIDTH;
    for (std::size_t first = 0; first < size; first += kCentreLanes)
    {
        std::size_t row = first;
        for (; row + kRows <= size; row += kRows)
            eliminate<kTiles>(m, size, first, row);
        for (; row < size; row += CELLWARP_WIDTH)
            eliminate<1>(m, size, first, row);
        if (!factorise_block(m, size, first))
            return false;
    }
    return true;
}

/// L y = b, then L^T x = y, for three right-hand sides at once.
void solve(const double* m, std::size_t size, double* rows)
{
    const std::size_t n = size;
    for (std::size_t first = 0; first < n; first += kCentreLanes)
    {
        const std::size_t end = first + kCentreLanes;
        for (std::size_t c = first; c < end; ++c)
            for (std::size_t k = 0; k < 3; ++k)
            {
                double& value = rows[k * n + c];
                value /= (m + at(size, c))[c];
                for (std::size_t i = c + 1; i < end; ++i)
                    rows[k * n + i] -= (m + at(size, c))[i] * value;
            }
        for (std::size_t i = end; i < n; i += CELLWARP_WIDTH)
        {
            Lanes sums[3];
            for (std::size_t k = 0; k < 3; ++k)
                sums[k] = load(rows + k * n + i);
            for (std::size_t c = first; c < end; ++c)
            {
                const Lanes entry = load((m + at(size, c)) + i);
                for (std::size_t k = 0; k < 3; ++k)
                    sums[k] -= entry * rows[k * n + c];
            }
            for (std::size_t k = 0; k < 3; ++k)
                store(rows + k * n + i, sums[k]);
        }
    }
    for (std::size_t end = n; end > 0; end -= kCentreLanes)
    {
        const std::size_t first = end - kCentreLanes;
        for (std::size_t c = end; c-- > first;)
        {
            const double* const own = (m + at(size, c));
            double totals[3] = {};
            for (std::size_t part = 0; part < kParts; ++part)
            {
                Lanes sums[3] = {};
                for (std::size_t i = end + part * CELLWARP_WIDTH; i < n;
                     i += kCentreLanes)
                {
                    const Lanes entry = load(own + i);
                    for (std::size_t k = 0; k < 3; ++k)
                        sums[k] += entry * load(rows + k * n + i);
                }
                for (std::size_t k = 0; k < 3; ++k)
                    for (int l = 0; l < CELLWARP_WIDTH; ++l)
                        totals[k] += sums[k][l];
            }
            for (std::size_t i = c + 1; i < end; ++i)
                for (std::size_t k = 0; k < 3; ++k)
                    totals[k] += own[i] * rows[k * n + i];
            for (std::size_t k = 0; k < 3; ++k)
                rows[k * n + c] = (rows[k * n + c] - totals[k]) / own[c];
        }
    }
}

} // namespace

RbfKernels rbf_kernels();

RbfKernels rbf_kernels()
{
    return {
        sum_at_places<false>, sum_at_places<true>, products, columns, factorise, solve};
}

} // namespace cellwarp::core::CELLWARP_LANES_FOR
