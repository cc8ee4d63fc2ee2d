// SPDX-License-Identifier: GPL-3.0-or-later
// Along a line through the material a field moves by no more than the poses around
// explain: it has no jumps. Every line is walked in small steps.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "library/session/session.h"
#include "octree/base/index.h"
#include "tests/support/bodies.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::Built;
using support::random_number;
using support::random_vector;

namespace
{

struct Place
{
    Eigen::Vector3d x;
    int own = -1;
};

/// Where material is, and in what cells.
struct Ground
{
    const VoxelGrid& grid;
    const Pieces& pieces;
    const Cells& cells;

    explicit Ground(const Built& built)
        : grid(built.material.grid), pieces(built.pieces), cells(built.cells)
    {
    }
    explicit Ground(const Body& body)
        : grid(body.rest->material.grid), pieces(body.pieces), cells(body.cells)
    {
    }
    /// -1: no material.
    int own(const Eigen::Vector3d& x) const { return pieces.at(grid, grid.locate(x)); }
    bool is_in_its_box(const Place& place) const
    {
        const Cell& c = cells.cells[idx(place.own)];
        return nearest_in_box(c.box_centre, c.edge, place.x) == place.x;
    }
    /// Whether the material goes on from one place to the next. A crumb goes on in the
    /// cell that it follows, whose box does not hold it, and in no other one.
    bool goes_on(const Place& a, const Place& b) const
    {
        const auto near = cells.neighbours_of(a.own);
        return a.own == b.own ||
               (is_in_its_box(a) && is_in_its_box(b) &&
                std::find(near.begin(), near.end(), b.own) != near.end());
    }
};

/// Steps of a line; of those in the material without a break from one to the next.
std::vector<std::vector<Place>> runs_of(const Ground& ground, const Eigen::Vector3d& a,
                                        const Eigen::Vector3d& b, int num_steps)
{
    std::vector<std::vector<Place>> runs(1);
    for (int i = 0; i <= num_steps; ++i)
    {
        const Eigen::Vector3d x = a + (b - a) * i / num_steps;
        const int own = ground.own(x);
        const bool goes_on = own >= 0 && !runs.back().empty() &&
                             ground.goes_on(runs.back().back(), {x, own});
        if (!goes_on && !runs.back().empty())
            runs.emplace_back();
        if (own >= 0)
            runs.back().push_back({x, own});
    }
    if (runs.back().empty())
        runs.pop_back();
    return runs;
}

/// By how much the poses around a place explain that a field changes there.
struct Change
{
    double slope = 0.0;
    double edge = INFINITY; ///< of the smallest cell around
};

/// Of the poses of the cells that count at a place, and of \p rings around these.
class PosesAround
{
public:
    PosesAround(const Cells& cells, std::span<const Pose> poses, std::size_t rings)
        : cells_(cells), poses_(poses), closest_(cells), rings_(rings)
    {
        for (const Pose& pose : poses)
            largest_turn_ = std::max(largest_turn_, turn(pose));
    }
    /// How the cells turn, and how far they carry the place from each other over their
    /// edge. Where both are nothing there is still rounding.
    Change at(const Place& place)
    {
        closest_.influences(place.x, place.own, found_);
        std::vector<int> near;
        for (const Influence& influence : found_)
            near.push_back(influence.cell);
        for (std::size_t begin = 0, ring = 0; ring < rings_; ++ring)
            for (const std::size_t end = near.size(); begin < end; ++begin)
                for (const int other : cells_.neighbours_of(near[begin]))
                    if (std::find(near.begin(), near.end(), other) == near.end())
                        near.push_back(other);
        Change change;
        double turned = 0.01 * largest_turn_, apart = 0.0;
        std::vector<Eigen::Vector3d> moved;
        for (const int cell : near)
        {
            const std::size_t c = idx(cell);
            moved.push_back(displacement(poses_[c], cells_.cells[c].centre, place.x));
            turned = std::max(turned, turn(poses_[c]));
            change.edge = std::min(change.edge, cells_.cells[c].edge);
            for (const Eigen::Vector3d& other : moved)
                apart = std::max(apart, (other - moved.back()).norm());
        }
        change.slope = turned + apart / change.edge;
        return change;
    }

private:
    static double turn(const Pose& pose)
    {
        return (pose.R - Eigen::Matrix3d::Identity()).norm();
    }

    const Cells& cells_;
    std::span<const Pose> poses_;
    ClosestCells closest_;
    std::size_t rings_;
    double largest_turn_ = 0.0;
    std::vector<Influence> found_;
};

/// The most that a field changes from one place to the next.
struct Most
{
    std::size_t num_steps = 0;
    double jump = 0.0;  ///< [work unit]
    double slope = 0.0; ///< [what the poses explain]
    double bend = 0.0;  ///< change of the slope over an edge [what the poses explain]
    Eigen::Vector3d slope_at = Eigen::Vector3d::Zero(), bend_at = Eigen::Vector3d::Zero();

    void add(const Field& field, PosesAround& poses, const std::vector<Place>& run)
    {
        std::vector<Eigen::Vector3d> points;
        std::vector<int> own;
        for (const Place& place : run)
        {
            points.push_back(place.x);
            own.push_back(place.own);
        }
        const std::vector<Eigen::Vector3d> d = field.displacements(points, own);
        Change b = poses.at(run.front());
        for (std::size_t i = 1; i < run.size(); ++i)
        {
            const double length = (points[i] - points[i - 1]).norm();
            const Change a = b;
            b = poses.at(run[i]);
            const double explained = length * std::max(a.slope, b.slope);
            const double step = (d[i] - d[i - 1]).norm();
            ++num_steps;
            jump = std::max(jump, step);
            if (step > slope * explained)
            {
                slope = step / explained;
                slope_at = points[i];
            }
            if (i + 1 == run.size())
                continue;
            const double bent = (d[i + 1] - 2.0 * d[i] + d[i - 1]).norm() *
                                std::min(a.edge, b.edge) / length;
            if (bent > bend * explained)
            {
                bend = bent / explained;
                bend_at = points[i];
            }
        }
    }
};

/// Rings of cells around those that count on which a field depends: an RBF asks those of
/// its clusters.
std::size_t rings_of(FieldKind kind)
{
    return kind == FieldKind::Rbf ? 2 : 0;
}

Most most_along(const Field& field, const Ground& ground, std::span<const Pose> poses,
                const Eigen::Vector3d& a, const Eigen::Vector3d& b, int num_steps)
{
    PosesAround around(ground.cells, poses, rings_of(field.kind()));
    Most most;
    for (const std::vector<Place>& run : runs_of(ground, a, b, num_steps))
        most.add(field, around, run);
    return most;
}

/// Every cell by itself: what no solver would give.
std::vector<Pose> random_poses(const Cells& cells, unsigned seed)
{
    std::mt19937 rng(seed);
    std::vector<Pose> poses;
    for (const Cell& cell : cells.cells)
        poses.push_back({rotation_about(random_vector(rng, 1.0).normalized(), 0.3),
                         cell.centre + random_vector(rng, 0.3 * cell.edge)});
    return poses;
}

/// The low end of the comb held, the tip of the upper finger moved up.
Session pulled_comb(FieldKind kind, int across, double by)
{
    SessionSettings settings;
    settings.cells.across = across;
    settings.field = kind;
    Session session(
        scan_geometry("comb.obj", support::obj_text(support::comb())).geometry,
        parse_handles("comb.handles", "cellwarp-handles 1\n"
                                      "fixed foot box -1 -1 -1 1 2 2\n"
                                      "handle tip box 3.5 0.5 -1 5 2 2\n"
                                      "frame 1\n"
                                      "move tip translate 0 " +
                                          std::to_string(by) + " 0\n"),
        settings);
    session.next_frame(true);
    return session;
}

/// \p along(n): in n steps of a line. No jump.
template <class Along>
void expect_continuous(Along&& along, int num_steps)
{
    const Most most = along(num_steps), finer = along(10 * num_steps);
    // Weights fall over a fraction of an edge: they may make the slope a few times as
    // large as all of the difference over a whole one. RBFs overshoot by more.
    EXPECT_LT(finer.slope, 20.0) << finer.slope_at.transpose();
    // A jump would be ten times as steep in these steps.
    EXPECT_LT(finer.slope, 2.0 * most.slope + 1.0) << finer.slope_at.transpose();
}

/// No kink either.
template <class Along>
void expect_smooth(Along&& along, int num_steps)
{
    expect_continuous(along, num_steps);
    Most most = along(num_steps), finer = along(10 * num_steps);
    // A kink would be ten times as sharp, a jump a hundred times. Where weights fall
    // within a step, the next finer ones have to show the bend as it is.
    if (!(finer.bend < 3.0 * most.bend + 10.0))
    {
        most = finer;
        finer = along(100 * num_steps);
    }
    EXPECT_LT(finer.bend, 3.0 * most.bend + 10.0) << finer.bend_at.transpose();
}

} // namespace

TEST(Continuity, of_a_comb_whose_fingers_share_a_leaf)
{
    for (const FieldKind kind : {FieldKind::Blend, FieldKind::Rbf})
        for (const int across : {4, 9})
            for (const double by : {1.0, 2.0})
            {
                SCOPED_TRACE(testing::Message()
                             << "field " << static_cast<int>(kind) << ", across "
                             << across << ", by " << by);
                const Session session = pulled_comb(kind, across, by);
                const CellSystem& system = *session.system();
                const WorkFrame& frame = system.rest().frame;
                const Field without_regions = fit_field(
                    kind, system.body().cells, system.poses(), system.constraints(), {});
                for (const auto& [y, z] : {std::pair(0.2, 0.5), {0.8, 0.5}, {0.44, 0.1}})
                {
                    const auto along =
                        [&, y = y, z = z](const Field& field, int num_steps)
                    {
                        return most_along(field, Ground(system.body()), system.poses(),
                                          frame.to_work({0.01, y, z}),
                                          frame.to_work({3.99, y, z}), num_steps);
                    };
                    // As the user sees it: a tenth of the step, a tenth of the way.
                    EXPECT_LT(along(*session.field(), 10000).jump,
                              0.2 * along(*session.field(), 1000).jump);
                    expect_smooth([&](int num_steps)
                                  { return along(without_regions, num_steps); },
                                  1000);
                }
            }
}

TEST(Continuity, through_every_leaf)
{
    struct Shaped
    {
        const char* name;
        Shape shape;
        int across;
        double max_voxel;
    };
    Eigen::Matrix3d mirrored = Eigen::Matrix3d::Identity(), quarter;
    mirrored(0, 0) = -1;
    quarter << 0, -1, 0, 0, 0, 1, -1, 0, 0;
    for (const Shaped& body : {Shaped{"comb", support::comb(), 4, 0.02},
                               {"fine comb", support::comb(), 9, 0.02},
                               {"angle", support::angle(), 4, 0.0},
                               {"hand", support::hand(), 12, 0.02}})
        for (const Eigen::Matrix3d& Q :
             {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), mirrored, quarter})
            for (const int depth : {0, 2})
            {
                const Shape shape = support::turned(body.shape, Q);
                const Built built =
                    support::built_mixed(shape, body.across, depth, 1, body.max_voxel);
                const std::vector<Pose> poses = random_poses(built.cells, 2);
                const std::vector<Constraint> constraints(built.cells.size());
                for (const FieldKind kind : {FieldKind::Blend, FieldKind::Rbf})
                {
                    SCOPED_TRACE(testing::Message()
                                 << body.name << ", depth " << depth << ", field "
                                 << static_cast<int>(kind) << ", turned by\n"
                                 << Q);
                    const Field field =
                        fit_field(kind, built.cells, poses, constraints, {});
                    std::mt19937 rng(3);
                    std::size_t num_steps = 0;
                    for (int line = 0; line < 8; ++line)
                    {
                        const auto end = [&]
                        { return shape.samples[rng() % shape.samples.size()]; };
                        const Eigen::Vector3d a = end(), b = end();
                        const auto along = [&](int count)
                        { return most_along(field, Ground(built), poses, a, b, count); };
                        // Where the hand's fingers share leaves of three sizes, the
                        // slope of the blend has a few kinks left.
                        if (std::string(body.name) == "hand" && depth > 0)
                            expect_continuous(along, 500);
                        else
                            expect_smooth(along, 500);
                        num_steps += along(500).num_steps;
                    }
                    EXPECT_GT(num_steps, 1000u);
                }
            }
}

} // namespace cellwarp::core
