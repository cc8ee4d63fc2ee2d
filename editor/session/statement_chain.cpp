// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/statement_chain.h"

#include <bit>
#include <string_view>

namespace cellwarp
{

namespace
{

/// Two rounds of a multiply and a fold for each word: any bit reaches all of them.
class Print
{
public:
    /// Goes on from a value.
    explicit Print(std::uint64_t start) : value_(start) {}

    void add(std::uint64_t word)
    {
        for (const std::uint64_t factor : {0x9e3779b97f4a7c15ull, 0xd6e8feb86659fd93ull})
        {
            value_ = (value_ ^ word) * factor;
            value_ ^= value_ >> 32;
        }
    }
    void add(double number) { add(std::bit_cast<std::uint64_t>(number)); }
    void add(std::int64_t number) { add(static_cast<std::uint64_t>(number)); }
    void add(std::string_view text)
    {
        add(std::uint64_t(text.size()));
        for (const char letter : text)
            add(std::uint64_t(static_cast<unsigned char>(letter)));
    }
    void add(const Eigen::Vector3d& v)
    {
        for (int k = 0; k < 3; ++k)
            add(v[k]);
    }
    std::uint64_t value() const { return value_; }

private:
    std::uint64_t value_;
};

template <class Kind>
std::uint64_t number_of(Kind kind)
{
    return static_cast<std::uint64_t>(kind);
}

void add(Print& print, const RegionStatement& region)
{
    const Selector& selector = region.selector;
    print.add(number_of(region.role));
    print.add(region.name);
    print.add(region.factor);
    print.add(number_of(selector.kind));
    print.add(std::uint64_t(selector.numbers.size()));
    for (const double number : selector.numbers)
        print.add(number);
    print.add(std::uint64_t(selector.ranges.size()));
    for (const auto& [first, last] : selector.ranges)
    {
        print.add(first);
        print.add(last);
    }
    print.add(selector.name);
    print.add(selector.label);
}

void add(Print& print, const FrameStatement& frame)
{
    print.add(frame.number);
    print.add(std::uint64_t(frame.moves.size()));
    for (const Move& move : frame.moves)
    {
        print.add(move.region);
        print.add(std::uint64_t(move.operations.size()));
        for (const Operation& operation : move.operations)
        {
            print.add(number_of(operation.kind));
            print.add(operation.vector);
            print.add(operation.degrees);
            print.add(std::uint64_t(operation.about.has_value()));
            if (operation.about)
                print.add(*operation.about);
            if (operation.matrix)
                for (int k = 0; k < 16; ++k)
                    print.add(operation.matrix->data()[k]);
        }
    }
}

/// Calls after(print) after the regions and after each frame.
template <class After>
void add(Print& print, const Stage& stage, After&& after)
{
    for (const RegionStatement& region : stage.regions)
        add(print, region);
    after(print);
    for (const FrameStatement& frame : stage.frames)
    {
        add(print, frame);
        after(print);
    }
}

} // namespace

StatementChain::StatementChain(const HandleFile& handles)
{
    std::uint64_t before = before_first(handles.is_relative);
    for (const Stage& stage : handles.stages)
    {
        StagePrints& prints = stages_.emplace_back();
        prints.before = before;
        Print print(before);
        add(print, stage, [&](const Print& now) { prints.after.push_back(now.value()); });
        print.add("stage");
        before = print.value();
    }
}

std::uint64_t StatementChain::before_first(bool is_relative)
{
    Print print(is_relative);
    print.add("stage");
    return print.value();
}

std::uint64_t StatementChain::before_next(std::uint64_t before, const Stage& stage)
{
    Print print(before);
    add(print, stage, [](const Print&) {});
    print.add("stage");
    return print.value();
}

} // namespace cellwarp
