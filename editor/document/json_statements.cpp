// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/json_statements.h"

#include <algorithm>
#include <array>

#include "io/base/error.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

using Json = nlohmann::ordered_json;

constexpr std::array kRoles = {"fixed", "handle", "pin", "stiff", "rod", "curve"};
constexpr std::array kSelectors = {"box",    "sphere", "capsule", "halfspace", "indices",
                                   "labels", "group",  "all",     "spline"};
constexpr std::array kOperations = {"translate", "rotate", "matrix",
                                    "to",        "turn",   "tangent"};
constexpr std::array kPlaces = {"whole", "point", "start", "end"};

template <class Kind, std::size_t n>
Kind kind_of(const Json& word, const std::array<const char*, n>& words)
{
    const std::string text = word.get<std::string>();
    const auto found = std::find(words.begin(), words.end(), text);
    if (found == words.end())
        throw std::invalid_argument("unknown word " + in_quotes(text));
    return static_cast<Kind>(found - words.begin());
}

Eigen::Vector3d vector_of(const Json& json)
{
    const auto v = json.get<std::array<double, 3>>();
    return {v[0], v[1], v[2]};
}

RegionStatement region_of(const Json& json)
{
    RegionStatement region;
    if (json.contains("line"))
    {
        const Stage stage = parse_statements("line", json["line"].get<std::string>());
        if (stage.regions.size() != 1 || !stage.regions[0].spline)
            throw std::invalid_argument("the line is no rod and no curve");
        return stage.regions[0];
    }
    region.role = kind_of<Role>(json.at("role"), kRoles);
    region.name = json.at("name").get<std::string>();
    region.factor = json.at("factor").get<double>();
    region.selector.kind = kind_of<Selector::Kind>(json.at("by"), kSelectors);
    if (json.contains("numbers"))
        region.selector.numbers = json["numbers"].get<std::vector<double>>();
    if (json.contains("runs"))
        region.selector.ranges = runs_of(json["runs"]);
    region.selector.name = json.value("of", std::string());
    region.selector.label = json.value("label", std::int64_t(0));
    return region;
}

Operation operation_of(const Json& json)
{
    Operation operation;
    operation.kind = kind_of<Operation::Kind>(json.at("kind"), kOperations);
    if (operation.kind == Operation::Kind::Matrix)
    {
        const auto rows = json.at("rows").get<std::array<double, 16>>();
        operation.matrix = std::make_shared<const Eigen::Matrix4d>(
            Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows.data()));
        return operation;
    }
    operation.vector = vector_of(json.at("vector"));
    operation.degrees = json.value("degrees", 0.0);
    if (json.contains("about"))
        operation.about = vector_of(json["about"]);
    return operation;
}

FrameStatement frame_of(const Json& json)
{
    FrameStatement frame;
    frame.number = json.at("number").get<std::int64_t>();
    for (const Json& move_json : json.at("moves"))
    {
        Move& move = frame.moves.emplace_back();
        move.region = move_json.at("region").get<std::string>();
        if (move_json.contains("at"))
        {
            move.place.kind = kind_of<MovePlace::Kind>(move_json["at"].at(0), kPlaces);
            move.place.point = move_json["at"].at(1).get<std::int64_t>();
        }
        move.chain = move_json.value("chain", std::string());
        if (move_json.contains("released"))
        {
            const auto parts = move_json["released"].get<std::array<bool, 3>>();
            move.released = HoldParts{parts[0], parts[1], parts[2]};
        }
        for (const Json& operation : move_json.at("do"))
            move.operations.push_back(operation_of(operation));
    }
    return frame;
}

} // namespace

std::vector<SampleRun> runs_of(const Json& json)
{
    if (json.size() % 2 != 0)
        throw std::invalid_argument("runs come in pairs");
    std::vector<SampleRun> runs;
    for (std::size_t k = 0; k + 1 < json.size(); k += 2)
        runs.emplace_back(json.at(k).get<std::int64_t>(),
                          json.at(k + 1).get<std::int64_t>());
    return runs;
}

std::vector<RegionStatement> regions_of(const Json& json)
{
    std::vector<RegionStatement> regions;
    for (const Json& region : json)
        regions.push_back(region_of(region));
    return regions;
}

std::vector<FrameStatement> frames_of(const Json& json)
{
    std::vector<FrameStatement> frames;
    for (const Json& frame : json)
        frames.push_back(frame_of(frame));
    return frames;
}

std::vector<OnStatement> ons_of(const Json& json)
{
    std::vector<OnStatement> ons;
    for (const Json& one : json)
    {
        OnStatement& on = ons.emplace_back();
        on.pin = one.at("pin").get<std::string>();
        on.guide = one.at("guide").get<std::string>();
        if (one.contains("at"))
            on.at = one["at"].get<double>();
    }
    return ons;
}

} // namespace cellwarp::core
