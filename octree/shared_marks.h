// SPDX-License-Identifier: GPL-3.0-or-later
// Marks of voxels that several threads set. Most are set again and again, and a look
// whether one is there costs less than writing it anew. But the first access to a page of
// fresh memory had better write: after a look the system has to give the page to all
// threads a second time, which takes ten times as long (10 us instead of 1 with two
// threads).
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "octree/voxel_values.h"

namespace cellwarp::core
{

class SharedMarks
{
public:
    /// \p marks must outlive this.
    explicit SharedMarks(VoxelFlags& marks)
        : marks_(marks),
          into_page_(reinterpret_cast<std::uintptr_t>(marks.data()) % kPage),
          is_written_((into_page_ + marks.size()) / kPage + 1)
    {
    }

    /// Whether a voxel has all of a mark. Another thread may give it the rest meanwhile.
    bool has(std::size_t voxel, std::uint8_t mark) const
    {
        return is_written_[page(voxel)].load(std::memory_order_relaxed) &&
               (std::atomic_ref<std::uint8_t>(marks_[voxel])
                    .load(std::memory_order_relaxed) &
                mark) == mark;
    }
    void add(std::size_t voxel, std::uint8_t mark)
    {
        if (has(voxel, mark))
            return;
        std::atomic_ref<std::uint8_t>(marks_[voxel])
            .fetch_or(mark, std::memory_order_relaxed);
        // Other threads read the flags beside it all the time: it is written once.
        if (std::atomic<bool>& is_written = is_written_[page(voxel)];
            !is_written.load(std::memory_order_relaxed))
            is_written.store(true, std::memory_order_relaxed);
    }

private:
    static constexpr std::size_t kPage = 4096; ///< [byte]

    std::size_t page(std::size_t voxel) const { return (into_page_ + voxel) / kPage; }

    VoxelFlags& marks_;
    std::size_t into_page_;                     ///< of the first voxel
    std::vector<std::atomic<bool>> is_written_; ///< of each page
};

} // namespace cellwarp::core
