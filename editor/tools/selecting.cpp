// SPDX-License-Identifier: GPL-3.0-or-later
// A million samples are projected on all threads, marked by place, and only those in the
// area are asked whether they can be seen. The sides of a lasso are sorted into rows of
// pixels, so that a sample meets only those at its own height.
#include "editor/tools/selecting.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kSampleGrain = 16'384; ///< samples worth a thread
constexpr double kLassoStep = 2.0;           ///< between a lasso's points [pixel]
constexpr int kBrushSides = 48;              ///< of its circle

/// The pixel of each place; NaN where it is outside the view.
std::vector<Eigen::Vector2f> projected(const ShownShape& shape, const Camera& camera)
{
    std::vector<Eigen::Vector2f> pixels(
        shape.positions.size() / 3,
        Eigen::Vector2f::Constant(std::numeric_limits<float>::quiet_NaN()));
    if (!(camera.width() >= 1) || !(camera.height() >= 1))
        return pixels;
    // Made once: the camera's own way costs a few sines a point.
    const Eigen::Matrix4d clip =
        camera.projection_matrix() * camera.view_matrix() * shape.to_view;
    const float* const positions = shape.positions.data();
    parallel_ranges(
        pixels.size(), kSampleGrain,
        [&](std::size_t begin, std::size_t end)
        {
            for (std::size_t i = begin; i < end; ++i)
            {
                const float* const x = positions + 3 * i;
                const Eigen::Vector4d at = clip * Eigen::Vector4d(x[0], x[1], x[2], 1.0);
                if (at.w() > 0 && std::abs(at.x()) <= at.w() &&
                    std::abs(at.y()) <= at.w())
                    pixels[i] =
                        Eigen::Vector2d(0.5 * camera.width() * (1 + at.x() / at.w()),
                                        0.5 * camera.height() * (1 - at.y() / at.w()))
                            .cast<float>();
            }
        });
    return pixels;
}

/// Marks the places whose pixel is in an area. NaN is in none.
template <class IsIn>
void mark(const std::vector<Eigen::Vector2f>& pixels, std::vector<std::uint8_t>& marks,
          IsIn&& is_in)
{
    parallel_ranges(pixels.size(), kSampleGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                            if (is_in(pixels[i]))
                                marks[i] = 1;
                    });
}

bool is_between(const Eigen::Vector2f& x, const Eigen::Vector2f& low,
                const Eigen::Vector2f& high)
{
    return x.x() >= low.x() && x.x() <= high.x() && x.y() >= low.y() && x.y() <= high.y();
}

/// A closed polygon's sides by the rows of pixels that they cross.
class Lasso
{
public:
    Lasso(const std::vector<Eigen::Vector2d>& path, double height)
        : rows_(static_cast<std::size_t>(height) + 1)
    {
        const double last = static_cast<double>(rows_.size() - 1);
        for (std::size_t i = 0; i < path.size(); ++i)
        {
            const Side side{path[i], path[i + 1 < path.size() ? i + 1 : 0]};
            const auto [low, high] = std::minmax(side.a.y(), side.b.y());
            if (!(high >= 0) || !(low <= last + 1))
                continue;
            const auto end = static_cast<std::size_t>(std::clamp(high, 0.0, last));
            for (auto row = static_cast<std::size_t>(std::clamp(low, 0.0, last));
                 row <= end; ++row)
                rows_[row].push_back(side);
        }
    }
    bool holds(const Eigen::Vector2f& pixel) const
    {
        if (!(pixel.y() >= 0))
            return false;
        const Eigen::Vector2d x = pixel.cast<double>();
        const auto row = std::min(static_cast<std::size_t>(x.y()), rows_.size() - 1);
        bool inside = false;
        for (const auto& [a, b] : rows_[row])
        {
            // Half open, so that a corner counts for one of its two sides.
            if ((a.y() > x.y()) == (b.y() > x.y()))
                continue;
            const double t = (x.y() - a.y()) / (b.y() - a.y());
            inside ^= x.x() < a.x() + t * (b.x() - a.x());
        }
        return inside;
    }

private:
    struct Side
    {
        Eigen::Vector2d a, b;
    };
    std::vector<std::vector<Side>> rows_;
};

std::vector<std::uint32_t> marked(const std::vector<std::uint8_t>& marks,
                                  const ShapeLayout& layout)
{
    std::vector<std::uint32_t> samples;
    for (std::size_t place = 0; place < marks.size(); ++place)
        if (marks[place])
            samples.push_back(layout.order[place]);
    return samples;
}

} // namespace

SelectGesture::SelectGesture(const Options& options, const Camera& camera,
                             const ShownShape& shape, const Eigen::Vector2d& pixel)
    : options_(options), camera_(camera), path_({pixel})
{
    chosen_ = Selection(shape.positions.size() / 3);
    if (options.kind != Kind::Brush || !shape.layout)
        return;
    layout_ = shape.layout;
    pixels_ = projected(shape, camera);
    collected_ = chosen_;
}

void SelectGesture::move_to(const Eigen::Vector2d& pixel)
{
    if (!pixel.allFinite())
        return;
    if (options_.kind == Kind::Box)
        path_.resize(1);
    else if ((pixel - path_.back()).norm() <
             (options_.kind == Kind::Lasso ? kLassoStep : 1e-9))
        return;
    path_.push_back(pixel);
}

std::vector<Eigen::Vector2d> SelectGesture::outline() const
{
    const Eigen::Vector2d& last = path_.back();
    std::vector<Eigen::Vector2d> line;
    switch (options_.kind)
    {
    case Kind::Box:
        return {path_[0], {last.x(), path_[0].y()}, last, {path_[0].x(), last.y()}};
    case Kind::Lasso:
        return path_;
    case Kind::Brush:
        for (int i = 0; i < kBrushSides; ++i)
        {
            const double angle = 2.0 * std::numbers::pi * i / kBrushSides;
            line.push_back(last + options_.radius *
                                      Eigen::Vector2d(std::cos(angle), std::sin(angle)));
        }
    }
    return line;
}

/// Marks what lies within the radius of the way since the last call.
void SelectGesture::mark_stroke(std::vector<std::uint8_t>& marks)
{
    if (painted_ == path_.size())
        return;
    struct Stroke
    {
        Eigen::Vector2f from, way;
        float per_length;
    };
    std::vector<Stroke> strokes;
    Eigen::Vector2f low = path_.back().cast<float>(), high = low;
    for (std::size_t i = std::max<std::size_t>(painted_, 1) - 1; i < path_.size(); ++i)
    {
        const Eigen::Vector2f a = path_[i].cast<float>();
        const Eigen::Vector2f way =
            path_[std::min(i + 1, path_.size() - 1)].cast<float>() - a;
        strokes.push_back({a, way, 1.0f / std::max(way.squaredNorm(), 1e-12f)});
        low = low.cwiseMin(a);
        high = high.cwiseMax(a);
    }
    const float radius = static_cast<float>(options_.radius);
    low.array() -= radius;
    high.array() += radius;
    mark(pixels_, marks,
         [&](const Eigen::Vector2f& x)
         {
             if (!is_between(x, low, high))
                 return false;
             for (const Stroke& stroke : strokes)
             {
                 const float t = std::clamp(
                     stroke.way.dot(x - stroke.from) * stroke.per_length, 0.0f, 1.0f);
                 if ((stroke.from + t * stroke.way - x).squaredNorm() <= radius * radius)
                     return true;
             }
             return false;
         });
    painted_ = path_.size();
}

void SelectGesture::collect(const ShownShape& shape)
{
    if (options_.kind == Kind::Brush)
    {
        if (!layout_)
            return;
        std::vector<std::uint8_t> marks(pixels_.size());
        mark_stroke(marks);
        for (const std::uint32_t sample : marked(marks, *layout_))
            if (!collected_.holds(sample))
            {
                collected_.add(sample);
                open_.push_back(sample);
            }
        return;
    }
    chosen_ = Selection(shape.positions.size() / 3);
    num_hidden_ = 0;
    open_.clear();
    if (!shape.layout)
        return;
    const std::vector<Eigen::Vector2f> pixels = projected(shape, camera_);
    std::vector<std::uint8_t> marks(pixels.size());
    if (options_.kind == Kind::Box)
    {
        const Eigen::Vector2f a = path_[0].cast<float>(), b = path_.back().cast<float>();
        const Eigen::Vector2f low = a.cwiseMin(b), high = a.cwiseMax(b);
        mark(pixels, marks,
             [&](const Eigen::Vector2f& x) { return is_between(x, low, high); });
    }
    else
    {
        const Lasso lasso(path_, camera_.height());
        mark(pixels, marks, [&](const Eigen::Vector2f& x) { return lasso.holds(x); });
    }
    open_ = marked(marks, *shape.layout);
}

bool SelectGesture::look(const Picker& picker, std::size_t at_most)
{
    const std::size_t count =
        options_.is_through ? open_.size() : std::min(at_most, open_.size());
    const std::span<const std::uint32_t> samples(
        open_.end() - static_cast<std::ptrdiff_t>(count), open_.end());
    std::vector<std::uint8_t> seen(count, 1);
    if (!options_.is_through)
        seen = picker.visible(samples, camera_);
    for (std::size_t i = 0; i < count; ++i)
        if (seen[i])
            chosen_.add(samples[i]);
        else
            ++num_hidden_;
    open_.resize(open_.size() - count);
    return open_.empty();
}

} // namespace cellwarp::core
