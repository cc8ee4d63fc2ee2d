// SPDX-License-Identifier: GPL-3.0-or-later
// Compiled once for each instruction set, into the namespace CELLWARP_LANES_FOR. It uses
// no template or inline function of others: the linker keeps one copy of those, which
// could be one that not every processor understands.
//
// Inside a cell, with xi, eta, zeta in [-1/2, 1/2], a trilinear function is
//   c0 + cx xi + cy eta + cz zeta + cxy xi eta + cyz eta zeta + czx zeta xi
//      + cxyz xi eta zeta,
// and its coefficients are sums of the corners' values with signs, over 8, 4, 2 and 1.
// Forces on the corners are the same sums of the forces on the coefficients.
#include "solver/flesh/part_kernel.h"

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

using Lanes = double __attribute__((vector_size(8 * CELLWARP_WIDTH)));

inline Lanes load(const PartRow& row, std::size_t lane)
{
    Lanes value;
    __builtin_memcpy(&value, row.lane + lane, sizeof value);
    return value;
}

inline void store(PartRow& row, std::size_t lane, const Lanes& value)
{
    __builtin_memcpy(row.lane + lane, &value, sizeof value);
}

/// The sums with all signs, of eight numbers: their own inverse, but for a factor of 8.
inline void add_with_signs(Lanes* v)
{
    for (int step = 1; step < 8; step *= 2)
        for (int a = 0; a < 8; ++a)
            if ((a & step) == 0)
            {
                const Lanes low = v[a], high = v[a + step];
                v[a] = low + high;
                v[a + step] = high - low;
            }
}

/// Of the coefficients, in the order of the corners' bits.
constexpr double kScale[8] = {0.125, 0.25, 0.25, 0.5, 0.25, 0.5, 0.5, 1.0};

/// One axis of a vector as a trilinear function.
struct Coefficients
{
    Lanes c[8]; ///< 1, xi, eta, xi eta, zeta, xi zeta, eta zeta, xi eta zeta
};

/// A point and its products.
struct Place
{
    Lanes x, y, z, xy, yz, zx;
};

inline Place place_of(Lanes x, Lanes y, Lanes z)
{
    return {x, y, z, x * y, y * z, z * x};
}

inline double sign_of(int k, int axis)
{
    return (k >> axis & 1) ? 1.0 : -1.0;
}

inline Place point(const BoxBlock& block, int k, std::size_t lane)
{
    Lanes at[3];
    for (int c = 0; c < 3; ++c)
    {
        at[c] = load(block.centre[c], lane);
        for (int i = 0; i < 3; ++i)
            at[c] += sign_of(k, i) * load(block.spread[3 * i + c], lane);
    }
    return place_of(at[0], at[1], at[2]);
}

inline Place point(const DrawnBlock&, int k, std::size_t)
{
    constexpr double kGauss = 0.28867513459481288225; // 1 / sqrt 12
    const Lanes zero = {};
    return place_of(zero + kGauss * sign_of(k, 0), zero + kGauss * sign_of(k, 1),
                    zero + kGauss * sign_of(k, 2));
}

inline Lanes weight(const BoxBlock& block, int, std::size_t lane)
{
    return load(block.weight, lane);
}
inline Lanes weight(const DrawnBlock& block, int k, std::size_t lane)
{
    return load(block.weight[k], lane);
}

/// How much a mode counts at a point, times its weight.
inline Lanes mode_weight(const BoxBlock& block, int, std::size_t lane)
{
    return load(block.weight, lane);
}
inline Lanes mode_weight(const DrawnBlock& block, int k, std::size_t lane)
{
    return load(block.weight[k], lane) * load(block.scale[k], lane);
}

/// By local coordinates.
inline void slopes(const Coefficients& f, const Place& at, Lanes* out)
{
    out[0] = f.c[1] + f.c[3] * at.y + f.c[5] * at.z + f.c[7] * at.yz;
    out[1] = f.c[2] + f.c[3] * at.x + f.c[6] * at.z + f.c[7] * at.zx;
    out[2] = f.c[4] + f.c[5] * at.x + f.c[6] * at.y + f.c[7] * at.xy;
}

inline Lanes value(const Coefficients& f, const Place& at)
{
    return f.c[0] + f.c[1] * at.x + f.c[2] * at.y + f.c[4] * at.z + f.c[3] * at.xy +
           f.c[6] * at.yz + f.c[5] * at.zx + f.c[7] * (at.xy * at.z);
}

/// The forces on the coefficients, of what pulls at the slopes.
inline void add_slopes(const Lanes* pull, const Place& at, Coefficients& f)
{
    f.c[1] += pull[0];
    f.c[2] += pull[1];
    f.c[4] += pull[2];
    f.c[3] += pull[0] * at.y + pull[1] * at.x;
    f.c[5] += pull[0] * at.z + pull[2] * at.x;
    f.c[6] += pull[1] * at.z + pull[2] * at.y;
    f.c[7] += pull[0] * at.yz + pull[1] * at.zx + pull[2] * at.xy;
}

inline void add_value(Lanes pull, const Place& at, Coefficients& f)
{
    f.c[0] += pull;
    f.c[1] += pull * at.x;
    f.c[2] += pull * at.y;
    f.c[4] += pull * at.z;
    f.c[3] += pull * at.xy;
    f.c[6] += pull * at.yz;
    f.c[5] += pull * at.zx;
    f.c[7] += pull * (at.xy * at.z);
}

/// From local to real coordinates: slopes of three functions, row by row.
inline void to_real(const BoxBlock& block, int, std::size_t lane, Lanes (*G)[3])
{
    const Lanes inverse = load(block.inverse_edge, lane);
    for (int c = 0; c < 3; ++c)
        for (int j = 0; j < 3; ++j)
            G[c][j] *= inverse;
}
inline void to_real(const DrawnBlock& block, int k, std::size_t lane, Lanes (*G)[3])
{
    for (int c = 0; c < 3; ++c)
    {
        const Lanes local[3] = {G[c][0], G[c][1], G[c][2]};
        for (int j = 0; j < 3; ++j)
        {
            G[c][j] = local[0] * load(block.inverse[9 * k + 3 * j], lane);
            for (int i = 1; i < 3; ++i)
                G[c][j] += local[i] * load(block.inverse[9 * k + 3 * j + i], lane);
        }
    }
}

/// And of what pulls at them back to local ones.
inline void to_local(const BoxBlock& block, int k, std::size_t lane, Lanes* pull)
{
    (void)k;
    const Lanes inverse = load(block.inverse_edge, lane);
    for (int j = 0; j < 3; ++j)
        pull[j] *= inverse;
}
inline void to_local(const DrawnBlock& block, int k, std::size_t lane, Lanes* pull)
{
    const Lanes real[3] = {pull[0], pull[1], pull[2]};
    for (int i = 0; i < 3; ++i)
    {
        pull[i] = real[0] * load(block.inverse[9 * k + i], lane);
        for (int j = 1; j < 3; ++j)
            pull[i] += real[j] * load(block.inverse[9 * k + 3 * j + i], lane);
    }
}

/// xx yy zz yz zx xy.
struct Stress
{
    Lanes s[6];
};

inline void times(const Stress& stress, const Lanes* v, Lanes* out)
{
    const Lanes* const s = stress.s;
    out[0] = s[0] * v[0] + s[5] * v[1] + s[4] * v[2];
    out[1] = s[5] * v[0] + s[1] * v[1] + s[3] * v[2];
    out[2] = s[4] * v[0] + s[3] * v[1] + s[2] * v[2];
}

/// Of a gradient.
inline Stress stress_of(const Lanes (*G)[3], Lanes lambda, Lanes shear)
{
    const Lanes pressure = lambda * (G[0][0] + G[1][1] + G[2][2]);
    const Lanes twice = shear + shear;
    return {{pressure + twice * G[0][0], pressure + twice * G[1][1],
             pressure + twice * G[2][2], shear * (G[1][2] + G[2][1]),
             shear * (G[2][0] + G[0][2]), shear * (G[0][1] + G[1][0])}};
}

/// What the modes that cost least take off the stress: of mode i, times its sign and
/// scale at a point. \p sums: of the stress at the points, weighted as the modes are.
inline void relax(const BoxBlock& block, std::size_t lane, const Stress* sums,
                  Stress* relief)
{
    // sum w sign (stress) e = -A a, and A has the closed form of [theory-skeleton 4.2].
    const Lanes lambda = load(block.lambda, lane), shear = load(block.shear, lane);
    const Lanes volume = 8.0 * load(block.weight, lane);
    for (int i = 0; i < 3; ++i)
    {
        const Lanes e[3] = {load(block.modes[3 * i], lane),
                            load(block.modes[3 * i + 1], lane),
                            load(block.modes[3 * i + 2], lane)};
        Lanes s[3];
        times(sums[i], e, s);
        const Lanes along = e[0] * s[0] + e[1] * s[1] + e[2] * s[2];
        const Lanes stretch = along / (lambda + shear + shear);
        Lanes G[3][3];
        for (int c = 0; c < 3; ++c)
        {
            const Lanes a = -(e[c] * stretch + (s[c] - e[c] * along) / shear) / volume;
            for (int j = 0; j < 3; ++j)
                G[c][j] = a * e[j];
        }
        relief[i] = stress_of(G, lambda, shear);
    }
}
inline void relax(const DrawnBlock& block, std::size_t lane, const Stress* sums,
                  Stress* relief)
{
    const Lanes lambda = load(block.lambda, lane), shear = load(block.shear, lane);
    Lanes s[9], m[9];
    for (int i = 0; i < 9; ++i)
        m[i] = load(block.modes[i], lane);
    for (int i = 0; i < 3; ++i)
        times(sums[i], m + 3 * i, s + 3 * i);
    for (int i = 0; i < 3; ++i)
    {
        Lanes G[3][3];
        for (int c = 0; c < 3; ++c)
        {
            Lanes a = {};
            for (int r = 0; r < 9; ++r)
                a -= load(block.mode_solve[9 * (3 * i + c) + r], lane) * s[r];
            for (int j = 0; j < 3; ++j)
                G[c][j] = a * m[3 * i + j];
        }
        relief[i] = stress_of(G, lambda, shear);
    }
}

inline Lanes scale(const BoxBlock&, int, std::size_t)
{
    const Lanes zero = {};
    return zero + 1.0;
}
inline Lanes scale(const DrawnBlock& block, int k, std::size_t lane)
{
    return load(block.scale[k], lane);
}

/// The values of the nodes, side by side.
template <class Block>
inline void gather(const PartRun<Block>& run, PartRow* rows)
{
    for (std::size_t a = 0; a < 8; ++a)
        for (std::size_t l = 0; l < kPartLanes; ++l)
        {
            const double* const value =
                run.values + 3 * static_cast<std::size_t>(run.nodes[kPartLanes * a + l]);
            rows[3 * a].lane[l] = value[0];
            rows[3 * a + 1].lane[l] = value[1];
            rows[3 * a + 2].lane[l] = value[2];
        }
}

/// Into the frame of each part, and to coefficients.
template <class Block>
inline void coefficients(const PartRun<Block>& run, const PartRow* rows, std::size_t lane,
                         const Lanes* R, Coefficients* f)
{
    for (std::size_t a = 0; a < 8; ++a)
    {
        Lanes v[3];
        for (std::size_t c = 0; c < 3; ++c)
        {
            v[c] = load(rows[3 * a + c], lane);
            if (run.from_rest)
                v[c] += load(run.block->rest[3 * a + c], lane);
        }
        for (std::size_t c = 0; c < 3; ++c)
        {
            f[c].c[a] = R[3 * c] * v[0] + R[3 * c + 1] * v[1] + R[3 * c + 2] * v[2];
            if (run.from_rest)
                f[c].c[a] -= load(run.block->rest[3 * a + c], lane);
        }
    }
    for (int c = 0; c < 3; ++c)
    {
        add_with_signs(f[c].c);
        for (int a = 0; a < 8; ++a)
            f[c].c[a] *= kScale[a];
    }
}

template <class Block>
void product(const PartRun<Block>& run)
{
    const Block& block = *run.block;
    PartRow rows[24];
    gather(run, rows);
    for (std::size_t lane = 0; lane < kPartLanes; lane += CELLWARP_WIDTH)
    {
        Lanes R[9];
        for (int i = 0; i < 9; ++i)
            R[i] = load(run.frames[i], lane);
        Coefficients f[3], force[3] = {};
        coefficients(run, rows, lane, R, f);
        const Lanes lambda = load(block.lambda, lane), shear = load(block.shear, lane);
        Stress stress[8], sums[3] = {}, relief[3];
        for (int k = 0; k < 8; ++k)
        {
            const Place at = point(block, k, lane);
            Lanes G[3][3];
            for (int c = 0; c < 3; ++c)
                slopes(f[c], at, G[c]);
            to_real(block, k, lane, G);
            stress[k] = stress_of(G, lambda, shear);
            const Lanes counts = mode_weight(block, k, lane);
            for (int i = 0; i < 3; ++i)
                for (int s = 0; s < 6; ++s)
                    if (sign_of(k, i) > 0)
                        sums[i].s[s] += counts * stress[k].s[s];
                    else
                        sums[i].s[s] -= counts * stress[k].s[s];
        }
        relax(block, lane, sums, relief);
        const Lanes density = load(block.density, lane);
        for (int k = 0; k < 8; ++k)
        {
            const Place at = point(block, k, lane);
            const Lanes counts = scale(block, k, lane);
            for (int s = 0; s < 6; ++s)
            {
                Lanes sum = {};
                for (int i = 0; i < 3; ++i)
                    if (sign_of(k, i) > 0)
                        sum += relief[i].s[s];
                    else
                        sum -= relief[i].s[s];
                stress[k].s[s] += counts * sum;
            }
            const Lanes w = weight(block, k, lane);
            const Lanes elastic = w * run.stiffness;
            const Lanes* const s = stress[k].s;
            Lanes pull[3][3] = {
                {s[0], s[5], s[4]}, {s[5], s[1], s[3]}, {s[4], s[3], s[2]}};
            for (int c = 0; c < 3; ++c)
            {
                for (int j = 0; j < 3; ++j)
                    pull[c][j] *= elastic;
                to_local(block, k, lane, pull[c]);
                add_slopes(pull[c], at, force[c]);
            }
            if (run.mass != 0.0)
            {
                const Lanes inert = w * density * run.mass;
                for (int c = 0; c < 3; ++c)
                    add_value(inert * value(f[c], at), at, force[c]);
            }
        }
        for (int c = 0; c < 3; ++c)
        {
            for (int a = 0; a < 8; ++a)
                force[c].c[a] *= kScale[a];
            // Signs of corners by signs of coefficients: the same sums, transposed.
            for (int step = 1; step < 8; step *= 2)
                for (int a = 0; a < 8; ++a)
                    if ((a & step) == 0)
                    {
                        const Lanes even = force[c].c[a], odd = force[c].c[a + step];
                        force[c].c[a] = even - odd;
                        force[c].c[a + step] = even + odd;
                    }
        }
        for (std::size_t a = 0; a < 8; ++a)
            for (std::size_t c = 0; c < 3; ++c)
                store(run.out[3 * a + c], lane,
                      R[c] * force[0].c[a] + R[3 + c] * force[1].c[a] +
                          R[6 + c] * force[2].c[a]);
    }
}

template <class Block>
void gradients(const PartRun<Block>& run)
{
    const Block& block = *run.block;
    PartRow rows[24];
    gather(run, rows);
    for (std::size_t lane = 0; lane < kPartLanes; lane += CELLWARP_WIDTH)
    {
        const Lanes zero = {}, one = zero + 1.0;
        const Lanes identity[9] = {one, zero, zero, zero, one, zero, zero, zero, one};
        Coefficients f[3];
        coefficients(run, rows, lane, identity, f);
        Lanes sum[3][3] = {};
        for (int k = 0; k < 8; ++k)
        {
            const Place at = point(block, k, lane);
            Lanes G[3][3];
            for (int c = 0; c < 3; ++c)
                slopes(f[c], at, G[c]);
            to_real(block, k, lane, G);
            const Lanes w = weight(block, k, lane);
            for (int c = 0; c < 3; ++c)
                for (int j = 0; j < 3; ++j)
                    sum[c][j] += w * G[c][j];
        }
        for (int c = 0; c < 3; ++c)
            for (int j = 0; j < 3; ++j)
                store(run.out[3 * j + c], lane, sum[c][j]);
    }
}

} // namespace

PartKernels part_kernels()
{
    return {product<BoxBlock>, product<DrawnBlock>, gradients<BoxBlock>,
            gradients<DrawnBlock>};
}

} // namespace cellwarp::CELLWARP_LANES_FOR
