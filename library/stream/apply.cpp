// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/stream/apply.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <filesystem>
#include <mutex>
#include <new>
#include <system_error>
#include <thread>

#include <fmt/format.h>

#include "io/base/number.h"
#include "library/stream/manifest.h"
#include "octree/base/clock.h"
#include "octree/base/parallel.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

namespace
{

/// A part is in memory as it is read, moved and written, each time as text and as doubles
/// [byte per byte of the part].
constexpr double kBytesPerPartByte = 30.0;
/// Of a record that a file larger than memory sorts, in a run and in what merges them
/// [byte].
constexpr double kBytesPerRecord = 48.0;
constexpr std::size_t kLeastPart = std::size_t(1) << 16, kLeastRecords = 1 << 14;

/// All parts together, and one of them, where there is no budget [byte]. In a long part
/// more points lie in one cell, and share the search for what is around it.
constexpr std::size_t kAllParts = std::size_t(1) << 22;
constexpr std::size_t kShortPart = std::size_t(1) << 19, kLongPart = std::size_t(1) << 20;

/// Sizes of what is in memory at once: enough for every thread to have a part and the
/// next one, and no more; less where the budget says so.
void set_sizes(const ApplySettings& settings, StreamOptions& options)
{
    constexpr unsigned kMost = 32;
    const unsigned threads = settings.threads > 0
                                 ? static_cast<unsigned>(settings.threads)
                                 : std::thread::hardware_concurrency();
    const unsigned jobs = static_cast<unsigned>(std::max(1, settings.jobs));
    options.parts_at_once = std::clamp(2 * threads / jobs, 2u, kMost);
    options.part_bytes =
        std::clamp(kAllParts / options.parts_at_once, kShortPart, kLongPart);
    if (!(settings.max_memory > 0))
        return;
    const double share = settings.max_memory / jobs;
    const auto bytes = [&]
    {
        return kBytesPerPartByte * static_cast<double>(options.part_bytes) *
                   static_cast<double>(options.parts_at_once) +
               kBytesPerRecord * static_cast<double>(options.sort_records);
    };
    while (bytes() > share && options.sort_records > kLeastRecords)
        options.sort_records /= 2;
    while (bytes() > share && options.parts_at_once > 2)
        --options.parts_at_once;
    while (bytes() > share && options.part_bytes > kLeastPart)
        options.part_bytes /= 2;
    if (bytes() > share)
        throw Error(Fault::Budget,
                    fmt::format("{} file(s) at once need about {} beyond the field "
                                "(limit {})",
                                jobs, in_bytes(jobs * bytes()),
                                in_bytes(settings.max_memory)));
    options.max_whole_memory = share;
}

StreamReport stream_file(const Deformation& deformation, const BatchFile& file,
                         const ApplySettings& settings, OutputSet& outputs,
                         std::stop_token stop, const std::function<void(double)>& watch)
{
    StreamOptions options;
    options.format = settings.format;
    options.read = settings.read;
    set_sizes(settings, options);
    StreamWork work;
    std::atomic<std::uint64_t> num_outside = 0;
    work.move = [&](const PartMotion& motion)
    {
        const StopOnRequest scope(stop);
        try
        {
            if (motion.is_first)
                num_outside += deformation.num_outside(motion.samples);
            deformation.carry({motion.samples,
                               {motion.direction_samples, motion.directions},
                               {motion.tangent_samples, motion.tangents},
                               {motion.rotation_samples, motion.rotations}});
        }
        catch (const Stopped&)
        {
            // The stream looks at the request too, and leaves no output.
        }
    };
    work.run = [](std::size_t count, const std::function<void(std::size_t)>& job)
    { parallel_for(count, job); };
    work.progress = watch;
    work.stop = stop;
    StreamReport report =
        stream_geometry(file.input, file.output, outputs, options, work);
    if (num_outside > 0)
        report.warnings.push_back(
            fmt::format("{}: {} of {} points lie outside the box of the model that the "
                        "field was made with: no material there tells where they go",
                        file.input == "-" ? "stdin" : file.input, num_outside.load(),
                        report.samples));
    return report;
}

/// The files of a batch, taken one after the other by every job.
class Batch
{
public:
    Batch(const Deformation& deformation, const std::vector<BatchFile>& files,
          const std::string& manifest, const ApplySettings& settings);
    std::vector<FileReport> run();

private:
    bool is_done(const BatchFile& file) const;
    void work();
    void apply(std::size_t i);
    void show(std::size_t i, double done);

    const Deformation& deformation_;
    const std::vector<BatchFile>& files_;
    const ApplySettings& settings_;
    std::string field_;
    std::vector<FileReport> reports_;
    std::optional<Manifest> manifest_;
    std::atomic<std::size_t> next_ = 0;
    std::stop_source stop_;
    std::mutex mutex_; ///< of what follows
    std::vector<double> done_;
    std::exception_ptr error_; ///< that ends the batch
};

Batch::Batch(const Deformation& deformation, const std::vector<BatchFile>& files,
             const std::string& manifest, const ApplySettings& settings)
    : deformation_(deformation), files_(files), settings_(settings),
      field_(fmt::format("{:08x} {} {}", deformation.checksum(), settings.format,
                         settings.read.columns)),
      reports_(files.size()), done_(files.size(), 0.0)
{
    StreamOptions unused;
    set_sizes(settings, unused); // over the budget, nothing is begun
    manifest_.emplace(manifest);
    for (std::size_t i = 0; i < files.size(); ++i)
    {
        const bool is_ours = settings.resumes && manifest_->find(files[i].input);
        if (settings.resumes && is_done(files[i]))
            reports_[i].status = FileStatus::Skipped;
        else
            check_output(files[i].output, is_ours ? Overwrite::Yes : settings.overwrite);
    }
}

bool Batch::is_done(const BatchFile& file) const
{
    const ManifestLine* const line = manifest_->find(file.input);
    std::error_code missing;
    return line && line->status == "done" && line->mark == mark_of(file.input, field_) &&
           std::filesystem::file_size(file.output, missing) == line->output_bytes &&
           !missing;
}

void Batch::show(std::size_t i, double done)
{
    if (!settings_.watch)
        return;
    const std::lock_guard lock(mutex_);
    done_[i] = done;
    double sum = 0.0;
    for (const double share : done_)
        sum += share;
    settings_.watch(sum / static_cast<double>(done_.size()), files_[i].input);
}

void Batch::apply(std::size_t i)
{
    const BatchFile& file = files_[i];
    FileReport& report = reports_[i];
    if (report.status == FileStatus::Skipped)
    {
        show(i, 1.0);
        return;
    }
    ManifestLine line{file.input, "started", 0, 0.0, 0, mark_of(file.input, field_), ""};
    manifest_->add(line);
    const bool is_ours = settings_.resumes && manifest_->find(file.input);
    const Clock::time_point start = Clock::now();
    report.status = FileStatus::Failed;
    try
    {
        OutputSet outputs(is_ours ? Overwrite::Yes : settings_.overwrite);
        report.stream =
            stream_file(deformation_, file, settings_, outputs, stop_.get_token(),
                        [&](double done) { show(i, done); });
        if (!report.stream.is_stopped)
            outputs.commit();
        report.status = report.stream.is_stopped ? FileStatus::Stopped : FileStatus::Done;
    }
    catch (const Error& error)
    {
        report.error = error;
    }
    catch (const std::bad_alloc&)
    {
        report.error.emplace(Fault::Budget, at({file.input, 0, ""}, "out of memory"));
    }
    report.seconds = seconds_since(start);
    show(i, 1.0);
    if (report.status == FileStatus::Stopped)
        return;
    line.status = report.status == FileStatus::Done ? "done" : "failed";
    line.samples = report.stream.samples;
    line.seconds = report.seconds;
    line.output_bytes = report.stream.bytes;
    line.message = report.error ? report.error->what() : "";
    manifest_->add(line);
    if (report.status == FileStatus::Failed && settings_.fails_fast)
        stop_.request_stop();
}

void Batch::work()
{
    try
    {
        for (std::size_t i = next_++; i < files_.size() && !stop_.stop_requested();
             i = next_++)
            apply(i);
    }
    catch (...)
    {
        const std::lock_guard lock(mutex_);
        error_ = std::current_exception();
        stop_.request_stop();
    }
}

std::vector<FileReport> Batch::run()
{
    const std::stop_callback on_stop(settings_.stop, [&] { stop_.request_stop(); });
    {
        std::vector<std::jthread> jobs;
        try
        {
            for (int j = 1; j < settings_.jobs; ++j)
                jobs.emplace_back([&] { work(); });
        }
        catch (const std::system_error&)
        {
            // Fewer threads do the same.
        }
        work();
    }
    if (error_)
        std::rethrow_exception(error_);
    return std::move(reports_);
}

} // namespace

StreamReport apply_to_file(const Deformation& deformation, const std::string& input,
                           const std::string& output, OutputSet& outputs,
                           const ApplySettings& settings)
{
    return stream_file(deformation, {input, output}, settings, outputs, settings.stop,
                       [&](double done)
                       {
                           if (settings.watch)
                               settings.watch(done, input);
                       });
}

std::vector<FileReport> apply_to_batch(const Deformation& deformation,
                                       const std::vector<BatchFile>& files,
                                       const std::string& manifest,
                                       const ApplySettings& settings)
{
    return Batch(deformation, files, manifest, settings).run();
}

} // namespace cellwarp::core
