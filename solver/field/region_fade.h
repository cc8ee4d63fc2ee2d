// SPDX-License-Identifier: GPL-3.0-or-later
// A field passes the samples of a region by a little. The difference to the
// region's own motion is added: wholly at its samples, smoothly less outside, over
// a cell or two of connected material.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "solver/field/blend.h"
#include "solver/field/node_table.h"

namespace cellwarp::core
{

class NearNodes;

/// Where one region's correction acts. Immutable.
class RegionFade
{
public:
    /// A place whose motion is known, and the cell that holds it.
    struct Node
    {
        Eigen::Vector3d place;
        int cell;
    };

    /// \p samples: those of the region. \p further: other places that move with it, at
    /// its border; such as coincide with others, up to rounding, are left out. \pre
    /// samples is not empty
    RegionFade(const Cells& cells, std::span<const Node> samples,
               std::span<const Node> further);
    /// One that was built before, from what it tells.
    RegionFade(const Cells& cells, const std::vector<Node>& nodes,
               std::vector<int> near_cells, double radius);

    /// The distinct places, and the cells that hold them.
    const std::vector<Eigen::Vector3d>& nodes() const { return tree_.points(); }
    const std::vector<int>& node_cells() const { return node_cells_; }

    /// Nodes of an average: on a regular lattice a point has up to eight equally near
    /// ones, and the weights need one farther.
    static constexpr std::size_t kNearest = 16;
    /// The nearest nodes of a point, nearest first, of equally near ones the first node
    /// first; fewer where there are fewer.
    struct Nearest
    {
        std::array<PointTree::Neighbour, kNearest> nodes;
        std::size_t count = 0;
        std::vector<PointTree::Neighbour> found; ///< scratch
        std::vector<double> squares;             ///< likewise
        /// Likewise, of nodes that may be among the nearest: squared distances, which
        /// nodes they are, and how many are nearer.
        std::vector<double> few;
        std::vector<std::uint32_t> few_nodes;
        std::vector<std::int64_t> ranks;

        std::span<const PointTree::Neighbour> all() const
        {
            return std::span(nodes).first(count);
        }
    };

    /// How much the correction counts at a point: 1 at the nodes with a slope of 0,
    /// then falling (twice continuously differentiable in the distance) to 0.
    struct Weight
    {
        double value = 0.0;
        Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
        bool is_node = false; ///< the point is a node
    };
    /// \p of_cells: the weights of ClosestCells at \p x, with their gradient, of the near
    /// cells together: the correction reaches only these. \p near: a shorter way to the
    /// nodes, or null. Where it counts, \p nearest is replaced.
    Weight weight(const Eigen::Vector3d& x, const Weight& of_cells, const NearNodes* near,
                  Nearest& nearest) const;

    /// A node near a point, and how much of the average there it makes.
    struct NodeShare
    {
        std::size_t node = 0;
        double value = 0.0;
        Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    };
    /// All that the average at a point takes from the place of the point. What a node
    /// tells there is its value + slope * (its slope) (point - node).
    struct NodeShares
    {
        std::vector<NodeShare> nodes;
        double slope = 0.0;
        Eigen::Vector3d slope_gradient = Eigen::Vector3d::Zero();
    };
    /// The nearest nodes, so weighted that the average is continuous. Slopes reach a
    /// cell far. Replaces \p out.
    void node_shares(const Eigen::Vector3d& x, const Nearest& nearest,
                     NodeShares& out) const;

    /// The values and slopes of the nodes carried to \p x, whose shares these are. The
    /// gradient is left 0 unless it is wanted.
    FieldValue average(const Eigen::Vector3d& x, const NodeShares& shares,
                       std::span<const FieldValue> node_values,
                       bool wants_gradient = true) const;

    /// The value alone, to the same bits: faster.
    Eigen::Vector3d average_displacement(const Eigen::Vector3d& x, const Nearest& nearest,
                                         std::span<const FieldValue> node_values) const;

    double radius() const { return radius_; }
    /// The cells that the correction may reach, ascending.
    const std::vector<int>& near_cells() const { return near_cells_; }
    /// Those in whose box it counts somewhere, ascending.
    const std::vector<int>& touched_cells() const { return touched_cells_; }
    /// No node farther than this from \p x is in the average at a point that is no
    /// farther than \p away from \p x.
    double reach_of_average(const Eigen::Vector3d& x, double away) const;

private:
    friend class NearNodes;
    RegionFade(const Cells& cells, double edge, const std::vector<Node>& nodes);
    void find_touched(const Cells& cells);
    void find_nearest(const Eigen::Vector3d& x, Nearest& out) const;

    PointTree tree_;
    std::vector<int> node_cells_;
    std::vector<int> near_cells_, touched_cells_; ///< ascending
    double radius_ = 0.0;
};

/// The nodes of a fade that may be among the nearest ones of points in a box: where there
/// are many such points these are found among them sooner than in the tree of all.
class NearNodes
{
public:
    /// \p num_points: so many will be asked for in the box.
    NearNodes(const RegionFade& fade, const Eigen::AlignedBox3d& box,
              std::size_t num_points);
    /// Whether nearest() tells of a point: it is in the box, and the box has not too
    /// many.
    bool may_tell_of(const Eigen::Vector3d& x) const
    {
        return is_worth_it_ && box_.contains(x);
    }
    /// What the tree tells, to the bit; nothing is told where no node is nearer than
    /// \p radius. False: only the tree can tell.
    bool nearest(const Eigen::Vector3d& x, double radius, RegionFade::Nearest& out) const;
    std::size_t num_bytes() const;

private:
    double reach_of(const Eigen::Vector3d& x) const;

    Eigen::AlignedBox3d box_;
    bool is_worth_it_ = false;
    Eigen::Vector3d middle_;
    double last_of_middle_ = 0.0;      ///< distance of the last of its own nearest nodes
    std::vector<std::uint32_t> nodes_; ///< by their distance from the middle
    std::vector<double> away_;         ///< that of every kPlaceLanes-th
    std::vector<double>
        places_; ///< rows x, y, z, in blocks of kPlaceLanes, padded with infinity
};

/// NearNodes of several regions for one box after the other.
class NearNodesOfRegions
{
public:
    /// \p num_points: that will be asked for in this box.
    void enter(const Eigen::AlignedBox3d& box, std::size_t num_points);
    /// Unless it is there, or the tree is as fast.
    void make(int region, const RegionFade& fade);
    /// Null where none was made.
    const NearNodes* of(int region) const;
    std::size_t num_bytes() const;

private:
    Eigen::AlignedBox3d box_;
    std::size_t num_points_ = 0;
    std::vector<std::pair<int, NearNodes>> of_region_;
};

/// What a motion does to a point, as the value of a field.
FieldValue moved_by(const Motion& motion, const Eigen::Vector3d& x);

/// A region in one frame: its motion, and by how much the field misses it. The samples of
/// a loose part beside other parts are one, too: the fields of those parts move them.
struct MovedRegion
{
    const RegionFade* fade = nullptr;
    Motion motion;
    bool may_turn = false; ///< a pin: the motion tells where nodes go, not how they turn
    /// A rod or samples of a loose part: each node has a motion of its own.
    bool bends = false;
    std::vector<Motion> node_motions = {}; ///< of a rod, for FieldFitter
    /// For FieldFitter: a node of a loose part moves as the field does in the material of
    /// this cell. Empty: no loose part.
    std::vector<int> leading_cells = {};
    /// Loose parts only: it is above the ranks of the loose parts that lead this one,
    /// which are corrected first.
    int rank = 0;
    std::vector<FieldValue> misses = {}; ///< one a node: motion minus field
    /// Cells, ascending, in which the field is the motion, up to rounding, and no
    /// correction counts.
    std::vector<int> deep_cells = {};
};

/// The fades of all regions, found by the cells that they reach.
class RegionFades
{
public:
    RegionFades() = default;
    /// Keeps the pointers.
    RegionFades(std::vector<const RegionFade*> fades, std::size_t num_cells);

    /// How much the miss of one region counts at a point.
    struct Share
    {
        int region = 0;
        double value = 0.0;
        Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
        std::size_t nearest = 0; ///< among those of Reach
    };
    /// What the regions mean for a point: it is a node of one, or takes shares.
    struct Reach
    {
        int node_of = -1;
        std::size_t nearest_of_node = 0; ///< among nearest
        std::vector<Share> shares;
        std::vector<RegionFade::Nearest> nearest; ///< more than are used

        /// A region, and what the cells near it weigh together at the point.
        struct Near
        {
            int region = 0;
            RegionFade::Weight weight;
            std::size_t num_cells = 0;
        };
        std::vector<Near> near; ///< scratch
    };
    /// \p influences: of ClosestCells at \p x. \p near: shorter ways to the nodes.
    /// Replaces \p out.
    void reach(const Eigen::Vector3d& x, std::span<const Influence> influences,
               const NearNodesOfRegions& near, Reach& out) const;
    /// Makes the shorter ways that reach() may use, for the regions near some cells.
    template <class Cells>
    void make_ways(const Cells& cells, NearNodesOfRegions& near) const
    {
        for (const int cell : cells)
            for (const int region : regions_of_cell_[idx(cell)])
                near.make(region, fade(region));
    }

    const RegionFade& fade(int region) const { return *fades_[idx(region)]; }

private:
    std::vector<const RegionFade*> fades_;
    std::vector<std::vector<int>> regions_of_cell_;
};

/// All regions of a frame.
class MovedRegions
{
public:
    MovedRegions() = default;
    /// \p regions must outlive this.
    MovedRegions(std::span<const MovedRegion> regions, std::size_t num_cells);
    MovedRegions(std::vector<MovedRegion>&& regions, std::size_t num_cells) = delete;

    struct Scratch
    {
        RegionFades::Reach reach;
        RegionFade::NodeShares shares;
    };
    /// Corrects the field's \p value at \p x for the regions around \p x. At a node it
    /// is the region's motion to the bit. \p near: shorter ways to the nodes.
    void correct(const Eigen::Vector3d& x, std::span<const Influence> influences,
                 const NearNodesOfRegions& near, bool wants_gradient, Scratch& scratch,
                 FieldValue& value) const;

    const RegionFades& fades() const { return fades_; }
    /// Whether a correction counts somewhere in the box of a cell.
    bool touches(int cell) const { return is_touched_[idx(cell)]; }
    /// The region that \p x, in the material of a cell, moves with because it is one of
    /// its nodes, and turns with; null where only correct() tells.
    const MovedRegion* region_of_node(const Eigen::Vector3d& x, int cell) const
    {
        const int region = nodes_.region_at(x, cell);
        return region < 0 ? nullptr : &regions_[idx(region)];
    }
    /// The region in which a cell is deep; null: none.
    const MovedRegion* deep_region(int cell) const
    {
        const int region = deep_region_[idx(cell)];
        return region < 0 ? nullptr : &regions_[idx(region)];
    }

private:
    std::span<const MovedRegion> regions_;
    RegionFades fades_;
    NodeTable nodes_;              ///< of cells that are not deep in a region
    std::vector<char> is_touched_; ///< a cell
    std::vector<int> deep_region_; ///< a cell; -1: none
};

} // namespace cellwarp::core
