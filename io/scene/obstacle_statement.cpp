// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/obstacle_statement.h"

#include "io/base/number.h"
#include "io/scene/timed_keys.h"

namespace cellwarp::core
{

ObstacleStatement read_obstacle(JsonObject& object)
{
    ObstacleStatement obstacle;
    obstacle.field = object.name();
    const int count = object.read("plane", obstacle.plane) +
                      object.read("sphere", obstacle.sphere) +
                      object.read_file_name("mesh", obstacle.mesh);
    if (count != 1)
        object.fail("", "needs one of plane, sphere and mesh");
    if (obstacle.plane && (*obstacle.plane)[0] == 0.0 && (*obstacle.plane)[1] == 0.0 &&
        (*obstacle.plane)[2] == 0.0)
        object.fail("plane", "its normal has no length");
    if (obstacle.sphere && !((*obstacle.sphere)[3] > 0.0))
        object.fail("sphere",
                    "got the radius " + shortest((*obstacle.sphere)[3]) + ", need > 0");
    object.read("friction", Between<double>{0.0, 10.0}, obstacle.friction);
    read_move_keys(object, kKeyTimes, obstacle.keys);
    return obstacle;
}

} // namespace cellwarp::core
