// SPDX-License-Identifier: GPL-3.0-or-later
// Views of a glTF's buffers that meshopt has compressed. [EXT_meshopt_compression]
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace cellwarp::core
{

struct MeshoptView
{
    enum class Mode
    {
        Attributes,
        Triangles,
        Indices
    };
    enum class Filter
    {
        None,
        Octahedral,
        Quaternion,
        Exponential
    };
    Mode mode = Mode::Attributes;
    Filter filter = Filter::None;
    std::uint64_t count = 0, stride = 0; ///< elements, bytes of each

    /// Why no such view can be, as the end of a message; empty: it can.
    std::string fault() const;
    /// Whether so many elements can come from so many bytes.
    bool may_come_from(std::uint64_t bytes) const;
};

/// Unpacks \p bytes to the view's count * stride bytes at \p out. False where they are
/// damaged, or of another version of the format.
/// \pre view.fault() is empty
bool unpack_meshopt(std::string_view bytes, const MeshoptView& view, char* out);

} // namespace cellwarp::core
