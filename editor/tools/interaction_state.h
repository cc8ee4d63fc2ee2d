// SPDX-License-Identifier: GPL-3.0-or-later
// What an Interaction keeps. Only its own sources include this: the gestures are in
// interaction_gestures.cpp, what keys do in interaction_commands.cpp.
#pragma once

#include <chrono>
#include <new>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "editor/tools/gizmo_drag.h"
#include "editor/tools/interaction.h"
#include "editor/tools/lazy_neighbours.h"
#include "editor/tools/navigation.h"
#include "editor/tools/picker.h"
#include "editor/tools/region_drag.h"
#include "editor/tools/selecting.h"
#include "io/base/error.h"
#include "octree/base/clock.h"

namespace cellwarp::core
{

/// One gesture at a time. Buttons and keys act at once; where the pointer is counts when
/// the frame is made, but for lassos and brushes, which need its whole way.
struct Interaction::State
{
    /// Samples whose visibility is looked up in a frame: some 30 ms.
    static constexpr std::size_t kLooksAtOnce = 40'000;
    static constexpr double kBrushStep = 1.15;
    static constexpr double kTwistStep = 5.0; ///< of the wheel [degree]

    /// A press that is not yet a click or a drag.
    struct Press
    {
        Eigen::Vector2d pixel;
        Modifiers modifiers;
        std::optional<Picked> picked; ///< under the pointer
    };
    /// A drag of the view.
    struct Look
    {
        CameraMotion motion;
        Button button;
        Eigen::Vector2d start, last;
        std::optional<Eigen::Vector3d> depth_point;
    };
    struct Choice
    {
        SelectGesture gesture;
        SelectMode mode;
        bool is_released = false; ///< only the rest has to be looked at

        std::string name() const; ///< "Select by box"
    };
    /// A point of a rod or curve, where it was when it was taken.
    struct PointDrag
    {
        std::size_t point = 0;
        Eigen::Vector3d place;   ///< [model unit]
        Eigen::Vector3d tangent; ///< unit
        double degrees = 0.0;    ///< of its turn
        double wheel = 0.0;      ///< turns by the wheel [degree]
    };
    /// A region in the hand.
    struct HandleDrag
    {
        RegionDrag drag;
        bool is_by_key; ///< no button is pressed
        std::optional<GizmoPart> part = {};
        std::optional<PointDrag> point = {}; ///< of a rod or curve, that alone
    };
    /// The pivot of the active region in the hand.
    struct PivotDrag
    {
        RegionDrag drag;
        std::optional<SeenPivot::Mark> mark; ///< that it snaps to
    };
    /// A pivot that the hand has given a region, whatever its name is: one of these
    /// samples, in the stage that has so many before it.
    struct Pivot
    {
        std::size_t num_stages, num_samples;
        Eigen::Vector3d centre; ///< EditedRegion::centre
        Eigen::Vector3d rest;   ///< [model unit]
    };
    /// A joint, or a sample of the flesh, in the hand while time runs.
    struct Pull
    {
        std::string joint;
        std::uint32_t sample = 0; ///< where the joint has no name
        Eigen::Vector3d place;    ///< where it was taken [view]
    };
    /// How a region is taken into the hand.
    struct DragStart
    {
        DragWay way;
        Eigen::Vector2d pixel;
        bool is_by_key = false;
        std::optional<Eigen::Vector3d> grabbed = {}; ///< point of the shape [view]
        std::optional<GizmoPart> part = {};
        std::optional<std::size_t> point = {}; ///< of a rod or curve, that alone
    };
    /// A point of a rod or curve, under the pointer.
    struct PointAt
    {
        std::string region;
        std::size_t point = 0;
    };
    /// A command that waits for the neighbours of samples.
    struct Spread
    {
        Command command;
        std::optional<std::uint32_t> sample; ///< under the pointer
    };

    Editing& editing;
    Camera camera;
    Picker picker;
    LazyNeighbours neighbours;

    Tool tool = Tool::Box;
    Navigation navigation = Navigation::Blender;
    /// Whether what is hidden is selected, too: a brush paints a surface, but a box is
    /// drawn around a part of the body, which has a far side.
    bool boxes_go_through = true, brush_goes_through = false;
    bool has_framed = false;
    int num_drags = 0;          ///< that changed something
    double brush_radius = 30.0; ///< [pixel]
    std::string active;
    std::optional<std::size_t> active_point; ///< of the active region
    std::vector<Eigen::Vector3d> drawn;      ///< of the line under way [view]

    Eigen::Vector2d pixel = Eigen::Vector2d::Zero(); ///< of the pointer
    Modifiers modifiers;
    bool is_inside = false; ///< the pointer has been in the view
    bool has_moved = false; ///< since the last update
    std::variant<std::monostate, Press, Look, Choice, HandleDrag, PivotDrag, Pull>
        gesture;
    std::vector<Pivot> pivots;
    FleshPuller* puller = nullptr;
    std::optional<Spread> spread;
    std::optional<Selection> preview; ///< of a brush
    /// Of the last box or lasso: samples that it left out, for they are hidden, and the
    /// document's revision with what it chose.
    std::size_t num_left_out = 0;
    std::uint64_t left_out_at = 0;
    std::optional<Hover> hover;
    std::optional<GizmoPart> hot;
    std::optional<PointAt> hot_point;
    std::string complaint;
    Clock::time_point complaint_ends;

    explicit State(Editing& of) : editing(of), neighbours(of.document().model()) {}

    Document& document() { return editing.document(); }
    const Document& document() const { return std::as_const(editing).document(); }

    template <class Type>
    Type* current()
    {
        return std::get_if<Type>(&gesture);
    }
    template <class Type>
    const Type* current() const
    {
        return std::get_if<Type>(&gesture);
    }
    bool is_idle() const { return std::holds_alternative<std::monostate>(gesture); }

    void complain(const std::string& what);
    /// Does a command; what cannot be is said.
    template <class Do>
    void attempt(Do&& what)
    {
        complaint.clear();
        try
        {
            what();
        }
        catch (const Error& error)
        {
            complain(error.what());
        }
        catch (const std::bad_alloc&)
        {
            complain("out of memory");
        }
    }

    // Regions.
    const EditedRegion* active_region() const { return document().region(active); }
    const EditedRegion* region_at(const std::optional<Picked>& picked) const;
    bool tool_turns(const EditedRegion& region) const; ///< a pin never
    std::vector<GizmoPart> gizmo() const;
    /// The part under a pixel.
    std::optional<GizmoPart> part_at(const Eigen::Vector2d& where) const;
    void take(const std::string& name, const DragStart& start);
    DragSpace drag_space() const;
    /// Tells the document's hand where the gesture's is.
    void lead();
    void let_go();

    // Pivots.
    static bool has_pivot(const EditedRegion& region);
    bool is_of(const Pivot& pivot, const EditedRegion& region) const;
    Eigen::Vector3d pivot_of(const EditedRegion& region) const; ///< at rest [model unit]
    /// Of a place at rest [model unit], where its region has it now [view].
    Eigen::Vector3d place_of(const Eigen::Vector3d& rest,
                             const EditedRegion& region) const;
    std::vector<SeenPivot::Mark> pivot_marks(const EditedRegion& region) const;
    const EditedRegion& turning_region() const;
    void set_pivot(const std::optional<Eigen::Vector3d>& rest);
    void pivot_to_border();
    void take_pivot();
    void move_pivot();
    void snap_pivot();
    void let_pivot_go();
    std::string pivot_status() const;

    // Rods and curves.
    const ShownLine* line_of(const std::string& region) const; ///< null: none is shown
    std::optional<Eigen::Vector3d> active_place() const;       ///< of the point [view]
    bool is_joint(const std::string& region) const;
    std::optional<PointAt> point_at(const Eigen::Vector2d& where) const;
    /// The joint of a film under a pixel.
    std::optional<Pull> joint_at(const Eigen::Vector2d& where) const;
    /// In the plane through a point that faces the eye.
    Eigen::Vector3d at_depth(const Eigen::Vector2d& where,
                             const Eigen::Vector3d& point) const;
    PointPlacement point_placement(const HandleDrag& drag) const;
    /// The middle of the shape under the pixel; beside it, as deep as the last point.
    Eigen::Vector3d through(const Eigen::Vector2d& where) const;
    void end_drawing(Role role);
    void draw_centre_line();
    /// The points with one more, or one less.
    void insert_point();
    void remove_point();
    void release_point(const HoldParts& parts);

    // Choosing.
    void start_choice(SelectGesture::Kind kind, const Press& press);
    /// Of the active tool.
    bool& goes_through()
    {
        return tool == Tool::Brush ? brush_goes_through : boxes_go_through;
    }
    void update_choice();
    void end_choice();
    /// Completes the selection that earlier events asked for and that is still being
    /// found, before a press or a key that follows them.
    void finish_selecting();
    void click(const Press& press);

    // Buttons and the pointer.
    void press(Button button, const Modifiers& with);
    void release(Button button);
    /// A press whose pointer has gone too far for a click.
    void begin_pull(const Press& press);
    /// What the pointer's last place means for the gesture.
    void follow_pointer();
    /// Hands the shape to the picker; that memory ends is said. \p waits: until the
    /// picker has it.
    void update_picker(bool waits);
    void find_hover();
    void cancel();

    // Keys.
    void key(const KeyEvent& event);
    void run(Command command);
    void take_tool(Tool next);
    void run_spread(const Neighbours& around);
    void make_region(Role role);
    void remove_region();
    void next_region();
    /// Shows the samples of a set, or all.
    void frame(const Selection& selection);
};

} // namespace cellwarp::core
