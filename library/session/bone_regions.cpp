// SPDX-License-Identifier: GPL-3.0-or-later
// The tube of a bone has half the median distance from places on the bone to the outside,
// unless its joint says; in a shell, whose bones are in the hollow, somewhat more than
// the median distance to the material, so that it holds the skin around. It ends
// max(radius, coarsest cell) before a joint that bends, on either side of it, but leaves
// two fifths of the bone. [theory-skeleton 9]
#include "library/session/bone_regions.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/base/error.h"
#include "octree/base/index.h"
#include "octree/base/segment.h"
#include "octree/distance_transform.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::Vector3i;
using Line = std::pair<Vector3d, Vector3d>;

/// Places on a bone where distances are measured.
constexpr int kPlacesOfBone = 17;

/// A tube holds the centre of a voxel wherever its line passes [voxel].
constexpr double kLeastRadius = 0.87;

/// The radius in a shell, of the distance to it.
constexpr double kGrip = 1.3;

/// Of a bone's length, what its ends leave.
constexpr double kMostCut = 0.6;

/// Material is far from a bone beyond this, of the bone's distance to the outside.
constexpr double kFar = 3.0;

/// Distances to the outside of a solid, or to the material of a shell.
class Distances
{
public:
    explicit Distances(const Material& material)
        : grid_(material.grid), is_solid_(material.method != InsideMethod::None)
    {
        VoxelFlags marks = grid_.material();
        if (is_solid_)
            for (std::size_t voxel = 0; voxel < marks.size(); ++voxel)
                marks[voxel] = !marks[voxel];
        squared_ = squared_distances(marks, grid_.counts());
    }
    bool is_solid() const { return is_solid_; }
    bool holds(const Vector3d& x) const
    {
        return (x.array() >= 0.0).all() &&
               (x.array() <= grid_.shape().size.array()).all();
    }
    bool is_material(const Vector3d& x) const
    {
        return holds(x) && grid_.material()[grid_.index(grid_.locate(x))];
    }
    /// Of a place in the box, whose faces are the outside as well.
    double at(const Vector3d& x) const
    {
        const double voxels =
            std::sqrt(static_cast<double>(squared_[grid_.index(grid_.locate(x))]));
        const double away = grid_.shape().voxel() * std::max(0.0, voxels - 0.5);
        return is_solid_
                   ? std::min({away, x.minCoeff(), (grid_.shape().size - x).minCoeff()})
                   : away;
    }

private:
    const VoxelGrid& grid_;
    bool is_solid_;
    std::vector<float> squared_; ///< [voxel]
};

struct Measured
{
    double inside = 0.0;   ///< share of places in the material
    double distance = 0.0; ///< median: to the outside, in a shell to the material
};

Measured measured(const std::vector<Line>& bones, const Distances& distances)
{
    std::vector<double> away;
    double inside = 0.0;
    for (const auto& [from, to] : bones)
        for (int k = 0; k < kPlacesOfBone; ++k)
        {
            const Vector3d x = from + (k + 0.5) / kPlacesOfBone * (to - from);
            inside += distances.is_material(x);
            if (distances.is_solid() ? distances.is_material(x) : distances.holds(x))
                away.push_back(distances.at(x));
        }
    const auto middle = away.begin() + std::ptrdiff_t(away.size() / 2);
    std::nth_element(away.begin(), middle, away.end());
    return {inside / static_cast<double>(kPlacesOfBone * bones.size()),
            away.empty() ? 0.0 : *middle};
}

/// Whether a joint turns its bones against that of its parent.
bool bends(const SkeletonHandle& skeleton, std::size_t joint)
{
    const int parent = skeleton.parent(joint);
    return parent >= 0 && !skeleton.bones(joint).empty() &&
           !skeleton.bones(idx(parent)).empty();
}

/// The bones of a joint without what lies near joints that bend.
std::vector<Line> cut_back(const SkeletonHandle& skeleton, std::size_t joint, double cut)
{
    std::vector<Line> lines;
    for (const Line& bone : skeleton.bones(joint))
    {
        bool bends_at_end = false;
        for (std::size_t child = 0; child < skeleton.size(); ++child)
            bends_at_end |= skeleton.parent(child) == static_cast<int>(joint) &&
                            skeleton.place(child) == bone.second &&
                            bends(skeleton, child);
        const Vector3d along = bone.second - bone.first;
        double first = bends(skeleton, joint) ? cut / along.norm() : 0.0;
        double last = bends_at_end ? cut / along.norm() : 0.0;
        if (const double both = first + last; both > kMostCut)
        {
            first *= kMostCut / both;
            last *= kMostCut / both;
        }
        lines.emplace_back(bone.first + first * along, bone.second - last * along);
    }
    return lines;
}

/// A tube about a line that was cut; round where nothing was cut.
RegionShape tube(const Line& line, const Line& bone, double radius,
                 const WorkFrame& frame)
{
    const Vector3d a = frame.to_model(line.first), b = frame.to_model(line.second);
    const double r = frame.length_to_model(radius);
    const bool is_cut_first = line.first != bone.first,
               is_cut_last = line.second != bone.second;
    const auto from_line = [=](const Vector3d& x)
    { return (x - a - nearest_share(a, b, x) * (b - a)).stableNorm(); };
    const auto is_beyond = [=](const Vector3d& x)
    {
        return (is_cut_first && (x - a).dot(b - a) < 0.0) ||
               (is_cut_last && (x - b).dot(b - a) > 0.0);
    };
    return {[=](const Vector3d& x) { return from_line(x) <= r && !is_beyond(x); },
            [=](const Vector3d& x) { return from_line(x) - r; },
            a.cwiseMin(b) - Vector3d::Constant(r), a.cwiseMax(b) + Vector3d::Constant(r)};
}

void find_far(const SkeletonHandle& skeleton, const RestShape& rest,
              const std::vector<std::pair<Line, double>>& reaches,
              SkeletonBinding& binding)
{
    // One voxel of a coarsest cell in eight tells as much as all of them.
    const VoxelGrid& grid = rest.material.grid;
    const int stride = std::max(1, grid.shape().voxels_per_coarsest() / 2);
    std::size_t all = 0, far = 0;
    double most = 0.0;
    for (int k = stride / 2; k < grid.counts().z(); k += stride)
        for (int j = stride / 2; j < grid.counts().y(); j += stride)
            for (int i = stride / 2; i < grid.counts().x(); i += stride)
            {
                if (!grid.material()[grid.index(i, j, k)])
                    continue;
                ++all;
                const Vector3d x = grid.centre({i, j, k});
                double away = INFINITY;
                bool is_near = false;
                for (const auto& [line, reach] : reaches)
                {
                    const double t = nearest_share(line.first, line.second, x);
                    const double d =
                        (line.first + t * (line.second - line.first) - x).norm();
                    is_near |= d <= kFar * reach;
                    away = std::min(away, d);
                }
                far += !is_near;
                if (!is_near && away > most)
                {
                    most = away;
                    binding.farthest = rest.frame.to_model(x);
                }
            }
    binding.far_share = all > 0 && skeleton.size() > 0
                            ? static_cast<double>(far) / static_cast<double>(all)
                            : 0.0;
}

} // namespace

std::vector<Region> bone_regions(const SkeletonHandle& skeleton, const RestShape& rest,
                                 SkeletonBinding& binding)
{
    const VoxelGrid& grid = rest.material.grid;
    const Distances distances(rest.material);
    std::vector<Region> regions;
    std::vector<std::pair<Line, double>> reaches;
    binding.joints = skeleton.size();
    for (std::size_t j = 0; j < skeleton.size(); ++j)
    {
        const std::vector<Line> bones = skeleton.bones(j);
        if (bones.empty())
            continue;
        const SkeletonJoint& statement = skeleton.statement(j);
        const Measured found = measured(bones, distances);
        const double radius =
            std::max(skeleton.told_radius(j).value_or(
                         (distances.is_solid() ? 0.5 : kGrip) * found.distance),
                     kLeastRadius * grid.shape().voxel());
        const double reach = std::max(found.distance, grid.shape().edge);
        Region region;
        region.role = Role::Bone;
        region.name = statement.name;
        region.line = statement.line;
        region.bone = Region::Bone{j, {}};
        const std::vector<Line> lines =
            cut_back(skeleton, j, std::max(radius, grid.shape().edge));
        for (std::size_t k = 0; k < lines.size(); ++k)
        {
            region.shapes.push_back(tube(lines[k], bones[k], radius, rest.frame));
            region.bone->lines.push_back(lines[k]);
            reaches.emplace_back(bones[k], reach);
        }
        binding.bones.push_back({statement.name, radius, found.inside, 0});
        regions.push_back(std::move(region));
    }
    find_far(skeleton, rest, reaches, binding);
    return regions;
}

std::vector<std::string> binding_warnings(const SkeletonBinding& binding,
                                          const std::string& file)
{
    constexpr double kMuch = 0.01; // of the material
    std::vector<std::string> warnings;
    if (!binding.outside.empty())
    {
        std::string names;
        for (const std::string& name : binding.outside)
            names += (names.empty() ? "" : ", ") + name;
        warnings.push_back(
            at({file, 0, "skeleton"},
               fmt::format("{} of {} bones meet no material and move nothing: {}",
                           binding.outside.size(),
                           binding.outside.size() + binding.bones.size(), names)));
    }
    if (binding.far_share > kMuch && !binding.bones.empty())
        warnings.push_back(at(
            {file, 0, "skeleton"},
            fmt::format("{:.0f} % of the material are far from every bone, the farthest "
                        "at {:.4g} {:.4g} {:.4g}",
                        100.0 * binding.far_share, binding.farthest.x(),
                        binding.farthest.y(), binding.farthest.z())));
    return warnings;
}

} // namespace cellwarp::core
