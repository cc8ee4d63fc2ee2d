// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/deform.h>

#include <algorithm>

#include "io/base/text.h"
#include "io/formats/geometry_output.h"
#include "library/access.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/session/pass_through.h"
#include "library/session/volume.h"
#include "library/session_calls.h"

namespace cellwarp
{

Deformed::Deformed(std::shared_ptr<const Data> data) : data_(std::move(data)) {}

std::span<const double> Deformed::samples() const
{
    return numbers_of(data_->samples->samples);
}

std::span<const double> Deformed::normals() const
{
    return numbers_of(data_->samples->directions);
}

std::span<const double> Deformed::tangents() const
{
    return numbers_of(data_->samples->tangents);
}

std::span<const double> Deformed::rotations() const
{
    return numbers_of(data_->samples->rotations);
}

bool Result::is_converged() const
{
    return std::all_of(frames.begin(), frames.end(),
                       [](const FrameReport& frame) { return frame.is_converged(); });
}

Result deform(const Model& model, const Edit& edit, const Settings& settings,
              const Control& control)
{
    core::SessionSettings of_session = run_call([&] { return to_core(settings); });
    return run_call(control, settings.threads,
                    [&](Watcher& watcher)
                    {
                        const std::size_t num_frames = edit.num_frames();
                        FrameWatch watch(watcher, num_frames);
                        watch.attach(of_session);
                        core::Session session(geometry_of(Access::file(model)),
                                              Access::handles(edit),
                                              std::move(of_session));
                        for (std::size_t left = num_frames; left > 0; --left)
                            watch.next_frame(session, left == 1);
                        Result result{Access::deformed(session.shared_deformed()),
                                      {},
                                      from_core(session.rods()),
                                      from_core(session.joints()),
                                      session.warnings()};
                        for (const core::FrameReport& report : session.frames())
                        {
                            result.frames.push_back(from_core(report));
                            for (std::string& warning : convergence_warnings(report))
                                result.warnings.push_back(std::move(warning));
                        }
                        return result;
                    });
}

namespace
{

/// Throws Fault::Usage for samples of another model.
void check_same_model(const Model& model, const Deformed& deformed)
{
    if (Access::samples(deformed).samples.size() != model.num_samples())
        throw wrong_argument("deformed",
                             "it is of another model: the samples are " +
                                 std::to_string(deformed.samples().size() / 3) +
                                 ", not " + std::to_string(model.num_samples()));
}

} // namespace

std::optional<Volume> volume_of(const Model& model, const Deformed& deformed)
{
    return run_call(
        [&]() -> std::optional<Volume>
        {
            check_same_model(model, deformed);
            const std::optional<core::Volume> volume = core::enclosed_volumes(
                Access::geometry(model), Access::samples(deformed).samples);
            if (!volume)
                return std::nullopt;
            return Volume{volume->before, volume->after};
        });
}

std::optional<SelfIntersections> self_intersections_of(const Model& model,
                                                       const Deformed& deformed,
                                                       const Control& control)
{
    return run_call(
        control, 0,
        [&](Watcher& watcher) -> std::optional<SelfIntersections>
        {
            watcher.begin("samples", 0.0);
            check_same_model(model, deformed);
            core::PassThroughOptions options;
            options.counts_rest = true;
            const core::PassThrough seen = core::pass_through(
                Access::geometry(model), Access::samples(deformed).samples, options);
            if (!seen.now || !seen.rest)
                return std::nullopt;
            return SelfIntersections{static_cast<std::size_t>(seen.rest->all),
                                     static_cast<std::size_t>(seen.now->all),
                                     static_cast<std::size_t>(seen.now->fresh)};
        });
}

namespace
{

void write_samples(const std::string& path, const Model& model,
                   const core::DeformedSamples& samples, Overwrite overwrite)
{
    run_call(
        [&]
        {
            const core::GeometryFile& file = *Access::file(model);
            core::check_output_format(path, file.geometry.format, core::Conversion::Yes);
            if (!file.geometry.not_writable.empty() &&
                !core::is_written_plain(path, file.geometry.format))
                throw core::malformed({file.path, 0, ""},
                                      "cannot be written: " + file.geometry.not_writable);
            const core::Overwrite to =
                overwrite == Overwrite::Yes ? core::Overwrite::Yes : core::Overwrite::No;
            core::check_output(path, to);
            core::check_geometry_output(path, file, to);
            core::write_geometry(path, file, samples, to);
        });
}

} // namespace

void write(const std::string& path, const Model& model, const Deformed& deformed,
           Overwrite overwrite)
{
    check_same_model(model, deformed);
    write_samples(path, model, Access::samples(deformed), overwrite);
}

void write(const std::string& path, const Model& model, Overwrite overwrite)
{
    const core::Geometry& geometry = Access::geometry(model);
    core::DeformedSamples rest{
        geometry.samples, {}, geometry.tangents, geometry.rotations};
    for (const core::DirectionUse& use : direction_uses(geometry))
        rest.directions.push_back(geometry.directions[use.direction]);
    write_samples(path, model, rest, overwrite);
}

} // namespace cellwarp
