// SPDX-License-Identifier: GPL-3.0-or-later
// Sets that are joined again and again.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

#include "octree/base/index.h"

namespace cellwarp::core
{

class UnionFind
{
public:
    /// Each number below \p count is alone.
    explicit UnionFind(std::size_t count) : root_(count)
    {
        std::iota(root_.begin(), root_.end(), 0);
    }

    /// The smallest number of the set that holds \p i.
    int first_of(int i)
    {
        while (root_[idx(i)] != i)
            i = root_[idx(i)] = root_[idx(root_[idx(i)])];
        return i;
    }
    /// False if they were one set before.
    bool join(int i, int j)
    {
        const int a = first_of(i), b = first_of(j);
        root_[idx(std::max(a, b))] = std::min(a, b);
        return a != b;
    }

private:
    std::vector<int> root_; ///< a smaller number of the same set, or itself
};

} // namespace cellwarp::core
