// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/error.h"

#include <mutex>

namespace cellwarp::core
{

std::string Remark::text() const
{
    std::string text = where.file;
    if (where.line > 0)
        text += ":" + std::to_string(where.line);
    if (!text.empty())
        text += ": ";
    if (!where.field.empty())
        text += where.field + ": ";
    return text + what;
}

Remark at(const Where& where, const std::string& what)
{
    return {where, what};
}

Error::Error(Fault fault, const std::string& message) : Error(fault, at({}, message)) {}

Error::Error(Fault fault, const Remark& remark)
    : content_(std::make_shared<Content>(Content{fault, remark, ""}))
{
}

const char* Error::what() const noexcept
{
    static std::mutex mutex;
    try
    {
        const std::lock_guard one_at_a_time(mutex);
        if (content_->text.empty())
            content_->text = content_->remark.text();
        return content_->text.c_str();
    }
    catch (const std::exception&)
    {
        return content_->remark.what.c_str(); // there is no memory for more
    }
}

Error wrong_flag(const std::string& flag, const std::string& what)
{
    return Error(Fault::Usage, at({"", 0, flag}, what));
}

Error malformed(const Where& where, const std::string& what)
{
    return Error(Fault::Malformed, at(where, what));
}

} // namespace cellwarp::core
