// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/near_word.h"

#include <algorithm>
#include <numeric>
#include <vector>

namespace cellwarp::core
{

namespace
{

/// By how many letters two words differ: put in, left out or changed.
std::size_t letters_between(const std::string& a, const std::string& b)
{
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t(0));
    for (std::size_t i = 0; i < a.size(); ++i)
    {
        std::size_t diagonal = row[0];
        row[0] = i + 1;
        for (std::size_t j = 0; j < b.size(); ++j)
        {
            const std::size_t changed = diagonal + (a[i] != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = std::min({row[j] + 1, row[j + 1] + 1, changed});
        }
    }
    return row.back();
}

} // namespace

std::string nearest_word(const std::string& given, std::span<const std::string> words)
{
    constexpr std::size_t kMostLetters = 3;
    std::size_t least = std::min(kMostLetters, given.size() / 2) + 1;
    std::string nearest;
    for (const std::string& word : words)
        if (const std::size_t letters = letters_between(given, word); letters < least)
        {
            least = letters;
            nearest = word;
        }
    return nearest;
}

} // namespace cellwarp::core
