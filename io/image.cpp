// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/image.h"

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

namespace cellwarp
{

std::string png_bytes(const Image& image)
{
    std::string bytes;
    stbi_write_png_to_func(
        [](void* out, void* data, int size)
        {
            static_cast<std::string*>(out)->append(static_cast<const char*>(data),
                                                   static_cast<std::size_t>(size));
        },
        &bytes, image.width, image.height, 3, image.rgb.data(), 3 * image.width);
    return bytes;
}

std::string ppm_bytes(const Image& image)
{
    std::string bytes = "P6\n" + std::to_string(image.width) + " " +
                        std::to_string(image.height) + "\n255\n";
    bytes.append(image.rgb.begin(), image.rgb.end());
    return bytes;
}

} // namespace cellwarp
