// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/lazy_neighbours.h"

#include <chrono>
#include <utility>

namespace cellwarp::core
{

namespace
{

/// Up to so many samples it is done at once: a few milliseconds.
constexpr std::size_t kFoundAtOnce = 20'000;

std::unique_ptr<const Neighbours> find(std::shared_ptr<const GeometryFile> model)
{
    return std::make_unique<const Neighbours>(model->geometry, model->geometry.samples);
}

} // namespace

LazyNeighbours::LazyNeighbours(std::shared_ptr<const GeometryFile> model)
    : model_(std::move(model))
{
}

const Neighbours* LazyNeighbours::get()
{
    if (!neighbours_ && !next_.valid())
    {
        if (model_->geometry.samples.size() <= kFoundAtOnce)
            neighbours_ = find(model_);
        else
            next_ = std::async(std::launch::async, find, model_);
    }
    if (next_.valid() &&
        next_.wait_for(std::chrono::seconds(0)) == std::future_status::ready)
        neighbours_ = next_.get();
    return neighbours_.get();
}

void LazyNeighbours::wait()
{
    if (next_.valid())
        neighbours_ = next_.get();
}

} // namespace cellwarp::core
