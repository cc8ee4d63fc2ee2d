// SPDX-License-Identifier: GPL-3.0-or-later
// A plate of thickness t that is stretched by the strain e bends back to a plane within
// about t / sqrt(12 e) of where it is held. Around a small handle that has gone off by
// its own size the strain is large: the plate is a membrane in the shape of a tent, with
// a crease of its thickness along the handle's border. That is what sheet metal does, and
// nobody wants it who pulls at a car's roof. To bend over a length like the handle's
// radius r the plate has to be about as thick as the handle is wide. So around a small
// handle it resists bending as a plate of the thickness
//   2 r (1 - s(d / 5 r)),   s(x) = x^2 (3 - 2 x),
// at the distance d from the handle, where that is more than its own. It stretches, and
// turns in its plane, as it did.
//   Measured on a square of thickness 0.01, its handle of radius 0.04 raised by twice
// that [diagonal]: the sharpest fold between triangles of edge 0.018 is 16 degrees
// without, 9 with it. On a car's roof a reach of 2 r leaves a crease at the end of the
// reach, one of 5 r none.
//   Larger handles move a part of the shape rather than raise a bulge, and strips held at
// an end bend along one line, as strips do: both are left as they are, and with them
// bones, rings around a tube and what lies at several places. All is measured on voxels
// and on the sheet's patches, which are the same in all cells.
#include "library/session/border_bending.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>

#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "octree/base/smooth_step.h"

namespace cellwarp::core
{

namespace
{

/// Of a plate that bends right beside a handle as its border should [the radius].
constexpr double kThickness = 2.0;

/// How far around a handle its border is smoothed [its radius].
constexpr double kReach = 5.0;

/// Radius up to which a handle is small, and from which it is not [diagonal].
constexpr double kSmall = 0.05, kLarge = 0.1;

/// A handle is a disc if its spread about its centre is within these bounds of that of a
/// disc of its area, and if it is as near to the centre as this [its radius].
constexpr double kLeastSpread = 0.85, kLargestSpread = 1.25, kNearCentre = 0.5;

/// The share of the ring around a handle that is sheet, from which it counts as lying in
/// one, and with which it does wholly: at an edge it has half, at the end of a strip
/// less.
constexpr double kLeastShare = 0.3, kWholeShare = 0.5;

/// Where a region has sheets: measured on voxels, which a mirror image of the mesh has
/// alike.
struct Spot
{
    std::vector<Eigen::Vector3d> places; ///< its voxels' centres
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double radius = 0.0; ///< of a disc that is spread about its centre as it is

    Spot(const RestShape& rest, const VoxelRuns& voxels)
    {
        const VoxelGrid& grid = rest.material.grid;
        voxels.for_each(
            [&](std::size_t voxel)
            {
                if (rest.material.is_sheet[voxel])
                    places.push_back(grid.centre(grid.coordinates(voxel)));
            });
        const auto count = static_cast<double>(places.size());
        for (const Eigen::Vector3d& x : places)
            centre += x / count;
        double sum = 0.0;
        for (const Eigen::Vector3d& x : places)
            sum += (x - centre).squaredNorm() / count;
        radius = std::sqrt(2.0 * sum);
    }

    /// \p tree: of its places; \p area: of the sheets.
    bool is_disc(const PointTree& tree, double area) const
    {
        const double of_disc = radius * std::sqrt(std::numbers::pi / area);
        return of_disc > kLeastSpread && of_disc < kLargestSpread &&
               std::sqrt(tree.nearest(centre).distance_squared) < kNearCentre * radius;
    }
};

/// Finds what lies around one spot after another.
class AroundSpots
{
public:
    explicit AroundSpots(const Body& body)
        : body_(body), first_(body.cells.size() + 1, 0), seen_(body.cells.size(), kUnseen)
    {
        // The patches of each cell, in a row.
        std::vector<int> cells;
        for (const SheetPatch& patch : patches())
        {
            cells.push_back(body.pieces.at(body.rest->material.grid, patch.voxel));
            ++first_[idx(cells.back()) + 1];
        }
        std::partial_sum(first_.begin(), first_.end(), first_.begin());
        patches_.resize(cells.size());
        std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
        for (std::size_t k = 0; k < cells.size(); ++k)
            patches_[next[idx(cells[k])]++] = k;
    }

    /// Of the sheets in a region.
    double area_of(const RegionSet& regions, std::size_t region,
                   const RegionShares& shares) const
    {
        double area = 0.0;
        for (const auto& [cell, share] : shares.cells)
            for_each_patch(cell,
                           [&](const SheetPatch& patch)
                           {
                               if (regions.voxels(region).has(patch.voxel))
                                   area += patch.area;
                           });
        return area;
    }

    /// From cells that the spot has a share of along the glue, as far as \p reach from
    /// its places.
    void find(const PointTree& places, const RegionShares& shares, double reach)
    {
        for (const int cell : touched_)
            seen_[idx(cell)] = kUnseen;
        touched_.clear();
        near_.clear();
        for (const auto& [cell, share] : shares.cells)
            take(cell, true);
        for (std::size_t next = 0; next < near_.size(); ++next)
            for (const int cell : body_.cells.neighbours_of(near_[next]))
            {
                if (seen_[idx(cell)] != kUnseen)
                    continue;
                const Cell& of = body_.cells.cells[idx(cell)];
                // As far as it reaches itself.
                const double most = reach + 0.5 * std::sqrt(3.0) * of.edge;
                take(cell, places.nearest(of.box_centre).distance_squared < most * most);
            }
    }

    /// Of the sheets in the cells found, within \p reach of the places.
    double area_within(const PointTree& places, double reach) const
    {
        double area = 0.0;
        for (const int cell : near_)
            for_each_patch(cell,
                           [&](const SheetPatch& patch)
                           {
                               if (places.nearest(patch.centre).distance_squared <
                                   reach * reach)
                                   area += patch.area;
                           });
        return area;
    }

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
                if (seen_[idx(face->b)] == kNear)
                    visit(idx(face - faces.begin()));
        }
    }

private:
    static constexpr char kUnseen = 0, kNear = 1, kFar = 2;

    const std::vector<SheetPatch>& patches() const { return body_.rest->sheets.patches; }

    template <class Visit>
    void for_each_patch(int cell, Visit&& visit) const
    {
        for (std::size_t k = first_[idx(cell)]; k < first_[idx(cell) + 1]; ++k)
            visit(patches()[patches_[k]]);
    }

    void take(int cell, bool is_near)
    {
        seen_[idx(cell)] = is_near ? kNear : kFar;
        touched_.push_back(cell);
        if (is_near)
            near_.push_back(cell);
    }

    const Body& body_;
    std::vector<std::size_t> first_; ///< cells + 1 offsets into patches_
    std::vector<std::size_t> patches_;
    std::vector<char> seen_; ///< of each cell
    std::vector<int> touched_, near_;
};

} // namespace

std::vector<double> border_bending(const Body& body, const RegionSet& regions,
                                   std::span<const RegionShares> shares)
{
    std::vector<double> bending;
    const RestShape& rest = *body.rest;
    if (rest.sheets.patches.empty())
        return bending;
    const double thickness = rest.sheets.thickness;
    const double diagonal = rest.frame.diagonal();
    std::optional<AroundSpots> around; // which takes time where sheets are large
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        const Region& region = regions[r];
        // Much larger ones are not looked at patch by patch.
        if (!region.moves_as_one() || region.is_pin_of_one_place() || region.bone ||
            regions.box(r).size().norm() > 4.0 * kLarge * diagonal)
            continue;
        const Spot spot(rest, regions.voxels(r));
        const double radius = spot.radius;
        const double smallness =
            1.0 - smooth_step(kSmall * diagonal, kLarge * diagonal, radius);
        if (!(smallness > 0) || !(kThickness * radius > thickness))
            continue;
        if (!around)
            around.emplace(body);
        const double area = around->area_of(regions, r, shares[r]);
        const PointTree places(spot.places);
        if (!spot.is_disc(places, area))
            continue;
        const double reach = kReach * radius;
        around->find(places, shares[r], reach);
        const double ring =
            std::numbers::pi * (std::pow(radius + reach, 2) - radius * radius);
        const double share =
            smallness * smooth_step(kLeastShare, kWholeShare,
                                    (around->area_within(places, reach) - area) / ring);
        if (!(share > 0))
            continue;
        bending.resize(body.cells.faces.size(), 0.0);
        around->for_each_face(
            [&](std::size_t f)
            {
                const Face& face = body.cells.faces[f];
                const double distance =
                    std::sqrt(places.nearest(face.centre).distance_squared);
                const double thick =
                    kThickness * radius * (1.0 - smooth_step(0.0, reach, distance));
                const double more =
                    std::max(0.0, thick * thick - thickness * thickness) / 12.0;
                bending[f] = std::max(bending[f], share * face.sheet_share * more);
            });
    }
    return bending;
}

} // namespace cellwarp::core
