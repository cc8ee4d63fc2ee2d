// SPDX-License-Identifier: GPL-3.0-or-later
// Whole files as bytes: read once into memory, written beside and renamed.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "io/base/descriptor.h"

namespace cellwarp::core
{

/// Largest file that is read whole [bytes].
inline constexpr std::uint64_t kMaxFileBytes = std::uint64_t(4) << 30;

/// Size of what tells none before its end, like stdin [bytes].
inline constexpr std::uint64_t kUnknownBytes = std::uint64_t(1) << 62;

/// A regular file, or stdin for "-", read from its beginning to its end.
class InputFile
{
public:
    /// Throws Fault::File when it is missing, no regular file or not readable.
    explicit InputFile(const std::string& path);

    std::uint64_t size() const { return size_; } ///< [bytes] kUnknownBytes of stdin
    /// Fills \p bytes; fewer only at the end. Throws Fault::File.
    std::size_t read(char* bytes, std::size_t count);
    /// Fills \p bytes from byte \p start on, whatever was read before; not for stdin. May
    /// be called by several threads at once. Throws Fault::File, also where the file has
    /// become too short.
    void read_at(std::uint64_t start, char* bytes, std::size_t count) const;
    /// To the beginning again; not for stdin.
    void rewind();
    /// Throws Fault::File if the file, which was read to its end or by read_at() alone,
    /// is another one than when it was opened.
    void check_unchanged() const;

private:
    std::string path_;
    Descriptor file_;
    std::uint64_t size_ = kUnknownBytes, num_read_ = 0;
    std::int64_t seconds_ = 0, nanoseconds_ = 0; ///< when it was changed last
};

/// The content of a regular file, or of stdin for "-".
/// Throws Fault::File when it is missing, no regular file, not readable, larger
/// than kMaxFileBytes, or changes while it is read.
std::string read_file(const std::string& path);

enum class Overwrite
{
    No,
    Yes
};

/// Throws what writing \p path would throw, before any work is done for it:
/// a missing or read-only folder, a target that exists (without \p overwrite),
/// that is no regular file or that may not be written.
void check_output(const std::string& path, Overwrite overwrite);

struct TemporaryName; // io/base/bytes.cpp

/// A file that appears whole or not at all: written beside its target under a
/// temporary name, synced, then renamed. What is not committed is removed, also
/// when a signal ends the program (see remove_unfinished_outputs). What a killed run left
/// is removed by the next one that writes into the folder. Without Overwrite::Yes a file
/// that appears while this one is written stays: commit() throws.
class AtomicFile
{
public:
    /// A symbolic link is followed: the link stays, its target is replaced.
    AtomicFile(const std::string& path, Overwrite overwrite);
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    void write(std::string_view bytes);
    /// The name until it is committed, for other processes that write into it.
    const std::string& temporary() const { return temporary_; }
    /// Finishes it, puts it in place and settles it. Throws Fault::File.
    void commit();

    // The steps of commit(), for files that must all be in place or none: OutputSet.
    /// All is on the disk and closed, still under the temporary name; nothing can be
    /// written after it. Throws Fault::File.
    void finish();
    /// The finished file gets its name, so that take_back() can undo it. False, and
    /// nothing is done, if it replaces a file on a file system that cannot exchange two.
    /// Throws Fault::File.
    bool try_put_in_place();
    /// The finished file gets its name; a file that it replaces is gone. Throws
    /// Fault::File.
    void put_in_place();
    /// Undoes try_put_in_place(); a file that another program has put there since stays.
    void take_back() noexcept;
    /// Drops what was replaced; that the name stands there is on the disk too.
    void settle() noexcept;

private:
    /// Method by which take_back() restores the former state.
    enum class Undo
    {
        Impossible,
        Remove,
        Exchange
    };
    /// A lock that keeps a file from being swept.
    using Lock = std::shared_ptr<const Descriptor>;
    void flush();
    void put(std::string_view bytes);
    void give_name();
    bool is_in_place() const;
    void discard() noexcept;
    [[noreturn]] void fail(const std::string& doing);
    [[noreturn]] void fail_because_of_target();

    std::string path_;      ///< as the user named it, for messages
    std::string target_;    ///< where it ends, links resolved
    std::string temporary_; ///< empty: there is none
    std::string buffer_;
    Descriptor file_;
    Lock lock_;          ///< of the finished file; null: it is not finished
    Lock replaced_lock_; ///< of the file that has the temporary name by an exchange
    std::uint64_t device_ = 0, inode_ = 0;       ///< of the finished file
    std::int64_t seconds_ = 0, nanoseconds_ = 0; ///< when it was written last
    Overwrite overwrite_;
    Undo undo_ = Undo::Impossible;
    TemporaryName* listed_ = nullptr; ///< in the list that the signal handler reads
};

/// A file that appears whole or not at all, or stdout for "-", which takes at once what
/// is written.
class OutputFile
{
public:
    OutputFile(const std::string& path, Overwrite overwrite);
    void write(std::string_view bytes);
    void commit();
    AtomicFile* file() { return file_ ? &*file_ : nullptr; } ///< null: stdout

private:
    std::optional<AtomicFile> file_;
};

/// Whether an OutputFile has written to stdout.
bool has_written_to_stdout();

/// A file that is there, written at any place, also by other processes.
class RangeFile
{
public:
    /// \p name is what messages call it. Throws Fault::File.
    RangeFile(const std::string& path, std::string name);

    void write_at(std::uint64_t start, std::string_view bytes);
    /// What was written is on the disk.
    void sync();

private:
    std::string name_;
    Descriptor file_;
};

/// A new file without a name in that folder, which vanishes with the process however it
/// ends; to read and write. Throws Fault::File.
Descriptor open_unnamed(const std::string& folder);

/// The folder that a file stands or will stand in.
std::string folder_of(const std::string& path);

/// That a file of this name stands there is on the disk too. A folder that cannot be
/// synced is no failure.
void sync_folder_of(const std::string& path);

/// Writes \p bytes to \p path atomically; "-" is stdout.
void write_file(const std::string& path, std::string_view bytes, Overwrite overwrite);

/// Unlinks every temporary of an AtomicFile that is open. Async-signal-safe.
void remove_unfinished_outputs() noexcept;

} // namespace cellwarp::core
