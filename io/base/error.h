// SPDX-License-Identifier: GPL-3.0-or-later
// The one error type of the program: something that the user can mend. What a
// numerical method could not reach is no error but a stop reason in its report.
#pragma once

#include <cstdint>
#include <exception>
#include <memory>
#include <string>

namespace cellwarp::core
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

/// A place in an input: file, line (0: the format has no lines) and field.
/// Binary formats put the element and byte into the field: "vertex 2 (byte 312)". The
/// field of a usage error is the flag.
struct Where
{
    std::string file;
    std::int64_t line = 0;
    std::string field;
};

/// A message and its place; as text "FILE:LINE: FIELD: what", without the parts that are
/// not known.
struct Remark
{
    Where where;
    std::string what;

    std::string text() const;
    operator std::string() const { return text(); }
};

/// A remark about a place, for an Error or (as text) a warning.
Remark at(const Where& where, const std::string& what);

class Error : public std::exception
{
public:
    /// Without a place.
    Error(Fault fault, const std::string& message);
    Error(Fault fault, const Remark& remark);

    Fault fault() const { return content_->fault; }
    const std::string& file() const { return content_->remark.where.file; }
    std::int64_t line() const { return content_->remark.where.line; } ///< 0: none
    const std::string& field() const { return content_->remark.where.field; }
    const std::string& message() const { return content_->remark.what; }
    /// The remark as text, made when it is asked for.
    const char* what() const noexcept override;

private:
    /// Shared, so that copies of the error need no memory.
    struct Content
    {
        Fault fault;
        Remark remark;
        std::string text; ///< empty: not made yet
    };
    std::shared_ptr<Content> content_;
};

/// The usage error for a flag of the command line.
Error wrong_flag(const std::string& flag, const std::string& what);

/// The error for content that cannot be used.
Error malformed(const Where& where, const std::string& what);

} // namespace cellwarp::core
