// SPDX-License-Identifier: GPL-3.0-or-later
// Built instead of flesh_film.cpp where skeletons are left out.
#include "editor/window/film_source.h"
#include "editor/window/live_flesh.h"

namespace cellwarp::core
{

bool plays_flesh()
{
    return false;
}

std::unique_ptr<FilmSource> film_of_flesh(const FilmScene&)
{
    return nullptr;
}

struct LiveFlesh::State
{
};

LiveFlesh::LiveFlesh(const Editing&) {}
LiveFlesh::~LiveFlesh() = default;

std::shared_ptr<const ShownShape> LiveFlesh::newest() const
{
    return nullptr;
}

double LiveFlesh::time() const
{
    return 0.0;
}

std::string LiveFlesh::error() const
{
    return "";
}

void LiveFlesh::pull(const std::string&, const Eigen::Vector3d&) {}
void LiveFlesh::pull(std::uint32_t, const Eigen::Vector3d&) {}
void LiveFlesh::let_go() {}

} // namespace cellwarp::core
