// SPDX-License-Identifier: GPL-3.0-or-later
// A number for every voxel of a grid, where most are 0. The memory of many comes from the
// system as zeros, and a page of it is taken up only when something is written there: a
// small shape in a large box needs little, as long as nobody writes the zeros. A few are
// cleared in memory that was freed, which costs less than pages that nobody has written.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <span>
#include <type_traits>
#include <utility>

#include "octree/base/parallel.h"

namespace cellwarp::core
{

/// All 0 at first.
template <class Value>
class VoxelValues
{
    static_assert(std::is_trivially_copyable_v<Value>);

public:
    using value_type = Value;

    VoxelValues() = default;
    explicit VoxelValues(std::size_t size) : size_(size)
    {
        if (size == 0)
            return;
        if (size <= kFew)
        {
            void* const memory = ::operator new(size * sizeof(Value));
            values_ = {static_cast<Value*>(std::memset(memory, 0, size * sizeof(Value))),
                       Free{false}};
            return;
        }
        values_ = {static_cast<Value*>(std::calloc(size, sizeof(Value))), Free{true}};
        if (!values_)
            throw std::bad_alloc();
    }
    /// Takes memory only where \p other has.
    VoxelValues(const VoxelValues& other) : VoxelValues(other.size_)
    {
        for (std::size_t begin = 0; begin < size_; begin += kPart)
        {
            const std::size_t end = std::min(size_, begin + kPart);
            if (!other.is_zero(begin, end))
                std::copy(other.begin() + begin, other.begin() + end,
                          values_.get() + begin);
        }
    }
    VoxelValues(VoxelValues&& other) noexcept { swap(other); }
    VoxelValues& operator=(VoxelValues other) noexcept
    {
        swap(other);
        return *this;
    }

    std::size_t size() const { return size_; }
    bool empty() const { return size_ == 0; }
    Value& operator[](std::size_t i) { return values_.get()[i]; }
    const Value& operator[](std::size_t i) const { return values_.get()[i]; }
    Value* data() { return values_.get(); }
    const Value* data() const { return values_.get(); }
    const Value* begin() const { return values_.get(); }
    const Value* end() const { return values_.get() + size_; }
    std::span<const Value> part(std::size_t begin, std::size_t end) const
    {
        return {values_.get() + begin, end - begin};
    }

    bool operator==(const VoxelValues& other) const
    {
        return std::equal(begin(), end(), other.begin(), other.end());
    }

    /// Whether all of [begin, end) are.
    bool is_zero(std::size_t begin, std::size_t end) const
    {
        const std::span<const Value> values = part(begin, end);
        const char* const bytes = reinterpret_cast<const char*>(values.data());
        const std::size_t count = values.size_bytes();
        std::uint64_t any = 0;
        std::size_t i = 0;
        for (; i + sizeof any <= count; i += sizeof any)
        {
            std::uint64_t word;
            std::memcpy(&word, bytes + i, sizeof word);
            any |= word;
        }
        for (; i < count; ++i)
            any |= static_cast<std::uint64_t>(bytes[i] != 0);
        return any == 0;
    }

private:
    static constexpr std::size_t kPart = 4096;
    /// The C library maps what is larger (memory_guard.cpp).
    static constexpr std::size_t kFew = (std::size_t{8} << 20) / sizeof(Value);

    void swap(VoxelValues& other) noexcept
    {
        std::swap(size_, other.size_);
        std::swap(values_, other.values_);
    }

    struct Free
    {
        bool is_from_system = false;
        void operator()(Value* values) const
        {
            if (is_from_system)
                std::free(values);
            else
                ::operator delete(values);
        }
    };
    std::size_t size_ = 0;
    std::unique_ptr<Value, Free> values_;
};

/// For every voxel a flag, or a few.
using VoxelFlags = VoxelValues<std::uint8_t>;

/// For every voxel a number, or -1 (as unsigned: the largest), which takes no memory.
template <class Number>
class VoxelNumbers
{
    using Code = std::make_unsigned_t<Number>; // 1 more, so that none is 0

public:
    VoxelNumbers() = default;
    explicit VoxelNumbers(std::size_t size) : codes_(size) {}

    std::size_t size() const { return codes_.size(); }
    Number operator[](std::size_t voxel) const
    {
        return static_cast<Number>(codes_[voxel] - 1u);
    }
    void set(std::size_t voxel, Number number)
    {
        codes_[voxel] = static_cast<Code>(number) + 1u;
    }
    /// Of \p count voxels that follow each other.
    void fill(std::size_t voxel, std::size_t count, Number number)
    {
        std::fill_n(codes_.data() + voxel, count, static_cast<Code>(number) + 1u);
    }
    /// Calls visit(voxel, number) for all that have one, ascending.
    template <class Visit>
    void for_each(Visit&& visit) const;

private:
    VoxelValues<Code> codes_;
};

/// Calls visit(i) for all of [begin, end) that are not 0, ascending. Zeros cost little.
template <class Value, class Visit>
void for_each_set(const VoxelValues<Value>& values, std::size_t begin, std::size_t end,
                  Visit&& visit)
{
    constexpr std::size_t kAtOnce = 64;
    for (std::size_t at = begin; at < end; at += kAtOnce)
    {
        const std::size_t next = std::min(end, at + kAtOnce);
        if (values.is_zero(at, next))
            continue;
        for (std::size_t i = at; i < next; ++i)
            if (values[i] != Value{})
                visit(i);
    }
}
template <class Value, class Visit>
void for_each_set(const VoxelValues<Value>& values, Visit&& visit)
{
    for_each_set(values, 0, values.size(), visit);
}

template <class Number>
template <class Visit>
void VoxelNumbers<Number>::for_each(Visit&& visit) const
{
    for_each_set(codes_, [&](std::size_t voxel) { visit(voxel, (*this)[voxel]); });
}

/// The same on all threads, in any order.
template <class Value, class Visit>
void parallel_for_each_set(const VoxelValues<Value>& values, Visit&& visit)
{
    constexpr std::size_t kGrain = 1 << 16;
    parallel_ranges(values.size(), kGrain,
                    [&](std::size_t begin, std::size_t end)
                    { for_each_set(values, begin, end, visit); });
}

} // namespace cellwarp::core
