// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/part_patch.h"

#include <algorithm>
#include <array>

#include "io/packed.h"
#include "io/stored_number.h"
#include "io/text.h"

namespace cellwarp
{

namespace
{

/// One number to replace.
struct Edit
{
    std::uint64_t start;
    Scalar scalar;
    bool big_endian;
    double value;
};

/// Numbers of a list of vectors in the order of their places. Vectors stand one
/// after the other; within one the components may stand in any order (PLY).
class EditStream
{
public:
    EditStream(const ByteOffsets& places, std::span<const double> before,
               std::span<const double> after)
        : places_(places), before_(before), after_(after)
    {
        load();
    }
    bool is_done() const { return first_ == after_.size(); }
    std::uint64_t start() const { return places_.starts[first_ + order_[next_]]; }
    bool changes() const
    {
        return before_[first_ + order_[next_]] != after_[first_ + order_[next_]];
    }
    Edit edit() const
    {
        return {start(), places_.scalars[order_[next_]], places_.big_endian,
                after_[first_ + order_[next_]]};
    }
    void advance()
    {
        if (++next_ == places_.length)
        {
            next_ = 0;
            first_ += places_.length;
            load();
        }
    }

private:
    void load()
    {
        if (is_done())
            return;
        const std::uint64_t* starts = &places_.starts[first_];
        if (std::is_sorted(
                order_.begin(), order_.begin() + static_cast<long>(places_.length),
                [&](std::size_t a, std::size_t b) { return starts[a] < starts[b]; }))
            return; // as in the last vector
        std::sort(order_.begin(), order_.begin() + static_cast<long>(places_.length),
                  [&](std::size_t a, std::size_t b) { return starts[a] < starts[b]; });
    }

    const ByteOffsets& places_;
    std::span<const double> before_, after_;
    std::array<std::size_t, 4> order_ = {0, 1, 2, 3};
    std::size_t first_ = 0; ///< number of the vector
    std::size_t next_ = 0;  ///< in order_
};

/// Length of the number or index at \p start: what none of the formats has in one
/// ends it.
std::size_t token_length(std::string_view bytes, std::uint64_t start)
{
    static constexpr std::string_view ends = "\n\r\\/,;\"";
    std::size_t end = start;
    while (end < bytes.size() && !is_blank(bytes[end]) &&
           ends.find(bytes[end]) == std::string_view::npos)
        ++end;
    return end - start;
}

} // namespace

void append_patched(const std::string& path, std::string_view bytes, std::uint64_t start,
                    const Geometry& geometry, const PartPatch& patch, std::string& out)
{
    std::uint64_t copied = start;
    const auto replace =
        [&](std::uint64_t place, std::size_t length, std::string_view text)
    {
        out.append(bytes.substr(copied - start, place - copied));
        out.append(text);
        copied = place + length;
    };
    std::string text;
    const auto apply = [&](const Edit& edit)
    {
        text.clear();
        if (!store(edit.value, edit.scalar, edit.big_endian, text))
            throw does_not_fit(path, edit.start, edit.value);
        const std::size_t size = stored_size(edit.scalar);
        replace(edit.start, size > 0 ? size : token_length(bytes, edit.start - start),
                text);
    };
    std::array<EditStream, 4> streams = {
        EditStream(geometry.sample_places, numbers_of(geometry.samples),
                   numbers_of(patch.samples)),
        EditStream(geometry.direction_places, numbers_of(geometry.directions),
                   numbers_of(patch.directions)),
        EditStream(geometry.tangent_places, numbers_of(geometry.tangents),
                   numbers_of(patch.tangents)),
        EditStream(geometry.rotation_places, numbers_of(geometry.rotations),
                   numbers_of(patch.rotations))};
    std::size_t index = 0;
    constexpr std::uint64_t kEnd = ~std::uint64_t(0);
    for (;;)
    {
        const auto start_of = [](const EditStream& stream)
        { return stream.is_done() ? kEnd : stream.start(); };
        EditStream& stream =
            *std::min_element(streams.begin(), streams.end(),
                              [&](const EditStream& a, const EditStream& b)
                              { return start_of(a) < start_of(b); });
        const std::uint64_t i =
            index == patch.index_starts.size() ? kEnd : patch.index_starts[index];
        const std::uint64_t first = std::min(start_of(stream), i);
        if (first == kEnd)
            break;
        if (first == i)
        {
            replace(i, token_length(bytes, i - start),
                    std::to_string(patch.new_indices[index]));
            ++index;
            continue;
        }
        if (stream.changes())
            apply(stream.edit());
        stream.advance();
    }
    out.append(bytes.substr(copied - start));
}

} // namespace cellwarp
