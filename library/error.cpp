// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/error.h>

#include <utility>

#include "io/base/error.h"

namespace cellwarp
{

struct Error::Content
{
    Fault fault;
    std::string message;
    Where where;
};

Error::Error(Fault fault, const std::string& message, Where where)
    : std::runtime_error(core::at({where.file, where.line, where.field}, message).text()),
      content_(std::make_shared<const Content>(Content{fault, message, std::move(where)}))
{
}

Error::Error(const Error&) noexcept = default;
Error& Error::operator=(const Error&) noexcept = default;
Error::~Error() = default;

Fault Error::fault() const noexcept
{
    return content_->fault;
}

const Where& Error::where() const noexcept
{
    return content_->where;
}

const std::string& Error::message() const noexcept
{
    return content_->message;
}

const char* fault_name(Fault fault)
{
    switch (fault)
    {
    case Fault::Internal:
        return "internal";
    case Fault::Usage:
        return "usage";
    case Fault::Malformed:
        return "malformed";
    case Fault::File:
        return "file";
    case Fault::Budget:
        return "budget";
    case Fault::Unsolvable:
        return "unsolvable";
    case Fault::Stopped:
        return "stopped";
    }
    return "";
}

} // namespace cellwarp
