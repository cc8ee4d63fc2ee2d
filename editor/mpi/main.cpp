// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp-mpi: apply for one huge file, by several processes on one machine or many.
#include <csignal>
#include <memory>
#include <optional>
#include <sstream>

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "editor/mpi/ranks.h"
#include "editor/mpi/spread.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "library/session/memory_limit.h"
#include "octree/base/parallel.h"

namespace
{

using namespace cellwarp::core;

struct Flags
{
    std::string field, input, output;
    int threads = 0;
    bool overwrites = false;
};

/// Outputs appear by a rename, so ending at once loses nothing.
extern "C" void end_at_signal(int signal)
{
    remove_unfinished_outputs();
    ::_exit(128 + signal);
}

/// The exit code where there is nothing to do.
std::optional<int> parse(int argc, char** argv, const Ranks& ranks, Flags& flags)
{
    CLI::App app("A saved deformation for one huge binary PLY, by several processes; the "
                 "result is that of cellwarp apply.\n\n"
                 "  mpirun -n 4 cellwarp-mpi bend.cwf scan.ply -o bent.ply\n"
                 "  mpirun --hostfile hosts cellwarp-mpi bend.cwf /shared/scan.ply -o "
                 "/shared/bent.ply\n",
                 "cellwarp-mpi");
    app.add_option("FIELD", flags.field, "deformation, from cellwarp deform --save-field")
        ->required();
    app.add_option("INPUT", flags.input,
                   "binary PLY, on a file system that all processes see")
        ->required();
    app.add_option("-o,--output", flags.output, "result, likewise")->required();
    app.add_option("--threads", flags.threads,
                   "of each process, 0: all (default 0); the result is the same")
        ->check(CLI::Range(0, 4096));
    app.add_flag("--overwrite", flags.overwrites, "replace an existing output");
    try
    {
        app.parse(argc, argv);
    }
    catch (const CLI::ParseError& error)
    {
        std::ostringstream text;
        app.exit(error, text, text);
        const bool is_help = error.get_exit_code() == 0;
        if (ranks.is_first() && is_help)
            write_file("-", text.str(), Overwrite::No);
        else if (ranks.is_first())
            fmt::print(stderr, "error: {}\n", error.what());
        return is_help ? 0 : static_cast<int>(Fault::Usage);
    }
    return std::nullopt;
}

void check_names(const Flags& flags)
{
    for (const std::string& path : {flags.input, flags.output})
        if (extension_of(path) != "ply")
            throw Error(Fault::Usage, path + ": only a .ply can be spread (got " +
                                          in_quotes("." + extension_of(path)) + ")");
}

void warn(std::uint64_t count, const std::string& path, const char* what)
{
    if (count > 0)
        fmt::print(stderr, "warning: {}: {} {}\n", path, count, what);
}

int run(const Ranks& ranks, const Flags& flags)
{
    const ThreadLimit limit(flags.threads);
    std::optional<Deformation> deformation;
    std::optional<SpreadPly> file;
    std::optional<AtomicFile> output;
    int code = ranks.together(
        [&]
        {
            check_names(flags);
            // Before any work, by the one that makes it.
            if (ranks.is_first())
                check_output(flags.output,
                             flags.overwrites ? Overwrite::Yes : Overwrite::No);
            deformation.emplace(read_field(flags.field), flags.field,
                                default_memory_limit());
            file.emplace(flags.input);
            if (ranks.is_first())
                output.emplace(flags.output,
                               flags.overwrites ? Overwrite::Yes : Overwrite::No);
        });
    if (code != 0)
        return code;
    const std::string temporary =
        ranks.from_first(output ? output->temporary() : std::string());
    code = ranks.together(
        [&]
        {
            RangeFile shared(temporary, flags.output);
            file->write_share(ranks.rank(), ranks.count(), *deformation, shared);
        });
    if (code != 0)
        return code;
    code = ranks.together(
        [&]
        {
            if (output)
                output->commit();
        });
    const std::uint64_t normals = ranks.sum(file->num_bad_normals()),
                        rotations = ranks.sum(file->num_bad_rotations()),
                        missing = ranks.sum(file->num_missing());
    if (ranks.is_first() && code == 0)
    {
        warn(normals, flags.input, "normals are not finite and stay as they are");
        warn(rotations, flags.input,
             "rotations are zero or not finite and stay as they are");
        warn(missing, flags.input, "points without a place (NaN) stay as they are");
    }
    return code;
}

} // namespace

int main(int argc, char** argv)
{
    const Ranks ranks(argc, argv);
    std::signal(SIGPIPE, SIG_IGN);
    std::signal(SIGXFSZ, SIG_IGN);
    std::signal(SIGINT, end_at_signal);
    std::signal(SIGTERM, end_at_signal);
    Flags flags;
    if (const std::optional<int> code = parse(argc, argv, ranks, flags))
        return *code;
    return run(ranks, flags);
}
