// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/geometry.h"

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

TEST(Geometry, the_extension_alone_tells_the_format)
{
    const std::string bytes = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    EXPECT_EQ(scan_geometry("x.OBJ", bytes).geometry.num_faces(), 1u);
    for (const std::string path : {"x.xyzw", "x", ".obj", "dir.obj/x"})
        EXPECT_TRUE(
            contains(error_of(Fault::Usage, [&] { scan_geometry(path, bytes); }),
                     path + ": the extension is no known format (need obj, ply, stl"));
}

} // namespace cellwarp::core
