// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/body.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/formats/face_triangles.h"
#include "library/session/flat.h"
#include "library/session/memory_limit.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/lids.h"

namespace cellwarp::core
{

namespace
{

/// Two voxels that share a face span sqrt 6 voxels: with voxels of gap / sqrt 6
/// no two parts farther apart than the gap touch voxels that share a face.
const double kVoxelsPerGap = std::sqrt(6.0);

/// A wider opening is worth a word before it is closed [diagonal].
constexpr double kWideOpening = 0.08;

/// By how much samples may lie outside a given frame [diagonal].
constexpr double kFrameSlack = 1e-6;

/// The automatic choice of across: the most cells that are no more than this.
constexpr std::size_t kTargetCells = 2500;
constexpr int kCandidates[] = {64, 56, 48, 40, 36, 32, 28, 24, 20, 16, 14, 12, 10, 8};

constexpr std::size_t kSamplesAtOnce = 4096; ///< of one thread

/// Voxels along the longest side that are enough to count cells.
constexpr double kProbeVoxels = 96.0;

/// Where samples leave openings this wide, in voxels, finer ones tell nothing: all that
/// is nearer than the opening is closed may be joined anyway.
constexpr double kVoxelsPerOpening = 16.0;

/// Voxels near an open surface or a cloud, where what encloses it is looked for: so many
/// take about a second. More than this only for what needs them by its gap.
constexpr double kMostOpenVoxels = 7.5e6;

/// Clouds of no more points than this get no finer cells and voxels than these resolve:
/// coarsest cells half as wide as the points are apart, so many voxels from one to the
/// next, and in all the voxels of kFewVoxels and kVoxelsPerPoint for each.
constexpr std::size_t kFewPoints = 1500;
constexpr double kVoxelsPerSpacing = 8.0, kFewVoxels = 3e5, kVoxelsPerPoint = 3e3;

/// The distance between the points of a small cloud; 0 for any other shape.
double spacing_of_few(const Shape& shape)
{
    return shape.is_cloud() && shape.samples.size() <= kFewPoints
               ? point_spacing(shape.samples)
               : 0.0;
}

/// What a sample takes from here on, with its motions, and what cells and fields do where
/// nothing is refined, as measured [byte]. Shells have several times as many cells.
constexpr double kBytesPerSample = 120.0, kBytesOfCells = 4e7, kBytesOfShellCells = 1e8;
/// What the squares of a point take where a cloud is a shell, as measured [byte].
constexpr double kBytesOfSquares = 4500.0;

/// Whether more than \p most leaves of the coarsest grid of \p shape hold voxels of the
/// material.
bool has_more_leaves(const VoxelGrid& grid, const GridShape& shape, std::size_t most)
{
    const Eigen::Vector3d corner =
        0.5 * (shape.size - shape.edge * shape.coarsest.cast<double>());
    std::array<std::vector<std::size_t>, 3> leaf_of; // of each line of voxels
    std::size_t step = 1;
    for (int axis = 0; axis < 3; ++axis)
    {
        for (int i = 0; i < grid.counts()[axis]; ++i)
        {
            Eigen::Vector3i voxel = Eigen::Vector3i::Zero();
            voxel[axis] = i;
            const double x = grid.centre(voxel)[axis] - corner[axis];
            leaf_of[idx(axis)].push_back(step *
                                         idx(std::clamp(static_cast<int>(x / shape.edge),
                                                        0, shape.coarsest[axis] - 1)));
        }
        step *= idx(shape.coarsest[axis]);
    }
    std::vector<char> is_counted(step, 0);
    std::size_t count = 0;
    for (int k = 0; k < grid.counts().z(); ++k)
        for (int j = 0; j < grid.counts().y(); ++j)
        {
            const std::uint8_t* const row = &grid.material()[grid.index(0, j, k)];
            char* const leaves = &is_counted[leaf_of[1][idx(j)] + leaf_of[2][idx(k)]];
            for (std::size_t i = 0; i < leaf_of[0].size(); ++i)
                if (row[i] && !leaves[leaf_of[0][i]])
                {
                    leaves[leaf_of[0][i]] = 1;
                    if (++count > most)
                        return true;
                }
        }
    return false;
}

/// A first look at a shape in larger voxels; none at a single point.
std::optional<Material> first_look(const Shape& shape, const BoundingSurface& surface,
                                   const Eigen::Vector3d& size, Fill fill,
                                   double max_voxel)
{
    const double longest = size.maxCoeff();
    if (!(longest > 0))
        return std::nullopt;
    return find_material(
        shape, surface,
        grid_shape(size, 8, 0, std::max(max_voxel, longest / kProbeVoxels)), fill);
}

/// The openings that samples leave, by a first look at them [length]; 0: none, or rays
/// tell what is inside.
double widest_opening(const Material& probe, const BoundingSurface& surface)
{
    return is_nearly_closed(surface) ? 0.0
                                     : 2.0 * std::max(probe.seal_radius, probe.spacing);
}

/// Volume of material tells how many cells a grid has before it is built. \p most_voxels:
/// near an open surface or a cloud. \p least_edge: of the cells [work].
int automatic_across(const Material& probe, const BoundingSurface& surface,
                     const Eigen::Vector3d& size, const CellSettings& settings,
                     double max_voxel, double most_voxels, double least_edge)
{
    const int last = std::end(kCandidates)[-1];
    const bool is_open = surface.open_edges > 0.0 && settings.fill == Fill::Solid;
    // Hollows are looked for in all of the box, and for few points all of it counts.
    const bool are_few = least_edge > 0.0;
    const double near = !is_open && !are_few ? 0.0
                        : are_few || probe.method == InsideMethod::Hollows
                            ? 1.0
                            : share_near(probe.grid);
    const auto near_voxels = [&](int across) {
        return near * num_voxels(grid_shape(size, across, settings.max_depth, max_voxel));
    };
    const double most = std::max(most_voxels, 1.5 * near_voxels(last));
    for (const int across : kCandidates)
        if (near_voxels(across) <= most && size.maxCoeff() >= across * least_edge &&
            !has_more_leaves(probe.grid, grid_shape(size, across, 0, 0.0), kTargetCells))
            return across;
    return last;
}

/// What a body with lids encloses is more than this [diagonal^3]: else it is a sheet.
constexpr double kLeastEnclosed = 1e-6;

/// Of a closed surface; of one whose triangles disagree about their sides too little.
double volume_within(const Shape& shape, const BoundingSurface& surface)
{
    double volume = 0.0;
    for (const auto& [a, b, c] : surface.triangles)
        volume += shape.samples[a].dot(shape.samples[b].cross(shape.samples[c])) / 6.0;
    return std::abs(volume);
}

/// Closes the openings of a mesh that has few; not of sheets and soups, which enclose
/// nothing then either. \p whole: what volumes are measured by.
bool put_lids_on(Shape& shape, double whole)
{
    if (!is_nearly_closed(bounding_surface(shape)))
        return false;
    Shape closed = with_lids(shape);
    if (volume_within(closed, bounding_surface(closed)) <= kLeastEnclosed * whole)
        return false;
    shape = std::move(closed);
    return true;
}

} // namespace

WorkFrame frame_of(const std::vector<Eigen::Vector3d>& samples,
                   const std::optional<Eigen::Vector3d>& normal,
                   const CellSettings& settings)
{
    if (settings.frame)
        return given_frame(*settings.frame, settings.frame_file);
    if (normal && (normal->array() == 0.0).count() < 2)
        return frame_along_plane(samples, *normal);
    return automatic_frame(bounding_box(samples));
}

std::optional<int> axis_across(const WorkFrame& frame, const Eigen::Vector3d& normal)
{
    int axis = 0;
    const Eigen::Vector3d in_frame = frame.axes * normal;
    in_frame.cwiseAbs().maxCoeff(&axis);
    if (!((in_frame - in_frame[axis] * Eigen::Vector3d::Unit(axis)).norm() <= kInPlane))
        return std::nullopt;
    return axis;
}

std::shared_ptr<const RestShape>
build_rest_shape(const Geometry& geometry, const std::vector<Eigen::Vector3d>& samples,
                 const CellSettings& settings)
{
    const std::optional<Eigen::Vector3d> normal = plane_normal(samples);
    const bool is_flat = settings.is_flat.value_or(false);
    if (is_flat && !normal)
        throw malformed({settings.frame_file, 0, "cells.flat"},
                        "the samples lie in no plane (to 1e-9 of the diagonal, or what "
                        "floats can tell)");
    WorkFrame frame = frame_of(samples, is_flat ? normal : std::nullopt, settings);
    int flat_axis = -1;
    if (is_flat)
    {
        const std::optional<int> across_it = axis_across(frame, *normal);
        if (!across_it)
            throw malformed(
                {settings.frame_file, 0, "cells.frame.axes"},
                "none of them is across the plane of the samples (cells.flat)");
        flat_axis = *across_it;
    }
    if (flat_axis >= 0)
    {
        // The plane is where that axis begins.
        const Eigen::Vector3d axis = frame.axes.row(flat_axis);
        frame.origin += axis.dot(samples.front() - frame.origin) * axis;
        frame.size[flat_axis] = 0.0;
    }
    Shape shape;
    shape.triangles = triangles_of(geometry);
    shape.lines = geometry.lines;
    shape.samples.resize(samples.size());
    parallel_for(samples.size(), kSamplesAtOnce,
                 [&](std::size_t i) { shape.samples[i] = frame.to_work(samples[i]); });
    if (settings.frame)
        for (std::size_t i = 0; i < shape.samples.size(); ++i)
        {
            const Eigen::Array3d slack =
                Eigen::Array3d::Constant(kFrameSlack * frame.diagonal());
            const Eigen::Array3d x = shape.samples[i].array();
            if ((x < -slack).any() || (x > frame.size.array() + slack).any())
                throw malformed({settings.frame_file, 0, "cells.frame"},
                                "does not hold sample " + std::to_string(i));
        }
    const std::size_t num_samples = shape.samples.size();
    std::vector<std::string> warnings;
    if (settings.has_lids && flat_axis < 0 &&
        !put_lids_on(shape, std::pow(frame.diagonal(), 3)))
        warnings.push_back("there is nothing that lids would enclose (--fill closed): "
                           "openings are closed as with --fill solid");
    const BoundingSurface surface = bounding_surface(shape);
    const double voxel_of_gap = settings.gap / kVoxelsPerGap * frame.diagonal();
    const double spacing = spacing_of_few(shape);
    const double most_voxels =
        spacing > 0.0
            ? std::min(kMostOpenVoxels,
                       kFewVoxels + kVoxelsPerPoint * static_cast<double>(samples.size()))
            : kMostOpenVoxels;
    double max_voxel = std::max(voxel_of_gap, spacing / kVoxelsPerSpacing);
    int across = std::max(settings.across, 1);
    bool is_shell = settings.fill == Fill::Shell;
    if (settings.across <= 0 || !is_nearly_closed(surface))
        if (const std::optional<Material> probe =
                first_look(shape, surface, frame.size, settings.fill, max_voxel))
        {
            is_shell = is_shell || probe->method == InsideMethod::None;
            max_voxel =
                std::max(max_voxel, widest_opening(*probe, surface) / kVoxelsPerOpening);
            if (settings.across <= 0)
                across = automatic_across(*probe, surface, frame.size, settings,
                                          max_voxel, most_voxels, 0.5 * spacing);
        }
    GridShape grid = grid_shape(frame.size, across, settings.max_depth, max_voxel);
    if (flat_axis >= 0 && frame.size.maxCoeff() > 0.0)
    {
        // In the middle of a layer of voxels the plane is in one layer of cells, of
        // whatever size.
        Eigen::Vector3d size = frame.size;
        size[flat_axis] = grid.voxel();
        grid = grid_shape(size, across, settings.max_depth, max_voxel);
    }
    const double others =
        (is_shell ? kBytesOfShellCells : kBytesOfCells) +
        (kBytesPerSample + (is_shell && shape.is_cloud() ? kBytesOfSquares : 0.0)) *
            static_cast<double>(samples.size());
    const double bytes = memory_with(
        material_bytes(surface, grid, settings.fill) + others, settings.max_memory);
    if ((settings.max_memory > 0 && bytes > settings.max_memory) ||
        num_voxels(grid) > 4e9)
    {
        const double coarser =
            material_bytes(surface,
                           grid_shape(frame.size, across, settings.max_depth,
                                      std::max(max_voxel, 2.0 * voxel_of_gap)),
                           settings.fill) +
            others + resident_memory();
        const std::string way =
            coarser < 0.9 * bytes
                ? fmt::format("a --gap of {:.2g} needs {}", 2.0 * settings.gap,
                              in_bytes(coarser))
                : "a smaller --across or --max-depth, or fewer samples, need less";
        throw Error(
            Fault::Budget,
            fmt::format("{} samples and {:.3g} voxels need about {} (limit {}): {}",
                        samples.size(), num_voxels(grid), in_bytes(bytes),
                        settings.max_memory > 0 ? in_bytes(settings.max_memory) : "none",
                        way));
    }
    Parts parts;
    Material material =
        settings.joins_parts
            ? find_material(shape, surface, grid, settings.fill)
            : material_of_parts(shape, surface, grid, settings.fill, parts);
    if (grid.voxel() > voxel_of_gap * (1.0 + 1e-9))
        material.joins_below =
            std::max(material.joins_below, kVoxelsPerGap * grid.voxel());
    if (settings.fill == Fill::Solid && flat_axis < 0)
        material.notches = find_notches(shape, surface, material.grid);
    const bool can_have_lids = !settings.has_lids && flat_axis < 0 && !shape.is_cloud() &&
                               is_nearly_closed(surface);
    const auto lids_would_enclose = [&]
    {
        Shape closed = shape;
        return can_have_lids && put_lids_on(closed, std::pow(frame.diagonal(), 3));
    };
    if (settings.fill == Fill::Solid && material.method == InsideMethod::None &&
        flat_axis < 0)
        warnings.push_back(
            std::string("nothing is enclosed: the shape is treated as a shell") +
            (lids_would_enclose() ? " (--fill closed puts lids on its openings)" : ""));
    const double opening = 2.0 * material.seal_radius / frame.diagonal();
    if (opening > kWideOpening)
        warnings.push_back(
            fmt::format("an opening of about {:.2g} of the diagonal is taken as closed: "
                        "the shape is solid (--fill shell leaves it open)",
                        opening));
    const double joined = material.joins_below / frame.diagonal();
    if (joined > settings.gap)
        warnings.push_back(fmt::format(
            "the samples leave openings: parts nearer than {:.4g} of the diagonal may be "
            "joined (gap raised from {:.4g}{})",
            joined, settings.gap,
            can_have_lids && material.method != InsideMethod::None
                ? "; --fill closed puts lids on them instead"
                : ""));
    if (!parts.touching.empty())
        warnings.push_back(fmt::format(
            "{} of {} parts of the mesh touch another one and are not glued to it "
            "(--join glues them)",
            parts.num_touching(), parts.count()));
    Sheets sheets =
        find_sheets(shape, surface, material, settings.thickness * frame.diagonal());
    // The tips of lids are no samples of the model.
    shape.samples.resize(num_samples);
    if (!parts.voxel_of_sample.empty())
        parts.voxel_of_sample.resize(num_samples);
    auto boundary = settings.has_contact
                        ? std::make_shared<const BoundaryPoints>(material.grid, flat_axis)
                        : nullptr;
    return std::make_shared<const RestShape>(RestShape{
        frame, std::move(shape.samples), std::move(material), std::move(parts),
        std::move(sheets), across,
        normal ? std::optional<Eigen::Vector3d>(frame.axes * *normal) : std::nullopt,
        flat_axis, std::move(warnings), std::move(boundary)});
}

const NearestSamples& RestShape::nearest_samples() const
{
    std::call_once(made_once->flag,
                   [&]
                   {
                       made_once->nearest_samples.emplace(material.grid, samples,
                                                          parts.voxel_of_sample,
                                                          material.notches);
                   });
    return *made_once->nearest_samples;
}

std::optional<Parts> mesh_parts(const Geometry& geometry)
{
    if (geometry.num_faces() == 0)
        return std::nullopt;
    Shape shape;
    shape.samples = geometry.samples;
    shape.triangles = triangles_of(geometry);
    shape.lines = geometry.lines;
    if (!may_have_parts(shape, bounding_surface(shape)))
        return Parts{{{0, geometry.samples.size()}}, {}, {}};
    return build_rest_shape(geometry, geometry.samples, CellSettings())->parts;
}

Body build_body(std::shared_ptr<const RestShape> rest, const CellSettings& settings)
{
    const VoxelGrid& grid = rest->material.grid;
    const MaterialTest has_material = material_test(grid);
    Octree octree(grid.shape(), has_material);
    const auto check_coarsest = [&](std::size_t num_cells)
    {
        if (static_cast<std::int64_t>(num_cells) > settings.max_cells)
            throw Error(
                Fault::Budget,
                fmt::format("the coarsest grid has {} cells, more than max_cells {}: use "
                            "a smaller --across",
                            num_cells, settings.max_cells));
    };
    check_coarsest(octree.leaves().size());
    std::vector<std::string> warnings;
    for (int level = 1; level <= settings.min_depth; ++level)
    {
        Octree finer = octree.split_all(level, has_material);
        if (static_cast<std::int64_t>(finer.leaves().size()) > settings.max_cells)
        {
            warnings.push_back(
                fmt::format("refinement stopped at depth {}: depth {} has {} "
                            "cells, more than max_cells {}",
                            level - 1, level, finer.leaves().size(), settings.max_cells));
            break;
        }
        octree = std::move(finer);
    }
    Body body = cut(std::move(rest), std::move(octree));
    if (settings.min_depth == 0)
        check_coarsest(body.cells.size()); // a leaf may hold several
    body.warnings = std::move(warnings);
    return body;
}

Body cut(std::shared_ptr<const RestShape> rest, Octree octree, const Body* earlier)
{
    const VoxelGrid& grid = rest->material.grid;
    std::optional<EarlierCells> from;
    if (earlier)
        from.emplace(EarlierCells{earlier->octree, earlier->pieces, earlier->cells});
    const Notches& notches = rest->material.notches;
    Pieces pieces = from ? find_pieces(grid, octree, notches, from->octree, from->pieces)
                         : find_pieces(grid, octree, notches);
    Cells cells = build_cells(grid, octree, pieces, rest->material.is_sheet, rest->sheets,
                              notches, from ? &*from : nullptr);
    std::vector<int> cell_of_sample(rest->samples.size());
    const std::vector<std::size_t>& voxels = rest->parts.voxel_of_sample;
    parallel_for(cell_of_sample.size(), kSamplesAtOnce,
                 [&](std::size_t i)
                 {
                     cell_of_sample[i] = voxels.empty()
                                             ? piece_at(grid, pieces, rest->samples[i])
                                             : pieces.at(grid, voxels[i]);
                 });
    return {std::move(rest),  std::move(octree),         std::move(pieces),
            std::move(cells), std::move(cell_of_sample), {}};
}

} // namespace cellwarp::core
