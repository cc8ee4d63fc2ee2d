// SPDX-License-Identifier: GPL-3.0-or-later
// Parts go through in batches: while one batch is scanned, moved and patched on all
// threads, one more thread writes the batch before and reads the one after.
#include "io/formats/stream.h"

#include <exception>
#include <filesystem>
#include <future>
#include <memory>
#include <optional>
#include <utility>

#include "io/base/error.h"
#include "io/base/text.h"
#include "io/formats/geometry_file.h"
#include "io/formats/gltf_stream.h"
#include "io/formats/obj_stream.h"
#include "io/formats/part_patch.h"
#include "io/formats/part_reader.h"
#include "io/formats/pcd.h"
#include "io/formats/pcd_stream.h"
#include "io/formats/stl.h"
#include "io/formats/stream_ranges.h"

namespace cellwarp::core
{

namespace
{

/// One part on its way.
struct MovingPart
{
    FilePart file;
    std::vector<Eigen::Vector3d> samples, directions, tangents;
    std::vector<Eigen::Vector4d> rotations;
    std::vector<IndexEdit> indices;
    std::string out;
    std::exception_ptr error;
};

struct Batch
{
    std::vector<MovingPart> parts;
    std::size_t count = 0;
    std::exception_ptr error; ///< of reading what comes after the parts
};

class Stream
{
public:
    Stream(const std::string& input, const std::string& output, OutputSet& outputs,
           const StreamOptions& options, const StreamWork& work);
    StreamReport run();

private:
    void read(Batch& batch);
    void move(MovingPart& part) const;
    void write(Batch& batch);
    void put(std::string_view bytes);
    StreamReport stopped();

    std::string path_, format_;
    const StreamOptions& options_;
    const StreamWork& work_;
    InputFile input_;
    OutputFile& output_;
    std::optional<NormalPlan> plan_;
    std::optional<PartReader> reader_;
    Geometry total_;
    std::string end_mark_;    ///< read, but not written yet
    std::uint64_t done_ = 0;  ///< [bytes] of the input, written
    bool has_failed_ = false; ///< to read; the parts before are still written
    StreamReport report_;
};

std::string format_of(const std::string& input, const StreamOptions& options)
{
    if (input == "-" && options.format.empty())
        throw Error(Fault::Usage, "stdin does not tell its format (need --format)");
    const std::string format =
        options.format.empty() ? extension_of(input) : options.format;
    if (!is_geometry_format(format))
        throw unknown_format(input);
    return format;
}

Stream::Stream(const std::string& input, const std::string& output, OutputSet& outputs,
               const StreamOptions& options, const StreamWork& work)
    : path_(input == "-" ? "stdin" : input), format_(format_of(input, options)),
      options_(options), work_(work), input_(input), output_(outputs.add(output))
{
    if (format_ == "obj" && input != "-" && may_use_normals(input_))
    {
        plan_.emplace(input_, path_, spill_folder(output), options, work);
        report_.num_split = plan_->num_split();
        input_.rewind();
    }
    reader_.emplace(input_, path_, format_, options.read, options.part_bytes);
}

void Stream::read(Batch& batch)
{
    batch.parts.resize(options_.parts_at_once);
    batch.count = 0;
    batch.error = nullptr;
    if (has_failed_)
        return;
    try
    {
        while (batch.count < batch.parts.size())
        {
            MovingPart& part = batch.parts[batch.count];
            part.error = nullptr;
            if (!reader_->next(part.file))
                return;
            const Geometry& geometry = part.file.geometry;
            if (plan_)
                plan_->take(geometry, part.directions, part.indices);
            else if (!geometry.corner_directions.empty())
                throw Error(Fault::Usage, at({path_, 0, ""},
                                             "its faces use normals (vn), so it is read "
                                             "twice (need a file, not stdin)"));
            ++batch.count;
        }
    }
    catch (...)
    {
        batch.error = std::current_exception();
        has_failed_ = true;
    }
}

void Stream::move(MovingPart& part) const
{
    scan_part(part.file);
    const Geometry& geometry = part.file.geometry;
    part.out.clear();
    if (geometry.samples.empty() && geometry.directions.empty() && part.indices.empty())
    {
        part.out.swap(part.file.bytes);
        return;
    }
    check_magnitude(path_, geometry);
    part.samples = geometry.samples;
    part.tangents = geometry.tangents;
    part.rotations = geometry.rotations;
    if (!plan_)
        part.directions = geometry.directions;
    // The normals of an STL follow from its corners, those of an OBJ from the plan.
    const bool turns_here = format_ != "stl" && format_ != "obj";
    work_.move({part.samples,
                turns_here ? std::span<const std::uint32_t>(geometry.direction_samples)
                           : std::span<const std::uint32_t>(),
                turns_here ? std::span<Eigen::Vector3d>(part.directions)
                           : std::span<Eigen::Vector3d>(),
                geometry.tangent_samples, part.tangents, geometry.rotation_samples,
                part.rotations});
    if (format_ == "stl")
        part.directions = facet_normals(geometry, part.samples);
    PatchedBytes(
        path_, part.file.bytes, part.file.start, geometry,
        {part.samples, part.directions, part.tangents, part.rotations, part.indices})
        .append_to(part.out);
}

void Stream::write(Batch& batch)
{
    const std::size_t count = std::exchange(batch.count, 0);
    for (std::size_t i = 0; i < count; ++i)
    {
        MovingPart& part = batch.parts[i];
        Geometry& geometry = part.file.geometry;
        if (part.error)
        {
            // Only here is it known how many samples came before.
            geometry.samples_before = total_.samples_before;
            check_magnitude(path_, geometry);
            std::rethrow_exception(part.error);
        }
        total_.samples_before += geometry.samples.size();
        total_.directions_before += geometry.directions.size();
        total_.num_bad_normals += geometry.num_bad_normals;
        total_.num_bad_rotations += geometry.num_bad_rotations;
        total_.num_missing += geometry.num_missing;
        // New lines come before what stands behind the last line end.
        put(std::exchange(end_mark_, {}));
        std::string_view out = part.out;
        if (plan_ && plan_->num_split() > 0)
            out = without_end_mark(out, part.file.start);
        put(out);
        end_mark_ = std::string_view(part.out).substr(out.size());
        done_ = part.file.start;
    }
    if (batch.error)
        std::rethrow_exception(batch.error);
}

void Stream::put(std::string_view bytes)
{
    output_.write(bytes);
    report_.bytes += bytes.size();
}

StreamReport Stream::run()
{
    const double share = plan_ ? 0.5 : 0.0, size = static_cast<double>(input_.size());
    if (work_.stop.stop_requested())
        return stopped();
    Batch reading, moving, writing;
    read(moving);
    while (moving.count > 0 || moving.error)
    {
        if (work_.stop.stop_requested())
            return stopped();
        // Where there is no thread left, it waits for get().
        std::future<void> files = std::async(std::launch::async | std::launch::deferred,
                                             [&]
                                             {
                                                 write(writing);
                                                 read(reading);
                                             });
        work_.run(moving.count,
                  [&](std::size_t i)
                  {
                      try
                      {
                          move(moving.parts[i]);
                      }
                      catch (...)
                      {
                          moving.parts[i].error = std::current_exception();
                      }
                  });
        files.get();
        std::swap(writing, moving);
        std::swap(moving, reading);
        if (work_.progress)
            work_.progress(share + (1.0 - share) * static_cast<double>(done_) / size);
    }
    if (work_.stop.stop_requested())
        return stopped();
    write(writing);
    reader_->finish(total_);
    if (plan_)
        plan_->write_lines(output_, report_.bytes);
    put(end_mark_);
    input_.check_unchanged();
    report_.samples = total_.samples_before;
    report_.warnings = std::move(total_.warnings);
    return std::move(report_);
}

StreamReport Stream::stopped()
{
    report_.is_stopped = true;
    return std::move(report_);
}

} // namespace

std::string spill_folder(const std::string& output)
{
    if (output != "-")
        return folder_of(output);
    std::error_code problem;
    const std::filesystem::path folder = std::filesystem::temp_directory_path(problem);
    if (problem)
        throw Error(Fault::File,
                    "the folder for temporary files (TMPDIR): " + problem.message());
    return folder.string();
}

StreamReport stream_geometry(const std::string& input, const std::string& output,
                             OutputSet& outputs, const StreamOptions& options,
                             const StreamWork& work)
{
    const std::string format = format_of(input, options);
    if (format == "gltf" || format == "glb")
        return stream_gltf(input, output, format, outputs, options, work);
    if (format == "pcd" && input != "-" && is_packed_pcd(InputFile(input)))
        return stream_packed_pcd(input, output, outputs, options, work);
    return Stream(input, output, outputs, options, work).run();
}

} // namespace cellwarp::core
