// SPDX-License-Identifier: GPL-3.0-or-later
// A plate of thickness t that is stretched by the strain e bends back to a plane within
// about t / sqrt(12 e) of where it is held. Around a small handle that has gone off by
// its own size the strain is large: the plate is a membrane in the shape of a tent, with
// a crease of its thickness along the handle's border. That is what sheet metal does, and
// nobody wants it who pulls at a car's roof. To bend over a length like the handle's
// radius r the plate has to be about as thick as the handle is wide. So around a small
// handle its resistance to bending, and that alone, is the one of a plate with the
// thickness
//   2 r (1 - s(d / 5 r)),   s(x) = x^2 (3 - 2 x),
// at the distance d from the handle, where that is more than its own. It stretches as it
// did.
//   Measured on a square of thickness 0.01, its handle of radius 0.04 raised by twice
// that [diagonal]: the sharpest fold between triangles of edge 0.018 is 16 degrees
// without, 11 with thickness r, 9 with 2 r. On a car's roof a reach of 2 r leaves a
// crease at the end of the reach, one of 5 r none.
//   Larger handles move a part of the shape rather than raise a bulge, and strips held at
// an end bend along one line, as strips do: both are left as they are.
#include "editor/session/border_bending.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "octree/base/index.h"
#include "octree/base/point_tree.h"

namespace cellwarp
{

namespace
{

/// Of a plate that bends right beside a handle as its border should [the radius].
constexpr double kThickness = 2.0;

/// How far around a handle its border is smoothed [its radius].
constexpr double kReach = 5.0;

/// Radius up to which a handle is small, and from which it is not [diagonal].
constexpr double kSmall = 0.05, kLarge = 0.1;

/// The share of the ring around a handle that is sheet, from which it counts as lying in
/// one, and with which it does wholly: at an edge it has half, at the end of a strip
/// less.
constexpr double kLeastShare = 0.3, kWholeShare = 0.5;

/// From 0 up to \p low to 1 from \p high on.
double smooth_step(double low, double high, double x)
{
    const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

std::vector<Eigen::Vector3d> centres_of_voxels(const Body& body, const RegionSet& regions,
                                               std::size_t region)
{
    const VoxelGrid& grid = body.rest->material.grid;
    std::vector<Eigen::Vector3d> centres;
    for (const std::uint32_t voxel : regions.voxels(region))
        centres.push_back(grid.centre(grid.coordinates(voxel)));
    return centres;
}

/// Of the disc that lies about its centre as the points do about theirs.
double radius_of(const std::vector<Eigen::Vector3d>& points)
{
    const auto count = static_cast<double>(points.size());
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& x : points)
        mean += x / count;
    double sum = 0.0;
    for (const Eigen::Vector3d& x : points)
        sum += (x - mean).squaredNorm();
    return std::sqrt(2.0 * sum / count);
}

/// Finds what lies around one handle after another.
class Surroundings
{
public:
    explicit Surroundings(const Body& body)
        : body_(body), areas_(body.cells.size(), 0.0), is_near_(body.cells.size(), 0)
    {
        for (const SheetPatch& patch : body.rest->sheets.patches)
            areas_[idx(body.pieces.at(body.rest->material.grid, patch.voxel))] +=
                patch.area;
    }

    /// From the handle's \p own cells along the glue, as far as \p reach.
    void find(const PointTree& handle, const std::vector<int>& own, double reach)
    {
        for (const int cell : near_)
            is_near_[idx(cell)] = 0;
        near_ = own;
        for (const int cell : near_)
            is_near_[idx(cell)] = 1;
        area_ = 0.0;
        for (std::size_t next = 0; next < near_.size(); ++next)
            for (const int cell : body_.cells.neighbours_of(near_[next]))
            {
                const Eigen::Vector3d& middle = body_.cells.cells[idx(cell)].middle;
                if (is_near_[idx(cell)] ||
                    handle.nearest(middle).distance_squared > reach * reach)
                    continue;
                is_near_[idx(cell)] = 1;
                near_.push_back(cell);
                area_ += areas_[idx(cell)];
            }
    }

    /// Of the sheets in the cells found, without the handle's own.
    double area() const { return area_; }

    /// Calls visit(f) for the faces between the cells found.
    template <class Visit>
    void for_each_face(Visit&& visit) const
    {
        const std::vector<Face>& faces = body_.cells.faces;
        for (const int cell : near_)
        {
            auto face = std::lower_bound(faces.begin(), faces.end(), cell,
                                         [](const Face& f, int a) { return f.a < a; });
            for (; face != faces.end() && face->a == cell; ++face)
                if (is_near_[idx(face->b)])
                    visit(idx(face - faces.begin()));
        }
    }

private:
    const Body& body_;
    std::vector<double> areas_; ///< of the sheets in each cell
    std::vector<char> is_near_;
    std::vector<int> near_;
    double area_ = 0.0;
};

} // namespace

std::vector<double> border_bending(const Body& body, const RegionSet& regions,
                                   std::span<const int> region_of_cell)
{
    std::vector<double> bending;
    const RestShape& rest = *body.rest;
    if (rest.sheets.patches.empty())
        return bending;
    const double thickness = rest.sheets.thickness;
    const double diagonal = rest.frame.diagonal();
    std::vector<std::vector<int>> cells_of_region(regions.size());
    for (std::size_t c = 0; c < region_of_cell.size(); ++c)
        if (region_of_cell[c] >= 0)
            cells_of_region[idx(region_of_cell[c])].push_back(static_cast<int>(c));
    Surroundings around(body);
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        // Much larger ones are not looked at voxel by voxel.
        if (!regions[r].moves_as_one() || cells_of_region[r].empty() ||
            regions.voxels(r).empty() ||
            regions.box(r).size().norm() > 4.0 * kLarge * diagonal)
            continue;
        const std::vector<Eigen::Vector3d> voxels = centres_of_voxels(body, regions, r);
        const double radius = radius_of(voxels);
        const double smallness =
            1.0 - smooth_step(kSmall * diagonal, kLarge * diagonal, radius);
        if (!(smallness > 0) || kThickness * radius <= thickness)
            continue;
        const PointTree handle(voxels);
        const double reach = kReach * radius;
        around.find(handle, cells_of_region[r], reach);
        const double ring =
            std::numbers::pi * (std::pow(radius + reach, 2) - radius * radius);
        const double share =
            smallness * smooth_step(kLeastShare, kWholeShare, around.area() / ring);
        if (!(share > 0))
            continue;
        bending.resize(body.cells.faces.size(), 0.0);
        around.for_each_face(
            [&](std::size_t f)
            {
                const Face& face = body.cells.faces[f];
                const double distance =
                    std::sqrt(handle.nearest(face.centre).distance_squared);
                const double thick =
                    kThickness * radius * (1.0 - smooth_step(0.0, reach, distance));
                const double more =
                    std::max(0.0, thick * thick - thickness * thickness) / 12.0;
                bending[f] = std::max(bending[f], share * face.sheet_share * more);
            });
    }
    return bending;
}

} // namespace cellwarp
