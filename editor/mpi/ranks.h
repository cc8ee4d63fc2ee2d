// SPDX-License-Identifier: GPL-3.0-or-later
// The processes that work together, each by its rank: what they tell each other.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace cellwarp::core
{

/// All processes of the run. MPI lives as long as this does.
class Ranks
{
public:
    Ranks(int& argc, char**& argv);
    ~Ranks();
    Ranks(const Ranks&) = delete;
    Ranks& operator=(const Ranks&) = delete;

    std::uint64_t rank() const { return rank_; }
    std::uint64_t count() const { return count_; }
    bool is_first() const { return rank_ == 0; }

    /// Does the work of this rank, then waits for the others. Where one has failed, all
    /// return its exit code (of several the lowest rank's) and the first rank says why;
    /// otherwise 0.
    int together(const std::function<void()>& work) const;
    /// The first rank's text, on every rank.
    std::string from_first(const std::string& text) const;
    /// Of all ranks, on every rank.
    std::uint64_t sum(std::uint64_t value) const;

private:
    std::string from(int rank, const std::string& text) const;

    std::uint64_t rank_ = 0, count_ = 1;
};

} // namespace cellwarp::core
