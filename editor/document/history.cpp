// SPDX-License-Identifier: GPL-3.0-or-later
// A record of the journal is an edit, or "at N": from here on N edits are done, or
// "closed WORD": the document ended here, and its files say what it does at this place,
// or "kept WORD": it ended here, and its files do not. An edit that comes after an undo
// takes the place of what was undone.
#include "editor/document/history.h"

#include <algorithm>
#include <cassert>
#include <charconv>
#include <variant>

#include "io/base/error.h"

namespace cellwarp::core
{

namespace
{

constexpr std::string_view kMoved = "at ", kClosed = "closed ", kKept = "kept ";

bool changes_content(const Edit& edit)
{
    return std::any_of(edit.changes.begin(), edit.changes.end(),
                       [](const Change& change)
                       { return !std::holds_alternative<Toggled>(change); });
}

} // namespace

History::History(Journal journal) : journal_(std::move(journal)) {}

History::History(Journal journal, const JournalContents& contents)
    : journal_(std::move(journal))
{
    for (std::size_t r = 0; r < contents.starts.size(); ++r)
    {
        const std::uint64_t start = contents.starts[r];
        const std::string text = journal_.read(start);
        if (text.starts_with(kClosed))
        {
            closed_content_ = content();
            continue;
        }
        if (text.starts_with(kKept))
            continue;
        const std::string where = journal_.path() + ": record " + std::to_string(r + 1);
        if (!text.starts_with(kMoved))
        {
            append(start, parse_edit(text, where));
            continue;
        }
        const char* const end = text.data() + text.size();
        std::size_t position = 0;
        const auto read = std::from_chars(text.data() + kMoved.size(), end, position);
        if (read.ec != std::errc() || read.ptr != end || position > size())
            throw malformed({where, 0, ""}, "is no place in the history");
        position_ = position;
    }
}

void History::append(std::uint64_t start, const Edit& edit)
{
    names_.resize(position_);
    starts_.resize(position_);
    contents_.resize(position_);
    const std::uint32_t before = content();
    names_.push_back(&*words_.insert(edit.name).first);
    starts_.push_back(start);
    contents_.push_back(changes_content(edit) ? ++last_content_ : before);
    ++position_;
}

void History::add(const Edit& edit)
{
    append(journal_.append(edit_text(edit)), edit);
}

Edit History::edit(std::size_t index) const
{
    return parse_edit(journal_.read(starts_[index]),
                      journal_.path() + ": edit " + std::to_string(index + 1));
}

void History::close(const std::string& word)
{
    journal_.append(std::string(kClosed) + word);
    journal_.sync();
}

void History::keep(const std::string& word)
{
    journal_.append(std::string(kKept) + word);
    journal_.sync();
}

History::End History::end_of(const Journal& journal, const JournalContents& contents)
{
    End end;
    for (std::size_t r = contents.starts.size(); r-- > 0;)
    {
        const std::string text = journal.read(contents.starts[r]);
        if (text.starts_with(kClosed))
        {
            end.word = end.word.value_or(text.substr(kClosed.size()));
            break;
        }
        if (!text.starts_with(kKept))
            ++end.records_after;
        else if (!end.word)
        {
            end.word = text.substr(kKept.size());
            end.is_kept = r + 1 == contents.starts.size();
        }
    }
    return end;
}

std::optional<std::size_t> History::position_of(std::uint32_t content) const
{
    for (std::size_t position = size() + 1; position-- > 0;)
        if (content_at(position) == content)
            return position;
    return std::nullopt;
}

void History::move_to(std::size_t position)
{
    assert(position <= size());
    if (position == position_)
        return;
    journal_.append(std::string(kMoved) + std::to_string(position));
    position_ = position;
}

} // namespace cellwarp::core
