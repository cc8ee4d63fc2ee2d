// SPDX-License-Identifier: GPL-3.0-or-later
// A smooth map from the nodes of an octree's lattice to places in its cells: what is
// drawn of the flesh. Shares are found once; a frame is a sum over them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "octree/octree.h"
#include "solver/flesh/lattice.h"
#include "solver/flesh/sparse_rows.h"

namespace cellwarp::core
{

/// Continuous with its gradient through glued cells, also where these change their size;
/// exact for affine maps of the nodes, and for quadratic ones two cells away from the
/// border. A place has shares only of nodes that glue joins to its own cell. Immutable
/// once built, safe for many threads. smooth_map.cpp derives it.
class SmoothMap
{
public:
    struct Place
    {
        int cell = 0;
        Eigen::Vector3d local = Eigen::Vector3d::Zero(); ///< [0, 1] inside of the cell
    };
    struct Value
    {
        Eigen::Vector3d displacement = Eigen::Vector3d::Zero(); ///< [m]
        Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero(); ///< column k: along axis k
    };

    /// Some 1.2 kB and 15 us each while the map is built.
    static constexpr std::size_t kMostBoxes = 200'000;

    /// \p lattice: octree_lattice() of \p octree and \p cells. \p most_boxes: the grid of
    /// the map is as fine as the smallest cells, or as much coarser as this needs.
    SmoothMap(const Octree& octree, const Cells& cells, const Lattice& lattice,
              std::span<const Place> places, std::size_t most_boxes = kMostBoxes);

    /// Displacements and gradients at the places. \p u: displacements of the nodes, three
    /// numbers each [m]. The first places, as many as \p without, get no gradient (0).
    /// The bits do not depend on the number of threads.
    std::vector<Value> values(const Eigen::VectorXd& u, std::size_t without = 0) const;

private:
    friend class SmoothMapBuilder;
    /// The values around a node.
    using Slots = std::array<std::int32_t, 27>;
    /// Places that take from the same values.
    struct Stencil
    {
        Slots slots;
        std::size_t first_place = 0; ///< in places_
    };
    /// From the middle node of its stencil [edge], in [-0.5, 0.5] inside of the cell.
    struct PlaceInStencil
    {
        Eigen::Vector3d local;
        std::size_t number = 0; ///< as it was given
    };
    /// One of several maps that count at a place (smooth_map.cpp, "Forks").
    struct Term
    {
        Slots slots;
        Eigen::Vector3d local; ///< as of a place
        double weight = 1.0;
        Eigen::Vector3d slope = Eigen::Vector3d::Zero(); ///< of the weight [1 / edge]
    };
    struct ForkedPlace
    {
        std::size_t number = 0;
        std::vector<Term> terms;
    };

    std::size_t num_nodes_ = 0;
    double edge_ = 1.0; ///< of the map's grid [m]
    /// Values that follow those of the nodes; each takes of nodes and of those before it.
    SparseRows rows_;
    std::vector<Stencil> stencils_; ///< and one for their end
    std::vector<PlaceInStencil> places_;
    std::vector<ForkedPlace> forked_;
};

} // namespace cellwarp::core
