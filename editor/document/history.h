// SPDX-License-Identifier: GPL-3.0-or-later
// The edits in their order, and how far they are done. Their contents stand in a journal
// on the disk; only their names are kept in memory.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <unordered_set>
#include <vector>

#include "editor/document/edit.h"
#include "io/journal/journal.h"

namespace cellwarp::core
{

class History
{
public:
    explicit History(Journal journal);
    /// Goes on where a journal ended that was opened. Throws Fault::Malformed with the
    /// record that is no edit.
    History(Journal journal, const JournalContents& contents);

    std::size_t size() const { return starts_.size(); } ///< edits, done or undone
    std::size_t position() const { return position_; }  ///< edits that are done
    const std::string& name(std::size_t edit) const { return *names_[edit]; }
    /// The same wherever the done edits amount to the same but for what is selected.
    std::uint32_t content() const { return content_at(position_); }
    /// The last position with that content; none: it is gone.
    std::optional<std::size_t> position_of(std::uint32_t content) const;

    /// Drops what is undone, and adds one that is done. Throws Fault::File; then it is
    /// not in it.
    void add(const Edit& edit);
    /// From the journal.
    Edit edit(std::size_t index) const;
    /// \pre position <= size()
    void move_to(std::size_t position);

    /// Ends the journal well: the file stays, for the next time, with a word of the
    /// caller's. Nothing more may be added. Throws Fault::File.
    void close(const std::string& word);
    /// The same where the files do not say what the edits amount to: the next time goes
    /// on with all of them. Throws Fault::File.
    void keep(const std::string& word);
    /// content() at the last close() before this history was opened; none: there was
    /// none.
    std::optional<std::uint32_t> closed_content() const { return closed_content_; }
    /// The end of a journal: the word of its last close() or keep() (none: of neither),
    /// the number of edits after its last close(), and whether keep() ended it.
    struct End
    {
        std::optional<std::string> word;
        std::size_t records_after = 0;
        bool is_kept = false;
    };
    static End end_of(const Journal& journal, const JournalContents& contents);

    /// The journal's file has another name from now on.
    void move_journal(const std::string& path) { journal_.move_to(path); }
    /// Ends the journal: the file goes.
    void remove() { journal_.remove(); }

private:
    std::uint32_t content_at(std::size_t position) const
    {
        return position == 0 ? 0 : contents_[position - 1];
    }
    void append(std::uint64_t start, const Edit& edit);

    Journal journal_;
    std::unordered_set<std::string> words_;
    // Of the edits.
    std::vector<const std::string*> names_; ///< in the words
    std::vector<std::uint64_t> starts_;     ///< of the records [byte]
    std::vector<std::uint32_t> contents_;
    std::uint32_t last_content_ = 0;
    std::optional<std::uint32_t> closed_content_;
    std::size_t position_ = 0;
};

} // namespace cellwarp::core
