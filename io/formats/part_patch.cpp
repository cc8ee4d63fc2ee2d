// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/part_patch.h"

#include <algorithm>
#include <array>
#include <optional>

#include "io/formats/packed.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
{

namespace
{

/// One number to replace.
struct Edit
{
    std::uint64_t start;
    std::size_t length; ///< of the old one [bytes]
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
    bool is_empty() const { return after_.empty(); }
    /// Whether its numbers have fixed lengths.
    bool is_binary() const
    {
        const auto end = places_.scalars.begin() + static_cast<long>(places_.length);
        return std::all_of(places_.scalars.begin(), end,
                           [](Scalar scalar) { return stored_size(scalar) > 0; });
    }
    std::uint64_t start() const { return starts_[order_[next_]]; }
    bool changes() const
    {
        const std::size_t number = first_ + order_[next_];
        return differs(before_[number], after_[number]);
    }
    Edit edit() const { return edit(first_ + order_[next_], start()); }
    void advance()
    {
        if (++next_ == places_.length)
        {
            next_ = 0;
            first_ += places_.length;
            load();
        }
    }
    /// Goes on to the first number at \p byte or behind it.
    void skip_to(std::uint64_t byte)
    {
        std::size_t low = first_ / places_.length, high = after_.size() / places_.length;
        while (low < high)
        {
            const std::size_t middle = low + (high - low) / 2;
            if (places_.start(last_number(middle)) < byte)
                low = middle + 1;
            else
                high = middle;
        }
        if (first_ != low * places_.length)
        {
            first_ = low * places_.length;
            next_ = 0;
            load();
        }
        while (!is_done() && start() < byte)
            advance();
    }
    /// The last number's; not of an empty list.
    Edit last() const
    {
        const std::size_t number = last_number(after_.size() / places_.length - 1);
        return edit(number, places_.start(number));
    }

private:
    Edit edit(std::size_t number, std::uint64_t start) const
    {
        const Scalar scalar = places_.scalars[number % places_.length];
        const std::size_t size = stored_size(scalar);
        return {start, size > 0 ? size : places_.lengths[number], scalar,
                places_.big_endian, after_[number]};
    }
    /// Of all numbers the one that stands last in a vector.
    std::size_t last_number(std::size_t vector) const
    {
        const std::size_t first = vector * places_.length;
        std::size_t last = first;
        for (std::size_t number = first; number < first + places_.length; ++number)
            if (places_.start(number) > places_.start(last))
                last = number;
        return last;
    }
    void load()
    {
        if (is_done())
            return;
        places_.starts_of(first_ / places_.length, starts_.data());
        const auto end = order_.begin() + static_cast<long>(places_.length);
        const auto is_before = [&](std::size_t a, std::size_t b)
        { return starts_[a] < starts_[b]; };
        if (!std::is_sorted(order_.begin(), end, is_before)) // mostly it stays
            std::sort(order_.begin(), end, is_before);
    }

    const ByteOffsets& places_;
    std::span<const double> before_, after_;
    std::array<std::uint64_t, 4> starts_ = {}; ///< of the vector
    std::array<std::size_t, 4> order_ = {0, 1, 2, 3};
    std::size_t first_ = 0; ///< number of the vector
    std::size_t next_ = 0;  ///< in order_
};

/// Those of all lists that change.
using EditStreams = std::array<EditStream, 4>;

EditStreams edit_streams(const Geometry& geometry, const PartPatch& patch)
{
    return {EditStream(geometry.sample_places, numbers_of(geometry.samples),
                       numbers_of(patch.samples)),
            EditStream(geometry.direction_places, numbers_of(geometry.directions),
                       numbers_of(patch.directions)),
            EditStream(geometry.tangent_places, numbers_of(geometry.tangents),
                       numbers_of(patch.tangents)),
            EditStream(geometry.rotation_places, numbers_of(geometry.rotations),
                       numbers_of(patch.rotations))};
}

constexpr std::uint64_t kNoByte = ~std::uint64_t(0);

/// The stream whose next number comes first.
EditStream& next_of(EditStreams& streams)
{
    const auto start_of = [](const EditStream& stream)
    { return stream.is_done() ? kNoByte : stream.start(); };
    return *std::min_element(streams.begin(), streams.end(),
                             [&](const EditStream& a, const EditStream& b)
                             { return start_of(a) < start_of(b); });
}

/// Whether all numbers keep their length.
bool is_binary(const EditStreams& streams)
{
    return std::all_of(streams.begin(), streams.end(),
                       [](const EditStream& stream)
                       { return stream.is_empty() || stream.is_binary(); });
}

/// Puts numbers of fixed lengths into a copy of the bytes from byte \p from of the file
/// on.
void overwrite(const std::string& path, EditStreams& streams, std::uint64_t from,
               std::span<char> copy)
{
    std::optional<Edit> too_large; // the first in the file
    for (EditStream& stream : streams)
        for (; !stream.is_done() && stream.start() < from + copy.size(); stream.advance())
        {
            if (!stream.changes())
                continue;
            const Edit edit = stream.edit();
            if (!overwrite_stored(edit.value, edit.scalar, edit.big_endian,
                                  &copy[edit.start - from]) &&
                !(too_large && too_large->start < edit.start))
                too_large = edit;
        }
    if (too_large)
        throw does_not_fit(path, too_large->start, too_large->value);
}

} // namespace

PatchedBytes::PatchedBytes(const std::string& path, std::string_view bytes,
                           std::uint64_t start, const Geometry& geometry,
                           const PartPatch& patch)
    : path_(path), bytes_(bytes), start_(start), geometry_(geometry), patch_(patch),
      end_(start)
{
    for (const EditStream& stream : edit_streams(geometry, patch))
        if (!stream.is_done())
        {
            const Edit last = stream.last();
            end_ = std::max(end_, last.start + last.length);
        }
    if (!patch.indices.empty())
        end_ = std::max(end_, patch.indices.back().start + patch.indices.back().length);
}

/// Number of the first index to replace that stands at \p byte or behind it.
std::size_t PatchedBytes::index_at(std::uint64_t byte) const
{
    const auto found = std::lower_bound(
        patch_.indices.begin(), patch_.indices.end(), byte,
        [](const IndexEdit& edit, std::uint64_t place) { return edit.start < place; });
    return static_cast<std::size_t>(found - patch_.indices.begin());
}

std::vector<std::uint64_t> PatchedBytes::cuts(std::uint64_t length) const
{
    std::vector<std::uint64_t> cuts = {start_};
    length = std::max(length, std::uint64_t(1));
    EditStreams streams = edit_streams(geometry_, patch_);
    while (end_ - cuts.back() > length)
    {
        const std::uint64_t least = cuts.back() + length;
        for (EditStream& stream : streams)
            stream.skip_to(least);
        const EditStream& next = next_of(streams);
        const std::size_t index = index_at(least);
        const std::uint64_t cut = std::min(
            {end_, next.is_done() ? kNoByte : next.start(),
             index == patch_.indices.size() ? kNoByte : patch_.indices[index].start});
        if (cut == end_)
            break;
        cuts.push_back(cut);
    }
    cuts.push_back(end_);
    return cuts;
}

void PatchedBytes::append_to(std::string& out) const
{
    append_to(out, start_, end_);
    out.append(tail());
}

void PatchedBytes::append_to(std::string& out, std::uint64_t from, std::uint64_t to) const
{
    EditStreams streams = edit_streams(geometry_, patch_);
    for (EditStream& stream : streams)
        stream.skip_to(from);
    if (patch_.indices.empty() && is_binary(streams))
    {
        const std::size_t first = out.size();
        out.append(bytes_.substr(from - start_, to - from));
        overwrite(path_, streams, from, std::span(out).subspan(first));
        return;
    }
    std::uint64_t copied = from;
    const auto put = [&](std::uint64_t place, std::size_t length, std::string_view text)
    {
        out.append(bytes_.substr(copied - start_, place - copied));
        out.append(text);
        copied = place + length;
    };
    std::string text;
    const auto apply = [&](const Edit& edit)
    {
        text.clear();
        if (!store(edit.value, edit.scalar, edit.big_endian, text))
            throw does_not_fit(path_, edit.start, edit.value);
        put(edit.start, edit.length, text);
    };
    std::size_t index = index_at(from);
    for (;;)
    {
        EditStream& stream = next_of(streams);
        const std::uint64_t number = stream.is_done() ? kNoByte : stream.start();
        const std::uint64_t i =
            index == patch_.indices.size() ? kNoByte : patch_.indices[index].start;
        if (std::min(number, i) >= to)
            break;
        if (i < number)
        {
            const IndexEdit& edit = patch_.indices[index++];
            put(i, edit.length, std::to_string(edit.index));
            continue;
        }
        if (stream.changes())
            apply(stream.edit());
        stream.advance();
    }
    out.append(bytes_.substr(copied - start_, to - copied));
}

} // namespace cellwarp::core
