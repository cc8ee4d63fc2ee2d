// SPDX-License-Identifier: GPL-3.0-or-later
// Skeleton readers on arbitrary bytes: a tree of finite joints with keys in order, or an
// Error. The first byte tells the format.
#include <array>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <string>

#include "io/base/error.h"
#include "io/scene/skeleton_file.h"

using namespace cellwarp::core;

namespace
{

void require(bool condition)
{
    if (!condition)
        std::abort();
}

template <int size>
void check_tracks(const std::vector<KeyTrack<size>>& tracks, std::size_t joints)
{
    for (const KeyTrack<size>& track : tracks)
    {
        require(track.joint < joints && !track.times.empty());
        require(track.values.size() == track.times.size());
        require(track.step != KeyStep::Cubic ||
                track.tangents.size() == track.times.size());
        for (std::size_t k = 0; k < track.times.size(); ++k)
        {
            require(k == 0 || track.times[k] > track.times[k - 1]);
            require(track.values[k].allFinite());
        }
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    if (size == 0)
        return 0;
    constexpr std::array<const char*, 4> kNames = {"x.tgf", "x.bvh", "x.gltf", "x.glb"};
    const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
    try
    {
        const SkeletonValues values = parse_skeleton(kNames[data[0] % 4], text);
        std::map<std::string, std::size_t> known;
        for (const SkeletonJoint& joint : values.joints)
        {
            require(joint.at.allFinite());
            require(joint.parent.empty() || known.contains(joint.parent));
            require(known.try_emplace(joint.name, known.size()).second);
        }
        check_tracks(values.turns, values.joints.size());
        check_tracks(values.shifts, values.joints.size());
    }
    catch (const Error&)
    {
    }
    return 0;
}
