// SPDX-License-Identifier: GPL-3.0-or-later
// The file has been scanned: what is wrong in it has been told, and what could not be
// read here after all has no coordinates.
#include "io/formats/texture_coordinates.h"

#include <cmath>
#include <optional>
#include <string_view>

#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/gltf.h"
#include "io/formats/gltf_json.h"
#include "io/formats/obj.h"

namespace cellwarp::core
{

namespace
{

/// The second of "v/vt/vn"; 0: there is none.
std::int64_t texture_of_corner(std::string_view corner)
{
    const std::size_t first = corner.find('/');
    if (first == std::string_view::npos)
        return 0;
    const std::string_view rest = corner.substr(first + 1);
    return parse_integer(rest.substr(0, rest.find('/'))).value_or(0);
}

std::vector<TextureCoordinate> of_obj(const GeometryFile& file)
{
    std::vector<TextureCoordinate> pool;
    std::vector<std::int64_t> indices; // of corners, -1: none
    const auto read = [&](std::string_view statement)
    {
        Tokens tokens(statement, 0);
        const auto next = [&](std::string_view& word)
        {
            Token token;
            const bool is_there = tokens.next(token) && token.text[0] != '#';
            word = token.text;
            return is_there;
        };
        std::string_view word;
        if (!next(word))
            return;
        if (word == "vt")
        {
            TextureCoordinate place = {0.0f, 0.0f};
            for (std::size_t k = 0; k < 2 && next(word); ++k)
                place[k] = static_cast<float>(parse_double(word).value_or(0.0));
            place[1] = 1.0f - place[1];
            pool.push_back(place);
            return;
        }
        if (word != "f" && word != "fo")
            return;
        const std::size_t first = indices.size();
        while (next(word))
        {
            const std::int64_t index = texture_of_corner(word);
            indices.push_back(index > 0   ? index - 1
                              : index < 0 ? static_cast<std::int64_t>(pool.size()) + index
                                          : -1);
        }
        if (indices.size() - first < 3)
            indices.resize(first); // no face
    };
    for_each_obj_statement(file.bytes, read);
    if (indices.size() != file.geometry.corners.size())
        return {};
    bool has_some = false;
    std::vector<TextureCoordinate> corners;
    for (const std::int64_t index : indices)
    {
        const bool is_there =
            index >= 0 && index < static_cast<std::int64_t>(pool.size());
        has_some = has_some || is_there;
        corners.push_back(is_there ? pool[static_cast<std::size_t>(index)]
                                   : TextureCoordinate{0.0f, 0.0f});
    }
    return has_some ? corners : std::vector<TextureCoordinate>();
}

std::vector<TextureCoordinate> of_gltf(const GeometryFile& file)
{
    const GltfLayout& layout = *file.gltf;
    const GltfJson json(
        file.path,
        std::string_view(file.bytes)
            .substr(layout.json.begin, layout.json.end - layout.json.begin),
        layout.json.begin, false);
    std::vector<TextureCoordinate> samples(file.geometry.samples.size(), {0.0f, 0.0f});
    bool has_some = false;
    for (const GltfLayout::Part& part : layout.parts)
        for (const GltfLayout::Run& run : part.runs)
        {
            if (run.list != 0)
                continue;
            std::optional<std::size_t> of_run; // the accessor that was read
            for (const GltfJson::Json& primitive :
                 json.list("meshes")[part.mesh]["primitives"])
            {
                const GltfJson::Json& attributes = primitive["attributes"];
                const GltfJson::Json* const found = json.find(attributes, "TEXCOORD_0");
                if (!found || !found->is_number_unsigned() ||
                    found->get<std::size_t>() >= layout.accessors.size() ||
                    attributes["POSITION"].get<double>() !=
                        static_cast<double>(run.accessor))
                    continue;
                if (of_run && *of_run != found->get<std::size_t>())
                    return {}; // a place has one coordinate, not two
                if (of_run)
                    continue;
                const GltfAccessor& accessor =
                    layout.accessors[found->get<std::size_t>()];
                if (accessor.length != 2 || accessor.count != run.end - run.first ||
                    accessor.sparse || !accessor.has_data)
                    continue;
                const std::vector<double> numbers =
                    accessor_numbers(accessor, file.geometry.unpacked);
                for (std::size_t i = 0; i < run.end - run.first; ++i)
                    samples[run.first + i] = {static_cast<float>(numbers[2 * i]),
                                              static_cast<float>(numbers[2 * i + 1])};
                has_some = true;
                of_run = found->get<std::size_t>();
            }
        }
    std::vector<TextureCoordinate> corners;
    for (const std::uint32_t corner : file.geometry.corners)
        if (has_some)
            corners.push_back(samples[corner]);
    return corners;
}

} // namespace

std::vector<TextureCoordinate> texture_coordinates(const GeometryFile& file)
{
    std::vector<TextureCoordinate> out;
    if (file.geometry.format == "obj")
        out = of_obj(file);
    if (file.gltf)
        out = of_gltf(file);
    for (TextureCoordinate& place : out)
        for (float& number : place)
            number = std::isfinite(number) ? number : 0.0f;
    return out;
}

} // namespace cellwarp::core
