// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/version.h>

namespace cellwarp
{

std::string version()
{
    return CELLWARP_VERSION;
}

std::vector<std::string> features()
{
    return {CELLWARP_FEATURES};
}

} // namespace cellwarp
