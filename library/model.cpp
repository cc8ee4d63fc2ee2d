// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/model.h>

#include <algorithm>
#include <numeric>

#include "io/base/error.h"
#include "io/formats/geometry_file.h"
#include "library/access.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/session/limbs.h"
#include "library/session/memory_limit.h"
#include "library/session/work_frame.h"
#include "library/views.h"

namespace cellwarp
{

namespace
{

void check_count(const char* name, std::size_t count, std::size_t needed,
                 const char* each)
{
    if (count != 0 && count != needed)
        throw wrong_argument(name, "got " + std::to_string(count) +
                                       ", need one for each of " +
                                       std::to_string(needed) + " " + each);
}

/// 0, 1, 2, ...: each vector belongs to the sample of its number.
std::vector<std::uint32_t> counted(std::size_t count)
{
    std::vector<std::uint32_t> numbers(count);
    std::iota(numbers.begin(), numbers.end(), 0u);
    return numbers;
}

void read_normals(const ShapeView& shape, core::Geometry& geometry)
{
    if (!shape.normals.empty() && !shape.corner_normals.empty())
        throw wrong_argument("normals", "there are corner_normals as well");
    check_count("normals", shape.normals.count, geometry.samples.size(), "samples");
    check_count("corner_normals", shape.corner_normals.count, geometry.corners.size(),
                "corners");
    if (!shape.normals.empty())
    {
        geometry.directions = vectors_of<3>(shape.normals, "normals");
        geometry.direction_samples = counted(geometry.directions.size());
    }
    else if (!shape.corner_normals.empty())
    {
        geometry.directions = vectors_of<3>(shape.corner_normals, "corner_normals");
        geometry.corner_directions = counted(geometry.directions.size());
    }
}

void read_groups(const ShapeView& shape, core::Geometry& geometry)
{
    for (std::size_t g = 0; g < shape.groups.size(); ++g)
    {
        const ShapeView::Group& group = shape.groups[g];
        if (group.first_face > group.end_face || group.end_face > geometry.num_faces())
            throw core::malformed({"", 0, "groups[" + std::to_string(g) + "]"},
                                  "got faces " + std::to_string(group.first_face) +
                                      " to " + std::to_string(group.end_face) +
                                      ", there are " +
                                      std::to_string(geometry.num_faces()));
        geometry.groups.push_back({group.name, group.first_face, group.end_face});
    }
}

core::Geometry geometry_of(const ShapeView& shape)
{
    core::Geometry geometry;
    geometry.samples = vectors_of<3>(shape.samples, "samples");
    FaceLists faces = faces_of(shape.faces);
    geometry.corners = std::move(faces.corners);
    geometry.face_ends.reserve(faces.ends.size());
    geometry.face_ends.append(faces.ends.begin(), faces.ends.end());
    geometry.lines.assign(shape.lines.begin(), shape.lines.end());
    read_normals(shape, geometry);
    const std::size_t count = geometry.samples.size();
    check_count("tangents", shape.tangents.count, count, "samples");
    geometry.tangents = vectors_of<3>(shape.tangents, "tangents");
    geometry.tangent_samples = counted(geometry.tangents.size());
    check_count("rotations", shape.rotations.count, count, "samples");
    geometry.rotations = vectors_of<4>(shape.rotations, "rotations");
    geometry.rotation_samples = counted(geometry.rotations.size());
    read_groups(shape, geometry);
    check_geometry(geometry);
    return geometry;
}

} // namespace

Model::Model(std::shared_ptr<const Data> data) : data_(std::move(data)) {}

Model::Model(const ShapeView& shape)
    : data_(run_call(
          [&]
          {
              auto file = std::make_shared<core::GeometryFile>();
              file->geometry = geometry_of(shape);
              return std::make_shared<const Data>(Data{std::move(file)});
          }))
{
}

Model Model::read(const std::string& path, const ReadSettings& settings,
                  const Control& control)
{
    return run_call(control, 0,
                    [&](Watcher& watcher)
                    {
                        watcher.begin("read", 0.0);
                        const double limit = memory_limit(settings.max_memory);
                        core::check_memory_of_file(path, limit);
                        return Model(std::make_shared<const Data>(
                            Data{std::make_shared<const core::GeometryFile>(
                                core::read_geometry(path, {settings.columns}))}));
                    });
}

std::size_t Model::num_samples() const
{
    return Access::geometry(*this).samples.size();
}

std::size_t Model::num_faces() const
{
    return Access::geometry(*this).num_faces();
}

std::span<const double> Model::samples() const
{
    return numbers_of(Access::geometry(*this).samples);
}

std::span<const std::uint32_t> Model::corners() const
{
    return Access::geometry(*this).corners;
}

std::vector<std::uint64_t> Model::face_ends() const
{
    const core::Geometry& geometry = Access::geometry(*this);
    std::vector<std::uint64_t> ends(geometry.num_faces());
    for (std::size_t f = 0; f < ends.size(); ++f)
        ends[f] = geometry.face_ends[f];
    return ends;
}

std::size_t Model::num_normals() const
{
    return direction_uses(Access::geometry(*this)).size();
}

Box Model::box() const
{
    const core::ModelBox box = core::bounding_box(Access::geometry(*this).samples);
    return {from_eigen(box.low), from_eigen(box.high)};
}

double Model::diagonal() const
{
    return core::bounding_box(Access::geometry(*this).samples).size().norm();
}

std::string Model::path() const
{
    return data_->file->path;
}

const std::vector<std::string>& Model::warnings() const
{
    return Access::geometry(*this).warnings;
}

std::vector<Box> extremities_of(const Model& model, std::size_t most,
                                const Control& control)
{
    return run_call(
        control, 0,
        [&](Watcher& watcher)
        {
            watcher.begin("cells", 0.0);
            const core::Geometry& geometry = Access::geometry(model);
            std::vector<core::LimbEnd> ends =
                limb_ends(core::limbs_of(model.path(), geometry), geometry);
            std::stable_sort(ends.begin(), ends.end(),
                             [](const core::LimbEnd& a, const core::LimbEnd& b)
                             { return a.num_samples > b.num_samples; });
            std::vector<Box> boxes;
            for (const core::LimbEnd& end : ends)
                if (boxes.size() < most)
                    boxes.push_back(
                        {from_eigen(end.box.min()), from_eigen(end.box.max())});
            return boxes;
        });
}

} // namespace cellwarp
