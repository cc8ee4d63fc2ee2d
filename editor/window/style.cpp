// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/style.h"

#include <array>
#include <string>

#include "library/picture/lettering.h"

namespace cellwarp::core
{

namespace
{

constexpr float kFontSize = 15.0f;
constexpr float kHeadingSize = 26.0f;
constexpr float kSmallSize = 13.0f;

Palette current;
ImFont* heading = nullptr;
ImFont* small = nullptr;

ImVec4 rgb(int hex, float alpha = 1.0f)
{
    return {static_cast<float>((hex >> 16) & 255) / 255.0f,
            static_cast<float>((hex >> 8) & 255) / 255.0f,
            static_cast<float>(hex & 255) / 255.0f, alpha};
}

void set_colours(bool is_dark)
{
    const ImVec4 ground = is_dark ? rgb(0x24272d) : rgb(0xf4f5f7);
    const ImVec4 bar = is_dark ? rgb(0x1b1d22) : rgb(0xe7e9ed);
    const ImVec4 ink = is_dark ? rgb(0xe3e6ea) : rgb(0x22262c);
    const ImVec4 faint = is_dark ? rgb(0x979ea9) : rgb(0x666d78);
    const ImVec4 field = is_dark ? rgb(0x32363e) : rgb(0xffffff);
    const ImVec4 raised = is_dark ? rgb(0x3a3f49) : rgb(0xdfe3e9);
    const ImVec4 lifted = is_dark ? rgb(0x474d59) : rgb(0xd2d8e0);
    const ImVec4 line = is_dark ? rgb(0x3b4049) : rgb(0xd0d4db);
    const ImVec4 accent = is_dark ? rgb(0x5b9df0) : rgb(0x2f74d0);
    const auto with = [](ImVec4 colour, float alpha)
    {
        colour.w = alpha;
        return colour;
    };
    current = {accent,
               faint,
               is_dark ? rgb(0xff8a7a) : rgb(0xc0342b),
               is_dark ? rgb(0xf0c05a) : rgb(0x96660a),
               is_dark ? rgb(0x7fce9b) : rgb(0x1f8348),
               bar,
               is_dark ? rgb(0xeef1f5) : rgb(0x1d2127),
               is_dark ? rgb(0x15171b, 0.80f) : rgb(0xffffff, 0.88f)};
    ImVec4* c = ImGui::GetStyle().Colors;
    is_dark ? ImGui::StyleColorsDark() : ImGui::StyleColorsLight();
    c[ImGuiCol_Text] = ink;
    c[ImGuiCol_TextDisabled] = faint;
    c[ImGuiCol_WindowBg] = ground;
    c[ImGuiCol_ChildBg] = with(ground, 0.0f);
    c[ImGuiCol_PopupBg] = is_dark ? rgb(0x2a2e35) : rgb(0xfbfcfd);
    c[ImGuiCol_Border] = line;
    c[ImGuiCol_Separator] = line;
    c[ImGuiCol_MenuBarBg] = bar;
    c[ImGuiCol_FrameBg] = field;
    c[ImGuiCol_FrameBgHovered] = is_dark ? raised : rgb(0xf0f4fa);
    c[ImGuiCol_FrameBgActive] = is_dark ? lifted : rgb(0xe6eefa);
    c[ImGuiCol_Button] = raised;
    c[ImGuiCol_ButtonHovered] = lifted;
    c[ImGuiCol_ButtonActive] = with(accent, 0.75f);
    c[ImGuiCol_Header] = with(accent, 0.24f);
    c[ImGuiCol_HeaderHovered] = with(accent, 0.16f);
    c[ImGuiCol_HeaderActive] = with(accent, 0.38f);
    c[ImGuiCol_CheckMark] = accent;
    c[ImGuiCol_SliderGrab] = accent;
    c[ImGuiCol_SliderGrabActive] = accent;
    c[ImGuiCol_PlotLines] = accent;
    c[ImGuiCol_PlotHistogram] = accent;
    c[ImGuiCol_ScrollbarBg] = with(ground, 0.0f);
    c[ImGuiCol_ScrollbarGrab] = raised;
    c[ImGuiCol_ScrollbarGrabHovered] = lifted;
    c[ImGuiCol_TitleBgActive] = bar;
    c[ImGuiCol_TitleBg] = bar;
    c[ImGuiCol_TextSelectedBg] = with(accent, 0.35f);
    c[ImGuiCol_NavHighlight] = accent;
    c[ImGuiCol_ModalWindowDimBg] = rgb(0x0c0e12, is_dark ? 0.55f : 0.30f);
    c[ImGuiCol_TableRowBgAlt] = with(ink, 0.03f);
}

} // namespace

const Palette& palette()
{
    return current;
}
ImFont* heading_font()
{
    return heading;
}
ImFont* small_font()
{
    return small;
}

void apply_style(bool is_dark, float scale)
{
    ImGuiStyle& style = ImGui::GetStyle();
    style = ImGuiStyle();
    style.WindowPadding = {12, 10};
    style.FramePadding = {8, 4};
    style.ItemSpacing = {8, 6};
    style.ItemInnerSpacing = {6, 4};
    style.IndentSpacing = 14;
    style.ScrollbarSize = 11;
    style.GrabMinSize = 10;
    style.WindowRounding = 9;
    style.ChildRounding = 4;
    style.FrameRounding = 4;
    style.PopupRounding = 6;
    style.GrabRounding = 4;
    style.ScrollbarRounding = 6;
    style.WindowBorderSize = 1;
    style.PopupBorderSize = 1;
    style.FrameBorderSize = is_dark ? 0.0f : 1.0f;
    style.WindowTitleAlign = {0.5f, 0.5f};
    set_colours(is_dark);
    style.ScaleAllSizes(scale);
}

void load_fonts(float scale)
{
    ImFontAtlas& atlas = *ImGui::GetIO().Fonts;
    atlas.Clear();
    // Latin, Greek and Cyrillic for names of files, and the signs that texts use.
    static constexpr std::array<ImWchar, 15> kRanges = {
        0x20,   0x24f,  0x370,  0x45f,  0x2010, 0x2044, 0x2190, 0x21ff,
        0x2200, 0x22ff, 0x25a0, 0x25ff, 0x2713, 0x2717, 0};
    if (const std::string file = font_file(); !file.empty())
    {
        ImFontConfig config;
        config.OversampleH = 2;
        config.OversampleV = 2;
        if (atlas.AddFontFromFileTTF(file.c_str(), kFontSize * scale, &config,
                                     kRanges.data()))
        {
            heading =
                atlas.AddFontFromFileTTF(file.c_str(), kHeadingSize * scale, &config,
                                         ImGui::GetIO().Fonts->GetGlyphRangesDefault());
            small = atlas.AddFontFromFileTTF(file.c_str(), kSmallSize * scale, &config,
                                             kRanges.data());
            return;
        }
    }
    ImFontConfig config;
    config.SizePixels = kFontSize * scale;
    heading = small = atlas.AddFontDefault(&config);
}

} // namespace cellwarp::core
