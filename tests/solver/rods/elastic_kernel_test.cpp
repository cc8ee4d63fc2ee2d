// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/elastic_kernel.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "octree/base/index.h"

namespace
{

using namespace cellwarp::core;

/// Eight bent spans with two places of stretch each.
template <int M>
struct Example
{
    using Counts = ElasticCounts<M>;
    ElasticKind kind;
    ElasticSpans<M> spans;
    ElasticPlaces<M> places;
    ElasticRates<M> moves;

    explicit Example(unsigned seed)
    {
        std::mt19937 rng(seed);
        std::uniform_real_distribution<double> part(0.5, 1.0), any(-0.2, 0.2);
        const auto fill = [&](auto& from, auto& number)
        {
            for (double& x : number.lane)
                x = from(rng);
        };
        for (int l = 0; l < kSpanLanes; ++l)
        {
            // A place of a span without order among its legs is as good as another.
            for (auto& shares : spans.first)
                for (SpanNumbers& share : shares)
                    share.lane[l] = part(rng);
            for (auto& shares : spans.second)
                for (SpanNumbers& share : shares)
                    share.lane[l] = any(rng);
            for (auto& shares : spans.stretch_first)
                for (SpanNumbers& share : shares)
                    share.lane[l] = part(rng);
            for (auto& leg : places.leg)
            {
                leg[0].lane[l] = part(rng);
                leg[1].lane[l] = any(rng);
                leg[2].lane[l] = any(rng);
            }
        }
        for (int g = 0; g < Counts::kInside; ++g)
        {
            fill(part, spans.sigma[g]);
            for (const int i : {0, 1})
            {
                fill(part, spans.stiffness[g][i]);
                fill(any, spans.rest[g][i]);
                fill(part, places.turn[g][i]);
            }
            kind.place[g] = (g + 0.5) / Counts::kInside;
        }
        for (int k = 0; k < Counts::kMostStretch; ++k)
        {
            fill(part, spans.stretch_weight[k]);
            fill(part, spans.stretch_sigma[k]);
            fill(any, places.force[k]);
            fill(any, spans.stretch_rest[k]);
        }
        for (SpanNumbers& number : moves.of)
            fill(any, number);
        for (SpanNumbers& number : places.reference)
            fill(any, number);
        fill(part, spans.twist_stiffness);
        fill(any, spans.rest_twist);
        fill(any, places.twist);
        spans.num_stretch = 2;
        spans.count = kSpanLanes;
        kind.cubes = 0.2;
    }

    /// Everything that the kernels say, a span after another.
    std::array<std::vector<double>, kSpanLanes> said(const ElasticKernels<M>& kernels)
    {
        std::array<std::vector<double>, kSpanLanes> out;
        const auto take = [&](const SpanNumbers& number)
        {
            for (int l = 0; l < spans.count; ++l)
                out[idx(l)].push_back(number.lane[l]);
        };
        SpanNumbers energy, force[Counts::kUnknowns];
        std::vector<SpanNumbers> entries(Counts::kEntries);
        for (const bool is_plain : {false, true})
        {
            kind.is_plain = is_plain;
            kernels.energy(kind, spans, places, energy);
            take(energy);
            kernels.gradient(kind, spans, places, force);
            std::for_each(std::begin(force), std::end(force), take);
            for (const bool is_predicted : {false, true})
                for (const RodHessian how :
                     {RodHessian::Exact, RodHessian::Tensed, RodHessian::Definite})
                {
                    kind.is_predicted = is_predicted;
                    kernels.hessian(kind, how, spans, places, entries.data());
                    std::for_each(entries.begin(), entries.end(), take);
                }
        }
        kind.is_plain = false;
        ElasticStrains<M> strains, rates;
        kernels.strains(kind, spans, places, strains);
        kernels.rates(kind, spans, places, moves, rates);
        for (const ElasticStrains<M>* all : {&strains, &rates})
        {
            std::for_each(all->stretch, all->stretch + spans.num_stretch, take);
            for (const auto& of_place : all->curvature)
                std::for_each(std::begin(of_place), std::end(of_place), take);
            take(all->twist);
        }
        return out;
    }
};

template <int M>
void expect_the_same_bits()
{
    Example<M> example(M);
    const auto plain = example.said(elastic_kernels<M>(InstructionSet::Plain));
    ASSERT_TRUE(std::all_of(plain[0].begin(), plain[0].end(),
                            [](double x) { return std::isfinite(x); }));
    for (const InstructionSet set : instruction_sets())
        EXPECT_EQ(example.said(elastic_kernels<M>(set)), plain);
}

TEST(ElasticKernel, instruction_sets_do_not_change_a_bit)
{
    expect_the_same_bits<3>();
    expect_the_same_bits<4>();
    expect_the_same_bits<5>();
    expect_the_same_bits<8>();
}

TEST(ElasticKernel, what_stands_beside_a_span_does_not_matter_to_it)
{
    Example<4> example(9);
    for (const InstructionSet set : instruction_sets())
    {
        const auto kernels = elastic_kernels<4>(set);
        example.spans.count = kSpanLanes;
        const auto all = example.said(kernels);
        example.spans.count = 3;
        const auto three = example.said(kernels);
        for (const std::size_t l : {0u, 1u, 2u})
            EXPECT_EQ(three[l], all[l]);
    }
}

} // namespace
