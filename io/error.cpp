// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/error.h"

namespace cellwarp
{

std::string at(const Where& where, const std::string& what)
{
    std::string text = where.file;
    if (where.line > 0)
        text += ":" + std::to_string(where.line);
    if (!text.empty())
        text += ": ";
    if (!where.field.empty())
        text += where.field + ": ";
    return text + what;
}

Error malformed(const Where& where, const std::string& what)
{
    return Error(Fault::Malformed, at(where, what));
}

} // namespace cellwarp
