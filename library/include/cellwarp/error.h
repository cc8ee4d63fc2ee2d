// SPDX-License-Identifier: GPL-3.0-or-later
// The exception of the library: a mistake that the caller can mend. A numerical method
// that does not reach its goal is no error: a report has the reason why it stopped.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>

#include <cellwarp/export.h>

namespace cellwarp
{

/// Kind of mistake; the value is the exit code of the command line.
enum class Fault
{
    Internal = 1,   ///< a fault of the library itself: please report it
    Usage = 2,      ///< an argument of the call: a range, a count, a name
    Malformed = 3,  ///< the content of an input: a file, a statement, a coordinate
    File = 4,       ///< a file cannot be read or written
    Budget = 5,     ///< over a limit of memory, cells or threads
    Unsolvable = 6, ///< the edit has no solution
    Stopped = 130   ///< Control::stop was requested
};

/// Name of a fault: "usage", "malformed", ...
CELLWARP_API const char* fault_name(Fault fault);

/// Place in an input; parts that are not known are empty, or 0.
struct Where
{
    std::string file = {};  ///< path; empty for values in memory
    std::int64_t line = 0;  ///< from 1
    std::string field = {}; ///< "box number 6", "faces[17][2]", "cells.gap"
};

/// Every call may throw it. Other exceptions are std::bad_alloc, and those of the
/// caller's own callback, which pass through unchanged. After any of them each object is
/// as before the call, unless the call says otherwise.
class CELLWARP_API Error : public std::runtime_error
{
public:
    Error(Fault fault, const std::string& message, Where where = {});
    Error(const Error&) noexcept;
    Error& operator=(const Error&) noexcept;
    ~Error() override;

    Fault fault() const noexcept;
    const Where& where() const noexcept;
    /// The text without the place; what() is "FILE:LINE: FIELD: MESSAGE", without the
    /// parts that are not known.
    const std::string& message() const noexcept;

private:
    struct Content;
    std::shared_ptr<const Content> content_;
};

} // namespace cellwarp
