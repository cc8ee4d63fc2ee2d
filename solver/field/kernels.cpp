// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/blend_kernel.h"
#include "solver/field/influence_kernel.h"
#include "solver/field/rbf_kernel.h"

namespace cellwarp::core
{

namespace plain
{
BlendKernels blend_kernels();
InfluenceKernels influence_kernels();
RbfKernels rbf_kernels();
} // namespace plain
#ifdef __x86_64__
namespace avx2
{
BlendKernels blend_kernels();
InfluenceKernels influence_kernels();
RbfKernels rbf_kernels();
} // namespace avx2
namespace avx512
{
BlendKernels blend_kernels();
InfluenceKernels influence_kernels();
RbfKernels rbf_kernels();
} // namespace avx512
#endif

BlendKernels blend_kernels([[maybe_unused]] InstructionSet set)
{
#ifdef __x86_64__
    if (set == InstructionSet::Avx512)
        return avx512::blend_kernels();
    if (set == InstructionSet::Avx2)
        return avx2::blend_kernels();
#endif
    return plain::blend_kernels();
}

InfluenceKernels influence_kernels([[maybe_unused]] InstructionSet set)
{
#ifdef __x86_64__
    if (set == InstructionSet::Avx512)
        return avx512::influence_kernels();
    if (set == InstructionSet::Avx2)
        return avx2::influence_kernels();
#endif
    return plain::influence_kernels();
}

const InfluenceKernels& widest_influence_kernels()
{
    static const InfluenceKernels kernels = influence_kernels(instruction_sets().back());
    return kernels;
}

RbfKernels rbf_kernels([[maybe_unused]] InstructionSet set)
{
#ifdef __x86_64__
    if (set == InstructionSet::Avx512)
        return avx512::rbf_kernels();
    if (set == InstructionSet::Avx2)
        return avx2::rbf_kernels();
#endif
    return plain::rbf_kernels();
}

} // namespace cellwarp::core
