// SPDX-License-Identifier: GPL-3.0-or-later
// For now one twist about the z axis: "cellwarp-field twist RADIANS_A_UNIT".
#include "editor/session/deformation.h"

#include <cmath>
#include <optional>

#include "io/bytes.h"
#include "io/error.h"
#include "io/number.h"
#include "io/text.h"
#include "octree/parallel.h"
#include "solver/field/blend.h"

namespace cellwarp
{

namespace
{

constexpr std::size_t kGrain = 1024;

} // namespace

Deformation::Deformation(const std::string& field_path)
{
    const std::string bytes = read_file(field_path);
    Tokens tokens(std::string_view(bytes).substr(0, bytes.find('\n')), 0);
    Token magic, kind, number;
    tokens.next(magic);
    tokens.next(kind);
    tokens.next(number);
    const std::optional<double> rate = parse_double(number.text);
    if (magic.text != "cellwarp-field" || kind.text != "twist" || !rate ||
        !std::isfinite(*rate))
        throw malformed({field_path, 0, ""}, "is no field (got " + in_quotes(magic.text) +
                                                 ", need 'cellwarp-field')");
    rate_ = *rate;
}

void Deformation::move(std::span<Eigen::Vector3d> places, Directions normals,
                       Directions tangents, Rotations, std::stop_token stop) const
{
    const auto twist = [&](const Eigen::Vector3d& x)
    {
        const double c = std::cos(rate_ * x.z()), s = std::sin(rate_ * x.z());
        Eigen::Matrix3d J;
        J << c, -s, -rate_ * (s * x.x() + c * x.y()), //
            s, c, rate_ * (c * x.x() - s * x.y()),    //
            0, 0, 1;
        return J;
    };
    parallel_ranges(normals.points.size(), kGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                            normals.vectors[i] = turned_normal(
                                twist(places[normals.points[i]]), normals.vectors[i]);
                    });
    parallel_ranges(tangents.points.size(), kGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                            tangents.vectors[i] =
                                twist(places[tangents.points[i]]) * tangents.vectors[i];
                    });
    parallel_ranges(
        places.size(), kGrain,
        [&](std::size_t begin, std::size_t end)
        {
            for (std::size_t i = begin; i < end && !stop.stop_requested(); ++i)
            {
                const Eigen::Vector3d x = places[i];
                const double c = std::cos(rate_ * x.z()), s = std::sin(rate_ * x.z());
                places[i] = {c * x.x() - s * x.y(), s * x.x() + c * x.y(), x.z()};
            }
        });
}

} // namespace cellwarp
