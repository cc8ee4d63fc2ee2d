// SPDX-License-Identifier: GPL-3.0-or-later
// Handle, scene and label readers on arbitrary bytes: a value or an Error.
#include <cstdint>
#include <string>

#include "io/error.h"
#include "io/handle_file.h"
#include "io/scene_file.h"

using namespace cellwarp;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    if (size == 0)
        return 0;
    const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
    try
    {
        switch (data[0] % 4)
        {
        case 0:
            parse_handles("h.handles", text);
            break;
        case 1:
            parse_scene("s.json", text);
            break;
        case 2:
            parse_labels("x.sel", text);
            break;
        default:
            parse_labels("x.dmat", text);
            break;
        }
    }
    catch (const Error&)
    {
    }
    return 0;
}
