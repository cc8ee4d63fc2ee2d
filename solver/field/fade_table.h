// SPDX-License-Identifier: GPL-3.0-or-later
// The corrections of the regions (region_fade.h) at points known beforehand: sums over
// the nodes of what the field misses there.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/cells.h"
#include "solver/field/blend.h"
#include "solver/field/blend_kernel.h"
#include "solver/field/region_fade.h"

namespace cellwarp::core
{

/// The cells that count at a point, by either way of the blend.
class BlendInfluences
{
public:
    BlendInfluences(const Cells& cells, bool is_closest4);

    struct Found
    {
        std::vector<Influence> near;     ///< of ClosestCells: the regions ask for them
        std::vector<Influence> closest4; ///< empty if that is not the way
        std::span<const Influence> base; ///< the ones that the point follows
    };
    void find(const Eigen::Vector3d& x, int own, Found& out) const;

private:
    ClosestCells closest_;
    std::optional<Closest4> closest4_;
};

/// Displacement A x + b: of a cell, or of a region.
struct AffineMap
{
    Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
    Eigen::Vector3d b = Eigen::Vector3d::Zero();
};

/// A region whose motion its samples follow. Keeps the pointer.
struct FadedRegion
{
    const RegionFade* fade = nullptr;
    bool may_turn = false;  ///< a pin: the motion tells where nodes go, not how they turn
    std::vector<int> cells; ///< whose poses are always the ones that its motion carries
};

using FadeTerms = std::vector<FadeTerm>;

/// The nodes of all regions, numbered through, and what is missed there.
class FadeNodes
{
public:
    FadeNodes(const Cells& cells, const BlendInfluences& influences,
              std::span<const FadedRegion> regions);

    const RegionFades& fades() const { return fades_; }
    bool may_turn(int region) const { return regions_[idx(region)].may_turn; }

    /// Adds the terms of the correction at \p x, or of its slopes along \p directions,
    /// one list each. Left out are nodes at which nothing is ever missed, because all
    /// cells that count there follow the region.
    void add_terms(const Eigen::Vector3d& x, const RegionFades::Reach& reach,
                   FadeTerms& out) const;
    void add_slope_terms(const Eigen::Vector3d& x, const RegionFades::Reach& reach,
                         std::span<const Eigen::Vector3d> directions,
                         std::span<FadeTerms> out) const;

    /// Numbers the nodes of these terms, which are all that will be used, anew: what is
    /// used together is then beside each other.
    void tabulate(const BlendInfluences& influences,
                  std::span<const std::span<FadeTerm>> terms);

    /// \p maps: of the cells, then of the regions.
    void find_misses(std::span<const AffineMap> maps);
    std::span<const NodeMiss> misses() const { return misses_; }

private:
    /// add(node, share of its region, all node shares there, its own) for each node
    /// that matters at \p x.
    template <class Add>
    void for_each_node(const Eigen::Vector3d& x, const RegionFades::Reach& reach,
                       const Add& add) const;

    std::vector<FadedRegion> regions_;
    RegionFades fades_;
    std::vector<std::size_t> first_node_; ///< of each region
    std::vector<Eigen::Vector3d> places_;
    std::vector<int> own_, region_of_node_;
    std::vector<char> follows_;
    std::vector<std::uint32_t> used_;
    std::vector<std::size_t> first_influence_; ///< of each used node
    std::vector<Influence> influences_;
    std::vector<NodeMiss> misses_;
};

/// Corrections as sums of terms, each for one lane of three rows. Lanes that are padding
/// have no terms.
class FadeSums
{
public:
    /// Terms of the next sum, of the next lane.
    void add(std::span<const FadeTerm> terms);
    void append(const FadeSums& other);
    std::size_t size() const { return first_term_.size() - 1; }
    std::span<FadeTerm> terms() { return terms_; }
    std::size_t bytes() const { return terms_.size() * sizeof(FadeTerm); }

    /// After the last sum: makes room for the results.
    void finish() { rows_.resize(size() / kLanes * 3); }
    void sum(std::span<const NodeMiss> misses, const BlendKernels& kernels);
    /// Three rows for kLanes sums.
    const Row* rows() const { return rows_.data(); }

private:
    std::vector<std::size_t> first_term_ = {0};
    FadeTerms terms_;
    std::vector<Row> rows_;
};

} // namespace cellwarp::core
