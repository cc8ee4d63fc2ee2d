// SPDX-License-Identifier: GPL-3.0-or-later
// Trees in work space: it is made so that single precision is enough there. No ray may
// pass between two faces, as a sample right behind another's edge is the rule in models
// that people build.
#include "editor/tools/picker.h"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>
#include <cstring>
#include <future>
#include <utility>

#include <Eigen/LU>

#include "library/picture/ray_tree.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Up to so many faces or points a tree is waited for: a few milliseconds.
constexpr std::size_t kMostWaitedFor = 60'000;
/// Of a cloud's balls: points strewn at random leave holes in 2 % of their surface then.
constexpr double kBallRadius = 1.1; ///< [spacing]
/// Rays to the viewer begin so far from their sample: enough to leave the faces around
/// it, less than the thickness of anything [view].
constexpr double kOffset = 1e-5;
/// The balls around a ball reach into its sight [radius].
constexpr double kBallOffset = 3.0;
/// From how far a ray comes in parallel projection; the shape is about 1 large [view].
constexpr double kFar = 100.0;
constexpr std::size_t kRayGrain = 1024; ///< rays worth a thread

/// How far apart a cloud's points are, roughly, taking them for a surface's: from the
/// number of grid cubes that hold any, at several points to a cube.
double
spacing_of(const Eigen::Ref<const Eigen::Matrix3Xf, 0, Eigen::OuterStride<>>& points)
{
    const std::size_t count = idx(points.cols());
    const Eigen::Vector3f low = points.rowwise().minCoeff();
    const float longest = (points.rowwise().maxCoeff() - low).maxCoeff();
    if (!(longest > 0))
        return 1.0;
    for (int across = 256; across > 1; across /= 2)
    {
        const float per_length = static_cast<float>(across) / longest;
        const std::size_t row = idx(across) + 1;
        std::vector<bool> holds(row * row * row);
        std::size_t cubes = 0;
        for (std::size_t i = 0; i < count && 4 * cubes <= count; ++i)
        {
            const Eigen::Matrix<std::size_t, 3, 1> cube =
                ((points.col(static_cast<Eigen::Index>(i)) - low) * per_length)
                    .cast<std::size_t>();
            const std::size_t index = (cube.x() * row + cube.y()) * row + cube.z();
            cubes += !holds[index];
            holds[index] = true;
        }
        if (4 * cubes <= count)
            return std::sqrt(static_cast<double>(cubes) / static_cast<double>(count)) /
                   per_length;
    }
    return longest / std::cbrt(static_cast<double>(count));
}

/// A shape as rays meet it.
class Tree
{
public:
    /// commit() has to follow. Throws std::bad_alloc, as does commit().
    // A quick tree: rays are few. Fitting an old one to new positions would be faster
    // still, but it could not serve meanwhile.
    Tree(const RayDevice& device, const ShownShape& shape)
        : layout_(shape.layout), tree_(device, RayTree::Making::Quick),
          count_(shape.positions.size() / 3)
    {
        vertices_ = is_cloud() ? tree_.add_balls(count_)
                               : tree_.add_triangles(count_, layout_->triangles);
        place(shape);
    }

    void commit()
    {
        if (is_cloud() && radius_ == 0)
        {
            const Eigen::Map<const Eigen::Matrix3Xf, 0, Eigen::OuterStride<>> points(
                vertices_, 3, static_cast<Eigen::Index>(count_), Eigen::OuterStride<>(4));
            radius_ = kBallRadius * spacing_of(points);
            for (std::size_t i = 0; i < count_; ++i)
                vertices_[4 * i + 3] = static_cast<float>(radius_);
        }
        tree_.commit();
    }

    std::optional<Picked> pick(const Ray& ray) const
    {
        // The direction keeps its length in view space, and so does the distance.
        const std::optional<RayHit> hit =
            tree_.first_hit(to_work(ray.origin).cast<float>(),
                            (to_work_.block<3, 3>(0, 0) * ray.direction).cast<float>());
        if (!hit)
            return std::nullopt;
        const std::size_t face = hit->element;
        if (is_cloud())
            return Picked{layout_->order[face], at(face)};
        const std::uint32_t* const corners = layout_->triangles.data() + 3 * face;
        const double u = hit->u, v = hit->v;
        const Eigen::Vector3d x[3] = {at(corners[0]), at(corners[1]), at(corners[2])};
        const Eigen::Vector3d point = (1 - u - v) * x[0] + u * x[1] + v * x[2];
        std::size_t nearest = 0;
        for (std::size_t k = 1; k < 3; ++k)
            if ((x[k] - point).squaredNorm() < (x[nearest] - point).squaredNorm())
                nearest = k;
        return Picked{layout_->order[corners[nearest]], point};
    }

    bool is_visible(std::uint32_t sample, const Camera& camera) const
    {
        const Eigen::Vector3d x = at(layout_->place_of[sample]);
        const Eigen::Vector3d way = camera.is_perspective()
                                        ? Eigen::Vector3d(camera.eye() - x)
                                        : Eigen::Vector3d(-kFar * camera.forward());
        const double distance = way.norm(), offset = this->offset();
        if (!(distance > offset))
            return true;
        return !tree_.is_blocked(
            to_work(x + offset / distance * way).cast<float>(),
            (to_work_.block<3, 3>(0, 0) * (way / distance)).cast<float>(), 0.0f,
            static_cast<float>(distance - offset));
    }

private:
    bool is_cloud() const { return layout_->triangles.empty(); }
    std::size_t stride() const { return is_cloud() ? 4 : 3; }
    double offset() const
    {
        return is_cloud() ? kBallOffset * radius_ * scale_ : kOffset;
    }

    void place(const ShownShape& shape)
    {
        to_view_ = shape.to_view;
        to_work_ = shape.to_view.inverse();
        scale_ = shape.to_view.col(0).head<3>().norm();
        if (!is_cloud())
        {
            std::memcpy(vertices_, shape.positions.data(),
                        shape.positions.size() * sizeof(float));
            return;
        }
        for (std::size_t i = 0; i < count_; ++i)
        {
            std::copy_n(shape.positions.data() + 3 * i, 3, vertices_ + 4 * i);
            vertices_[4 * i + 3] = static_cast<float>(radius_);
        }
    }

    Eigen::Vector3d to_work(const Eigen::Vector3d& point) const
    {
        return (to_work_ * point.homogeneous()).head<3>();
    }
    /// A sample by its place [view].
    Eigen::Vector3d at(std::size_t place) const
    {
        const float* const x = vertices_ + stride() * place;
        return (to_view_ * Eigen::Vector4d(x[0], x[1], x[2], 1.0)).head<3>();
    }

    std::shared_ptr<const ShapeLayout> layout_;
    RayTree tree_;
    std::size_t count_;
    float* vertices_;     ///< as many as the layout has places; the tree's
    double radius_ = 0.0; ///< of a cloud's balls; 0: not yet known [work]
    Eigen::Matrix4d to_view_, to_work_;
    double scale_ = 1.0; ///< [view/work]
};

} // namespace

struct Picker::State
{
    RayDevice device;
    std::shared_ptr<Tree> tree;              ///< that serves
    std::future<std::shared_ptr<Tree>> next; ///< that is being made
    std::uint64_t version = 0;               ///< of the shape that was given last
    bool has_version = false;

    ~State()
    {
        if (next.valid())
            next.wait();
    }

    void take()
    {
        if (next.valid())
            tree = next.get();
    }

    void update(const ShownShape& shape);

    /// Does something that may throw; then no tree is left, as the old one may be of
    /// other samples.
    template <class Do>
    void attempt(Do&& what)
    {
        try
        {
            what();
        }
        catch (...)
        {
            tree.reset();
            throw;
        }
    }
};

Picker::Picker() : state_(std::make_unique<State>()) {}
Picker::~Picker() = default;

void Picker::State::update(const ShownShape& shape)
{
    if (next.valid())
    {
        if (next.wait_for(std::chrono::seconds(0)) == std::future_status::timeout)
            return;
        take();
    }
    if (!shape.layout || shape.positions.empty() ||
        (has_version && version == shape.version))
        return;
    assert(shape.layout->order.size() == shape.positions.size() / 3);
    version = shape.version;
    has_version = true;
    const auto commit = [made = std::make_shared<Tree>(device, shape)]
    {
        made->commit();
        return made;
    };
    // Each tree is made by a thread of its own, as one in which memory once ended hangs
    // in its next tree (RayDevice). Where none can begin, it is made by who waits.
    next = std::async(std::launch::async | std::launch::deferred, commit);
    if (std::max(shape.layout->triangles.size(), shape.positions.size()) / 3 <=
        kMostWaitedFor)
        take();
}

void Picker::update(const ShownShape& shape)
{
    state_->attempt([&] { state_->update(shape); });
}

void Picker::wait()
{
    state_->attempt([&] { state_->take(); });
}

bool Picker::is_ready() const
{
    return state_->tree != nullptr;
}

std::optional<Picked> Picker::pick(const Ray& ray) const
{
    return is_ready() ? state_->tree->pick(ray) : std::nullopt;
}

std::vector<std::uint8_t> Picker::visible(std::span<const std::uint32_t> samples,
                                          const Camera& camera) const
{
    std::vector<std::uint8_t> result(samples.size(), 1);
    if (is_ready())
        parallel_ranges(samples.size(), kRayGrain,
                        [&](std::size_t begin, std::size_t end)
                        {
                            for (std::size_t i = begin; i < end; ++i)
                                result[i] = state_->tree->is_visible(samples[i], camera);
                        });
    return result;
}

} // namespace cellwarp::core
