// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/widgets.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "editor/window/style.h"

namespace cellwarp::core
{

namespace
{

/// Where the values of a panel begin [letters].
constexpr float kLabelWidth = 7.5f;

} // namespace

float letters(float count)
{
    return count * ImGui::GetFontSize() * 0.62f;
}

ImU32 packed(const ImVec4& colour)
{
    return ImGui::ColorConvertFloat4ToU32(colour);
}

ImVec4 shown(const Colour& colour)
{
    return {colour[0] / 255.0f, colour[1] / 255.0f, colour[2] / 255.0f, 1.0f};
}

std::string counted(std::int64_t count)
{
    std::string digits = std::to_string(count);
    for (std::size_t k = digits.size(); k > 3 + (count < 0 ? 1u : 0u);)
        digits.insert(k -= 3, ",");
    return digits;
}

std::string counted(std::int64_t count, const char* one, const char* many)
{
    return counted(count) + " " + (count == 1 ? one : many);
}

std::string rounded(double value)
{
    char text[32];
    const double size = std::abs(value);
    if (size >= 1000.0 && size < 1e6)
        std::snprintf(text, sizeof text, "%.0f", value);
    else
        std::snprintf(text, sizeof text, "%.3g", value);
    return text;
}

bool section(const char* name, bool is_open_at_first, const std::string& summary)
{
    ImGui::PushStyleColor(ImGuiCol_Header, palette().bar);
    const float top = ImGui::GetCursorPosY();
    const bool is_open =
        ImGui::CollapsingHeader(name, is_open_at_first ? ImGuiTreeNodeFlags_DefaultOpen
                                                       : ImGuiTreeNodeFlags_None);
    ImGui::PopStyleColor();
    if (!summary.empty())
    {
        const float below = ImGui::GetCursorPosY();
        const float width = ImGui::CalcTextSize(summary.c_str()).x;
        ImGui::SetCursorPos({ImGui::GetContentRegionMax().x - width - letters(0.8f),
                             top + ImGui::GetStyle().FramePadding.y});
        ImGui::TextColored(palette().faint, "%s", summary.c_str());
        ImGui::SetCursorPosY(below);
    }
    return is_open;
}

float second_column()
{
    return ImGui::GetStyle().WindowPadding.x +
           std::min(letters(18.0f), 0.53f * ImGui::GetContentRegionAvail().x);
}

void value_pair(const char* left, const std::string& left_value, const char* right,
                const std::string& right_value)
{
    const auto show = [](const char* name, const std::string& value)
    {
        ImGui::TextColored(palette().faint, "%s", name);
        ImGui::SameLine(0, letters(0.9f));
        ImGui::TextUnformatted(value.c_str());
    };
    const float column = second_column();
    const float end = ImGui::GetContentRegionMax().x;
    show(left, left_value);
    const float width = ImGui::CalcTextSize(right).x + letters(0.9f) +
                        ImGui::CalcTextSize(right_value.c_str()).x;
    // In a narrow panel it stands in a row of its own.
    const float free = ImGui::GetItemRectMax().x - ImGui::GetWindowPos().x + letters(1);
    if (free <= column + letters(1) && column + width <= end)
        ImGui::SameLine(column);
    else if (free + width <= end)
        ImGui::SameLine(free);
    show(right, right_value);
}

void label(const char* text)
{
    ImGui::AlignTextToFramePadding();
    ImGui::PushStyleColor(ImGuiCol_Text, palette().faint);
    ImGui::TextUnformatted(text);
    ImGui::PopStyleColor();
    ImGui::SameLine(ImGui::GetStyle().WindowPadding.x + letters(kLabelWidth));
}

void faint_text(const std::string& text)
{
    ImGui::PushStyleColor(ImGuiCol_Text, palette().faint);
    ImGui::TextWrapped("%s", text.c_str());
    ImGui::PopStyleColor();
}

void error_text(const std::string& text)
{
    ImGui::PushStyleColor(ImGuiCol_Text, palette().error);
    ImGui::TextWrapped("%s", text.c_str());
    ImGui::PopStyleColor();
}

void warning_text(const std::string& text)
{
    ImGui::PushStyleColor(ImGuiCol_Text, palette().warning);
    ImGui::TextWrapped("%s", text.c_str());
    ImGui::PopStyleColor();
}

void tip(const char* text)
{
    if (ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenDisabled))
    {
        ImGui::BeginTooltip();
        ImGui::PushTextWrapPos(letters(40));
        ImGui::TextUnformatted(text);
        ImGui::PopTextWrapPos();
        ImGui::EndTooltip();
    }
}

bool has_keyboard()
{
    return ImGui::GetIO().NavVisible && ImGui::IsItemFocused();
}

bool toggle(const char* name, bool is_on)
{
    if (is_on)
    {
        ImVec4 on = palette().accent;
        on.w = 0.45f;
        ImGui::PushStyleColor(ImGuiCol_Button, on);
        on.w = 0.6f;
        ImGui::PushStyleColor(ImGuiCol_ButtonHovered, on);
    }
    const bool is_pressed = ImGui::Button(name);
    if (is_on)
        ImGui::PopStyleColor(2);
    return is_pressed;
}

} // namespace cellwarp::core
