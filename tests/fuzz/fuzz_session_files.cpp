// SPDX-License-Identifier: GPL-3.0-or-later
// Handle, scene and label readers on arbitrary bytes: a value or an Error; what a handle
// file or a scene says is written as a text that says the same.
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "io/base/error.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"

using namespace cellwarp::core;

namespace
{

void require(bool condition)
{
    if (!condition)
        std::abort();
}

bool same_bits(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b)
{
    return a.size() == b.size() &&
           std::memcmp(a.data(), b.data(), 8 * std::size_t(a.size())) == 0;
}

void require_same(const Move& a, const Move& b)
{
    require(a.region == b.region && a.operations.size() == b.operations.size());
    for (std::size_t k = 0; k < a.operations.size(); ++k)
    {
        const Operation &x = a.operations[k], &y = b.operations[k];
        require(x.kind == y.kind && same_bits(x.vector, y.vector));
        const RigidMove &moves = x.move, &others = y.move;
        require(same_bits(moves.translation, others.translation));
        require(same_bits(moves.axis, others.axis));
        require(std::memcmp(&moves.degrees, &others.degrees, sizeof moves.degrees) == 0);
        require(x.is_about_border == y.is_about_border);
        require(moves.pivot.has_value() == others.pivot.has_value());
        require(!moves.pivot || same_bits(*moves.pivot, *others.pivot));
        require(!x.matrix == !y.matrix);
        require(!x.matrix || same_bits(*x.matrix, *y.matrix));
    }
}

/// What the selectors of a stage say; a list that became several statements is one.
std::vector<double> numbers_of(const Stage& stage)
{
    std::vector<double> numbers;
    for (const RegionStatement& region : stage.regions)
    {
        for (const auto& [first, last] : region.selector.ranges)
            numbers.insert(numbers.end(), {double(first), double(last), region.factor});
        numbers.insert(numbers.end(), region.selector.numbers.begin(),
                       region.selector.numbers.end());
        if (region.selector.kind == Selector::Kind::Labels)
            numbers.push_back(double(region.selector.label));
    }
    return numbers;
}

void check_handles(const std::string& text)
{
    const HandleFile file = parse_handles("dir/h.handles", text);
    std::string printed;
    try
    {
        printed = handle_text(file);
    }
    catch (const Error& error)
    {
        // A label file of another folder may have a name that is none from here.
        require(error.fault() == Fault::Usage || error.fault() == Fault::File);
        return;
    }
    const HandleFile again = parse_handles("dir/h.handles", printed);
    require(handle_text(again) == printed);
    require(again.is_relative == file.is_relative);
    require(again.stages.size() == file.stages.size());
    for (std::size_t s = 0; s < file.stages.size(); ++s)
    {
        const Stage &a = file.stages[s], &b = again.stages[s];
        const std::vector<double> said = numbers_of(a), read = numbers_of(b);
        require(said.size() == read.size() && b.frames.size() == a.frames.size());
        require(said.empty() ||
                std::memcmp(said.data(), read.data(), 8 * said.size()) == 0);
        for (std::size_t f = 0; f < a.frames.size(); ++f)
        {
            require(a.frames[f].moves.size() == b.frames[f].moves.size());
            for (std::size_t m = 0; m < a.frames[f].moves.size(); ++m)
                require_same(a.frames[f].moves[m], b.frames[f].moves[m]);
        }
    }
}

void check_scene(const std::string& text)
{
    const SceneFile scene = parse_scene("dir/s.json", text);
    const std::string printed = scene_text(scene);
    const SceneFile again = parse_scene("dir/s.json", printed);
    require(again.unknown_keys.size() == scene.unknown_keys.size()); // they are kept
    require(scene_text(again) == printed);
    require(again.settings.cells.threshold == scene.settings.cells.threshold &&
            again.settings.cells.gap == scene.settings.cells.gap);
    require(again.settings.cells.across == scene.settings.cells.across &&
            again.settings.cells.max_cells == scene.settings.cells.max_cells);
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    if (size == 0)
        return 0;
    const std::string text(reinterpret_cast<const char*>(data) + 1, size - 1);
    try
    {
        switch (data[0] % 4)
        {
        case 0:
            check_handles(text);
            break;
        case 1:
            check_scene(text);
            break;
        case 2:
            parse_labels("x.sel", text);
            break;
        default:
            parse_labels("x.dmat", text);
            break;
        }
    }
    catch (const Error&)
    {
    }
    return 0;
}
