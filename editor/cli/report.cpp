// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/report.h"

#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/base/number.h"

namespace cellwarp::core
{

/// The bytes of report.html; CMakeLists.txt makes its definition.
extern const std::string_view kReportTemplate;

namespace
{

/// In quotes where it needs them (RFC 4180).
std::string quoted(const std::string& text)
{
    if (text.find_first_of("\",\r\n") == std::string::npos)
        return text;
    std::string field = "\"";
    for (const char c : text)
        field += c == '"' ? std::string("\"\"") : std::string(1, c);
    return field + "\"";
}

std::string csv_field(const Json& row, const std::string& key)
{
    const Json::json_pointer place("/" + key);
    const Json value = row.contains(place) ? row.at(place) : Json();
    if (value.is_null())
        return "";
    if (value.is_string())
        return quoted(value.get<std::string>());
    if (value.is_array())
        return quoted(
            fmt::format("{}", fmt::join(value.get<std::vector<std::string>>(), "; ")));
    return value.is_number_float() ? shortest(value.get<double>()) : value.dump();
}

} // namespace

std::string csv_text(const std::vector<CsvColumn>& columns, const Json& rows)
{
    std::string csv;
    for (const CsvColumn& column : columns)
        csv += (csv.empty() ? "" : ",") + column.name;
    csv += "\n";
    for (const Json& row : rows)
    {
        std::vector<std::string> fields;
        for (const CsvColumn& column : columns)
            fields.push_back(csv_field(row, column.key));
        csv += fmt::format("{}\n", fmt::join(fields, ","));
    }
    return csv;
}

std::string report_page(const Json& data)
{
    constexpr std::string_view mark = ">REPORT<";
    std::string text;
    // Within JSON a "<" is always in a string. As it is, it could end the script that
    // holds the data ("</script>") or hide its end ("<!--").
    for (const char c : data.dump(-1, ' ', false, Json::error_handler_t::replace))
        text += c == '<' ? std::string("\\u003c") : std::string(1, c);
    std::string page(kReportTemplate);
    return page.replace(page.find(mark) + 1, mark.size() - 2, text);
}

} // namespace cellwarp::core
