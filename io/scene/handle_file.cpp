// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/handle_file.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "io/base/bytes.h"
#include "io/base/number.h"
#include "io/base/relative_name.h"
#include "io/base/text.h"
#include "io/formats/geometry.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
{

namespace
{

constexpr std::string_view kKeyword = "cellwarp-handles";

/// "# save PRINT of SCENE"; handle_text.cpp writes it.
constexpr std::string_view kSaveComment = "# save ", kOfScene = " of ";

/// Factors of stiff regions: squares of forces neither vanish nor overflow.
constexpr double kMinFactor = 1e-100, kMaxFactor = 1e100;

/// From its rows.
std::shared_ptr<const Eigen::Matrix4d> matrix_of(const std::vector<double>& rows)
{
    return std::make_shared<const Eigen::Matrix4d>(
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows.data()));
}

/// The words of one statement; a word in double quotes may hold blanks and #.
class Statement
{
public:
    Statement(const std::string& file, std::int64_t line, std::string_view text)
        : file_(file), line_(line)
    {
        for (std::size_t i = 0; i < text.size();)
        {
            if (is_blank(text[i]))
                ++i;
            else if (text[i] == '#')
                break;
            else if (text[i] == '"')
            {
                const std::size_t end = text.find('"', i + 1);
                if (end == std::string_view::npos)
                    throw malformed({file, line, ""}, "a double quote is not closed");
                words_.emplace_back(text.substr(i + 1, end - i - 1));
                i = end + 1;
            }
            else
            {
                std::size_t end = i;
                while (end < text.size() && !is_end_of_word(text[end]))
                    ++end;
                words_.emplace_back(text.substr(i, end - i));
                i = end;
            }
        }
    }

    bool is_empty() const { return words_.empty(); }
    bool is_done() const { return next_ == words_.size(); }
    const std::string& peek() const { return words_[next_]; }

    const std::string& word(const std::string& field)
    {
        if (is_done())
            fail(field, "is missing");
        return words_[next_++];
    }
    double number(const std::string& field)
    {
        const std::string& text = word(field);
        const std::optional<double> value = parse_double(text);
        if (!value || !std::isfinite(*value))
            fail(field, "got " + in_quotes(text) + ", need a finite number");
        return *value;
    }
    std::vector<double> numbers(const std::string& field, int count)
    {
        std::vector<double> values;
        for (int i = 0; i < count; ++i)
            values.push_back(number(field + " number " + std::to_string(i + 1)));
        return values;
    }
    Eigen::Vector3d vector(const std::string& field)
    {
        const std::vector<double> v = numbers(field, 3);
        return {v[0], v[1], v[2]};
    }
    std::int64_t integer(const std::string& field)
    {
        const std::string& text = word(field);
        const std::optional<std::int64_t> value = parse_integer(text);
        if (!value)
            fail(field, "got " + in_quotes(text) + ", need an integer");
        return *value;
    }
    void end()
    {
        if (!is_done())
            fail("", "one word too many (got " + in_quotes(words_[next_]) + ")");
    }
    [[noreturn]] void fail(const std::string& field, const std::string& what) const
    {
        throw malformed({file_, line_, field}, what);
    }

private:
    const std::string& file_;
    std::int64_t line_;
    std::vector<std::string> words_;
    std::size_t next_ = 0;
};

Selector parse_selector(Statement& words, const std::string& file)
{
    Selector selector;
    const std::string kind = words.word("selector");
    if (kind == "box")
    {
        selector.kind = Selector::Kind::Box;
        selector.numbers = words.numbers("box", 6);
        for (std::size_t k = 0; k < 3; ++k)
            if (selector.numbers[k] > selector.numbers[k + 3])
                words.fail("box", "its lower corner is above its upper one (got " +
                                      shortest(selector.numbers[k]) + " > " +
                                      shortest(selector.numbers[k + 3]) + ")");
    }
    else if (kind == "sphere" || kind == "capsule")
    {
        const bool is_sphere = kind == "sphere";
        selector.kind = is_sphere ? Selector::Kind::Sphere : Selector::Kind::Capsule;
        selector.numbers = words.numbers(kind, is_sphere ? 4 : 7);
        if (!(selector.numbers.back() >= 0))
            words.fail("radius",
                       "got " + shortest(selector.numbers.back()) + ", need >= 0");
    }
    else if (kind == "halfspace")
    {
        selector.kind = Selector::Kind::Halfspace;
        selector.numbers = words.numbers("halfspace", 4);
        if (selector.numbers[0] == 0 && selector.numbers[1] == 0 &&
            selector.numbers[2] == 0)
            words.fail("normal", "got 0 0 0, need a direction");
    }
    else if (kind == "indices")
    {
        selector.kind = Selector::Kind::Indices;
        do
        {
            const std::string& text = words.word("index");
            const std::size_t dash = text.find('-', 1);
            const std::optional<std::int64_t> first = parse_integer(text.substr(0, dash));
            const std::optional<std::int64_t> last =
                dash == std::string::npos ? first : parse_integer(text.substr(dash + 1));
            if (!first || !last || *first < 0 || *last < *first)
                words.fail("index", "got " + in_quotes(text) +
                                        ", need a sample index or a range like 3-7");
            selector.ranges.emplace_back(*first, *last);
        } while (!words.is_done() && words.peek() != "factor");
    }
    else if (kind == "labels")
    {
        selector.kind = Selector::Kind::Labels;
        selector.name = resolved_name(file, words.word("label file"));
        selector.label = words.integer("label");
    }
    else if (kind == "group")
    {
        selector.kind = Selector::Kind::Group;
        selector.name = words.word("group name");
    }
    else if (kind != "all")
        words.fail("selector",
                   "got " + in_quotes(kind) +
                       ", need box, sphere, capsule, halfspace, indices, labels, "
                       "group or all");
    return selector;
}

/// What a rod or curve says behind its name.
SplineStatement parse_spline(Role role, Statement& words)
{
    using Form = SplineStatement::Form;
    SplineStatement spline;
    const std::string form = words.word("form");
    if (form == "through" || form == "points")
    {
        spline.form = form == "through" ? Form::Through : Form::Points;
        while (!words.is_done() && parse_double(words.peek()))
            spline.points.push_back(
                words.vector("point " + std::to_string(spline.points.size())));
        const std::size_t least = spline.form == Form::Points ? 4 : 2;
        if (spline.points.size() < least ||
            spline.points.size() > static_cast<std::size_t>(kMostSplinePoints))
            words.fail(form, "got " + std::to_string(spline.points.size()) +
                                 " points, need " + std::to_string(least) + " to " +
                                 std::to_string(kMostSplinePoints));
    }
    else if (form == "from" && role == Role::Rod)
    {
        spline.form = Form::Skeleton;
        if (words.word("source") != "skeleton")
            words.fail("source", "need 'from skeleton'");
        if (!words.is_done() && words.peek() == "near")
        {
            words.word("near");
            spline.near = words.word("region name");
        }
    }
    else
        words.fail("form",
                   "got " + in_quotes(form) + ", need through" +
                       (role == Role::Rod ? ", points or from skeleton" : " or points"));
    const auto positive = [&](const std::string& field)
    {
        const double value = words.number(field);
        if (!(value >= kMinFactor && value <= kMaxFactor))
            words.fail(field, "got " + shortest(value) + ", need " +
                                  shortest(kMinFactor) + " to " + shortest(kMaxFactor));
        return value;
    };
    while (!words.is_done())
    {
        const std::string word = words.word("option");
        if (word == "closed" && spline.form != Form::Skeleton)
            spline.is_closed = true;
        else if (word == "spans" && spline.form == Form::Through)
        {
            spline.spans = words.integer("spans");
            if (spline.spans < 1 || spline.spans > kMostSpans)
                words.fail("spans", "got " + std::to_string(spline.spans) +
                                        ", need 1 to " + std::to_string(kMostSpans));
        }
        else if (word == "radius" && role == Role::Rod)
            spline.radii = {positive("radius")};
        else if (word == "stiffness" && role == Role::Rod)
            spline.stiffness = positive("stiffness");
        else if (word == "exact" && role == Role::Rod)
            spline.is_exact = true;
        else
            words.fail(
                "option",
                "got " + in_quotes(word) + ", need " +
                    (role == Role::Rod ? "closed, spans, radius, stiffness or exact"
                                       : "closed or spans") +
                    (spline.form == Form::Through ? "" : " (spans: of through alone)"));
    }
    if (spline.is_closed && spline.points.size() < 3)
        words.fail("closed", "a closed one needs 3 points");
    if (spline.form == Form::Through)
        for (std::size_t k = 1; k < spline.points.size(); ++k)
            if (spline.points[k] == spline.points[k - 1])
                words.fail("point " + std::to_string(k), "is where the one before is");
    return spline;
}

RegionStatement parse_region(Role role, Statement& words, const std::string& file,
                             std::int64_t line)
{
    RegionStatement region;
    region.role = role;
    region.line = line;
    region.name = words.word("region name");
    if (role == Role::Rod || role == Role::Curve)
    {
        region.selector.kind = Selector::Kind::Spline;
        region.spline =
            std::make_shared<const SplineStatement>(parse_spline(role, words));
        return region;
    }
    region.selector = parse_selector(words, file);
    if (role == Role::Stiff)
    {
        // A bare number there would be one more index.
        if (region.selector.kind == Selector::Kind::Indices &&
            (words.is_done() || words.word("factor") != "factor"))
            words.fail("factor", "is missing (need 'factor' and a number after indices)");
        region.factor = words.number("factor");
        if (!(region.factor >= kMinFactor && region.factor <= kMaxFactor))
            words.fail("factor", "got " + shortest(region.factor) + ", need " +
                                     shortest(kMinFactor) + " to " +
                                     shortest(kMaxFactor));
    }
    words.end();
    return region;
}

Operation parse_operation(Statement& words)
{
    Operation operation;
    const std::string kind = words.word("operation");
    if (kind == "translate")
        operation.move.translation = words.vector(kind);
    else if (kind == "to")
    {
        operation.kind = Operation::Kind::To;
        operation.vector = words.vector(kind);
    }
    else if (kind == "rotate")
    {
        operation.kind = Operation::Kind::Rotate;
        operation.move.axis = words.vector("axis");
        if (operation.move.axis.isZero(0))
            words.fail("axis", "got 0 0 0, need a direction");
        operation.move.degrees = words.number("degrees");
        if (!words.is_done() && words.peek() == "about")
        {
            words.word("about");
            operation.is_about_border = !words.is_done() && words.peek() == "border";
            if (operation.is_about_border)
                words.word("about");
            else
                operation.move.pivot = words.vector("about");
        }
    }
    else if (kind == "matrix")
    {
        operation.kind = Operation::Kind::Matrix;
        operation.matrix = matrix_of(words.numbers("matrix", 16));
        if (operation.matrix->row(3) != Eigen::RowVector4d(0, 0, 0, 1))
            words.fail("matrix", "its last row is not 0 0 0 1");
    }
    else if (kind == "turn")
    {
        operation.kind = Operation::Kind::Turn;
        operation.move.degrees = words.number("degrees");
    }
    else if (kind == "tangent")
    {
        operation.kind = Operation::Kind::Tangent;
        operation.vector = words.vector("tangent");
        if (operation.vector.isZero(0))
            words.fail("tangent", "got 0 0 0, need a direction");
    }
    else
        words.fail("operation", "got " + in_quotes(kind) +
                                    ", need translate, rotate, matrix, to, turn or "
                                    "tangent");
    return operation;
}

/// "point K", "start" or "end", if that is what follows.
MovePlace parse_place(Statement& words)
{
    MovePlace place;
    const std::string word = words.is_done() ? "" : words.peek();
    if (word == "point")
    {
        words.word("point");
        place.kind = MovePlace::Kind::Point;
        place.point = words.integer("point");
    }
    else if (word == "start" || word == "end")
    {
        words.word(word);
        place.kind = word == "end" ? MovePlace::Kind::End : MovePlace::Kind::Start;
    }
    return place;
}

/// What "release" names behind the place; nothing: all of it.
HoldParts parse_parts(Statement& words)
{
    if (words.is_done())
        return {true, true, true};
    HoldParts released;
    while (!words.is_done())
    {
        const std::string word = words.word("part");
        if (word == "place")
            released.place = true;
        else if (word == "tangent")
            released.tangent = true;
        else if (word == "twist")
            released.twist = true;
        else
            words.fail("part",
                       "got " + in_quotes(word) + ", need place, tangent or twist");
    }
    return released;
}

/// A move, or a release, by what its line says alone.
Move parse_move(Statement& words, std::int64_t line, bool releases)
{
    Move move;
    move.line = line;
    move.region = words.word("region name");
    move.place = parse_place(words);
    if (releases)
    {
        move.released = parse_parts(words);
        return move;
    }
    do
        move.operations.push_back(parse_operation(words));
    while (!words.is_done() && words.peek() != "from");
    if (!words.is_done())
    {
        words.word("from");
        move.chain = words.word("first joint");
        words.end();
    }
    return move;
}

OnStatement parse_on(Statement& words, std::int64_t line)
{
    OnStatement on;
    on.line = line;
    on.pin = words.word("pin name");
    on.guide = words.word("name of a curve or rod");
    if (!words.is_done())
    {
        if (words.word("at") != "at")
            words.fail("at", "need 'at' and a share of the length, or nothing");
        on.at = words.number("at");
        if (!(*on.at >= 0 && *on.at <= 1))
            words.fail("at", "got " + shortest(*on.at) + ", need 0 to 1");
    }
    words.end();
    return on;
}

FrameStatement parse_frame(Statement& words, std::int64_t line)
{
    const std::int64_t number = words.integer("frame number");
    if (number < 0 || number > kLastFrame)
        words.fail("frame number", "got " + std::to_string(number) + ", need 0 to " +
                                       std::to_string(kLastFrame));
    words.end();
    return {number, {}, line};
}

std::optional<Role> role_named(const std::string& word)
{
    for (const Role role :
         {Role::Fixed, Role::Handle, Role::Pin, Role::Stiff, Role::Rod, Role::Curve})
        if (word == role_name(role))
            return role;
    return std::nullopt;
}

/// Operations that the role of a region, and the place in a rod or curve, let it make.
void check_operation(const Operation& operation, bool is_first, Role role,
                     const MovePlace& place, Statement& words, const std::string& region)
{
    using Kind = Operation::Kind;
    const Kind kind = operation.kind;
    const bool turns = kind == Kind::Rotate || kind == Kind::Matrix;
    const bool is_of_rod = kind == Kind::Turn || kind == Kind::Tangent;
    if (role == Role::Bone)
    {
        if (is_of_rod || kind == Kind::Matrix)
            words.fail(region, "a joint takes rotate or to; a root translate as well");
        if (kind == Kind::Rotate && (operation.move.pivot || operation.is_about_border))
            words.fail(region, "a joint turns about itself: leave out 'about'");
    }
    else if (place.kind != MovePlace::Kind::Whole)
    {
        if (turns)
            words.fail(region, "a point of it takes translate, to, turn or tangent");
        if (is_of_rod && role == Role::Curve)
            words.fail(region, "a curve has no twist and holds no tangent");
    }
    else if (is_of_rod)
        words.fail(region, "'turn' and 'tangent' are for points of a rod");
    else if (role == Role::Pin && turns)
        words.fail(region, "a pin turns freely: it takes translate or to");
    else if (role != Role::Pin && kind == Kind::To)
        words.fail(region, "'to' is for a pin, a joint, or a point of a rod");
    if (kind == Kind::To && !is_first)
        words.fail(region, role == Role::Pin ? "'to' must be a pin's first operation"
                                             : "'to' must be the first operation");
}

} // namespace

/// Builds the file statement by statement and knows what may come next.
class HandleBuilder::Parser
{
public:
    Parser(const std::string& path, std::vector<SkeletonJoint> joints)
    {
        file_.path = path;
        file_.stages.emplace_back();
        for (const SkeletonJoint& joint : joints)
        {
            regions_.try_emplace(joint.name, Role::Bone, joint.line);
            joints_.try_emplace(joint.name, joints_.size());
        }
        file_.stages.back().joints = std::move(joints);
    }

    explicit Parser(HandleFile file) : file_(std::move(file)), has_header_(true)
    {
        if (file_.stages.empty())
            file_.stages.emplace_back();
        for (const Stage& stage : file_.stages)
            if (!stage.frames.empty())
                last_frame_ = stage.frames.back().number;
        const Stage& stage = file_.stages.back();
        for (const RegionStatement& region : stage.regions)
        {
            regions_.try_emplace(region.name, region.role, region.line);
            if (region.spline)
                splines_[region.name] = region.spline;
        }
        for (const OnStatement& on : stage.ons)
            guided_.try_emplace(on.pin, on.line);
        for (const SkeletonJoint& joint : stage.joints)
        {
            regions_.try_emplace(joint.name, Role::Bone, joint.line);
            joints_.try_emplace(joint.name, joints_.size());
        }
        if (!stage.frames.empty())
            for (const Move& move : stage.frames.back().moves)
                moved_.try_emplace(key_of(move), move.line);
    }

    void statement(std::string_view text, std::int64_t line)
    {
        if (text.starts_with(kSaveComment))
            save_comment(text.substr(kSaveComment.size()));
        Statement words(file_.path, line, text);
        if (words.is_empty())
            return;
        const std::string keyword = words.word("statement");
        if (!has_header_)
        {
            if (keyword != kKeyword || words.integer("version") != 1)
                words.fail("", "the first statement is wrong (got " + in_quotes(text) +
                                   ", need 'cellwarp-handles 1')");
            has_header_ = true;
            words.end();
            return;
        }
        Stage& stage = file_.stages.back();
        if (const std::optional<Role> role = role_named(keyword))
        {
            if (!stage.frames.empty())
                words.fail(keyword,
                           "a region comes before the frames, or after a commit");
            RegionStatement region = parse_region(*role, words, file_.path, line);
            const auto [known, is_new] =
                regions_.try_emplace(region.name, region.role, region.line);
            if (!is_new && known->second.first != region.role)
                words.fail(region.name, "is already a " + role_name(known->second.first) +
                                            " region" + line_note(known->second.second));
            if (!is_new && region.spline)
                words.fail(region.name,
                           "is already told of" + line_note(known->second.second));
            if (region.spline)
                splines_[region.name] = region.spline;
            stage.regions.push_back(std::move(region));
        }
        else if (keyword == "units")
        {
            const std::string unit = words.word("units");
            if (unit != "relative")
                words.fail("units", "got " + in_quotes(unit) + ", need relative");
            if (!stage.regions.empty() || file_.stages.size() > 1)
                words.fail("units", "comes before the first region");
            if (!stage.joints.empty())
                words.fail("units", "the joints before it are in the model's units");
            file_.is_relative = true;
            words.end();
        }
        else if (keyword == "joint")
            joint(words, line);
        else if (keyword == "skeleton")
            skeleton(words, line);
        else if (keyword == "frame")
            frame(words, line);
        else if (keyword == "move")
            move(words, line, false);
        else if (keyword == "release")
            move(words, line, true);
        else if (keyword == "on")
            on(words, line);
        else if (keyword == "commit")
        {
            if (stage.frames.empty())
                words.fail("commit", "no frame stands before it");
            words.end();
            file_.stages.emplace_back();
            regions_.clear();
            splines_.clear();
            guided_.clear();
            joints_.clear();
        }
        else
            words.fail("", "unknown statement (got " + in_quotes(keyword) +
                               ", need units, fixed, handle, pin, stiff, rod, curve, on, "
                               "joint, skeleton, frame, move, release or commit)");
    }

    /// The lines of a whole file.
    void parse(std::string_view text)
    {
        // What begins like a handle file is one, also with names that look like markup.
        const bool is_ours = text.starts_with(kKeyword);
        if (const std::string guess =
                is_ours ? foreign_bytes(text) : foreign_content(text);
            !guess.empty())
            throw malformed({file_.path, 0, ""},
                            "this looks like " + guess + ", need a handle file");
        text.remove_prefix(byte_order_mark(text));
        LineReader lines(text, 0, true);
        for (std::string_view line; lines.next(line);)
            statement(line, lines.line_number());
        if (!has_header_)
            throw malformed({file_.path, lines.line_number(), ""},
                            "the file is empty (need 'cellwarp-handles 1')");
    }

    HandleFile& file() { return file_; }

private:
    void save_comment(std::string_view text)
    {
        const std::size_t print = text.find(kOfScene);
        if (print != std::string_view::npos)
            file_.save = {std::string(text.substr(0, print)),
                          std::string(text.substr(print + kOfScene.size()))};
    }

    /// Of a statement about joints.
    Stage& stage_for_joints(const Statement& words)
    {
        Stage& stage = file_.stages.back();
        if (!stage.frames.empty())
            words.fail("joint", "comes before the frames, or after a commit");
        return stage;
    }
    void check_new_joint(const std::string& name, const Statement& words) const
    {
        if (const auto known = regions_.find(name); known != regions_.end())
            words.fail(name, "is already a " + role_name(known->second.first) +
                                 (known->second.first == Role::Bone ? "" : " region") +
                                 line_note(known->second.second));
    }
    /// " (line 12)": where something else stands; empty for text of no file.
    std::string line_note(std::int64_t line) const
    {
        return file_.path.empty() ? "" : " (line " + std::to_string(line) + ")";
    }

    void joint(Statement& words, std::int64_t line)
    {
        Stage& stage = stage_for_joints(words);
        SkeletonJoint joint;
        joint.line = line;
        joint.name = words.word("joint name");
        if (joint.name.empty())
            words.fail("joint name", "is empty");
        if (words.word("at") != "at")
            words.fail("at", "need 'at' and a place");
        joint.at = words.vector("at");
        while (!words.is_done())
        {
            const std::string option = words.word("option");
            if (option == "parent")
                joint.parent = words.word("parent");
            else if (option == "hinge")
            {
                joint.hinge = words.vector("hinge");
                if (joint.hinge->isZero(0))
                    words.fail("hinge", "got 0 0 0, need a direction");
            }
            else if (option == "twist")
            {
                const std::vector<double> angles = words.numbers("twist", 2);
                joint.twist = {angles[0], angles[1]};
            }
            else if (option == "swing")
            {
                joint.swing = words.number("swing");
                if (!(*joint.swing >= 0))
                    words.fail("swing", "got " + shortest(*joint.swing) + ", need >= 0");
            }
            else if (option == "radius")
            {
                joint.radius = words.number("radius");
                if (!(*joint.radius >= kMinFactor && *joint.radius <= kMaxFactor))
                    words.fail("radius", "got " + shortest(*joint.radius) + ", need " +
                                             shortest(kMinFactor) + " to " +
                                             shortest(kMaxFactor));
            }
            else
                words.fail("option", "got " + in_quotes(option) +
                                         ", need parent, hinge, twist, swing or radius");
        }
        check_new_joint(joint.name, words);
        if (stage.joints.size() == kMostJoints)
            words.fail("joint", "more than " + std::to_string(kMostJoints) + " joints");
        // A parent stands before its children, so that each line can be checked.
        const auto parent = joints_.find(joint.parent);
        if (joint.parent.empty() && !stage.joints.empty())
            words.fail(joint.name,
                       "is a second root; the first one is " + stage.joints.front().name);
        if (!joint.parent.empty() && parent == joints_.end())
            words.fail(joint.parent, "is no joint that was told of before");
        if (parent != joints_.end() && stage.joints[parent->second].at == joint.at)
            words.fail(joint.name,
                       "the bone from " + joint.parent + " to it has no length");
        if (joint.twist && (*joint.twist)[0] > (*joint.twist)[1])
            words.fail("twist", "its least angle is " + shortest((*joint.twist)[0]) +
                                    ", its largest " + shortest((*joint.twist)[1]));
        regions_.try_emplace(joint.name, Role::Bone, line);
        joints_[joint.name] = stage.joints.size();
        stage.joints.push_back(std::move(joint));
    }

    void skeleton(Statement& words, std::int64_t line)
    {
        Stage& stage = stage_for_joints(words);
        if (!stage.joints.empty())
            words.fail("skeleton", "there are joints already");
        if (file_.is_relative)
            words.fail("skeleton", "is in the model's units: leave out 'units relative'");
        const std::string path = resolved_name(file_.path, words.word("file"));
        if (!is_skeleton_format(extension_of(path)))
            words.fail("file",
                       "got " + in_quotes(path) + ", need .tgf, .bvh, .gltf or .glb");
        SkeletonPlacement placement;
        while (!words.is_done())
        {
            const std::string option = words.word("option");
            if (option == "root")
                placement.root = words.word("root");
            else if (option == "scale")
            {
                placement.scale = words.number("scale");
                if (!(placement.scale >= kMinFactor && placement.scale <= kMaxFactor))
                    words.fail("scale", "got " + shortest(placement.scale) + ", need " +
                                            shortest(kMinFactor) + " to " +
                                            shortest(kMaxFactor));
            }
            else if (option == "up")
            {
                const std::string axis = words.word("up");
                if (axis != "x" && axis != "y" && axis != "z")
                    words.fail("up", "got " + in_quotes(axis) + ", need x, y or z");
                placement.up = axis[0];
            }
            else if (option == "translate")
                placement.shift = words.vector("translate");
            else
                words.fail("option", "got " + in_quotes(option) +
                                         ", need root, scale, up or translate");
        }
        stage.joints = read_skeleton(path, placement).joints;
        for (SkeletonJoint& joint : stage.joints)
        {
            joint.line = line;
            check_new_joint(joint.name, words);
            regions_.try_emplace(joint.name, Role::Bone, line);
            joints_.try_emplace(joint.name, joints_.size());
        }
    }

    void frame(Statement& words, std::int64_t line)
    {
        FrameStatement frame = parse_frame(words, line);
        if (last_frame_ && frame.number <= *last_frame_)
            words.fail("frame number", "got " + std::to_string(frame.number) +
                                           ", need more than the last one, " +
                                           std::to_string(*last_frame_));
        last_frame_ = frame.number;
        moved_.clear();
        file_.stages.back().frames.push_back(std::move(frame));
    }

    Role role_of(const std::string& region, const Statement& words) const
    {
        const auto found = regions_.find(region);
        if (found == regions_.end())
            words.fail(region, "no region has this name");
        return found->second.first;
    }

    void on(Statement& words, std::int64_t line)
    {
        Stage& stage = file_.stages.back();
        if (!stage.frames.empty())
            words.fail("on", "comes before the frames, or after a commit");
        OnStatement on = parse_on(words, line);
        if (const Role role = role_of(on.pin, words); role != Role::Pin)
            words.fail(on.pin, "is a " + role_name(role) +
                                   " region, only a pin can stay on a curve");
        if (!splines_.contains(on.guide))
            words.fail(on.guide, "is no curve or rod that was told of before");
        const auto [other, is_first] = guided_.try_emplace(on.pin, line);
        if (!is_first)
            words.fail(on.pin, "is already on a curve" + line_note(other->second));
        stage.ons.push_back(std::move(on));
    }

    void check_place(const Move& move, const Statement& words) const
    {
        if (move.place.kind == MovePlace::Kind::Whole)
            return;
        const auto spline = splines_.find(move.region);
        if (spline == splines_.end())
            words.fail(move.region, "has no points: only a rod or curve has");
        const std::size_t count = spline->second->points.size();
        const std::int64_t point = move.place.point;
        if (point < 0 || (count > 0 && point >= std::int64_t(count)) ||
            point >= kMostSplinePoints)
            words.fail("point", "got " + std::to_string(point) + ", need 0 to " +
                                    std::to_string(std::int64_t(count) - 1));
        if (spline->second->is_closed && move.place.kind == MovePlace::Kind::End)
            words.fail(move.region, "is closed: it has no end");
    }

    void check_joint_move(const Move& move, const Statement& words) const
    {
        const std::vector<SkeletonJoint>& joints = file_.stages.back().joints;
        const SkeletonJoint& joint = joints[joints_.at(move.region)];
        using Kind = Operation::Kind;
        for (const Operation& operation : move.operations)
            if (operation.kind == Kind::Translate && !joint.parent.empty())
                words.fail(move.region,
                           "hangs on " + joint.parent + ": only a root is translated");
        if (move.operations.front().kind != Kind::To)
            return;
        if (move.operations.size() > 1)
            words.fail(move.region, "'to' is the only operation of its move");
        if (joint.parent.empty())
            words.fail(move.region, "is a root: nothing above it turns, use translate");
        if (move.chain.empty())
            return;
        std::string above = joint.parent;
        while (!above.empty() && above != move.chain)
            above = joints[joints_.at(above)].parent;
        if (above.empty())
            words.fail(move.chain, "is no joint above " + move.region);
    }

    /// \p releases: a release, else a move.
    void move(Statement& words, std::int64_t line, bool releases)
    {
        Stage& stage = file_.stages.back();
        if (stage.frames.empty())
            words.fail(releases ? "release" : "move", "no frame stands before it");
        Move move = parse_move(words, line, releases);
        const Role role = role_of(move.region, words);
        if (role == Role::Fixed || role == Role::Stiff)
            words.fail(move.region,
                       "is a " + role_name(role) +
                           " region, only a handle, a pin, a rod, a curve or "
                           "a joint can be moved");
        if (const auto guided = guided_.find(move.region); guided != guided_.end())
            words.fail(move.region,
                       "is on a curve" + line_note(guided->second) + ": that moves it");
        check_place(move, words);
        MovedKey key = key_of(move);
        if (const auto other = moved_.find(key); other != moved_.end())
            words.fail(move.region, std::string(releases ? "is released" : "is moved") +
                                        " twice in this frame" +
                                        line_note(other->second));
        if (releases)
        {
            if (role == Role::Bone && *move.released != HoldParts{true, true, true})
                words.fail(move.region,
                           "one word too many: a joint is released as a whole");
            if (role != Role::Bone &&
                (role != Role::Rod || (move.place.kind == MovePlace::Kind::Whole &&
                                       *move.released == HoldParts{true, true, true})))
                words.fail(move.region,
                           "only a joint, or a point, start or end of a rod is released "
                           "(of both ends place, tangent or twist)");
        }
        for (std::size_t k = 0; k < move.operations.size(); ++k)
            check_operation(move.operations[k], k == 0, role, move.place, words,
                            move.region);
        if (!move.chain.empty() &&
            (role != Role::Bone || move.operations.back().kind != Operation::Kind::To))
            words.fail("from", "comes after the 'to' of a joint");
        if (role == Role::Bone && !releases)
            check_joint_move(move, words);
        moved_.try_emplace(std::move(key), line);
        stage.frames.back().moves.push_back(std::move(move));
    }

    /// A region or point that is moved, and whether this is a release.
    using MovedKey = std::tuple<std::string, MovePlace, bool>;

    /// Points of a rod count by their number, where that is known.
    MovedKey key_of(const Move& move) const
    {
        MovePlace point = move.place;
        const auto spline = splines_.find(move.region);
        if (spline != splines_.end() && !spline->second->points.empty() &&
            point.kind != MovePlace::Kind::Whole)
        {
            if (point.kind != MovePlace::Kind::Point)
                point.point = point.kind == MovePlace::Kind::End
                                  ? std::int64_t(spline->second->points.size()) - 1
                                  : 0;
            point.kind = MovePlace::Kind::Point;
        }
        return {move.region, point, move.released.has_value()};
    }

    HandleFile file_;
    bool has_header_ = false;
    std::optional<std::int64_t> last_frame_;
    std::map<std::string, std::pair<Role, std::int64_t>> regions_; ///< role, line
    std::map<std::string, std::shared_ptr<const SplineStatement>> splines_;
    std::map<std::string, std::int64_t> guided_; ///< pins on curves: line
    std::map<std::string, std::size_t> joints_;  ///< number of each
    std::map<MovedKey, std::int64_t> moved_;     ///< in this frame: line
};

std::string role_name(Role role)
{
    switch (role)
    {
    case Role::Fixed:
        return "fixed";
    case Role::Handle:
        return "handle";
    case Role::Pin:
        return "pin";
    case Role::Stiff:
        return "stiff";
    case Role::Rod:
        return "rod";
    case Role::Curve:
        return "curve";
    case Role::Bone:
        return "bone";
    }
    return {};
}

HandleBuilder::HandleBuilder(const std::string& path, std::string_view text,
                             std::vector<SkeletonJoint> joints)
    : parser_(std::make_unique<Parser>(path, std::move(joints)))
{
    parser_->parse(text);
}

HandleBuilder::HandleBuilder(const std::string& path, std::string_view text)
    : HandleBuilder(path, text, {})
{
}

HandleBuilder::HandleBuilder(HandleFile file)
    : parser_(std::make_unique<Parser>(std::move(file)))
{
}

HandleBuilder::HandleBuilder() : HandleBuilder("", "cellwarp-handles 1") {}

HandleBuilder::HandleBuilder(const HandleBuilder& other)
    : parser_(std::make_unique<Parser>(*other.parser_))
{
}

HandleBuilder& HandleBuilder::operator=(const HandleBuilder& other)
{
    parser_ = std::make_unique<Parser>(*other.parser_);
    return *this;
}

HandleBuilder::HandleBuilder(HandleBuilder&&) noexcept = default;
HandleBuilder& HandleBuilder::operator=(HandleBuilder&&) noexcept = default;
HandleBuilder::~HandleBuilder() = default;

const HandleFile& HandleBuilder::file() const
{
    return parser_->file();
}

void HandleBuilder::parse(const std::string& statements)
{
    LineReader lines(statements, 0, true);
    for (std::string_view line; lines.next(line);)
        parser_->statement(line, 0);
}

void HandleBuilder::use_relative_units()
{
    parse("units relative");
}

void HandleBuilder::add(RegionStatement region)
{
    // A long list is checked here and not as text.
    Selector& selector = region.selector;
    std::vector<std::pair<std::int64_t, std::int64_t>> ranges;
    if (selector.kind == Selector::Kind::Indices)
    {
        if (selector.ranges.empty())
            throw malformed({file().path, 0, "indices"}, "there is none");
        for (const auto& [first, last] : selector.ranges)
            if (first < 0 || last < first)
                throw malformed({file().path, 0, "index"},
                                "got " + std::to_string(first) + "-" +
                                    std::to_string(last) +
                                    ", need a sample index or a range like 3-7");
        ranges = std::move(selector.ranges);
        selector.ranges = {{0, 0}};
    }
    parse(statements_text({{region}, {}}));
    if (!ranges.empty())
        parser_->file().stages.back().regions.back().selector.ranges = std::move(ranges);
}

void HandleBuilder::add(const OnStatement& on)
{
    parse(statements_text({{}, {}, {on}}));
}

void HandleBuilder::add(const SkeletonJoint& joint)
{
    parse(statements_text({{}, {}, {}, {joint}}));
}

void HandleBuilder::add(const FrameStatement& frame)
{
    parse(statements_text({{}, {{frame.number, {}}}}));
    parser_->file().stages.back().frames.back().time = frame.time;
}

void HandleBuilder::add(const Move& move)
{
    parse(statement_text(move));
}

void HandleBuilder::commit()
{
    parse("commit");
}

HandleFile parse_handles(const std::string& path, std::string_view text,
                         std::vector<SkeletonJoint> joints)
{
    HandleBuilder builder(path, text, std::move(joints));
    return std::move(builder.parser_->file());
}

Stage parse_statements(const std::string& where, std::string_view text)
{
    Stage stage;
    LineReader lines(text, 0, true);
    for (std::string_view line; lines.next(line);)
    {
        // They are of no file, so they know no line of it.
        constexpr std::int64_t no_line = 0;
        Statement words(where, lines.line_number(), line);
        const std::string keyword = words.word("statement");
        if (const std::optional<Role> role = role_named(keyword))
            stage.regions.push_back(parse_region(*role, words, "", no_line));
        else if (keyword == "on")
            stage.ons.push_back(parse_on(words, no_line));
        else if (keyword == "frame")
            stage.frames.push_back(parse_frame(words, no_line));
        else if ((keyword == "move" || keyword == "release") && !stage.frames.empty())
            stage.frames.back().moves.push_back(
                parse_move(words, no_line, keyword == "release"));
        else
            words.fail("", "unknown statement (got " + in_quotes(keyword) + ")");
    }
    return stage;
}

HandleFile read_handles(const std::string& path, std::vector<SkeletonJoint> joints)
{
    return parse_handles(path, read_file(path), std::move(joints));
}

} // namespace cellwarp::core
