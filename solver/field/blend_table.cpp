// SPDX-License-Identifier: GPL-3.0-or-later
// On a regular grid the cells that count at a point are corners of its dual box, the
// cube between eight centres. So the points are sorted by dual boxes, and in each one by
// the cells whose weight there is positive, half of the eight in the mean. Points of sets
// that are too few for blocks of their own share the union of their sets: a weight of 0
// adds nothing.
#include "solver/field/blend_table.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <ranges>
#include <tuple>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Blocks that one thread does at once: long enough that making the maps of a group
/// costs little beside.
constexpr std::size_t kChunkBlocks = 64;

/// Maps of a group that are made on the stack; on a regular grid there are eight.
constexpr std::size_t kStackMaps = 32;

/// Points of one set that are worth a group of their own.
constexpr std::size_t kOwnGroup = 32;

std::size_t to_blocks(std::size_t num_points)
{
    return (num_points + kLanes - 1) / kLanes;
}

/// A table's points, and the samples they are at.
struct Points
{
    BlendTable::Kind kind;
    const SampleSet& samples;

    std::size_t size() const
    {
        return is_normals() ? samples.normals.size() : samples.places.size();
    }
    bool is_normals() const { return kind == BlendTable::Kind::Normals; }
    std::size_t sample(std::size_t i) const
    {
        return is_normals() ? samples.normals[i].sample : i;
    }
    const Eigen::Vector3d& place(std::size_t i) const
    {
        return samples.places[sample(i)];
    }
    int cell(std::size_t i) const { return samples.cells[sample(i)]; }
    Eigen::Vector3f normal(std::size_t i) const
    {
        return samples.normals[i].direction.cast<float>();
    }
    Eigen::Vector3f rest(std::size_t i) const
    {
        return is_normals() ? normal(i) : place(i).cast<float>();
    }
};

/// Points sorted by the dual box that holds them, else in their order.
struct DualBoxes
{
    std::vector<std::uint32_t> points;
    std::vector<std::size_t> first; ///< boxes + 1
};

/// Where the dual box of a cell's octant is, with its component: parts that lie side by
/// side are kept apart. Boxes far from each other may have the same key.
std::uint64_t dual_box_key(const Cells& cells, int component, std::size_t cell,
                           std::size_t octant)
{
    const Cell& c = cells.cells[cell];
    std::uint64_t key = static_cast<std::uint64_t>(component) & 0xffff;
    for (int k = 0; k < 3; ++k)
    {
        const double low = c.box_centre[k] - (octant >> k & 1 ? 0.0 : c.edge);
        const long long index =
            std::llround((low - cells.cells.front().box_centre[k]) / c.edge);
        key = key << 16 | (static_cast<std::uint64_t>(index) & 0xffff);
    }
    return key;
}

DualBoxes dual_boxes(const Points& points, const Cells& cells)
{
    const auto octant_of = [&](std::size_t i)
    {
        const std::size_t cell = idx(points.cell(i));
        const Eigen::Vector3d& centre = cells.cells[cell].box_centre;
        std::size_t octant = 0;
        for (int k = 0; k < 3; ++k)
            octant |= static_cast<std::size_t>(points.place(i)[k] >= centre[k]) << k;
        return 8 * cell + octant;
    };
    std::vector<std::uint32_t> octants(points.size());
    parallel_for(points.size(), [&](std::size_t i)
                 { octants[i] = static_cast<std::uint32_t>(octant_of(i)); });
    const std::vector<int> component = connected_components(cells);
    std::vector<std::pair<std::uint64_t, std::uint32_t>> keys;
    for (std::size_t o = 0; o < 8 * cells.size(); ++o)
        keys.emplace_back(dual_box_key(cells, component[o / 8], o / 8, o % 8),
                          static_cast<std::uint32_t>(o));
    std::sort(keys.begin(), keys.end());
    std::vector<std::uint32_t> box_of_octant(keys.size());
    std::uint32_t num_boxes = 0;
    for (std::size_t k = 0; k < keys.size(); ++k)
    {
        num_boxes += k == 0 || keys[k].first != keys[k - 1].first;
        box_of_octant[keys[k].second] = num_boxes - 1;
    }
    DualBoxes boxes;
    boxes.first.assign(num_boxes + 1, 0);
    for (const std::uint32_t octant : octants)
        ++boxes.first[box_of_octant[octant] + 1];
    std::partial_sum(boxes.first.begin(), boxes.first.end(), boxes.first.begin());
    std::vector<std::size_t> next = boxes.first;
    boxes.points.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        boxes.points[next[box_of_octant[octants[i]]]++] = static_cast<std::uint32_t>(i);
    return boxes;
}

/// Tangents with first x second = n, as the kernel finds them.
std::array<Eigen::Vector3d, 2> unit_tangents(const Eigen::Vector3d& n)
{
    const double sign = n.z() < 0.0 ? -1.0 : 1.0;
    const double a = -1.0 / (sign + n.z()), b = n.x() * n.y() * a;
    return {Eigen::Vector3d(1.0 + sign * n.x() * n.x() * a, sign * b, -sign * n.x()),
            Eigen::Vector3d(b, sign + n.y() * n.y() * a, -n.y())};
}

/// The part of a table that one dual box makes; its numbers count from its own begin.
struct Part
{
    std::vector<BlendGroup> groups;
    std::vector<std::uint32_t> maps, points;
    std::vector<Row> rows;
    FadeSums sums;
};

/// Makes parts; keeps the scratch of one for the next.
class PartMaker
{
public:
    PartMaker(const Points& points, const Cells& cells, std::span<const char> is_idle,
              const BlendInfluences& influences, const FadeNodes& nodes)
        : points_(points), num_cells_(cells.size()), is_idle_(is_idle),
          influences_(influences), nodes_(nodes), bit_of_cell_(cells.size(), -1)
    {
    }
    Part part(std::span<const std::uint32_t> points);

private:
    /// What a point follows; a number from 0 on: the region whose node it is.
    static constexpr int kIdle = -3, kFaded = -2, kCells = -1;
    struct Member
    {
        std::uint32_t point = 0;
        int follows = kCells;
        std::uint64_t cells = 0; ///< one bit each: which of cells_
        std::size_t first_influence = 0, end_influence = 0;
        std::size_t first_term[2] = {0, 0}, end_term[2] = {0, 0};
    };
    void add_member(std::uint32_t point);
    void add_terms(Member& member);
    void find_cells();
    void merge_small_groups();
    void add_group(std::span<const Member> members, Part& part) const;
    void fill_row_lanes(const Member& member, std::span<const std::uint32_t> maps,
                        Row* rows, std::size_t lane) const;
    void add_sums(std::span<const Member> members, Part& part) const;
    std::span<const Influence> influences_of(const Member& member) const
    {
        return std::span(pool_).subspan(member.first_influence,
                                        member.end_influence - member.first_influence);
    }

    const Points& points_;
    std::size_t num_cells_;
    std::span<const char> is_idle_;
    const BlendInfluences& influences_;
    const FadeNodes& nodes_;

    BlendInfluences::Found found_;
    NearNodesOfRegions near_;
    RegionFades::Reach reach_;
    std::vector<Member> members_;
    std::vector<Influence> pool_;
    FadeTerms terms_[2];           ///< of the displacement, or along the two tangents
    std::vector<int> cells_;       ///< that count somewhere in the box, ascending
    std::vector<int> bit_of_cell_; ///< where in cells_; -1 between calls
};

Part PartMaker::part(std::span<const std::uint32_t> points)
{
    members_.clear();
    pool_.clear();
    for (FadeTerms& terms : terms_)
        terms.clear();
    Eigen::AlignedBox3d box;
    for (const std::uint32_t point : points)
        box.extend(points_.place(point));
    near_.enter(box, points.size());
    for (const std::uint32_t point : points)
        add_member(point);
    find_cells();
    merge_small_groups();
    Part part;
    for (std::size_t begin = 0, end = 0; begin < members_.size(); begin = end)
    {
        const auto key = [&](std::size_t i)
        { return std::pair(members_[i].follows, members_[i].cells); };
        for (end = begin; end < members_.size() && key(end) == key(begin);)
            ++end;
        add_group(std::span(members_).subspan(begin, end - begin), part);
    }
    return part;
}

void PartMaker::add_member(std::uint32_t point)
{
    Member member;
    member.point = point;
    member.first_influence = member.end_influence = pool_.size();
    const int own = points_.cell(point);
    if (is_idle_[idx(own)])
        member.follows = kIdle;
    else
    {
        influences_.find(points_.place(point), own, found_);
        nodes_.fades().make_ways(std::views::transform(found_.near, &Influence::cell),
                                 near_);
        nodes_.fades().reach(points_.place(point), found_.near, near_, reach_);
        if (reach_.node_of >= 0)
            member.follows = reach_.node_of;
        // A pin's nodes turn with the cells around.
        if (reach_.node_of < 0 || nodes_.may_turn(reach_.node_of))
            pool_.insert(pool_.end(), found_.base.begin(), found_.base.end());
        member.end_influence = pool_.size();
        add_terms(member);
    }
    members_.push_back(member);
}

void PartMaker::add_terms(Member& member)
{
    for (std::size_t k = 0; k < 2; ++k)
        member.first_term[k] = member.end_term[k] = terms_[k].size();
    if (reach_.shares.empty())
        return;
    const Eigen::Vector3d& x = points_.place(member.point);
    if (points_.is_normals())
        nodes_.add_slope_terms(x, reach_,
                               unit_tangents(points_.normal(member.point).cast<double>()),
                               terms_);
    else
        nodes_.add_terms(x, reach_, terms_[0]);
    for (std::size_t k = 0; k < 2; ++k)
        member.end_term[k] = terms_[k].size();
    if (member.end_term[0] > member.first_term[0])
        member.follows = kFaded;
}

void PartMaker::find_cells()
{
    cells_.clear();
    for (const Influence& influence : pool_)
        if (int& bit = bit_of_cell_[idx(influence.cell)]; bit < 0)
        {
            bit = 0;
            cells_.push_back(influence.cell);
        }
    std::sort(cells_.begin(), cells_.end());
    for (std::size_t i = 0; i < cells_.size(); ++i)
        bit_of_cell_[idx(cells_[i])] = static_cast<int>(i);
    for (Member& member : members_)
        for (const Influence& influence : influences_of(member))
            // More cells than bits: one group of them all.
            member.cells |= cells_.size() > 64
                                ? ~std::uint64_t(0)
                                : std::uint64_t(1) << bit_of_cell_[idx(influence.cell)];
    for (const int cell : cells_)
        bit_of_cell_[idx(cell)] = -1;
}

/// Afterwards members of one group are beside each other. The cells of those that are
/// too few are the union, with no bit left for a set of its own.
void PartMaker::merge_small_groups()
{
    const auto key = [](const Member& member)
    { return std::tuple(member.follows, member.cells, member.point); };
    const auto by_key = [&](const Member& a, const Member& b) { return key(a) < key(b); };
    std::sort(members_.begin(), members_.end(), by_key);
    for (std::size_t begin = 0, end = 0; begin < members_.size(); begin = end)
    {
        const int follows = members_[begin].follows;
        std::uint64_t merged = 0;
        std::vector<std::size_t> small;
        for (end = begin; end < members_.size() && members_[end].follows == follows;)
        {
            const std::size_t first = end;
            while (end < members_.size() && members_[end].follows == follows &&
                   members_[end].cells == members_[first].cells)
                ++end;
            if (end - first >= kOwnGroup)
                continue;
            merged |= members_[first].cells;
            for (std::size_t i = first; i < end; ++i)
                small.push_back(i);
        }
        for (const std::size_t i : small)
            members_[i].cells = merged;
        if (!small.empty())
            std::sort(members_.begin() + static_cast<std::ptrdiff_t>(begin),
                      members_.begin() + static_cast<std::ptrdiff_t>(end), by_key);
    }
}

void PartMaker::add_group(std::span<const Member> members, Part& part) const
{
    BlendGroup group;
    group.first_map = part.maps.size();
    group.first_row = part.rows.size();
    group.first_sum = part.sums.size();
    group.first_value = part.points.size();
    group.num_values = members.size();
    group.reference = points_.place(members.front().point).cast<float>();
    const int follows = members.front().follows;
    for (const Member& member : members)
        part.points.push_back(member.point);
    if (follows == kIdle)
        return;
    if (follows >= 0 && !(points_.is_normals() && nodes_.may_turn(follows)))
        part.maps.push_back(static_cast<std::uint32_t>(num_cells_) +
                            static_cast<std::uint32_t>(follows));
    else
        for (std::size_t c = 0; c < cells_.size(); ++c)
            if (cells_.size() > 64 || (members.front().cells >> c & 1))
                part.maps.push_back(static_cast<std::uint32_t>(cells_[c]));
    group.num_maps = part.maps.size() - group.first_map;
    group.rows_a_block = points_.is_normals()
                             ? kNormalRows + kNormalWeightRows * (group.num_maps - 1)
                             : kPlaceRows + kPlaceWeightRows * (group.num_maps - 1);
    part.rows.resize(group.first_row + group.rows_a_block * to_blocks(members.size()),
                     Row{});
    for (std::size_t i = 0; i < members.size(); ++i)
        fill_row_lanes(members[i], std::span(part.maps).subspan(group.first_map),
                       part.rows.data() + group.first_row +
                           i / kLanes * group.rows_a_block,
                       i % kLanes);
    group.has_corrections = follows == kFaded;
    if (group.has_corrections)
        add_sums(members, part);
    part.groups.push_back(group);
}

void PartMaker::fill_row_lanes(const Member& member, std::span<const std::uint32_t> maps,
                               Row* rows, std::size_t lane) const
{
    const bool is_normals = points_.is_normals();
    const Eigen::Vector3f x = points_.place(member.point).cast<float>();
    for (std::size_t k = 0; k < 3; ++k)
        rows[k].lane[lane] = x[static_cast<Eigen::Index>(k)];
    std::array<Eigen::Vector3d, 2> tangents = {Eigen::Vector3d::Zero(),
                                               Eigen::Vector3d::Zero()};
    if (is_normals)
    {
        const Eigen::Vector3f n = points_.normal(member.point);
        tangents = unit_tangents(n.cast<double>());
        for (std::size_t k = 0; k < 3; ++k)
            rows[3 + k].lane[lane] = n[static_cast<Eigen::Index>(k)];
    }
    if (maps.size() == 1)
        return;
    for (const Influence& influence : influences_of(member))
    {
        const std::size_t i = idx(std::find(maps.begin(), maps.end(),
                                            static_cast<std::uint32_t>(influence.cell)) -
                                  maps.begin());
        // The kernel does without the weight of the first.
        if (i == 0)
            continue;
        Row* of_cell = is_normals ? rows + kNormalRows + kNormalWeightRows * (i - 1)
                                  : rows + kPlaceRows + kPlaceWeightRows * (i - 1);
        of_cell[0].lane[lane] = static_cast<float>(influence.weight);
        if (!is_normals)
            continue;
        for (std::size_t t = 0; t < 2; ++t)
            of_cell[1 + t].lane[lane] =
                static_cast<float>(influence.gradient.dot(tangents[t]));
    }
}

void PartMaker::add_sums(std::span<const Member> members, Part& part) const
{
    const std::size_t sums_a_point = points_.is_normals() ? 2 : 1;
    for (std::size_t block = 0; block < to_blocks(members.size()); ++block)
        for (std::size_t s = 0; s < sums_a_point; ++s)
            for (std::size_t i = block * kLanes; i < (block + 1) * kLanes; ++i)
                if (i < members.size())
                    part.sums.add(std::span(terms_[s]).subspan(
                        members[i].first_term[s],
                        members[i].end_term[s] - members[i].first_term[s]));
                else
                    part.sums.add({});
}

} // namespace

BlendTable::BlendTable(Kind kind, const SampleSet& samples, const Cells& cells,
                       std::span<const char> is_idle, const BlendInfluences& influences,
                       const FadeNodes& nodes)
    : kind_(kind)
{
    const Points points{kind, samples};
    const DualBoxes boxes = dual_boxes(points, cells);
    std::vector<Part> parts(boxes.first.size() - 1);
    parallel_ranges(
        parts.size(), 1,
        [&](std::size_t begin, std::size_t end)
        {
            PartMaker maker(points, cells, is_idle, influences, nodes);
            for (std::size_t b = begin; b < end; ++b)
                parts[b] = maker.part(
                    std::span(boxes.points)
                        .subspan(boxes.first[b], boxes.first[b + 1] - boxes.first[b]));
        });
    std::vector<std::size_t> first_row = {0};
    for (std::size_t b = 0; b < parts.size(); ++b)
    {
        const Part& part = parts[b];
        for (BlendGroup group : part.groups)
        {
            group.first_map += maps_.size();
            group.first_row += first_row.back();
            group.first_sum += sums_.size();
            group.first_value += order_.size();
            groups_.push_back(group);
        }
        maps_.insert(maps_.end(), part.maps.begin(), part.maps.end());
        order_.insert(order_.end(), part.points.begin(), part.points.end());
        sums_.append(part.sums);
        first_row.push_back(first_row.back() + part.rows.size());
    }
    rows_.resize(first_row.back());
    values_.resize(3 * order_.size());
    parallel_for(parts.size(),
                 [&](std::size_t b)
                 {
                     std::copy(parts[b].rows.begin(), parts[b].rows.end(),
                               rows_.begin() + static_cast<std::ptrdiff_t>(first_row[b]));
                     parts[b] = {};
                 });
    parallel_for(order_.size(),
                 [&](std::size_t i)
                 {
                     const Eigen::Vector3f rest = points.rest(order_[i]);
                     std::copy(rest.begin(), rest.end(), values_.data() + 3 * i);
                 });
    sums_.finish();
    make_chunks();
}

void BlendTable::make_chunks()
{
    std::size_t spilled = 0;
    for (std::size_t g = 0; g < groups_.size(); ++g)
        for (std::size_t block = 0; block < to_blocks(groups_[g].num_values);
             block += kChunkBlocks)
        {
            chunks_.push_back({g, block, spilled});
            if (groups_[g].num_maps > kStackMaps)
                spilled += kMapSize * groups_[g].num_maps;
        }
    spill_.resize(spilled);
}

std::size_t BlendTable::bytes() const
{
    return rows_.size() * sizeof(Row) + sums_.bytes();
}

void BlendTable::apply(std::span<const AffineMap> maps, std::span<const NodeMiss> misses,
                       const BlendKernels& kernels)
{
    sums_.sum(misses, kernels);
    parallel_ranges(chunks_.size(), 4,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t c = begin; c < end; ++c)
                            run(chunks_[c], maps, kernels);
                    });
}

void BlendTable::run(const Chunk& chunk, std::span<const AffineMap> maps,
                     const BlendKernels& kernels)
{
    const BlendGroup& group = groups_[chunk.group];
    const bool is_normals = kind_ == Kind::Normals;
    float stack[kStackMaps * kMapSize];
    float* const numbers =
        group.num_maps > kStackMaps ? spill_.data() + chunk.spilled_maps : stack;
    // Differences in double precision: what moves as one stays one.
    const Eigen::Vector3d reference = group.reference.cast<double>();
    const AffineMap& first = maps[maps_[group.first_map]];
    for (std::size_t i = 0; i < group.num_maps; ++i)
    {
        AffineMap map = maps[maps_[group.first_map + i]];
        if (i > 0)
        {
            map.A -= first.A;
            map.b -= first.b;
        }
        using Rows = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
        Eigen::Map<Rows>(numbers + i * kMapSize) = map.A.cast<float>();
        Eigen::Map<Eigen::Vector3f>(numbers + i * kMapSize + 9) =
            (map.A * reference + map.b).cast<float>();
    }
    const std::size_t done = chunk.first_block * kLanes;
    BlendRun run;
    run.rows = rows_.data() + group.first_row + chunk.first_block * group.rows_a_block;
    if (group.has_corrections)
        run.corrections = sums_.rows() + group.first_sum / kLanes * 3 +
                          chunk.first_block *
                              (is_normals ? kNormalCorrectionRows : kPlaceCorrectionRows);
    run.maps = numbers;
    run.num_maps = group.num_maps;
    run.num_samples = std::min(group.num_values - done, kChunkBlocks * kLanes);
    Eigen::Map<Eigen::Vector3f>(run.reference) = group.reference;
    run.out = values_.data() + 3 * (group.first_value + done);
    (is_normals ? kernels.normals : kernels.places)(run);
}

} // namespace cellwarp::core
