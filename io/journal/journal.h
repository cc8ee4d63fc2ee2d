// SPDX-License-Identifier: GPL-3.0-or-later
// An append-only file of records that survives the end of the program at any moment: what
// was appended and synced is there, what was cut off is left out, what was altered is
// found. What the records say is the caller's business.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "io/base/error.h"

namespace cellwarp::core
{

/// Another process holds a journal.
class InUse : public Error
{
public:
    using Error::Error;
};

/// What a journal held when it was opened.
struct JournalContents
{
    std::string header;                ///< the caller's, from create()
    std::vector<std::uint64_t> starts; ///< of the whole records [byte]
    std::vector<std::string> warnings; ///< of a tail that was cut
};

/// One journal, locked for this process while it lives.
class Journal
{
public:
    /// A new one, or instead of what is there. \p path empty: an unnamed file of the
    /// system's temporary folder, which goes with the process. Throws Fault::File, also
    /// InUse "in use by PID".
    static Journal create(const std::string& path, std::string_view header);
    /// One that is there, to go on with. A tail that is no whole record is dropped with a
    /// warning: one that is too short, or that ends in zeros of blocks that were never
    /// written. A record that was altered, the last one too, is Fault::Malformed with its
    /// number from 1; a newer version is Fault::Malformed "made by version N".
    static Journal open(const std::string& path, JournalContents& contents);
    ~Journal();
    Journal(Journal&&) noexcept;
    Journal& operator=(Journal&&) noexcept;

    /// One write; gives the record's start. Synced to the disk at most every 200 ms, by
    /// sync() and at its end. Throws Fault::File; then the record is not in it.
    std::uint64_t append(std::string_view payload);
    void sync();
    /// Of the record that starts there. Throws Fault::Malformed, Fault::File.
    std::string read(std::uint64_t start) const;
    /// Throws InUse if another process holds the journal of this name.
    static void check_free(const std::string& path);
    /// Has another name from now on; what no process holds there is kept beside it, see
    /// keep_aside(). An unnamed journal stays so. Throws Fault::File, InUse.
    void move_to(const std::string& path);
    /// Removes the file. Nothing more can be appended.
    void remove();
    const std::string& path() const;

    /// Renames a file to the first free one of NAME.kept, NAME.kept2, ...; gives that.
    static std::string keep_aside(const std::string& path);

private:
    struct State;
    explicit Journal(std::unique_ptr<State> state);
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
