// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/region_drag.h"

#include <cmath>

#include <fmt/format.h>

namespace cellwarp::core
{

namespace
{

constexpr double kSteps = 20.0; ///< of snapping, along the longest side

const char* const kAxes[] = {"X", "Y", "Z"};
const char* const kPlanes[] = {"YZ", "XZ", "XY"};

std::string number(double value)
{
    return fmt::format("{:.4g}", value == 0 ? 0.0 : value); // no "-0"
}

} // namespace

double snap_step(double longest_side)
{
    const double most = longest_side / kSteps;
    if (!(most > 0) || !std::isfinite(most))
        return 0.0;
    const double power = std::pow(10.0, std::floor(std::log10(most)));
    for (const double digit : {5.0, 2.0})
        if (digit * power <= most * (1 + 1e-9))
            return digit * power;
    return power;
}

RegionDrag::RegionDrag(const EditedRegion& region, const RigidMove& turned,
                       const DragSpace& space, const Camera& camera,
                       const Eigen::Vector3d& centre,
                       const std::optional<Eigen::Vector3d>& grabbed, const DragWay& way,
                       const Eigen::Vector2d& pixel)
    : region_(region.name), can_turn_(region.role != Role::Pin), start_(region.placement),
      turned_(turned), space_(space), camera_(camera), centre_(centre),
      grabbed_(grabbed.value_or(centre)), pressed_(pixel), pixel_(pixel),
      drag_(camera, way.turns() ? centre : grabbed_, way, pixel)
{
}

void RegionDrag::move_to(const Eigen::Vector2d& pixel, bool snaps)
{
    snaps_ = snaps;
    pixel_ = pixel;
    drag_.move_to(pixel);
}

void RegionDrag::change_way(const DragWay& way)
{
    drag_ = GizmoDrag(camera_, way.turns() ? centre_ : grabbed_, way, pressed_);
    drag_.move_to(pixel_);
}

bool RegionDrag::key(const KeyEvent& event)
{
    if (event.key == Key::Backspace)
    {
        typed_.backspace();
        return true;
    }
    if (event.key != Key::Character)
        return false;
    const char c = event.character;
    const bool turns = way().turns();
    if (c >= 'x' && c <= 'z')
    {
        DragWay next{turns                   ? DragWay::Kind::TurnAxis
                     : event.modifiers.shift ? DragWay::Kind::MovePlane
                                             : DragWay::Kind::MoveAxis,
                     c - 'x'};
        if (next == way()) // twice: without it again
            next = {turns ? DragWay::Kind::TurnView : DragWay::Kind::MoveScreen, 0};
        change_way(next);
        return true;
    }
    if (c == 'r' && can_turn_)
    {
        change_way({way().kind == DragWay::Kind::TurnView ? DragWay::Kind::TurnFree
                                                          : DragWay::Kind::TurnView,
                    0});
        return true;
    }
    if (c == 'g')
    {
        change_way({DragWay::Kind::MoveScreen, 0});
        return true;
    }
    return typed_.put(c);
}

DragAmount RegionDrag::amount() const
{
    DragEntry entry{snaps_ ? space_.snap * space_.view_per_model : 0.0, typed_.value()};
    if (entry.typed && !way().turns())
        *entry.typed *= space_.view_per_model;
    return drag_.amount(entry);
}

RigidMove RegionDrag::placement() const
{
    const DragAmount amount = this->amount();
    // A shift is written as it was, whatever the pivot is.
    return moved(amount.degrees == 0.0 ? start_ : turned_,
                 amount.shift / space_.view_per_model, amount.axis, amount.degrees);
}

Eigen::Vector3d RegionDrag::centre() const
{
    return centre_ + amount().shift;
}

std::string RegionDrag::status() const
{
    const DragAmount amount = this->amount();
    const Eigen::Vector3d shift = amount.shift / space_.view_per_model;
    const int axis = way().axis;
    std::string what, how_much;
    switch (way().kind)
    {
    case DragWay::Kind::MoveScreen:
        what = "Move";
        how_much =
            number(shift.x()) + ", " + number(shift.y()) + ", " + number(shift.z());
        break;
    case DragWay::Kind::MoveAxis:
        what = std::string("Move ") + kAxes[axis];
        how_much = number(shift[axis]);
        break;
    case DragWay::Kind::MovePlane:
        what = std::string("Move ") + kPlanes[axis];
        how_much =
            number(shift[axis == 0 ? 1 : 0]) + ", " + number(shift[axis == 2 ? 1 : 2]);
        break;
    case DragWay::Kind::TurnAxis:
        what = std::string("Turn ") + kAxes[axis];
        how_much = number(amount.degrees) + "°";
        break;
    case DragWay::Kind::TurnView:
    case DragWay::Kind::TurnFree:
        what = "Turn";
        how_much = number(amount.degrees) + "°";
        break;
    }
    if (!typed_.empty())
        how_much = "[" + typed_.text() + "]";
    return what + " " + how_much;
}

} // namespace cellwarp::core
