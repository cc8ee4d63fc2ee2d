// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/softness.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "octree/base/index.h"
#include "octree/base/point_tree.h"

namespace cellwarp::core
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

/// The sag of samples, by small strain, but where nothing holds them.
struct Sag
{
    double of_size = 0.0; ///< at the most [diagonal]
    double of_thickness =
        0.0; ///< at the most [flesh between the sample and what holds it]
};

Sag sag_in(const FleshBody& body, const Vector3d& gravity)
{
    Sag out;
    const FleshModel& model = *body.model;
    const std::vector<Vector3d> held = places_held(body);
    if (held.empty())
        return out;
    const PointTree tree(held);
    const std::vector<Motion> at_rest(body.first_own_motion() + body.own_motions.size());
    const Eigen::VectorXd u = body.flesh->sag(gravity, at_rest);
    const Lattice& lattice = body.flesh->lattice();
    for (std::size_t i = 0; i < body.cell_of_sample.size(); ++i)
    {
        const CornerNodes& cell = lattice.cells[idx(body.cell_of_sample[i])];
        if (body.is_loose[cell[0]])
            continue;
        const FleshPoint point = body.point_of_sample(i);
        const double sag = at_point(point.shares, u).norm();
        const double across =
            (lattice.places[idx(cell[7])] - lattice.places[idx(cell[0])]).norm();
        out.of_size = std::max(out.of_size, sag);
        out.of_thickness = std::max(
            out.of_thickness,
            sag /
                std::max(across, std::sqrt(tree.nearest(point.place).distance_squared)));
    }
    out.of_size /= model.metre * model.frame.diagonal();
    return out;
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
        sag_in(body, body.model->frame.axes * Vector3d(0.0, -kGravity, 0.0)).of_size;
    return sag > 0.0 && std::isfinite(sag) ? rounded_up(kFirstYoung * sag / kSag) : 0.0;
}

void warn_of_sag(FleshBody& body)
{
    const FleshModel& model = *body.model;
    const Vector3d& gravity = model.settings.gravity;
    if (gravity.isZero(0.0) || model.flesh().is_at_rest_as_drawn ||
        model.settings.law == FleshLaw::Regions)
        return; // the regions would make factors for it
    const Sag sag = sag_in(body, gravity);
    if (sag.of_size <= kMuchOfSize && sag.of_thickness <= kMuchOfThickness)
        return;
    const double more = std::max(sag.of_size / kSag, sag.of_thickness / kMuchOfThickness);
    body.warnings.push_back(at(
        {model.scene.path, 0, "skeleton.E"},
        fmt::format(
            "the flesh sags by {:.0f} % of its size and {:.0f} % of its "
            "thickness in its weight, or more: E {} sags by {:.0f} % of the "
            "size at the most",
            100.0 * std::min(sag.of_size, 1.0), 100.0 * std::min(sag.of_thickness, 1.0),
            shortest(rounded_up(model.materials[0].young * more)), 100.0 * kSag)));
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

} // namespace cellwarp::core
