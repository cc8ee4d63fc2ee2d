// SPDX-License-Identifier: GPL-3.0-or-later
// One code of colours for all that shows regions: fixed grey, free blue, handles yellow,
// as in [Botsch07].
#pragma once

#include <array>
#include <cstdint>

#include "io/scene/handle_file.h"

namespace cellwarp::core
{

/// Red, green, blue as a screen shows them.
using PlainColour = std::array<std::uint8_t, 3>;

/// Of what no region holds.
inline constexpr PlainColour kFreeColour = {104, 152, 214};

constexpr PlainColour role_colour(Role role)
{
    switch (role)
    {
    case Role::Fixed:
        return {146, 146, 150};
    case Role::Handle:
        return {240, 196, 60};
    case Role::Pin:
        return {184, 112, 214};
    case Role::Stiff:
        return {64, 168, 142};
    case Role::Rod:
        return {226, 112, 72};
    case Role::Curve:
        return {92, 170, 220};
    case Role::Bone:
        return {232, 218, 170};
    }
    return kFreeColour;
}

} // namespace cellwarp::core
