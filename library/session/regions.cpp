// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/regions.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "library/session/spline_region.h"
#include "octree/base/segment.h"

namespace cellwarp::core
{

namespace
{

/// The test of a geometric selector. Relative ones test points in the box's own
/// coordinates, where a flat axis is 0; distances are lengths of the model.
RegionShape shape_of(const Selector& selector, const Units& units)
{
    const std::vector<double>& n = selector.numbers;
    const Eigen::Vector3d low = units.box.low, size = units.box.size();
    // A sample this near to the border is on it, and held: rounding must not hold other
    // samples and voxels in the mirror image of a shape.
    const double slack = kCoincident * size.stableNorm();
    const bool is_relative = units.is_relative;
    const auto relative = [=](const Eigen::Vector3d& x)
    {
        Eigen::Vector3d u = x;
        if (is_relative)
            for (int k = 0; k < 3; ++k)
                u[k] = size[k] > 0 ? (x[k] - low[k]) / size[k] : 0.0;
        return u;
    };
    const auto absolute = [=](const Eigen::Vector3d& u)
    { return is_relative ? Eigen::Vector3d(low + u.cwiseProduct(size)) : u; };
    switch (selector.kind)
    {
    case Selector::Kind::Box:
    {
        const Eigen::Vector3d first(n[0], n[1], n[2]), last(n[3], n[4], n[5]);
        const Eigen::Vector3d unit = is_relative ? size : Eigen::Vector3d::Ones();
        Eigen::Array3d slacks = Eigen::Array3d::Constant(slack);
        if (is_relative)
            slacks = (size.array() > 0.0).select(slack / size.array(), 0.0);
        return {[=](const Eigen::Vector3d& x)
                {
                    const Eigen::Array3d u = relative(x).array();
                    return (u >= first.array() - slacks).all() &&
                           (u <= last.array() + slacks).all();
                },
                [=](const Eigen::Vector3d& x)
                {
                    const Eigen::Vector3d u = relative(x);
                    return (first - u)
                        .cwiseMax(u - last)
                        .cwiseMax(0.0)
                        .cwiseProduct(unit)
                        .norm();
                },
                absolute(first), absolute(last)};
    }
    case Selector::Kind::Sphere:
    case Selector::Kind::Capsule:
    {
        const Eigen::Vector3d a = absolute({n[0], n[1], n[2]});
        const bool is_capsule = selector.kind == Selector::Kind::Capsule;
        const Eigen::Vector3d b = is_capsule ? absolute({n[3], n[4], n[5]}) : a;
        const double r = n.back() * (is_relative ? size.norm() : 1.0);
        const auto from_axis = [=](const Eigen::Vector3d& x)
        { return (x - a - nearest_share(a, b, x) * (b - a)).stableNorm(); };
        return {[=](const Eigen::Vector3d& x) { return from_axis(x) <= r + slack; },
                [=](const Eigen::Vector3d& x) { return from_axis(x) - r; },
                a.cwiseMin(b) - Eigen::Vector3d::Constant(r),
                a.cwiseMax(b) + Eigen::Vector3d::Constant(r)};
    }
    case Selector::Kind::Halfspace:
    {
        const Eigen::Vector3d normal(n[0], n[1], n[2]);
        const double d = n[3];
        // How fast it comes nearer along a way of the model.
        Eigen::Vector3d slope = normal;
        if (is_relative)
            for (int k = 0; k < 3; ++k)
                slope[k] = size[k] > 0 ? normal[k] / size[k] : 0.0;
        const auto missing = [=](const Eigen::Vector3d& x)
        {
            const double of_normal = d - normal.dot(relative(x));
            // Across a flat axis it holds all or nothing.
            if (slope.isZero(0))
                return of_normal > 0 ? INFINITY : 0.0;
            return of_normal / slope.norm();
        };
        return {[=](const Eigen::Vector3d& x) { return missing(x) <= slack; }, missing};
    }
    default:
        return {[](const Eigen::Vector3d&) { return true; },
                [](const Eigen::Vector3d&) { return 0.0; }};
    }
}

/// The samples that a list selector names, without what coincides with them.
std::vector<std::uint32_t> listed_samples(const RegionStatement& statement,
                                          const Geometry& geometry,
                                          std::size_t num_samples, const HandleFile& file)
{
    const Selector& selector = statement.selector;
    const Where where{file.path, statement.line, statement.name};
    std::vector<std::uint32_t> listed;
    if (selector.kind == Selector::Kind::Indices)
    {
        for (const auto& [first, last] : selector.ranges)
            if (last >= static_cast<std::int64_t>(num_samples))
                throw malformed(where, "sample index is out of range (got " +
                                           std::to_string(last) + ", need 0 to " +
                                           std::to_string(num_samples - 1) + ")");
        // Ranges may overlap: each sample is listed once.
        auto ranges = selector.ranges;
        std::sort(ranges.begin(), ranges.end());
        std::int64_t next = 0;
        for (const auto& [first, last] : ranges)
            for (next = std::max(next, first); next <= last; ++next)
                listed.push_back(static_cast<std::uint32_t>(next));
        return listed;
    }
    if (selector.kind == Selector::Kind::Labels)
    {
        const auto labels = file.labels->read(selector.name);
        if (labels->size() != num_samples)
            throw malformed(where, selector.name + " has " +
                                       std::to_string(labels->size()) +
                                       " labels, need one for each of " +
                                       std::to_string(num_samples) + " samples");
        for (std::size_t i = 0; i < num_samples; ++i)
            if ((*labels)[i] == selector.label)
                listed.push_back(static_cast<std::uint32_t>(i));
    }
    else
    {
        bool is_known = false;
        for (const FaceGroup& group : geometry.groups)
            if (group.name == selector.name)
            {
                is_known = true;
                for (std::size_t f = group.first_face; f < group.end_face; ++f)
                    for (const std::uint32_t corner : geometry.face(f))
                        listed.push_back(corner);
            }
        if (!is_known)
            throw malformed(where, "the model has no group " + in_quotes(selector.name));
    }
    std::sort(listed.begin(), listed.end());
    listed.erase(std::unique(listed.begin(), listed.end()), listed.end());
    return listed;
}

Eigen::Vector3d centre_of(const Region& region,
                          const std::vector<Eigen::Vector3d>& samples,
                          const ModelBox& model)
{
    ModelBox box{Eigen::Vector3d::Constant(INFINITY),
                 Eigen::Vector3d::Constant(-INFINITY)};
    const auto include = [&](const Eigen::Vector3d& low, const Eigen::Vector3d& high)
    {
        box.low = box.low.cwiseMin(low);
        box.high = box.high.cwiseMax(high);
    };
    for (const std::uint32_t i : region.samples)
        include(samples[i], samples[i]);
    if (region.samples.empty())
        for (const RegionShape& shape : region.shapes)
            include(shape.low.cwiseMax(model.low).cwiseMin(model.high),
                    shape.high.cwiseMin(model.high).cwiseMax(model.low));
    return box.low.allFinite() ? box.centre() : model.centre();
}

/// From 0 to 1 along each side of the box.
Eigen::Vector3d place_in_box(const Eigen::Vector3d& x, const ModelBox& box)
{
    return (box.size().array() > 0.0)
        .select((x - box.low).array() / box.size().array(), 0.0);
}

bool is_geometric(Selector::Kind kind)
{
    return kind != Selector::Kind::Indices && kind != Selector::Kind::Labels &&
           kind != Selector::Kind::Group && kind != Selector::Kind::Spline;
}

} // namespace

bool Region::holds(const Eigen::Vector3d& model_point) const
{
    return std::any_of(shapes.begin(), shapes.end(),
                       [&](const auto& shape) { return shape.holds(model_point); });
}

std::string nearest_sample_note(const Region& region,
                                const std::vector<Eigen::Vector3d>& samples)
{
    double least = INFINITY;
    std::size_t nearest = 0;
    for (const RegionShape& shape : region.shapes)
        for (std::size_t i = 0; i < samples.size(); ++i)
            if (const double d = shape.distance(samples[i]); d < least)
            {
                least = d;
                nearest = i;
            }
    if (region.shapes.empty())
        return " (it lists no sample)";
    if (std::isinf(least))
        return " (no sample can be in it)";
    const ModelBox box = bounding_box(samples);
    return fmt::format(" (the nearest sample, {}, is {:.4g} away, at {}, relative {})",
                       nearest, least, place_text(samples[nearest], box.size().norm()),
                       place_text(place_in_box(samples[nearest], box), 1.0));
}

std::string line_note(const Region& region)
{
    return region.line > 0 ? fmt::format(" (line {})", region.line) : "";
}

namespace
{

/// Those that it lists, or that lie in its shapes.
void find_samples(const std::vector<Eigen::Vector3d>& samples, const ModelBox& box,
                  Region& region)
{
    region.samples.clear();
    if (region.shapes.empty())
        region.samples = region.listed;
    else
    {
        std::vector<bool> is_listed(samples.size(), false);
        for (const std::uint32_t i : region.listed)
            is_listed[i] = true;
        for (std::size_t i = 0; i < samples.size(); ++i)
            if (is_listed[i] || region.holds(samples[i]))
                region.samples.push_back(static_cast<std::uint32_t>(i));
    }
    region.centre = centre_of(region, samples, box);
    region.is_at_one_place =
        !region.samples.empty() &&
        std::all_of(region.samples.begin(), region.samples.end(),
                    [&](std::uint32_t i)
                    {
                        return (samples[i] - samples[region.samples.front()]).norm() <=
                               kCoincident * box.size().norm();
                    });
}

} // namespace

void put_on_guides(std::span<const OnStatement> statements, const std::string& file,
                   std::vector<Region>& regions)
{
    const auto named = [&](const std::string& name)
    {
        return std::find_if(regions.begin(), regions.end(),
                            [&](const Region& region) { return region.name == name; });
    };
    for (const OnStatement& on : statements)
    {
        const auto pin = named(on.pin), guide = named(on.guide);
        if (pin == regions.end() || guide == regions.end())
            continue; // the file is not whole: it was refused
        if (!pin->is_at_one_place)
            throw malformed({file, on.line, on.pin},
                            "'on' needs a pin of one place; this one has " +
                                (pin->samples.empty()
                                     ? std::string("no sample")
                                     : std::to_string(pin->samples.size()) + " samples"));
        if (guide->spline && guide->spline->stiffness() > 0.0)
            throw malformed({file, on.line, on.pin},
                            guide->name + " pushes back: no pin stays on such a rod "
                                          "(leave out its stiffness, or use a curve)");
        pin->guide = Region::Guide{static_cast<std::size_t>(guide - regions.begin()),
                                   on.at, on.line};
    }
}

void check_lists(const std::vector<RegionStatement>& statements, const Geometry& geometry,
                 const HandleFile& file)
{
    for (const RegionStatement& statement : statements)
        if (!statement.spline && !is_geometric(statement.selector.kind))
            listed_samples(statement, geometry, geometry.samples.size(), file);
}

std::vector<Region> resolve_regions(const std::vector<RegionStatement>& statements,
                                    const Geometry& geometry,
                                    const std::vector<Eigen::Vector3d>& samples,
                                    const Units& units, const HandleFile& file,
                                    const CoincidentSamples* known_coincident,
                                    std::span<const LedRod> led_rods)
{
    std::vector<Region> regions;
    std::map<std::string, std::size_t> by_name;
    std::vector<std::pair<const RegionStatement*, std::size_t>> of_skeleton;
    for (const RegionStatement& statement : statements)
    {
        const auto [found, is_new] = by_name.try_emplace(statement.name, regions.size());
        if (is_new)
        {
            Region region;
            region.role = statement.role;
            region.name = statement.name;
            region.factor = statement.factor;
            region.line = statement.line;
            regions.push_back(std::move(region));
        }
        Region& region = regions[found->second];
        if (region.factor != statement.factor)
            throw malformed({file.path, statement.line, statement.name},
                            "has another factor than on line " +
                                std::to_string(region.line) + " (got " +
                                shortest(statement.factor) + ", need " +
                                shortest(region.factor) + ")");
        if (statement.spline && statement.spline->form != SplineStatement::Form::Skeleton)
        {
            std::vector<Eigen::Vector3d> points;
            for (const Eigen::Vector3d& point : statement.spline->points)
                points.push_back(units.point(point));
            put_spline(statement, points, units, file.path, region);
        }
        else if (statement.spline)
            of_skeleton.emplace_back(&statement, found->second);
        else if (is_geometric(statement.selector.kind))
            region.shapes.push_back(shape_of(statement.selector, units));
        else
        {
            const std::vector<std::uint32_t> more =
                listed_samples(statement, geometry, samples.size(), file);
            std::vector<std::uint32_t> all;
            std::set_union(region.listed.begin(), region.listed.end(), more.begin(),
                           more.end(), std::back_inserter(all));
            region.listed = std::move(all);
        }
    }
    for (const LedRod& rod : led_rods)
    {
        if (!by_name.try_emplace(rod.name, regions.size()).second)
            throw malformed({file.path, 0, rod.name},
                            "a rod of the scene has this name as well");
        Region region;
        region.role = Role::Rod;
        region.name = rod.name;
        put_led_rod(rod, units, region);
        regions.push_back(std::move(region));
    }
    std::optional<CoincidentSamples> own_coincident;
    const auto coincident = [&]() -> const CoincidentSamples&
    {
        if (!known_coincident && !own_coincident)
            own_coincident.emplace(samples, kCoincident * units.box.size().norm());
        return known_coincident ? *known_coincident : *own_coincident;
    };
    for (Region& region : regions)
    {
        if (!region.listed.empty())
            region.listed = coincident().of(region.listed);
        find_samples(samples, units.box, region);
    }
    for (const auto& [statement, r] : of_skeleton)
    {
        std::vector<std::uint32_t> near;
        if (const std::string& name = statement->spline->near; !name.empty())
        {
            const auto found = by_name.find(name);
            if (found == by_name.end() || regions[found->second].samples.empty())
                throw malformed({file.path, statement->line, statement->name},
                                "near: " + in_quotes(name) +
                                    " is no region with samples of this stage");
            near = regions[found->second].samples;
        }
        put_spline(*statement,
                   centre_points(*statement, geometry, samples, near, units, file.path),
                   units, file.path, regions[r]);
        find_samples(samples, units.box, regions[r]);
    }
    return regions;
}

} // namespace cellwarp::core
