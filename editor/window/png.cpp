// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/png.h"

#include <new>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

namespace cellwarp
{

std::string png_of(const Pixels& pixels)
{
    int size = 0;
    unsigned char* bytes = stbi_write_png_to_mem(pixels.rgb.data(), 3 * pixels.width,
                                                 pixels.width, pixels.height, 3, &size);
    if (bytes == nullptr)
        throw std::bad_alloc();
    std::string png(reinterpret_cast<const char*>(bytes), static_cast<std::size_t>(size));
    STBIW_FREE(bytes);
    return png;
}

std::string ppm_of(const Pixels& pixels)
{
    std::string ppm = "P6\n" + std::to_string(pixels.width) + " " +
                      std::to_string(pixels.height) + "\n255\n";
    ppm.append(pixels.rgb.begin(), pixels.rgb.end());
    return ppm;
}

} // namespace cellwarp
