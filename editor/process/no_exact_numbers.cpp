// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/process/exact_numbers.h"

namespace cellwarp::core
{

void let_exact_numbers_throw() {}

} // namespace cellwarp::core
