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

#include "octree/base/lanes.h"

namespace cellwarp::core::CELLWARP_LANES_FOR
{

namespace
{

inline Lanes load(const PartRow& row, std::size_t lane)
{
    return load(row.lane + lane);
}

inline void store(PartRow& row, std::size_t lane, const Lanes& value)
{
    store(row.lane + lane, value);
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

/// xx yy zz yz zx xy.
struct Stress
{
    Lanes s[6];
};

/// Of a gradient.
inline Stress stress_of(const Lanes (*G)[3], Lanes lambda, Lanes shear)
{
    const Lanes pressure = lambda * (G[0][0] + G[1][1] + G[2][2]);
    const Lanes twice = shear + shear;
    return {{pressure + twice * G[0][0], pressure + twice * G[1][1],
             pressure + twice * G[2][2], shear * (G[1][2] + G[2][1]),
             shear * (G[2][0] + G[0][2]), shear * (G[0][1] + G[1][0])}};
}

/// The values of the nodes, side by side.
inline void gather(const PartRun& run, PartRow* rows)
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
inline void coefficients(const PartRun& run, const PartRow* rows, std::size_t lane,
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

/// Forces on coefficients back to the corners, turned out of the frame of each part.
inline void give(const PartRun& run, const Lanes* R, std::size_t lane,
                 Coefficients* force)
{
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

/// What functions of a place are over the eight points: sums of the eight products of
/// signs, 1, e0, e1, e2, e0 e1, e1 e2, e2 e0, e0 e1 e2. Over all points the products are
/// orthogonal: sums over points become sums over these.
struct Signs
{
    Lanes place[3][4], product[3][7]; ///< of x, y, z; of yz, zx, xy
};

inline Signs signs_of(const PartBlock& block, std::size_t lane)
{
    Signs out;
    for (int c = 0; c < 3; ++c)
    {
        out.place[c][0] = load(block.centre[c], lane);
        for (int i = 0; i < 3; ++i)
            out.place[c][1 + i] = load(block.spread[3 * i + c], lane);
    }
    for (int c = 0; c < 3; ++c)
    {
        const Lanes* const a = out.place[(c + 1) % 3];
        const Lanes* const b = out.place[(c + 2) % 3];
        Lanes* const p = out.product[c];
        p[0] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
        for (int i = 1; i < 4; ++i)
            p[i] = a[0] * b[i] + a[i] * b[0];
        for (int i = 0; i < 3; ++i)
        {
            const int j = 1 + (i + 1) % 3;
            p[4 + i] = a[1 + i] * b[j] + a[j] * b[1 + i];
        }
    }
    return out;
}

/// Which coefficients belong to yz, zx and xy, and to x, y and z.
constexpr int kOfProduct[3] = {6, 5, 3}, kOfPlace[3] = {1, 2, 4};

/// The slopes of a function along axis j are c_j + c_jk k + c_jl l + c_xyz k l: one
/// product of signs of them.
inline Lanes slope(const Coefficients& f, const Signs& at, int j, int sign)
{
    const int k = (j + 1) % 3, l = (j + 2) % 3;
    if (sign >= 4)
        return f.c[7] * at.product[j][sign];
    Lanes sum = f.c[kOfProduct[l]] * at.place[k][sign] +
                f.c[kOfProduct[k]] * at.place[l][sign] + f.c[7] * at.product[j][sign];
    if (sign == 0)
        sum += f.c[kOfPlace[j]];
    return sum;
}

/// And the forces on the coefficients of what pulls at it.
inline void add_slope(Lanes pull, const Signs& at, int j, int sign, Coefficients& f)
{
    const int k = (j + 1) % 3, l = (j + 2) % 3;
    f.c[7] += pull * at.product[j][sign];
    if (sign >= 4)
        return;
    f.c[kOfProduct[l]] += pull * at.place[k][sign];
    f.c[kOfProduct[k]] += pull * at.place[l][sign];
    if (sign == 0)
        f.c[kOfPlace[j]] += pull;
}

/// Takes off the stresses of single signs, 1 to 3, what the modes that cost least take:
/// mode i at a point is its place along axis i, from the part's centre.
inline void relax(const PartBlock& block, const Signs& at, std::size_t lane, Lanes lambda,
                  Lanes shear, Stress* stress)
{
    constexpr int kColumn[3][3] = {{0, 5, 4}, {5, 1, 3}, {4, 3, 2}}; // of a Stress
    Lanes pulls[9];
    for (int i = 0; i < 3; ++i)
        for (int c = 0; c < 3; ++c)
        {
            const int s = kColumn[i][c];
            pulls[3 * i + c] = at.place[i][1] * stress[1].s[s] +
                               at.place[i][2] * stress[2].s[s] +
                               at.place[i][3] * stress[3].s[s];
        }
    Lanes modes[9] = {};
    for (int r = 0, next = 0; r < 9; ++r)
        for (int c = 0; c <= r; ++c, ++next)
        {
            const Lanes entry = load(block.mode_solve[next], lane);
            modes[r] -= entry * pulls[c];
            if (c < r)
                modes[c] -= entry * pulls[r];
        }
    for (int sign = 1; sign < 4; ++sign)
    {
        Lanes G[3][3];
        for (int c = 0; c < 3; ++c)
            for (int i = 0; i < 3; ++i)
                G[c][i] = modes[3 * i + c] * at.place[i][sign];
        const Stress relief = stress_of(G, lambda, shear);
        for (int k = 0; k < 6; ++k)
            stress[sign].s[k] += relief.s[k];
    }
}

/// Adds to the forces on the corners what mass and tubes do, which are alike along each
/// axis: no frame turns them.
inline void add_alike(const PartRun& run, const PartRow* values, std::size_t lane)
{
    Lanes entries[8][8];
    for (std::size_t a = 0, next = 0; a < 8; ++a)
        for (std::size_t b = 0; b <= a; ++b, ++next)
        {
            Lanes& entry = entries[a][b];
            entry = run.mass * load(run.block->mass[next], lane);
            if (run.tubes)
                entry += run.tube * load(run.tubes[next], lane);
            entries[b][a] = entry;
        }
    for (std::size_t c = 0; c < 3; ++c)
    {
        Lanes value[8];
        for (std::size_t a = 0; a < 8; ++a)
            value[a] = load(values[3 * a + c], lane);
        for (std::size_t a = 0; a < 8; ++a)
        {
            Lanes sum = load(run.out[3 * a + c], lane);
            for (std::size_t b = 0; b < 8; ++b)
                sum += entries[a][b] * value[b];
            store(run.out[3 * a + c], lane, sum);
        }
    }
}

/// Sums over the points are sums over signs.
void product(const PartRun& run)
{
    const PartBlock& block = *run.block;
    PartRow rows[24];
    gather(run, rows);
    for (std::size_t lane = 0; lane < kPartLanes; lane += CELLWARP_WIDTH)
    {
        Lanes R[9];
        for (int i = 0; i < 9; ++i)
            R[i] = load(run.frames[i], lane);
        Coefficients f[3], force[3] = {};
        coefficients(run, rows, lane, R, f);
        const Signs at = signs_of(block, lane);
        const Lanes lambda = load(block.lambda, lane), shear = load(block.shear, lane);
        const Lanes inverse = load(block.inverse_edge, lane);
        const Lanes weight = 8.0 * load(block.weight, lane);
        const Lanes elastic = weight * run.stiffness * inverse;
        Stress stress[7];
        for (int sign = 0; sign < 7; ++sign)
        {
            Lanes G[3][3];
            for (int c = 0; c < 3; ++c)
                for (int j = 0; j < 3; ++j)
                    G[c][j] = inverse * slope(f[c], at, j, sign);
            stress[sign] = stress_of(G, lambda, shear);
        }
        relax(block, at, lane, lambda, shear, stress);
        for (int sign = 0; sign < 7; ++sign)
        {
            const Lanes* const s = stress[sign].s;
            const Lanes pull[3][3] = {
                {s[0], s[5], s[4]}, {s[5], s[1], s[3]}, {s[4], s[3], s[2]}};
            for (int c = 0; c < 3; ++c)
                for (int j = 0; j < 3; ++j)
                    add_slope(elastic * pull[c][j], at, j, sign, force[c]);
        }
        give(run, R, lane, force);
        if (run.mass != 0.0 || run.tube != 0.0)
            add_alike(run, rows, lane);
    }
}

void gradients(const PartRun& run)
{
    const PartBlock& block = *run.block;
    PartRow rows[24];
    gather(run, rows);
    for (std::size_t lane = 0; lane < kPartLanes; lane += CELLWARP_WIDTH)
    {
        const Lanes zero = {}, one = zero + 1.0;
        const Lanes identity[9] = {one, zero, zero, zero, one, zero, zero, zero, one};
        Coefficients f[3];
        coefficients(run, rows, lane, identity, f);
        const Signs at = signs_of(block, lane);
        const Lanes scale =
            8.0 * load(block.weight, lane) * load(block.inverse_edge, lane);
        for (int c = 0; c < 3; ++c)
            for (int j = 0; j < 3; ++j)
                store(run.out[3 * j + c], lane, scale * slope(f[c], at, j, 0));
    }
}

} // namespace

PartKernels part_kernels()
{
    return {product, gradients};
}

} // namespace cellwarp::core::CELLWARP_LANES_FOR
