// SPDX-License-Identifier: GPL-3.0-or-later
// One bit a sample: a million samples are 125 kB, and joining two sets touches only
// words. Bits beyond the last sample are never set.
#include "editor/document/selection.h"

#include <bit>
#include <cassert>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kBits = 64; ///< of a word

std::size_t num_words(std::size_t num_samples)
{
    return (num_samples + kBits - 1) / kBits;
}

} // namespace

Selection::Selection(std::size_t num_samples)
    : num_samples_(num_samples), words_(num_words(num_samples), 0)
{
}

Selection::Selection(std::size_t num_samples, std::span<const SampleRun> runs)
    : Selection(num_samples)
{
    for (const auto& [first, last] : runs)
    {
        assert(first >= 0 && last < static_cast<std::int64_t>(num_samples));
        for (std::int64_t i = first; i <= last; ++i)
            add(idx(i));
    }
}

void Selection::add(std::size_t sample)
{
    assert(sample < num_samples_);
    count_ += !holds(sample);
    words_[sample / kBits] |= std::uint64_t{1} << (sample % kBits);
}

void Selection::remove(std::size_t sample)
{
    assert(sample < num_samples_);
    count_ -= holds(sample);
    words_[sample / kBits] &= ~(std::uint64_t{1} << (sample % kBits));
}

std::vector<SampleRun> Selection::runs() const
{
    std::vector<SampleRun> runs;
    for (const std::uint32_t i : samples())
    {
        if (!runs.empty() && runs.back().second + 1 == i)
            runs.back().second = i;
        else
            runs.emplace_back(i, i);
    }
    return runs;
}

std::vector<std::uint32_t> Selection::samples() const
{
    std::vector<std::uint32_t> samples;
    samples.reserve(count_);
    for (std::size_t w = 0; w < words_.size(); ++w)
        for (std::uint64_t word = words_[w]; word != 0; word &= word - 1)
            samples.push_back(
                static_cast<std::uint32_t>(w * kBits + idx(std::countr_zero(word))));
    return samples;
}

Selection Selection::difference(const Selection& other) const
{
    assert(other.num_samples_ == num_samples_);
    Selection result(num_samples_);
    for (std::size_t w = 0; w < words_.size(); ++w)
    {
        result.words_[w] = words_[w] ^ other.words_[w];
        result.count_ += idx(std::popcount(result.words_[w]));
    }
    return result;
}

Selection combined(const Selection& old, const Selection& chosen, SelectMode mode)
{
    if (mode == SelectMode::Replace)
        return chosen;
    Selection result = old;
    for (const std::uint32_t i : chosen.samples())
    {
        if (mode == SelectMode::Add)
            result.add(i);
        else
            result.remove(i);
    }
    return result;
}

Selection inverted(const Selection& selection)
{
    Selection result(selection.num_samples());
    for (std::size_t i = 0; i < selection.num_samples(); ++i)
        if (!selection.holds(i))
            result.add(i);
    return result;
}

Selection grown(const Selection& selection, const Neighbours& neighbours)
{
    Selection result = selection;
    for (const std::uint32_t i : selection.samples())
        for (const std::uint32_t other : neighbours.of(i))
            result.add(other);
    return result;
}

Selection shrunk(const Selection& selection, const Neighbours& neighbours)
{
    Selection result = selection;
    for (const std::uint32_t i : selection.samples())
        for (const std::uint32_t other : neighbours.of(i))
            if (!selection.holds(other))
            {
                result.remove(i);
                break;
            }
    return result;
}

Selection connected(const Selection& selection, const Neighbours& neighbours)
{
    Selection result = selection;
    std::vector<std::uint32_t> open = selection.samples();
    while (!open.empty())
    {
        const std::uint32_t i = open.back();
        open.pop_back();
        for (const std::uint32_t other : neighbours.of(i))
            if (!result.holds(other))
            {
                result.add(other);
                open.push_back(other);
            }
    }
    return result;
}

} // namespace cellwarp::core
