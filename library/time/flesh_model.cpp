// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/flesh_model.h"

#include <set>
#include <utility>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "library/session/bone_regions.h"
#include "library/time/drawn_flesh.h"
#include "octree/base/index.h"
#include "octree/base/segment.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Cells of the lattice along the longest side.
constexpr int kAcross = 24;

/// How often cells are halved where detail is asked for.
constexpr int kDetailDepth = 2;

constexpr double kUsualTolerance = 1e-3, kTightTolerance = 1e-10;

/// What of a scene cannot be together.
void refuse_what_cannot_be(const SceneFile& scene)
{
    const FleshStatement& flesh = scene.skeleton->flesh;
    const auto refuse = [&](const char* key, const std::string& what) {
        throw malformed({scene.path, 0, std::string("skeleton.") + key}, what);
    };
    if (flesh.law == "regions" && flesh.newton > 1)
        refuse("newton", "is for other laws: regions are solved once a step");
    if (scene.time.integrator != "implicit-euler" && scene.time.integrator != "bdf2")
        throw malformed({scene.path, 0, "simulate.integrator"},
                        "got " + in_quotes(scene.time.integrator) +
                            ", flesh has implicit-euler and bdf2");
    for (const FleshRegion& material : flesh.materials)
        if (material.reference && flesh.lattice.empty())
            throw malformed({scene.path, 0, material.field + ".reference"},
                            "is of the cells of a lattice of a file");
}

FleshSettings flesh_settings(const FleshModel& model, bool is_tight)
{
    const FleshStatement& flesh = model.flesh();
    FleshSettings out;
    out.law = flesh.law == "linear"        ? FleshLaw::Linear
              : flesh.law == "regions"     ? FleshLaw::Regions
              : flesh.law == "stvk"        ? FleshLaw::StVenantKirchhoff
              : flesh.law == "neo-hookean" ? FleshLaw::NeoHookean
                                           : FleshLaw::Cells;
    out.alpha = flesh.alpha;
    out.beta = flesh.beta;
    const Triple& g = model.scene.time.gravity;
    out.gravity = model.frame.axes * Vector3d(g[0], g[1], g[2]);
    out.tolerance = is_tight ? kTightTolerance : kUsualTolerance;
    out.newton = static_cast<int>(flesh.newton);
    return out;
}

/// Runs \p call, whose errors name \p field of the scene.
template <class Call>
auto at_field(const FleshModel& model, const std::string& field, Call&& call)
{
    try
    {
        return call();
    }
    catch (const Error& error)
    {
        // It names a line of a file that nobody has.
        const bool is_of_text = error.file() == model.scene.path && error.line() > 0;
        throw Error(error.fault(),
                    at({model.scene.path, 0, field},
                       is_of_text ? at({"", 0, error.field()}, error.message()).text()
                                  : error.what()));
    }
}

RegionSet regions_of(const FleshModel& model, const std::vector<std::string>& selectors,
                     const std::string& field)
{
    std::vector<Region> regions = flesh_regions(model, selectors, field);
    return at_field(
        model, field,
        [&] { return RegionSet(model.rest, std::move(regions), model.scene.path); });
}

void take_obstacles(FleshModel& model)
{
    for (const ObstacleStatement& told : model.flesh().obstacles)
    {
        FleshObstacle obstacle;
        obstacle.friction = told.friction;
        if (told.plane)
        {
            const auto& [x, y, z, d] = *told.plane;
            const Vector3d normal(x, y, z);
            obstacle.normal = model.direction_of(normal);
            obstacle.offset = obstacle.normal->dot(
                model.to_metres(d / normal.norm() * normal.normalized()));
        }
        else
        {
            const auto& [x, y, z, r] = *told.sphere;
            obstacle.centre = model.to_metres({x, y, z});
            obstacle.radius = r * model.metre / model.frame.length_to_model(1.0);
        }
        model.obstacles.emplace_back(obstacle, model.to_metres(told.keys));
    }
}

/// And of each voxel of an octree the last region of another material that has it.
void take_materials(FleshModel& model)
{
    const FleshStatement& flesh = model.flesh();
    model.materials.push_back(
        {flesh.young.value_or(kFirstYoung), flesh.poisson, flesh.density});
    if (flesh.materials.empty())
        return;
    if (model.rest)
        model.material_of_voxel.assign(model.rest->material.grid.size(), 0);
    for (const FleshRegion& told : flesh.materials)
    {
        const int number = static_cast<int>(model.materials.size());
        FleshMaterial& material = model.materials.emplace_back(model.materials.front());
        material.young = told.young.value_or(material.young);
        material.poisson = told.poisson.value_or(material.poisson);
        material.density = told.density.value_or(material.density);
        if (model.rest)
            regions_of(model, {told.region}, told.field + ".region")
                .voxels(0)
                .for_each([&](std::size_t voxel)
                          { model.material_of_voxel[voxel] = number; });
    }
}

/// What the octree cuts; and the radii of the bones' tubes where they are not told.
void take_rest_shape(FleshModel& model)
{
    const FleshStatement& flesh = model.flesh();
    model.cells.across = static_cast<int>(flesh.across.value_or(kAcross));
    try
    {
        model.rest =
            build_rest_shape(*model.geometry, model.geometry->samples, model.cells);
    }
    catch (const Error& error)
    {
        if (error.fault() != Fault::Budget)
            throw;
        throw Error(Fault::Budget,
                    at({model.scene.path, 0, "skeleton.across"}, error.what()));
    }
    model.warnings.insert(model.warnings.end(), model.rest->warnings.begin(),
                          model.rest->warnings.end());
    SkeletonBinding binding;
    bone_regions(*model.skeleton, *model.rest, binding);
    for (TubeBone& bone : model.bones)
        for (const BoneBinding& bound : binding.bones)
            if (bound.name == model.skeleton->statement(idx(bone.line.motion)).name)
                bone.radius = model.metre * bound.radius;
    if (flesh.has_tube)
        model.tube_voxels =
            voxels_in_tubes(model.rest->material.grid, model.metre, model.bones);
    if (!flesh.fine_regions.empty())
        model.fine = std::make_shared<const RegionSet>(
            regions_of(model, flesh.fine_regions, "skeleton.detail_regions"));
}

/// The share of a bone's length along which it runs inside another one, but for a
/// hundredth of its length.
double share_along(const BoneLine& bone, const BoneLine& other)
{
    constexpr int kLooks = 64;
    int near = 0;
    for (int k = 0; k < kLooks; ++k)
    {
        const Vector3d x = bone.from + (k + 0.5) / kLooks * (bone.to - bone.from);
        const double t = nearest_share(other.from, other.to, x);
        near += (other.from + t * (other.to - other.from) - x).norm() <=
                0.01 * (bone.to - bone.from).norm();
    }
    return static_cast<double>(near) / kLooks;
}

/// Warns of bones of different joints that lie along each other: flesh cannot follow
/// both.
void warn_of_shared_places(FleshModel& model)
{
    constexpr double kMuch = 0.25;
    std::set<std::pair<int, int>> joints;
    for (const TubeBone& bone : model.bones)
        for (const TubeBone& other : model.bones)
            if (bone.line.motion != other.line.motion &&
                share_along(bone.line, other.line) > kMuch)
                joints.insert(std::minmax(bone.line.motion, other.line.motion));
    std::string pairs;
    for (const auto& [one, other] : joints)
        pairs += fmt::format("{}{} and {}", pairs.empty() ? "" : ", ",
                             model.skeleton->statement(idx(one)).name,
                             model.skeleton->statement(idx(other)).name);
    if (!pairs.empty())
        model.warnings.push_back(
            at({model.scene.path, 0, "skeleton.joints"},
               "bones hold the same place, and flesh cannot follow both where they move "
               "apart: " +
                   pairs));
}

} // namespace

std::vector<Region> flesh_regions(const FleshModel& model,
                                  const std::vector<std::string>& selectors,
                                  const std::string& field)
{
    return at_field(
        model, field,
        [&]
        {
            std::string text = "cellwarp-handles 1\n";
            for (std::size_t k = 0; k < selectors.size(); ++k)
                text += "fixed flesh" + std::to_string(k) + " " + selectors[k] + "\n";
            const HandleFile file = parse_handles(model.scene.path, text + "frame 1\n");
            return resolve_regions(file.stages.front().regions, *model.geometry,
                                   model.geometry->samples, model.units(), file);
        });
}

MaterialTest FleshModel::has_material() const
{
    return drawn ? drawn->forest.has_material() : material_test(rest->material.grid);
}

void FleshModel::check_cells(std::size_t size, int level) const
{
    if (static_cast<std::int64_t>(size) > cells.max_cells)
        throw Error(Fault::Budget,
                    at({scene.path, 0,
                        level > 0 ? "skeleton.max_depth"
                        : drawn   ? "skeleton.lattice"
                                  : "skeleton.across"},
                       fmt::format("at depth {} the lattice has {} cells, more than "
                                   "max_cells {}",
                                   level, size, cells.max_cells)));
}

Units FleshModel::units() const
{
    return {frame, false, bounding_box(geometry->samples), 0.0};
}

MoveKeys FleshModel::to_metres(MoveKeys of_model) const
{
    for (MoveKey& key : of_model)
        key.move.translation = metre * frame.vector_to_work(key.move.translation);
    return of_model;
}

Vector3d FleshModel::direction_of(const Vector3d& of_model) const
{
    return frame.axes * of_model.normalized();
}

std::shared_ptr<const FleshModel> flesh_model(std::shared_ptr<const Geometry> geometry,
                                              const SceneFile& scene,
                                              const SkeletonValues& skeleton,
                                              const CellSettings& cells, bool is_tight)
{
    refuse_what_cannot_be(scene);
    const auto model = std::make_shared<FleshModel>();
    model->geometry = std::move(geometry);
    model->scene = scene;
    model->cells = cells;
    model->frame = cells.frame ? given_frame(*cells.frame, cells.frame_file)
                               : automatic_frame(bounding_box(model->geometry->samples));
    model->metre = model->frame.length_to_model(1.0) * scene.time.unit;
    model->settings = flesh_settings(*model, is_tight);
    if (scene.time.viscosity > 0.0)
        model->warnings.push_back(at({scene.path, 0, "simulate.viscosity"},
                                     "is for rods, ignored: flesh has damping"));
    model->skeleton = std::make_shared<const SkeletonHandle>(skeleton.joints,
                                                             model->units(), scene.path);
    for (std::size_t j = 0; j < model->skeleton->size(); ++j)
        for (const auto& [from, to] : model->skeleton->bones(j))
            model->bones.push_back(
                {{model->metre * from, model->metre * to, static_cast<int>(j)},
                 model->metre * model->skeleton->told_radius(j).value_or(0.0)});
    warn_of_shared_places(*model);
    const FleshStatement& flesh = model->flesh();
    model->cells.min_depth = 0;
    model->cells.max_depth =
        static_cast<int>(flesh.max_depth.value_or(flesh.detail > 0.0 ? kDetailDepth : 0));
    if (flesh.detail > 0.0 && model->cells.max_depth == 0)
        model->warnings.push_back(
            at({scene.path, 0, "skeleton.detail"},
               "needs a max_depth above 0: cells are never halved"));
    if (flesh.lattice.empty())
        take_rest_shape(*model);
    else
        model->drawn =
            std::make_shared<const DrawnFlesh>(read_drawn_flesh(*model, model->warnings));
    take_materials(*model);
    take_obstacles(*model);
    return model;
}

} // namespace cellwarp::core
