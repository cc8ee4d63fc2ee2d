// SPDX-License-Identifier: GPL-3.0-or-later
// The file, little-endian:
//
//   "cwjourn\n"   8 bytes
//   version       4    of this layout; magic, version and holder stay where they are
//   holder        4    PID of the process that has it open, or had it last; unchecked
//   length        4    of the caller's text
//   checksum      4    of length and text
//   text
//   then for each record: length 4, checksum 4, number 8 (from 1), payload;
//   the checksum is that of length, number and payload.
#include "io/journal/journal.h"

#include <algorithm>
#include <bit>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "io/base/bytes.h"
#include "io/base/checksum.h"
#include "io/base/descriptor.h"
#include "io/base/error.h"
#include "io/journal/journal_records.h"

namespace cellwarp::core
{

namespace
{

static_assert(std::endian::native == std::endian::little,
              "journals are little-endian, and read and written as they are");

constexpr std::string_view kJournalMagic = "cwjourn\n";
constexpr std::uint32_t kJournalVersion = 1;

struct FileHead
{
    char magic[8];
    std::uint32_t version, holder, length, checksum;
};
static_assert(sizeof(FileHead) == 24);

/// What a crash can take with it, in time.
constexpr std::chrono::milliseconds kSyncInterval(200);

/// Read at once with a record's head: most edits are no longer [bytes].
constexpr std::size_t kShortRecord = 4096;

[[noreturn]] void fail(const std::string& path, const std::string& doing)
{
    throw Error(Fault::File, at({path.empty() ? "a temporary journal" : path, 0, ""},
                                doing + ": " + std::strerror(errno)));
}

[[noreturn]] void fail_in_use(const std::string& path, int file)
{
    FileHead head{};
    const bool is_known =
        read_at(file, 0, reinterpret_cast<char*>(&head), sizeof head) >=
            static_cast<std::int64_t>(offsetof(FileHead, length)) &&
        std::string_view(head.magic, sizeof head.magic) == kJournalMagic;
    throw InUse(
        Fault::File,
        at({path, 0, ""}, "in use by " + (is_known ? "PID " + std::to_string(head.holder)
                                                   : "another process")));
}

/// The file of this name, locked for this process until it is closed.
Descriptor open_locked(const std::string& path, int flags)
{
    for (;;)
    {
        Descriptor file(
            ::open(path.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC | flags, 0600));
        if (!file)
            fail(path, "cannot open");
        struct stat mine
        {
        };
        if (::fstat(file.get(), &mine) != 0)
            fail(path, "cannot open");
        if (!S_ISREG(mine.st_mode))
            throw Error(Fault::File, at({path, 0, ""}, "is no regular file"));
        if (::flock(file.get(), LOCK_EX | LOCK_NB) != 0)
        {
            if (errno == EWOULDBLOCK)
                fail_in_use(path, file.get());
            fail(path, "cannot lock");
        }
        // Its last holder may have removed it since it was opened here.
        struct stat now
        {
        };
        if (::stat(path.c_str(), &now) == 0 && now.st_ino == mine.st_ino &&
            now.st_dev == mine.st_dev)
            return file;
    }
}

std::string temporary_folder()
{
    const char* const folder = std::getenv("TMPDIR");
    return folder && *folder ? folder : "/tmp";
}

/// Checks the file's head; gives the caller's text.
std::string read_header(const std::string& path, int file, std::uint64_t size)
{
    if (size == 0)
        throw malformed({path, 0, ""}, "the file is empty: no journal");
    FileHead head{};
    const std::int64_t got =
        read_at(file, 0, reinterpret_cast<char*>(&head), sizeof head);
    if (got < 0)
        fail(path, "cannot read");
    if (!bytes_of(head).starts_with(kJournalMagic))
        throw malformed({path, 0, ""}, "this is no journal of cellwarp");
    const bool has_version = got >= static_cast<std::int64_t>(offsetof(FileHead, holder));
    if (has_version && head.version != kJournalVersion)
        throw malformed({path, 0, ""}, "made by version " + std::to_string(head.version) +
                                           ", need " + std::to_string(kJournalVersion));
    if (size < sizeof head || head.length > kMaxPayload ||
        head.length > size - sizeof head)
        throw malformed({path, 0, "header"}, "was cut or altered");
    std::string text(head.length, '\0');
    if (read_at(file, sizeof head, text.data(), text.size()) !=
        static_cast<std::int64_t>(text.size()))
        fail(path, "cannot read");
    if (checksum_of(text, checksum_of(bytes_of(head.length))) != head.checksum)
        throw malformed({path, 0, "header"}, "was altered");
    return text;
}

} // namespace

struct Journal::State
{
    std::string path; ///< empty: the file has no name
    Descriptor file;
    std::uint64_t first = 0; ///< where records begin [byte]
    std::uint64_t end = 0;   ///< of the last whole one [byte]
    std::uint64_t num_records = 0;
    bool is_synced = true;
    bool has_debris = false; ///< behind the end, of a write that failed
    bool is_removed = false;
    std::chrono::steady_clock::time_point last_sync = {};
    std::string buffer; ///< kept for its memory

    State() = default;
    State(const State&) = delete;
    State& operator=(const State&) = delete;
    ~State()
    {
        if (file && !is_synced)
            ::fdatasync(file.get()); // nobody is left to hear of a failure
    }

    /// What a process leaves in a file without a name is lost anyway.
    bool needs_sync() const { return !path.empty() && !is_removed; }

    bool try_sync()
    {
        is_synced = true; // also where it fails: a second call would tell nothing
        last_sync = std::chrono::steady_clock::now();
        return ::fdatasync(file.get()) == 0;
    }

    /// Back to the last whole record.
    bool drop_debris()
    {
        has_debris = ::ftruncate(file.get(), static_cast<off_t>(end)) != 0;
        return !has_debris;
    }
};

Journal::Journal(std::unique_ptr<State> state) : state_(std::move(state)) {}
Journal::~Journal() = default;
Journal::Journal(Journal&&) noexcept = default;
Journal& Journal::operator=(Journal&&) noexcept = default;

Journal Journal::create(const std::string& path, std::string_view header)
{
    if (header.size() > kMaxPayload)
        throw Error(Fault::File, at({path, 0, "header"}, "is too long for a journal"));
    auto state = std::make_unique<State>();
    state->path = path;
    state->file =
        path.empty() ? open_unnamed(temporary_folder()) : open_locked(path, O_CREAT);
    FileHead head{{},
                  kJournalVersion,
                  static_cast<std::uint32_t>(::getpid()),
                  static_cast<std::uint32_t>(header.size()),
                  0};
    std::memcpy(head.magic, kJournalMagic.data(), sizeof head.magic);
    head.checksum = checksum_of(header, checksum_of(bytes_of(head.length)));
    state->buffer.append(bytes_of(head)).append(header);
    if (::ftruncate(state->file.get(), 0) != 0 ||
        !write_at(state->file.get(), 0, state->buffer) ||
        (state->needs_sync() && !state->try_sync()))
    {
        const int why = errno;
        if (!path.empty())
            ::unlink(path.c_str());
        errno = why;
        fail(path, "cannot write");
    }
    state->first = state->end = state->buffer.size();
    if (!path.empty())
    {
        sync_folder_of(path);
    }
    return Journal(std::move(state));
}

Journal Journal::open(const std::string& path, JournalContents& contents)
{
    contents = {};
    auto state = std::make_unique<State>();
    state->path = path;
    state->file = open_locked(path, 0);
    struct stat status
    {
    };
    if (::fstat(state->file.get(), &status) != 0)
        fail(path, "cannot read");
    const std::uint64_t size = static_cast<std::uint64_t>(status.st_size);
    contents.header = read_header(path, state->file.get(), size);
    state->first = state->end = sizeof(FileHead) + contents.header.size();
    WholeRecords records = whole_records(path, state->file.get(), state->first, size);
    state->end = records.end;
    state->num_records = records.starts.size();
    contents.starts = std::move(records.starts);
    if (state->end < size)
    {
        contents.warnings.push_back(
            at({path, 0, ""}, "was cut at byte " + std::to_string(size) + ": " +
                                  std::to_string(state->num_records) +
                                  " whole records are kept"));
        if (!state->drop_debris() || !state->try_sync())
            fail(path, "cannot write");
    }
    const std::uint32_t holder = static_cast<std::uint32_t>(::getpid());
    if (!write_at(state->file.get(), offsetof(FileHead, holder), bytes_of(holder)))
        fail(path, "cannot write");
    return Journal(std::move(state));
}

std::uint64_t Journal::append(std::string_view payload)
{
    State& state = *state_;
    if (state.is_removed)
        throw Error(Fault::File, at({state.path, 0, ""}, "was removed"));
    if (payload.size() > kMaxPayload)
        throw Error(Fault::File,
                    at({state.path, 0, ""}, "a record is too long for a journal"));
    if (state.has_debris && !state.drop_debris())
        fail(state.path, "cannot write");
    RecordHead head{static_cast<std::uint32_t>(payload.size()), 0, state.num_records + 1};
    head.checksum = checksum_of(payload, checksum_of_head(head.length, head.number));
    state.buffer.clear();
    state.buffer.append(bytes_of(head)).append(payload);
    const bool is_written = write_at(state.file.get(), state.end, state.buffer);
    state.is_synced = false;
    if (!is_written ||
        (state.needs_sync() &&
         std::chrono::steady_clock::now() - state.last_sync >= kSyncInterval &&
         !state.try_sync()))
    {
        const int why = errno;
        state.drop_debris();
        errno = why;
        fail(state.path, "cannot write");
    }
    const std::uint64_t start = state.end;
    state.end += state.buffer.size();
    ++state.num_records;
    return start;
}

void Journal::sync()
{
    if (state_->needs_sync() && !state_->is_synced && !state_->try_sync())
        fail(state_->path, "cannot write");
}

std::string Journal::read(std::uint64_t start) const
{
    const State& state = *state_;
    const auto refuse = [&](const std::string& what) {
        throw malformed({state.path, 0, "record at byte " + std::to_string(start)}, what);
    };
    if (start < state.first || start > state.end ||
        state.end - start < sizeof(RecordHead))
        refuse("there is none");
    char first[kShortRecord];
    const std::int64_t got = read_at(state.file.get(), start, first,
                                     static_cast<std::size_t>(std::min<std::uint64_t>(
                                         sizeof first, state.end - start)));
    if (got < 0)
        fail(state.path, "cannot read");
    RecordHead head{};
    if (got >= static_cast<std::int64_t>(sizeof head))
        std::memcpy(&head, first, sizeof head);
    if (got < static_cast<std::int64_t>(sizeof head) ||
        head.length > state.end - start - sizeof head)
        refuse("was altered");
    std::string payload(head.length, '\0');
    const std::size_t at_hand =
        std::min(payload.size(), static_cast<std::size_t>(got) - sizeof head);
    std::memcpy(payload.data(), first + sizeof head, at_hand);
    const std::int64_t more = read_at(state.file.get(), start + sizeof head + at_hand,
                                      payload.data() + at_hand, payload.size() - at_hand);
    if (more < 0)
        fail(state.path, "cannot read");
    if (static_cast<std::size_t>(more) != payload.size() - at_hand ||
        checksum_of(payload, checksum_of_head(head.length, head.number)) != head.checksum)
        refuse("was altered");
    return payload;
}

void Journal::check_free(const std::string& path)
{
    struct stat file
    {
    };
    if (::stat(path.c_str(), &file) == 0)
        open_locked(path, 0);
}

std::string Journal::keep_aside(const std::string& path)
{
    for (int number = 1;; ++number)
    {
        const std::string aside =
            path + ".kept" + (number == 1 ? "" : std::to_string(number));
        // An empty file takes the name, so that nobody else's is replaced; not every file
        // system has a second name for a file, or a rename that replaces none.
        const Descriptor taken(
            ::open(aside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
        if (!taken && errno == EEXIST)
            continue;
        if (!taken)
            fail(path, "cannot keep aside");
        if (::rename(path.c_str(), aside.c_str()) == 0)
            return aside;
        const int why = errno;
        ::unlink(aside.c_str());
        errno = why;
        fail(path, "cannot keep aside");
    }
}

void Journal::move_to(const std::string& path)
{
    if (state_->path.empty() || state_->is_removed || path == state_->path)
        return;
    struct stat file
    {
    };
    if (::stat(path.c_str(), &file) == 0)
    {
        check_free(path);
        keep_aside(path);
    }
    if (::rename(state_->path.c_str(), path.c_str()) != 0)
        fail(state_->path, "cannot rename");
    state_->path = path;
}

void Journal::remove()
{
    if (state_->is_removed)
        return;
    state_->is_removed = state_->is_synced = true;
    if (!state_->path.empty() && ::unlink(state_->path.c_str()) != 0 && errno != ENOENT)
        fail(state_->path, "cannot remove");
}

const std::string& Journal::path() const
{
    return state_->path;
}

} // namespace cellwarp::core
