// SPDX-License-Identifier: GPL-3.0-or-later
// The one error type of the program: something that the user can mend. What a
// numerical method could not reach is no error but a stop reason in its report.
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace cellwarp
{

/// What kind of mistake it was; the value is the exit code of the command line.
enum class Fault
{
    Usage = 2,
    Malformed = 3,
    File = 4,
    Budget = 5,
    Unsolvable = 6
};

class Error : public std::runtime_error
{
public:
    Error(Fault fault, const std::string& message)
        : std::runtime_error(message), fault_(fault)
    {
    }
    Fault fault() const { return fault_; }

private:
    Fault fault_;
};

/// A place in an input: file, line (0: the format has no lines) and field.
/// Binary formats put the element and byte into the field: "vertex 2 (byte 312)".
struct Where
{
    std::string file;
    std::int64_t line = 0;
    std::string field;
};

/// "FILE:LINE: FIELD: what", without the parts that are not known.
std::string at(const Where& where, const std::string& what);

/// The error for content that cannot be used.
Error malformed(const Where& where, const std::string& what);

} // namespace cellwarp
