// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/gauss.h"

#include <array>

#include "octree/base/index.h"

namespace cellwarp
{

namespace
{

using Table = std::array<std::array<double, kMaxGaussPlaces>, kMaxGaussPlaces>;

constexpr Table kPlaces = {{
    {0.5},
    {0.21132486540518712, 0.7886751345948129},
    {0.1127016653792583, 0.5, 0.8872983346207417},
    {0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263},
    {0.046910077030668, 0.23076534494715845, 0.5, 0.7692346550528415, 0.953089922969332},
    {0.03376524289842399, 0.16939530676686774, 0.38069040695840156, 0.6193095930415985,
     0.8306046932331322, 0.966234757101576},
}};
constexpr Table kWeights = {{
    {1.0},
    {0.5, 0.5},
    {0.2777777777777778, 0.4444444444444444, 0.2777777777777778},
    {0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692},
    {0.11846344252809454, 0.23931433524968324, 0.28444444444444444, 0.23931433524968324,
     0.11846344252809454},
    {0.08566224618958517, 0.1803807865240693, 0.23395696728634552, 0.23395696728634552,
     0.1803807865240693, 0.08566224618958517},
}};

} // namespace

std::span<const double> gauss_places(int count)
{
    return std::span(kPlaces[idx(count - 1)]).first(idx(count));
}

std::span<const double> gauss_weights(int count)
{
    return std::span(kWeights[idx(count - 1)]).first(idx(count));
}

} // namespace cellwarp
