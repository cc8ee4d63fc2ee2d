// SPDX-License-Identifier: GPL-3.0-or-later
// Pictures as files' bytes.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace cellwarp::core
{

/// Rows from the upper edge down, three numbers a pixel.
struct Image
{
    int width = 0, height = 0;
    std::vector<std::uint8_t> rgb;
};

/// Covers a share of a pixel, in [0, 1], with a colour. Outside of the picture: nothing.
void cover_pixel(Image& image, int column, int row,
                 const std::array<std::uint8_t, 3>& colour, double share);

/// A PNG file's bytes.
std::string png_bytes(const Image& image);
/// A binary PPM file's bytes: what programs read without a library.
std::string ppm_bytes(const Image& image);

} // namespace cellwarp::core
