// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/held_points.h"

#include <algorithm>

#include "io/base/error.h"
#include "octree/base/index.h"
#include "solver/flesh/step_rows.h"

namespace cellwarp::core
{

using Eigen::Vector3d;

HeldPoints held_points(const FleshModel& model, const Lattice& lattice,
                       const CellOf& cell_of)
{
    HeldPoints out;
    for (const FleshHoldStatement& told : model.flesh().held)
    {
        const Vector3d x = model.to_metres(told.at);
        const int cell = cell_of(x);
        const std::optional<Vector3d> local =
            cell < 0 ? std::nullopt : local_place(lattice, cell, x);
        if (!local || local->minCoeff() < -kBeside || local->maxCoeff() > 1.0 + kBeside)
            throw malformed({model.scene.path, 0, told.field + ".at"},
                            "lies outside of the material");
        const NodeShares shares = shares_at(lattice, cell, *local);
        if (told.normal)
        {
            PulledPoint guided;
            guided.point = {shares, x};
            guided.normal = model.direction_of(*told.normal);
            out.guided.push_back({guided, model.to_metres(told.keys)});
            continue;
        }
        out.whole.push_back(
            {shares, x, static_cast<int>(model.skeleton->size() + out.holds.size())});
        out.holds.push_back(model.to_metres(told.keys));
    }
    return out;
}

void guide_what_is_not_bound(const FleshModel& model, const Flesh& flesh,
                             HeldPoints& held, std::vector<std::string>& warnings)
{
    const FreeShares shares(flesh.nodes(), flesh.lattice().places.size());
    const std::vector<int>& dropped = flesh.nodes().dropped;
    const std::size_t first = flesh.points().size() - held.whole.size();
    std::vector<HeldPoints::Guided> as_rows;
    std::size_t whole = 0, guided = 0;
    for (const FleshHoldStatement& told : model.flesh().held)
    {
        FleshPoint point;
        bool is_eliminated = false;
        std::size_t number = 0; // of the whole ones
        if (told.normal)
            point = held.guided[guided++].point.point;
        else
        {
            number = whole++;
            point = {held.whole[number].shares, held.whole[number].place};
            is_eliminated = !std::binary_search(dropped.begin(), dropped.end(),
                                                static_cast<int>(first + number));
            held.num_whole_guided += is_eliminated ? 0 : 1;
        }
        if (is_eliminated)
            continue;
        if (shares.of(point.shares).free.empty())
            warnings.push_back(at({model.scene.path, 0, told.field},
                                  "lies where bones or other held points have the flesh "
                                  "already: it is ignored"));
        else if (!told.normal)
        {
            HeldPoints::Guided& row = as_rows.emplace_back();
            row.point.point = point;
            row.point.goal = point.place;
            row.keys = held.holds[number];
            row.whole = static_cast<int>(number);
        }
    }
    held.guided.insert(held.guided.end(), as_rows.begin(), as_rows.end());
}

} // namespace cellwarp::core
