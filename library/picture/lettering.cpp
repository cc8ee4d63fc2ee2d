// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/picture/lettering.h"

#include <cmath>
#include <filesystem>
#include <string_view>
#include <vector>

#include "io/base/bytes.h"
#include "io/base/error.h"

#define STB_TRUETYPE_IMPLEMENTATION
#define STBTT_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wsign-compare"
#include <stb/stb_truetype.h>
#pragma GCC diagnostic pop

namespace cellwarp::core
{

namespace
{

/// The first that is there is taken.
constexpr std::array kFonts = {
    "/usr/share/fonts/truetype/inter/Inter-Regular.ttf",
    "/usr/share/fonts/opentype/inter/Inter-Regular.otf",
    "/usr/share/fonts/truetype/noto/NotoSans-Regular.ttf",
    "/usr/share/fonts/truetype/open-sans/OpenSans-Regular.ttf",
    "/usr/share/fonts/truetype/dejavu/DejaVuSans.ttf",
    "/usr/share/fonts/TTF/DejaVuSans.ttf",
    "/usr/share/fonts/dejavu-sans-fonts/DejaVuSans.ttf",
    "/usr/share/fonts/truetype/liberation/LiberationSans-Regular.ttf",
    "/System/Library/Fonts/Helvetica.ttc",
};

/// The characters of a text in UTF-8; of bytes that are none, question marks.
std::vector<int> characters_of(std::string_view text)
{
    std::vector<int> characters;
    for (std::size_t i = 0; i < text.size();)
    {
        const auto byte = static_cast<unsigned char>(text[i++]);
        const int more = byte < 0x80 ? 0 : byte >= 0xf0 ? 3 : byte >= 0xe0 ? 2 : 1;
        int character = more == 0 ? byte : byte & (0x3f >> more);
        bool is_valid = byte < 0x80 || byte >= 0xc0;
        for (int k = 0; k < more; ++k, ++i)
        {
            is_valid = is_valid && i < text.size() && (text[i] & 0xc0) == 0x80;
            if (is_valid)
                character = character << 6 | (text[i] & 0x3f);
        }
        characters.push_back(is_valid ? character : '?');
    }
    return characters;
}

} // namespace

std::string font_file()
{
    for (const char* const file : kFonts)
        if (std::error_code error; std::filesystem::exists(file, error))
            return file;
    return "";
}

struct Lettering::Font
{
    std::string bytes;
    stbtt_fontinfo info;
    float scale = 0.0f;
    double middle = 0.0; ///< of a digit, above the base line [pixel]

    /// Calls visit(character, x of its origin) and returns the width [pixel].
    template <class Visit>
    double for_each(const std::string& text, Visit&& visit) const
    {
        const std::vector<int> characters = characters_of(text);
        double x = 0.0;
        for (std::size_t k = 0; k < characters.size(); ++k)
        {
            visit(characters[k], x);
            int advance = 0, bearing = 0;
            stbtt_GetCodepointHMetrics(&info, characters[k], &advance, &bearing);
            if (k + 1 < characters.size())
                advance += stbtt_GetCodepointKernAdvance(&info, characters[k],
                                                         characters[k + 1]);
            x += scale * advance;
        }
        return x;
    }
};

Lettering::Lettering(double height) : height_(height)
{
    const std::string file = font_file();
    if (file.empty())
        throw Error(Fault::File,
                    "there is no font for the letters of a picture (Debian's "
                    "package fonts-dejavu-core has one)");
    auto font = std::make_unique<Font>();
    font->bytes = read_file(file);
    const auto* const data = reinterpret_cast<const unsigned char*>(font->bytes.data());
    if (!stbtt_InitFont(&font->info, data, stbtt_GetFontOffsetForIndex(data, 0)))
        throw Error(Fault::File, at({file, 0, ""}, "is no font"));
    font->scale = stbtt_ScaleForPixelHeight(&font->info, static_cast<float>(height));
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
    stbtt_GetCodepointBox(&font->info, '0', &x0, &y0, &x1, &y1);
    font->middle = 0.5 * font->scale * (y0 + y1);
    font_ = std::move(font);
}

Lettering::~Lettering() = default;

double Lettering::width(const std::string& text) const
{
    return font_->for_each(text, [](int, double) {});
}

void Lettering::draw(const std::string& text, double x, double y,
                     const std::array<std::uint8_t, 3>& colour, Image& image) const
{
    const double left = x - 0.5 * width(text), base = std::round(y + font_->middle);
    font_->for_each(text,
                    [&](int character, double offset)
                    {
                        const double origin = left + offset, whole = std::floor(origin);
                        int wide = 0, high = 0, from_x = 0, from_y = 0;
                        unsigned char* const shape = stbtt_GetCodepointBitmapSubpixel(
                            &font_->info, font_->scale, font_->scale,
                            static_cast<float>(origin - whole), 0.0f, character, &wide,
                            &high, &from_x, &from_y);
                        for (int j = 0; j < high; ++j)
                            for (int i = 0; i < wide; ++i)
                                cover_pixel(image, static_cast<int>(whole) + from_x + i,
                                            static_cast<int>(base) + from_y + j, colour,
                                            shape[j * wide + i] / 255.0);
                        stbtt_FreeBitmap(shape, nullptr);
                    });
}

} // namespace cellwarp::core
