// SPDX-License-Identifier: GPL-3.0-or-later
// What is drawn in which colour. Plain arithmetic, no window.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "editor/document/document.h"
#include "library/picture/role_colour.h"
#include "library/session/shape.h"

namespace cellwarp::core
{

/// Red, green, blue as a screen shows them. The fourth: how much selected samples are
/// marked, less where the colour of a region must be seen, too.
using Colour = std::array<std::uint8_t, 4>;

/// Of a role, and of no region; not marked.
Colour colour_of(Role role);
Colour free_colour();
Colour selected_colour();

/// One colour a place of the layout: of the sample's region, marked where selected.
/// \p shows_regions: or all as free.
std::vector<Colour> sample_colours(const Document& document, const Selection& selection,
                                   const ShapeLayout& layout, bool shows_regions);

/// What the cells are coloured by.
enum class CellColours
{
    Gap,
    Depth,
    Region
};

/// The ends of the scale that cells are coloured on.
struct CellScale
{
    float low = 0.0f, high = 1.0f;
    bool is_logarithmic = false;
};

CellScale cell_scale(const ShownCells& cells, CellColours by);
/// \p regions: of the document, in the order that ShownCell::region counts in.
Colour cell_colour(const ShownCell& cell, CellColours by, const CellScale& scale,
                   std::span<const EditedRegion> regions);
/// From calm to glaring, \p t in [0, 1].
Colour scale_colour(double t);

} // namespace cellwarp::core
