// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/part_kernel.h"

namespace cellwarp::core
{

namespace plain
{
PartKernels part_kernels();
} // namespace plain
#ifdef __x86_64__
namespace avx2
{
PartKernels part_kernels();
} // namespace avx2
namespace avx512
{
PartKernels part_kernels();
} // namespace avx512
#endif

PartKernels part_kernels([[maybe_unused]] InstructionSet set)
{
#ifdef __x86_64__
    if (set == InstructionSet::Avx512)
        return avx512::part_kernels();
    if (set == InstructionSet::Avx2)
        return avx2::part_kernels();
#endif
    return plain::part_kernels();
}

} // namespace cellwarp::core
