// SPDX-License-Identifier: GPL-3.0-or-later
// What a build without importers says.
#include "io/import/import.h"

#include <algorithm>
#include <iterator>

#include "io/base/error.h"
#include "io/base/text.h"

namespace cellwarp::core
{

bool is_import_format(std::string_view extension)
{
    static constexpr std::string_view formats[] = {
        "3ds", "ac",  "ase", "b3d", "blend",   "dae",  "dxf",
        "fbx", "lwo", "md2", "md3", "md5mesh", "ms3d", "x"};
    return std::find(std::begin(formats), std::end(formats), extension) !=
           std::end(formats);
}

Geometry import_geometry(const std::string& path, const std::string&)
{
    throw Error(Fault::Usage,
                at({path, 0, ""}, "this build reads no ." + extension_of(path) +
                                      " (it is made without importers)"));
}

} // namespace cellwarp::core
