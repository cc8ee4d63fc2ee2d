// SPDX-License-Identifier: GPL-3.0-or-later
// Built instead of rods_film.cpp where rods are left out.
#include "editor/window/film_source.h"

namespace cellwarp::core
{

bool plays_rods()
{
    return false;
}

std::unique_ptr<FilmSource> film_of_rods(const FilmScene&)
{
    return nullptr;
}

} // namespace cellwarp::core
