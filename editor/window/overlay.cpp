// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/window/overlay.h"

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

#include <imgui.h>

#include "editor/window/style.h"
#include "editor/window/widgets.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

constexpr int kScaleSteps = 48;

/// Draws in the view's pixels.
class Overlay
{
public:
    Overlay(ImDrawList& list, const ViewRect& view, double scale, const Camera& camera)
        : list_(list), view_(view), scale_(static_cast<float>(scale)), camera_(camera)
    {
    }

    ImVec2 at(const Eigen::Vector2d& pixel) const
    {
        return {static_cast<float>(view_.x) + static_cast<float>(pixel.x()) * scale_,
                static_cast<float>(view_.y) + static_cast<float>(pixel.y()) * scale_};
    }
    /// False: behind the viewer.
    bool at(const Eigen::Vector3d& point, ImVec2& place) const
    {
        const std::optional<Eigen::Vector3d> seen = camera_.project(point);
        if (seen)
            place = at(Eigen::Vector2d(seen->x(), seen->y()));
        return seen.has_value();
    }
    float px(float pixels) const { return pixels * scale_; }
    ImDrawList& list() const { return list_; }
    const ViewRect& view() const { return view_; }

private:
    ImDrawList& list_;
    const ViewRect& view_;
    float scale_;
    const Camera& camera_;
};

ImU32 part_colour(const GizmoPart& part)
{
    if (part.is_hot)
        return IM_COL32(255, 226, 110, 255);
    if (part.kind == GizmoPart::Kind::Screen)
        return packed(palette().view_ink);
    constexpr std::array<ImU32, 3> kAxes = {IM_COL32(232, 84, 84, 255),
                                            IM_COL32(112, 192, 84, 255),
                                            IM_COL32(84, 142, 244, 255)};
    return kAxes[idx(std::clamp(part.axis, 0, 2))];
}

void draw_part(const Overlay& overlay, const GizmoPart& part)
{
    std::vector<ImVec2> line;
    for (const Eigen::Vector3d& point : part.line)
        if (ImVec2 place; overlay.at(point, place))
            line.push_back(place);
    if (line.size() < 2)
        return;
    const int count = static_cast<int>(line.size());
    const ImU32 ink = part_colour(part);
    const float width = overlay.px(part.is_hot ? 3.6f : 2.6f);
    ImDrawList& list = overlay.list();
    if (part.kind == GizmoPart::Kind::Plane)
    {
        list.AddConvexPolyFilled(line.data(), count,
                                 (ink & ~IM_COL32_A_MASK) |
                                     IM_COL32(0, 0, 0, part.is_hot ? 190 : 90));
        list.AddPolyline(line.data(), count, ink, ImDrawFlags_Closed, overlay.px(1.2f));
        return;
    }
    // A dark edge keeps it legible on a bright shape.
    const int flags = part.is_closed ? ImDrawFlags_Closed : ImDrawFlags_None;
    list.AddPolyline(line.data(), count, IM_COL32(0, 0, 0, 90), flags,
                     width + overlay.px(1.6f));
    list.AddPolyline(line.data(), count, ink, flags, width);
}

/// Through the shape: what is inside is to be seen.
void draw_thread(const Overlay& overlay, const std::vector<Eigen::Vector3d>& places,
                 ImU32 ink, float width)
{
    std::vector<ImVec2> line;
    const auto draw = [&]
    {
        const int count = static_cast<int>(line.size());
        if (count > 1)
        {
            overlay.list().AddPolyline(line.data(), count, IM_COL32(0, 0, 0, 90), 0,
                                       overlay.px(width + 1.6f));
            overlay.list().AddPolyline(line.data(), count, ink, 0, overlay.px(width));
        }
        line.clear();
    };
    for (const Eigen::Vector3d& place : places)
        if (ImVec2 at; overlay.at(place, at))
            line.push_back(at);
        else
            draw(); // it goes on behind the viewer
    draw();
}

/// Held ones are filled, others rings.
void draw_point(const Overlay& overlay, const SeenLine::Point& point, ImU32 ink)
{
    ImVec2 at;
    if (!overlay.at(point.place, at))
        return;
    const ImU32 edge =
        point.is_hot || point.is_active ? IM_COL32(255, 226, 110, 255) : ink;
    const float radius = overlay.px(point.is_hot ? 6.5f : 5.0f);
    overlay.list().AddCircleFilled(at, radius,
                                   point.is_held ? edge : IM_COL32(30, 30, 34, 200), 20);
    overlay.list().AddCircle(at, radius, IM_COL32(0, 0, 0, 120), 20, overlay.px(3.0f));
    overlay.list().AddCircle(at, radius, edge, 20, overlay.px(1.8f));
}

void draw_lines(const Overlay& overlay, const Interaction& hand)
{
    for (const SeenLine& line : hand.lines())
    {
        const ImU32 ink = packed(shown(colour_of(line.is_bone  ? Role::Bone
                                                 : line.is_rod ? Role::Rod
                                                               : Role::Curve)));
        draw_thread(overlay, line.places, ink, line.is_active ? 3.0f : 2.0f);
        for (const SeenLine::Point& point : line.points)
            draw_point(overlay, point, ink);
    }
    const ImU32 ink = packed(shown(colour_of(Role::Rod)));
    draw_thread(overlay, hand.drawn(), ink, 2.0f);
    for (const Eigen::Vector3d& place : hand.drawn())
        draw_point(overlay, {place, true, false, false}, ink);
}

/// What the active region turns about: a cross in a ring, and where it snaps to.
void draw_pivot(const Overlay& overlay, const Interaction& hand)
{
    const std::optional<SeenPivot> pivot = hand.seen_pivot();
    if (!pivot)
        return;
    const ImU32 shade = IM_COL32(0, 0, 0, 120);
    ImDrawList& list = overlay.list();
    const float r = overlay.px(4.5f);
    for (const SeenPivot::Mark& mark : pivot->marks)
        if (ImVec2 at; overlay.at(mark.place, at))
        {
            const ImU32 ink = packed(palette().view_ink);
            list.AddRect({at.x - r, at.y - r}, {at.x + r, at.y + r}, shade, 0, 0,
                         overlay.px(3.0f));
            list.AddRect({at.x - r, at.y - r}, {at.x + r, at.y + r}, ink, 0, 0,
                         overlay.px(1.4f));
            // To both sides, for they may lie close together.
            const ImVec2 size = ImGui::CalcTextSize(mark.name.c_str());
            const bool is_first = &mark == &pivot->marks[0];
            list.AddText(
                {is_first ? at.x + 2 * r : at.x - 2 * r - size.x, at.y - 0.5f * size.y},
                ink, mark.name.c_str());
        }
    ImVec2 at;
    if (!overlay.at(pivot->place, at))
        return;
    const ImU32 ink = pivot->marks.empty() ? packed(shown(colour_of(Role::Handle)))
                                           : IM_COL32(255, 226, 110, 255);
    const float reach = 1.9f * r;
    for (const auto& [width, colour] : {std::pair(3.4f, shade), std::pair(1.6f, ink)})
    {
        list.AddCircle(at, r, colour, 20, overlay.px(width));
        list.AddLine({at.x - reach, at.y}, {at.x + reach, at.y}, colour,
                     overlay.px(width));
        list.AddLine({at.x, at.y - reach}, {at.x, at.y + reach}, colour,
                     overlay.px(width));
    }
}

void draw_outline(const Overlay& overlay, const Interaction& hand)
{
    std::vector<ImVec2> line;
    for (const Eigen::Vector2d& pixel : hand.outline())
        line.push_back(overlay.at(pixel));
    if (line.size() < 2)
        return;
    const Colour orange = selected_colour();
    const ImU32 ink = IM_COL32(orange[0], orange[1], orange[2], 255);
    const int count = static_cast<int>(line.size());
    if (hand.tool() != Tool::Lasso) // which need not be convex
        overlay.list().AddConvexPolyFilled(line.data(), count,
                                           IM_COL32(orange[0], orange[1], orange[2], 34));
    overlay.list().AddPolyline(line.data(), count, ink, ImDrawFlags_Closed,
                               overlay.px(1.5f));
}

void draw_hover(const Overlay& overlay, const Interaction& hand)
{
    const std::optional<Hover> hover = hand.hover();
    ImVec2 place;
    const ImVec2 pointer = ImGui::GetIO().MousePos;
    const bool is_over = overlay.view().holds(static_cast<double>(pointer.x),
                                              static_cast<double>(pointer.y));
    if (!hover || !is_over || hand.is_busy() || !overlay.at(hover->point, place))
        return;
    overlay.list().AddCircle(place, overlay.px(5.5f), IM_COL32(0, 0, 0, 110), 20,
                             overlay.px(3.2f));
    overlay.list().AddCircle(place, overlay.px(5.5f), IM_COL32(255, 255, 255, 240), 20,
                             overlay.px(1.6f));
}

/// A text on a rounded ground, its lower middle at a place.
void draw_pill(const Overlay& overlay, const std::string& text, ImVec2 bottom)
{
    const float room = static_cast<float>(overlay.view().width) - letters(6);
    const ImVec2 size = ImGui::CalcTextSize(text.c_str(), nullptr, false, room);
    const ImVec2 pad = {letters(1.5f), letters(0.7f)};
    const ImVec2 corner = {bottom.x - size.x / 2 - pad.x, bottom.y - size.y - 2 * pad.y};
    overlay.list().AddRectFilled(
        corner, {corner.x + size.x + 2 * pad.x, corner.y + size.y + 2 * pad.y},
        packed(palette().pill), letters(1.0f));
    overlay.list().AddText(ImGui::GetFont(), ImGui::GetFontSize(),
                           {corner.x + pad.x, corner.y + pad.y},
                           packed(palette().view_ink), text.c_str(), nullptr, room);
}

void draw_hint(const Overlay& overlay, const std::string& hint)
{
    if (hint.empty())
        return;
    const ViewRect& view = overlay.view();
    draw_pill(overlay, hint,
              {static_cast<float>(view.x) + static_cast<float>(view.width) / 2,
               static_cast<float>(view.y + view.height) - letters(2)});
}

std::string scale_end(double value, CellColours by)
{
    return by == CellColours::Gap ? rounded(100.0 * value) + " %" : rounded(value);
}

void draw_scale(const Overlay& overlay, const ViewOptions& options,
                const CellScale& cells)
{
    if (options.cells == CellsShown::No || options.cell_colours == CellColours::Region)
        return;
    const ViewRect& view = overlay.view();
    const ImVec2 corner = {static_cast<float>(view.x) + letters(2),
                           static_cast<float>(view.y) + letters(4.2f)};
    const float width = letters(20), height = letters(1.1f);
    ImDrawList& list = overlay.list();
    const std::string title = options.cell_colours == CellColours::Gap
                                  ? "Gap to neighbours, of the diagonal"
                                  : "Depth of cells";
    const float ground = std::max(width, ImGui::CalcTextSize(title.c_str()).x);
    list.AddRectFilled({corner.x - letters(1), corner.y - letters(2.8f)},
                       {corner.x + ground + letters(1), corner.y + letters(3.6f)},
                       packed(palette().pill), letters(1.0f));
    const ImU32 ink = packed(palette().view_ink);
    list.AddText({corner.x, corner.y - letters(2.2f)}, ink, title.c_str());
    for (int k = 0; k < kScaleSteps; ++k)
    {
        const Colour colour = scale_colour((k + 0.5) / kScaleSteps);
        const float step = width / kScaleSteps;
        list.AddRectFilled(
            {corner.x + step * static_cast<float>(k), corner.y},
            {corner.x + step * static_cast<float>(k + 1), corner.y + height},
            IM_COL32(colour[0], colour[1], colour[2], 255));
    }
    const float below = corner.y + height + letters(0.3f);
    const std::string low = scale_end(cells.low, options.cell_colours);
    const std::string high = scale_end(cells.high, options.cell_colours);
    list.AddText({corner.x, below}, ink, low.c_str());
    list.AddText({corner.x + width - ImGui::CalcTextSize(high.c_str()).x, below}, ink,
                 high.c_str());
}

/// Where the axes point, in the lower left corner.
void draw_axes(const Overlay& overlay, const Camera& camera)
{
    const ViewRect& view = overlay.view();
    if (view.width < overlay.px(200) || view.height < overlay.px(160))
        return;
    const ImVec2 centre = {static_cast<float>(view.x) + overlay.px(42),
                           static_cast<float>(view.y + view.height) - overlay.px(42)};
    const Eigen::Matrix4d to_eye = camera.view_matrix();
    constexpr std::array<const char*, 3> kNames = {"x", "y", "z"};
    for (int a = 0; a < 3; ++a)
    {
        GizmoPart part;
        part.axis = a;
        const ImU32 ink = part_colour(part);
        const ImVec2 tip = {centre.x + static_cast<float>(to_eye(0, a)) * overlay.px(24),
                            centre.y - static_cast<float>(to_eye(1, a)) * overlay.px(24)};
        overlay.list().AddLine(centre, tip, ink, overlay.px(2.0f));
        const ImVec2 size = ImGui::CalcTextSize(kNames[idx(a)]);
        const ImVec2 word = {centre.x + static_cast<float>(to_eye(0, a)) * overlay.px(33),
                             centre.y -
                                 static_cast<float>(to_eye(1, a)) * overlay.px(33)};
        overlay.list().AddText({word.x - size.x / 2, word.y - size.y / 2},
                               packed(palette().view_ink), kNames[idx(a)]);
    }
}

/// A thin line at the view's upper edge while the result is made.
void draw_progress(const Overlay& overlay, const SolveStatus& status)
{
    const bool is_working = status.state == SolveStatus::State::Preparing ||
                            status.state == SolveStatus::State::Solving ||
                            status.state == SolveStatus::State::Field;
    if (!is_working)
        return;
    const ViewRect& view = overlay.view();
    const double solved = status.state == SolveStatus::State::Preparing ? 0.1
                          : status.state == SolveStatus::State::Field
                              ? 0.9
                              : 0.1 + 0.8 * (status.progress.step + 0.5) /
                                          std::max(1, status.progress.steps);
    const ImVec2 corner = {static_cast<float>(view.x), static_cast<float>(view.y)};
    overlay.list().AddRectFilled(
        corner,
        {corner.x + static_cast<float>(view.width * solved), corner.y + overlay.px(3)},
        packed(palette().accent));
}

} // namespace

void draw_overlay(EditorApp& app, const ViewRect& view, double scale,
                  const CellScale& cells)
{
    OpenedDocument* opened = app.opened();
    if (opened == nullptr || view.width < 1 || view.height < 1)
        return;
    const Interaction& hand = opened->hand;
    ImDrawList& list = *ImGui::GetBackgroundDrawList();
    list.PushClipRect({static_cast<float>(view.x), static_cast<float>(view.y)},
                      {static_cast<float>(view.x + view.width),
                       static_cast<float>(view.y + view.height)});
    const Overlay overlay(list, view, scale, hand.camera());
    draw_lines(overlay, hand);
    for (const GizmoPart& part : hand.gizmo())
        draw_part(overlay, part);
    draw_pivot(overlay, hand);
    draw_outline(overlay, hand);
    draw_hover(overlay, hand);
    draw_axes(overlay, hand.camera());
    draw_scale(overlay, app.view, cells);
    draw_progress(overlay, opened->editing.status());
    draw_hint(overlay, hand.hint());
    list.PopClipRect();
}

} // namespace cellwarp::core
