// SPDX-License-Identifier: GPL-3.0-or-later
// Keys of scenes whose times rise, of rigid motions above all.
#pragma once

#include <vector>

#include "io/base/number.h"
#include "io/scene/json_object.h"
#include "octree/base/rigid_move.h"

namespace cellwarp::core
{

/// Reads the list "keys" of \p object; each of them is at 0 unless it has a time.
/// \p read_value(key, its output) reads all but the time.
template <class Key, class ReadValue>
void read_timed_keys(JsonObject& object, const Between<double>& times,
                     std::vector<Key>& keys, const ReadValue& read_value)
{
    object.read_objects("keys",
                        [&](JsonObject& key)
                        {
                            Key out;
                            key.read("time", times, out.time);
                            read_value(key, out);
                            if (!keys.empty() && !(out.time > keys.back().time))
                                key.fail("time", "got " + shortest(out.time) +
                                                     ", need more than " +
                                                     shortest(keys.back().time));
                            keys.push_back(std::move(out));
                        });
}

/// Reads "rotate", an axis and an angle [degree]; returns whether it is there.
bool read_turn(JsonObject& object, RigidMove& move);

/// Reads keys of "translate" and "rotate", both from rest.
void read_move_keys(JsonObject& object, const Between<double>& times, MoveKeys& keys);

} // namespace cellwarp::core
