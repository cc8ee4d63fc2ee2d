// SPDX-License-Identifier: GPL-3.0-or-later
// Flesh in real time beside the window: its bones go by the keys of the scene, or where
// the hand has them; it is pulled at any place.
#pragma once

#include <memory>
#include <string>

#include <Eigen/Core>

#include "editor/document/editing.h"
#include "editor/tools/interaction.h"

namespace cellwarp::core
{

class LiveFlesh final : public FleshPuller
{
public:
    /// Begins at frame 0 of a document as it is now. \pre Its scene has a time
    explicit LiveFlesh(const Editing& editing);
    /// Ends as soon as the step under way allows.
    ~LiveFlesh();

    /// What is to be seen now; null: nothing yet.
    std::shared_ptr<const ShownShape> newest() const;
    double time() const; ///< of it [s]
    /// Why there is nothing more; empty: it goes on.
    std::string error() const;

    void pull(const std::string& joint, const Eigen::Vector3d& place) override;
    void pull(std::uint32_t sample, const Eigen::Vector3d& place) override;
    void let_go() override;

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
