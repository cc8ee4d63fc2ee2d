// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/scene_settings.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "io/base/error.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

std::string words_of(const std::string& value)
{
    return value;
}
std::string words_of(double value)
{
    return shortest(value);
}
std::string words_of(std::int64_t value)
{
    return std::to_string(value);
}
std::string words_of(bool value)
{
    return value ? "true" : "false";
}

/// From here on a number has no upper end.
constexpr double kEndless = 1e300;

template <class Number>
std::string values_of(const Between<Number>& allowed)
{
    if (static_cast<double>(allowed.high) >= kEndless)
        return "from " + words_of(allowed.low);
    return words_of(allowed.low) + " to " + words_of(allowed.high);
}
std::string values_of(const OneOf& allowed)
{
    return fmt::format("`{}`", fmt::join(allowed.words, "`, `"));
}
std::string values_of(YesOrNo)
{
    return "`true`, `false`";
}

template <class Number>
bool is_allowed(const Between<Number>& allowed, Number value)
{
    return value >= allowed.low && value <= allowed.high; // not if it is NaN
}
bool is_allowed(const OneOf& allowed, const std::string& value)
{
    return allowed.has(value);
}
bool is_allowed(YesOrNo, bool)
{
    return true;
}

} // namespace

std::string SettingText::flag(const char* before) const
{
    std::string text = before + std::string(key);
    std::replace(text.begin(), text.end(), '_', '-');
    return text;
}

std::string SettingText::help_with_unit() const
{
    return *unit == 0 ? help : fmt::format("{} [of the {}]", help, unit);
}

template <class Value>
std::string Usual<Value>::in_words() const
{
    if (!value)
        return text;
    return words_of(*value) + (*text == 0 ? "" : "; ") + text;
}

template struct Usual<std::string>;
template struct Usual<double>;
template struct Usual<std::int64_t>;
template struct Usual<bool>;

SceneSettings with_usual_values(SceneSettings settings)
{
    visit_settings(
        [](const SettingText&, const auto&, const auto& usual, auto& value)
        {
            if (!value)
                value = usual.value;
        },
        settings);
    return settings;
}

void check_settings(const SceneSettings& settings)
{
    visit_settings(
        [](const SettingText& text, const auto& allowed, const auto&, const auto& value)
        {
            if (value && !is_allowed(allowed, *value))
                throw Error(
                    Fault::Usage,
                    at({"", 0,
                        (*text.section ? text.section + std::string(".") : "") +
                            text.key},
                       "got " + words_of(*value) + ", need " + values_of(allowed)));
        },
        settings);
}

std::string settings_table()
{
    std::string table = "| key | meaning | values | default |\n|---|---|---|---|\n";
    const SceneSettings none;
    visit_settings(
        [&](const SettingText& text, const auto& allowed, const auto& usual, const auto&)
        {
            const std::string section = text.section;
            table += fmt::format(
                "| `{}{}{}` | {} | {} | {} |\n", section, section.empty() ? "" : ".",
                text.key, text.help_with_unit(), values_of(allowed), usual.in_words());
        },
        none);
    return table;
}

} // namespace cellwarp::core
