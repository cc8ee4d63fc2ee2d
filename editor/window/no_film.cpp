// SPDX-License-Identifier: GPL-3.0-or-later
// Built instead of film.cpp where rods are left out: there is nothing to play.
#include "editor/window/film.h"

namespace cellwarp
{

struct Film::State
{
};

bool Film::is_in(const Document&)
{
    return false;
}

Film::Film(const Editing&) {}
Film::~Film() = default;

std::int64_t Film::num_made() const
{
    return 0;
}

std::int64_t Film::last() const
{
    return -1;
}

double Film::seconds_a_frame() const
{
    return 1.0;
}

bool Film::is_working() const
{
    return false;
}

std::string Film::error() const
{
    return "";
}

std::shared_ptr<const ShownShape> Film::shape(std::int64_t) const
{
    return nullptr;
}

} // namespace cellwarp
