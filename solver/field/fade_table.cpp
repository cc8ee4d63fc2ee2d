// SPDX-License-Identifier: GPL-3.0-or-later
// With S the share of a region at x, s_j that of its node j there, m that of the slopes,
// v_j the miss and G_j its slope, the correction is
//   sum a_j v_j + G_j c_j,   a_j = S s_j,  c_j = m a_j (x - x_j),
// whose factors a_j and c_j, and their slopes along a direction, depend on x alone.
#include "solver/field/fade_table.h"

#include <algorithm>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

FadeTerm term(std::uint32_t node, double a, const Eigen::Vector3d& c)
{
    FadeTerm result;
    result.node = node;
    Eigen::Map<Eigen::Vector4f>(result.factors) << static_cast<float>(a), c.cast<float>();
    return result;
}

} // namespace

BlendInfluences::BlendInfluences(const Cells& cells, bool is_closest4) : closest_(cells)
{
    if (is_closest4)
        closest4_.emplace(cells);
}

void BlendInfluences::find(const Eigen::Vector3d& x, int own, Found& out) const
{
    closest_.influences(x, own, out.near);
    out.base = out.near;
    if (!closest4_)
        return;
    closest4_->influences(x, out.closest4);
    out.base = out.closest4;
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
            carried[idx(cell)] = true;
    }
    fades_ = RegionFades(std::move(fades), cells.size());
    follows_.assign(places_.size(), false);
    parallel_ranges(places_.size(), 256,
                    [&](std::size_t begin, std::size_t end)
                    {
                        BlendInfluences::Found found;
                        for (std::size_t i = begin; i < end; ++i)
                        {
                            influences.find(places_[i], own_[i], found);
                            const std::vector<char>& carried =
                                is_carried[idx(region_of_node_[i])];
                            follows_[i] =
                                std::all_of(found.base.begin(), found.base.end(),
                                            [&](const Influence& influence)
                                            { return carried[idx(influence.cell)]; });
                        }
                    });
}

template <class Add>
void FadeNodes::for_each_node(const Eigen::Vector3d& x, const RegionFades::Reach& reach,
                              const Add& add) const
{
    RegionFade::NodeShares near;
    for (const RegionFades::Share& share : reach.shares)
    {
        const std::size_t first = first_node_[idx(share.region)];
        fades_.fade(share.region).node_shares(x, reach.nearest[share.nearest], near);
        for (const RegionFade::NodeShare& node : near.nodes)
            if (!follows_[first + node.node])
                add(static_cast<std::uint32_t>(first + node.node), share, near, node);
    }
}

void FadeNodes::add_terms(const Eigen::Vector3d& x, const RegionFades::Reach& reach,
                          FadeTerms& out) const
{
    for_each_node(
        x, reach,
        [&](std::uint32_t index, const RegionFades::Share& share,
            const RegionFade::NodeShares& near, const RegionFade::NodeShare& node)
        {
            const double a = share.value * node.value;
            out.push_back(term(index, a, near.slope * a * (x - places_[index])));
        });
}

void FadeNodes::add_slope_terms(const Eigen::Vector3d& x, const RegionFades::Reach& reach,
                                std::span<const Eigen::Vector3d> directions,
                                std::span<FadeTerms> out) const
{
    for_each_node(
        x, reach,
        [&](std::uint32_t index, const RegionFades::Share& share,
            const RegionFade::NodeShares& near, const RegionFade::NodeShare& node)
        {
            const double a = share.value * node.value;
            const Eigen::Vector3d slope =
                share.value * node.gradient + share.gradient * node.value;
            const Eigen::Vector3d arm = x - places_[index];
            for (std::size_t k = 0; k < directions.size(); ++k)
            {
                const Eigen::Vector3d& t = directions[k];
                const double a_slope = slope.dot(t);
                out[k].push_back(
                    term(index, a_slope,
                         (near.slope * a_slope + a * near.slope_gradient.dot(t)) * arm +
                             near.slope * a * t));
            }
        });
}

void FadeNodes::tabulate(const BlendInfluences& influences,
                         std::span<const std::span<FadeTerm>> terms)
{
    constexpr std::uint32_t kUnused = 0xffffffff;
    std::vector<std::uint32_t> number(places_.size(), kUnused);
    for (const std::span<FadeTerm> list : terms)
        for (FadeTerm& one : list)
        {
            if (number[one.node] == kUnused)
            {
                number[one.node] = static_cast<std::uint32_t>(used_.size());
                used_.push_back(one.node);
            }
            one.node = number[one.node];
        }
    BlendInfluences::Found found;
    first_influence_.push_back(0);
    for (const std::uint32_t i : used_)
    {
        influences.find(places_[i], own_[i], found);
        influences_.insert(influences_.end(), found.base.begin(), found.base.end());
        first_influence_.push_back(influences_.size());
    }
    misses_.assign(used_.size(), NodeMiss{});
}

void FadeNodes::find_misses(std::span<const AffineMap> maps)
{
    const std::span<const AffineMap> of_regions = maps.last(regions_.size());
    const auto set = [](NodeMiss& miss, int column, const Eigen::Vector3d& value)
    { Eigen::Map<Eigen::Vector3f>(miss.columns + 4 * column) = value.cast<float>(); };
    const auto find = [&](std::size_t u)
    {
        const std::size_t i = used_[u], r = idx(region_of_node_[i]);
        const Eigen::Vector3d& x = places_[i];
        Eigen::Vector3d miss = of_regions[r].A * x + of_regions[r].b;
        Eigen::Matrix3d slope = of_regions[r].A;
        for (std::size_t k = first_influence_[u]; k < first_influence_[u + 1]; ++k)
        {
            const Influence& influence = influences_[k];
            const AffineMap& map = maps[idx(influence.cell)];
            const Eigen::Vector3d d = map.A * x + map.b;
            miss -= influence.weight * d;
            slope -= influence.weight * map.A + d * influence.gradient.transpose();
        }
        set(misses_[u], 0, miss);
        // A pin does not say how things turn.
        for (int k = 0; k < 3 && !regions_[r].may_turn; ++k)
            set(misses_[u], k + 1, slope.col(k));
    };
    parallel_ranges(used_.size(), 64,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t u = begin; u < end; ++u)
                            find(u);
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

void FadeSums::sum(std::span<const NodeMiss> misses, const BlendKernels& kernels)
{
    parallel_ranges(size() / kLanes, 8,
                    [&](std::size_t begin, std::size_t end)
                    {
                        FadeRun run;
                        run.misses = misses.data();
                        run.terms = terms_.data();
                        run.first_term = first_term_.data() + begin * kLanes;
                        run.num_blocks = end - begin;
                        run.out = rows_.data() + 3 * begin;
                        kernels.corrections(run);
                    });
}

} // namespace cellwarp::core
