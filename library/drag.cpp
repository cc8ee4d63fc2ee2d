// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/drag.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>

#include "library/access.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/session/prepared_drag.h"
#include "library/views.h"
#include "octree/base/index.h"

namespace cellwarp
{

namespace
{

/// The motion of the work's space for one of the model's.
core::Motion work_motion(const core::WorkFrame& frame, const Eigen::Matrix4d& matrix)
{
    const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
    const Eigen::Vector3d t = matrix.topRightCorner<3, 1>();
    return {frame.rotation_to_work(R), frame.to_work(R * frame.origin + t)};
}

/// Throws Fault::Usage for a matrix that is not rigid.
Eigen::Matrix4d rigid(const Mat4& matrix)
{
    constexpr double kRigid = 1e-4;
    const Eigen::Matrix4d out = to_eigen(matrix);
    if (!out.allFinite())
        throw wrong_argument("motion", "it has numbers that are not finite");
    if (out.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
        throw wrong_argument("motion", "its last row is not 0 0 0 1");
    const Eigen::Matrix3d R = out.topLeftCorner<3, 3>();
    if (!((R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <=
          kRigid) ||
        !(R.determinant() > 0))
        throw wrong_argument("motion", "it is no rotation and translation");
    return out;
}

} // namespace

struct Drag::State
{
    explicit State(core::PreparedDrag made)
        : prepared(std::move(made)), motions(prepared.drag->system().motions()),
          is_moved(motions.size(), 0)
    {
    }

    core::PreparedDrag prepared;
    std::vector<core::Motion> motions; ///< of the regions, from rest [work]
    std::vector<char> is_moved;        ///< by move()
    std::vector<Eigen::Vector3d> places;
    std::stop_source stop_refining;
    std::future<std::optional<core::PreparedDrag>> refining;
    std::atomic_flag busy;

    ~State()
    {
        stop_refining.request_stop(); // the future waits for its thread
    }

    const core::CellSystem& system() const { return prepared.drag->system(); }
    const core::WorkFrame& frame() const { return prepared.source.body->rest->frame; }
    const core::Region& region(std::size_t r) const
    {
        return prepared.source.regions->regions()[r];
    }
    void take_refined()
    {
        if (!refining.valid() ||
            refining.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
            return;
        std::optional<core::PreparedDrag> made;
        try
        {
            made = refining.get();
        }
        catch (const std::exception&)
        {
            // Smaller cells cannot be: these do.
        }
        if (made)
            prepared = std::move(*made);
    }
    /// Vectors in the order of the drag, into the caller's array.
    template <class ToModel>
    void copy(std::span<const float> numbers, std::span<const std::uint32_t> order,
              const PointsSpan& out, ToModel&& to_model)
    {
        check_view<3>(out, "out");
        const std::size_t count = prepared.source.rest->size();
        if (out.count != count)
            throw wrong_argument("out", "got " + std::to_string(out.count) +
                                            " vectors, need " + std::to_string(count));
        places.assign(count, Eigen::Vector3d::Zero());
        for (std::size_t k = 0; k < order.size(); ++k)
            places[order[k]] =
                to_model(Eigen::Vector3f(numbers.data() + 3 * k).template cast<double>());
        write_vectors<3>(places, 0, out);
    }
    template <class Work>
    auto look(Work&& work)
    {
        return run_call(
            [&]
            {
                const OneThread alone(busy);
                return work();
            });
    }
};

Drag::Drag(const Session& session, const Control& control)
    : state_(run_call(control, session.settings().threads,
                      [&](Watcher& watcher)
                      {
                          watcher.begin("cells", 0.0);
                          return std::make_unique<State>(
                              core::prepare_drag(Access::drag_source(session)));
                      }))
{
}

Drag::Drag(Drag&&) noexcept = default;
Drag& Drag::operator=(Drag&&) noexcept = default;
Drag::~Drag() = default;

void Drag::move(const std::string& name, const Mat4& motion)
{
    state_->look(
        [&]
        {
            const Eigen::Matrix4d matrix = rigid(motion);
            bool is_there = false;
            for (std::size_t r = 0; r < state_->motions.size(); ++r)
            {
                const core::Region& region = state_->region(r);
                if (region.name != name)
                    continue;
                if (region.role != core::Role::Handle && region.role != core::Role::Pin)
                    throw wrong_argument(name, "only a handle or a pin can be dragged");
                state_->motions[r] = work_motion(state_->frame(), matrix);
                state_->is_moved[r] = 1;
                is_there = true;
            }
            if (!is_there)
                throw wrong_argument(name, "no region has this name");
        });
}

DragFrame Drag::frame(int iterations)
{
    return state_->look(
        [&]
        {
            constexpr int kMost = 1000;
            if (iterations < 1 || iterations > kMost)
                throw wrong_argument("iterations", "got " + std::to_string(iterations) +
                                                       ", need 1 to 1000");
            state_->take_refined();
            core::DragReport report;
            const int rounds = (iterations + 1) / 2; // a frame of the drag takes two
            for (int round = 0; round < rounds; ++round)
            {
                const core::DragReport last =
                    state_->prepared.drag->frame(state_->motions);
                report.solve = last.solve;
                report.solve_ms += last.solve_ms;
                report.blend_ms += last.blend_ms;
                if (last.solve.stop == core::Stop::Converged)
                    break;
            }
            return DragFrame{from_core(report.solve.stop), report.solve_ms,
                             report.blend_ms, state_->prepared.source.body->cells.size()};
        });
}

void Drag::refine()
{
    state_->look(
        [&]
        {
            if (state_->refining.valid())
                return;
            state_->refining = std::async(std::launch::async,
                                          [source = state_->prepared.source,
                                           at = state_->system().state(),
                                           stop = state_->stop_refining.get_token()]
                                          {
                                              const core::StopOnRequest scope(stop);
                                              return core::refined(source, at);
                                          });
        });
}

void Drag::copy_samples(PointsSpan out) const
{
    state_->look(
        [&]
        {
            const core::SampleBlend& samples = state_->prepared.drag->samples();
            state_->copy(samples.positions(), samples.order(), out,
                         [&](const Eigen::Vector3d& x)
                         { return state_->frame().to_model(x); });
        });
}

void Drag::copy_normals(PointsSpan out) const
{
    state_->look(
        [&]
        {
            const core::SampleBlend& samples = state_->prepared.drag->samples();
            state_->copy(samples.normals(), samples.normal_order(), out,
                         [&](const Eigen::Vector3d& normal) -> Eigen::Vector3d
                         { return state_->frame().axes.transpose() * normal; });
        });
}

std::vector<std::pair<std::string, Operation>> Drag::moves() const
{
    return state_->look(
        [&]
        {
            std::vector<std::pair<std::string, Operation>> out;
            for (std::size_t r = 0; r < state_->motions.size(); ++r)
            {
                if (!state_->is_moved[r])
                    continue;
                const core::Region& region = state_->region(r);
                const core::Motion motion =
                    state_->frame().motion_to_model(state_->motions[r]);
                if (region.role == core::Role::Pin)
                {
                    const Eigen::Vector3d& centre = region.centre;
                    out.emplace_back(
                        region.name,
                        translate(from_eigen(Eigen::Vector3d(motion(centre) - centre))));
                    continue;
                }
                Eigen::Matrix4d whole = Eigen::Matrix4d::Identity();
                whole.topLeftCorner<3, 3>() = motion.R;
                whole.topRightCorner<3, 1>() = motion.t;
                out.emplace_back(region.name, matrix(from_eigen(whole)));
            }
            return out;
        });
}

} // namespace cellwarp
