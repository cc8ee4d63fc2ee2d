// SPDX-License-Identifier: GPL-3.0-or-later
// Words on pictures, in a font of the system.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>

#include "library/picture/image.h"

namespace cellwarp::core
{

/// The file of the first sans serif font that is there; empty: none is.
std::string font_file();

/// Letters of one height.
class Lettering
{
public:
    /// \p height: of a line [pixel]. Throws Fault::File where there is no font.
    explicit Lettering(double height);
    ~Lettering();
    Lettering(const Lettering&) = delete;
    Lettering& operator=(const Lettering&) = delete;

    double height() const { return height_; }
    /// Of a text in UTF-8 [pixel].
    double width(const std::string& text) const;
    /// The middle of the text is at (\p x, \p y) [pixel]; what lies outside of the
    /// picture is left out.
    void draw(const std::string& text, double x, double y,
              const std::array<std::uint8_t, 3>& colour, Image& image) const;

private:
    struct Font;
    double height_;
    std::unique_ptr<const Font> font_;
};

} // namespace cellwarp::core
