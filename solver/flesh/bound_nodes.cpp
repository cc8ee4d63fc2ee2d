// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/bound_nodes.h"

#include <array>
#include <cmath>
#include <map>
#include <set>

namespace cellwarp::core
{

namespace
{

constexpr double kLeastPivot = 0.2;

/// Shares below this are what rounding left of none.
constexpr double kRounding = 1e-14;

/// What a node is solved to: shares of nodes and of points.
struct Solved
{
    std::map<int, double> nodes, points;
};

class Elimination
{
public:
    explicit Elimination(std::size_t num_nodes)
        : solved_(num_nodes), is_solved_(num_nodes, false), mentioned_by_(num_nodes)
    {
    }

    /// False: dropped.
    bool add(std::span<const NodeShare> shares, int point)
    {
        Solved row;
        row.points[point] = 1.0;
        for (const NodeShare& share : shares)
            if (!is_solved_[idx(share.node)])
                row.nodes[share.node] += share.share;
            else
                substitute(solved_[idx(share.node)], share.share, row);
        int pivot = -1;
        double largest = kLeastPivot;
        for (const auto& [node, share] : row.nodes)
            if (std::abs(share) >= largest * (pivot < 0 ? 1.0 : 1.0 + 1e-12))
            {
                largest = std::abs(share);
                pivot = node;
            }
        if (pivot < 0)
            return false;
        const double scale = row.nodes[pivot];
        row.nodes.erase(pivot);
        for (auto& [node, share] : row.nodes)
            share /= -scale;
        for (auto& [other, share] : row.points)
            share /= scale;
        solve(pivot, std::move(row));
        return true;
    }

    bool is_solved(int node) const { return is_solved_[idx(node)]; }
    const Solved& operator[](int node) const { return solved_[idx(node)]; }

private:
    /// A row sum shares u = gamma loses \p share times a solved node.
    static void substitute(const Solved& by, double share, Solved& row)
    {
        for (const auto& [node, of] : by.nodes)
            row.nodes[node] += share * of;
        for (const auto& [point, of] : by.points)
            row.points[point] -= share * of;
    }

    void solve(int node, Solved row)
    {
        drop_zeros(row);
        for (const int other : std::set<int>(mentioned_by_[idx(node)]))
        {
            Solved& to = solved_[idx(other)];
            const double share = to.nodes[node];
            to.nodes.erase(node);
            for (const auto& [free, of] : row.nodes)
                to.nodes[free] += share * of;
            for (const auto& [point, of] : row.points)
                to.points[point] += share * of;
            drop_zeros(to);
            for (const auto& [free, of] : to.nodes)
                mentioned_by_[idx(free)].insert(other);
        }
        mentioned_by_[idx(node)].clear();
        for (const auto& [free, of] : row.nodes)
            mentioned_by_[idx(free)].insert(node);
        solved_[idx(node)] = std::move(row);
        is_solved_[idx(node)] = true;
    }

    static void drop_zeros(Solved& row)
    {
        for (std::map<int, double>* shares : {&row.nodes, &row.points})
            std::erase_if(*shares, [](const auto& share)
                          { return std::abs(share.second) < kRounding; });
    }

    std::vector<Solved> solved_;
    std::vector<bool> is_solved_;
    std::vector<std::set<int>> mentioned_by_; ///< solved nodes that take of a node
};

} // namespace

BoundNodes bind_nodes(std::span<const NodeShares> hanging,
                      std::span<const HeldPoint> points)
{
    Elimination elimination(hanging.size());
    BoundNodes out;
    for (std::size_t p = 0; p < points.size(); ++p)
        if (!elimination.add(points[p].shares, static_cast<int>(p)))
            out.dropped.push_back(static_cast<int>(p));
    std::vector<int> place(hanging.size(), -1);
    for (std::size_t n = 0; n < hanging.size(); ++n)
    {
        const int node = static_cast<int>(n);
        if (!hanging[n].empty() || elimination.is_solved(node))
            out.bound.push_back(node);
        else
        {
            place[n] = static_cast<int>(out.free.size());
            out.free.push_back(node);
        }
    }
    for (const int node : out.bound)
    {
        NodeShares by_free, by_points;
        const auto take = [&](int of, double share)
        {
            if (!elimination.is_solved(of))
            {
                by_free.push_back({place[idx(of)], share});
                return;
            }
            for (const auto& [free, part] : elimination[of].nodes)
                by_free.push_back({place[idx(free)], share * part});
            for (const auto& [point, part] : elimination[of].points)
                by_points.push_back({point, share * part});
        };
        if (hanging[idx(node)].empty())
            take(node, 1.0);
        for (const NodeShare& share : hanging[idx(node)])
            take(share.node, share.share);
        out.by_free.add(gathered(std::move(by_free)));
        out.by_points.add(gathered(std::move(by_points)));
    }
    out.free_of = out.by_free.transposed(out.free.size());
    return out;
}

SparseRows by_free_of_all(const BoundNodes& nodes)
{
    SparseRows out;
    std::size_t free = 0, bound = 0;
    while (free < nodes.free.size() || bound < nodes.bound.size())
        if (bound == nodes.bound.size() ||
            (free < nodes.free.size() && nodes.free[free] < nodes.bound[bound]))
            out.add(std::array{NodeShare{static_cast<int>(free++), 1.0}});
        else
            out.add(nodes.by_free[bound++]);
    return out;
}

} // namespace cellwarp::core
