// SPDX-License-Identifier: GPL-3.0-or-later
// Which samples the user has selected, and what can be done with such a set.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "editor/document/neighbours.h"

namespace cellwarp::core
{

/// First and last sample of consecutive ones.
using SampleRun = std::pair<std::int64_t, std::int64_t>;

/// A set of the samples of one model. A value.
class Selection
{
public:
    Selection() = default;
    /// Nothing of \p num_samples.
    explicit Selection(std::size_t num_samples);
    /// \pre the runs lie in the samples
    Selection(std::size_t num_samples, std::span<const SampleRun> runs);

    std::size_t num_samples() const { return num_samples_; }
    std::size_t count() const { return count_; }
    bool empty() const { return count_ == 0; }
    bool holds(std::size_t sample) const
    {
        return (words_[sample / 64] >> (sample % 64)) & 1u;
    }
    void add(std::size_t sample);
    void remove(std::size_t sample);

    std::vector<SampleRun> runs() const;        ///< ascending, none touch
    std::vector<std::uint32_t> samples() const; ///< ascending
    /// Those that are in one of the two alone.
    Selection difference(const Selection& other) const;
    bool operator==(const Selection&) const = default;

private:
    std::size_t num_samples_ = 0, count_ = 0;
    std::vector<std::uint64_t> words_;
};

enum class SelectMode
{
    Replace,
    Add,
    Subtract
};

Selection combined(const Selection& old, const Selection& chosen, SelectMode mode);
Selection inverted(const Selection& selection);
/// With all neighbours; without those that have a neighbour outside.
Selection grown(const Selection& selection, const Neighbours& neighbours);
Selection shrunk(const Selection& selection, const Neighbours& neighbours);
/// With everything that can be reached from it.
Selection connected(const Selection& selection, const Neighbours& neighbours);

} // namespace cellwarp::core
