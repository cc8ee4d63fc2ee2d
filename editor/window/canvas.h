// SPDX-License-Identifier: GPL-3.0-or-later
// The view of the shape: what editor/document shows, drawn with OpenGL 3.3. It copies
// arrays to the graphics card when they have changed and decides nothing.
#pragma once

#include <memory>

#include "editor/document/document.h"
#include "editor/tools/camera.h"
#include "editor/window/colours.h"
#include "library/session/shape.h"

namespace cellwarp::core
{

enum class CellsShown
{
    No,
    Wire,
    Glass
};

/// How much of a shape that has very many triangles is drawn.
enum class Detail
{
    All,
    Coarse
};

/// What the user wants to see.
struct ViewOptions
{
    bool is_dark = true;
    bool shows_faces = true; ///< otherwise edges alone
    bool shows_edges = false;
    bool shows_regions = true; ///< in their colours
    bool shows_ghost = false;  ///< the rest shape as glass
    bool shows_floor = true;
    bool is_smooth =
        true; ///< edges without steps; slower where there is no graphics card
    Detail detail = Detail::All;
    CellsShown cells = CellsShown::No;
    CellColours cell_colours = CellColours::Gap;
    bool operator==(const ViewOptions&) const = default;
};

/// A rectangle of the window, from its upper left corner [pixel of the screen].
struct ViewRect
{
    int x = 0, y = 0, width = 0, height = 0;
    bool holds(double px, double py) const
    {
        return px >= x && py >= y && px < x + width && py < y + height;
    }
};

/// All that a picture is made of; nothing of it is kept.
struct CanvasScene
{
    const Document& document;
    const Selection& selection; ///< as it is seen: the brush may be at work
    const ShownShape& shape;
    const ShownShape& rest;
    const ShownCells& cells;
    const Camera& camera;
    Eigen::Vector3d low, high; ///< corners of the rest model's box [view]
};

class Canvas
{
public:
    /// \pre an OpenGL 3.3 context is current, now and whenever it is used
    Canvas();
    ~Canvas();

    /// Forgets what it holds of an earlier document.
    void clear();
    /// Copies what has changed since the last call. \return time that it took [ms]
    double upload(const CanvasScene& scene, const ViewOptions& options);
    /// Whether the last upload() brought something new.
    bool has_news() const;
    /// Whether all of it is there: of large meshes a part comes with each call, and fewer
    /// triangles are drawn until then.
    bool is_whole() const;
    /// Draws into \p rect of a window that is \p window_height high. Nothing is drawn
    /// into an empty one.
    void draw(const CanvasScene& scene, const ViewOptions& options, const ViewRect& rect,
              int window_height);
    /// Shows what was drawn the last time, if draw() would draw just that; else false.
    bool show_again(const CanvasScene& scene, const ViewOptions& options,
                    const ViewRect& rect, int window_height);
    /// The view of no document.
    void draw_empty(const ViewOptions& options, const ViewRect& rect, int window_height);
    CellScale scale_of_cells() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
