// SPDX-License-Identifier: GPL-3.0-or-later
// Order of drawing: background, the shape with its edges, the floor (which blends over
// them), the ghost, the cells. A frame in which nothing changed copies and draws nothing:
// the last picture is shown again, which takes the cores of a solver that is at work, or
// of a machine without a graphics card, for a moment only.
#include "editor/window/canvas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/LU>

#include "editor/window/gl.h"
#include "editor/window/shaders.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// A pixel, where edges are smooth.
constexpr int kSamples = 4;
/// Lines lie this much of the depth range before the faces that they belong to.
constexpr float kLineNearer = 4e-5f;
constexpr float kGhostOpacity = 0.42f;
/// Points whose distance to the next is looked up to find how large they are drawn.
constexpr std::size_t kSpacingProbes = 48;
/// A point is drawn this much larger than its distance to the next one, so that no
/// holes are seen between points that are spread at random.
constexpr double kPointOverlap = 2.4, kCoarseOverlap = 1.4;
constexpr double kFloorReach = 3.0; ///< half side [view]
/// How wide the points of drawn lines are, over those of a cloud: the lines show.
constexpr double kOnLines = 0.2;

/// So many points of a cloud, and up to twice as many, are drawn where all would be slow.
constexpr int kCoarsePoints = 100000;
/// Corners of triangles that go to the graphics card in one frame.
constexpr std::size_t kCornersAtOnce = 1000000;

Eigen::Matrix4f as_float(const Eigen::Matrix4d& matrix)
{
    return matrix.cast<float>();
}

void set_colour(const ShaderProgram& program, const char* name, const Colour& colour)
{
    program.set(name, colour[0] / 255.0f, colour[1] / 255.0f, colour[2] / 255.0f, 1.0f);
}

/// Median distance of a sample to the next one that is elsewhere [work].
double spacing_of(const ShownShape& shape)
{
    const std::size_t count = shape.positions.size() / 3;
    std::vector<float> nearest;
    for (std::size_t k = 0; k < std::min(count, kSpacingProbes); ++k)
    {
        const float* probe = shape.positions.data() + 3 * (k * count / kSpacingProbes);
        float least = std::numeric_limits<float>::max();
        for (std::size_t i = 0; i < count; ++i)
        {
            const float* x = shape.positions.data() + 3 * i;
            const float a = x[0] - probe[0], b = x[1] - probe[1], c = x[2] - probe[2];
            const float squared = a * a + b * b + c * c;
            if (squared > 0.0f && squared < least)
                least = squared;
        }
        nearest.push_back(std::sqrt(least));
    }
    if (nearest.empty())
        return 0.0;
    std::nth_element(nearest.begin(),
                     nearest.begin() + static_cast<std::ptrdiff_t>(nearest.size() / 2),
                     nearest.end());
    return nearest[nearest.size() / 2];
}

/// A shape on the graphics card.
class DrawnShape
{
public:
    /// \return whether anything has changed
    bool upload(const ShownShape& shape)
    {
        if (shape.layout == nullptr)
            return false;
        const bool was_whole = is_whole();
        if (!was_whole)
            upload_triangles();
        if (version_ == shape.version && layout_ == shape.layout)
            return !was_whole;
        positions_.fill(shape.positions.data(), shape.positions.size() * sizeof(float));
        normals_.fill(shape.normals.data(), shape.normals.size() * sizeof(float));
        to_view_ = shape.to_view;
        version_ = shape.version;
        count_ = static_cast<GLsizei>(shape.positions.size() / 3);
        if (layout_ == shape.layout)
            return true;
        layout_ = shape.layout;
        num_corners_ = static_cast<GLsizei>(layout_->triangles.size());
        array_.bind();
        // One buffer: all triangles, then the coarse ones, which come first, and lines.
        num_coarse_ = static_cast<GLsizei>(layout_->coarse_triangles.size());
        num_ends_ = static_cast<GLsizei>(layout_->lines.size());
        triangles_.reserve(idx(num_corners_ + num_coarse_ + num_ends_) *
                           sizeof(std::uint32_t));
        triangles_.write(layout_->lines.data(), idx(num_ends_) * sizeof(std::uint32_t),
                         idx(num_corners_ + num_coarse_) * sizeof(std::uint32_t));
        triangles_.write(layout_->coarse_triangles.data(),
                         idx(num_coarse_) * sizeof(std::uint32_t),
                         idx(num_corners_) * sizeof(std::uint32_t));
        num_uploaded_ = 0;
        upload_triangles();
        array_.floats(0, positions_, 3);
        if (shape.normals.empty())
            array_.constant(1);
        else
            array_.floats(1, normals_, 3);
        array_.constant(2);
        if (num_corners_ == 0 && spacing_ == 0.0)
            spacing_ = (has_lines() ? kOnLines : 1.0) * spacing_of(shape);
        has_colours_ = false;
        return true;
    }

    void set_colours(const std::vector<Colour>& colours)
    {
        colours_.fill(colours.data(), colours.size() * sizeof(Colour));
        array_.colours(2, colours_);
        has_colours_ = true;
    }

    /// Whether all triangles are there; until then the coarse ones are drawn.
    bool is_whole() const { return num_uploaded_ == num_corners_; }
    bool is_cloud() const { return num_corners_ == 0; }
    bool is_empty() const { return count_ == 0; }
    const std::shared_ptr<const ShapeLayout>& layout() const { return layout_; }
    const Eigen::Matrix4d& to_view() const { return to_view_; }
    double spacing() const { return spacing_; }

    /// Of a cloud, which points are drawn: all, or one of so many.
    int point_step(Detail detail) const
    {
        return detail == Detail::Coarse ? std::max(1, count_ / kCoarsePoints) : 1;
    }

    bool has_lines() const { return num_ends_ > 0; }
    void draw_lines() const
    {
        bind();
        glDrawElements(GL_LINES, num_ends_, GL_UNSIGNED_INT,
                       reinterpret_cast<const void*>(idx(num_corners_ + num_coarse_) *
                                                     sizeof(std::uint32_t)));
    }

    void draw(Detail detail) const
    {
        bind();
        if (is_cloud())
            draw_points(point_step(detail));
        else if ((detail == Detail::Coarse || !is_whole()) && num_coarse_ > 0)
            glDrawElements(
                GL_TRIANGLES, num_coarse_, GL_UNSIGNED_INT,
                reinterpret_cast<const void*>(idx(num_corners_) * sizeof(std::uint32_t)));
        else
            glDrawElements(GL_TRIANGLES, num_corners_, GL_UNSIGNED_INT, nullptr);
    }

private:
    void bind() const
    {
        array_.bind();
        if (!has_colours_)
        {
            const Colour colour = free_colour();
            glVertexAttrib4f(2, colour[0] / 255.0f, colour[1] / 255.0f,
                             colour[2] / 255.0f, 0.0f);
        }
        glVertexAttrib3f(1, 0.0f, 0.0f, 0.0f);
    }
    void draw_points(int step) const
    {
        read_every(step);
        glDrawArrays(GL_POINTS, 0, (count_ + step - 1) / step);
        read_every(1);
    }
    /// One of so many places is a vertex.
    void read_every(int step) const
    {
        array_.floats(0, positions_, 3, step * 3 * static_cast<int>(sizeof(float)));
        if (has_colours_)
            array_.colours(2, colours_, step * static_cast<int>(sizeof(Colour)));
    }
    /// The next part, or all where there are no coarse triangles to draw meanwhile.
    void upload_triangles()
    {
        array_.bind();
        const std::size_t first = idx(num_uploaded_), all = idx(num_corners_);
        const std::size_t count =
            num_coarse_ > 0 ? std::min(all - first, kCornersAtOnce) : all - first;
        triangles_.write(layout_->triangles.data() + first, count * sizeof(std::uint32_t),
                         first * sizeof(std::uint32_t));
        num_uploaded_ += static_cast<GLsizei>(count);
    }

    VertexArray array_;
    GpuBuffer positions_{GL_ARRAY_BUFFER}, normals_{GL_ARRAY_BUFFER},
        colours_{GL_ARRAY_BUFFER}, triangles_{GL_ELEMENT_ARRAY_BUFFER};
    std::shared_ptr<const ShapeLayout> layout_;
    Eigen::Matrix4d to_view_ = Eigen::Matrix4d::Identity();
    std::uint64_t version_ = 0;
    GLsizei count_ = 0, num_corners_ = 0, num_coarse_ = 0, num_ends_ = 0;
    GLsizei num_uploaded_ = 0; ///< of the corners
    double spacing_ = 0.0;     ///< [work], of a cloud
    bool has_colours_ = false;
};

/// One box, as the graphics card reads it.
struct DrawnCell
{
    std::array<float, 3> origin, edge_x, edge_y, edge_z; ///< [work]
    Colour colour;
};

/// The boxes of the cells on the graphics card: one cube, drawn once a cell.
class CanvasCells
{
public:
    CanvasCells()
    {
        std::array<float, 24> corners{};
        for (std::size_t k = 0; k < 8; ++k)
            for (std::size_t a = 0; a < 3; ++a)
                corners[3 * k + a] = static_cast<float>((k >> a) & 1u);
        // Each face as two triangles; then the twelve edges.
        constexpr std::array<std::uint16_t, 60> kIndices = {
            0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5, 0, 1, 5, 0, 5, 4, 2, 6,
            7, 2, 7, 3, 0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 2, 3,
            4, 5, 6, 7, 0, 2, 1, 3, 4, 6, 5, 7, 0, 4, 1, 5, 2, 6, 3, 7};
        array_.bind();
        indices_.fill(kIndices.data(), sizeof kIndices);
        corners_.fill(corners.data(), sizeof corners);
        array_.floats(0, corners_, 3);
        constexpr int kStride = sizeof(DrawnCell);
        for (GLuint k = 0; k < 4; ++k)
            array_.floats(1 + k, cells_, 3, kStride, 12 * k, true);
        array_.colours(5, cells_, kStride, offsetof(DrawnCell, colour), true);
    }

    void upload(const ShownCells& cells, CellColours by,
                std::span<const EditedRegion> regions)
    {
        scale_ = cell_scale(cells, by);
        std::vector<DrawnCell> boxes(cells.cells.size());
        for (std::size_t c = 0; c < boxes.size(); ++c)
        {
            const auto& x = cells.cells[c].corners;
            const auto edge = [&](std::size_t k) -> std::array<float, 3> {
                return {x[k].x() - x[0].x(), x[k].y() - x[0].y(), x[k].z() - x[0].z()};
            };
            boxes[c] = {{x[0].x(), x[0].y(), x[0].z()},
                        edge(1),
                        edge(2),
                        edge(4),
                        cell_colour(cells.cells[c], by, scale_, regions)};
        }
        cells_.fill(boxes.data(), boxes.size() * sizeof(DrawnCell));
        count_ = static_cast<GLsizei>(boxes.size());
    }

    void draw_faces() const
    {
        array_.bind();
        glDrawElementsInstanced(GL_TRIANGLES, 36, GL_UNSIGNED_SHORT, nullptr, count_);
    }
    void draw_edges() const
    {
        array_.bind();
        glDrawElementsInstanced(GL_LINES, 24, GL_UNSIGNED_SHORT,
                                reinterpret_cast<const void*>(36 * sizeof(std::uint16_t)),
                                count_);
    }
    const CellScale& scale() const { return scale_; }

private:
    VertexArray array_;
    GpuBuffer corners_{GL_ARRAY_BUFFER}, cells_{GL_ARRAY_BUFFER},
        indices_{GL_ELEMENT_ARRAY_BUFFER};
    GLsizei count_ = 0;
    CellScale scale_;
};

/// What the colours of the samples depend on.
struct ColoursOf
{
    std::uint64_t revision = 0;
    const ShapeLayout* layout = nullptr;
    bool shows_regions = true;
    bool operator==(const ColoursOf&) const = default;
};

/// What the boxes of the cells depend on.
struct CellsOf
{
    std::uint64_t version = 0;
    CellColours by = CellColours::Gap;
    std::uint64_t revision = 0; ///< where they have the regions' colours
    bool operator==(const CellsOf&) const = default;
};

/// What a picture depends on.
struct PictureOf
{
    std::uint64_t upload = 0; ///< the last one that brought something new
    ViewOptions options;
    int width = 0, height = 0;
    // Of a document:
    Eigen::Matrix4d view = Eigen::Matrix4d::Zero(), projection = view,
                    cells_to_view = view;
    Eigen::Vector3d low = Eigen::Vector3d::Zero(), high = low;
    int up_axis = -1;
    bool operator==(const PictureOf&) const = default;
};

} // namespace

struct Canvas::State
{
    ShaderProgram background{shaders::kBackgroundVertex, shaders::kBackgroundFragment};
    ShaderProgram faces{shaders::kShapeVertex, shaders::kFaceFragment};
    ShaderProgram lines{shaders::kShapeVertex, shaders::kLineFragment};
    ShaderProgram points{shaders::kShapeVertex, shaders::kPointFragment};
    ShaderProgram boxes{shaders::kCellVertex, shaders::kCellFragment};
    ShaderProgram floor{shaders::kFloorVertex, shaders::kFloorFragment};
    VertexArray nothing; ///< for shaders that need no attribute
    Offscreen smooth{kSamples}, picture{1};
    bool is_smooth = false, is_kept = false; ///< the frame that is being drawn
    std::uint64_t num_uploads = 0;           ///< that brought something new
    bool has_news = false;                   ///< the last upload brought some
    std::optional<PictureOf> picture_of;     ///< the picture that is kept
    std::optional<DrawnShape> shape, rest;
    CanvasCells cells;
    std::optional<ColoursOf> colours_of;
    std::vector<Colour> colours; ///< of the samples, as they are shown
    Selection selection; ///< that the colours show: a brush at work changes only this
    std::optional<CellsOf> cells_of;

    PictureOf picture_wanted(const ViewOptions& options, const ViewRect& rect) const;
    PictureOf picture_wanted(const CanvasScene& scene, const ViewOptions& options,
                             const ViewRect& rect) const;
    bool show_again(const PictureOf& wanted, const ViewRect& rect,
                    int window_height) const;
    void begin(const ViewRect& rect, int window_height, const ViewOptions& options);
    void end(const ViewRect& rect, int window_height);
    void remember(const PictureOf& drawn)
    {
        if (is_kept)
            picture_of = drawn;
    }
    void set_up(const ShaderProgram& program, const CanvasScene& scene,
                const Eigen::Matrix4d& to_view) const;
    void draw_shape(const CanvasScene& scene, const ViewOptions& options,
                    const ViewRect& rect);
    void draw_points(const CanvasScene& scene, const DrawnShape& drawn,
                     const ViewRect& rect, Detail detail, float opacity);
    void draw_ghost(const CanvasScene& scene, const ViewOptions& options,
                    const ViewRect& rect);
    void draw_cells(const CanvasScene& scene, const ViewOptions& options);
    void draw_floor(const CanvasScene& scene, const ViewOptions& options);
};

Canvas::Canvas() : state_(std::make_unique<State>())
{
    clear();
}
Canvas::~Canvas() = default;

void Canvas::clear()
{
    state_->shape.emplace();
    state_->rest.emplace();
    state_->colours_of.reset();
    state_->colours = {};
    state_->cells_of.reset();
    ++state_->num_uploads;
}

bool Canvas::is_whole() const
{
    return state_->shape->is_whole() && state_->rest->is_whole();
}

bool Canvas::has_news() const
{
    return state_->has_news;
}

CellScale Canvas::scale_of_cells() const
{
    return state_->cells.scale();
}

double Canvas::upload(const CanvasScene& scene, const ViewOptions& options)
{
    const Clock::time_point start = Clock::now();
    State& state = *state_;
    bool is_new = state.shape->upload(scene.shape);
    const ColoursOf colours_of{scene.document.revision(), state.shape->layout().get(),
                               options.shows_regions};
    if (colours_of.layout != nullptr &&
        (state.colours_of != colours_of || state.selection != scene.selection))
    {
        std::vector<Colour> colours =
            sample_colours(scene.document, scene.selection, *state.shape->layout(),
                           options.shows_regions);
        const bool has_same_layout =
            state.colours_of && state.colours_of->layout == colours_of.layout;
        // Most edits move a region and leave all colours as they are.
        if (!has_same_layout || colours != state.colours)
        {
            state.shape->set_colours(colours);
            state.colours = std::move(colours);
            is_new = true;
        }
        state.colours_of = colours_of;
        state.selection = scene.selection;
    }
    if (options.shows_ghost || !state.rest->is_whole())
        is_new = state.rest->upload(scene.rest) || is_new;
    const CellsOf cells_of{
        scene.cells.version, options.cell_colours,
        options.cell_colours == CellColours::Region ? scene.document.revision() : 0};
    if (options.cells != CellsShown::No && state.cells_of != cells_of)
    {
        state.cells.upload(scene.cells, options.cell_colours, scene.document.regions());
        state.cells_of = cells_of;
        is_new = true;
    }
    state.num_uploads += is_new;
    state.has_news = is_new;
    return ms_since(start);
}

PictureOf Canvas::State::picture_wanted(const ViewOptions& options,
                                        const ViewRect& rect) const
{
    return {num_uploads, options, rect.width, rect.height};
}

PictureOf Canvas::State::picture_wanted(const CanvasScene& scene,
                                        const ViewOptions& options,
                                        const ViewRect& rect) const
{
    PictureOf wanted = picture_wanted(options, rect);
    wanted.view = scene.camera.view_matrix();
    wanted.projection = scene.camera.projection_matrix();
    wanted.cells_to_view = scene.cells.to_view;
    wanted.low = scene.low;
    wanted.high = scene.high;
    wanted.up_axis = scene.camera.up_axis();
    return wanted;
}

bool Canvas::State::show_again(const PictureOf& wanted, const ViewRect& rect,
                               int window_height) const
{
    if (picture_of != wanted)
        return false;
    picture.copy_to(0, rect.x, window_height - rect.y - rect.height);
    return true;
}

void Canvas::State::begin(const ViewRect& rect, int window_height,
                          const ViewOptions& options)
{
    picture_of.reset();
    is_kept = picture.begin(rect.width, rect.height);
    is_smooth = options.is_smooth && smooth.begin(rect.width, rect.height);
    if (is_kept && !is_smooth)
        picture.begin(rect.width, rect.height); // smooth.begin() has left it
    const bool is_beside = is_smooth || is_kept;
    const int x = is_beside ? 0 : rect.x;
    const int y = is_beside ? 0 : window_height - rect.y - rect.height;
    glViewport(x, y, rect.width, rect.height);
    glEnable(GL_SCISSOR_TEST);
    glScissor(x, y, rect.width, rect.height);
    glDepthMask(GL_TRUE);
    glClear(GL_DEPTH_BUFFER_BIT);
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_BLEND);
    glDisable(GL_CULL_FACE);
    glEnable(GL_MULTISAMPLE);
    background.use();
    if (options.is_dark)
    {
        background.set("upper", 0.200f, 0.212f, 0.235f, 1.0f);
        background.set("lower", 0.118f, 0.125f, 0.141f, 1.0f);
    }
    else
    {
        background.set("upper", 0.965f, 0.970f, 0.980f, 1.0f);
        background.set("lower", 0.835f, 0.850f, 0.875f, 1.0f);
    }
    nothing.bind();
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LEQUAL);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
}

void Canvas::State::end(const ViewRect& rect, int window_height)
{
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_SCISSOR_TEST);
    const int x = rect.x, y = window_height - rect.y - rect.height;
    if (is_smooth)
        smooth.copy_to(is_kept ? picture.frame() : 0, is_kept ? 0 : x, is_kept ? 0 : y);
    if (is_kept)
        picture.copy_to(0, x, y);
}

void Canvas::State::set_up(const ShaderProgram& program, const CanvasScene& scene,
                           const Eigen::Matrix4d& to_view) const
{
    program.use();
    const Eigen::Matrix4d view = scene.camera.view_matrix();
    program.set_matrix("to_eye", as_float(view * to_view).data());
    program.set_matrix("to_clip", as_float(scene.camera.projection_matrix()).data());
    program.set("is_perspective", scene.camera.is_perspective() ? 1 : 0);
    const Eigen::Vector3d up =
        view.topLeftCorner<3, 3>() * Eigen::Vector3d::Unit(scene.camera.up_axis());
    program.set("up", static_cast<float>(up.x()), static_cast<float>(up.y()),
                static_cast<float>(up.z()), 0.0f);
    set_colour(program, "selected", selected_colour());
    program.set("opacity", 1.0f);
    program.set("nearer", 0.0f);
    program.set("point_size", 0.0f);
}

void Canvas::State::draw_points(const CanvasScene& scene, const DrawnShape& drawn,
                                const ViewRect& rect, Detail detail, float opacity)
{
    set_up(points, scene, drawn.to_view());
    const double scale = std::cbrt(
        std::abs(drawn.to_view().topLeftCorner<3, 3>().determinant())); // view per work
    // Fewer points are larger, and a little more so, for chance leaves larger gaps.
    const int step = drawn.point_step(detail);
    const double width = kPointOverlap * drawn.spacing() * scale *
                         (step > 1 ? kCoarseOverlap * std::sqrt(step) : 1.0);
    // Row 1 of the projection takes a length at distance 1 to half heights of the view.
    points.set("point_size",
               static_cast<float>(width * scene.camera.projection_matrix()(1, 1) *
                                  rect.height / 2.0));
    points.set("is_perspective_points", scene.camera.is_perspective() ? 1 : 0);
    points.set("point_radius", static_cast<float>(width / 2.0));
    points.set("opacity", opacity);
    glEnable(GL_PROGRAM_POINT_SIZE);
    drawn.draw(detail);
}

void Canvas::State::draw_shape(const CanvasScene& scene, const ViewOptions& options,
                               const ViewRect& rect)
{
    if (shape->is_empty())
        return;
    if (shape->has_lines())
    {
        set_up(lines, scene, shape->to_view());
        lines.set("nearer", kLineNearer);
        lines.set("ink", 0.0f, 0.0f, 0.0f, 0.0f);
        shape->draw_lines();
    }
    if (shape->is_cloud())
    {
        draw_points(scene, *shape, rect, options.detail, 1.0f);
        return;
    }
    if (options.shows_faces)
    {
        set_up(faces, scene, shape->to_view());
        shape->draw(options.detail);
    }
    if (!options.shows_edges && options.shows_faces)
        return;
    set_up(lines, scene, shape->to_view());
    lines.set("nearer", kLineNearer);
    if (options.shows_faces)
        lines.set("ink", 0.05f, 0.06f, 0.09f, 0.42f);
    else
        lines.set("ink", 0.0f, 0.0f, 0.0f, 0.0f);
    glPolygonMode(GL_FRONT_AND_BACK, GL_LINE);
    glEnable(GL_BLEND);
    shape->draw(options.detail);
    glDisable(GL_BLEND);
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
}

void Canvas::State::draw_ghost(const CanvasScene& scene, const ViewOptions& options,
                               const ViewRect& rect)
{
    if (rest->is_empty())
        return;
    glEnable(GL_BLEND);
    if (rest->is_cloud())
    {
        glDepthMask(GL_FALSE);
        draw_points(scene, *rest, rect, options.detail, 0.12f);
        glDepthMask(GL_TRUE);
    }
    else
    {
        // The depth first: of a ghost only what is in front is seen.
        set_up(faces, scene, rest->to_view());
        faces.set("opacity", kGhostOpacity);
        glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
        rest->draw(options.detail);
        glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
        rest->draw(options.detail);
    }
    glDisable(GL_BLEND);
}

void Canvas::State::draw_cells(const CanvasScene& scene, const ViewOptions& options)
{
    set_up(boxes, scene, scene.cells.to_view);
    glEnable(GL_BLEND);
    glDepthMask(GL_FALSE);
    if (options.cells == CellsShown::Glass)
    {
        glEnable(GL_CULL_FACE);
        boxes.set("opacity", 0.30f);
        boxes.set("is_line", 0.0f);
        cells.draw_faces();
        glDisable(GL_CULL_FACE);
    }
    boxes.set("opacity", options.cells == CellsShown::Glass ? 0.55f : 0.85f);
    boxes.set("is_line", 1.0f);
    boxes.set("nearer", kLineNearer);
    cells.draw_edges();
    glDepthMask(GL_TRUE);
    glDisable(GL_BLEND);
}

void Canvas::State::draw_floor(const CanvasScene& scene, const ViewOptions& options)
{
    const int up = scene.camera.up_axis(), u = (up + 1) % 3, v = (up + 2) % 3;
    const Eigen::Vector3d half = 0.5 * (scene.high - scene.low);
    Eigen::Vector3f centre = (scene.low + half).cast<float>();
    Eigen::Vector4f side_u(0, 0, 0, kFloorReach), side_v(0, 0, 0, 0);
    centre[up] = static_cast<float>(scene.low[up]);
    side_u[u] = side_v[v] = static_cast<float>(kFloorReach);
    floor.use();
    floor.set_matrix(
        "to_clip",
        as_float(scene.camera.projection_matrix() * scene.camera.view_matrix()).data());
    floor.set("centre", centre.x(), centre.y(), centre.z(), 1.0f);
    floor.set("side_u", side_u.x(), side_u.y(), side_u.z(), side_u.w());
    floor.set("side_v", side_v.x(), side_v.y(), side_v.z(), 0.0f);
    const float ink = options.is_dark ? 0.62f : 0.30f;
    floor.set("ink", ink, ink, ink, options.is_dark ? 0.34f : 0.30f);
    floor.set("footprint", static_cast<float>(half[u]), static_cast<float>(half[v]),
              options.is_dark ? 0.30f : 0.16f, 0.0f);
    glEnable(GL_BLEND);
    glBlendFunc(GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    glDepthMask(GL_FALSE);
    nothing.bind();
    glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
    glDepthMask(GL_TRUE);
    glBlendFunc(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA);
    glDisable(GL_BLEND);
}

void Canvas::draw_empty(const ViewOptions& options, const ViewRect& rect,
                        int window_height)
{
    if (rect.width < 1 || rect.height < 1)
        return;
    const PictureOf wanted = state_->picture_wanted(options, rect);
    if (state_->show_again(wanted, rect, window_height))
        return;
    state_->begin(rect, window_height, options);
    state_->end(rect, window_height);
    state_->remember(wanted);
}

bool Canvas::show_again(const CanvasScene& scene, const ViewOptions& options,
                        const ViewRect& rect, int window_height)
{
    return state_->show_again(state_->picture_wanted(scene, options, rect), rect,
                              window_height);
}

void Canvas::draw(const CanvasScene& scene, const ViewOptions& options,
                  const ViewRect& rect, int window_height)
{
    if (rect.width < 1 || rect.height < 1)
        return;
    state_->begin(rect, window_height, options);
    state_->draw_shape(scene, options, rect);
    if (options.shows_floor)
        state_->draw_floor(scene, options);
    if (options.shows_ghost)
        state_->draw_ghost(scene, options, rect);
    if (options.cells != CellsShown::No)
        state_->draw_cells(scene, options);
    state_->end(rect, window_height);
    state_->remember(state_->picture_wanted(scene, options, rect));
}

} // namespace cellwarp::core
