// SPDX-License-Identifier: GPL-3.0-or-later
// A document of a small bar, and seeded edits of every kind on it.
#pragma once

#include <random>
#include <string>

#include "editor/document/document.h"
#include "tests/support/files.h"

namespace cellwarp::core::support
{

/// A bar of 1 x 1 x 4 in a folder of its own.
struct BarDocument
{
    Folder folder;
    std::string model = folder / "bar.obj", journals = folder / "journals";

    explicit BarDocument(int n = 4);
    Document open(bool has_journal = true) const;
};

/// Samples whose height is from \p low to \p high.
Selection between(const Document& document, double low, double high);

/// A fixed foot and a head to move.
void hold_ends(Document& document);

/// All that the edits amount to, as text.
std::string contents(const Document& document);

/// What a session makes of the document's statements, in 12 cells along the longest side.
std::vector<Eigen::Vector3d> replayed(const Document& document);

/// One edit, or none, of a kind that the generator draws.
void edit_at_random(Document& document, std::mt19937& rng);

} // namespace cellwarp::core::support
