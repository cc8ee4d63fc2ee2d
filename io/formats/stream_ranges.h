// SPDX-License-Identifier: GPL-3.0-or-later
// What streams of packed files share: their numbers stand anywhere in a body, which is
// kept in a temporary file and moved range by range.
#pragma once

#include <algorithm>
#include <cstdint>
#include <exception>
#include <string>
#include <vector>

#include "io/base/bytes.h"
#include "io/base/spill.h"
#include "io/formats/stream.h"

namespace cellwarp::core
{

/// A piece of a file that is copied at a time [bytes].
inline constexpr std::size_t kPieceBytes = std::size_t(1) << 18;

/// Calls job(slot, i) for every range i below \p count, on any threads, then
/// end(slot, i) in their order; the slots are used again. The first range that throws
/// ends it all. False when it was stopped.
template <class Slot, class Job, class End>
bool run_ranges(std::uint64_t count, std::size_t ranges_at_once, const StreamWork& work,
                Job&& job, End&& end)
{
    std::vector<Slot> slots(ranges_at_once);
    std::vector<std::exception_ptr> errors(slots.size());
    for (std::uint64_t first = 0; first < count; first += slots.size())
    {
        if (work.stop.stop_requested())
            return false;
        const std::size_t num = static_cast<std::size_t>(
            std::min<std::uint64_t>(slots.size(), count - first));
        work.run(num,
                 [&](std::size_t s)
                 {
                     try
                     {
                         job(slots[s], first + s);
                     }
                     catch (...)
                     {
                         errors[s] = std::current_exception();
                     }
                 });
        for (std::size_t s = 0; s < num; ++s)
        {
            if (errors[s])
                std::rethrow_exception(errors[s]);
            end(slots[s], first + s);
        }
    }
    return !work.stop.stop_requested();
}

/// Calls take(piece) for all pieces of [start, end), which read(start, bytes, count)
/// gives.
template <class Read, class Take>
void for_each_piece(std::uint64_t start, std::uint64_t end, Read&& read, Take&& take)
{
    std::string piece;
    while (start < end)
    {
        piece.resize(
            static_cast<std::size_t>(std::min<std::uint64_t>(kPieceBytes, end - start)));
        read(start, piece.data(), piece.size());
        take(piece);
        start += piece.size();
    }
}

/// Where temporary files of a stream to \p output stand.
std::string spill_folder(const std::string& output);

} // namespace cellwarp::core
