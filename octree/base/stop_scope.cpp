// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/stop_scope.h"

#include <utility>

namespace cellwarp::core
{

namespace
{

thread_local const StopScope* innermost = nullptr;

} // namespace

StopScope::StopScope() : outer_(std::exchange(innermost, this)) {}

StopScope::~StopScope()
{
    innermost = outer_;
}

const StopScope* StopScope::current()
{
    return innermost;
}

void StopScope::check() const
{
    for (const StopScope* scope = this; scope && !scope->is_deferral();
         scope = scope->outer_)
        if (scope->is_met())
            throw Stopped();
}

StopScope::Entered::Entered(const StopScope* scope)
    : before_(std::exchange(innermost, scope))
{
}

StopScope::Entered::~Entered()
{
    innermost = before_;
}

void check_stop()
{
    if (innermost)
        innermost->check();
}

bool is_stop_requested()
{
    for (const StopScope* scope = innermost; scope; scope = scope->outer_)
        if (scope->is_met())
            return true;
    return false;
}

} // namespace cellwarp::core
