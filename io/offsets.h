// SPDX-License-Identifier: GPL-3.0-or-later
// A long list of places, in four bytes each.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace cellwarp
{

/// Numbers of 64 bits whose upper halves seldom change from one to the next, as places in
/// a file: four bytes each, and the upper half where it changes. One is read at once
/// where all are below 2^32, else in the logarithm of the changes.
class Offsets
{
public:
    std::size_t size() const { return low_.size(); }
    bool empty() const { return low_.empty(); }
    std::uint64_t operator[](std::size_t i) const { return high_at(i) << 32 | low_[i]; }

    void push_back(std::uint64_t offset)
    {
        const std::uint64_t high = offset >> 32;
        if (high != (changes_.empty() ? 0 : changes_.back().high))
            changes_.push_back({low_.size(), high});
        low_.push_back(static_cast<std::uint32_t>(offset));
    }
    template <class Iterator>
    void append(Iterator first, Iterator last)
    {
        for (; first != last; ++first)
            push_back(*first);
    }
    void clear() { truncate(0); }
    /// Keeps the first \p count. \pre count <= size()
    void truncate(std::size_t count)
    {
        low_.resize(count);
        while (!changes_.empty() && changes_.back().first >= count)
            changes_.pop_back();
    }
    /// Appends zeros up to \p count. \pre count >= size()
    void pad(std::size_t count)
    {
        while (size() < count)
            push_back(0);
    }

    bool operator==(const Offsets&) const = default;

private:
    struct Change
    {
        std::size_t first;  ///< number from which on it counts
        std::uint64_t high; ///< above 32 bits
        bool operator==(const Change&) const = default;
    };

    std::uint64_t high_at(std::size_t i) const
    {
        if (changes_.empty())
            return 0;
        const auto after = std::upper_bound(changes_.begin(), changes_.end(), i,
                                            [](std::size_t number, const Change& change)
                                            { return number < change.first; });
        return after == changes_.begin() ? 0 : std::prev(after)->high;
    }

    std::vector<std::uint32_t> low_;
    std::vector<Change> changes_; ///< ascending; 0 before the first
};

} // namespace cellwarp
