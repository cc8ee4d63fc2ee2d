// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/picture/image.h"

#include <cmath>
#include <cstring>
#include <memory_resource>

namespace
{

/// Memory of a picture that is being packed. The packer does not look whether it got any:
/// this throws std::bad_alloc, and all of it goes at once. What has grown keeps its
/// smaller parts until then, in all as much again.
thread_local std::pmr::memory_resource* memory_of_packer = nullptr;

/// While one picture is packed.
struct PackerMemory
{
    std::pmr::monotonic_buffer_resource memory;

    PackerMemory() { memory_of_packer = &memory; }
    ~PackerMemory() { memory_of_packer = nullptr; }
    PackerMemory(const PackerMemory&) = delete;
    PackerMemory& operator=(const PackerMemory&) = delete;
};

void* allocate_for_packer(std::size_t bytes)
{
    return memory_of_packer->allocate(bytes);
}

void* grow_for_packer(void* old, std::size_t old_bytes, std::size_t bytes)
{
    void* const grown = allocate_for_packer(bytes);
    if (old)
        std::memcpy(grown, old, old_bytes);
    return grown;
}

} // namespace

#define STBIW_MALLOC(bytes) allocate_for_packer(bytes)
#define STBIW_REALLOC_SIZED(old, old_bytes, bytes) grow_for_packer(old, old_bytes, bytes)
#define STBIW_FREE(old) static_cast<void>(old)
#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#include <stb/stb_image_write.h>
#pragma GCC diagnostic pop

namespace cellwarp::core
{

void cover_pixel(Image& image, int column, int row,
                 const std::array<std::uint8_t, 3>& colour, double share)
{
    if (column < 0 || row < 0 || column >= image.width || row >= image.height)
        return;
    std::uint8_t* const pixel =
        &image.rgb[3 * (static_cast<std::size_t>(row) *
                            static_cast<std::size_t>(image.width) +
                        static_cast<std::size_t>(column))];
    for (std::size_t k = 0; k < 3; ++k)
        pixel[k] = static_cast<std::uint8_t>(
            std::lround(share * colour[k] + (1.0 - share) * pixel[k]));
}

std::string png_bytes(const Image& image)
{
    const PackerMemory memory;
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

} // namespace cellwarp::core
