// SPDX-License-Identifier: GPL-3.0-or-later
#include <array>
#include <limits>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "io/base/error.h"
#include "library/time/drawn_shapes.h"
#include "library/time/key_motion.h"
#include "library/time/object_in_time.h"
#include "octree/base/index.h"
#include "solver/rods/spline_sheet.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

constexpr int kAlongSide = 25; ///< places of the surface
constexpr Colour kSheet = {120, 166, 110}, kSheetToo = {196, 214, 186};

/// Both sides of a sheet, or the six faces of a block, of points in a grid of \p places
/// along each side.
void add_sheet(const std::string& name, const std::vector<Vector3d>& points, int places,
               Geometry& out)
{
    const int across = places * places;
    const bool is_block = static_cast<int>(points.size()) > across;
    const int last = places - 1;
    out.groups.push_back({name, out.num_faces(), 0});
    // Each face by itself, with sharp edges: from a corner along two ways.
    const auto add_face = [&](int corner, int u, int v)
    {
        const auto first = static_cast<std::uint32_t>(out.samples.size());
        for (int j = 0; j < places; ++j)
            for (int i = 0; i < places; ++i)
            {
                out.samples.push_back(points[idx(corner + i * u + j * v)]);
                // Squares, so that stretch is seen.
                constexpr int kSquare = 4;
                out.colours.push_back((i / kSquare + j / kSquare) % 2 == 0 ? kSheet
                                                                           : kSheetToo);
            }
        const auto row = static_cast<std::uint32_t>(places);
        for (std::uint32_t j = 0; j + 1 < row; ++j)
            for (std::uint32_t i = 0; i + 1 < row; ++i)
            {
                const std::uint32_t a = first + j * row + i;
                out.corners.insert(out.corners.end(), {a, a + 1, a + row + 1, a + row});
                out.face_ends.push_back(out.corners.size());
            }
    };
    const std::array<int, 3> step = {1, places, across};
    if (!is_block)
    {
        add_face(0, step[0], step[1]);
        add_face(0, step[1], step[0]);
    }
    for (std::size_t a = 0; a < 3 && is_block; ++a)
    {
        const int u = step[(a + 1) % 3], v = step[(a + 2) % 3];
        add_face(0, v, u);
        add_face(last * step[a], u, v);
    }
    out.groups.back().end_face = out.num_faces();
}

std::unique_ptr<SplineSheet> sheet_of(const RodScene& scene, std::size_t k,
                                      const Vector3d& origin)
{
    const SheetStatement& of = scene.sheets[k];
    SheetShape shape{vector_of(of.corner) - origin,
                     {},
                     of.counts,
                     static_cast<int>(of.degree),
                     of.young,
                     of.thickness,
                     of.density};
    for (const Triple& side : of.sides)
        shape.sides.push_back(vector_of(side));
    const std::string where = fmt::format("sheets[{}]", k);
    std::unique_ptr<SplineSheet> sheet;
    try
    {
        sheet = std::make_unique<SplineSheet>(shape);
    }
    catch (const std::invalid_argument& error)
    {
        throw malformed({scene.path, 0, where + ".sides"}, error.what());
    }
    sheet->gravity = vector_of(scene.gravity);
    sheet->viscosity = of.viscosity;
    sheet->damping = of.damping;
    for (int c = 0; c < sheet->num_controls(); ++c)
        sheet->velocity.segment<3>(3 * c) = vector_of(of.velocity);
    for (const Triple& place : of.fixed)
        sheet->fix(place);
    constexpr double kNear = 0.01; // of the size
    for (std::size_t p = 0; p < of.over.size(); ++p)
    {
        const Vector3d point = vector_of(of.over[p]) - origin;
        sheet->slide_over(point);
        if ((sheet->at(sheet->sliding(p)) - point).norm() > kNear * sheet->size())
            throw malformed({scene.path, 0, fmt::format("{}.over[{}]", where, p)},
                            "the sheet is not there at the start");
    }
    return sheet;
}

class SheetInTime final : public ObjectInTime
{
public:
    SheetInTime(const RodScene& scene, std::size_t index, const Vector3d& origin)
        : statement_(scene.sheets[index]), origin_(origin),
          sheet_(sheet_of(scene, index, origin))
    {
    }

    JointEnd::Kind kind() const override { return JointEnd::Kind::Sheet; }
    std::string name() const override { return statement_.name; }
    ArticulableObject& articulable() override { return *sheet_; }
    Vector3d place_of(const JointEnd& end, const std::string&) const override
    {
        return sheet_->at(end.point);
    }
    int add_place(const JointEnd& end, const SlideStatement&, const std::string&,
                  const Vector3d&) override
    {
        return sheet_->add_place(end.point);
    }
    bool is_held() const override
    {
        return !statement_.fixed.empty() || !statement_.over.empty();
    }

    void add_to(SimulationReport& report) const override
    {
        report.kinetic += sheet_->kinetic();
        report.elastic += sheet_->elastic();
        report.gravity += sheet_->weight_energy();
        add_from_origin(sheet_->mass(), sheet_->momentum(), sheet_->angular_momentum(),
                        origin_, sheet_->gravity, report);
    }
    void add_to(int places, SimulatedObjects& out) const override
    {
        SimulatedSheet& one = out.sheets.emplace_back();
        one.name = name();
        one.points = points(places);
        for (std::size_t s = 0; s < sheet_->num_slides(); ++s)
        {
            const SheetPlace at = sheet_->sliding(s);
            const double nan = std::numeric_limits<double>::quiet_NaN();
            one.sliding.push_back(sheet_->has_left(s) ? Vector3d(nan, nan, nan)
                                                      : Vector3d(at[0], at[1], at[2]));
        }
    }
    void add_surface(int, Geometry& out) const override
    {
        add_sheet(name(), points(kAlongSide), kAlongSide, out);
    }
    void add_to(Eigen::AlignedBox3d& box) const override
    {
        for (const Vector3d& point : points(2))
            box.extend(point);
    }

private:
    std::vector<Vector3d> points(int places) const
    {
        std::vector<Vector3d> out;
        const int depth = sheet_->is_block() ? places : 1;
        for (int c = 0; c < depth; ++c)
            for (int b = 0; b < places; ++b)
                for (int a = 0; a < places; ++a)
                    out.push_back(
                        origin_ +
                        sheet_->at({double(a) / (places - 1), double(b) / (places - 1),
                                    depth > 1 ? double(c) / (places - 1) : 0.0}));
        return out;
    }

    const SheetStatement& statement_;
    const Vector3d origin_;
    std::unique_ptr<SplineSheet> sheet_;
};

} // namespace

std::unique_ptr<ObjectInTime> sheet_in_time(const RodScene& scene, std::size_t index,
                                            const Vector3d& origin)
{
    return std::make_unique<SheetInTime>(scene, index, origin);
}

} // namespace cellwarp::core
