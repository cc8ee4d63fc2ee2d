// SPDX-License-Identifier: GPL-3.0-or-later
// Painted weights: how much each joint of a skeleton has of each sample. Text, or those
// of the skins of a glTF.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cellwarp::core
{

struct PaintedWeights
{
    std::vector<std::string> joints;
    /// Of each sample one number a joint, >= 0, one after the other.
    std::vector<double> values;

    std::size_t num_samples() const
    {
        return joints.empty() ? 0 : values.size() / joints.size();
    }
};

/// First line "cellwarp-weights 1", second the names of joints, then a line of numbers
/// for each sample; between them blanks or commas; # begins a comment. Throws Fault::File
/// and Fault::Malformed with line and field.
/// FILE.gltf and .glb: of the joints of its skins, for all samples of its meshes.
PaintedWeights read_weights(const std::string& path);
PaintedWeights parse_weights(const std::string& path, std::string_view text);
/// gltf_skeleton.cpp.
PaintedWeights parse_gltf_weights(const std::string& path, std::string bytes);

} // namespace cellwarp::core
