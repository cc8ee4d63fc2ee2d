// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/weight_file.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/file_limits.h"
#include "io/base/number.h"
#include "io/base/text.h"

namespace cellwarp::core
{

namespace
{

/// The words of a line, without its comment; names may be quoted.
std::vector<std::string> words_of(std::string_view line, const std::string& path,
                                  std::int64_t number)
{
    std::vector<std::string> words;
    const auto is_between = [](char c) { return is_blank(c) || c == ','; };
    for (std::size_t i = 0; i < line.size();)
    {
        if (is_between(line[i]))
        {
            ++i;
            continue;
        }
        if (line[i] == '#')
            break;
        if (line[i] == '"')
        {
            const std::size_t end = line.find('"', i + 1);
            if (end == std::string_view::npos)
                throw malformed({path, number, ""}, "a double quote is not closed");
            words.emplace_back(line.substr(i + 1, end - i - 1));
            i = end + 1;
            continue;
        }
        std::size_t end = i;
        while (end < line.size() && !is_between(line[end]) && line[end] != '#')
            ++end;
        words.emplace_back(line.substr(i, end - i));
        i = end;
    }
    return words;
}

} // namespace

PaintedWeights parse_weights(const std::string& path, std::string_view text)
{
    if (const std::string guess = foreign_content(text); !guess.empty())
        throw malformed({path, 0, ""}, "this looks like " + guess + ", need weights");
    text.remove_prefix(byte_order_mark(text));
    PaintedWeights out;
    bool has_header = false;
    LineReader lines(text, 0, true);
    for (std::string_view line; lines.next(line);)
    {
        const std::int64_t number = lines.line_number();
        const std::vector<std::string> words = words_of(line, path, number);
        if (words.empty())
            continue;
        if (!has_header)
        {
            if (words.size() != 2 || words[0] != "cellwarp-weights" || words[1] != "1")
                throw malformed({path, number, ""},
                                "the first line is wrong (need 'cellwarp-weights 1')");
            has_header = true;
        }
        else if (out.joints.empty())
        {
            for (const std::string& name : words)
                if (std::count(words.begin(), words.end(), name) > 1)
                    throw malformed({path, number, name}, "is named twice");
            out.joints = words;
        }
        else
        {
            if (words.size() != out.joints.size())
                throw malformed({path, number, ""},
                                "got " + std::to_string(words.size()) +
                                    " numbers, need one a joint, " +
                                    std::to_string(out.joints.size()));
            for (std::size_t k = 0; k < words.size(); ++k)
            {
                const std::optional<double> value = parse_double(words[k]);
                if (!value || !(*value >= 0.0) || !(*value <= kHuge))
                    throw malformed({path, number, out.joints[k]},
                                    "got " + in_quotes(words[k]) +
                                        ", need a number >= 0");
                out.values.push_back(*value);
            }
        }
    }
    if (out.joints.empty())
        throw malformed({path, lines.line_number(), ""}, "the file names no joints");
    return out;
}

PaintedWeights read_weights(const std::string& path)
{
    const std::string extension = extension_of(path);
    if (extension == "gltf" || extension == "glb")
        return parse_gltf_weights(path, read_file(path));
    return parse_weights(path, read_file(path));
}

} // namespace cellwarp::core
