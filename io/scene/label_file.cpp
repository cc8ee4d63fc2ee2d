// SPDX-License-Identifier: GPL-3.0-or-later
// Labels of samples, and the deformation survey's pair that is made of them.
#include <algorithm>
#include <cmath>

#include "io/base/bytes.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/geometry.h"
#include "io/formats/stored_number.h"
#include "io/scene/handle_file.h"

namespace cellwarp::core
{

namespace
{

/// All numbers of a text, with # comments left out.
std::vector<double> all_numbers(const std::string& path, std::string_view text)
{
    std::vector<double> values;
    LineReader lines(text, 0, true);
    for (std::string_view line; lines.next(line);)
    {
        Tokens tokens(line.substr(0, line.find('#')), 0);
        for (Token token; tokens.next(token);)
        {
            const std::optional<double> value = parse_double(token.text);
            if (!value || !std::isfinite(*value))
                throw malformed({path, lines.line_number(),
                                 "number " + std::to_string(values.size() + 1)},
                                "got " + in_quotes(token.text) +
                                    ", need a finite number");
            values.push_back(*value);
        }
    }
    return values;
}

std::vector<std::int64_t> as_labels(const std::string& path,
                                    const std::vector<double>& values)
{
    std::vector<std::int64_t> labels;
    for (std::size_t i = 0; i < values.size(); ++i)
    {
        if (values[i] != std::floor(values[i]) || std::abs(values[i]) > 2147483647.0)
            throw malformed({path, 0, "label " + std::to_string(i)},
                            "got " + shortest(values[i]) + ", need an integer");
        labels.push_back(static_cast<std::int64_t>(values[i]));
    }
    return labels;
}

/// libigl's DMAT: "cols rows" and column-major text, or "0 0", a second header
/// line and binary doubles.
std::vector<std::int64_t> parse_dmat(const std::string& path, std::string_view bytes)
{
    LineReader lines(bytes, 0, true);
    std::string_view line;
    const auto header = [&]
    {
        if (!lines.next(line))
            throw malformed({path, 0, "header"}, "the file is empty (need 'cols rows')");
        const std::vector<double> sizes = all_numbers(path, line);
        if (sizes.size() != 2 || sizes[0] != std::floor(sizes[0]) ||
            sizes[1] != std::floor(sizes[1]) || sizes[0] < 0 || sizes[1] < 0)
            throw malformed({path, lines.line_number(), "header"},
                            "got " + in_quotes(line) + ", need 'cols rows'");
        if ((sizes[0] == 0) != (sizes[1] == 0) || sizes[0] > 1)
            throw malformed({path, lines.line_number(), "header"},
                            "got " + in_quotes(line) + ", need one column of labels");
        return sizes[1];
    };
    const double rows = header();
    std::vector<double> values;
    if (rows > 0)
        values = all_numbers(path, bytes.substr(lines.consumed()));
    const double count = rows > 0 ? rows : header();
    if (rows == 0)
    {
        const std::string_view data = bytes.substr(lines.consumed());
        for (std::size_t at = 0; data.size() - at >= sizeof(double); at += sizeof(double))
            values.push_back(load_stored(data.data() + at, Scalar::Float64, false));
    }
    if (static_cast<double>(values.size()) != count)
        throw malformed({path, 0, "header"}, "promises " + shortest(count) +
                                                 " labels (got " +
                                                 std::to_string(values.size()) + ")");
    return as_labels(path, values);
}

} // namespace

std::vector<std::int64_t> parse_labels(const std::string& path, std::string_view bytes)
{
    if (extension_of(path) == "dmat")
        return parse_dmat(path, bytes);
    if (const std::string guess = foreign_content(bytes); !guess.empty())
        throw malformed({path, 0, ""}, "this looks like " + guess + ", need labels");
    return as_labels(path, all_numbers(path, bytes));
}

std::vector<std::int64_t> read_labels(const std::string& path)
{
    return parse_labels(path, read_file(path));
}

std::shared_ptr<const std::vector<std::int64_t>> LabelFiles::read(const std::string& path)
{
    const std::lock_guard lock(mutex_);
    const auto found = read_.find(path);
    if (found != read_.end())
        return found->second;
    return read_[path] =
               std::make_shared<const std::vector<std::int64_t>>(read_labels(path));
}

HandleFile read_survey_pair(const std::string& sel, const std::string& def)
{
    const std::vector<double> values = all_numbers(def, read_file(def));
    if (values.size() != 16)
        throw malformed({def, 0, "matrix"},
                        "got " + std::to_string(values.size()) + " numbers, need 16");
    Operation operation;
    operation.kind = Operation::Kind::Matrix;
    operation.matrix = std::make_shared<const Eigen::Matrix4d>(
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data()));
    if (operation.matrix->row(3) != Eigen::RowVector4d(0, 0, 0, 1))
        throw malformed({def, 0, "matrix"}, "its last row is not 0 0 0 1");
    // Checked here, where it is known which file is to blame.
    HandleFile file;
    file.path = def;
    const auto of_samples = file.labels->read(sel);
    const std::vector<std::int64_t>& labels = *of_samples;
    for (std::size_t i = 0; i < labels.size(); ++i)
        if (labels[i] < 0 || labels[i] > 2)
            throw malformed({sel, 0, "label " + std::to_string(i)},
                            "got " + std::to_string(labels[i]) +
                                ", need 0 (fixed), 1 (free) or 2 (handle)");
    const auto has = [&](std::int64_t label)
    { return std::find(labels.begin(), labels.end(), label) != labels.end(); };
    if (!has(2))
        throw malformed({sel, 0, ""}, "no label is 2 (handle)");
    Stage& stage = file.stages.emplace_back();
    const auto region = [&](Role role, const std::string& name, std::int64_t label)
    {
        Selector selector;
        selector.kind = Selector::Kind::Labels;
        selector.name = sel;
        selector.label = label;
        stage.regions.push_back({role, name, selector, 1.0, 0});
    };
    if (has(0))
        region(Role::Fixed, "fixed", 0);
    region(Role::Handle, "handle", 2);
    stage.frames.push_back({1, {{"handle", {operation}, 0}}, 0});
    return file;
}

} // namespace cellwarp::core
