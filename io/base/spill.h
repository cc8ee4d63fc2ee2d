// SPDX-License-Identifier: GPL-3.0-or-later
// Lists that may be larger than the memory: kept in temporary files without a name, which
// vanish with the process however it ends.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <queue>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "io/base/descriptor.h"

namespace cellwarp::core
{

/// A temporary file without a name. Throws Fault::File.
class SpillFile
{
public:
    explicit SpillFile(const std::string& folder);

    std::uint64_t size() const { return size_; } ///< [bytes]
    void append(const void* bytes, std::size_t count);
    /// Over what is there; other ranges may be read and written at the same time.
    void overwrite(std::uint64_t start, const void* bytes, std::size_t count) const;
    void read(std::uint64_t start, void* bytes, std::size_t count) const;

private:
    Descriptor file_;
    std::uint64_t size_ = 0;
};

/// Records [begin, end) of a spill file, one after the other.
template <class Record>
class SpillReader
{
public:
    SpillReader(const SpillFile& file, std::uint64_t begin, std::uint64_t end,
                std::size_t records_at_once)
        : file_(&file), next_(begin), end_(end), records_at_once_(records_at_once)
    {
    }

    /// False at the end.
    bool next(Record& record)
    {
        if (at_ == buffer_.size() && !refill())
            return false;
        record = buffer_[at_++];
        return true;
    }

private:
    bool refill()
    {
        buffer_.resize(static_cast<std::size_t>(
            std::min<std::uint64_t>(records_at_once_, end_ - next_)));
        at_ = 0;
        if (!buffer_.empty())
            file_->read(next_ * sizeof(Record), buffer_.data(),
                        buffer_.size() * sizeof(Record));
        next_ += buffer_.size();
        return !buffer_.empty();
    }

    const SpillFile* file_;
    std::uint64_t next_, end_;
    std::size_t records_at_once_;
    std::vector<Record> buffer_;
    std::size_t at_ = 0;
};

/// A list of records that only grows.
template <class Record>
class SpillList
{
    static_assert(std::is_trivially_copyable_v<Record>);
    static constexpr std::size_t kAtOnce = (std::size_t(1) << 18) / sizeof(Record);

public:
    explicit SpillList(const std::string& folder) : file_(folder) {}

    void push(const Record& record)
    {
        buffer_.push_back(record);
        ++size_;
        if (buffer_.size() == kAtOnce)
            flush();
    }
    std::uint64_t size() const { return size_; }
    /// From the first record on; nothing may be pushed any more.
    SpillReader<Record> reader()
    {
        flush();
        return {file_, 0, size_, kAtOnce};
    }

private:
    void flush()
    {
        file_.append(buffer_.data(), buffer_.size() * sizeof(Record));
        buffer_.clear();
    }

    SpillFile file_;
    std::vector<Record> buffer_;
    std::uint64_t size_ = 0;
};

/// Sorts records by their operator<; equal ones come in any order.
template <class Record>
class SpillSorter
{
    static_assert(std::is_trivially_copyable_v<Record>);

public:
    /// \p run_records: so many are sorted in memory.
    SpillSorter(const std::string& folder, std::size_t run_records)
        : file_(folder), run_records_(run_records)
    {
    }

    void push(const Record& record)
    {
        run_.push_back(record);
        if (run_.size() == run_records_)
            end_run();
    }

    /// Hands the records out in order.
    class Sorted
    {
    public:
        explicit Sorted(std::vector<SpillReader<Record>> runs) : runs_(std::move(runs))
        {
            for (std::size_t r = 0; r < runs_.size(); ++r)
                refill(r);
        }
        bool next(Record& record)
        {
            if (heads_.empty())
                return false;
            const Head head = heads_.top();
            heads_.pop();
            record = head.record;
            refill(head.run);
            return true;
        }

    private:
        struct Head
        {
            Record record;
            std::size_t run;
            bool operator<(const Head& other) const { return other.record < record; }
        };
        void refill(std::size_t run)
        {
            Head head{{}, run};
            if (runs_[run].next(head.record))
                heads_.push(head);
        }
        std::vector<SpillReader<Record>> runs_;
        std::priority_queue<Head> heads_;
    };

    /// From the smallest record on; nothing may be pushed any more.
    Sorted sorted()
    {
        end_run();
        run_.shrink_to_fit();
        std::vector<SpillReader<Record>> runs;
        std::uint64_t begin = 0;
        for (const std::uint64_t end : run_ends_)
        {
            // All runs together buffer no more than one run took.
            runs.emplace_back(file_, begin, end,
                              std::max<std::size_t>(1, run_records_ / run_ends_.size()));
            begin = end;
        }
        return Sorted(std::move(runs));
    }

private:
    void end_run()
    {
        if (run_.empty())
            return;
        std::sort(run_.begin(), run_.end());
        file_.append(run_.data(), run_.size() * sizeof(Record));
        run_ends_.push_back(file_.size() / sizeof(Record));
        run_.clear();
    }

    SpillFile file_;
    std::size_t run_records_;
    std::vector<Record> run_;
    std::vector<std::uint64_t> run_ends_;
};

} // namespace cellwarp::core
