// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/geometry_output.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <iterator>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/geometry_file.h"
#include "io/formats/gltf.h"
#include "io/formats/plain_mesh.h"

namespace cellwarp::core
{

namespace
{

namespace fs = std::filesystem;

bool is_same_file(const std::string& a, const std::string& b)
{
    std::error_code ignored;
    return fs::equivalent(a, b, ignored);
}

/// The model's buffers must outlive a copy of the model.
void check_companion(const std::string& path, const std::string& output,
                     const GeometryFile& model, Overwrite overwrite)
{
    check_output(path, overwrite);
    if (is_same_file(output, model.path))
        return;
    for (const GltfLayout::Buffer& buffer : model.gltf->buffers)
        if (!buffer.path.empty() && is_same_file(path, buffer.path))
            throw Error(Fault::File,
                        at({output, 0, ""}, "its buffer would replace the model's own, " +
                                                path + ": choose another name"));
}

} // namespace

void check_output_format(const std::string& output, const std::string& format,
                         Conversion conversion)
{
    const std::string extension = extension_of(output);
    const std::string given = extension.empty() ? "none" : in_quotes("." + extension);
    if (conversion == Conversion::Yes)
    {
        const bool is_own = extension == format && is_geometry_format(format);
        if (!is_own && !is_converted_format(extension))
            throw Error(Fault::Usage,
                        at({output, 0, ""}, "cannot be converted to (got " + given +
                                                ", need .obj, .ply, .off, .stl or "
                                                ".xyz)"));
        return;
    }
    const std::string got = " (got " + given + ", need .";
    if (!is_geometry_format(format) && !is_plain_format(extension))
        throw Error(Fault::Usage,
                    at({output, 0, ""}, "a ." + format +
                                            " can only be read; what becomes of it is a "
                                            "plain mesh" +
                                            got + "obj or .ply)"));
    if (is_geometry_format(format) && extension != format)
        throw Error(
            Fault::Usage,
            at({output, 0, ""}, "the output has the model's format" + got + format +
                                    (conversion == Conversion::IfAsked
                                         ? "; --convert writes plain geometry of another)"
                                         : ")")));
}

bool is_written_plain(const std::string& output, const std::string& format)
{
    return !is_geometry_format(format) ||
           (output != "-" && extension_of(output) != format);
}

std::vector<std::string> left_out(const std::string& output, const Geometry& geometry,
                                  bool has_texture)
{
    const std::string extension = extension_of(output);
    if (extension == "pc2" || extension == "mdd")
        return {};
    const auto is_kept = [&](const std::string& attribute)
    {
        if (attribute == "colours")
            return extension == "glb";
        if (attribute == "groups")
            return extension == "obj" || extension == "glb";
        if (attribute == "texture coordinates" || attribute == "TEXCOORD_0")
            return extension == "glb" && has_texture;
        if (attribute != "normals")
            return false;
        if (geometry.format == "stl")
            return true; // they follow from the faces
        return (extension == "obj" || extension == "ply" || extension == "xyz") &&
               has_all_normals(geometry);
    };
    std::vector<std::string> out;
    std::copy_if(geometry.attributes.begin(), geometry.attributes.end(),
                 std::back_inserter(out), std::not_fn(is_kept));
    return out;
}

std::string left_out_note(const std::string& output, const Geometry& geometry,
                          bool has_texture)
{
    constexpr std::size_t kMost = 6; // a splat has dozens
    const std::vector<std::string> names = left_out(output, geometry, has_texture);
    std::string text;
    for (std::size_t k = 0; k < std::min(kMost, names.size()); ++k)
        text += (k == 0 ? "" : ", ") + names[k];
    if (names.size() > kMost)
        text += " and " + std::to_string(names.size() - kMost) + " more";
    return text.empty() ? text
                        : "not in the ." + extension_of(output) + ": the model's " + text;
}

void check_geometry_output(const std::string& output, const GeometryFile& model,
                           Overwrite overwrite)
{
    const std::string& format = model.geometry.format;
    if (output == "-" && !is_geometry_format(format))
        throw Error(Fault::Usage,
                    "-o -: a ." + format + " can only be read; name an .obj or .ply");
    if (!model.gltf || is_written_plain(output, format))
        return;
    for (const std::string& path : companion_paths(*model.gltf, output))
    {
        if (output == "-")
            throw Error(Fault::Usage, "-o -: " + model.path +
                                          " has buffers in files of their own; name a "
                                          ".gltf for it to be beside them");
        check_companion(path, output, model, overwrite);
    }
}

std::size_t write_geometry(const std::string& output, const GeometryFile& model,
                           const DeformedSamples& patch, OutputSet& outputs)
{
    if (is_written_plain(output, model.geometry.format))
    {
        outputs.write(output,
                      plain_mesh_bytes(model.geometry, patch, extension_of(output)));
        return 0;
    }
    if (model.gltf)
    {
        const PatchedGltf result = patched_gltf(model, patch, output);
        for (const Companion& companion : result.companions)
            outputs.write(companion.path, companion.bytes);
        outputs.write(output, result.bytes);
        return 0;
    }
    if (output == "-")
    {
        std::string whole;
        const std::size_t num_split =
            write_patched(model, patch, [&](std::string_view bytes) { whole += bytes; });
        outputs.write(output, whole);
        return num_split;
    }
    OutputFile& file = outputs.add(output);
    return write_patched(model, patch,
                         [&](std::string_view bytes) { file.write(bytes); });
}

std::size_t write_geometry(const std::string& output, const GeometryFile& model,
                           const DeformedSamples& patch, Overwrite overwrite)
{
    OutputSet outputs(overwrite);
    const std::size_t num_split = write_geometry(output, model, patch, outputs);
    outputs.commit();
    return num_split;
}

} // namespace cellwarp::core
