// SPDX-License-Identifier: GPL-3.0-or-later
// Blocks of a multigrid in single precision, as few bytes and as wide as can be: a cycle
// takes as long as it takes to read them.
#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "solver/cells/glue_block.h"

namespace cellwarp::core
{

/// Three numbers in one register. What stands in the fourth lane means nothing where
/// nothing else is said, but is finite.
using FourFloats = float __attribute__((vector_size(4 * sizeof(float))));

inline FourFloats four_of(const Eigen::Vector3d& x)
{
    FourFloats four = {};
    for (int k = 0; k < 3; ++k)
        four[k] = static_cast<float>(x[k]);
    return four;
}

inline FourFloats cross(const FourFloats& a, const FourFloats& b)
{
    return __builtin_shufflevector(a, a, 1, 2, 0, 3) *
               __builtin_shufflevector(b, b, 2, 0, 1, 3) -
           __builtin_shufflevector(a, a, 2, 0, 1, 3) *
               __builtin_shufflevector(b, b, 1, 2, 0, 3);
}

/// A turn and a shift, or a moment and a force.
struct WideVector
{
    FourFloats turn = {}, shift = {};

    static WideVector of(const Vector6& x)
    {
        return {four_of(x.head<3>()), four_of(x.tail<3>())};
    }
    Vector6 numbers() const
    {
        Vector6 x;
        x << turn[0], turn[1], turn[2], shift[0], shift[1], shift[2];
        return x;
    }
    WideVector& operator+=(const WideVector& other)
    {
        turn += other.turn;
        shift += other.shift;
        return *this;
    }
    WideVector& operator-=(const WideVector& other)
    {
        turn -= other.turn;
        shift -= other.shift;
        return *this;
    }
    friend WideVector operator+(WideVector a, const WideVector& b) { return a += b; }
    friend WideVector operator-(WideVector a, const WideVector& b) { return a -= b; }
    friend WideVector operator*(float factor, const WideVector& a)
    {
        return {factor * a.turn, factor * a.shift};
    }
};

/// A GlueBlock in as many bytes as a cache line has.
struct alignas(64) WideGlue
{
    std::array<FourFloats, 3> turn; ///< by columns; below them column_arm
    FourFloats row_arm;             ///< and after it the shift

    WideGlue() = default;
    explicit WideGlue(const GlueBlock& block) : row_arm(four_of(block.row_arm))
    {
        for (int k = 0; k < 3; ++k)
        {
            turn[idx(k)] = four_of(block.turn.col(k));
            turn[idx(k)][3] = static_cast<float>(block.column_arm[k]);
        }
        row_arm[3] = static_cast<float>(block.shift);
    }
    /// y += A x
    void add_product(const WideVector& x, WideVector& y) const
    {
        // (., ., b_0, b_1), then b
        const FourFloats two = __builtin_shufflevector(turn[0], turn[1], 2, 6, 3, 7);
        const FourFloats column_arm = __builtin_shufflevector(two, turn[2], 2, 3, 7, 7);
        y.turn += turn[0] * x.turn[0] + turn[1] * x.turn[1] +
                  (turn[2] * x.turn[2] + cross(row_arm, x.shift));
        y.shift += row_arm[3] * x.shift + cross(column_arm, x.turn);
    }
};

/// Other 6 x 6 blocks in a row, by columns. Of a column two times four numbers are read:
/// the fourth of its shift is the next column's first, which is finite and goes nowhere.
class WideBlocks
{
public:
    static constexpr std::size_t kBytes = 36 * sizeof(float); ///< of each

    explicit WideBlocks(std::size_t count = 0) : numbers_(36 * count + 1, 0.0f) {}

    std::size_t size() const { return numbers_.size() / 36; }
    void set(std::size_t at, const Matrix6& A)
    {
        Eigen::Map<Eigen::Matrix<float, 6, 6>>(numbers_.data() + 36 * at) =
            A.cast<float>();
    }
    /// A x
    WideVector product(std::size_t at, const WideVector& x) const
    {
        const float* column = numbers_.data() + 36 * at;
        WideVector y;
        for (const FourFloats& half : {x.turn, x.shift})
            for (int k = 0; k < 3; ++k, column += 6)
            {
                y.turn += read(column) * half[k];
                y.shift += read(column + 3) * half[k];
            }
        return y;
    }

private:
    static FourFloats read(const float* numbers)
    {
        FourFloats four;
        std::memcpy(&four, numbers, sizeof four);
        return four;
    }

    std::vector<float> numbers_;
};

} // namespace cellwarp::core
