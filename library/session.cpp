// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/session.h>

#include <algorithm>
#include <atomic>

#include "library/access.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/session/session.h"
#include "library/session_calls.h"
#include "octree/base/index.h"

namespace cellwarp
{

struct Session::State
{
    State(Model of, Edit by, const Settings& with)
        : model(std::move(of)), edit(std::move(by)), settings(with)
    {
    }

    Model model;
    Edit edit;
    Settings settings;
    FrameWatch* watch = nullptr; ///< of the call that is under way
    std::optional<core::Session> session;
    std::vector<FrameReport> frames;
    mutable std::atomic_flag busy;

    /// Cells of the stage; throws Fault::Usage where there are none.
    const core::CellSystem& system() const
    {
        const core::CellSystem* const system = session->system();
        if (!system)
            throw Error(Fault::Usage, "the session has no cells until the next call of "
                                      "next() or set_edit()");
        return *system;
    }
    /// Forgets the reports of frames that are to be solved again.
    void trim_frames()
    {
        std::int64_t end = -1; // of the frames that stay
        if (const std::optional<std::int64_t> upcoming = session->upcoming_frame())
            end = *upcoming;
        else
            for (const core::Stage& stage : Access::handles(edit).stages)
                for (const core::FrameStatement& frame : stage.frames)
                    end = frame.number + 1;
        std::erase_if(frames,
                      [&](const FrameReport& report) { return report.frame >= end; });
    }
    /// Calls work(watch) as the only call of the session.
    template <class Work>
    auto call(const Control& control, Work&& work)
    {
        return run_call(control, settings.threads,
                        [&](Watcher& watcher)
                        {
                            const OneThread alone(busy);
                            FrameWatch of_call(watcher, session ? session->num_upcoming()
                                                                : edit.num_frames());
                            watch = &of_call;
                            struct End
                            {
                                FrameWatch*& watch;
                                ~End() { watch = nullptr; }
                            } const end{watch};
                            return work(of_call);
                        });
    }
    template <class Work>
    auto look(Work&& work) const
    {
        return run_call(
            [&]
            {
                const OneThread alone(busy);
                return work();
            });
    }
};

Session::Session(Model model, Edit edit, Settings settings, const Control& control)
    : state_(std::make_unique<State>(std::move(model), std::move(edit), settings))
{
    core::SessionSettings of_session = run_call([&] { return to_core(settings); });
    of_session.keeps_checkpoints = of_session.keeps_fields = true;
    of_session.watch = [state = state_.get()](const core::FrameProgress& now)
    {
        if (state->watch)
            state->watch->see(now);
    };
    state_->call(control,
                 [&](FrameWatch&)
                 {
                     state_->session.emplace(geometry_of(Access::file(state_->model)),
                                             Access::handles(state_->edit),
                                             std::move(of_session));
                 });
}

Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;
Session::~Session() = default;

const Model& Session::model() const
{
    return state_->model;
}

const Edit& Session::edit() const
{
    return state_->edit;
}

const Settings& Session::settings() const
{
    return state_->settings;
}

bool Session::next(bool wants_samples, const Control& control)
{
    return state_->call(control,
                        [&](FrameWatch& watch)
                        {
                            core::Session& session = *state_->session;
                            if (!watch.next_frame(session, wants_samples))
                                return false;
                            state_->frames.push_back(from_core(session.frames().back()));
                            return true;
                        });
}

std::optional<std::int64_t> Session::upcoming() const
{
    return state_->look([&] { return state_->session->upcoming_frame(); });
}

std::size_t Session::num_upcoming() const
{
    return state_->look([&] { return state_->session->num_upcoming(); });
}

void Session::set_edit(Edit edit, const Control& control)
{
    state_->call(control,
                 [&](FrameWatch&)
                 {
                     state_->session->set_script(Access::handles(edit));
                     state_->edit = std::move(edit);
                     state_->trim_frames();
                 });
}

Deformed Session::deformed() const
{
    return state_->look([&]
                        { return Access::deformed(state_->session->shared_deformed()); });
}

const std::vector<FrameReport>& Session::frames() const
{
    return state_->frames;
}

const std::vector<std::string>& Session::warnings() const
{
    return state_->session->warnings();
}

std::vector<RodReport> Session::rods() const
{
    return state_->look([&] { return from_core(state_->session->rods()); });
}

std::vector<PosedJoint> Session::joints() const
{
    return state_->look([&] { return from_core(state_->session->joints()); });
}

std::map<std::string, Vec3> Session::borders() const
{
    return state_->look(
        [&]
        {
            state_->system();
            std::map<std::string, Vec3> borders;
            for (const auto& [name, place] : state_->session->borders())
                borders.emplace(name, from_eigen(place));
            return borders;
        });
}

Field Session::field() const
{
    return state_->look(
        [&]
        {
            if (!state_->session->field())
                throw Error(Fault::Usage,
                            "there is no field: no frame has moved the samples");
            return Access::field(state_->session->field_file());
        });
}

Cells Session::cells() const
{
    return state_->look(
        [&]
        {
            const core::CellSystem& system = state_->system();
            const core::Body& body = system.body();
            const core::WorkFrame& frame = system.rest().frame;
            // Statements of one name are one region.
            const std::vector<std::string> names = state_->edit.regions();
            std::vector<std::int32_t> numbers;
            for (const core::Region& region : system.regions().regions())
            {
                const auto found = std::find(names.begin(), names.end(), region.name);
                numbers.push_back(found == names.end()
                                      ? -1
                                      : static_cast<std::int32_t>(found - names.begin()));
            }
            Cells cells;
            for (std::size_t c = 0; c < body.cells.size(); ++c)
            {
                const core::Cell& cell = body.cells.cells[c];
                for (unsigned k = 0; k < 8; ++k)
                {
                    const Eigen::Vector3d side(k & 1 ? 0.5 : -0.5, k & 2 ? 0.5 : -0.5,
                                               k & 4 ? 0.5 : -0.5);
                    const Eigen::Vector3d corner =
                        frame.to_model(core::image(system.poses()[c], cell.centre,
                                                   cell.box_centre + cell.edge * side));
                    cells.corners.insert(cells.corners.end(), corner.begin(),
                                         corner.end());
                }
                const int region = system.region_of_cell()[c];
                cells.regions.push_back(region < 0 ? -1 : numbers[core::idx(region)]);
                cells.depths.push_back(body.octree[cell.leaf].level);
            }
            return cells;
        });
}

core::DragSource Access::drag_source(const Session& session)
{
    const Session::State& state = *session.state_;
    return state.look(
        [&]
        {
            const core::CellSystem& system = state.system();
            Settings preview = state.settings;
            preview.field = FieldKind::Blend;
            core::SessionSettings settings = to_core(preview);
            return core::DragSource{
                file(state.model),
                std::make_shared<const std::vector<Eigen::Vector3d>>(
                    state.session->rest_samples()),
                system.shared_body(),
                system.shared_regions(),
                system.state(),
                state.session->refiner(),
                {settings.cells.max_memory, settings.method, settings.departures},
                settings.field.kind,
                system.rest().frame,
                state.session->stage_fingerprint()};
        });
}

} // namespace cellwarp
