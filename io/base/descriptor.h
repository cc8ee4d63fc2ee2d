// SPDX-License-Identifier: GPL-3.0-or-later
// An open file of the system, and reading and writing where a call may do only a part.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <utility>

#include <unistd.h>

namespace cellwarp::core
{

/// Closes its file when it goes.
class Descriptor
{
public:
    Descriptor() = default;
    /// Takes what a call of the system gave; negative: it failed.
    explicit Descriptor(int file) : file_(file) {}
    Descriptor(Descriptor&& other) noexcept : file_(other.release()) {}
    Descriptor& operator=(Descriptor&& other) noexcept
    {
        std::swap(file_, other.file_);
        return *this;
    }
    ~Descriptor() { close(); }

    explicit operator bool() const { return file_ >= 0; }
    int get() const { return file_; }
    /// Leaves the file open, for the caller to close.
    int release() { return std::exchange(file_, -1); }
    /// False and errno where closing tells of an error.
    bool close() { return file_ < 0 || ::close(release()) == 0; }

private:
    int file_ = -1;
};

/// Writes all of it where the file stands. False and errno where it fails.
bool write_all(int file, std::string_view bytes);

/// Writes all of it from byte \p start on. False and errno where it fails.
bool write_at(int file, std::uint64_t start, std::string_view bytes);

/// As many bytes from byte \p start on as there are, \p count at the most; -1 and errno
/// where it fails.
std::int64_t read_at(int file, std::uint64_t start, char* bytes, std::size_t count);

/// As read_at(), from where the file stands.
std::int64_t read_next(int file, char* bytes, std::size_t count);

} // namespace cellwarp::core
