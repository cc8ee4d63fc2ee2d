// SPDX-License-Identifier: GPL-3.0-or-later
// Whole files as bytes: read once into memory, written beside and renamed.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace cellwarp
{

/// Largest file that is read whole [bytes].
inline constexpr std::uint64_t kMaxFileBytes = std::uint64_t(4) << 30;

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

/// A file that appears whole or not at all: written beside its target under a
/// temporary name, synced, then renamed. What is not committed is removed, also
/// when a signal ends the program (see remove_unfinished_outputs).
class AtomicFile
{
public:
    /// A symbolic link is followed: the link stays, its target is replaced.
    AtomicFile(const std::string& path, Overwrite overwrite);
    ~AtomicFile();
    AtomicFile(const AtomicFile&) = delete;
    AtomicFile& operator=(const AtomicFile&) = delete;

    void write(std::string_view bytes);
    /// Flush, sync, close, rename, sync the folder. Throws Fault::File.
    void commit();

private:
    void flush();
    [[noreturn]] void fail(const std::string& doing);

    std::string path_;   ///< as the user named it, for messages
    std::string target_; ///< where it ends, links resolved
    std::string temporary_;
    std::string buffer_;
    int file_ = -1;
    int slot_ = -1; ///< in the table that the signal handler reads
};

/// Writes \p bytes to \p path atomically; "-" is stdout.
void write_file(const std::string& path, std::string_view bytes, Overwrite overwrite);

/// Unlinks every temporary of an AtomicFile that is open. Async-signal-safe.
void remove_unfinished_outputs() noexcept;

} // namespace cellwarp
