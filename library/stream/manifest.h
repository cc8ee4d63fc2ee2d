// SPDX-License-Identifier: GPL-3.0-or-later
// What a batch has done, line by line, so that it can go on where it was ended.
#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

#include "io/base/descriptor.h"

namespace cellwarp::core
{

/// What tells an input from another one, and the field with which it was moved.
struct InputMark
{
    std::uint64_t bytes = 0;
    std::int64_t time = 0; ///< [ns] of its last change
    std::string field;     ///< checksum
    bool operator==(const InputMark&) const = default;
};

/// The mark of a file as it is now; zeros where it is none.
InputMark mark_of(const std::string& input, const std::string& field_checksum);

struct ManifestLine
{
    std::string input, status;
    std::uint64_t samples = 0;
    double seconds = 0.0;
    std::uint64_t output_bytes = 0;
    InputMark mark;
    std::string message;
};

/// A file of lines that is only ever added to. Threads may add at the same time.
class Manifest
{
public:
    /// Reads what is there, and takes a torn last line away. Throws Fault::File, also for
    /// a link, and for what is no manifest: nothing of it is touched.
    explicit Manifest(const std::string& path);

    /// The last line of an input when the manifest was opened; null: none.
    const ManifestLine* find(const std::string& input) const;
    /// On disk when it returns. Throws Fault::File.
    void add(const ManifestLine& line);

private:
    std::string path_;
    Descriptor file_;
    std::map<std::string, ManifestLine> lines_;
    std::mutex mutex_;
};

} // namespace cellwarp::core
