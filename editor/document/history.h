// SPDX-License-Identifier: GPL-3.0-or-later
// The edits in their order, and how far they are done. Their contents stand in a journal
// on the disk; only their names are kept in memory.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "editor/document/edit.h"
#include "io/journal.h"

namespace cellwarp
{

class History
{
public:
    /// In memory of the system's temporary files if \p journal has no name.
    explicit History(Journal journal);

    std::size_t size() const;     ///< edits, done or undone
    std::size_t position() const; ///< edits that are done
    const std::string& name(std::size_t edit) const;

    /// Drops what is undone, and adds one that is done.
    void add(const Edit& edit);
    /// From the journal.
    Edit edit(std::size_t index) const;
    void move_to(std::size_t position);

private:
    Journal journal_;
    std::vector<std::uint32_t> names_; ///< into the words
    std::vector<std::string> words_;
    std::vector<std::uint64_t> starts_; ///< of the records [byte]
    std::size_t position_ = 0;
};

} // namespace cellwarp
