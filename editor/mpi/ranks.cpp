// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/mpi/ranks.h"

#include <exception>
#include <new>

#include <fmt/format.h>
#include <mpi.h>

#include "io/base/error.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

Ranks::Ranks(int& argc, char**& argv)
{
    MPI_Init(&argc, &argv);
    int rank = 0, count = 1;
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &count);
    rank_ = static_cast<std::uint64_t>(rank);
    count_ = static_cast<std::uint64_t>(count);
}

Ranks::~Ranks()
{
    MPI_Finalize();
}

int Ranks::together(const std::function<void()>& work) const
{
    int code = 0;
    std::string message;
    try
    {
        work();
    }
    catch (const Error& error)
    {
        code = static_cast<int>(error.fault());
        message = error.what();
    }
    catch (const std::bad_alloc&)
    {
        code = static_cast<int>(Fault::Budget);
        message = "out of memory";
    }
    catch (const std::exception& error)
    {
        code = 1;
        message = std::string("internal error: ") + error.what();
    }
    const int mine = code == 0 ? static_cast<int>(count_) : static_cast<int>(rank_);
    int failed = mine;
    MPI_Allreduce(&mine, &failed, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
    if (failed == static_cast<int>(count_))
        return 0;
    MPI_Bcast(&code, 1, MPI_INT, failed, MPI_COMM_WORLD);
    message = from(failed, message);
    if (is_first())
        fmt::print(stderr, "error: {}\n", message);
    return code;
}

std::string Ranks::from(int rank, const std::string& text) const
{
    int size = static_cast<int>(text.size());
    MPI_Bcast(&size, 1, MPI_INT, rank, MPI_COMM_WORLD);
    std::string all = text;
    all.resize(idx(size));
    MPI_Bcast(all.data(), size, MPI_CHAR, rank, MPI_COMM_WORLD);
    return all;
}

std::string Ranks::from_first(const std::string& text) const
{
    return from(0, text);
}

std::uint64_t Ranks::sum(std::uint64_t value) const
{
    std::uint64_t all = 0;
    MPI_Allreduce(&value, &all, 1, MPI_UINT64_T, MPI_SUM, MPI_COMM_WORLD);
    return all;
}

} // namespace cellwarp::core
