// SPDX-License-Identifier: GPL-3.0-or-later
// Built instead of joined_film.cpp where rods or skeletons are left out.
#include "editor/window/film_source.h"

namespace cellwarp::core
{

bool plays_joined()
{
    return false;
}

std::unique_ptr<FilmSource> film_of_joined(const FilmScene&)
{
    return nullptr;
}

} // namespace cellwarp::core
