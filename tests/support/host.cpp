// SPDX-License-Identifier: GPL-3.0-or-later
// A program with settings of its own for its process: `host MODEL RESULT` edits a model
// as samples/library/bend.cpp does, with two threads for BLAS, and ends with 1 where a
// setting is another one afterwards.
#include <cstdio>
#include <exception>
#include <tuple>

#include <gmp.h>

#include <cellwarp/cellwarp.h>

extern "C" int openblas_get_num_threads();
extern "C" void openblas_set_num_threads(int);
extern "C" int omp_get_max_threads();
extern "C" int omp_get_max_active_levels();

using namespace cellwarp;

namespace
{

struct OfProcess
{
    void* (*allocate)(std::size_t) = nullptr;
    void* (*reallocate)(void*, std::size_t, std::size_t) = nullptr;
    void (*release)(void*, std::size_t) = nullptr;
    std::terminate_handler terminate = std::get_terminate();

    OfProcess() { ::mp_get_memory_functions(&allocate, &reallocate, &release); }
    bool operator==(const OfProcess&) const = default;
};

/// Before the library's own variables begin.
const OfProcess before __attribute__((init_priority(101)));

auto thread_counts()
{
    return std::tuple(openblas_get_num_threads(), omp_get_max_threads(),
                      omp_get_max_active_levels());
}

void bend(const char* from, const char* to)
{
    const Model model = Model::read(from);
    const Edit edit = Edit::parse(R"(cellwarp-handles 1
units relative
fixed foot box 0 0 0  1 1 0.1
handle head box 0 0 0.9  1 1 1
frame 1
move head rotate 1 0 0 45 about border
)");
    write(to, model, deform(model, edit).deformed, Overwrite::Yes);
}

} // namespace

int main(int, char** names)
{
    openblas_set_num_threads(2);
    const auto counts = thread_counts();
    bend(names[1], names[2]);
    if (OfProcess() == before && thread_counts() == counts &&
        openblas_get_num_threads() == 2)
        return 0;
    std::fputs("the process has other settings than before\n", stderr);
    return 1;
}
