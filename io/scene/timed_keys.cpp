// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/timed_keys.h"

#include <array>

namespace cellwarp::core
{

bool read_turn(JsonObject& object, RigidMove& move)
{
    std::array<double, 4> turn;
    if (!object.read("rotate", turn))
        return false;
    move.axis = {turn[0], turn[1], turn[2]};
    move.degrees = turn[3];
    if (move.axis.isZero(0))
        object.fail("rotate", "its axis has no length");
    return true;
}

void read_move_keys(JsonObject& object, const Between<double>& times, MoveKeys& keys)
{
    read_timed_keys(object, times, keys,
                    [](JsonObject& key, MoveKey& out)
                    {
                        key.read("translate", out.move.translation);
                        read_turn(key, out.move);
                    });
}

} // namespace cellwarp::core
