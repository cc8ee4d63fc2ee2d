// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/field_file.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "io/base/bytes.h"
#include "io/base/checksum.h"
#include "io/base/error.h"

namespace cellwarp::core
{

namespace
{

static_assert(std::endian::native == std::endian::little,
              "field files are little-endian, and read and written as they are");

constexpr std::string_view kFieldMagic = "cwfield\n";
constexpr std::uint32_t kFieldVersion = 1;
constexpr std::size_t kNameSize = 12, kHeadSize = kNameSize + 4 + 8;
constexpr std::size_t kAlignment = 8;

/// Stages and regions beyond these are no field of ours.
constexpr std::uint32_t kMaxStages = 100000, kMaxRegions = 1000000;

/// Scales by more than this power of two are no session's: coordinates end at 1e150.
constexpr std::int32_t kMaxExponent = 1100;

/// Voxels of a field at the most: what a session makes.
constexpr double kMaxVoxels = 4e9;

/// Voxels that a file may claim for each of its bytes, and those that any file may: runs
/// of them take no more room where they are longer. Fields of the sparsest shapes have a
/// thousand a byte.
constexpr double kVoxelsPerByte = 4096.0, kFreeVoxels = double(1 << 25);

/// By how much rotations may be off, and sizes.
constexpr double kSlack = 1e-6;

template <class Number>
constexpr std::uint32_t type_of()
{
    if constexpr (std::is_same_v<Number, std::int32_t>)
        return 1;
    else if constexpr (std::is_same_v<Number, std::uint32_t>)
        return 2;
    else if constexpr (std::is_same_v<Number, double>)
        return 3;
    else
    {
        static_assert(std::is_same_v<Number, std::uint8_t>);
        return 4;
    }
}

class Writer
{
public:
    explicit Writer(std::string& out) : out_(out) {}

    template <class Number>
    void numbers(std::string_view name, const Number* values, std::size_t count)
    {
        std::string head(name);
        head.resize(kNameSize, '\0');
        out_ += head;
        raw(type_of<Number>());
        raw(static_cast<std::uint64_t>(count));
        out_.append(reinterpret_cast<const char*>(values), count * sizeof(Number));
        out_.resize((out_.size() + kAlignment - 1) / kAlignment * kAlignment, '\0');
    }
    template <class Number>
    void operator()(std::string_view name, const std::vector<Number>& values)
    {
        numbers(name, values.data(), values.size());
    }
    template <class Number, std::size_t kCount>
    void operator()(std::string_view name, const std::array<Number, kCount>& values)
    {
        numbers(name, values.data(), kCount);
    }
    template <class Number>
    requires std::is_arithmetic_v<Number>
    void operator()(std::string_view name, const Number& value)
    {
        numbers(name, &value, 1);
    }
    template <class Number>
    void raw(const Number& value)
    {
        out_.append(reinterpret_cast<const char*>(&value), sizeof value);
    }

private:
    std::string& out_;
};

class FieldReader
{
public:
    FieldReader(const std::string& path, std::string_view bytes)
        : path_(path), bytes_(bytes)
    {
        const std::string_view magic = bytes_.substr(0, kFieldMagic.size());
        if (magic != kFieldMagic)
            throw malformed({path_, 0, ""}, bytes_.empty()
                                                ? "the file is empty: no field"
                                                : "this is no field file of cellwarp");
        at_ = kFieldMagic.size();
    }

    [[noreturn]] void fail(const std::string& what) const
    {
        throw malformed({path_, 0,
                         (section_.empty() ? "header" : "section '" + section_ + "'") +
                             " (byte " + std::to_string(start_) + ")"},
                        what);
    }
    void require(bool is_right, const char* what) const
    {
        if (!is_right)
            fail(what);
    }

    template <class Number>
    Number raw()
    {
        if (bytes_.size() - at_ < sizeof(Number))
            fail("the file ends here: it is cut off");
        Number value;
        std::memcpy(&value, bytes_.data() + at_, sizeof value);
        at_ += sizeof value;
        return value;
    }
    template <class Number>
    std::size_t begin(std::string_view name)
    {
        section_ = name;
        start_ = at_;
        if (bytes_.size() - at_ < kHeadSize)
            fail("the file ends here: it is cut off");
        std::string padded(name);
        padded.resize(kNameSize, '\0');
        require(bytes_.substr(at_, kNameSize) == padded, "another section stands here");
        at_ += kNameSize;
        require(raw<std::uint32_t>() == type_of<Number>(), "holds another type");
        const std::uint64_t count = raw<std::uint64_t>();
        if (count > (bytes_.size() - at_) / sizeof(Number))
            fail("the file ends here: it is cut off");
        return static_cast<std::size_t>(count);
    }
    template <class Number>
    void take(Number* values, std::size_t count)
    {
        if (count > 0)
            std::memcpy(values, bytes_.data() + at_, count * sizeof(Number));
        at_ += count * sizeof(Number);
        const std::size_t end = (at_ + kAlignment - 1) / kAlignment * kAlignment;
        require(end <= bytes_.size(), "the file ends here: it is cut off");
        for (; at_ < end; ++at_)
            require(bytes_[at_] == 0, "is padded with something else than zeros");
        if constexpr (std::is_same_v<Number, double>)
            for (std::size_t i = 0; i < count; ++i)
                require(std::isfinite(values[i]), "holds a number that is not finite");
    }
    template <class Number>
    void operator()(std::string_view name, std::vector<Number>& values)
    {
        values.resize(begin<Number>(name));
        take(values.data(), values.size());
    }
    template <class Number, std::size_t kCount>
    void operator()(std::string_view name, std::array<Number, kCount>& values)
    {
        require(begin<Number>(name) == kCount, "holds another count");
        take(values.data(), kCount);
    }
    template <class Number>
    requires std::is_arithmetic_v<Number>
    void operator()(std::string_view name, Number& value)
    {
        require(begin<Number>(name) == 1, "holds another count");
        take(&value, 1);
    }
    std::size_t at() const { return at_; }
    std::size_t size() const { return bytes_.size(); }
    bool is_at_end() const { return at_ == bytes_.size(); }

private:
    const std::string& path_;
    std::string_view bytes_;
    std::size_t at_ = 0, start_ = 0;
    std::string section_;
};

/// The sections of a region, to write or to read them.
template <class Archive, class Region>
void region_sections(Archive& archive, Region& region)
{
    archive("motion", region.motion);
    archive("radius", region.radius);
    archive("may turn", region.may_turn);
    archive("nodes", region.nodes);
    archive("node cells", region.node_cells);
    archive("misses", region.misses);
    archive("near cells", region.near_cells);
    archive("deep cells", region.deep_cells);
}

/// The same of a stage, but for its regions.
template <class Archive, class Stage>
void stage_sections(Archive& archive, Stage& stage)
{
    archive("origin", stage.origin);
    archive("axes", stage.axes);
    archive("exponent", stage.exponent);
    archive("size", stage.size);
    archive("coarsest", stage.coarsest);
    archive("edge", stage.edge);
    archive("max depth", stage.max_depth);
    archive("leaf voxels", stage.voxels_per_leaf);
    archive("runs", stage.run_lengths);
    archive("run pieces", stage.run_pieces);
    archive("box centres", stage.box_centres);
    archive("edges", stage.edges);
    archive("centres", stage.centres);
    archive("neighbours 1", stage.first_neighbour);
    archive("neighbours", stage.neighbours);
    archive("poses", stage.poses);
    archive("idle", stage.is_idle);
    archive("kind", stage.kind);
    archive("centre count", stage.num_centres);
    archive("residual", stage.residual);
    archive("members 1", stage.first_membership);
    archive("members", stage.membership_fits);
    archive("weights", stage.membership_weights);
    archive("rbf 1", stage.first_centre);
    archive("rbf origins", stage.rbf_origins);
    archive("rbf P", stage.rbf_polynomials);
    archive("rbf centres", stage.rbf_centres);
}

/// Offsets begin with 0, do not fall and end with \p end.
bool are_offsets(const std::vector<std::int32_t>& offsets, std::size_t lists,
                 std::size_t end)
{
    if (offsets.size() != lists + 1 || offsets.front() != 0 ||
        static_cast<std::size_t>(offsets.back()) != end)
        return false;
    for (std::size_t i = 0; i < lists; ++i)
        if (offsets[i] > offsets[i + 1])
            return false;
    return true;
}

bool are_below(const std::vector<std::int32_t>& indices, std::size_t end, int least = 0)
{
    for (const std::int32_t index : indices)
        if (index < least || (index >= 0 && static_cast<std::size_t>(index) >= end))
            return false;
    return true;
}

bool are_ascending(const std::vector<std::int32_t>& numbers)
{
    for (std::size_t i = 1; i < numbers.size(); ++i)
        if (numbers[i - 1] >= numbers[i])
            return false;
    return true;
}

/// Orthonormal, no mirror: rows of a motion, a pose or axes.
bool is_rotation(const double* rows)
{
    double determinant = 0.0;
    for (int i = 0; i < 3; ++i)
    {
        for (int j = i; j < 3; ++j)
        {
            double dot = 0.0;
            for (int k = 0; k < 3; ++k)
                dot += rows[3 * i + k] * rows[3 * j + k];
            if (!(std::abs(dot - (i == j)) <= kSlack))
                return false;
        }
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        determinant += rows[i] * (rows[3 + j] * rows[6 + k] - rows[3 + k] * rows[6 + j]);
    }
    return determinant > 0;
}

double covered_voxels(const StoredField& stage)
{
    std::uint64_t covered = 0;
    for (const std::uint32_t length : stage.run_lengths)
        covered += length;
    return static_cast<double>(covered);
}

void check_grid(const FieldReader& reader, const StoredField& stage)
{
    double voxels = 1.0;
    for (int axis = 0; axis < 3; ++axis)
    {
        reader.require(stage.size[static_cast<std::size_t>(axis)] >= 0 &&
                           stage.coarsest[static_cast<std::size_t>(axis)] >= 1,
                       "the box has a negative size");
        voxels *= stage.coarsest[static_cast<std::size_t>(axis)];
    }
    reader.require(std::abs(stage.exponent) <= kMaxExponent, "the scale is none");
    reader.require(stage.edge > 0 && stage.max_depth >= 0 && stage.max_depth <= 20 &&
                       stage.voxels_per_leaf >= 1 && stage.voxels_per_leaf <= 1 << 20,
                   "the grid is none");
    const double a_leaf = std::ldexp(stage.voxels_per_leaf, stage.max_depth);
    for (const std::int32_t leaves : stage.coarsest)
        reader.require(leaves * a_leaf <= std::numeric_limits<std::int32_t>::max(),
                       "the grid is too large");
    voxels *= std::pow(a_leaf, 3);
    reader.require(voxels <= 64.0 * kMaxVoxels, "the grid is too large");
    reader.require(stage.run_lengths.size() == stage.run_pieces.size() &&
                       covered_voxels(stage) <= kMaxVoxels,
                   "the runs of voxels are wrong");
}

void check_stage(const FieldReader& reader, const StoredField& stage)
{
    check_grid(reader, stage);
    const std::size_t cells = stage.edges.size();
    reader.require(cells > 0, "there is no cell");
    reader.require(are_below(stage.run_pieces, cells, -1),
                   "a voxel belongs to no cell of the file");
    reader.require(stage.box_centres.size() == 3 * cells &&
                       stage.centres.size() == 3 * cells &&
                       stage.poses.size() == 12 * cells && stage.is_idle.size() == cells,
                   "the cells' lists differ in length");
    // Cells are boxes of the octree: else a search for near ones might find all.
    const double finest = std::ldexp(stage.edge, -stage.max_depth);
    for (const double edge : stage.edges)
        reader.require(edge >= (1 - kSlack) * finest && edge <= (1 + kSlack) * stage.edge,
                       "a cell is not of a size that the octree has");
    for (std::size_t i = 0; i < stage.box_centres.size(); ++i)
        reader.require(stage.box_centres[i] >= -stage.edge &&
                           stage.box_centres[i] <= stage.size[i % 3] + stage.edge,
                       "a cell lies outside of the box");
    reader.require(is_rotation(stage.axes.data()), "the axes are no rotation");
    for (std::size_t c = 0; c < cells; ++c)
        reader.require(is_rotation(&stage.poses[12 * c]), "a pose is no rotation");
    reader.require(are_offsets(stage.first_neighbour, cells, stage.neighbours.size()) &&
                       are_below(stage.neighbours, cells),
                   "the neighbours are wrong");
    reader.require(stage.kind >= 0 && stage.kind <= 4, "the kind of field is unknown");
    const std::size_t fits = stage.rbf_origins.size() / 3;
    reader.require(
        stage.rbf_origins.size() == 3 * fits &&
            stage.rbf_polynomials.size() == 30 * fits &&
            stage.rbf_centres.size() % 6 == 0 &&
            are_offsets(stage.first_centre, fits, stage.rbf_centres.size() / 6),
        "the RBFs' lists differ in length");
    if (stage.kind == 2)
    {
        reader.require(
            are_offsets(stage.first_membership, cells, stage.membership_fits.size()) &&
                are_below(stage.membership_fits, fits, -1) &&
                stage.membership_weights.size() == stage.membership_fits.size(),
            "the memberships are wrong");
        for (std::size_t c = 0; c < cells; ++c)
            reader.require(stage.is_idle[c] != 0 ||
                               stage.first_membership[c] < stage.first_membership[c + 1],
                           "a cell belongs to no RBF");
        for (const double weight : stage.membership_weights)
            reader.require(weight > 0 && weight <= 1, "a weight is not in (0, 1]");
    }
    reader.require(stage.kind < 3 || fits == 1, "there is not one global RBF");
}

void check_region(const FieldReader& reader, const StoredRegion& region,
                  std::size_t cells)
{
    const std::size_t nodes = region.node_cells.size();
    reader.require(nodes > 0 && region.nodes.size() == 3 * nodes &&
                       region.misses.size() == 12 * nodes,
                   "the nodes' lists differ in length");
    reader.require(region.radius > 0, "the fade has no radius");
    reader.require(is_rotation(region.motion.data()), "the motion is no rotation");
    reader.require(
        are_below(region.node_cells, cells) && are_below(region.near_cells, cells) &&
            are_below(region.deep_cells, cells) && are_ascending(region.near_cells) &&
            are_ascending(region.deep_cells),
        "the cells of a region are wrong");
}

} // namespace

std::string field_bytes(const FieldFile& file)
{
    std::string out(kFieldMagic);
    Writer writer(out);
    writer.raw(kFieldVersion);
    writer.raw(static_cast<std::uint32_t>(file.stages.size()));
    for (const StoredField& stage : file.stages)
    {
        stage_sections(writer, stage);
        writer("regions", static_cast<std::uint32_t>(stage.regions.size()));
        for (const StoredRegion& region : stage.regions)
            region_sections(writer, region);
    }
    writer("end", checksum_of(out));
    return out;
}

FieldFile parse_field(const std::string& path, std::string_view bytes)
{
    FieldReader reader(path, bytes);
    if (const std::uint32_t version = reader.raw<std::uint32_t>();
        version != kFieldVersion)
        reader.fail("made by version " + std::to_string(version) +
                    " of the format, need " + std::to_string(kFieldVersion));
    const std::uint32_t num_stages = reader.raw<std::uint32_t>();
    reader.require(num_stages >= 1 && num_stages <= kMaxStages, "there is no stage");
    FieldFile file;
    const double most_voxels =
        kFreeVoxels + kVoxelsPerByte * static_cast<double>(reader.size());
    double voxels = 0.0;
    for (std::uint32_t s = 0; s < num_stages; ++s)
    {
        StoredField& stage = file.stages.emplace_back();
        stage_sections(reader, stage);
        check_stage(reader, stage);
        voxels += covered_voxels(stage);
        if (voxels > most_voxels)
            reader.fail("the grid is too large for a file of this size (got " +
                        std::to_string(static_cast<std::uint64_t>(voxels)) +
                        " voxels, need " +
                        std::to_string(static_cast<std::uint64_t>(most_voxels)) +
                        " at the most)");
        std::uint32_t num_regions = 0;
        reader("regions", num_regions);
        reader.require(num_regions <= kMaxRegions, "there are too many regions");
        for (std::uint32_t r = 0; r < num_regions; ++r)
        {
            StoredRegion& region = stage.regions.emplace_back();
            region_sections(reader, region);
            check_region(reader, region, stage.edges.size());
        }
    }
    const std::uint32_t computed = checksum_of(bytes.substr(0, reader.at()));
    reader("end", file.checksum);
    reader.require(file.checksum == computed,
                   "the checksum is wrong: the file is altered");
    reader.require(reader.is_at_end(), "more bytes follow");
    return file;
}

FieldFile read_field(const std::string& path)
{
    return parse_field(path, read_file(path));
}

} // namespace cellwarp::core
