// SPDX-License-Identifier: GPL-3.0-or-later
// JSON of reports: keys stay in the order in which they were added.
#pragma once

#include <nlohmann/json.hpp>

namespace cellwarp::core
{

/// An object begins as Json::object(): a null that becomes one by its first key is not
/// destroyed well where memory ends (nlohmann 3.11.2).
using Json = nlohmann::ordered_json;

} // namespace cellwarp::core
