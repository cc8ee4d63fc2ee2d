// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/minimize/state.h"

#include <numeric>

namespace cellwarp::core
{

UnknownPlace State::end() const
{
    const std::span<const int> sizes = block_sizes();
    return {begin_.block + static_cast<int>(sizes.size()),
            std::accumulate(sizes.begin(), sizes.end(), begin_.unknown)};
}

} // namespace cellwarp::core
