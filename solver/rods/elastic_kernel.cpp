// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/elastic_kernel.h"

namespace cellwarp::core
{

#define CELLWARP_KERNELS_OF(SET)                                                         \
    namespace SET                                                                        \
    {                                                                                    \
    void kernels(ElasticKernels<3>&);                                                    \
    void kernels(ElasticKernels<4>&);                                                    \
    void kernels(ElasticKernels<5>&);                                                    \
    void kernels(ElasticKernels<6>&);                                                    \
    void kernels(ElasticKernels<7>&);                                                    \
    void kernels(ElasticKernels<8>&);                                                    \
    }
CELLWARP_KERNELS_OF(plain)
#ifdef __x86_64__
CELLWARP_KERNELS_OF(avx2)
CELLWARP_KERNELS_OF(avx512)
#endif
#undef CELLWARP_KERNELS_OF

template <int M>
ElasticKernels<M> elastic_kernels([[maybe_unused]] InstructionSet set)
{
    ElasticKernels<M> found;
    plain::kernels(found);
#ifdef __x86_64__
    if (set == InstructionSet::Avx512)
        avx512::kernels(found);
    else if (set == InstructionSet::Avx2)
        avx2::kernels(found);
#endif
    return found;
}

template ElasticKernels<3> elastic_kernels<3>(InstructionSet);
template ElasticKernels<4> elastic_kernels<4>(InstructionSet);
template ElasticKernels<5> elastic_kernels<5>(InstructionSet);
template ElasticKernels<6> elastic_kernels<6>(InstructionSet);
template ElasticKernels<7> elastic_kernels<7>(InstructionSet);
template ElasticKernels<8> elastic_kernels<8>(InstructionSet);

} // namespace cellwarp::core
