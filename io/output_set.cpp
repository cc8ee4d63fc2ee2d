// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/output_set.h"

namespace cellwarp
{

OutputFile& OutputSet::add(const std::string& path)
{
    return *files_.emplace_back(std::make_unique<OutputFile>(path, overwrite_));
}

void OutputSet::write(const std::string& path, std::string_view bytes)
{
    if (path == "-")
        for_stdout_.append(bytes);
    else
        add(path).write(bytes);
}

void OutputSet::finish()
{
    for (const std::unique_ptr<OutputFile>& output : files_)
        if (AtomicFile* const file = output->file())
            file->finish();
}

void OutputSet::commit()
{
    finish();
    std::vector<AtomicFile*> files;
    for (const std::unique_ptr<OutputFile>& output : files_)
        if (AtomicFile* const file = output->file())
            files.push_back(file);
    const auto write_stdout = [&]
    {
        if (!for_stdout_.empty())
            write_file("-", for_stdout_, overwrite_);
    };
    // New files can always be taken back, so what stands in their way is met before
    // stdout says that all is well. Replacing can hardly fail, and not every file system
    // can undo it: a reader that has gone, or a full disk behind stdout, is met before
    // that.
    const bool are_new = overwrite_ == Overwrite::No;
    if (!are_new)
        write_stdout();
    std::size_t num_placed = 0;
    try
    {
        for (; num_placed < files.size(); ++num_placed)
            files[num_placed]->put_in_place(num_placed + 1 < files.size()
                                                ? AtomicFile::Replaced::Kept
                                                : AtomicFile::Replaced::Dropped);
        if (are_new)
            write_stdout();
    }
    catch (...)
    {
        while (num_placed > 0)
            files[--num_placed]->take_back();
        throw;
    }
    for (AtomicFile* const file : files)
        file->settle();
    files_.clear();
    for_stdout_.clear();
}

} // namespace cellwarp
