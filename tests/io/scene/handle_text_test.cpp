// SPDX-License-Identifier: GPL-3.0-or-later
// What handle files and scenes say is read back as it was, to the bit.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

const std::string kPath = "dir/h.handles";

/// Values, names and their order; lists of indices of one region in a row as one.
std::string meaning_of(const HandleFile& file)
{
    std::string bytes;
    const auto word = [&](const std::string& text)
    { bytes += std::to_string(text.size()) + ":" + text + ";"; };
    const auto value = [&](const auto& number)
    { bytes.append(reinterpret_cast<const char*>(&number), sizeof number); };
    const auto vector = [&](const Eigen::Vector3d& v)
    { bytes.append(reinterpret_cast<const char*>(v.data()), 24); };
    value(file.is_relative);
    for (const Stage& stage : file.stages)
    {
        word("stage");
        const RegionStatement* last = nullptr;
        for (const RegionStatement& region : stage.regions)
        {
            const Selector& selector = region.selector;
            if (!last || last->name != region.name ||
                last->selector.kind != Selector::Kind::Indices ||
                selector.kind != Selector::Kind::Indices)
            {
                word(role_name(region.role));
                word(region.name);
                value(region.factor);
                value(selector.kind);
                value(selector.label);
                word(selector.name);
            }
            last = &region;
            for (const double number : selector.numbers)
                value(number);
            for (const auto& [from, to] : selector.ranges)
            {
                value(from);
                value(to);
            }
            if (region.spline)
            {
                const SplineStatement& spline = *region.spline;
                value(spline.form);
                for (const Eigen::Vector3d& point : spline.points)
                    vector(point);
                word(spline.near);
                value(spline.is_closed);
                value(spline.spans);
                for (const double radius : spline.radii)
                    value(radius);
                value(spline.stiffness.value_or(0.0));
                value(spline.is_exact);
            }
        }
        for (const OnStatement& on : stage.ons)
        {
            word(on.pin);
            word(on.guide);
            value(on.at.value_or(-1.0));
        }
        for (const FrameStatement& frame : stage.frames)
        {
            value(frame.number);
            for (const Move& move : frame.moves)
            {
                word(move.region);
                value(move.place.kind);
                value(move.place.point);
                if (move.released)
                    value(*move.released);
                for (const Operation& operation : move.operations)
                {
                    value(operation.kind);
                    vector(operation.vector);
                    vector(operation.move.translation);
                    vector(operation.move.axis);
                    value(operation.move.degrees);
                    vector(operation.move.pivot.value_or(Eigen::Vector3d(0.1, 0.2, 0.3)));
                    if (operation.matrix)
                        for (const double entry : operation.matrix->reshaped())
                            value(entry);
                }
            }
        }
    }
    return bytes;
}

/// Any finite double, also the smallest and the largest.
double any_number(std::mt19937& rng)
{
    for (;;)
    {
        std::uint64_t bits = (std::uint64_t(rng()) << 32) ^ rng();
        switch (rng() % 4)
        {
        case 0:
            bits &= 0x800fffffffffffffu; // below the normal ones
            break;
        case 1:
            bits = bits % 2 << 63; // 0 and -0
            break;
        default:
            break;
        }
        double number = 0.0;
        std::memcpy(&number, &bits, sizeof number);
        if (std::isfinite(number))
            return number;
    }
}

Eigen::Vector3d any_vector(std::mt19937& rng)
{
    return {any_number(rng), any_number(rng), any_number(rng)};
}

Eigen::Vector3d any_direction(std::mt19937& rng)
{
    Eigen::Vector3d v = any_vector(rng);
    v[static_cast<int>(rng() % 3)] = 5e-324;
    return v;
}

std::string any_name(std::mt19937& rng)
{
    static const char* const pieces[] = {"a",  "arm",      " ", "#",      "\t",   "3.5",
                                         "\\", "\xc3\xa4", "'", "<html>", "\x01", "all"};
    std::string name;
    for (std::size_t count = rng() % 4; count > 0; --count)
        name += pieces[rng() % std::size(pieces)];
    return name;
}

Selector any_selector(std::mt19937& rng)
{
    Selector selector;
    selector.kind = static_cast<Selector::Kind>(rng() % 8);
    std::vector<double>& numbers = selector.numbers;
    const auto add = [&](int count)
    {
        for (; count > 0; --count)
            numbers.push_back(any_number(rng));
    };
    switch (selector.kind)
    {
    case Selector::Kind::Box:
        add(6);
        for (std::size_t k = 0; k < 3; ++k)
            if (numbers[k] > numbers[k + 3])
                std::swap(numbers[k], numbers[k + 3]);
        break;
    case Selector::Kind::Sphere:
    case Selector::Kind::Capsule:
        add(selector.kind == Selector::Kind::Sphere ? 4 : 7);
        numbers.back() = std::abs(numbers.back());
        break;
    case Selector::Kind::Halfspace:
    {
        const Eigen::Vector3d normal = any_direction(rng);
        numbers.assign(normal.begin(), normal.end());
        add(1);
        break;
    }
    case Selector::Kind::Indices:
        for (std::size_t count = 1 + rng() % 300; count > 0; --count)
        {
            const std::int64_t first = std::int64_t(rng() >> rng() % 32);
            selector.ranges.emplace_back(first, first + rng() % 3);
        }
        break;
    case Selector::Kind::Labels:
        selector.name = "dir/" + any_name(rng) + ".sel";
        selector.label = std::int64_t(rng()) - (std::int64_t(1) << 31);
        break;
    case Selector::Kind::Group:
        selector.name = any_name(rng);
        break;
    case Selector::Kind::All:
    case Selector::Kind::Spline:
        break;
    }
    return selector;
}

SplineStatement any_spline(std::mt19937& rng, Role role)
{
    using Form = SplineStatement::Form;
    SplineStatement spline;
    spline.form = static_cast<Form>(rng() % (role == Role::Rod ? 3 : 2));
    if (spline.form == Form::Skeleton)
        spline.near = any_name(rng);
    else
        for (int k = 4 + int(rng() % 4); k > 0; --k)
            spline.points.push_back(any_vector(rng) + 1e-3 * k * any_direction(rng));
    for (std::size_t k = 1; k < spline.points.size(); ++k)
        if (spline.points[k] == spline.points[k - 1])
            spline.points[k].x() = k;
    spline.is_closed = spline.form != Form::Skeleton && rng() % 2;
    if (spline.form == Form::Through)
        spline.spans = 1 + std::int64_t(rng() % 8);
    if (role == Role::Rod && rng() % 2)
        spline.radii = {std::ldexp(double(1 + rng()), -20)};
    if (role == Role::Rod && rng() % 2)
        spline.stiffness = std::ldexp(double(1 + rng()), -20);
    spline.is_exact = role == Role::Rod && rng() % 2;
    return spline;
}

/// Of a point of a rod.
Move any_hold(std::mt19937& rng, const RegionStatement& rod)
{
    Move move;
    move.region = rod.name;
    move.place.kind =
        static_cast<MovePlace::Kind>(1 + rng() % (rod.spline->is_closed ? 2 : 3));
    if (move.place.kind == MovePlace::Kind::Point)
        move.place.point = std::int64_t(rng() % 4);
    if (rng() % 3 == 0)
    {
        move.released = {rng() % 2 == 0, rng() % 2 == 0, true};
        return move;
    }
    Operation operation;
    switch (rng() % 3)
    {
    case 0:
        operation.kind = Operation::Kind::To;
        operation.vector = any_vector(rng);
        break;
    case 1:
        operation.kind = Operation::Kind::Turn;
        operation.move.degrees = any_number(rng);
        break;
    default:
        operation.kind = Operation::Kind::Tangent;
        operation.vector = any_direction(rng);
        break;
    }
    move.operations.push_back(operation);
    return move;
}

Operation any_operation(std::mt19937& rng, bool is_pin, bool is_first)
{
    Operation operation;
    const unsigned kind = unsigned(rng() % 3);
    if (is_pin || kind == 0)
    {
        const bool is_to = is_pin && is_first && kind == 0;
        operation.kind = is_to ? Operation::Kind::To : Operation::Kind::Translate;
        (is_to ? operation.vector : operation.move.translation) = any_vector(rng);
    }
    else if (kind == 1)
    {
        operation.kind = Operation::Kind::Rotate;
        operation.move.axis = any_direction(rng);
        operation.move.degrees = any_number(rng);
        if (rng() % 2)
            operation.move.pivot = any_vector(rng);
        else
            operation.is_about_border = rng() % 2 == 0;
    }
    else
    {
        operation.kind = Operation::Kind::Matrix;
        Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
        for (int row = 0; row < 3; ++row)
            for (int column = 0; column < 4; ++column)
                matrix(row, column) = any_number(rng);
        operation.matrix = std::make_shared<const Eigen::Matrix4d>(matrix);
    }
    return operation;
}

HandleFile any_file(std::mt19937& rng)
{
    HandleFile file;
    file.path = kPath;
    file.is_relative = rng() % 2;
    std::int64_t frame_number = std::int64_t(rng() % 3);
    for (std::size_t stages = 1 + rng() % 3; stages > 0; --stages)
    {
        Stage& stage = file.stages.emplace_back();
        for (int regions = 1; regions < 7; ++regions)
        {
            RegionStatement region;
            region.role = static_cast<Role>(rng() % 6);
            region.name = any_name(rng) + std::to_string(regions);
            if (region.role == Role::Stiff)
                region.factor = std::ldexp(double(1 + rng()), int(rng() % 80) - 40);
            if (region.role == Role::Rod || region.role == Role::Curve)
            {
                region.selector.kind = Selector::Kind::Spline;
                region.spline =
                    std::make_shared<const SplineStatement>(any_spline(rng, region.role));
                stage.regions.push_back(region);
                continue;
            }
            for (std::size_t statements = 1 + rng() % 3; statements > 0; --statements)
            {
                region.selector = any_selector(rng);
                stage.regions.push_back(region);
            }
        }
        std::string pin, guide;
        for (const RegionStatement& region : stage.regions)
        {
            if (region.role == Role::Pin)
                pin = region.name;
            if (region.spline)
                guide = region.name;
        }
        if (!pin.empty() && !guide.empty())
        {
            OnStatement& on = stage.ons.emplace_back();
            on.pin = pin;
            on.guide = guide;
            if (rng() % 2)
                on.at = std::ldexp(double(rng()), -32);
        }
        for (std::size_t frames = 1 + rng() % 3; frames > 0; --frames)
        {
            FrameStatement& frame = stage.frames.emplace_back();
            frame.number = frame_number;
            frame_number += 1 + std::int64_t(rng() % 1000);
            std::string last;
            for (const RegionStatement& region : stage.regions)
            {
                const bool is_pin = region.role == Role::Pin;
                const bool is_on = !stage.ons.empty() && region.name == stage.ons[0].pin;
                if (region.name == last || is_on ||
                    (!is_pin && !region.spline && region.role != Role::Handle))
                    continue;
                last = region.name;
                if (region.role == Role::Rod && rng() % 2)
                    frame.moves.push_back(any_hold(rng, region));
                Move& move = frame.moves.emplace_back();
                move.region = region.name;
                for (std::size_t k = 0; k <= rng() % 3; ++k)
                    move.operations.push_back(any_operation(rng, is_pin, k == 0));
            }
        }
    }
    return file;
}

HandleFile with_name(const std::string& name)
{
    HandleFile file;
    file.path = kPath;
    RegionStatement region;
    region.name = name;
    file.stages.emplace_back().regions.push_back(region);
    return file;
}

} // namespace

TEST(HandleText, reads_back_the_same_to_the_bit)
{
    for (unsigned seed = 0; seed < 300; ++seed)
    {
        SCOPED_TRACE(seed);
        std::mt19937 rng(seed);
        const HandleFile file = any_file(rng);
        const std::string text = handle_text(file);
        const HandleFile again = parse_handles(kPath, text);
        ASSERT_EQ(meaning_of(again), meaning_of(file));
        ASSERT_EQ(handle_text(again), text);
    }
}

TEST(HandleText, is_what_a_person_would_write)
{
    const std::string text =
        "cellwarp-handles 1\nunits relative\nfixed base box 0 0 0 1 0.1 1\n"
        "handle \"left arm\" labels a.sel -1\npin tip indices 17 20-22\n"
        "stiff plate indices 3 factor 20\nframe 1\n"
        "move \"left arm\" rotate 0 1 0 45 about 1 2 3 translate 0 0.2 0\n"
        "move tip to 0.1 0.2 0.3\ncommit\nhandle rest all\nframe 3\n"
        "move rest matrix 1 0 0 0 0 1 0 0.2 0 0 1 0 0 0 0 1\n";
    EXPECT_EQ(handle_text(parse_handles(kPath, text)), text);
    HandleFile nothing;
    EXPECT_EQ(handle_text(nothing), "cellwarp-handles 1\n");
}

TEST(HandleText, has_no_long_lines)
{
    HandleFile file = with_name("many");
    RegionStatement& region = file.stages[0].regions[0];
    region.role = Role::Stiff;
    region.factor = 0.125;
    region.selector.kind = Selector::Kind::Indices;
    for (std::int64_t i = 0; i < 20000; ++i)
        region.selector.ranges.emplace_back(3 * i, 3 * i + 1);
    const std::string text = handle_text(file);
    std::size_t longest = 0, start = 0;
    for (std::size_t end; (end = text.find('\n', start)) != std::string::npos;)
    {
        longest = std::max(longest, end - start);
        start = end + 1;
    }
    EXPECT_LT(longest, 600u);
    const HandleFile again = parse_handles(kPath, text);
    EXPECT_EQ(meaning_of(again), meaning_of(file));
    for (const RegionStatement& statement : again.stages[0].regions)
        EXPECT_EQ(statement.factor, 0.125);
}

TEST(HandleText, quotes_names_and_refuses_those_that_no_file_can_hold)
{
    for (const std::string name :
         {"", " ", "a b", "#", "a#", "a\"b", "\\", "about", "\t", "\xff", "<html", "'x'",
          "<?xml version", "1", "factor", "\xef\xbb\xbf"})
    {
        SCOPED_TRACE(name);
        EXPECT_TRUE(is_handle_name(name));
        const HandleFile again = parse_handles(kPath, handle_text(with_name(name)));
        ASSERT_EQ(again.stages[0].regions.size(), 1u);
        EXPECT_EQ(again.stages[0].regions[0].name, name);
    }
    for (const std::string& name :
         {std::string("a\nb"), std::string("\r"), std::string("a\0b", 3),
          std::string("\"a"), std::string("a \"b"), std::string("#\"")})
    {
        EXPECT_FALSE(is_handle_name(name));
        EXPECT_TRUE(
            contains(error_of(Fault::Usage, [&] { handle_text(with_name(name)); }),
                     "dir/h.handles: cannot hold the name '"));
    }
}

TEST(HandleText, label_files_are_named_from_its_folder)
{
    HandleFile file = with_name("a");
    Selector& selector = file.stages[0].regions[0].selector;
    selector.kind = Selector::Kind::Labels;
    selector.name = "dir/deep er/x.sel";
    EXPECT_TRUE(contains(handle_text(file), "labels \"deep er/x.sel\" 0\n"));
    selector.name = "/nowhere/x.sel";
    EXPECT_TRUE(contains(handle_text(file), "labels /nowhere/x.sel 0\n"));
}

TEST(SceneText, reads_back_the_same_to_the_bit)
{
    std::mt19937 rng(5);
    const auto maybe = [&](auto& out, const auto& value)
    {
        if (rng() % 2)
            out = value;
    };
    for (int trial = 0; trial < 300; ++trial)
    {
        SCOPED_TRACE(trial);
        SceneFile scene;
        scene.path = "dir/s.json";
        scene.model = "dir/" + any_name(rng) + ".obj";
        if (rng() % 2)
            scene.handles = rng() % 2 ? "/h\".handles" : "dir/b.handles";
        maybe(scene.settings.cells.fill, rng() % 2 ? "closed" : "shell");
        maybe(scene.settings.cells.across, std::int64_t(1 + rng() % (1 << 20)));
        maybe(scene.settings.cells.max_depth, std::int64_t(rng() % 21));
        maybe(scene.settings.cells.threshold, double(rng()) * 5e-324);
        maybe(scene.settings.cells.gap, 1e-6 + double(rng()) / 3e10);
        maybe(scene.settings.cells.thickness, 1e-6 + double(rng()) / 3e10);
        maybe(scene.settings.cells.loose, rng() % 2 ? "follow" : "stay");
        maybe(scene.settings.cells.join, rng() % 2 == 0);
        maybe(scene.settings.cells.max_cells, std::int64_t(1 + rng() / 2));
        if (rng() % 2)
        {
            FrameBox& frame = scene.frame.emplace();
            for (std::size_t k = 0; k < 3; ++k)
            {
                frame.origin[k] = any_number(rng);
                frame.size[k] = double(1 + rng()) / 7;
                for (double& entry : frame.axes[k])
                    entry = any_number(rng);
            }
        }
        maybe(scene.settings.field.drag, rng() % 2 ? "blend" : "closest4");
        maybe(scene.settings.field.release, rng() % 2 ? "rbf-global" : "blend");
        maybe(scene.settings.energy, rng() % 2 ? "cellwarp" : "botsch07");
        const std::string text = scene_text(scene);
        const SceneFile again = parse_scene(scene.path, text);
        EXPECT_TRUE(again.warnings.empty());
        EXPECT_EQ(again.model, scene.model);
        EXPECT_EQ(again.handles, scene.handles);
        EXPECT_EQ(again.settings.cells.fill, scene.settings.cells.fill);
        EXPECT_EQ(again.settings.cells.across, scene.settings.cells.across);
        EXPECT_EQ(again.settings.cells.max_depth, scene.settings.cells.max_depth);
        EXPECT_EQ(again.settings.cells.threshold, scene.settings.cells.threshold);
        EXPECT_EQ(again.settings.cells.gap, scene.settings.cells.gap);
        EXPECT_EQ(again.settings.cells.thickness, scene.settings.cells.thickness);
        EXPECT_EQ(again.settings.cells.loose, scene.settings.cells.loose);
        EXPECT_EQ(again.settings.cells.join, scene.settings.cells.join);
        EXPECT_EQ(again.settings.cells.max_cells, scene.settings.cells.max_cells);
        EXPECT_EQ(again.settings.field.drag, scene.settings.field.drag);
        EXPECT_EQ(again.settings.field.release, scene.settings.field.release);
        EXPECT_EQ(again.settings.energy, scene.settings.energy);
        ASSERT_EQ(again.frame.has_value(), scene.frame.has_value());
        if (scene.frame)
        {
            EXPECT_EQ(std::memcmp(&*again.frame, &*scene.frame, sizeof(FrameBox)), 0);
        }
        EXPECT_EQ(scene_text(again), text);
    }
}

TEST(SceneText, says_only_what_the_scene_says)
{
    SceneFile scene;
    scene.path = "dir/s.json";
    scene.model = "dir/a.obj";
    EXPECT_EQ(scene_text(scene), "{\n  \"cellwarp\": 1,\n  \"model\": \"a.obj\"\n}\n");
    scene.model = "dir/\xff.obj";
    EXPECT_TRUE(contains(error_of(Fault::Usage, [&] { scene_text(scene); }),
                         "dir/s.json: cannot name its model or handles"));
}

TEST(HandleText, joints_come_back_as_they_were)
{
    const HandleFile file = parse_handles(
        kPath, "cellwarp-handles 1\n"
               "joint root at 0 1 0 radius 0.2\n"
               "joint \"left arm\" at 1 1 0 parent root hinge 0 0 1 twist -10 140\n"
               "joint hand at 2 1 0 parent \"left arm\" swing 60\n"
               "frame 1\n"
               "move root translate 0 0 1 rotate 0 1 0 90\n"
               "move hand to 1 2 0 from root\n"
               "frame 2\n"
               "release hand\n");
    const std::string text = handle_text(file);
    const HandleFile again = parse_handles(kPath, text);
    EXPECT_EQ(again.stages[0].joints.size(), 3u);
    EXPECT_EQ(again.stages[0].frames[0].moves[1].chain, "root");
    for (std::size_t k = 0; k < 3; ++k)
    {
        SkeletonJoint joint = again.stages[0].joints[k];
        joint.line = file.stages[0].joints[k].line;
        EXPECT_EQ(joint, file.stages[0].joints[k]);
    }
    EXPECT_EQ(handle_text(again), text);
}

} // namespace cellwarp::core
