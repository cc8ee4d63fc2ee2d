// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/blend_kernel.h"

#include <vector>

namespace cellwarp
{

namespace plain
{
BlendKernels kernels();
}
#ifdef __x86_64__
namespace avx2
{
BlendKernels kernels();
}
namespace avx512
{
BlendKernels kernels();
}
#endif

std::span<const InstructionSet> instruction_sets()
{
    static const std::vector<InstructionSet> sets = []
    {
        std::vector<InstructionSet> found{InstructionSet::Plain};
#ifdef __x86_64__
        if (__builtin_cpu_supports("avx2"))
            found.push_back(InstructionSet::Avx2);
        if (__builtin_cpu_supports("avx512f"))
            found.push_back(InstructionSet::Avx512);
#endif
        return found;
    }();
    return sets;
}

BlendKernels blend_kernels(InstructionSet set)
{
#ifdef __x86_64__
    if (set == InstructionSet::Avx512)
        return avx512::kernels();
    if (set == InstructionSet::Avx2)
        return avx2::kernels();
#endif
    static_cast<void>(set);
    return plain::kernels();
}

} // namespace cellwarp
