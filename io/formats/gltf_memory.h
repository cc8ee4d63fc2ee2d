// SPDX-License-Identifier: GPL-3.0-or-later
// How much memory a glTF needs beyond what its file is long.
#pragma once

#include <string_view>

namespace cellwarp::core
{

/// Size of the compressed data of a glTF when unpacked, as its \p json states it [byte];
/// 0 if there are none. JSON that cannot be read has none.
double unpacked_gltf_bytes(std::string_view json);

} // namespace cellwarp::core
