// SPDX-License-Identifier: GPL-3.0-or-later
// The neighbours of a model's samples, found in the background when they are first
// needed: of a million samples that takes half a second.
#pragma once

#include <future>
#include <memory>

#include "editor/document/neighbours.h"
#include "io/formats/geometry.h"

namespace cellwarp::core
{

class LazyNeighbours
{
public:
    explicit LazyNeighbours(std::shared_ptr<const GeometryFile> model);

    /// Null while they are not there; the first call begins.
    const Neighbours* get();
    void wait();

private:
    std::shared_ptr<const GeometryFile> model_;
    std::future<std::unique_ptr<const Neighbours>> next_;
    std::unique_ptr<const Neighbours> neighbours_;
};

} // namespace cellwarp::core
