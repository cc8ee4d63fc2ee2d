// SPDX-License-Identifier: GPL-3.0-or-later
// Each list as its length and its bytes.
#include "io/import/imported.h"

#include <cstring>

namespace cellwarp::core
{

namespace
{

template <class List>
void put(const List& items, std::string& out)
{
    const std::uint64_t count = items.size();
    out.append(reinterpret_cast<const char*>(&count), sizeof count);
    out.append(reinterpret_cast<const char*>(items.data()),
               count * sizeof(typename List::value_type));
}

template <class List>
bool take(std::string_view& bytes, List& items)
{
    using Item = typename List::value_type;
    std::uint64_t count;
    if (bytes.size() < sizeof count)
        return false;
    std::memcpy(&count, bytes.data(), sizeof count);
    bytes.remove_prefix(sizeof count);
    if (count > bytes.size() / sizeof(Item))
        return false;
    items.resize(static_cast<std::size_t>(count));
    if (count > 0) // an empty list has no place to copy to
        std::memcpy(static_cast<void*>(items.data()), bytes.data(), count * sizeof(Item));
    bytes.remove_prefix(count * sizeof(Item));
    return true;
}

} // namespace

std::string imported_bytes(const Imported& imported)
{
    std::string bytes;
    put(imported.problem, bytes);
    put(imported.samples, bytes);
    put(imported.directions, bytes);
    put(imported.direction_samples, bytes);
    put(imported.corners, bytes);
    put(imported.face_ends, bytes);
    return bytes;
}

bool parse_imported(std::string_view bytes, Imported& imported)
{
    return take(bytes, imported.problem) && take(bytes, imported.samples) &&
           take(bytes, imported.directions) && take(bytes, imported.direction_samples) &&
           take(bytes, imported.corners) && take(bytes, imported.face_ends);
}

} // namespace cellwarp::core
