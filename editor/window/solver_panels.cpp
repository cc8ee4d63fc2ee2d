// SPDX-License-Identifier: GPL-3.0-or-later
// Cells, release field and solver: their settings, and what they reached.
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include <imgui.h>

#include "editor/window/panels.h"
#include "editor/window/style.h"
#include "editor/window/warning_words.h"
#include "editor/window/widgets.h"
#include "io/scene/scene_settings.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kPlotPoints = 96;
constexpr std::size_t kWarningsShown = 3;

/// A value of a setting and its name; nothing: the default.
template <class Value>
struct Choice
{
    std::optional<Value> value;
    std::string name;
};

/// A combo of values that may be left to the default.
template <class Value>
bool show_choice(const char* name, std::optional<Value>& value,
                 const std::vector<Choice<Value>>& choices)
{
    label(name);
    const auto chosen =
        std::find_if(choices.begin(), choices.end(),
                     [&](const Choice<Value>& choice) { return choice.value == value; });
    bool changed = false;
    ImGui::SetNextItemWidth(-1);
    ImGui::PushID(name);
    if (ImGui::BeginCombo("##choice",
                          chosen == choices.end() ? "" : chosen->name.c_str()))
    {
        for (const Choice<Value>& choice : choices)
        {
            const bool was_chosen = choice.value == value;
            if (ImGui::Selectable(choice.name.c_str(), was_chosen) && !was_chosen)
            {
                value = choice.value;
                changed = true;
            }
            if (was_chosen && ImGui::IsWindowAppearing())
                ImGui::SetItemDefaultFocus();
        }
        ImGui::EndCombo();
    }
    ImGui::PopID();
    return changed;
}

/// What a number field did in this frame.
struct Typed
{
    bool is_typing = false, is_done = false;
};

/// A number that may be left to its default; emptied, it goes back there.
template <class Number>
Typed show_number(const char* name, std::optional<Number>& value, const char* hint,
                  const char* explanation)
{
    static_assert(std::is_same_v<Number, double> || std::is_same_v<Number, std::int64_t>);
    label(name);
    char text[32] = "";
    if (value)
    {
        if constexpr (std::is_same_v<Number, double>)
            std::snprintf(text, sizeof text, "%.6g", *value);
        else
            std::snprintf(text, sizeof text, "%lld", static_cast<long long>(*value));
    }
    Typed typed;
    ImGui::SetNextItemWidth(-1);
    ImGui::PushID(name);
    if (ImGui::InputTextWithHint("##number", hint, text, sizeof text,
                                 ImGuiInputTextFlags_CharsScientific |
                                     ImGuiInputTextFlags_AutoSelectAll))
    {
        char* end = nullptr;
        const double number = std::strtod(text, &end);
        if (end == text)
            value.reset();
        else if (std::isfinite(number) && std::abs(number) < 1e15)
            value = static_cast<Number>(number);
    }
    typed.is_typing = ImGui::IsItemActive();
    typed.is_done = ImGui::IsItemDeactivatedAfterEdit();
    ImGui::PopID();
    tip(explanation);
    return typed;
}

/// Result of the fields of settings in this frame.
struct Asked
{
    bool is_typing = false, is_done = false;
};

std::string with_capital(std::string text)
{
    text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
    return text;
}

/// Fields of settings, by the kind of their values.
template <class Number>
void show_setting(const SettingText& text, const Between<Number>&,
                  const Usual<Number>& usual, std::optional<Number>& value, Asked& asked)
{
    const std::string hint = usual.value ? usual.in_words() + " (default)" : "by itself";
    const Typed typed = show_number(text.label, value, hint.c_str(),
                                    with_capital(text.help_with_unit()).c_str());
    asked.is_typing |= typed.is_typing;
    asked.is_done |= typed.is_done;
}

void show_setting(const SettingText& text, const OneOf& allowed,
                  const Usual<std::string>& usual, std::optional<std::string>& value,
                  Asked& asked)
{
    std::vector<Choice<std::string>> choices(1);
    for (const char* word : allowed.words)
    {
        const char* const name = text.names.at(choices.size() - 1);
        if (usual.value == word)
            choices[0].name = std::string(name) + " (default)";
        choices.push_back({word, name});
    }
    asked.is_done |= show_choice(text.label, value, choices);
    tip(with_capital(text.help_with_unit()).c_str());
}

/// A box to check where the default is no, a choice of three where the model decides.
void show_setting(const SettingText& text, YesOrNo, const Usual<bool>& usual,
                  std::optional<bool>& value, Asked& asked)
{
    if (!usual.value)
    {
        const std::vector<Choice<bool>> choices = {{std::nullopt, "By itself (default)"},
                                                   {true, text.names[0]},
                                                   {false, text.names[1]}};
        asked.is_done |= show_choice(text.label, value, choices);
    }
    else if (bool is_on = value.value_or(*usual.value);
             ImGui::Checkbox(text.label, &is_on))
    {
        value = is_on == *usual.value ? std::nullopt : std::optional(is_on);
        asked.is_done = true;
    }
    tip(with_capital(text.help_with_unit()).c_str());
}

/// All settings of one section of the scene file.
Asked show_settings(std::string_view section, SceneSettings& settings)
{
    Asked asked;
    visit_settings(
        [&](const SettingText& text, const auto& allowed, const auto& usual, auto& value)
        {
            if (text.section == section)
                show_setting(text, allowed, usual, value, asked);
        },
        settings);
    return asked;
}

/// What the document's settings are, or what is being typed instead.
SceneSettings& settings_in_hand(EditorApp& app, PanelState& state)
{
    if (!state.types_settings)
        state.settings = app.document().settings();
    return state.settings;
}

void show_cell_counts(const SolveStatus& status)
{
    if (status.cells == 0)
    {
        faint_text("No cells yet");
        return;
    }
    std::string text = counted(static_cast<std::int64_t>(status.cells), "cell", "cells") +
                       ", " + counted(static_cast<std::int64_t>(status.free_cells)) +
                       " free";
    ImGui::TextUnformatted(text.c_str());
    if (status.cells_per_depth.size() > 1)
    {
        std::string depths = "by depth: ";
        for (std::size_t d = 0; d < status.cells_per_depth.size(); ++d)
            depths += (d > 0 ? " · " : "") + counted(status.cells_per_depth[d]);
        faint_text(depths);
    }
    if (!status.inside.empty())
        faint_text(status.inside);
}

std::string state_text(const SolveStatus& status)
{
    switch (status.state)
    {
    case SolveStatus::State::Idle:
        return status.report ? "Done in " + rounded(status.seconds) + " s" : "Ready";
    case SolveStatus::State::Preparing:
        return "Making cells";
    case SolveStatus::State::Solving:
        return "Solving frame " + std::to_string(status.progress.frame);
    case SolveStatus::State::Field:
        return "Fitting the field";
    case SolveStatus::State::Failed:
        return "Could not be solved";
    }
    return "";
}

/// Where in a frame it is; else by what it solves.
std::string way_text(const SolveStatus& status)
{
    if (status.state != SolveStatus::State::Solving)
        return "Method: Newton, multigrid";
    const FrameProgress& now = status.progress;
    const std::string iteration = "teration " + std::to_string(now.iteration);
    return now.steps > 1 ? "Step " + std::to_string(now.step) + " of " +
                               std::to_string(now.steps) + ", i" + iteration
                         : "I" + iteration;
}

/// The part of all frames asked for that is done, 0 to 1.
float done_of(const SolveStatus& status)
{
    if (status.state == SolveStatus::State::Field)
        return 1.0f;
    if (status.state != SolveStatus::State::Solving || status.frames_to_do == 0)
        return 0.0f;
    const FrameProgress& now = status.progress;
    const double frames =
        static_cast<double>(now.frames_done) - static_cast<double>(status.frames_before);
    const double steps = static_cast<double>(now.step - 1) / std::max(1, now.steps);
    return static_cast<float>(std::clamp(
        (frames + steps) / static_cast<double>(status.frames_to_do), 0.0, 1.0));
}

/// Some of them, and the others where the user unfolds them: what stands below is to be
/// seen, too.
void show_warnings(const std::vector<std::string>& warnings, const Document& document)
{
    const std::size_t first = std::min(warnings.size(), kWarningsShown);
    for (std::size_t k = 0; k < first; ++k)
        warning_text(in_window_words(warnings[k], document));
    if (first == warnings.size())
        return;
    const std::string more = "and " + std::to_string(warnings.size() - first) + " more";
    if (!ImGui::TreeNode("warnings", "%s", more.c_str()))
        return;
    for (std::size_t k = first; k < warnings.size(); ++k)
        warning_text(in_window_words(warnings[k], document));
    ImGui::TreePop();
}

void show_energy_curve(const SolveStatus& status)
{
    const auto& curve = status.energy_curve;
    if (curve.size() < 2 || !(curve.back().first > curve.front().first))
        return;
    std::array<float, kPlotPoints> values{};
    const double begin = curve.front().first, end = curve.back().first;
    double least = curve.front().second, most = least;
    for (const auto& [when, energy] : curve)
    {
        least = std::min(least, energy);
        most = std::max(most, energy);
    }
    // Over many powers of ten only their exponents can be read.
    const bool is_logarithmic = least > 0.0 && most > 100.0 * least;
    std::size_t at = 0;
    for (std::size_t k = 0; k < kPlotPoints; ++k)
    {
        const double when = begin + (end - begin) * static_cast<double>(k) /
                                        static_cast<double>(kPlotPoints - 1);
        while (at + 1 < curve.size() && curve[at + 1].first <= when)
            ++at;
        const double energy = curve[at].second;
        values[k] = static_cast<float>(is_logarithmic ? std::log10(energy) : energy);
    }
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    const float lowest = *low, highest = *high;
    const float range = std::max(highest - lowest, 1e-30f); // room for the name above
    const std::string name = is_logarithmic ? "energy (powers of ten)" : "energy";
    ImGui::PlotLines("##energy", values.data(), static_cast<int>(values.size()), 0,
                     name.c_str(), lowest - 0.05f * range, highest + 0.4f * range,
                     {ImGui::GetContentRegionAvail().x, letters(6.5f)});
    tip(("Energy from " + rounded(most) + " to " + rounded(curve.back().second) + " in " +
         rounded(end - begin) + " s")
            .c_str());
}

void show_report(const SolveStatus& status)
{
    if (!status.report)
        return;
    const FrameReport& report = *status.report;
    if (report.solve.stop != Stop::Converged)
        warning_text("Stopped early: " + stop_name(report.solve.stop));
    value_pair("Iterations", std::to_string(report.solve.iterations), "Steps",
               std::to_string(report.steps));
    value_pair("Energy", rounded(status.energy), "Gap",
               rounded(100.0 * status.max_gap) + " %");
    tip("The widest gap between neighbours, of the diagonal");
    value_pair("Cells", rounded(report.cells_ms) + " ms", "Solve",
               rounded(report.solve_ms) + " ms");
    value_pair("Fit", rounded(report.fit_ms) + " ms", "Apply",
               rounded(report.apply_ms) + " ms");
}

/// Nothing has been solved yet, for nobody has asked.
void show_unsolved(EditorApp& app)
{
    std::size_t frames = 0;
    for (const Stage& stage : app.document().handles().stages)
        frames += stage.frames.size();
    ImGui::TextUnformatted("At rest, not solved");
    if (frames > 0 &&
        ImGui::Button(frames == 1
                          ? "Solve its frame"
                          : ("Solve its " + std::to_string(frames) + " frames").c_str()))
        app.opened()->editing.solve();
    faint_text(frames > 0 ? "An edit solves them, too; Play does not need them."
                          : "Cells are made when something is edited.");
}

} // namespace

void show_cells_panel(EditorApp& app, PanelState& state)
{
    const SolveStatus status = app.opened()->editing.status();
    if (!section("Cells", false,
                 status.cells > 0 ? counted(static_cast<std::int64_t>(status.cells))
                                  : ""))
        return;
    show_cell_counts(status);
    ImGui::BeginDisabled(app.opened()->hand.is_busy());
    SceneSettings& settings = settings_in_hand(app, state);
    if (status.across > 0 && !settings.cells.across)
        faint_text("Across: " + std::to_string(status.across) + ", by itself");
    const Asked asked = show_settings("cells", settings);
    ImGui::EndDisabled();
    state.types_settings = asked.is_typing;
    if (asked.is_done)
    {
        const SceneSettings wanted = settings;
        state.types_settings = false;
        app.attempt(Place::Cells, [&] { app.document().change_settings(wanted); });
    }
    if (const Notice* notice = app.notice(Place::Cells))
        error_text(notice->text);
}

void show_field_panel(EditorApp& app)
{
    if (!section("Field", false))
        return;
    SceneSettings settings = app.document().settings();
    ImGui::BeginDisabled(app.opened()->hand.is_busy());
    const Asked asked = show_settings("field", settings);
    ImGui::EndDisabled();
    const SolveStatus status = app.opened()->editing.status();
    if (status.centres > 0)
        faint_text(
            counted(static_cast<std::int64_t>(status.centres), "centre", "centres") +
            (status.clusters > 0
                 ? " in " + counted(static_cast<std::int64_t>(status.clusters), "cluster",
                                    "clusters")
                 : std::string()));
    if (asked.is_done)
        app.attempt(Place::Field, [&] { app.document().change_settings(settings); });
    const ExportStatus written = app.opened()->editing.export_status();
    if (written.state == ExportStatus::State::Working)
    {
        faint_text("Writing " + std::filesystem::path(written.path).filename().string());
        ImGui::SameLine(ImGui::GetContentRegionMax().x - letters(9));
        if (ImGui::SmallButton(" Cancel ##field"))
            app.opened()->editing.cancel_export();
        ImGui::ProgressBar(
            static_cast<float>(written.frames_done) /
                static_cast<float>(std::max<std::size_t>(1, written.frames)),
            {-1, letters(0.6f)}, "");
    }
    if (const Notice* notice = app.notice(Place::Field))
        error_text(notice->text);
}

void show_solver_panel(EditorApp& app)
{
    const SolveStatus status = app.opened()->editing.status();
    if (!section("Solver", true))
        return;
    if (app.opened()->editing.is_unsolved())
    {
        show_unsolved(app);
        return;
    }
    if (app.opened()->editing.shows_film())
        faint_text("Of what is edited, not of what is played:");
    const bool is_working = status.state == SolveStatus::State::Preparing ||
                            status.state == SolveStatus::State::Solving ||
                            status.state == SolveStatus::State::Field;
    ImGui::TextUnformatted(state_text(status).c_str());
    if (is_working)
    {
        ImGui::SameLine(ImGui::GetContentRegionMax().x - letters(9));
        if (ImGui::SmallButton(" Cancel "))
            app.opened()->editing.cancel();
    }
    // Always there, so that nothing below it jumps.
    ImGui::ProgressBar(done_of(status), {-1, letters(0.6f)}, "");
    faint_text(way_text(status));
    // What concerns a region is said there.
    if (status.state == SolveStatus::State::Failed && status.error_region.empty())
        error_text(in_window_words(status.error, app.document()));
    if (status.state == SolveStatus::State::Failed && ImGui::Button("Solve again"))
        app.opened()->editing.solve();
    // Before there is a region nothing is wrong yet.
    if (!app.document().regions().empty())
        show_warnings(status.warnings, app.document());
    show_report(status);
    show_energy_curve(status);
}

} // namespace cellwarp::core
