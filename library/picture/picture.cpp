// SPDX-License-Identifier: GPL-3.0-or-later
// Parallel projection, four samples a pixel. Corner normals are averaged over the faces
// around a corner, the less the sharper two of them meet, so that smooth parts look
// smooth, edges stay sharp, and a bend that gets sharper along its way does not jump from
// one to the other. The sky is sampled about these normals, too: about the faces' own
// each face would have a brightness of its own. The directions of all samples of a pixel
// are those of one Fibonacci lattice, moved at random from pixel to pixel: they leave a
// third of the grain that as many random ones do.
#include "library/picture/picture.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include <Eigen/Geometry>

#include "library/picture/axes.h"
#include "library/picture/lettering.h"
#include "library/picture/projection.h"
#include "library/picture/ray_tree.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/smooth_step.h"

namespace cellwarp::core
{

namespace
{

constexpr int kSamples = 2; ///< an axis of a pixel
constexpr double kMargin = 1.08;
/// Angle between two faces up to where they are seen as smooth, and from where on as an
/// edge [degree].
constexpr double kSmoothUpTo = 30.0, kSharpFrom = 50.0;
constexpr double kGlass = 0.45;      ///< opacity of boxes
constexpr double kSeenThrough = 0.7; ///< opacity of beads behind something
constexpr double kEdgeWidth = 0.03;  ///< of the lines on boxes [edge]
constexpr float kInk = 0.25f;        ///< brightness of those lines

/// Of the golden section: from place to place of a Fibonacci lattice.
constexpr float kGoldenPart = 0.61803399f;

/// The rays to the sky of one of a pixel's samples: every so many-th place of a lattice
/// on the unit square.
struct SkyRays
{
    int count = 0; ///< of this sample
    int sample = 0;
    Eigen::Vector2f shift = Eigen::Vector2f::Zero(); ///< of the pixel's lattice

    Eigen::Vector2f ray(int number) const
    {
        const auto place = static_cast<float>(number * kSamples * kSamples + sample);
        const auto places = static_cast<float>(count * kSamples * kSamples);
        const Eigen::Vector2f at =
            Eigen::Vector2f(place / places, kGoldenPart * place) + shift;
        return at - at.array().floor().matrix();
    }
};

/// A number in [0, 1) that looks random, the same for the same \p state. PCG: one
/// multiplication.
float hashed(std::uint32_t state)
{
    state = state * 747796405u + 2891336453u;
    const std::uint32_t word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return static_cast<float>((word >> 22u ^ word) >> 8) / 16777216.0f;
}

/// A figure as the ray tracer sees it, in units of the picture's extent.
class Traced
{
public:
    Traced(const RayDevice& device, const Figure& figure, const Eigen::Vector3d& centre,
           double extent)
        : figure_(figure), tree_(device, RayTree::Making::Best),
          glass_(device, RayTree::Making::Best), beads_(device, RayTree::Making::Best)
    {
        const auto place = [&](const Eigen::Vector3d& x) -> Eigen::Vector3f
        { return ((x - centre) / extent).cast<float>(); };
        if (!figure.triangles.empty())
        {
            float* const v = tree_.add_triangles(
                figure.points.size(),
                {figure.triangles.front().data(), 3 * figure.triangles.size()});
            for (std::size_t i = 0; i < figure.points.size(); ++i)
                Eigen::Map<Eigen::Vector3f>(v + 3 * i) = place(figure.points[i]);
            find_normals();
        }
        std::vector<bool> is_used(figure.points.size(), false);
        for (const auto& t : figure.triangles)
            for (const std::uint32_t corner : t)
                is_used[corner] = true;
        for (std::size_t i = 0; i < figure.points.size(); ++i)
            if (!is_used[i] && figure.point_radius > 0)
                balls_.push_back(static_cast<std::uint32_t>(i));
        const auto add_ball = [&](float* ball, const Eigen::Vector3d& x, double radius)
        {
            Eigen::Map<Eigen::Vector3f>{ball} = place(x);
            ball[3] = static_cast<float>(radius / extent);
        };
        if (const std::size_t count = balls_.size() + figure.balls.size(); count > 0)
        {
            float* v = tree_.add_balls(count);
            for (const std::uint32_t point : balls_)
                add_ball(std::exchange(v, v + 4), figure.points[point],
                         figure.point_radius);
            for (const Figure::Bead& ball : figure.balls)
                add_ball(std::exchange(v, v + 4), ball.place, ball.radius);
        }
        if (!figure.boxes.empty())
        {
            static constexpr std::uint32_t sides[6][4] = {{0, 2, 6, 4}, {1, 3, 7, 5},
                                                          {0, 1, 5, 4}, {2, 3, 7, 6},
                                                          {0, 1, 3, 2}, {4, 5, 7, 6}};
            for (std::uint32_t b = 0; b < figure.boxes.size(); ++b)
                for (const auto& side : sides)
                    for (const std::uint32_t corner : side)
                        box_corners_.push_back(8 * b + corner);
            float* v = glass_.add_quadrilaterals(8 * figure.boxes.size(), box_corners_);
            for (const auto& box : figure.boxes)
                for (std::size_t k = 0; k < 8; ++k, v += 3)
                    Eigen::Map<Eigen::Vector3f>{v} = place(box[k]);
        }
        if (!figure.beads.empty())
        {
            float* const v = beads_.add_balls(figure.beads.size());
            for (std::size_t i = 0; i < figure.beads.size(); ++i)
                add_ball(v + 4 * i, figure.beads[i].place, figure.beads[i].radius);
        }
        for (RayTree* const tree : {&tree_, &glass_, &beads_})
            tree->commit();
    }
    Traced(const Traced&) = delete;
    Traced& operator=(const Traced&) = delete;

    /// Colour seen along a ray, and how much of it there is (0: background).
    Eigen::Vector4f look(const Eigen::Vector3f& origin, const Eigen::Vector3f& direction,
                         const SkyRays& sky) const
    {
        Eigen::Vector4f seen = Eigen::Vector4f::Zero();
        const std::optional<RayHit> hit = tree_.first_hit(origin, direction);
        const float reach = hit ? hit->distance : INFINITY;
        if (hit)
        {
            const Eigen::Vector3f x = origin + reach * direction;
            Eigen::Vector3f flat = hit->normal.normalized();
            Eigen::Vector3f normal = flat, colour;
            surface(*hit, normal, colour);
            if (flat.dot(direction) > 0)
                flat = -flat;
            if (normal.dot(flat) < 0)
                normal = -normal;
            const float light = shade(normal, direction) * openness(x, normal, flat, sky);
            seen = opaque(light * colour);
        }
        const Eigen::Vector4f inside = with_beads(seen, origin, direction, reach);
        if (figure_.boxes.empty())
            return inside;
        const std::optional<RayHit> box = glass_.first_hit(origin, direction);
        if (!box || box->distance > reach)
            return inside;
        Eigen::Vector3f normal = box->normal.normalized();
        if (normal.dot(direction) > 0)
            normal = -normal;
        const float u = box->u, v = box->v, edge = static_cast<float>(kEdgeWidth);
        const bool is_line = std::min({u, v, 1 - u, 1 - v}) < edge;
        const Eigen::Vector3f colour = (is_line ? kInk : 1.0f) *
                                       shade(normal, direction) *
                                       to_float(figure_.box_colours[box->element / 6]);
        const float cover = is_line ? 0.9f : static_cast<float>(kGlass);
        const Eigen::Vector4f glass = opaque(colour);
        const Eigen::Vector4f behind =
            inside.w() > 0 ? inside : Eigen::Vector4f(Eigen::Vector4f::Ones());
        return cover * glass + (1 - cover) * behind;
    }

private:
    /// What is seen of the beads over \p seen, whose distance is \p reach.
    Eigen::Vector4f with_beads(const Eigen::Vector4f& seen, const Eigen::Vector3f& origin,
                               const Eigen::Vector3f& direction, float reach) const
    {
        if (figure_.beads.empty())
            return seen;
        const std::optional<RayHit> hit = beads_.first_hit(origin, direction);
        if (!hit)
            return seen;
        const Eigen::Vector3f normal = hit->normal.normalized();
        const Eigen::Vector4f bead = opaque(shade(normal, direction) *
                                            to_float(figure_.beads[hit->element].colour));
        const float cover =
            hit->distance < reach ? 1.0f : static_cast<float>(kSeenThrough);
        return cover * bead + (1 - cover) * seen;
    }
    static Eigen::Vector4f opaque(const Eigen::Vector3f& c)
    {
        return {c.x(), c.y(), c.z(), 1.0f};
    }
    static Eigen::Vector3f to_float(const Colour& c)
    {
        return Eigen::Vector3f(c[0], c[1], c[2]) / 255.0f;
    }

    void find_normals()
    {
        const auto& triangles = figure_.triangles;
        std::vector<Eigen::Vector3d> faces(triangles.size());
        std::vector<std::vector<std::uint32_t>> around(figure_.points.size());
        for (std::size_t t = 0; t < triangles.size(); ++t)
        {
            const auto& [a, b, c] = triangles[t];
            faces[t] = (figure_.points[b] - figure_.points[a])
                           .cross(figure_.points[c] - figure_.points[a]);
            for (const std::uint32_t corner : triangles[t])
                around[corner].push_back(static_cast<std::uint32_t>(t));
        }
        const double sharp = std::cos(kSharpFrom * std::numbers::pi / 180.0);
        const double smooth = std::cos(kSmoothUpTo * std::numbers::pi / 180.0);
        normals_.resize(3 * triangles.size());
        for (std::size_t t = 0; t < triangles.size(); ++t)
            for (std::size_t k = 0; k < 3; ++k)
            {
                Eigen::Vector3d sum = Eigen::Vector3d::Zero();
                for (const std::uint32_t other : around[triangles[t][k]])
                {
                    const double product = faces[other].norm() * faces[t].norm();
                    const double cosine =
                        product > 0 ? faces[other].dot(faces[t]) / product : 1.0;
                    sum += smooth_step(sharp, smooth, cosine) * faces[other];
                }
                normals_[3 * t + k] = sum.stableNormalized().cast<float>();
            }
    }

    void surface(const RayHit& hit, Eigen::Vector3f& normal,
                 Eigen::Vector3f& colour) const
    {
        if (hit.body == 1 || figure_.triangles.empty())
        {
            colour = to_float(hit.element < balls_.size()
                                  ? figure_.colours[balls_[hit.element]]
                                  : figure_.balls[hit.element - balls_.size()].colour);
            return;
        }
        const auto& t = figure_.triangles[hit.element];
        const float w[3] = {1 - hit.u - hit.v, hit.u, hit.v};
        Eigen::Vector3f sum = Eigen::Vector3f::Zero();
        colour.setZero();
        for (std::size_t k = 0; k < 3; ++k)
        {
            sum += w[k] * normals_[3 * hit.element + k];
            colour += w[k] * to_float(figure_.colours[t[k]]);
        }
        if (sum.norm() > 0)
            normal = sum.normalized();
    }

    /// A light from the viewer's upper left, and a weaker one from the viewer.
    float shade(const Eigen::Vector3f& normal, const Eigen::Vector3f& direction) const
    {
        const float key = std::max(0.0f, normal.dot(key_light_));
        const float front = std::max(0.0f, -normal.dot(direction));
        return std::min(1.0f, 0.30f + 0.50f * key + 0.32f * front);
    }

    /// Share of the sky that a point sees, softened. Rays that would begin into the face
    /// are turned over to its other side.
    float openness(const Eigen::Vector3f& x, const Eigen::Vector3f& normal,
                   const Eigen::Vector3f& flat, const SkyRays& sky) const
    {
        if (sky.count <= 0)
            return 1.0f;
        const Eigen::Vector3f side = normal.unitOrthogonal(), other = normal.cross(side);
        int open = 0;
        for (int r = 0; r < sky.count; ++r)
        {
            const Eigen::Vector2f at = sky.ray(r);
            const float radius = std::sqrt(at.x());
            const float phi = 2.0f * std::numbers::pi_v<float> * at.y();
            Eigen::Vector3f d = radius * std::cos(phi) * side +
                                radius * std::sin(phi) * other +
                                std::sqrt(1.0f - at.x()) * normal;
            if (const float into = d.dot(flat); into < 0.0f)
                d -= 2.0f * into * flat;
            open += !tree_.is_blocked(x + 1e-4f * flat, d, 1e-4f, 0.25f);
        }
        return 0.35f + 0.65f * static_cast<float>(open) / static_cast<float>(sky.count);
    }

    const Figure& figure_;
    std::vector<std::uint32_t> box_corners_; ///< four a side; glass_ reads them
    RayTree tree_; ///< of faces, then of balls, where there are any
    RayTree glass_, beads_;
    std::vector<std::uint32_t> balls_; ///< points that are balls
    std::vector<Eigen::Vector3f> normals_;

public:
    Eigen::Vector3f key_light_ = Eigen::Vector3f::UnitZ(); ///< set once, before looking
};

/// Without its centre and the size of its pixels.
Projection direction_of(const PictureOptions& options)
{
    const double degree = std::numbers::pi / 180.0;
    const double a = options.azimuth * degree, e = options.elevation * degree;
    const Eigen::Vector3d up = Eigen::Vector3d::Unit(options.up);
    // Towards the viewer, as in the editor: where z is up that is -y.
    const Eigen::Vector3d front = options.up == 2
                                      ? Eigen::Vector3d(-Eigen::Vector3d::UnitY())
                                      : Eigen::Vector3d::Unit((options.up + 1) % 3);
    const Eigen::Vector3d side = up.cross(front);
    Projection view;
    view.back =
        std::cos(e) * (std::cos(a) * front - std::sin(a) * side) + std::sin(e) * up;
    view.right = up.cross(view.back).normalized();
    view.up = view.back.cross(view.right);
    view.width = options.width;
    view.height = options.height;
    return view;
}

/// Pixels of a picture that has all its rays to the sky.
constexpr double kPixelsOfAllRays = 1e6;
constexpr int kLeastRays = 4;

int occlusion_rays(const PictureOptions& options)
{
    const double pixels = static_cast<double>(options.width) * options.height;
    const int fewer = static_cast<int>(options.occlusion_rays *
                                       std::min(1.0, kPixelsOfAllRays / pixels));
    return std::min(options.occlusion_rays, std::max(kLeastRays, fewer));
}

/// Of letters, for a picture of this size [pixel]; beside axes there is room for so many
/// lines on each side.
double line_height(const PictureOptions& options)
{
    return std::clamp(0.024 * std::min(options.width, options.height), 11.0, 60.0);
}
constexpr double kRoomOfAxes = 4.5;

/// Of a label, from the upper edge of the picture to its middle [height of a line].
constexpr double kLabelFromTop = 1.2;
constexpr Colour kLabelInk = {70, 74, 82};

/// A box in the viewer's directions: right, up and back.
class SeenBox
{
public:
    explicit SeenBox(const Projection& view) : view_(&view) {}
    void add(const Eigen::Vector3d& x)
    {
        box_.extend(
            Eigen::Vector3d(view_->right.dot(x), view_->up.dot(x), view_->back.dot(x)));
    }
    void add(const Eigen::AlignedBox3d& box)
    {
        for (int k = 0; k < 8; ++k)
            add(box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k)));
    }
    Eigen::Vector3d size() const { return box_.sizes(); }
    Eigen::Vector3d centre() const
    {
        const Eigen::Vector3d middle = box_.center();
        return middle.x() * view_->right + middle.y() * view_->up +
               middle.z() * view_->back;
    }

private:
    const Projection* view_;
    Eigen::AlignedBox3d box_;
};

/// Calls visit(place) for all that must be in the picture.
template <class Visit>
void for_each_place(const Figure& figure, const Visit& visit)
{
    std::for_each(figure.points.begin(), figure.points.end(), visit);
    for (const auto& corners : figure.boxes)
        std::for_each(corners.begin(), corners.end(), visit);
    for (const Figure::Bead& bead : figure.beads)
        visit(bead.place);
}

} // namespace

Image draw(const std::vector<Figure>& figures, const PictureOptions& options)
{
    Projection view = direction_of(options);
    Eigen::AlignedBox3d all;
    SeenBox seen_all(view);
    for (const Figure& figure : figures)
        for_each_place(figure,
                       [&](const Eigen::Vector3d& x)
                       {
                           all.extend(x);
                           seen_all.add(x);
                       });
    double extent =
        std::max(seen_all.size().maxCoeff(), 2.0 * figures.front().point_radius);
    if (!(extent > 0))
        extent = 1.0;
    const Eigen::AlignedBox3d framed = options.focus ? *options.focus : all;
    SeenBox shown = seen_all;
    if (options.focus || options.shows_axes)
    {
        shown = SeenBox(view);
        shown.add(framed);
    }
    const double line = line_height(options);
    const bool has_labels =
        std::any_of(figures.begin(), figures.end(),
                    [](const Figure& figure) { return !figure.label.empty(); });
    // Beside the axes on all sides, and above, and below for the middle to stay there.
    const double beside = options.shows_axes ? 2.0 * kRoomOfAxes * line : 0.0;
    const double above = beside + (has_labels ? 2.0 * kLabelFromTop * line : 0.0);
    // The rays begin in front of all figures, also of those beside what is in focus.
    const Eigen::Vector3d middle = shown.centre();
    const Eigen::Vector3d centre =
        middle + view.back.dot(seen_all.centre() - middle) * view.back;
    const double reach = 2.0 + (centre - seen_all.centre()).norm() / extent;
    const double unit =
        kMargin *
        std::max(
            {shown.size().x() / std::max(0.3 * options.width, options.width - beside),
             shown.size().y() / std::max(0.3 * options.height, options.height - above),
             extent * 1e-3 / options.width}) /
        extent;
    view.centre = centre;
    view.pixel = unit * extent;

    const int rays = occlusion_rays(options);
    // Where a thread cannot begin this throws; within Embree it would end the program.
    parallel_for(options.height, [](int) {});
    const RayDevice device;
    Image image;
    image.width = options.width * static_cast<int>(figures.size());
    image.height = options.height;
    image.rgb.assign(3 * idx(image.width) * idx(image.height), 255);
    for (std::size_t f = 0; f < figures.size(); ++f)
    {
        Traced traced(device, figures[f], centre, extent);
        traced.key_light_ = (-0.45 * view.right + 0.75 * view.up + 0.6 * view.back)
                                .normalized()
                                .cast<float>();
        const Eigen::Vector3f direction = -view.back.cast<float>();
        parallel_for(
            options.height,
            [&](int row)
            {
                for (int column = 0; column < options.width; ++column)
                {
                    const auto pixel =
                        static_cast<std::uint32_t>(row * options.width + column);
                    SkyRays sky{.count = rays,
                                .shift = {hashed(2 * pixel), hashed(2 * pixel + 1)}};
                    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
                    for (int s = 0; s < kSamples * kSamples; ++s)
                    {
                        const double x = column + (s % kSamples + 0.5) / kSamples -
                                         0.5 * options.width;
                        const double y =
                            0.5 * options.height - row - (s / kSamples + 0.5) / kSamples;
                        const Eigen::Vector3d origin =
                            unit * (x * view.right + y * view.up) + reach * view.back;
                        sky.sample = s;
                        const Eigen::Vector4f seen =
                            traced.look(origin.cast<float>(), direction, sky);
                        sum +=
                            seen.head<3>() + (1.0f - seen.w()) * Eigen::Vector3f::Ones();
                    }
                    const std::size_t first = 3 * (idx(row) * idx(image.width) +
                                                   f * idx(options.width) + idx(column));
                    for (int k = 0; k < 3; ++k)
                        image.rgb[first + idx(k)] = static_cast<std::uint8_t>(std::lround(
                            255.0f *
                            std::clamp(sum[k] / (kSamples * kSamples), 0.0f, 1.0f)));
                }
            });
    }
    if (!options.shows_axes && !has_labels)
        return image;
    const Lettering lettering(line);
    for (std::size_t f = 0; f < figures.size(); ++f)
    {
        const int first = static_cast<int>(f) * options.width;
        if (options.shows_axes)
            draw_axes(framed, options.up, view, lettering, first, image);
        lettering.draw(figures[f].label, first + 0.5 * options.width,
                       kLabelFromTop * line, kLabelInk, image);
    }
    return image;
}

} // namespace cellwarp::core
