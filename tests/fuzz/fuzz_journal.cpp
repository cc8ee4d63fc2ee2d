// SPDX-License-Identifier: GPL-3.0-or-later
// The journal on arbitrary files, and on its own files cut or altered at one place: it
// opens with the first of the records and goes on from there, or refuses with an Error.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include <sys/mman.h>
#include <unistd.h>

#include "io/base/error.h"
#include "io/journal/journal.h"
#include "octree/base/index.h"

using namespace cellwarp::core;

namespace
{

void require(bool condition)
{
    if (!condition)
        std::abort();
}

/// A file in memory, with a name.
class MemoryFile
{
public:
    explicit MemoryFile(const std::string& bytes) : file_(::memfd_create("journal", 0))
    {
        require(file_ >= 0);
        require(::write(file_, bytes.data(), bytes.size()) ==
                static_cast<ssize_t>(bytes.size()));
    }
    ~MemoryFile() { ::close(file_); }
    MemoryFile(const MemoryFile&) = delete;
    MemoryFile& operator=(const MemoryFile&) = delete;

    std::string path() const { return "/proc/self/fd/" + std::to_string(file_); }
    std::string bytes() const
    {
        std::string bytes(idx(::lseek(file_, 0, SEEK_END)), '\0');
        require(::pread(file_, bytes.data(), bytes.size(), 0) ==
                static_cast<ssize_t>(bytes.size()));
        return bytes;
    }

private:
    int file_;
};

std::vector<std::string> records_of(const std::string& path)
{
    JournalContents contents;
    const Journal journal = Journal::open(path, contents);
    std::vector<std::string> records;
    for (const std::uint64_t start : contents.starts)
        records.push_back(journal.read(start));
    return records;
}

/// Opened, it takes one more and has it the next time.
std::vector<std::string> check_opened(const MemoryFile& file)
{
    std::vector<std::string> records = records_of(file.path());
    {
        JournalContents contents;
        Journal::open(file.path(), contents).append("one more");
        require(contents.warnings.empty()); // the cut was mended
    }
    std::vector<std::string> more = records_of(file.path());
    require(more.size() == records.size() + 1 && more.back() == "one more");
    more.pop_back();
    require(more == records);
    return records;
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    if (size < 5)
        return 0;
    const std::string rest(reinterpret_cast<const char*>(data) + 5, size - 5);
    try
    {
        if (data[0] % 2 == 0)
        {
            check_opened(MemoryFile(rest));
            return 0;
        }
        // Records as the bytes say: a length, then so many.
        const MemoryFile whole("");
        std::vector<std::string> records;
        {
            Journal journal = Journal::create(whole.path(), "about");
            for (std::size_t i = 0; i < rest.size();)
            {
                const std::size_t length = static_cast<unsigned char>(rest[i++]);
                records.push_back(rest.substr(i, 8 * length));
                journal.append(records.back());
                i += std::min(8 * length, rest.size() - i);
            }
        }
        std::string bytes = whole.bytes();
        const std::size_t place = (data[1] + 256u * data[2]) % bytes.size();
        if (data[3] == 0)
            bytes.resize(place);
        else
            bytes[place] = static_cast<char>(bytes[place] ^ data[3]);
        const std::vector<std::string> kept = check_opened(MemoryFile(bytes));
        require(kept.size() <= records.size());
        require(std::equal(kept.begin(), kept.end(), records.begin()));
    }
    catch (const Error&)
    {
    }
    return 0;
}
