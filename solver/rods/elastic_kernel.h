// SPDX-License-Identifier: GPL-3.0-or-later
// Energy, forces and second derivatives of eight spans at a time: as many as fit into the
// processor's registers side by side. elasticity.cpp has the formulas. A span takes part
// in the same operations in the same order whatever stands beside it.
#pragma once

#include "octree/base/instruction_set.h"
#include "solver/rods/rod_hessian.h"

namespace cellwarp::core
{

inline constexpr int kSpanLanes = 8;

/// A number of each span.
struct SpanNumbers
{
    alignas(64) double lane[kSpanLanes] = {};
};

/// Of spans in which M control points act. Everything depends on their differences alone,
/// the legs of the control polygon: with these as unknowns there are three fewer.
template <int M>
struct ElasticCounts
{
    static constexpr int kLegs = M - 1;
    static constexpr int kInside = M > 2 ? M - 2 : 1; ///< bending places
    static constexpr int kPlaces = kInside + 2;       ///< and those of both stations
    static constexpr int kMostStretch = M - 1;
    static constexpr int kLegUnknowns = 3 * kLegs + 2; ///< legs, near and far angle
    static constexpr int kUnknowns = 3 * M + 2; ///< control points, near and far angle
    static constexpr int kEntries = kUnknowns * (kUnknowns + 1) / 2; ///< lower triangle
};

/// What all spans of a rod have in common.
struct ElasticKind
{
    bool has_stretch = true, has_bending = true, has_twist = true;
    bool is_plain = false;     ///< round everywhere, and straight at rest
    double cubes = 0.0;        ///< Rod::cubes_of_steps()
    double place[6] = {};      ///< bending places, shares of the span
    bool is_predicted = false; ///< the stretch forces
};

/// Eight spans, as they are for ever. Shares are of legs.
template <int M>
struct ElasticSpans : ElasticCounts<M>
{
    using Counts = ElasticCounts<M>;
    SpanNumbers first[Counts::kPlaces][Counts::kLegs];  ///< P' = sum share * leg
    SpanNumbers second[Counts::kInside][Counts::kLegs]; ///< P''
    SpanNumbers sigma[Counts::kInside];                 ///< |P'| at rest
    SpanNumbers stiffness[Counts::kInside][2];          ///< YI W sigma [N m^3]
    SpanNumbers rest[Counts::kInside][2];               ///< curvatures [1/m]
    SpanNumbers stretch_first[Counts::kMostStretch][Counts::kLegs];
    SpanNumbers stretch_weight[Counts::kMostStretch]; ///< YA W sigma [N m]
    SpanNumbers stretch_sigma[Counts::kMostStretch];
    SpanNumbers stretch_rest[Counts::kMostStretch]; ///< strains
    SpanNumbers twist_stiffness, rest_twist;        ///< GJ / L [N m], [rad]
    int num_stretch = 0; ///< the most of a span; others have such of no weight
    int count = 0;       ///< of spans
};

/// Where eight spans are.
template <int M>
struct ElasticPlaces : ElasticCounts<M>
{
    using Counts = ElasticCounts<M>;
    SpanNumbers leg[Counts::kLegs][3];
    SpanNumbers reference[3];                ///< of the near station
    SpanNumbers turn[Counts::kInside][2];    ///< cos and sin of the material's angle
    SpanNumbers twist;                       ///< Delta [rad]
    SpanNumbers force[Counts::kMostStretch]; ///< YA W sigma eps, as predicted
};

/// Strains of eight spans, or their rates.
template <int M>
struct ElasticStrains : ElasticCounts<M>
{
    using Counts = ElasticCounts<M>;
    SpanNumbers stretch[Counts::kMostStretch];
    SpanNumbers curvature[Counts::kInside][2]; ///< [1/m]
    SpanNumbers twist;                         ///< [rad]
};

/// Velocities of eight spans: legs, near and far angle.
template <int M>
struct ElasticRates : ElasticCounts<M>
{
    SpanNumbers of[ElasticCounts<M>::kLegUnknowns];
};

template <int M>
struct ElasticKernels
{
    using Counts = ElasticCounts<M>;
    /// [J]
    void (*energy)(const ElasticKind&, const ElasticSpans<M>&, const ElasticPlaces<M>&,
                   SpanNumbers& out);
    /// \pre not is_plain
    void (*strains)(const ElasticKind&, const ElasticSpans<M>&, const ElasticPlaces<M>&,
                    ElasticStrains<M>& out);
    void (*rates)(const ElasticKind&, const ElasticSpans<M>&, const ElasticPlaces<M>&,
                  const ElasticRates<M>&, ElasticStrains<M>& out);
    /// kUnknowns numbers.
    void (*gradient)(const ElasticKind&, const ElasticSpans<M>&, const ElasticPlaces<M>&,
                     SpanNumbers* out);
    /// kEntries numbers: the lower triangle by columns.
    void (*hessian)(const ElasticKind&, RodHessian, const ElasticSpans<M>&,
                    const ElasticPlaces<M>&, SpanNumbers* out);
};

/// \pre \p set is one of instruction_sets(), M is 3 to 8
template <int M>
ElasticKernels<M> elastic_kernels(InstructionSet set);

} // namespace cellwarp::core
