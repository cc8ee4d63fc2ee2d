// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/instruction_set.h"

#include <vector>

namespace cellwarp::core
{

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

} // namespace cellwarp::core
