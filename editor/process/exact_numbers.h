// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace cellwarp::core
{

/// CGAL's exact numbers are those of GMP, which ends the process where memory ends. From
/// here on it throws std::bad_alloc instead, as all else does: for the whole process, to
/// be called before the first number. Does nothing in a build without CGAL.
void let_exact_numbers_throw();

} // namespace cellwarp::core
