// SPDX-License-Identifier: GPL-3.0-or-later
// Stretch of a rod as a polynomial of the legs of its control polygon, its coefficients
// integrated once. tensor_stretch.cpp has the derivation. [Nocent01]
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "solver/rods/rod_term.h"

namespace cellwarp::core
{

/// Numbers N_ijkl that are the same in whatever order the indices stand, and zero unless
/// they all lie within \p order successive ones: one array without zeros or repeats. Of a
/// closed curve, indices go on behind the last one from 0.
class PackedTensor
{
public:
    PackedTensor(int count, int order, bool is_closed);

    std::size_t size() const { return values_.size(); }
    /// \pre i <= j <= k <= l < i + order; i < count, the others may lie beyond it
    /// by whole turns of a closed curve.
    double& at(int i, int j, int k, int l)
    {
        return values_[first_[idx(i)] + address(j - i, k - i, l - i)];
    }
    /// Of those that begin with \p i: at offsets a <= b <= c, in the order of address().
    const double* from(int i) const { return values_.data() + first_[idx(i)]; }
    /// How far behind i the others may lie.
    int reach(int i) const { return reach_[idx(i)]; }

    /// Place among those of one i, of offsets a <= b <= c.
    static std::size_t address(int a, int b, int c)
    {
        return idx(a) + idx(b) * (idx(b) + 1) / 2 +
               idx(c) * (idx(c) + 1) * (idx(c) + 2) / 6;
    }

private:
    std::vector<std::size_t> first_;
    std::vector<int> reach_;
    std::vector<double> values_;
};

/// 1/2 YA int eps^2 dS with the Green strain eps = 1/2 (l^2 / sigma^2 - 1). It gives way
/// where the rod is pressed below 0.577 of its length: not for slender rods. The rod must
/// outlive it.
std::unique_ptr<RodTerm> tensor_stretch(const Rod& rod);

} // namespace cellwarp::core
