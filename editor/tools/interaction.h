// SPDX-License-Identifier: GPL-3.0-or-later
// What the user's hand means: pointer and key events become selections, drags and camera
// moves. No window; a window sends events in and draws what is told here.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "editor/document/editing.h"
#include "editor/tools/camera.h"
#include "editor/tools/events.h"
#include "editor/tools/gizmo.h"
#include "editor/tools/keys.h"

namespace cellwarp::core
{

/// What a click would pick.
struct Hover
{
    std::uint32_t sample = 0;
    Eigen::Vector3d point = Eigen::Vector3d::Zero(); ///< [view]
    int region = -1;
};

/// A rod or curve as it is to be drawn, in view space.
struct SeenLine
{
    struct Point
    {
        Eigen::Vector3d place;
        bool is_held = false, is_active = false, is_hot = false;
    };
    std::vector<Eigen::Vector3d> places;
    std::vector<Point> points;
    bool is_rod = true, is_bone = false, is_active = false;
};

/// What the active region turns about, in view space.
struct SeenPivot
{
    /// A place that it snaps to.
    struct Mark
    {
        Eigen::Vector3d place;
        std::string name;
        Eigen::Vector3d rest; ///< [model unit]
    };
    Eigen::Vector3d place;
    std::vector<Mark> marks; ///< while it is in the hand
};

/// Who leads the joints of a skeleton while time runs.
class FleshPuller
{
public:
    virtual ~FleshPuller() = default;
    /// To a place, or as near as its bone gets [view].
    virtual void pull(const std::string& joint, const Eigen::Vector3d& place) = 0;
    /// A sample of the flesh.
    virtual void pull(std::uint32_t sample, const Eigen::Vector3d& place) = 0;
    virtual void let_go() = 0;
};

class Interaction
{
public:
    static constexpr double kBrushSmallest = 2.0, kBrushLargest = 500.0; ///< [pixel]

    /// \p editing must outlive it.
    explicit Interaction(Editing& editing);
    ~Interaction();

    // Events. Places in pixels of the view, from its upper left corner. What is not
    // finite is left out. Several moves between two updates count as the last; lassos and
    // brushes take their whole way.
    void resize(double width, double height);
    void pointer_moved(const Eigen::Vector2d& pixel, const Modifiers& modifiers);
    void button(Button button, bool is_pressed, const Modifiers& modifiers);
    void wheel(const Eigen::Vector2d& steps, const Modifiers& modifiers);
    void key(const KeyEvent& event);
    /// The pointer left, or the window lost the keyboard: gestures end as by Escape.
    void focus_lost();
    /// Once a drawn frame, after Editing::update(): does what the events since the last
    /// one amount to.
    void update();
    /// Until what goes on in the background is done. For tests and scripts.
    void wait();

    // Settings of the hand.
    Tool tool() const;
    void set_tool(Tool tool);
    Navigation navigation() const;
    void set_navigation(Navigation navigation);
    void set_up_axis(int axis); ///< 0, 1 or 2
    void set_turning(Camera::Turning turning);
    /// As Camera::text() told it; what tells no view changes nothing.
    void look_as(const std::string& view);
    /// Whether the active tool selects also what is hidden: at first all but the brush
    /// do.
    bool selects_through() const;
    void set_selects_through(bool through);
    double brush_radius() const; ///< [pixel]
    void set_brush_radius(double pixels);
    /// Which region the gizmo is on; empty: none.
    const std::string& active_region() const;
    void set_active_region(const std::string& region);
    /// Of the active region, if it is a rod or curve: the point that keys act on.
    std::optional<std::size_t> active_point() const;
    void set_active_point(std::optional<std::size_t> point);
    /// What the active region turns about, at rest [model unit]; none: it does not turn,
    /// or about itself alone.
    std::optional<Eigen::Vector3d> pivot() const;
    void set_pivot(const std::optional<Eigen::Vector3d>& rest); ///< none: its middle
    /// While a film is shown its bones can be taken by their joints, and this is told;
    /// null: they cannot. It must outlive the film.
    void set_puller(FleshPuller* puller);
    void run(Command command); ///< as its key does
    void frame_selection();    ///< or all, where nothing is selected

    // What is to be drawn.
    const Camera& camera() const;
    std::vector<GizmoPart> gizmo() const; ///< empty: none
    std::optional<SeenPivot> seen_pivot() const;
    /// Of the selection gesture under way, or of the brush at the pointer; closed
    /// [pixel].
    std::vector<Eigen::Vector2d> outline() const;
    std::optional<Hover> hover() const;
    std::vector<SeenLine> lines() const;
    /// Points of the line that is being drawn [view].
    const std::vector<Eigen::Vector3d>& drawn() const;
    /// The document's, or what the brush at work would make of it.
    const Selection& shown_selection() const;
    /// What the gesture under way does: "Move X 0.23 (Enter: done, Esc: back)".
    std::string status() const;
    /// What the user may do next, in the first minutes; empty when there is nothing to
    /// say.
    std::string hint() const;
    /// Of the last command that could not be; gone after a few seconds or the next one.
    std::string complaint() const;
    /// A gesture is under way, or something else has a region in the hand: then the
    /// document takes no commands.
    bool is_busy() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
