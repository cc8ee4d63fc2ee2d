// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace cellwarp::core
{

/// How much of the second derivatives.
enum class RodHessian
{
    Exact,
    Tensed,  ///< exact, but for stretch forces that push: they count as none
    Definite ///< positive semi-definite: without what curves downwards
};

} // namespace cellwarp::core
