// SPDX-License-Identifier: GPL-3.0-or-later
// How well the glue carries from one cell to others at a place: a network of resistors.
// It knows nothing of cells and places; blend.cpp says what the resistances are.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace cellwarp::core
{

/// Nodes with a resistance each, some of them joined. A joint of two nodes resists as
/// much as the mean of theirs.
class GlueNetwork
{
public:
    explicit GlueNetwork(std::span<const double> resistances);

    void join(std::size_t a, std::size_t b);

    /// After the last join(): the node to which resistances are measured.
    /// \pre joints lead to it from every other node
    void solve_for(std::size_t ground);

    /// Between a node and the ground.
    double resistance_to(std::size_t node);
    /// The derivatives of the last resistance_to() by the nodes' resistances; all >= 0.
    std::span<const double> slopes() const { return slopes_; }

private:
    double& at(std::size_t a, std::size_t b) { return factors_[a * size() + b]; }
    std::size_t size() const { return resistances_.size(); }

    struct Joint
    {
        std::size_t a = 0, b = 0;
        double conductance = 0.0;
    };
    std::vector<double> resistances_;
    std::vector<Joint> joints_;
    std::vector<std::size_t> order_, place_; ///< of elimination; of each node in it
    std::vector<double> factors_, pivots_, potentials_, slopes_;
};

} // namespace cellwarp::core
