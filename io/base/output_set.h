// SPDX-License-Identifier: GPL-3.0-or-later
// The outputs of one run, which all appear or none: a model, its buffers, a saved field
// and what is told on stdout.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "io/base/bytes.h"

namespace cellwarp::core
{

/// Files are written and synced under temporary names; commit() gives all of them their
/// names. What is not committed leaves nothing.
class OutputSet
{
public:
    explicit OutputSet(Overwrite overwrite) : overwrite_(overwrite) {}

    Overwrite overwrite() const { return overwrite_; }
    /// A further output, for the caller to write into until commit(); of "-", stdout,
    /// what is written cannot be taken back. Throws what AtomicFile throws.
    OutputFile& add(const std::string& path);
    /// A further output as a whole, which is finished; of "-" it is kept until commit().
    void write(const std::string& path, std::string_view bytes);
    /// All files are on the disk, still under their temporary names. Throws Fault::File.
    void finish();
    /// Finishes all, gives the files their names in the order in which they were added,
    /// and writes what is kept for stdout. If a step fails the files before it lose their
    /// names again, and what they replaced is back. A file system that cannot exchange
    /// two files does not give back what was replaced; stdout is written before that.
    /// Throws Fault::File.
    void commit();

private:
    Overwrite overwrite_;
    std::vector<std::unique_ptr<OutputFile>> files_;
    std::string for_stdout_;
};

} // namespace cellwarp::core
