// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/output_set.h"

#include <utility>

namespace cellwarp::core
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
    {
        OutputFile& output = add(path);
        output.write(bytes);
        output.file()->finish();
    }
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
    // Stdout cannot be taken back: it is written when all files have their names, but
    // before the first one that replaces a file beyond recall.
    bool has_told = for_stdout_.empty();
    const auto write_stdout = [&]
    {
        if (!std::exchange(has_told, true))
            write_file("-", for_stdout_, overwrite_);
    };
    std::size_t num_placed = 0;
    try
    {
        for (; num_placed < files.size(); ++num_placed)
        {
            AtomicFile& file = *files[num_placed];
            const bool is_end = has_told && num_placed + 1 == files.size();
            if (!is_end && file.try_put_in_place())
                continue;
            write_stdout();
            file.put_in_place();
        }
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

} // namespace cellwarp::core
