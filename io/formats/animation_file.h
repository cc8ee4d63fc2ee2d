// SPDX-License-Identifier: GPL-3.0-or-later
// Frames of one shape as one file that moves: glTF with a morph target a frame (.glb),
// and the point caches .pc2 and .mdd, which play on a mesh that is there already.
// animation_file.cpp tells what stands in each.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "io/base/output_set.h"
#include "io/formats/geometry.h"
#include "io/formats/texture_coordinates.h"

namespace cellwarp::core
{

/// Whether frames of a model of \p format are written into one file of this extension: a
/// .pc2 or .mdd always, a .glb but where the model's own is patched.
bool is_animation_format(std::string_view extension, std::string_view format,
                         bool is_patched);

/// Whether a model has a skin, which would go on moving a patched copy of it: where
/// joints have posed it, it is written as a mesh that moves.
bool is_skinned(const Geometry& geometry);

/// Takes frame after frame; they never lie in memory together.
class AnimationFile
{
public:
    /// Unit normals of samples, wherever these are.
    using NormalsOf = std::function<std::vector<Eigen::Vector3d>(
        std::span<const Eigen::Vector3d> samples)>;

    /// Adds the file to \p outputs, which the caller commits after finish(). \p times of
    /// the frames [s], ascending. \p normals: what a .glb is shown with; none: its faces
    /// look flat. \p texture: of each corner, or none. \p outputs and \p geometry must
    /// outlive it. Throws Fault::Usage for what the format cannot hold, Fault::File.
    AnimationFile(const std::string& path, OutputSet& outputs, const Geometry& geometry,
                  std::vector<double> times, NormalsOf normals = {},
                  const std::vector<TextureCoordinate>& texture = {});
    ~AnimationFile();

    /// The next frame: as many samples as the geometry has. Throws Fault::Malformed for
    /// what its 32-bit numbers cannot hold.
    void add(const std::vector<Eigen::Vector3d>& samples);
    /// Writes what comes after the frames.
    /// \pre as many frames as times
    void finish();

private:
    class Writer;
    class PointCache;
    class Glb;
    std::unique_ptr<Writer> writer_;
};

} // namespace cellwarp::core
