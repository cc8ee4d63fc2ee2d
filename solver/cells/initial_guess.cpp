// SPDX-License-Identifier: GPL-3.0-or-later
// The minimiser sees only glue that is torn where a region has moved away from its
// neighbours, and would mend it from there inwards, the slower the finer the cells: a bar
// turned by 135 degrees takes 49 iterations with 207,360 cells. From a start that spreads
// the step over the whole body it takes 4 for any number of cells of a bar; where fine
// features give way and fold, more cells still mean more iterations.
//
// Shares s_r solve sum_j w_ij (s_i - s_j) = 0 over the glue, 1 in cells of region r, 0 in
// those of others, and in the cells of a rod linear between two of its places: found by
// conjugate gradients, no better than a guess deserves. Steps are blended as dual
// quaternions [Kavan07], along screws; with positive real parts they are added by the
// shortest turns from where the cells are.
#include "solver/cells/initial_guess.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/cells/grouping.h"

namespace cellwarp::core
{

namespace
{

/// How well the shares are solved for where few groups are left, relative to the first
/// residual, and with how many steps at most on the way down, where only what a coarser
/// level cannot show is missing.
constexpr double kTolerance = 1e-4;
constexpr int kFewCells = 400;
constexpr int kSmoothing = 12;

/// Shorter sums of quaternions are no rotation.
constexpr double kLeastBlend = 0.1;

/// Smaller shares are none.
constexpr double kLeast = 1e-4;

/// Glue as a graph of cells, or of groups of them.
struct Graph : Links
{
    std::vector<double> weight;   ///< of each link
    std::vector<double> diagonal; ///< sum of the weights
    std::vector<Driving> driving; ///< of each node

    /// sum_j w_ij (x_i - x_j) in free nodes, 0 in others.
    void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const
    {
        parallel_ranges(driving.size(), 1024,
                        [&](std::size_t begin, std::size_t end)
                        {
                            for (std::size_t i = begin; i < end; ++i)
                                y[static_cast<Eigen::Index>(i)] = row(i, x);
                        });
    }

private:
    double row(std::size_t i, const Eigen::VectorXd& x) const
    {
        if (!driving[i].is_free())
            return 0.0;
        double sum = diagonal[i] * x[static_cast<Eigen::Index>(i)];
        for (std::size_t k = begin(i); k < end(i); ++k)
            sum -= weight[k] * x[column[k]];
        return sum;
    }
};

Graph graph_of(const Glue& glue, std::vector<Driving> driving)
{
    Graph graph;
    graph.first = glue.first_face;
    graph.diagonal.assign(driving.size(), 0.0);
    for (std::size_t i = 0; i < driving.size(); ++i)
        for (std::size_t k = graph.begin(i); k < graph.end(i); ++k)
        {
            const GlueFace& face = glue.faces[idx(glue.faces_of_cell[k])];
            graph.column.push_back(face.a == static_cast<int>(i) ? face.b : face.a);
            graph.weight.push_back(face.stiffness);
            graph.diagonal[i] += face.stiffness;
        }
    graph.driving = std::move(driving);
    return graph;
}

Graph joined(const Graph& graph, const Grouping& grouping)
{
    Graph next;
    next.first.push_back(0);
    const std::vector<int>& group = grouping.group_of_node;
    std::vector<std::pair<int, double>> row;
    for (std::size_t g = 0; g < grouping.members.size(); ++g)
    {
        row.clear();
        double sum = 0.0;
        for (const int member : grouping.members.of(g))
            for (std::size_t k = graph.begin(idx(member)); k < graph.end(idx(member));
                 ++k)
            {
                const int other = group[idx(graph.column[k])];
                if (other == static_cast<int>(g))
                    continue;
                sum += graph.weight[k];
                const auto found =
                    std::find_if(row.begin(), row.end(),
                                 [&](const auto& entry) { return entry.first == other; });
                if (found == row.end())
                    row.emplace_back(other, graph.weight[k]);
                else
                    found->second += graph.weight[k];
            }
        for (const auto& [column, weight] : row)
        {
            next.column.push_back(column);
            next.weight.push_back(weight);
        }
        next.first.push_back(static_cast<int>(next.column.size()));
        next.diagonal.push_back(sum);
        // Of one rod members differ in how far along it they are.
        Driving driving = graph.driving[idx(grouping.members.of(g).front())];
        double share = 0.0;
        for (const int member : grouping.members.of(g))
            share += graph.driving[idx(member)].share;
        driving.share = share / static_cast<double>(grouping.members.of(g).size());
        next.driving.push_back(driving);
    }
    return next;
}

/// Makes \p x, given in nodes that are not free, more harmonic in the others.
void make_harmonic(const Graph& graph, int max_steps, Eigen::VectorXd& x)
{
    Eigen::VectorXd r(x.size()), z(x.size()), image(x.size());
    const auto precondition = [&]
    {
        for (Eigen::Index i = 0; i < x.size(); ++i)
        {
            const double diagonal = graph.diagonal[idx(i)];
            z[i] = diagonal > 0 ? r[i] / diagonal : 0.0;
        }
    };
    graph.multiply(x, r);
    r = -r;
    precondition();
    Eigen::VectorXd direction = z;
    double r_z = r.dot(z);
    const double least = kTolerance * kTolerance * r_z;
    for (int step = 0; step < max_steps && r_z > least; ++step)
    {
        graph.multiply(direction, image);
        const double length = r_z / direction.dot(image);
        if (!std::isfinite(length))
            break;
        x += length * direction;
        r -= length * image;
        precondition();
        const double next = r.dot(z);
        direction = z + next / r_z * direction;
        r_z = next;
    }
}

/// Finest first; every level but the last has its grouping.
struct Cascade
{
    std::vector<Graph> graphs;
    std::vector<Grouping> groupings;

    Cascade(Graph finest, std::span<const GridPlace> places)
    {
        graphs.push_back(std::move(finest));
        OctreeBlocks blocks(places);
        while (graphs.back().count() > kFewCells)
        {
            const Graph& graph = graphs.back();
            const bool is_mixed = blocks.is_mixed();
            Grouping grouping =
                blocks.join(graph,
                            [&](std::size_t i, std::size_t k)
                            {
                                const Driving &a = graph.driving[i],
                                              &b = graph.driving[idx(graph.column[k])];
                                return a.first == b.first && a.second == b.second;
                            });
            if (!is_mixed && grouping.members.size() == graph.driving.size())
                return;
            graphs.push_back(joined(graph, grouping));
            groupings.push_back(std::move(grouping));
        }
    }
    /// The share of a motion in each cell.
    Eigen::VectorXd share(int motion) const
    {
        Eigen::VectorXd x;
        for (std::size_t level = graphs.size(); level-- > 0;)
        {
            const Graph& graph = graphs[level];
            Eigen::VectorXd finer(graph.count());
            for (Eigen::Index i = 0; i < finer.size(); ++i)
            {
                const std::size_t node = idx(i);
                const Driving& own = graph.driving[node];
                finer[i] = !own.is_free() ? own.share_of(motion)
                           : level + 1 == graphs.size()
                               ? 0.0
                               : x[groupings[level].group_of_node[node]];
            }
            x = std::move(finer);
            make_harmonic(graph, level + 1 == graphs.size() ? graph.count() : kSmoothing,
                          x);
        }
        return x;
    }
};

struct DualQuaternion
{
    Eigen::Vector4d real, dual;

    explicit DualQuaternion(const Motion& motion)
    {
        Eigen::Quaterniond q(motion.R);
        if (q.w() < 0)
            q.coeffs() = -q.coeffs();
        const Eigen::Quaterniond t(0.0, motion.t.x(), motion.t.y(), motion.t.z());
        real = q.coeffs();
        dual = 0.5 * (t * q).coeffs();
    }
};

/// The motion of a sum of dual quaternions.
Motion motion_of(const Eigen::Vector4d& real, const Eigen::Vector4d& dual)
{
    const double length = real.norm();
    const Eigen::Quaterniond q(Eigen::Vector4d(real / length));
    const Eigen::Quaterniond d(Eigen::Vector4d(dual / length));
    return {q.toRotationMatrix(), 2.0 * (d * q.conjugate()).vec()};
}

} // namespace

InitialGuess::InitialGuess(const Cells& cells, const Glue& glue,
                           std::span<const Constraint> constraints,
                           std::span<const Driving> driving, int num_motions)
{
    const std::size_t n = cells.size();
    std::vector<Driving> of_nodes(n);
    std::vector<bool> is_there(idx(num_motions), false);
    std::vector<GridPlace> places;
    for (std::size_t i = 0; i < n; ++i)
    {
        places.push_back(grid_place(cells, static_cast<int>(i)));
        if (constraints[i].hold == Hold::Free)
            continue;
        of_nodes[i] = driving[i];
        for (const int motion : {driving[i].first, driving[i].second})
            if (motion >= 0)
                is_there[idx(motion)] = true;
    }
    const Cascade cascade(graph_of(glue, std::move(of_nodes)), places);
    std::vector<std::vector<Share>> of_cell(n);
    for (int r = 0; r < num_motions; ++r)
    {
        if (!is_there[idx(r)])
            continue;
        const Eigen::VectorXd x = cascade.share(r);
        for (std::size_t i = 0; i < n; ++i)
            if (const double value = x[static_cast<Eigen::Index>(i)]; value > kLeast)
                of_cell[i].push_back({r, static_cast<float>(value)});
    }
    first_.push_back(0);
    for (const std::vector<Share>& shares : of_cell)
    {
        shares_.insert(shares_.end(), shares.begin(), shares.end());
        first_.push_back(static_cast<int>(shares_.size()));
    }
}

double InitialGuess::share(int cell, int motion) const
{
    const std::size_t c = idx(cell);
    for (int k = first_[c]; k < first_[c + 1]; ++k)
        if (shares_[idx(k)].motion == motion)
            return static_cast<double>(shares_[idx(k)].value);
    return 0.0;
}

void InitialGuess::carry(std::span<const Motion> steps, std::span<const int> cells,
                         std::span<Pose> poses) const
{
    const auto carry_one = [&](std::size_t i)
    {
        const std::size_t first = idx(first_[i]);
        const std::span<const Share> shares =
            std::span(shares_).subspan(first, idx(first_[i + 1]) - first);
        if (shares.empty())
            return;
        const Motion& one = steps[idx(shares[0].motion)];
        bool is_one = true;
        Eigen::Vector4d real = Eigen::Vector4d::Zero(), dual = real;
        for (const Share& share : shares)
        {
            const Motion& step = steps[idx(share.motion)];
            is_one = is_one && step.R == one.R && step.t == one.t;
            const DualQuaternion q(step);
            real += static_cast<double>(share.value) * q.real;
            dual += static_cast<double>(share.value) * q.dual;
        }
        // Where turns that oppose each other cancel, the blend means nothing.
        const bool is_blend = !is_one && real.norm() > kLeastBlend;
        const Motion blend = is_blend ? motion_of(real, dual) : one;
        poses[i] = {blend.R * poses[i].R, blend(poses[i].p)};
    };
    parallel_ranges(cells.size(), 256,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t k = begin; k < end; ++k)
                            carry_one(idx(cells[k]));
                    });
}

} // namespace cellwarp::core
