// SPDX-License-Identifier: GPL-3.0-or-later
// Beside the material a point follows the piece whose voxel is nearest to its own; beyond
// the grid, to the nearest voxel of the border.
#include "library/session/deformation.h"

#include <algorithm>
#include <atomic>
#include <deque>
#include <limits>

#include "io/base/error.h"
#include "io/base/number.h"
#include "octree/base/parallel.h"
#include "octree/distance_transform.h"

namespace cellwarp::core
{

namespace
{

/// Points farther from the box than this have squares beyond all numbers [work].
constexpr double kFarthest = 1e100;

template <class Matrix>
void append(const Matrix& matrix, std::vector<double>& numbers)
{
    numbers.insert(numbers.end(), matrix.data(), matrix.data() + matrix.size());
}

void append_motion(const Eigen::Matrix3d& R, const Eigen::Vector3d& t,
                   std::vector<double>& numbers)
{
    append(Eigen::Matrix3d(R.transpose()), numbers);
    append(t, numbers);
}

Eigen::Vector3d vector_at(const std::vector<double>& numbers, std::size_t i)
{
    return Eigen::Map<const Eigen::Vector3d>(numbers.data() + 3 * i);
}

Eigen::Matrix3d by_rows(const double* numbers)
{
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(numbers);
}

void store_material(const CellSystem& system, StoredField& out)
{
    const GridShape& shape = system.rest().material.grid.shape();
    Eigen::Map<Eigen::Vector3i>(out.coarsest.data()) = shape.coarsest;
    out.edge = shape.edge;
    out.max_depth = shape.max_depth;
    out.voxels_per_leaf = shape.voxels_per_leaf;
    const VoxelGrid& grid = system.rest().material.grid;
    std::size_t end = 0; // of the runs
    const auto add = [&](std::size_t count, std::int32_t piece)
    {
        if (count == 0)
            return;
        if (out.run_pieces.empty() || out.run_pieces.back() != piece)
        {
            out.run_pieces.push_back(piece);
            out.run_lengths.push_back(0);
        }
        out.run_lengths.back() += count;
        end += count;
    };
    system.body().pieces.for_each(grid,
                                  [&](std::size_t voxel, std::int32_t piece)
                                  {
                                      add(voxel - end, -1);
                                      add(1, piece);
                                  });
    add(grid.size() - end, -1);
}

void store_cells(const Cells& cells, const FieldParts& field, StoredField& out)
{
    for (const Cell& cell : cells.cells)
    {
        append(cell.box_centre, out.box_centres);
        out.edges.push_back(cell.edge);
        append(cell.centre, out.centres);
    }
    out.first_neighbour = cells.first_neighbour;
    out.neighbours = cells.neighbours;
    for (const Pose& pose : field.poses)
        append_motion(pose.R, pose.p, out.poses);
    out.is_idle.assign(field.is_idle.begin(), field.is_idle.end());
}

void store_fits(const FieldParts& field, StoredField& out)
{
    const auto add = [&](const RbfField& fit)
    {
        append(fit.terms().origin, out.rbf_origins);
        append(fit.terms().polynomial, out.rbf_polynomials);
        append(fit.terms().centres, out.rbf_centres);
        out.first_centre.push_back(static_cast<std::int32_t>(out.rbf_centres.size() / 6));
    };
    out.first_centre.push_back(0);
    if (field.global)
        add(*field.global);
    if (!field.local)
        return;
    const Clusters& clusters = field.local->clusters();
    out.first_membership = clusters.first_membership;
    for (const Membership& membership : clusters.memberships)
    {
        out.membership_fits.push_back(membership.cluster);
        out.membership_weights.push_back(membership.weight);
    }
    for (const auto& fit : field.local->fits())
        add(*fit);
}

StoredRegion stored_region(const MovedRegion& region)
{
    StoredRegion out;
    std::vector<double> motion;
    append_motion(region.motion.R, region.motion.t, motion);
    std::copy(motion.begin(), motion.end(), out.motion.begin());
    out.radius = region.fade->radius();
    out.may_turn = region.bends ? 2 : region.may_turn;
    for (const Eigen::Vector3d& node : region.fade->nodes())
        append(node, out.nodes);
    out.node_cells = region.fade->node_cells();
    for (const FieldValue& miss : region.misses)
    {
        append(miss.displacement, out.misses);
        append(miss.gradient, out.misses);
    }
    out.near_cells = region.fade->near_cells();
    out.deep_cells = region.deep_cells;
    return out;
}

} // namespace

StoredField stored_field(const CellSystem& system, const Field& field)
{
    StoredField out;
    const WorkFrame& frame = system.rest().frame;
    Eigen::Map<Eigen::Vector3d>(out.origin.data()) = frame.origin;
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(out.axes.data()) =
        frame.axes;
    out.exponent = frame.exponent;
    Eigen::Map<Eigen::Vector3d>(out.size.data()) = frame.size;
    store_material(system, out);
    const FieldParts& parts = field.parts();
    store_cells(system.body().cells, parts, out);
    out.kind = static_cast<std::int32_t>(parts.kind);
    out.num_centres = static_cast<std::uint32_t>(parts.num_centres);
    out.residual = parts.residual;
    store_fits(parts, out);
    for (const MovedRegion& region : parts.regions)
        out.regions.push_back(stored_region(region));
    return out;
}

WorkFrame frame_of(const StoredField& stored)
{
    WorkFrame frame;
    frame.origin = Eigen::Vector3d(stored.origin.data());
    frame.axes = by_rows(stored.axes.data());
    frame.exponent = stored.exponent;
    frame.size = Eigen::Vector3d(stored.size.data());
    return frame;
}

/// One stage, ready to be applied.
struct Deformation::Map
{
    /// \p most_kept: see Field::keep_surroundings().
    Map(const StoredField& stored, const std::string& path, std::size_t most_kept);

    void carry(const Carried& carried) const;

    WorkFrame frame;
    VoxelGrid grid;
    /// Where there is no material: -2 less the nearest piece.
    std::vector<std::int32_t> piece_of_voxel;
    /// Of the boxes of the smallest leaves: what all their voxels have, or kMixed. Most
    /// have one, and these numbers fit into the processor's cache.
    std::vector<std::int32_t> piece_of_box;
    static constexpr std::int32_t kMixed = std::numeric_limits<std::int32_t>::min();
    Cells cells; ///< without faces
    std::deque<RegionFade> fades;
    std::unique_ptr<Field> field;

private:
    std::int32_t piece_of(const Eigen::Vector3i& voxel) const;
    int cell_at(const Eigen::Vector3d& x) const;
    void read_material(const StoredField& stored, const std::string& path);
    void find_boxes();
    void read_cells(const StoredField& stored);
    FieldParts read_field(const StoredField& stored);
};

namespace
{

/// Of a voxel: its piece, the grid's own mark, and while labels spread a distance [byte].
constexpr double kBytesPerVoxel = 4.0 + 1.0, kBytesPerSpreadVoxel = 4.0;

/// How often the numbers of a file are in memory: as they were read, and ready to be
/// used.
constexpr double kCopies = 2.5;

/// Of a cell and of a box of voxels, beyond what the file says of it [byte].
constexpr double kBytesPerCell = sizeof(Cell) + sizeof(CellMap), kBytesPerBox = 4.0;

/// What all maps may keep of what they looked up, and what is left to parts of files
/// before anything is kept [byte].
constexpr double kMostKept = 64e6, kBytesForParts = 256e6;

double num_voxels_of(const StoredField& stored)
{
    double voxels = 0.0;
    for (const std::uint32_t length : stored.run_lengths)
        voxels += length;
    return voxels;
}

template <class Numbers>
double bytes_in(const Numbers& numbers)
{
    return static_cast<double>(numbers.size() * sizeof(*numbers.data()));
}

double bytes_of_numbers(const StoredField& stored)
{
    double bytes = bytes_in(stored.run_lengths) + bytes_in(stored.run_pieces) +
                   bytes_in(stored.box_centres) + bytes_in(stored.edges) +
                   bytes_in(stored.centres) + bytes_in(stored.first_neighbour) +
                   bytes_in(stored.neighbours) + bytes_in(stored.poses) +
                   bytes_in(stored.is_idle) + bytes_in(stored.first_membership) +
                   bytes_in(stored.membership_fits) +
                   bytes_in(stored.membership_weights) + bytes_in(stored.first_centre) +
                   bytes_in(stored.rbf_origins) + bytes_in(stored.rbf_polynomials) +
                   bytes_in(stored.rbf_centres);
    for (const StoredRegion& region : stored.regions)
        bytes += bytes_in(region.nodes) + bytes_in(region.node_cells) +
                 bytes_in(region.misses) + bytes_in(region.near_cells) +
                 bytes_in(region.deep_cells);
    return bytes;
}

/// Before anything as large as the grid is made.
GridShape checked_grid(const StoredField& stored, const std::string& path)
{
    const GridShape shape = {Eigen::Vector3d(stored.size.data()),
                             Eigen::Vector3i(stored.coarsest.data()), stored.edge,
                             stored.max_depth, stored.voxels_per_leaf};
    const double voxels = num_voxels_of(stored);
    if (voxels != num_voxels(shape))
        throw malformed({path, 0, "section 'runs'"},
                        "the material does not fill the grid (got " + shortest(voxels) +
                            " voxels, need " + shortest(num_voxels(shape)) + ")");
    return shape;
}

std::shared_ptr<const RbfField> fit_at(const StoredField& stored, std::size_t i)
{
    RbfField::Terms terms;
    terms.origin = vector_at(stored.rbf_origins, i);
    terms.polynomial = Eigen::Map<const Eigen::Matrix<double, 3, RbfField::kTerms>>(
        stored.rbf_polynomials.data() + 3 * RbfField::kTerms * i);
    terms.centres = Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>>(
        stored.rbf_centres.data() + 6 * stored.first_centre[i], 6,
        stored.first_centre[i + 1] - stored.first_centre[i]);
    return std::make_shared<const RbfField>(std::move(terms));
}

} // namespace

Deformation::Map::Map(const StoredField& stored, const std::string& path,
                      std::size_t most_kept)
    : frame(frame_of(stored)), grid(checked_grid(stored, path))
{
    read_material(stored, path);
    read_cells(stored);
    field = std::make_unique<Field>(cells, read_field(stored));
    field->keep_surroundings(most_kept);
}

void Deformation::Map::read_material(const StoredField& stored, const std::string& path)
{
    piece_of_voxel.reserve(grid.size());
    for (std::size_t run = 0; run < stored.run_lengths.size(); ++run)
        piece_of_voxel.insert(piece_of_voxel.end(), stored.run_lengths[run],
                              stored.run_pieces[run]);
    spread_labels(piece_of_voxel, grid.counts());
    if (piece_of_voxel.front() < 0)
        throw malformed({path, 0, "section 'run pieces'"}, "there is no material");
    auto voxel = piece_of_voxel.begin();
    for (std::size_t run = 0; run < stored.run_lengths.size(); ++run)
    {
        const auto end = voxel + static_cast<std::ptrdiff_t>(stored.run_lengths[run]);
        if (stored.run_pieces[run] < 0)
            std::transform(voxel, end, voxel,
                           [](std::int32_t nearest) { return -2 - nearest; });
        voxel = end;
    }
    find_boxes();
}

void Deformation::Map::find_boxes()
{
    piece_of_box.resize(grid.num_boxes());
    parallel_for(
        piece_of_box.size(), kSmallBodies,
        [&](std::size_t box)
        {
            const VoxelRange range = grid.voxels_of_box(box);
            const std::int32_t first = piece_of_voxel[grid.index(range.first)];
            bool is_mixed = false;
            for_each_voxel(
                range, [&](const Eigen::Vector3i& voxel)
                { is_mixed = is_mixed || piece_of_voxel[grid.index(voxel)] != first; });
            piece_of_box[box] = is_mixed ? kMixed : first;
        });
}

std::int32_t Deformation::Map::piece_of(const Eigen::Vector3i& voxel) const
{
    const std::int32_t of_box = piece_of_box[grid.box(voxel)];
    return of_box == kMixed ? piece_of_voxel[grid.index(voxel)] : of_box;
}

/// A sample of the session's model is in the cell that it has there.
int Deformation::Map::cell_at(const Eigen::Vector3d& x) const
{
    const std::int32_t piece = piece_at(
        grid, [&](const Eigen::Vector3i& voxel) { return piece_of(voxel); }, x);
    return piece >= 0 ? piece : -2 - piece_of(grid.locate(x));
}

void Deformation::Map::read_cells(const StoredField& stored)
{
    cells.cells.resize(stored.edges.size());
    for (std::size_t c = 0; c < cells.size(); ++c)
    {
        Cell& cell = cells.cells[c];
        cell.box_centre = vector_at(stored.box_centres, c);
        cell.edge = stored.edges[c];
        cell.centre = vector_at(stored.centres, c);
    }
    cells.first_neighbour = stored.first_neighbour;
    cells.neighbours = stored.neighbours;
}

FieldParts Deformation::Map::read_field(const StoredField& stored)
{
    FieldParts parts;
    parts.kind = static_cast<FieldKind>(stored.kind);
    for (std::size_t c = 0; c < cells.size(); ++c)
        parts.poses.push_back(
            {by_rows(stored.poses.data() + 12 * c), vector_at(stored.poses, 4 * c + 3)});
    parts.is_idle.assign(stored.is_idle.begin(), stored.is_idle.end());
    parts.num_centres = stored.num_centres;
    parts.residual = stored.residual;
    if (is_dense(parts.kind))
        parts.global = fit_at(stored, 0);
    if (parts.kind == FieldKind::Rbf)
    {
        auto clusters = std::make_shared<Clusters>();
        clusters->first_membership = stored.first_membership;
        for (std::size_t m = 0; m < stored.membership_fits.size(); ++m)
            clusters->memberships.push_back(
                {stored.membership_fits[m], stored.membership_weights[m]});
        LocalRbf::Fits fits;
        for (std::size_t i = 0; i + 1 < stored.first_centre.size(); ++i)
            fits.push_back(fit_at(stored, i));
        parts.local.emplace(std::move(clusters), std::move(fits));
    }
    for (const StoredRegion& region : stored.regions)
    {
        std::vector<RegionFade::Node> nodes;
        MovedRegion moved;
        for (std::size_t i = 0; i < region.node_cells.size(); ++i)
        {
            nodes.push_back({vector_at(region.nodes, i), region.node_cells[i]});
            FieldValue& miss = moved.misses.emplace_back();
            miss.displacement = vector_at(region.misses, 4 * i);
            miss.gradient =
                Eigen::Map<const Eigen::Matrix3d>(region.misses.data() + 12 * i + 3);
        }
        moved.fade = &fades.emplace_back(cells, nodes, region.near_cells, region.radius);
        moved.motion = {by_rows(region.motion.data()),
                        Eigen::Vector3d(region.motion.data() + 9)};
        moved.may_turn = region.may_turn == 1;
        moved.bends = region.may_turn == 2;
        moved.deep_cells = region.deep_cells;
        parts.regions.push_back(std::move(moved));
    }
    return parts;
}

void Deformation::Map::carry(const Carried& carried) const
{
    std::vector<Eigen::Vector3d> work(carried.places.size());
    std::vector<int> own(carried.places.size());
    parallel_ranges(work.size(), 1024,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                        {
                            work[i] = frame.to_work(carried.places[i]);
                            if (!(work[i].cwiseAbs().maxCoeff() <= kFarthest))
                                throw Error(Fault::Malformed,
                                            "a point is too far from the field's box "
                                            "(more than 1e100 of its size)");
                            own[i] = cell_at(work[i]);
                        }
                    });
    cellwarp::core::apply_field(*field, frame, work, own, carried);
}

double memory_of(const FieldFile& file)
{
    double bytes = 0.0, largest = 0.0;
    for (const StoredField& stage : file.stages)
    {
        const double voxels = num_voxels_of(stage);
        const double leaf = stage.voxels_per_leaf;
        bytes += (kBytesPerVoxel + kBytesPerBox / (leaf * leaf * leaf)) * voxels +
                 kBytesPerCell * static_cast<double>(stage.edges.size()) +
                 kCopies * bytes_of_numbers(stage);
        largest = std::max(largest, kBytesPerSpreadVoxel * voxels);
    }
    return bytes + largest;
}

Deformation::Deformation(const FieldFile& file, const std::string& path,
                         double max_memory)
    : checksum_(file.checksum)
{
    const double bytes = memory_of(file);
    if (max_memory > 0 && bytes > max_memory)
    {
        double voxels = 0.0;
        for (const StoredField& stage : file.stages)
            voxels += num_voxels_of(stage);
        throw Error(Fault::Budget,
                    at({path, 0, ""}, "the field needs about " + in_bytes(bytes) +
                                          " for " + shortest(voxels) + " voxels (limit " +
                                          in_bytes(max_memory) + ")"));
    }
    most_kept_ = kMostKept;
    if (max_memory > 0)
        most_kept_ = std::clamp(max_memory - bytes - kBytesForParts, 0.0, kMostKept);
    const double share = most_kept_ / static_cast<double>(file.stages.size());
    for (const StoredField& stage : file.stages)
        maps_.push_back(
            std::make_unique<const Map>(stage, path, static_cast<std::size_t>(share)));
}

Deformation::~Deformation() = default;
Deformation::Deformation(Deformation&&) noexcept = default;
Deformation& Deformation::operator=(Deformation&&) noexcept = default;

std::uint64_t Deformation::num_outside(std::span<const Eigen::Vector3d> places) const
{
    constexpr double kSlack = 0.05; // [diagonal]
    constexpr std::size_t kPlacesAtOnce = 4096;
    const WorkFrame& frame = maps_.front()->frame;
    const double slack = kSlack * frame.diagonal();
    const Eigen::Array3d high = frame.size.array() + slack;
    std::atomic<std::uint64_t> count = 0;
    parallel_ranges(places.size(), kPlacesAtOnce,
                    [&](std::size_t begin, std::size_t end)
                    {
                        std::uint64_t own = 0;
                        for (std::size_t i = begin; i < end; ++i)
                        {
                            const Eigen::Array3d x = frame.to_work(places[i]).array();
                            own += (x < -slack).any() || (x > high).any();
                        }
                        count += own;
                    });
    return count;
}

void Deformation::carry(const Carried& carried) const
{
    for (const std::unique_ptr<const Map>& map : maps_)
        map->carry(carried);
}

} // namespace cellwarp::core
