// SPDX-License-Identifier: GPL-3.0-or-later
// All buffers are copied to a temporary file and moved there; then the bounds are known,
// the JSON can be written, and the buffers are copied behind or beside it. What is moved
// is read from the input, where it is as it was.
//
// A file whose moved numbers have no place of their own in it (gltf_rebuild.h) is read
// and written whole: they have to be unpacked in memory, and how many of its instances
// get meshes of their own is known in the end.
#include "io/formats/gltf_stream.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/formats/geometry_output.h"
#include "io/formats/gltf.h"
#include "io/formats/gltf_memory.h"
#include "io/formats/packed.h"
#include "io/formats/scanner.h"
#include "io/formats/stored_number.h"
#include "io/formats/stream_ranges.h"

namespace cellwarp::core
{

namespace
{

using Data = GltfLayout::Data;
using Kind = GltfLayout::Buffer::Kind;

/// Longest JSON, with the buffers inside it [bytes].
constexpr std::uint64_t kMaxJsonBytes = std::uint64_t(1) << 28;
/// Of its values, in memory [byte per byte of the text].
constexpr double kMemoryPerJsonByte = 16.0;
/// Memory of a file that is read whole, for each of its bytes and of its unpacked ones.
constexpr double kMemoryPerByte = 8.0;
/// Samples of such a file that are moved at a time: enough that lists around them are no
/// matter.
constexpr std::size_t kSamplesAtOnce = 16384;
/// Magic word, version, length; length and type of the JSON chunk.
constexpr std::uint64_t kGlbHeadBytes = 20;

/// A number that changes.
struct Change
{
    std::uint64_t start; ///< in the buffers [byte]
    char bytes[sizeof(float)];
};

/// Some elements of a run on their way.
struct Elements
{
    Geometry geometry;
    std::vector<Eigen::Vector3d> samples, directions, tangents;
    /// As the node has them.
    std::vector<Eigen::Vector3d> stored_samples, stored_directions, stored_tangents;
    std::vector<Eigen::Vector3d> local; ///< of one list
    std::string bytes;
    std::vector<Change> changes;
    bool is_too_far = false;
};

/// Elements [first, first + count) of a run.
struct Range
{
    std::size_t run;
    std::uint64_t first, count;
};

class GltfStream
{
public:
    GltfStream(const std::string& input, const std::string& output,
               const std::string& format, OutputSet& outputs,
               const StreamOptions& options, const StreamWork& work);
    StreamReport run();

private:
    void read_beginning();
    void check_memory(const std::string& why, double memory) const;
    void read_source(std::uint64_t start, char* bytes, std::size_t count) const;
    bool copy_buffers();
    void check_indices() const;
    void load(const Data& data, const Range& range, std::string& bytes,
              std::vector<Eigen::Vector3d>& values) const;
    void load_vectors(const Data& data, const Range& range, const Eigen::Matrix3d& map,
                      Elements& elements, std::vector<Eigen::Vector3d>& vectors,
                      std::vector<std::uint32_t>& samples,
                      std::vector<Eigen::Vector3d>& stored, ByteOffsets& places) const;
    void read_whole();
    StreamReport run_whole();
    bool move_whole(DeformedSamples& patch) const;
    void move_elements(Elements& elements, const Range& range) const;
    bool move();
    void overwrite(const std::vector<Change>& changes);
    std::vector<GltfBounds> find_bounds() const;
    std::vector<std::string> uris() const;
    void write();
    void complete_report();
    void put(OutputFile& file, std::string_view bytes);
    void copy_body(const GltfLayout::Buffer& buffer, OutputFile& file);
    void show(double done) const;

    std::string output_path_;
    OutputSet& outputs_;
    const StreamOptions& options_;
    const StreamWork& work_;
    InputFile input_;
    GeometryFile file_;
    GltfPlan plan_;
    std::vector<std::size_t> own_buffers_; ///< that have bytes of their own
    SpillFile body_;                       ///< the buffers one after the other, moved
    OutputFile* output_ = nullptr;
    std::vector<std::string> companions_;
    std::uint64_t num_samples_ = 0, num_bad_vectors_ = 0;
    StreamReport report_;
};

GltfStream::GltfStream(const std::string& input, const std::string& output,
                       const std::string& format, OutputSet& outputs,
                       const StreamOptions& options, const StreamWork& work)
    : output_path_(output), outputs_(outputs), options_(options), work_(work),
      input_(input), file_{input, {}, {}}, body_(spill_folder(output))
{
    file_.geometry.format = format;
    read_beginning();
    check_content(input, format, file_.bytes, 0);
    plan_ = plan_gltf(file_, input_);
    if (!file_.gltf->is_patched)
        read_whole();
    if (!file_.geometry.not_writable.empty())
        throw malformed({input, 0, ""},
                        "cannot be written: " + file_.geometry.not_writable);
    for (std::size_t b = 0; b < file_.gltf->buffers.size(); ++b)
        if (file_.gltf->buffers[b].kind != Kind::Again)
            own_buffers_.push_back(b);
    check_geometry_output(output, file_, outputs.overwrite());
    check_output(output, outputs.overwrite());
    companions_ = companion_paths(*file_.gltf, output);
}

void GltfStream::read_whole()
{
    std::uint64_t bytes = input_.size();
    for (const GltfPlan::Source& source : plan_.sources)
        bytes += source.file ? source.file->size() : 0;
    const double memory =
        kMemoryPerByte *
        (static_cast<double>(bytes) +
         unpacked_gltf_bytes(std::string_view(file_.bytes)
                                 .substr(file_.gltf->json.begin,
                                         file_.gltf->json.end - file_.gltf->json.begin)));
    check_memory(
        "it is compressed, or some numbers belong to several of its nodes; so it "
        "is read whole",
        memory);
    GeometryFile file{file_.path, {}, {}};
    file.geometry.format = file_.geometry.format;
    file.bytes.resize(static_cast<std::size_t>(input_.size()));
    input_.read_at(0, file.bytes.data(), file.bytes.size());
    scan_gltf(file);
    check_magnitude(file.path, file.geometry);
    file_ = std::move(file);
    plan_ = {};
}

void GltfStream::check_memory(const std::string& why, double memory) const
{
    if (options_.max_whole_memory > 0 && memory > options_.max_whole_memory)
        throw Error(Fault::Budget,
                    at({file_.path, 0, ""},
                       why + " and needs about " + in_bytes(memory) + " (limit " +
                           in_bytes(options_.max_whole_memory) + ")"));
}

void GltfStream::read_beginning()
{
    std::uint64_t count = input_.size(), json = count;
    if (file_.geometry.format == "glb")
    {
        count = std::min(count, kGlbHeadBytes);
        file_.bytes.resize(static_cast<std::size_t>(count));
        input_.read_at(0, file_.bytes.data(), file_.bytes.size());
        std::uint32_t length = 0;
        if (count == kGlbHeadBytes)
            std::memcpy(&length, file_.bytes.data() + 12, sizeof length);
        json = length;
        count = std::min(input_.size(), kGlbHeadBytes + json);
    }
    if (json > kMaxJsonBytes)
        throw Error(Fault::Usage,
                    at({file_.path, 0, ""},
                       "its JSON is read whole, and is longer than 256 MB (need buffers "
                       "beside it, or a .glb)"));
    check_memory("its JSON is read whole",
                 kMemoryPerJsonByte * static_cast<double>(json));
    file_.bytes.resize(static_cast<std::size_t>(count));
    input_.read_at(0, file_.bytes.data(), file_.bytes.size());
}

/// Of the buffers as they were; all within one of them.
void GltfStream::read_source(std::uint64_t start, char* bytes, std::size_t count) const
{
    const std::vector<GltfLayout::Buffer>& buffers = file_.gltf->buffers;
    const std::size_t b =
        *(std::upper_bound(own_buffers_.begin(), own_buffers_.end(), start,
                           [&](std::uint64_t place, std::size_t i)
                           { return place < buffers[i].start; }) -
          1);
    const GltfPlan::Source& source = plan_.sources[b];
    const std::uint64_t offset = start - buffers[b].start;
    if (buffers[b].kind == Kind::Chunk)
        input_.read_at(file_.gltf->chunk_start + offset, bytes, count);
    else if (source.file)
        source.file->read_at(offset, bytes, count);
    else
        std::memcpy(bytes, source.inside.data() + offset, count);
}

/// Reads every file once, from its beginning to its end.
bool GltfStream::copy_buffers()
{
    const std::vector<GltfLayout::Buffer>& buffers = file_.gltf->buffers;
    const auto copy = [&](InputFile& file, std::uint64_t begin, std::uint64_t end)
    {
        std::uint64_t start = 0;
        for_each_piece(
            0, file.size(),
            [&](std::uint64_t, char* bytes, std::size_t count)
            { file.read(bytes, count); },
            [&](std::string_view piece)
            {
                const std::uint64_t from = std::clamp(begin, start, start + piece.size()),
                                    to = std::clamp(end, start, start + piece.size());
                if (from < to)
                    body_.append(piece.data() + (from - start), to - from);
                start += piece.size();
            });
    };
    const std::uint64_t chunk = file_.gltf->chunk_start;
    const bool has_chunk = !buffers.empty() && buffers[0].kind == Kind::Chunk;
    copy(input_, chunk, has_chunk ? chunk + buffers[0].size : chunk);
    for (const GltfPlan::Source& source : plan_.sources)
    {
        if (work_.stop.stop_requested())
            return false;
        if (source.file)
            copy(*source.file, 0, source.file->size());
        else
            body_.append(source.inside.data(), source.inside.size());
    }
    return !work_.stop.stop_requested();
}

void GltfStream::check_indices() const
{
    for (const GltfPlan::Indices& indices : plan_.indices)
    {
        const Data& data = indices.data;
        const std::uint64_t at_once =
            std::max<std::uint64_t>(1, kPieceBytes / data.stride);
        std::string bytes;
        for (std::uint64_t first = 0; first < data.count; first += at_once)
        {
            const std::uint64_t count = std::min(at_once, data.count - first);
            bytes.resize(static_cast<std::size_t>((count - 1) * data.stride +
                                                  stored_size(indices.type)));
            read_source(data.start + first * data.stride, bytes.data(), bytes.size());
            for (std::uint64_t i = 0; i < count; ++i)
                if (const double index =
                        load_stored(bytes.data() + i * data.stride, indices.type, false);
                    index >= static_cast<double>(indices.samples))
                    throw index_out_of_range(file_.path, indices.where, first + i, index,
                                             indices.samples);
        }
    }
}

/// The first three numbers of each element.
void GltfStream::load(const Data& data, const Range& range, std::string& bytes,
                      std::vector<Eigen::Vector3d>& values) const
{
    bytes.resize(static_cast<std::size_t>((range.count - 1) * data.stride +
                                          data.length * sizeof(float)));
    read_source(data.start + range.first * data.stride, bytes.data(), bytes.size());
    values.resize(static_cast<std::size_t>(range.count));
    for (std::size_t i = 0; i < values.size(); ++i)
        for (std::size_t k = 0; k < 3; ++k)
            values[i][static_cast<Eigen::Index>(k)] =
                load_stored(bytes.data() + i * data.stride + k * sizeof(float),
                            Scalar::Float32, false);
}

void add_places(const Data& data, std::uint64_t i, ByteOffsets& places)
{
    for (std::size_t k = 0; k < 3; ++k)
        places.starts.push_back(data.start + i * data.stride + k * sizeof(float));
}

void GltfStream::load_vectors(const Data& data, const Range& range,
                              const Eigen::Matrix3d& map, Elements& elements,
                              std::vector<Eigen::Vector3d>& vectors,
                              std::vector<std::uint32_t>& samples,
                              std::vector<Eigen::Vector3d>& stored,
                              ByteOffsets& places) const
{
    std::vector<Eigen::Vector3d>& values = elements.local;
    load(data, range, elements.bytes, values);
    for (std::size_t i = 0; i < values.size(); ++i)
    {
        // One that is none stays as it is: it takes no part.
        const Eigen::Vector3d vector = turned_to_world(map, values[i]);
        if (!vector.allFinite() || vector.isZero(0))
        {
            elements.geometry.num_bad_normals += values[i].allFinite() ? 0 : 1;
            continue;
        }
        vectors.push_back(vector);
        stored.push_back(values[i]);
        samples.push_back(static_cast<std::uint32_t>(i));
        add_places(data, range.first + i, places);
    }
}

void GltfStream::move_elements(Elements& elements, const Range& range) const
{
    const GltfPlan::Run& run = plan_.runs[range.run];
    const GltfLayout::Part& part = file_.gltf->parts[run.part];
    elements.geometry = {};
    Geometry& geometry = elements.geometry;
    for (ByteOffsets* places :
         {&geometry.sample_places, &geometry.direction_places, &geometry.tangent_places})
        places->scalars.fill(Scalar::Float32);
    elements.changes.clear();
    elements.stored_directions.clear();
    elements.stored_tangents.clear();
    elements.is_too_far = false;

    load(run.samples, range, elements.bytes, elements.stored_samples);
    for (std::uint64_t i = 0; i < range.count; ++i)
    {
        const Eigen::Vector3d& value = elements.stored_samples[i];
        geometry.samples.push_back(
            part.is_in_place() ? value : Eigen::Vector3d(part.to_world * value));
        if (!geometry.samples.back().allFinite())
            throw vertex_not_finite(file_.path, run.samples, range.first + i);
        add_places(run.samples, range.first + i, geometry.sample_places);
    }
    for (const Data& data : run.directions)
        load_vectors(data, range, part.of_normals, elements, geometry.directions,
                     geometry.direction_samples, elements.stored_directions,
                     geometry.direction_places);
    for (const Data& data : run.tangents)
        load_vectors(data, range, part.to_world.linear(), elements, geometry.tangents,
                     geometry.tangent_samples, elements.stored_tangents,
                     geometry.tangent_places);
    try
    {
        check_magnitude(file_.path, geometry);
    }
    catch (const Error&)
    {
        elements.is_too_far = true; // how many samples came before is not known here
        return;
    }
    elements.samples = geometry.samples;
    elements.directions = geometry.directions;
    elements.tangents = geometry.tangents;
    work_.move({elements.samples, geometry.direction_samples, elements.directions,
                geometry.tangent_samples, elements.tangents});

    const GltfToNode to_node(part);
    const auto note = [&](const ByteOffsets& places,
                          const std::vector<Eigen::Vector3d>& before,
                          const std::vector<Eigen::Vector3d>& after,
                          const std::vector<Eigen::Vector3d>& stored, auto&& map)
    {
        elements.local = stored;
        for (std::size_t i = 0; i < after.size(); ++i)
            if (after[i] != before[i])
                elements.local[i] = map(after[i]);
        for_each_change(places, numbers_of(stored), numbers_of(elements.local),
                        file_.path,
                        [&](std::uint64_t start, const std::string& bytes)
                        {
                            Change& change = elements.changes.emplace_back();
                            change.start = start;
                            std::memcpy(change.bytes, bytes.data(), sizeof change.bytes);
                        });
    };
    note(geometry.sample_places, geometry.samples, elements.samples,
         elements.stored_samples,
         [&](const Eigen::Vector3d& x) { return to_node.sample(x); });
    note(geometry.direction_places, geometry.directions, elements.directions,
         elements.stored_directions,
         [&](const Eigen::Vector3d& n) { return to_node.direction(n); });
    note(geometry.tangent_places, geometry.tangents, elements.tangents,
         elements.stored_tangents,
         [&](const Eigen::Vector3d& t) { return to_node.tangent(t); });
}

/// Changes stand in the order of their places but for a jump here and there: what is near
/// is read and written at once.
void GltfStream::overwrite(const std::vector<Change>& changes)
{
    std::string bytes;
    for (std::size_t first = 0; first < changes.size();)
    {
        const std::uint64_t start = changes[first].start;
        std::size_t end = first + 1;
        while (end < changes.size() && changes[end].start > changes[end - 1].start &&
               changes[end].start - start < kPieceBytes)
            ++end;
        bytes.resize(static_cast<std::size_t>(changes[end - 1].start - start) +
                     sizeof(float));
        body_.read(start, bytes.data(), bytes.size());
        for (; first < end; ++first)
            bytes.replace(changes[first].start - start, sizeof(float),
                          changes[first].bytes, sizeof(float));
        body_.overwrite(start, bytes.data(), bytes.size());
    }
}

bool GltfStream::move()
{
    std::vector<std::pair<std::uint64_t, std::uint64_t>> runs; // end range, elements each
    std::uint64_t ranges = 0;
    for (const GltfPlan::Run& run : plan_.runs)
    {
        std::uint64_t bytes = run.samples.stride;
        for (const std::vector<Data>* list : {&run.directions, &run.tangents})
            for (const Data& data : *list)
                bytes += data.stride;
        const std::uint64_t each =
            std::max<std::uint64_t>(1, options_.part_bytes / bytes);
        ranges += (run.samples.count + each - 1) / each;
        runs.emplace_back(ranges, each);
    }
    const auto range_of = [&](std::uint64_t i)
    {
        const auto found = std::upper_bound(runs.begin(), runs.end(), i,
                                            [](std::uint64_t range, const auto& run)
                                            { return range < run.first; });
        const std::size_t run = static_cast<std::size_t>(found - runs.begin());
        const std::uint64_t first =
            (i - (run > 0 ? runs[run - 1].first : 0)) * found->second;
        return Range{run, first,
                     std::min(found->second, plan_.runs[run].samples.count - first)};
    };
    return run_ranges<Elements>(
        ranges, options_.parts_at_once, work_,
        [&](Elements& elements, std::uint64_t i)
        { move_elements(elements, range_of(i)); },
        [&](Elements& elements, std::uint64_t i)
        {
            elements.geometry.samples_before = num_samples_;
            elements.geometry.sample_places.starts.clear(); // they are told by number
            if (elements.is_too_far)
                check_magnitude(file_.path, elements.geometry);
            num_samples_ += elements.geometry.samples.size();
            num_bad_vectors_ += elements.geometry.num_bad_normals;
            overwrite(elements.changes);
            show(0.1 + 0.7 * static_cast<double>(i + 1) / static_cast<double>(ranges));
        });
}

/// Of the accessors that have changed.
std::vector<GltfBounds> GltfStream::find_bounds() const
{
    std::vector<GltfBounds> bounds;
    for (const Data& data : file_.gltf->data)
    {
        GltfBounds found(data);
        const std::size_t size = data.length * sizeof(float);
        const std::uint64_t at_once =
            std::max<std::uint64_t>(1, kPieceBytes / data.stride);
        bool has_changed = false;
        std::string before, after;
        for (std::uint64_t first = 0; first < data.count; first += at_once)
        {
            const std::uint64_t count = std::min(at_once, data.count - first),
                                start = data.start + first * data.stride;
            before.resize(static_cast<std::size_t>((count - 1) * data.stride) + size);
            after.resize(before.size());
            read_source(start, before.data(), before.size());
            body_.read(start, after.data(), after.size());
            for (std::uint64_t i = 0; i < count; ++i)
            {
                const std::size_t place = static_cast<std::size_t>(i * data.stride);
                has_changed =
                    has_changed || before.compare(place, size, after, place, size) != 0;
                found.add(after.data() + place);
            }
        }
        if (has_changed)
            bounds.push_back(std::move(found));
    }
    return bounds;
}

std::vector<std::string> GltfStream::uris() const
{
    std::vector<std::string> uris;
    std::size_t num_beside = 0;
    for (std::size_t b = 0; b < file_.gltf->buffers.size(); ++b)
    {
        const GltfLayout::Buffer& buffer = file_.gltf->buffers[b];
        uris.push_back(buffer.uri);
        if (buffer.kind == Kind::Beside)
            uris.back() = uri_of(companions_[num_beside++]);
        if (buffer.kind == Kind::Again)
            uris.back() = uri_again(*file_.gltf, uris, buffer);
        if (buffer.kind != Kind::Inside)
            continue;
        std::string after(static_cast<std::size_t>(buffer.size), '\0');
        body_.read(buffer.start, after.data(), after.size());
        if (after != plan_.sources[b].inside)
            uris.back() = patched_data_uri(buffer.uri, plan_.sources[b].inside, after);
    }
    return uris;
}

void GltfStream::put(OutputFile& file, std::string_view bytes)
{
    file.write(bytes);
    if (&file == output_)
        report_.bytes += bytes.size();
}

void GltfStream::copy_body(const GltfLayout::Buffer& buffer, OutputFile& file)
{
    for_each_piece(
        buffer.start, buffer.start + buffer.size,
        [&](std::uint64_t at, char* bytes, std::size_t count)
        { body_.read(at, bytes, count); },
        [&](std::string_view piece) { put(file, piece); });
}

void GltfStream::write()
{
    const GltfLayout& layout = *file_.gltf;
    const bool is_binary = file_.geometry.format == "glb";
    const std::string json =
        patched_json(std::string_view(file_.bytes)
                         .substr(layout.json.begin, layout.json.end - layout.json.begin),
                     layout, find_bounds(), uris(), is_binary);
    std::size_t num_beside = 0;
    for (const GltfLayout::Buffer& buffer : layout.buffers)
        if (buffer.kind == Kind::Beside)
        {
            OutputFile& beside = outputs_.add(companions_[num_beside++]);
            copy_body(buffer, beside);
            beside.file()->finish();
        }
    // The file comes last, so that what it names is there.
    output_ = &outputs_.add(output_path_);
    if (is_binary)
        put(*output_, glb_head(file_.bytes, layout.json, json.size()));
    put(*output_, json);
    if (!is_binary)
        return;
    const auto copy = [&](std::uint64_t start, std::uint64_t end)
    {
        for_each_piece(
            start, end,
            [&](std::uint64_t at, char* bytes, std::size_t count)
            { input_.read_at(at, bytes, count); },
            [&](std::string_view piece) { put(*output_, piece); });
    };
    if (layout.buffers.empty() || layout.buffers[0].kind != Kind::Chunk)
    {
        copy(layout.json.end, input_.size());
        return;
    }
    copy(layout.json.end, layout.chunk_start);
    copy_body(layout.buffers[0], *output_);
    copy(layout.chunk_start + layout.buffers[0].size, input_.size());
}

void GltfStream::show(double done) const
{
    if (work_.progress)
        work_.progress(done);
}

/// The vectors of one kind that belong to a range of samples.
class Hangers
{
public:
    Hangers(const std::vector<std::uint32_t>& samples,
            std::vector<Eigen::Vector3d>& moved)
        : samples_(samples), moved_(moved), order_(samples.size())
    {
        std::iota(order_.begin(), order_.end(), std::size_t(0));
        std::stable_sort(order_.begin(), order_.end(),
                         [&](std::size_t a, std::size_t b)
                         { return samples[a] < samples[b]; });
    }
    /// Those of the samples [first, end).
    struct Part
    {
        std::vector<std::uint32_t> samples; ///< counted from the first
        std::vector<Eigen::Vector3d> vectors;
        std::size_t begin = 0;
    };
    Part of(std::size_t first, std::size_t end) const
    {
        const auto begin =
            std::partition_point(order_.begin(), order_.end(),
                                 [&](std::size_t i) { return samples_[i] < first; });
        Part part;
        part.begin = static_cast<std::size_t>(begin - order_.begin());
        for (auto at = begin; at != order_.end() && samples_[*at] < end; ++at)
        {
            part.samples.push_back(static_cast<std::uint32_t>(samples_[*at] - first));
            part.vectors.push_back(moved_[*at]);
        }
        return part;
    }
    void put_back(const Part& part)
    {
        for (std::size_t i = 0; i < part.vectors.size(); ++i)
            moved_[order_[part.begin + i]] = part.vectors[i];
    }

private:
    const std::vector<std::uint32_t>& samples_;
    std::vector<Eigen::Vector3d>& moved_;
    std::vector<std::size_t> order_; ///< by samples
};

bool GltfStream::move_whole(DeformedSamples& patch) const
{
    const Geometry& geometry = file_.geometry;
    Hangers directions(geometry.direction_samples, patch.directions),
        tangents(geometry.tangent_samples, patch.tangents);
    const std::size_t count = patch.samples.size(),
                      ranges = (count + kSamplesAtOnce - 1) / kSamplesAtOnce;
    struct Nothing
    {
    };
    return run_ranges<Nothing>(
        ranges, options_.parts_at_once, work_,
        [&](Nothing&, std::uint64_t i)
        {
            const std::size_t first = static_cast<std::size_t>(i) * kSamplesAtOnce,
                              end = std::min(count, first + kSamplesAtOnce);
            Hangers::Part normals = directions.of(first, end),
                          along = tangents.of(first, end);
            work_.move({std::span(patch.samples).subspan(first, end - first),
                        normals.samples, normals.vectors, along.samples, along.vectors});
            directions.put_back(normals);
            tangents.put_back(along);
        },
        [&](Nothing&, std::uint64_t i)
        { show(0.1 + 0.7 * static_cast<double>(i + 1) / static_cast<double>(ranges)); });
}

StreamReport GltfStream::run_whole()
{
    const Geometry& geometry = file_.geometry;
    DeformedSamples patch{geometry.samples, geometry.directions, geometry.tangents};
    if (!move_whole(patch))
    {
        report_.is_stopped = true;
        return std::move(report_);
    }
    const PatchedGltf result = patched_gltf(file_, patch, output_path_);
    for (const Companion& companion : result.companions)
        outputs_.write(companion.path, companion.bytes);
    output_ = &outputs_.add(output_path_);
    put(*output_, result.bytes);
    input_.check_unchanged();
    num_samples_ = geometry.samples.size();
    complete_report();
    return std::move(report_);
}

void GltfStream::complete_report()
{
    report_.samples = num_samples_;
    report_.warnings = std::move(file_.geometry.warnings);
}

StreamReport GltfStream::run()
{
    if (!file_.gltf->is_patched)
        return run_whole();

    if (work_.stop.stop_requested() || !copy_buffers())
    {
        report_.is_stopped = true;
        return std::move(report_);
    }
    check_indices();
    if (!move())
    {
        report_.is_stopped = true;
        return std::move(report_);
    }
    write();
    input_.check_unchanged();
    for (const GltfPlan::Source& source : plan_.sources)
        if (source.file)
            source.file->check_unchanged();
    warn_of_bad_vectors(file_.path, num_bad_vectors_, file_.geometry);
    complete_report();
    return std::move(report_);
}

} // namespace

StreamReport stream_gltf(const std::string& input, const std::string& output,
                         const std::string& format, OutputSet& outputs,
                         const StreamOptions& options, const StreamWork& work)
{
    if (input == "-")
        throw Error(Fault::Usage, "a glTF is read in ranges (need a file, not stdin)");
    return GltfStream(input, output, format, outputs, options, work).run();
}

} // namespace cellwarp::core
