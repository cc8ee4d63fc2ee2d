// SPDX-License-Identifier: GPL-3.0-or-later
// With S the share of a region at x, s_j that of its node j there, m that of the slopes,
// v_j the miss and G_j its slope, the correction is
//   sum a_j v_j + G_j c_j,   a_j = S s_j,  c_j = m a_j (x - x_j),
// whose factors a_j and c_j, and their slopes along a direction, depend on x alone.
#include "solver/field/fade_table.h"

#include <algorithm>

#include "octree/parallel.h"

namespace cellwarp
{

BlendInfluences::BlendInfluences(const Cells& cells, bool is_closest4) : closest_(cells)
{
    if (is_closest4)
        closest4_.emplace(cells);
}

void BlendInfluences::find(const Eigen::Vector3d& x, int own, Found& out) const
{
    closest_.influences(x, own, out.near);
    if (closest4_)
        closest4_->influences(x, out.base);
    else
        out.base = out.near;
}

FadeNodes::FadeNodes(const Cells& cells, const BlendInfluences& influences,
                     std::span<const FadedRegion> regions)
    : regions_(regions.begin(), regions.end())
{
    std::vector<const RegionFade*> fades;
    std::vector<std::vector<char>> is_carried;
    for (const FadedRegion& region : regions_)
    {
        fades.push_back(region.fade);
        first_node_.push_back(places_.size());
        const std::vector<Eigen::Vector3d>& nodes = region.fade->nodes();
        const std::vector<int>& own = region.fade->node_cells();
        places_.insert(places_.end(), nodes.begin(), nodes.end());
        own_.insert(own_.end(), own.begin(), own.end());
        region_of_node_.resize(places_.size(), static_cast<int>(fades.size()) - 1);
        std::vector<char>& carried = is_carried.emplace_back(cells.size(), char(false));
        for (const int cell : region.cells)
            carried[static_cast<std::size_t>(cell)] = true;
    }
    fades_ = RegionFades(std::move(fades), cells.size());
    follows_.assign(places_.size(), false);
    parallel_ranges(
        places_.size(), 256,
        [&](std::size_t begin, std::size_t end)
        {
            BlendInfluences::Found found;
            for (std::size_t i = begin; i < end; ++i)
            {
                influences.find(places_[i], own_[i], found);
                const std::vector<char>& carried =
                    is_carried[static_cast<std::size_t>(region_of_node_[i])];
                follows_[i] = std::all_of(
                    found.base.begin(), found.base.end(),
                    [&](const Influence& influence)
                    { return carried[static_cast<std::size_t>(influence.cell)]; });
            }
        });
}

void FadeNodes::add_terms(const Eigen::Vector3d& x,
                          std::span<const RegionFades::Share> shares,
                          const Eigen::Vector3d* direction,
                          std::vector<FadeTerm>& out) const
{
    RegionFade::NodeShares near;
    for (const RegionFades::Share& share : shares)
    {
        const std::size_t first = first_node_[static_cast<std::size_t>(share.region)];
        fades_.fade(share.region).node_shares(x, near);
        for (const RegionFade::NodeShare& node : near.nodes)
        {
            const std::size_t index = first + node.node;
            if (follows_[index])
                continue;
            const Eigen::Vector3d arm = x - places_[index];
            Eigen::Vector4d factors;
            factors[0] = share.value * node.value;
            factors.tail<3>() = near.slope * factors[0] * arm;
            if (direction)
            {
                const double change =
                    (share.value * node.gradient + share.gradient * node.value)
                        .dot(*direction);
                factors.tail<3>() = (near.slope * change +
                                     factors[0] * near.slope_gradient.dot(*direction)) *
                                        arm +
                                    near.slope * factors[0] * *direction;
                factors[0] = change;
            }
            FadeTerm& term = out.emplace_back();
            term.node = static_cast<std::uint32_t>(index);
            Eigen::Map<Eigen::Vector4f>(term.factors) = factors.cast<float>();
        }
    }
}

void FadeNodes::tabulate(const BlendInfluences& influences, std::span<const char> is_used)
{
    BlendInfluences::Found found;
    first_influence_.push_back(0);
    for (std::size_t i = 0; i < places_.size(); ++i)
    {
        if (!is_used[i])
            continue;
        used_.push_back(static_cast<std::uint32_t>(i));
        influences.find(places_[i], own_[i], found);
        influences_.insert(influences_.end(), found.base.begin(), found.base.end());
        first_influence_.push_back(influences_.size());
    }
    misses_.resize(places_.size());
}

void FadeNodes::find_misses(const Cells& cells, std::span<const Pose> poses,
                            std::span<const Motion> motions)
{
    const auto set = [](Eigen::Array4f& column, const Eigen::Vector3d& value)
    { column << value.cast<float>().array(), 0.0f; };
    parallel_ranges(
        used_.size(), 64,
        [&](std::size_t begin, std::size_t end)
        {
            for (std::size_t u = begin; u < end; ++u)
            {
                const std::size_t i = used_[u],
                                  r = static_cast<std::size_t>(region_of_node_[i]);
                const FieldValue field =
                    blended(std::span(influences_)
                                .subspan(first_influence_[u],
                                         first_influence_[u + 1] - first_influence_[u]),
                            poses, cells, places_[i]);
                const Eigen::Matrix3d turn = motions[r].R - Eigen::Matrix3d::Identity();
                NodeMiss& miss = misses_[i];
                set(miss.columns[0],
                    turn * places_[i] + motions[r].t - field.displacement);
                for (int k = 0; k < 3; ++k)
                    set(miss.columns[k + 1],
                        regions_[r].may_turn
                            ? Eigen::Vector3d::Zero()
                            : Eigen::Vector3d(turn.col(k) - field.gradient.col(k)));
            }
        });
}

void FadeSums::add(std::span<const FadeTerm> terms)
{
    terms_.insert(terms_.end(), terms.begin(), terms.end());
    first_term_.push_back(terms_.size());
}

void FadeSums::append(const FadeSums& other)
{
    const std::size_t before = terms_.size();
    terms_.insert(terms_.end(), other.terms_.begin(), other.terms_.end());
    for (std::size_t i = 1; i < other.first_term_.size(); ++i)
        first_term_.push_back(before + other.first_term_[i]);
}

void FadeSums::sum(std::span<const NodeMiss> misses)
{
    parallel_ranges(
        size(), 16 * kLanes,
        [&](std::size_t begin, std::size_t end)
        {
            for (std::size_t i = begin; i < end; ++i)
            {
                Eigen::Array4f total = Eigen::Array4f::Zero();
                for (std::size_t t = first_term_[i]; t < first_term_[i + 1]; ++t)
                    for (int k = 0; k < 4; ++k)
                        total += terms_[t].factors[k] * misses[terms_[t].node].columns[k];
                for (int k = 0; k < 3; ++k)
                    rows_[i / kLanes * 3 + static_cast<std::size_t>(k)].lane[i % kLanes] =
                        total[k];
            }
        });
}

} // namespace cellwarp
