// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/edit.h>

#include <algorithm>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/scene/scene_file.h"
#include "library/access.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/session/scene_script.h"

namespace cellwarp
{

namespace
{

using Ranges = std::vector<std::pair<std::int64_t, std::int64_t>>;

void add_to(Ranges& ranges, std::int64_t index)
{
    if (!ranges.empty() && ranges.back().second + 1 >= index && index >= 0)
        ranges.back().second = std::max(ranges.back().second, index);
    else
        ranges.emplace_back(index, index);
}

template <class Index>
core::Selector listed(std::span<const Index> samples)
{
    core::Selector selector;
    selector.kind = core::Selector::Kind::Indices;
    if (std::is_sorted(samples.begin(), samples.end()))
        for (const Index index : samples)
            add_to(selector.ranges, static_cast<std::int64_t>(index));
    else
    {
        std::vector<Index> sorted(samples.begin(), samples.end());
        std::sort(sorted.begin(), sorted.end());
        for (const Index index : sorted)
            add_to(selector.ranges, static_cast<std::int64_t>(index));
    }
    return selector;
}

core::Selector numbered(core::Selector::Kind kind, std::vector<double> numbers)
{
    core::Selector selector;
    selector.kind = kind;
    selector.numbers = std::move(numbers);
    return selector;
}

core::Operation to_core(const Operation& operation)
{
    using Kind = core::Operation::Kind;
    core::Operation out;
    out.move.degrees = operation.degrees;
    switch (operation.kind)
    {
    case Operation::Kind::Translate:
        out.kind = Kind::Translate;
        out.move.translation = to_eigen(operation.vector);
        return out;
    case Operation::Kind::Rotate:
        out.kind = Kind::Rotate;
        out.move.axis = to_eigen(operation.vector);
        if (operation.about == Operation::About::Point)
            out.move.pivot = to_eigen(operation.point);
        out.is_about_border = operation.about == Operation::About::Border;
        return out;
    case Operation::Kind::Matrix:
        out.kind = Kind::Matrix;
        out.matrix = std::make_shared<const Eigen::Matrix4d>(to_eigen(operation.matrix));
        return out;
    case Operation::Kind::To:
        out.kind = Kind::To;
        out.vector = to_eigen(operation.vector);
        return out;
    case Operation::Kind::Turn:
        out.kind = Kind::Turn;
        return out;
    case Operation::Kind::Tangent:
        out.kind = Kind::Tangent;
        out.vector = to_eigen(operation.vector);
        return out;
    }
    throw wrong_argument("operation", "its kind is not known");
}

core::MovePlace to_core(SplinePoint point)
{
    using Kind = core::MovePlace::Kind;
    switch (point)
    {
    case kWhole:
        return {Kind::Whole};
    case kStart:
        return {Kind::Start};
    case kEnd:
        return {Kind::End};
    default:
        return {Kind::Point, point};
    }
}

core::Move move_of(const std::string& region, SplinePoint point,
                   std::span<const Operation> operations)
{
    core::Move move;
    move.region = region;
    move.place = to_core(point);
    for (const Operation& operation : operations)
        move.operations.push_back(to_core(operation));
    return move;
}

core::RegionStatement region_of(core::Role role, const std::string& name,
                                const Selector& where, double factor = 1.0)
{
    return {role, name, Access::selector(where), factor};
}

core::RegionStatement region_of(core::Role role, const std::string& name,
                                const SplineLine& line)
{
    using Form = core::SplineStatement::Form;
    core::SplineStatement spline;
    spline.form = line.form == SplineLine::Form::Through   ? Form::Through
                  : line.form == SplineLine::Form::Control ? Form::Points
                                                           : Form::Skeleton;
    for (const Vec3& point : line.points)
        spline.points.push_back(to_eigen(point));
    spline.near = line.near;
    spline.is_closed = line.is_closed;
    spline.spans = line.spans;
    if (line.radius)
        spline.radii = {*line.radius};
    spline.stiffness = line.stiffness;
    spline.is_exact = line.is_exact;
    core::RegionStatement region;
    region.role = role;
    region.name = name;
    region.selector.kind = core::Selector::Kind::Spline;
    region.spline = std::make_shared<const core::SplineStatement>(std::move(spline));
    return region;
}

} // namespace

Selector::Selector(Data data) : data_(std::make_unique<Data>(std::move(data))) {}
Selector::Selector(const Selector& other) : Selector(Data(*other.data_)) {}
Selector& Selector::operator=(const Selector& other)
{
    data_ = std::make_unique<Data>(*other.data_);
    return *this;
}
Selector::Selector(Selector&&) noexcept = default;
Selector& Selector::operator=(Selector&&) noexcept = default;
Selector::~Selector() = default;

Selector Selector::box(Vec3 low, Vec3 high)
{
    return Selector(Data{numbered(core::Selector::Kind::Box,
                                  {low[0], low[1], low[2], high[0], high[1], high[2]})});
}

Selector Selector::sphere(Vec3 centre, double radius)
{
    return Selector(Data{numbered(core::Selector::Kind::Sphere,
                                  {centre[0], centre[1], centre[2], radius})});
}

Selector Selector::capsule(Vec3 from, Vec3 to, double radius)
{
    return Selector(
        Data{numbered(core::Selector::Kind::Capsule,
                      {from[0], from[1], from[2], to[0], to[1], to[2], radius})});
}

Selector Selector::halfspace(Vec3 normal, double offset)
{
    return Selector(Data{numbered(core::Selector::Kind::Halfspace,
                                  {normal[0], normal[1], normal[2], offset})});
}

Selector Selector::indices(std::span<const std::uint32_t> samples)
{
    return Selector(Data{listed(samples)});
}

Selector Selector::indices(std::span<const std::int64_t> samples)
{
    return Selector(Data{listed(samples)});
}

Selector Selector::mask(std::span<const std::uint8_t> samples)
{
    core::Selector selector;
    selector.kind = core::Selector::Kind::Indices;
    for (std::size_t i = 0; i < samples.size(); ++i)
        if (samples[i] != 0)
            add_to(selector.ranges, static_cast<std::int64_t>(i));
    return Selector(Data{std::move(selector)});
}

Selector Selector::group(std::string name)
{
    core::Selector selector;
    selector.kind = core::Selector::Kind::Group;
    selector.name = std::move(name);
    return Selector(Data{std::move(selector)});
}

Selector Selector::labels(std::string file, std::int64_t value)
{
    core::Selector selector;
    selector.kind = core::Selector::Kind::Labels;
    selector.name = std::move(file);
    selector.label = value;
    return Selector(Data{std::move(selector)});
}

Selector Selector::all()
{
    return Selector(Data{});
}

Operation translate(Vec3 by)
{
    return {Operation::Kind::Translate, by};
}

Operation rotate(Vec3 axis, double degrees)
{
    return {Operation::Kind::Rotate, axis, degrees};
}

Operation rotate_about(Vec3 axis, double degrees, Vec3 point)
{
    return {Operation::Kind::Rotate, axis, degrees, Operation::About::Point, point};
}

Operation rotate_about_border(Vec3 axis, double degrees)
{
    return {Operation::Kind::Rotate, axis, degrees, Operation::About::Border};
}

Operation matrix(const Mat4& rigid)
{
    Operation operation;
    operation.kind = Operation::Kind::Matrix;
    operation.matrix = rigid;
    return operation;
}

Operation to(Vec3 place)
{
    return {Operation::Kind::To, place};
}

Edit::Edit(Data data) : data_(std::make_unique<Data>(std::move(data))) {}
Edit::Edit() : Edit(Data{}) {}
Edit::Edit(const Edit& other) : Edit(Data(*other.data_)) {}
Edit& Edit::operator=(const Edit& other)
{
    data_ = std::make_unique<Data>(*other.data_);
    return *this;
}
Edit::Edit(Edit&&) noexcept = default;
Edit& Edit::operator=(Edit&&) noexcept = default;
Edit::~Edit() = default;

Edit Edit::read(const std::string& path)
{
    return run_call(
        [&] { return Edit(Data{core::HandleBuilder(path, core::read_file(path))}); });
}

Edit Edit::parse(std::string_view text)
{
    return run_call([&] { return Edit(Data{core::HandleBuilder("", text)}); });
}

Edit Edit::read_scene(const std::string& path, std::vector<std::string>* warnings)
{
    return run_call(
        [&]
        {
            const core::SceneFile scene = core::read_scene(path);
            std::vector<std::string> found = scene.warnings;
            found.insert(found.end(), scene.left_out.begin(), scene.left_out.end());
            std::optional<core::HandleFile> script =
                core::script_of(scene, scene.handles, found);
            if (warnings)
                warnings->insert(warnings->end(), found.begin(), found.end());
            return Edit(Data{script ? core::HandleBuilder(std::move(*script))
                                    : core::HandleBuilder()});
        });
}

Edit Edit::read_survey_pair(const std::string& sel, const std::string& def)
{
    return run_call(
        [&]
        { return Edit(Data{core::HandleBuilder(core::read_survey_pair(sel, def))}); });
}

std::string Edit::text() const
{
    return run_call([&] { return handle_text(data_->builder.file()); });
}

Edit& Edit::use_relative_units()
{
    run_call([&] { data_->builder.use_relative_units(); });
    return *this;
}

Edit& Edit::fixed(const std::string& name, const Selector& where)
{
    run_call([&] { data_->builder.add(region_of(core::Role::Fixed, name, where)); });
    return *this;
}

Edit& Edit::handle(const std::string& name, const Selector& where)
{
    run_call([&] { data_->builder.add(region_of(core::Role::Handle, name, where)); });
    return *this;
}

Edit& Edit::pin(const std::string& name, const Selector& where)
{
    run_call([&] { data_->builder.add(region_of(core::Role::Pin, name, where)); });
    return *this;
}

Edit& Edit::stiff(const std::string& name, const Selector& where, double factor)
{
    run_call([&]
             { data_->builder.add(region_of(core::Role::Stiff, name, where, factor)); });
    return *this;
}

Edit& Edit::rod(const std::string& name, const SplineLine& line)
{
    run_call([&] { data_->builder.add(region_of(core::Role::Rod, name, line)); });
    return *this;
}

Edit& Edit::curve(const std::string& name, const SplineLine& line)
{
    run_call([&] { data_->builder.add(region_of(core::Role::Curve, name, line)); });
    return *this;
}

Edit& Edit::on(const std::string& pin, const std::string& guide, std::optional<double> at)
{
    run_call([&] { data_->builder.add(core::OnStatement{pin, guide, at, 0}); });
    return *this;
}

Edit& Edit::skeleton(std::span<const Joint> joints)
{
    run_call(
        [&]
        {
            core::HandleBuilder with_joints = data_->builder;
            for (const Joint& joint : joints)
                with_joints.add(to_core(joint));
            data_->builder = std::move(with_joints);
        });
    return *this;
}

Edit& Edit::frame(std::int64_t number)
{
    run_call([&] { data_->builder.add(core::FrameStatement{number, {}, 0}); });
    return *this;
}

Edit& Edit::move(const std::string& region, std::span<const Operation> operations)
{
    return move(region, kWhole, operations);
}

Edit& Edit::move(const std::string& region, std::initializer_list<Operation> operations)
{
    return move(region, kWhole, operations);
}

Edit& Edit::move(const std::string& rod, SplinePoint point,
                 std::span<const Operation> operations)
{
    run_call([&] { data_->builder.add(move_of(rod, point, operations)); });
    return *this;
}

Edit& Edit::move(const std::string& rod, SplinePoint point,
                 std::initializer_list<Operation> operations)
{
    return move(rod, point, std::span(operations.begin(), operations.size()));
}

Edit& Edit::release(const std::string& rod, SplinePoint point, Holds released)
{
    run_call(
        [&]
        {
            core::Move move;
            move.region = rod;
            move.place = to_core(point);
            move.released =
                core::HoldParts{released.place, released.tangent, released.twist};
            data_->builder.add(move);
        });
    return *this;
}

Edit& Edit::pose(const std::string& joint, std::span<const Operation> operations,
                 const std::string& from)
{
    run_call(
        [&]
        {
            core::Move move = move_of(joint, kWhole, operations);
            move.chain = from;
            data_->builder.add(move);
        });
    return *this;
}

Edit& Edit::commit()
{
    run_call([&] { data_->builder.commit(); });
    return *this;
}

std::size_t Edit::num_frames() const
{
    std::size_t count = 0;
    for (const core::Stage& stage : data_->builder.file().stages)
        count += stage.frames.size();
    return count;
}

std::vector<std::string> Edit::regions() const
{
    std::vector<std::string> names;
    for (const core::RegionStatement& region :
         data_->builder.file().stages.back().regions)
        if (std::find(names.begin(), names.end(), region.name) == names.end())
            names.push_back(region.name);
    return names;
}

} // namespace cellwarp
