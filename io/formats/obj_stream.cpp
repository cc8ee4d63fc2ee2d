// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/obj_stream.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <tuple>
#include <utility>

#include "io/formats/obj.h"

namespace cellwarp::core
{

namespace
{

/// Uses that are turned at once; each job takes a share.
constexpr std::size_t kTurnedAtOnce = std::size_t(1) << 16, kTurnedInAJob = 4096;

Eigen::Vector3d as_vector(const double (&x)[3])
{
    return {x[0], x[1], x[2]};
}

} // namespace

bool may_use_normals(InputFile& file)
{
    // "v//vn" and "v/vt/vn" have a slash, perhaps an index, a slash and an index.
    const auto is_index = [](char c)
    { return (c >= '0' && c <= '9') || c == '+' || c == '-'; };
    std::string block(std::size_t(1) << 18, '\0');
    int slashes = 0;
    bool is_found = false;
    while (const std::size_t got = is_found ? 0 : file.read(block.data(), block.size()))
    {
        const char* const end = block.data() + got;
        for (const char* at = block.data(); at < end && !is_found; ++at)
        {
            if (slashes == 0)
                at = std::find(at, end, '/');
            if (at == end)
                break;
            is_found = slashes == 2 && is_index(*at);
            slashes =
                *at == '/' ? std::min(2, slashes + 1) : slashes == 1 && is_index(*at);
        }
    }
    file.rewind();
    return is_found;
}

bool NormalPlan::Use::operator<(const Use& other) const
{
    return std::tie(direction, sample, corner) <
           std::tie(other.direction, other.sample, other.corner);
}

/// What the first reading finds.
struct NormalPlan::Read
{
    SpillList<Vector> samples, directions; ///< at rest
    SpillSorter<Use> uses;
    bool has_crlf = false;
    int direction_decimals = 0;
    char last = '\n'; ///< byte of the file

    Read(const std::string& folder, const StreamOptions& options)
        : samples(folder), directions(folder), uses(folder, options.sort_records)
    {
    }
};

NormalPlan::NormalPlan(InputFile& file, const std::string& path,
                       const std::string& folder, const StreamOptions& options,
                       const StreamWork& work)
    : directions_(folder), new_indices_(folder, options.sort_records), lines_(folder)
{
    Read found(folder, options);
    read(file, path, options, work, found);
    if (work.stop.stop_requested())
        return;
    turn(found, folder, options, work);
    next_direction_ = std::make_unique<SpillReader<Vector>>(directions_.reader());
    next_index_ = std::make_unique<SpillSorter<NewIndex>::Sorted>(new_indices_.sorted());
    has_index_ = next_index_->next(index_);
}

void NormalPlan::read(InputFile& file, const std::string& path,
                      const StreamOptions& options, const StreamWork& work, Read& found)
{
    PartReader reader(file, path, "obj", options.read, options.part_bytes);
    FilePart part;
    Geometry total;
    std::uint64_t corners = 0;
    while (!work.stop.stop_requested() && reader.next(part))
    {
        const Geometry& geometry = part.geometry;
        for (const Eigen::Vector3d& x : geometry.samples)
            found.samples.push({{x.x(), x.y(), x.z()}});
        found.direction_decimals =
            std::max(found.direction_decimals, geometry.direction_decimals);
        for (const Eigen::Vector3d& n : geometry.directions)
            found.directions.push({{n.x(), n.y(), n.z()}});
        for (std::size_t c = 0; c < geometry.corner_directions.size(); ++c)
            if (geometry.corner_directions[c] != kNone)
                found.uses.push(
                    {geometry.corner_directions[c], geometry.corners[c], corners++});
        found.has_crlf = found.has_crlf || part.bytes.find("\r\n") != std::string::npos;
        if (const std::string_view text = without_end_mark(part.bytes, part.start);
            !text.empty())
            found.last = text.back();
        total.samples_before = geometry.num_samples();
        total.directions_before = geometry.num_directions();
        if (work.progress)
            work.progress(0.5 * static_cast<double>(part.start) /
                          static_cast<double>(file.size()));
    }
    if (!work.stop.stop_requested())
        reader.finish(total);
}

void NormalPlan::turn(Read& found, const std::string& folder,
                      const StreamOptions& options, const StreamWork& work)
{
    // Uses are sorted by vn; their places are fetched in the order of the vertices, so
    // that every list is only ever read from its beginning to its end.
    // Uses of a vn that the file lacks come last, and are left out.
    const std::uint64_t num_directions = found.directions.size();
    SpillSorter<Placed> placed(folder, options.sort_records);
    {
        SpillSorter<Waiting> waiting(folder, options.sort_records);
        auto uses = found.uses.sorted();
        std::uint64_t num_uses = 0;
        Use last = {kNone, kNone, 0};
        for (Use use; uses.next(use) && use.direction < num_directions; last = use)
            if (use.direction != last.direction || use.sample != last.sample)
                waiting.push({use.sample, num_uses++});
        auto sorted = waiting.sorted();
        auto samples = found.samples.reader();
        Vector place = {};
        std::uint64_t num_read = 0;
        for (Waiting use; sorted.next(use);)
        {
            for (; num_read <= use.sample; ++num_read)
                samples.next(place);
            placed.push({use.use, {place.x[0], place.x[1], place.x[2]}});
        }
    }

    const std::string line_end = found.has_crlf ? "\r\n" : "\n";
    DirectionSplitter splitter(found.directions.size(), found.direction_decimals,
                               line_end);
    SpillList<std::uint32_t> index_of_use(folder);
    auto rest = found.directions.reader(), unused = found.directions.reader();
    auto places = placed.sorted();
    std::uint64_t num_rest = 0, num_ended = 0;
    Vector direction = {};
    std::vector<DirectionUse> batch;
    std::vector<Eigen::Vector3d> at, values, rest_values;
    std::vector<std::uint32_t> count(kTurnedInAJob);
    std::iota(count.begin(), count.end(), 0u);
    const auto end_until = [&](std::uint64_t end)
    {
        // A vn that no face uses stays as it is.
        for (Vector same; num_ended < end && unused.next(same); ++num_ended)
            directions_.push(same);
    };
    const auto turn_batch = [&]
    {
        work.run((batch.size() + kTurnedInAJob - 1) / kTurnedInAJob,
                 [&](std::size_t job)
                 {
                     const std::size_t first = job * kTurnedInAJob;
                     const std::size_t size =
                         std::min(kTurnedInAJob, batch.size() - first);
                     PartMotion motion{std::span(at).subspan(first, size),
                                       std::span(count).first(size),
                                       std::span(values).subspan(first, size)};
                     motion.is_first = false; // each comes in its place, too
                     work.move(motion);
                 });
        std::string lines;
        for (std::size_t i = 0; i < batch.size(); ++i)
        {
            // A vn that is not finite stays for all of its uses.
            const bool is_finite = rest_values[i].allFinite();
            const Eigen::Vector3d& value = is_finite ? values[i] : rest_values[i];
            end_until(batch[i].direction);
            if (num_ended == batch[i].direction)
            {
                Vector skipped;
                unused.next(skipped);
                directions_.push({{value.x(), value.y(), value.z()}});
                ++num_ended;
            }
            index_of_use.push(is_finite ? splitter.index(batch[i], value, lines)
                                        : batch[i].direction + 1);
        }
        if (!lines.empty() && lines_.size() == 0 && found.last != '\n' &&
            found.last != '\r')
            lines.insert(0, line_end);
        lines_.append(lines.data(), lines.size());
        batch.clear();
        at.clear();
        values.clear();
        rest_values.clear();
    };
    auto uses = found.uses.sorted();
    Use last = {kNone, kNone, 0};
    for (Use use;
         !work.stop.stop_requested() && uses.next(use) && use.direction < num_directions;
         last = use)
    {
        if (use.direction == last.direction && use.sample == last.sample)
            continue;
        for (; num_rest <= use.direction; ++num_rest)
            rest.next(direction);
        Placed place = {};
        places.next(place);
        batch.push_back({use.direction, use.sample});
        at.push_back(as_vector(place.place));
        rest_values.push_back(as_vector(direction.x));
        values.push_back(rest_values.back());
        if (batch.size() == kTurnedAtOnce)
            turn_batch();
    }
    turn_batch();
    end_until(found.directions.size());
    num_split_ = splitter.num_lines();
    if (num_split_ == 0)
        return;

    auto again = found.uses.sorted();
    auto indices = index_of_use.reader();
    std::uint32_t index = 0;
    last = {kNone, kNone, 0};
    for (Use use; again.next(use) && use.direction < num_directions; last = use)
    {
        if (use.direction != last.direction || use.sample != last.sample)
            indices.next(index);
        if (index != use.direction + 1)
            new_indices_.push({use.corner, index});
    }
}

void NormalPlan::take(const Geometry& part, std::vector<Eigen::Vector3d>& directions,
                      std::vector<IndexEdit>& indices)
{
    directions.clear();
    indices.clear();
    Vector direction = {};
    for (std::size_t d = 0; d < part.directions.size(); ++d)
    {
        next_direction_->next(direction);
        directions.push_back(as_vector(direction.x));
    }
    for (std::size_t c = 0; c < part.corner_directions.size(); ++c)
    {
        if (part.corner_directions[c] == kNone)
            continue;
        if (has_index_ && index_.corner == corners_)
        {
            indices.push_back({part.corner_direction_starts[c],
                               part.corner_direction_lengths[c], index_.index});
            has_index_ = next_index_->next(index_);
        }
        ++corners_;
    }
}

void NormalPlan::write_lines(OutputFile& output, std::uint64_t& bytes) const
{
    std::string block;
    for (std::uint64_t at = 0; at < lines_.size(); at += block.size())
    {
        block.resize(static_cast<std::size_t>(
            std::min<std::uint64_t>(std::size_t(1) << 20, lines_.size() - at)));
        lines_.read(at, block.data(), block.size());
        output.write(block);
    }
    bytes += lines_.size();
}

} // namespace cellwarp::core
