// SPDX-License-Identifier: GPL-3.0-or-later
// Handle files the other way: values as text that reads back the same.
#include <algorithm>

#include "io/base/number.h"
#include "io/base/relative_name.h"
#include "io/base/text.h"
#include "io/scene/handle_file.h"

namespace cellwarp::core
{

namespace
{

/// Indices of a region go on in a further statement before a line is longer than this
/// [bytes]: lines that editors and people can still read.
constexpr std::size_t kLongLine = 500;

/// Writes statements one by one.
class Printer
{
public:
    /// For a file at \p path; null: each statement in one line, names of files as they
    /// are.
    explicit Printer(const std::string* path) : path_(path) {}

    /// Regions, ons and frames.
    void stage(const Stage& stage)
    {
        for (const RegionStatement& region : stage.regions)
            this->region(region);
        for (const OnStatement& on : stage.ons)
            this->on(on);
        for (const SkeletonJoint& joint : stage.joints)
            this->joint(joint);
        for (const FrameStatement& frame : stage.frames)
        {
            word("frame");
            word(std::to_string(frame.number));
            end();
            for (const Move& move : frame.moves)
                this->move(move);
        }
    }
    void move(const Move& move)
    {
        word(move.released ? "release" : "move");
        name(move.region);
        switch (move.place.kind)
        {
        case MovePlace::Kind::Whole:
            break;
        case MovePlace::Kind::Point:
            word("point");
            word(std::to_string(move.place.point));
            break;
        case MovePlace::Kind::Start:
            word("start");
            break;
        case MovePlace::Kind::End:
            word("end");
            break;
        }
        if (move.released && *move.released != HoldParts{true, true, true})
        {
            if (move.released->place)
                word("place");
            if (move.released->tangent)
                word("tangent");
            if (move.released->twist)
                word("twist");
        }
        for (const Operation& operation : move.operations)
            this->operation(operation);
        if (!move.chain.empty())
        {
            word("from");
            name(move.chain);
        }
        end();
    }
    void word(std::string_view text)
    {
        text_ += is_line_begun_ ? " " : "";
        text_ += text;
        is_line_begun_ = true;
    }
    void end()
    {
        text_ += '\n';
        line_start_ = text_.size();
        is_line_begun_ = false;
    }
    std::string take() { return std::move(text_); }

private:
    void region(const RegionStatement& region)
    {
        begin(region);
        if (region.spline)
            return spline(*region.spline);
        const Selector& selector = region.selector;
        switch (selector.kind)
        {
        case Selector::Kind::Box:
            word("box");
            break;
        case Selector::Kind::Sphere:
            word("sphere");
            break;
        case Selector::Kind::Capsule:
            word("capsule");
            break;
        case Selector::Kind::Halfspace:
            word("halfspace");
            break;
        case Selector::Kind::Indices:
            ranges(region);
            break;
        case Selector::Kind::Labels:
            word("labels");
            name(path_ ? relative_name(*path_, selector.name) : selector.name);
            word(std::to_string(selector.label));
            break;
        case Selector::Kind::Group:
            word("group");
            name(selector.name);
            break;
        case Selector::Kind::All:
            word("all");
            break;
        case Selector::Kind::Spline:
            break;
        }
        for (const double value : selector.numbers)
            number(value);
        factor(region);
        end();
    }
    void on(const OnStatement& on)
    {
        word("on");
        name(on.pin);
        name(on.guide);
        if (on.at)
        {
            word("at");
            number(*on.at);
        }
        end();
    }
    void joint(const SkeletonJoint& joint)
    {
        word("joint");
        name(joint.name);
        word("at");
        vector(joint.at);
        if (!joint.parent.empty())
        {
            word("parent");
            name(joint.parent);
        }
        if (joint.hinge)
        {
            word("hinge");
            vector(*joint.hinge);
        }
        if (joint.twist)
        {
            word("twist");
            number((*joint.twist)[0]);
            number((*joint.twist)[1]);
        }
        if (joint.swing)
        {
            word("swing");
            number(*joint.swing);
        }
        if (joint.radius)
        {
            word("radius");
            number(*joint.radius);
        }
        end();
    }
    void begin(const RegionStatement& region)
    {
        word(role_name(region.role));
        name(region.name);
    }
    void spline(const SplineStatement& spline)
    {
        using Form = SplineStatement::Form;
        word(spline.form == Form::Through  ? "through"
             : spline.form == Form::Points ? "points"
                                           : "from skeleton");
        if (!spline.near.empty())
        {
            word("near");
            name(spline.near);
        }
        for (const Eigen::Vector3d& point : spline.points)
            vector(point);
        if (spline.is_closed)
            word("closed");
        if (spline.spans != SplineStatement().spans)
        {
            word("spans");
            word(std::to_string(spline.spans));
        }
        for (const double radius : spline.radii)
        {
            word("radius");
            number(radius);
        }
        if (spline.stiffness)
        {
            word("stiffness");
            number(*spline.stiffness);
        }
        if (spline.is_exact)
            word("exact");
        end();
    }
    void ranges(const RegionStatement& region)
    {
        word("indices");
        for (const auto& [first, last] : region.selector.ranges)
        {
            if (path_ && text_.size() - line_start_ > kLongLine)
            {
                factor(region);
                end();
                begin(region);
                word("indices");
            }
            word(std::to_string(first) +
                 (last > first ? "-" + std::to_string(last) : ""));
        }
    }
    void factor(const RegionStatement& region)
    {
        if (region.role != Role::Stiff)
            return;
        if (region.selector.kind == Selector::Kind::Indices)
            word("factor");
        number(region.factor);
    }
    void operation(const Operation& operation)
    {
        switch (operation.kind)
        {
        case Operation::Kind::Translate:
            word("translate");
            vector(operation.move.translation);
            break;
        case Operation::Kind::To:
            word("to");
            vector(operation.vector);
            break;
        case Operation::Kind::Rotate:
            word("rotate");
            vector(operation.move.axis);
            number(operation.move.degrees);
            if (operation.move.pivot)
            {
                word("about");
                vector(*operation.move.pivot);
            }
            if (operation.is_about_border)
            {
                word("about");
                word("border");
            }
            break;
        case Operation::Kind::Matrix:
            word("matrix");
            for (Eigen::Index row = 0; row < 4; ++row)
                for (Eigen::Index column = 0; column < 4; ++column)
                    number((*operation.matrix)(row, column));
            break;
        case Operation::Kind::Turn:
            word("turn");
            number(operation.move.degrees);
            break;
        case Operation::Kind::Tangent:
            word("tangent");
            vector(operation.vector);
            break;
        }
    }
    void name(const std::string& text)
    {
        if (!is_handle_name(text))
            throw Error(Fault::Usage, at({path_ ? *path_ : "", 0, ""},
                                         "cannot hold the name " + in_quotes(text) +
                                             ": it has a line break or a double quote"));
        const bool is_plain = !text.empty() && text.front() != '"' &&
                              std::none_of(text.begin(), text.end(), is_end_of_word);
        word(is_plain ? text : '"' + text + '"');
    }
    void number(double value) { word(shortest(value)); }
    void vector(const Eigen::Vector3d& v)
    {
        for (const double value : v)
            number(value);
    }

    const std::string* path_;
    std::string text_;
    std::size_t line_start_ = 0;
    bool is_line_begun_ = false;
};

} // namespace

bool is_handle_name(std::string_view name)
{
    const bool is_quoted =
        name.starts_with('"') || std::any_of(name.begin(), name.end(), is_end_of_word);
    return name.find_first_of(std::string_view("\n\r\0", 3)) == std::string_view::npos &&
           !(is_quoted && name.find('"') != std::string_view::npos);
}

std::string statements_text(const Stage& part)
{
    Printer printer(nullptr);
    printer.stage(part);
    return printer.take();
}

std::string statement_text(const Move& move)
{
    Printer printer(nullptr);
    printer.move(move);
    return printer.take();
}

std::string handle_text(const HandleFile& file)
{
    Printer printer(&file.path);
    printer.word("cellwarp-handles 1");
    printer.end();
    if (file.save && is_handle_name(file.save->scene))
    {
        printer.word("# save " + file.save->print + " of " + file.save->scene);
        printer.end();
    }
    if (file.is_relative)
    {
        printer.word("units relative");
        printer.end();
    }
    for (std::size_t s = 0; s < file.stages.size(); ++s)
    {
        if (s > 0)
        {
            printer.word("commit");
            printer.end();
        }
        printer.stage(file.stages[s]);
    }
    return printer.take();
}

} // namespace cellwarp::core
