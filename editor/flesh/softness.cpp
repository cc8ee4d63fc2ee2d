// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/flesh/softness.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/error.h"
#include "io/number.h"
#include "octree/base/index.h"
#include "octree/base/point_tree.h"

namespace cellwarp
{

namespace
{

using Eigen::Vector3d;

/// The rest places of the points that bones and scenes hold.
std::vector<Vector3d> places_held(const FleshBody& body)
{
    std::vector<Vector3d> places;
    const std::vector<HeldPoint>& points = body.flesh->points();
    for (std::size_t k = body.leaving.nodes.size(); k < points.size(); ++k)
        places.push_back(points[k].place);
    for (const HeldPoints::Guided& guided : body.held_points.guided)
        places.push_back(guided.point.point.place);
    return places;
}

/// By how much of the diagonal a sample sags at the most, but where nothing holds it.
double sag_in(const FleshBody& body, const Vector3d& gravity)
{
    const FleshModel& model = *body.model;
    const std::vector<Motion> at_rest(body.first_own_motion() + body.own_motions.size());
    const Eigen::VectorXd u = body.flesh->sag(gravity, at_rest);
    double most = 0.0;
    for (std::size_t i = 0; i < body.cell_of_sample.size(); ++i)
    {
        const int cell = body.cell_of_sample[i];
        if (!body.is_loose[idx(body.flesh->lattice().cells[idx(cell)][0])])
            most = std::max(most, at_point(body.point_of_sample(i).shares, u).norm());
    }
    return most / (model.metre * model.frame.diagonal());
}

double rounded_up(double value)
{
    const double digit = std::pow(10.0, std::floor(std::log10(value)) - 1.0);
    return std::ceil(value / digit * (1.0 - 1e-12)) * digit;
}

} // namespace

Softness softness_of(const FleshBody& body)
{
    Softness out;
    const FleshModel& model = *body.model;
    const double gravity = model.settings.gravity.norm();
    const std::vector<Vector3d> places = places_held(body);
    if (places.empty() || gravity == 0.0 || model.flesh().is_at_rest_as_drawn)
        return out;
    const PointTree tree(places);
    int softest = 0;
    for (const LatticePart& part : body.flesh->lattice().parts)
    {
        const FleshMaterial& material = model.materials[idx(part.material)];
        const double reach = std::sqrt(tree.nearest(part.centre).distance_squared);
        const double weight = material.density * gravity * reach / material.young;
        if (weight <= out.weight)
            continue;
        out.weight = weight;
        out.reach = reach;
        softest = part.material;
    }
    if (out.weight == 0.0)
        return out;
    out.young = rounded_up(out.weight * model.materials[idx(softest)].young);
    out.field = softest == 0 ? "skeleton.E"
                             : model.flesh().materials[idx(softest - 1)].field + ".E";
    return out;
}

double holding_stiffness(const FleshBody& body)
{
    constexpr double kGravity = 9.81; // [m/s^2]
    const double sag =
        sag_in(body, body.model->frame.axes * Vector3d(0.0, -kGravity, 0.0));
    return sag > 0.0 && std::isfinite(sag) ? rounded_up(kFirstYoung * sag / kSag) : 0.0;
}

void warn_of_sag(FleshBody& body)
{
    const FleshModel& model = *body.model;
    const Vector3d& gravity = model.settings.gravity;
    if (gravity.isZero(0.0) || model.flesh().is_at_rest_as_drawn ||
        model.settings.law == FleshLaw::Regions)
        return; // the regions would make factors for it
    if (const double sag = sag_in(body, gravity); sag > kMuch)
        body.warnings.push_back(
            at({model.scene.path, 0, "skeleton.E"},
               fmt::format("the flesh sags by {:.0f} % of its size in its weight, or "
                           "more: E {} sags by {:.0f} %",
                           100.0 * std::min(sag, 1.0),
                           shortest(rounded_up(model.materials[0].young * sag / kSag)),
                           100.0 * kSag)));
}

bool settles(const FleshBody& body)
{
    const FleshModel& model = *body.model;
    if (model.flesh().settles)
        return *model.flesh().settles;
    const bool has_loose_parts = std::find(body.is_loose.begin(), body.is_loose.end(),
                                           true) != body.is_loose.end();
    return !model.settings.gravity.isZero(0.0) && model.obstacles.empty() &&
           model.settings.law != FleshLaw::Regions && !has_loose_parts &&
           softness_of(body).weight <= kSoftest;
}

void refuse_without_rest(const FleshBody& body)
{
    const Softness softness = softness_of(body);
    if (softness.weight > kSoftest)
        throw malformed({body.model->scene.path, 0, softness.field},
                        fmt::format("flesh that reaches {:.3g} m beyond what holds it "
                                    "has no rest in its weight at this stiffness: E {} "
                                    "would do, or no settle",
                                    softness.reach, shortest(softness.young)));
}

} // namespace cellwarp
