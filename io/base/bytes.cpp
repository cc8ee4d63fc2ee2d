// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/bytes.h"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <mutex>
#include <set>
#include <utility>

#include <dirent.h>
#include <fcntl.h>
#include <limits.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "io/base/error.h"

namespace cellwarp::core
{

/// A temporary that exists now. Entries are only ever added and used again, because a
/// signal handler walks the list: one is claimed by a thread, then has a name, then is
/// listed.
struct TemporaryName
{
    std::atomic<bool> is_claimed = true, is_listed = false;
    char path[PATH_MAX];
    TemporaryName* next = nullptr;
};

namespace
{

std::atomic<TemporaryName*> temporaries;

TemporaryName* claim_temporary_name()
{
    for (TemporaryName* name = temporaries.load(); name; name = name->next)
        if (!name->is_claimed.exchange(true))
            return name;
    TemporaryName* const name = new TemporaryName;
    name->next = temporaries.load();
    while (!temporaries.compare_exchange_weak(name->next, name))
        ;
    return name;
}

void free_name(TemporaryName*& name)
{
    if (!name)
        return;
    name->is_listed.store(false);
    name->is_claimed.store(false);
    name = nullptr;
}

namespace fs = std::filesystem;

/// Bytes gathered before a write call: large enough that the calls cost nothing.
constexpr std::size_t kBufferBytes = std::size_t(1) << 20;

std::atomic<bool> writes_to_stdout;

Error file_error(const std::string& path, const std::string& what)
{
    return Error(Fault::File, at({path, 0, ""}, what));
}

std::string reason()
{
    return std::strerror(errno);
}

/// Follows symbolic links to the file that a save must replace.
std::string resolve(const std::string& path)
{
    std::error_code ignored;
    if (!fs::is_symlink(fs::symlink_status(path, ignored)))
        return path;
    char resolved[PATH_MAX];
    if (::realpath(path.c_str(), resolved))
        return resolved;
    const fs::path link = fs::read_symlink(path, ignored);
    return link.is_absolute() ? link.string()
                              : (fs::path(path).parent_path() / link).string();
}

/// The rights that new files do not get. umask() would set the mask to return it, for all
/// threads of the process: the kernel's list has it without. 022 where there is no list.
mode_t file_mask()
{
    static const mode_t mask = []
    {
        std::ifstream status("/proc/self/status");
        std::string key;
        unsigned value = 022;
        while (status >> key && key != "Umask:")
            status.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
        return status >> std::oct >> value ? mode_t(value) : mode_t(022);
    }();
    return mask;
}

/// Whether a call failed because the file system or the kernel does not have it.
bool is_lacking()
{
    return errno == EINVAL || errno == ENOSYS || errno == EOPNOTSUPP;
}

/// A rename that replaces nothing. False and errno where it fails: EEXIST where the new
/// name is taken.
bool rename_to_free_name(const char* from, const char* to)
{
    if (::renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_NOREPLACE) == 0)
        return true;
    if (!is_lacking())
        return false;
    // The file gets a second name, which fails where that is taken, and loses the first
    // one.
    if (::link(from, to) == 0)
    {
        ::unlink(from);
        return true;
    }
    if (errno != EPERM && !is_lacking())
        return false;
    // Nor has it second names: between the look and the rename is a gap.
    struct stat status
    {
    };
    if (::lstat(to, &status) == 0)
    {
        errno = EEXIST;
        return false;
    }
    return ::rename(from, to) == 0;
}

bool is_same_file(int file, const char* name)
{
    struct stat open_file
    {
    }, named{};
    return ::fstat(file, &open_file) == 0 && ::stat(name, &named) == 0 &&
           open_file.st_dev == named.st_dev && open_file.st_ino == named.st_ino;
}

/// False and errno where two files could not exchange their names.
bool exchange(const char* from, const char* to)
{
    return ::renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_EXCHANGE) == 0;
}

/// How temporaries are called: one of these, then what makes the name the only one.
constexpr std::string_view kSaveName = ".cellwarp-save-", kSpillName = ".cellwarp-spill-";
constexpr std::string_view kUnique = "XXXXXX";

bool is_temporary_name(std::string_view name)
{
    const auto has = [&](std::string_view beginning)
    {
        return name.starts_with(beginning) &&
               name.size() == beginning.size() + kUnique.size() &&
               std::all_of(name.begin() + static_cast<std::ptrdiff_t>(beginning.size()),
                           name.end(),
                           [](unsigned char c) { return std::isalnum(c) != 0; });
    };
    return has(kSaveName) || has(kSpillName);
}

bool lock(int file, int how)
{
    int result = 0;
    do
        result = ::flock(file, how);
    while (result != 0 && errno == EINTR);
    return result == 0;
}

/// Removes a temporary if the process that made it no longer runs: while it does, it
/// holds a lock on it. A number of a process would tell less: it may be another one's by
/// now, or one of another machine.
void sweep(int folder, const char* name)
{
    const Descriptor file(
        ::openat(folder, name, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    struct stat status
    {
    };
    if (file && ::fstat(file.get(), &status) == 0 && S_ISREG(status.st_mode) &&
        status.st_uid == ::geteuid() && lock(file.get(), LOCK_EX | LOCK_NB))
        ::unlinkat(folder, name, 0);
}

/// Locks of files beyond these are one lock of their folder, so that a run of thousands
/// of outputs does not have thousands of open files.
constexpr int kMostFileLocks = 64;
std::atomic<int> num_file_locks;

/// Keeps others from sweeping a folder, while somebody has it; null where there are no
/// locks.
std::shared_ptr<const Descriptor> lock_of_folder(const std::string& folder)
{
    static std::mutex mutex;
    static std::map<std::string, std::weak_ptr<const Descriptor>> all;
    const std::lock_guard one_at_a_time(mutex);
    std::weak_ptr<const Descriptor>& known = all[folder];
    std::shared_ptr<const Descriptor> held = known.lock();
    if (held)
        return held;
    Descriptor opened(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!opened || !lock(opened.get(), LOCK_SH))
        return nullptr;
    known = held = std::make_shared<const Descriptor>(std::move(opened));
    return held;
}

/// Takes a file that is locked already.
std::shared_ptr<const Descriptor> kept_lock(Descriptor file, const std::string& folder)
{
    if (num_file_locks >= kMostFileLocks)
        if (std::shared_ptr<const Descriptor> of_all = lock_of_folder(folder))
            return of_all;
    ++num_file_locks;
    return {new Descriptor(std::move(file)), [](const Descriptor* lock)
            {
                delete lock;
                --num_file_locks;
            }};
}

/// Locks a file as sweep() does: what cannot be opened so is not swept.
std::shared_ptr<const Descriptor> lock_of_file(const char* name,
                                               const std::string& folder)
{
    Descriptor file(::open(name, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    if (!file)
        return nullptr;
    lock(file.get(), LOCK_EX | LOCK_NB);
    return kept_lock(std::move(file), folder);
}

/// Removes what killed runs have left in a folder, when this process first writes there.
/// Removes temporaries that killed runs left. One that cannot be removed stays; all stay
/// while a run holds the lock of the folder.
void sweep_folder(const std::string& folder)
{
    static std::mutex mutex;
    static std::set<std::string> swept;
    const std::lock_guard one_at_a_time(mutex);
    if (!swept.insert(folder).second)
        return;
    DIR* const entries = ::opendir(folder.c_str());
    if (!entries)
        return;
    if (lock(::dirfd(entries), LOCK_EX | LOCK_NB) || errno != EWOULDBLOCK)
        while (const struct dirent* entry = ::readdir(entries))
            if (is_temporary_name(entry->d_name))
                sweep(::dirfd(entries), entry->d_name);
    ::closedir(entries);
}

/// Makes a temporary and locks it, so that nobody sweeps it; none and errno if that
/// fails.
Descriptor make_temporary(std::string& name)
{
    constexpr int kTries = 16; // a sweeper may be faster than the lock, but not often
    for (int tries = 1;; ++tries)
    {
        name.replace(name.size() - kUnique.size(), kUnique.size(), kUnique);
        Descriptor file(::mkostemp(name.data(), O_CLOEXEC));
        if (!file)
            return file;
        lock(file.get(), LOCK_EX); // where there are no locks, nobody sweeps
        struct stat status
        {
        };
        if (tries == kTries || ::fstat(file.get(), &status) != 0 || status.st_nlink > 0)
            return file;
    }
}

} // namespace

std::string folder_of(const std::string& path)
{
    const std::string folder = fs::path(path).parent_path().string();
    return folder.empty() ? "." : folder;
}

void sync_folder_of(const std::string& path)
{
    const Descriptor folder(::open(folder_of(path).c_str(), O_RDONLY | O_CLOEXEC));
    if (folder)
        ::fsync(folder.get());
}

Descriptor open_unnamed(const std::string& folder)
{
    sweep_folder(folder);
    Descriptor file(::open(folder.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, 0600));
    if (file)
        return file;
    // Not every file system has files without a name.
    std::string name = folder + "/" + std::string(kSpillName) + std::string(kUnique);
    Descriptor named(::mkostemp(name.data(), O_CLOEXEC));
    if (!named)
        throw file_error("a temporary file",
                         "cannot create it in " + folder + ": " + reason());
    ::unlink(name.c_str());
    return named;
}

InputFile::InputFile(const std::string& path) : path_(path)
{
    if (path == "-")
    {
        file_ = Descriptor(::fcntl(0, F_DUPFD_CLOEXEC, 3));
        if (!file_)
            throw file_error(path, "cannot read: " + reason());
        return;
    }
    // O_NONBLOCK: opening a pipe must not wait for its other end.
    Descriptor file(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
    if (!file)
        throw file_error(path, "cannot open: " + reason());
    struct stat status
    {
    };
    if (::fstat(file.get(), &status) != 0)
        throw file_error(path, "cannot read: " + reason());
    if (S_ISDIR(status.st_mode))
        throw file_error(path, "is a directory, need a file");
    if (!S_ISREG(status.st_mode))
        throw file_error(path, "is no regular file");
    size_ = static_cast<std::uint64_t>(status.st_size);
    seconds_ = status.st_mtim.tv_sec;
    nanoseconds_ = status.st_mtim.tv_nsec;
    file_ = std::move(file);
}

std::size_t InputFile::read(char* bytes, std::size_t count)
{
    const std::int64_t got = read_next(file_.get(), bytes, count);
    if (got < 0)
        throw file_error(path_, "cannot read: " + reason());
    num_read_ += static_cast<std::uint64_t>(got);
    return static_cast<std::size_t>(got);
}

void InputFile::read_at(std::uint64_t start, char* bytes, std::size_t count) const
{
    const std::int64_t got = cellwarp::core::read_at(file_.get(), start, bytes, count);
    if (got < 0)
        throw file_error(path_, "cannot read: " + reason());
    if (static_cast<std::size_t>(got) < count)
        throw file_error(path_, "changed while it was read");
}

void InputFile::rewind()
{
    if (::lseek(file_.get(), 0, SEEK_SET) != 0)
        throw file_error(path_, "cannot read: " + reason());
    num_read_ = 0;
}

void InputFile::check_unchanged() const
{
    if (size_ == kUnknownBytes)
        return;
    struct stat now
    {
    };
    ::fstat(file_.get(), &now);
    if ((num_read_ > 0 && num_read_ != size_) ||
        size_ != static_cast<std::uint64_t>(now.st_size) ||
        seconds_ != now.st_mtim.tv_sec || nanoseconds_ != now.st_mtim.tv_nsec)
        throw file_error(path_, "changed while it was read");
}

std::string read_file(const std::string& path)
{
    InputFile file(path);
    const bool has_size = file.size() != kUnknownBytes;
    if (has_size && file.size() > kMaxFileBytes)
        throw file_error(path, "is larger than 4 GiB");
    std::string bytes;
    // One byte more than the size, so that a file that grew is noticed.
    bytes.resize(has_size ? static_cast<std::size_t>(file.size()) + 1 : kBufferBytes);
    std::size_t filled = 0;
    for (;;)
    {
        filled += file.read(bytes.data() + filled, bytes.size() - filled);
        if (filled > kMaxFileBytes)
            throw file_error(path, "is larger than 4 GiB");
        if (filled < bytes.size())
            break;
        bytes.resize(2 * bytes.size());
    }
    bytes.resize(filled);
    file.check_unchanged();
    return bytes;
}

void check_output(const std::string& path, Overwrite overwrite)
{
    if (path == "-")
        return;
    if (path.empty())
        throw file_error("''", "an output needs a name");
    const std::string target = resolve(path);
    struct stat status
    {
    };
    if (::stat(target.c_str(), &status) == 0)
    {
        if (S_ISDIR(status.st_mode))
            throw file_error(path, "is a directory, need a file");
        if (!S_ISREG(status.st_mode))
            throw file_error(path, "is no regular file, will not replace it");
        if (overwrite == Overwrite::No)
            throw file_error(path, "exists already (use --overwrite to replace it)");
        if (::access(target.c_str(), W_OK) != 0)
            throw file_error(path, "cannot write: " + reason());
    }
    else if (errno != ENOENT)
        throw file_error(path, "cannot write: " + reason());
    const std::string folder = folder_of(target);
    if (::access(folder.c_str(), W_OK | X_OK) != 0)
        throw file_error(path, "cannot write into folder " + folder + ": " + reason());
}

AtomicFile::AtomicFile(const std::string& path, Overwrite overwrite)
    : path_(path), target_(resolve(path)), overwrite_(overwrite)
{
    check_output(path, overwrite);
    buffer_.reserve(kBufferBytes);
    const std::string folder = folder_of(target_);
    sweep_folder(folder);
    temporary_ = (folder == "." ? std::string() : folder + "/") + std::string(kSaveName) +
                 std::string(kUnique);
    listed_ = claim_temporary_name();
    file_ = make_temporary(temporary_);
    if (!file_)
    {
        const int error = errno;
        temporary_.clear();
        errno = error;
        fail("cannot create a file beside it");
    }
    if (temporary_.size() < PATH_MAX)
    {
        std::memcpy(listed_->path, temporary_.c_str(), temporary_.size() + 1);
        listed_->is_listed.store(true);
    }
    struct stat old
    {
    };
    const bool existed = ::stat(target_.c_str(), &old) == 0;
    // Who may read and write, and no more: setuid bits were given to another owner's
    // file.
    if (::fchmod(file_.get(), existed ? old.st_mode & 0777 : 0666 & ~file_mask()) != 0)
        fail("cannot set its mode");
}

AtomicFile::~AtomicFile()
{
    discard();
}

void AtomicFile::discard() noexcept
{
    file_.close();
    if (!temporary_.empty())
        ::unlink(temporary_.c_str());
    temporary_.clear();
    lock_.reset();
    replaced_lock_.reset();
    free_name(listed_);
}

void AtomicFile::fail(const std::string& doing)
{
    const int error = errno;
    discard();
    errno = error;
    throw file_error(path_, doing + ": " + reason());
}

void AtomicFile::write(std::string_view bytes)
{
    // What is large gains nothing from being gathered.
    constexpr std::size_t kLarge = kBufferBytes / 16;
    if (bytes.size() >= kLarge)
    {
        flush();
        put(bytes);
        return;
    }
    buffer_.append(bytes);
    if (buffer_.size() >= kBufferBytes)
        flush();
}

void AtomicFile::flush()
{
    put(buffer_);
    buffer_.clear();
}

void AtomicFile::put(std::string_view bytes)
{
    if (!write_all(file_.get(), bytes))
        fail("cannot write");
}

void AtomicFile::finish()
{
    if (lock_)
        return;
    flush();
    std::string().swap(buffer_);
    struct stat status
    {
    };
    if (::fsync(file_.get()) != 0 || ::fstat(file_.get(), &status) != 0)
        fail("cannot write");
    device_ = status.st_dev;
    inode_ = status.st_ino;
    seconds_ = status.st_mtim.tv_sec;
    nanoseconds_ = status.st_mtim.tv_nsec;
    // Closing tells of errors; the lock is held on until the name is in place.
    Descriptor same(::fcntl(file_.get(), F_DUPFD_CLOEXEC, 3));
    if (!same)
        fail("cannot write");
    lock_ = kept_lock(std::move(same), folder_of(target_));
    if (!file_.close())
        fail("cannot write");
}

void AtomicFile::fail_because_of_target()
{
    discard();
    check_output(path_, overwrite_); // tells what stands there now
    throw file_error(path_, "existed already when it was to be put in place");
}

bool AtomicFile::try_put_in_place()
{
    const char* const from = temporary_.c_str();
    const char* const to = target_.c_str();
    struct stat status
    {
    };
    if (overwrite_ == Overwrite::Yes && ::lstat(to, &status) == 0)
    {
        if (!S_ISREG(status.st_mode))
            fail_because_of_target();
        // Nobody sweeps the old file under the temporary name.
        const std::string folder = folder_of(target_);
        replaced_lock_ = lock_of_file(to, folder);
        if (exchange(from, to))
        {
            undo_ = Undo::Exchange;
            if (replaced_lock_ && !is_same_file(replaced_lock_->get(), from))
                replaced_lock_ = lock_of_file(from, folder);
            return true;
        }
        const int error = errno;
        replaced_lock_.reset();
        errno = error;
        if (is_lacking())
            return false;
        if (errno != ENOENT) // else it has gone
            fail("cannot put it in place");
    }
    if (!rename_to_free_name(from, to))
    {
        if (errno != EEXIST)
            fail("cannot put it in place");
        if (overwrite_ == Overwrite::Yes)
            return false;
        fail_because_of_target();
    }
    undo_ = Undo::Remove;
    give_name();
    return true;
}

void AtomicFile::put_in_place()
{
    if (overwrite_ == Overwrite::No)
        try_put_in_place();
    else if (::rename(temporary_.c_str(), target_.c_str()) == 0)
        give_name();
    else
        fail("cannot put it in place");
}

/// The temporary name is no more.
void AtomicFile::give_name()
{
    temporary_.clear();
    free_name(listed_);
}

/// Whether the target is the file that was written here.
bool AtomicFile::is_in_place() const
{
    struct stat status
    {
    };
    return ::lstat(target_.c_str(), &status) == 0 && status.st_dev == device_ &&
           status.st_ino == inode_ && status.st_mtim.tv_sec == seconds_ &&
           status.st_mtim.tv_nsec == nanoseconds_;
}

void AtomicFile::take_back() noexcept
{
    if (undo_ != Undo::Impossible && is_in_place())
    {
        if (undo_ == Undo::Exchange)
            exchange(temporary_.c_str(), target_.c_str());
        else
            ::unlink(target_.c_str());
    }
    undo_ = Undo::Impossible;
    discard();
}

void AtomicFile::settle() noexcept
{
    discard();
    sync_folder_of(target_);
}

void AtomicFile::commit()
{
    finish();
    put_in_place();
    settle();
}

RangeFile::RangeFile(const std::string& path, std::string name)
    : name_(std::move(name)), file_(::open(path.c_str(), O_WRONLY | O_CLOEXEC))
{
    if (!file_)
        throw file_error(name_, "cannot open: " + reason());
}

void RangeFile::write_at(std::uint64_t start, std::string_view bytes)
{
    if (!cellwarp::core::write_at(file_.get(), start, bytes))
        throw file_error(name_, "cannot write: " + reason());
}

void RangeFile::sync()
{
    if (::fsync(file_.get()) != 0)
        throw file_error(name_, "cannot write: " + reason());
}

OutputFile::OutputFile(const std::string& path, Overwrite overwrite)
{
    if (path != "-")
        file_.emplace(path, overwrite);
}

void OutputFile::write(std::string_view bytes)
{
    if (file_)
        file_->write(bytes);
    else
    {
        writes_to_stdout.store(true);
        if (!write_all(1, bytes))
            throw file_error("stdout", "cannot write: " + reason());
    }
}

bool has_written_to_stdout()
{
    return writes_to_stdout.load();
}

void OutputFile::commit()
{
    if (file_)
        file_->commit();
}

void write_file(const std::string& path, std::string_view bytes, Overwrite overwrite)
{
    OutputFile file(path, overwrite);
    file.write(bytes);
    file.commit();
}

void remove_unfinished_outputs() noexcept
{
    for (const TemporaryName* name = temporaries.load(); name; name = name->next)
        if (name->is_listed.load())
            ::unlink(name->path);
}

} // namespace cellwarp::core
