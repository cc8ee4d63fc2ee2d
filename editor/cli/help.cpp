// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/help.h"

#include <algorithm>
#include <sstream>

namespace cellwarp::core
{

namespace
{

/// One line, which ends without a line break.
std::string wrapped_line(const std::string& line, std::size_t first, std::size_t indent)
{
    const bool is_command = line.starts_with(' ');
    const std::string ending = is_command ? " \\" : "";
    const std::size_t start = std::min(line.find_first_not_of(' '), line.size());
    const std::string margin(is_command ? start + 4 : indent, ' ');
    std::string text = line.substr(0, start);
    std::size_t column = first + start;
    std::istringstream words(line.substr(start));
    bool is_first = true;
    for (std::string word; words >> word; is_first = false)
    {
        // A command keeps room for its backslash, also where it would end here.
        const std::size_t width = word.size() + (is_first ? 0 : 1);
        if (!is_first && column + width + ending.size() > kHelpColumns)
        {
            text += ending + "\n" + margin + word;
            column = margin.size() + word.size();
            continue;
        }
        text += (is_first ? "" : " ") + word;
        column += width;
    }
    return text;
}

class WrappingFormatter : public CLI::Formatter
{
public:
    std::string make_option(const CLI::Option* option, bool is_positional) const override
    {
        return row(make_option_name(option, is_positional) + make_option_opts(option),
                   make_option_desc(option));
    }
    /// A command's line in the list of commands, without its examples.
    std::string make_subcommand(const CLI::App* command) const override
    {
        const std::string all = command->get_description();
        return row(command->get_display_name(true), all.substr(0, all.find("\n\n")));
    }
    std::string make_description(const CLI::App* command) const override
    {
        return wrapped(CLI::Formatter::make_description(command));
    }
    std::string make_footer(const CLI::App* command) const override
    {
        return wrapped(CLI::Formatter::make_footer(command));
    }

private:
    static constexpr std::size_t kIndent = 2, kNames = 26;

    static std::string row(const std::string& name, const std::string& what)
    {
        std::string text(kIndent, ' ');
        text += name;
        if (what.empty())
            return text + "\n";
        if (text.size() + 1 > kNames)
            text += "\n" + std::string(kNames, ' ');
        else
            text.resize(kNames, ' ');
        return text + wrapped(what, kNames, kNames) + "\n";
    }
};

} // namespace

std::string wrapped(const std::string& text, std::size_t first, std::size_t indent)
{
    std::string all;
    for (std::size_t begin = 0; begin <= text.size();)
    {
        const std::size_t end = std::min(text.find('\n', begin), text.size());
        if (begin > 0)
            all += "\n";
        const std::string line = text.substr(begin, end - begin);
        if (begin > 0 && !line.empty())
            all += std::string(indent, ' ');
        all += wrapped_line(line, begin > 0 ? indent : first, indent);
        begin = end + 1;
    }
    return all;
}

std::shared_ptr<CLI::FormatterBase> help_formatter()
{
    return std::make_shared<WrappingFormatter>();
}

} // namespace cellwarp::core
