// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/sparse_rows.h"

#include <algorithm>

namespace cellwarp::core
{

NodeShares gathered(NodeShares shares)
{
    std::stable_sort(shares.begin(), shares.end(),
                     [](const NodeShare& a, const NodeShare& b)
                     { return a.node < b.node; });
    NodeShares out;
    for (const NodeShare& share : shares)
        if (!out.empty() && out.back().node == share.node)
            out.back().share += share.share;
        else
            out.push_back(share);
    std::erase_if(out, [](const NodeShare& share) { return share.share == 0.0; });
    return out;
}

Eigen::Vector3d at_point(std::span<const NodeShare> shares, const Eigen::VectorXd& x)
{
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const NodeShare& share : shares)
        sum += share.share * x.segment<3>(3 * share.node);
    return sum;
}

SparseRows SparseRows::transposed(std::size_t columns) const
{
    SparseRows out;
    out.first_.assign(columns + 1, 0);
    for (const NodeShare& share : shares_)
        ++out.first_[idx(share.node) + 1];
    for (std::size_t c = 0; c < columns; ++c)
        out.first_[c + 1] += out.first_[c];
    out.shares_.resize(shares_.size());
    std::vector<std::size_t> next(out.first_.begin(), out.first_.end() - 1);
    for (std::size_t row = 0; row < size(); ++row)
        for (const NodeShare& share : (*this)[row])
            out.shares_[next[idx(share.node)]++] = {static_cast<int>(row), share.share};
    return out;
}

} // namespace cellwarp::core
