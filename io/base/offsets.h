// SPDX-License-Identifier: GPL-3.0-or-later
// Long lists of places in a file, and of the lengths of what stands there, in few bytes.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <utility>
#include <vector>

namespace cellwarp::core
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
    void reserve(std::size_t count) { low_.reserve(count); }
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

/// Lengths of tokens [bytes]: one byte each, and the few that are longer apart.
class TokenLengths
{
public:
    std::size_t size() const { return short_.size(); }
    std::size_t operator[](std::size_t i) const
    {
        if (short_[i] < kLong)
            return short_[i];
        return std::lower_bound(long_.begin(), long_.end(), std::pair(i, std::size_t(0)))
            ->second;
    }
    void push_back(std::size_t length)
    {
        if (length >= kLong)
            long_.emplace_back(short_.size(), length);
        short_.push_back(static_cast<std::uint8_t>(std::min(length, kLong)));
    }
    void clear() { truncate(0); }
    /// Keeps the first \p count. \pre count <= size()
    void truncate(std::size_t count)
    {
        short_.resize(count);
        while (!long_.empty() && long_.back().first >= count)
            long_.pop_back();
    }
    /// Appends zeros up to \p count. \pre count >= size()
    void pad(std::size_t count) { short_.resize(count); }

    bool operator==(const TokenLengths&) const = default;

private:
    static constexpr std::size_t kLong = 255;

    std::vector<std::uint8_t> short_;                       ///< at most kLong
    std::vector<std::pair<std::size_t, std::size_t>> long_; ///< number, length; ascending
};

/// Places of vectors in records of one size, which are computed from the records'
/// numbers. Records may be left out: a list of ranges names those that count.
class RecordPlaces
{
public:
    /// Slot s is vector s % in_record of record s / in_record.
    struct Layout
    {
        std::array<std::uint64_t, 4> first = {};  ///< [byte] of number k in slot 0
        std::array<std::uint64_t, 4> stride = {}; ///< from one record to the next [bytes]
        std::uint64_t in_record = 1;              ///< vectors
        std::uint64_t inner_stride =
            0; ///< from one vector of a record to the next [bytes]
        bool operator==(const Layout&) const = default;
    };

    bool empty() const { return size_ == 0; }
    const Layout& layout() const { return layout_; }
    void set_layout(const Layout& layout) { layout_ = layout; }
    void clear()
    {
        ranges_.clear();
        size_ = 0;
    }
    /// The next \p count vectors stand in slots from \p slot on.
    void add(std::uint64_t slot, std::size_t count = 1)
    {
        if (ranges_.empty() ||
            slot != ranges_.back().slot + (size_ - ranges_.back().first))
            ranges_.push_back({size_, slot});
        size_ += count;
    }
    /// [byte] of number \p k of vector \p i
    std::uint64_t start(std::size_t i, std::size_t k) const
    {
        const Slot slot = slot_of(i);
        return layout_.first[k] + slot.record * layout_.stride[k] + slot.shift;
    }
    /// Writes the starts of all \p length numbers of the vector.
    void starts(std::size_t i, std::size_t length, std::uint64_t* out) const
    {
        const Slot slot = slot_of(i);
        for (std::size_t k = 0; k < length; ++k)
            out[k] = layout_.first[k] + slot.record * layout_.stride[k] + slot.shift;
    }

    bool operator==(const RecordPlaces&) const = default;

private:
    struct Range
    {
        std::size_t first;  ///< number of its first vector
        std::uint64_t slot; ///< of that vector
        bool operator==(const Range&) const = default;
    };

    struct Slot
    {
        std::uint64_t record;
        std::uint64_t shift; ///< in the record [bytes]
    };

    Slot slot_of(std::size_t i) const
    {
        const Range* range = ranges_.data();
        if (ranges_.size() > 1)
            range =
                &*std::prev(std::upper_bound(ranges_.begin(), ranges_.end(), i,
                                             [](std::size_t number, const Range& other)
                                             { return number < other.first; }));
        const std::uint64_t slot = range->slot + (i - range->first);
        if (layout_.in_record == 1)
            return {slot, 0};
        return {slot / layout_.in_record,
                slot % layout_.in_record * layout_.inner_stride};
    }

    Layout layout_;
    std::vector<Range> ranges_; ///< ascending
    std::size_t size_ = 0;      ///< vectors
};

} // namespace cellwarp::core
