// SPDX-License-Identifier: GPL-3.0-or-later
// The shape while a region is dragged: a frame in milliseconds, approximately. The exact
// result comes from Session::set_edit() and next().
#pragma once

#include <cstddef>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <cellwarp/points.h>
#include <cellwarp/report.h>
#include <cellwarp/session.h>

namespace cellwarp
{

struct DragFrame
{
    Stop stop = Stop::NotRun; ///< Converged: further frames change nothing
    double solve_ms = 0.0, samples_ms = 0.0;
    std::size_t cells = 0;
};

/// Begins at the last frame of a session, which is not needed afterwards. One thread at a
/// time. With the same cells, frames after the first allocate nothing.
class CELLWARP_API Drag
{
public:
    explicit Drag(const Session& session, const Control& control = {});
    Drag(Drag&&) noexcept;
    Drag& operator=(Drag&&) noexcept;
    ~Drag();

    /// Motion of a handle or pin from rest [model unit]; other regions keep theirs. For a
    /// pin the motion of its place counts, or of the middle of its samples. Throws
    /// Fault::Usage for a region that is not there, and a matrix that is not rigid to
    /// 1e-4.
    void move(const std::string& region, const Mat4& motion);

    /// Goes on towards the minimum for at most \p iterations; two make a good frame.
    DragFrame frame(int iterations = 2);
    /// Makes smaller cells where the deformation wants them, in a thread of its own,
    /// while frames go on; frame() takes them when they are there. Meant for a hand that
    /// rests.
    void refine();

    /// Samples of the last frame, into the caller's floats or doubles [model unit].
    /// Throws Fault::Usage for another number of samples.
    void copy_samples(PointsSpan out) const;
    /// Unit normals of the samples; zero for a cloud.
    void copy_normals(PointsSpan out) const;

    /// Motions of the regions as operations for Edit::move().
    std::vector<std::pair<std::string, Operation>> moves() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp
