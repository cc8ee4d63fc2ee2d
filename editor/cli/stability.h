// SPDX-License-Identifier: GPL-3.0-or-later
// How scenes end that ask too much: each is run twice, and what a stable method keeps is
// measured.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "editor/cli/stability_scenes.h"
#include "library/session/json.h"

namespace cellwarp::core
{

/// How it ended. What a case cannot tell is empty.
struct StabilityRow
{
    StabilityCase of;
    /// "converged", "iteration limit", ...; "exit 3: what the program says".
    std::string outcome;
    /// What no case may do: end otherwise than the program says it can, or miss a gate.
    std::vector<std::string> faults;
    std::optional<std::size_t> cells;
    std::optional<std::int64_t> iterations;
    std::optional<double> rise;     ///< of the energy, by one step, of its begin
    std::optional<double> gradient; ///< relative, at the end
    std::optional<double> residual; ///< of handles [diagonal]
    std::optional<double> inverted; ///< share of triangles that look into their cell
    std::optional<double> jump;     ///< largest, between glued cells [degree]
    std::optional<double> orthonormality; ///< largest |R^T R - I|
    std::optional<double> digits_lost;    ///< of the result, against another scene's
    std::optional<double> violation;      ///< of constraints, the largest [m, rad]
    std::optional<double> growth;         ///< of what moves alone: energy, of its size
    std::optional<bool> has_same_bits;    ///< when it is run again
    double seconds = 0.0;                 ///< of the first run
};

/// Runs them in turn. \p watch: before each, its number. Throws nothing that a scene
/// does.
std::vector<StabilityRow> run_stability(const std::vector<StabilityCase>& cases,
                                        const std::function<void(std::size_t)>& watch);

/// All rows, the number of those with faults, and the limits of the gates by key.
Json stability_json(const std::vector<StabilityRow>& rows);
/// A line for each case of \p json, which is stability_json(), with its keys as columns.
/// \pre there is a case
std::string stability_csv(const Json& json);
/// What came out, one a sentence.
std::vector<std::string> stability_sentences(const std::vector<StabilityRow>& rows);

} // namespace cellwarp::core
