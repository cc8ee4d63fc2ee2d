// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/field.h>

#include <algorithm>
#include <array>

#include "io/base/bytes.h"
#include "io/base/output_set.h"
#include "library/access.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/session/deformation.h"
#include "library/views.h"

namespace cellwarp
{

struct Field::Data
{
    Data(core::FieldFile of, const std::string& path, double max_memory)
        : file(std::move(of)), deformation(file, path, max_memory)
    {
    }

    core::FieldFile file;
    core::Deformation deformation;
};

namespace
{

/// Places that are moved at once: large enough for all threads, small beside the caller's
/// own array.
constexpr std::size_t kAtOnce = std::size_t(1) << 18;

template <int size>
using Vectors = std::vector<Eigen::Matrix<double, size, 1>>;

/// A part of one of the caller's arrays, of which some vectors are moved.
template <int size>
class Part
{
public:
    /// Reads those that are finite, at places that are; \p number_of: of each place among
    /// those that move, or none.
    void read(const VectorsView<size>& view, std::size_t first, std::size_t count,
              std::span<const std::uint32_t> number_of)
    {
        all_.resize(count);
        read_vectors<size>(view, first, all_);
        moved_.clear();
        from_.clear();
        places_.clear();
        for (std::size_t i = 0; i < count; ++i)
            if (all_[i].allFinite() && (number_of.empty() || number_of[i] != core::kNone))
            {
                from_.push_back(static_cast<std::uint32_t>(i));
                moved_.push_back(all_[i]);
                if (!number_of.empty())
                    places_.push_back(number_of[i]);
            }
    }
    void write(const VectorsSpan<size>& out, std::size_t first)
    {
        for (std::size_t k = 0; k < from_.size(); ++k)
            all_[from_[k]] = moved_[k];
        write_vectors<size>(all_, first, out);
    }

    Vectors<size>& moved() { return moved_; }
    std::span<const std::uint32_t> from() const { return from_; }
    /// For AtPlaces; empty: there are none.
    core::AtPlaces<Eigen::Matrix<double, size, 1>> at_places()
    {
        return {places_, moved_};
    }

private:
    Vectors<size> all_, moved_;
    std::vector<std::uint32_t> from_, places_;
};

void check_count(const char* name, std::size_t count, std::size_t needed)
{
    if (count != 0 && count != needed)
        throw wrong_argument(name, "got " + std::to_string(count) +
                                       ", need one for each of " +
                                       std::to_string(needed) + " places");
}

std::size_t move_places(const core::Deformation& deformation, const PointsView& from,
                        const PointsSpan& to, const Directions& directions,
                        Watcher& watcher)
{
    check_view(from, "places");
    check_view<3>(to, "places");
    check_view<3>(directions.normals, "normals");
    check_view<3>(directions.tangents, "tangents");
    check_view<4>(directions.rotations, "rotations");
    if (to.count != from.count)
        throw wrong_argument("places", "got " + std::to_string(from.count) +
                                           " and an array for " +
                                           std::to_string(to.count));
    check_count("normals", directions.normals.count, from.count);
    check_count("tangents", directions.tangents.count, from.count);
    check_count("rotations", directions.rotations.count, from.count);

    watcher.progress().all = from.count;
    watcher.begin("samples", 0.0);
    Part<3> places, normals, tangents;
    Part<4> rotations;
    std::vector<std::uint32_t> number_of;
    std::size_t num_left = 0;
    for (std::size_t first = 0; first < from.count; first += kAtOnce)
    {
        const std::size_t count = std::min(kAtOnce, from.count - first);
        places.read(from, first, count, {});
        number_of.assign(count, core::kNone);
        for (std::size_t k = 0; k < places.from().size(); ++k)
            number_of[places.from()[k]] = static_cast<std::uint32_t>(k);
        num_left += count - places.from().size();
        if (directions.normals.count > 0)
            normals.read(directions.normals, first, count, number_of);
        if (directions.tangents.count > 0)
            tangents.read(directions.tangents, first, count, number_of);
        if (directions.rotations.count > 0)
            rotations.read(directions.rotations, first, count, number_of);
        deformation.carry({places.moved(), normals.at_places(), tangents.at_places(),
                           rotations.at_places()});
        places.write(to, first);
        if (directions.normals.count > 0)
            normals.write(directions.normals, first);
        if (directions.tangents.count > 0)
            tangents.write(directions.tangents, first);
        if (directions.rotations.count > 0)
            rotations.write(directions.rotations, first);
        watcher.progress().done = first + count;
        watcher.begin("samples", static_cast<double>(first + count) /
                                     static_cast<double>(from.count));
    }
    return num_left;
}

} // namespace

Field::Field(std::shared_ptr<const Data> data) : data_(std::move(data)) {}

Field Access::field(const core::FieldFile& file)
{
    return Field(std::make_shared<const Field::Data>(file, "", 0.0));
}

Field Field::read(const std::string& path, double max_memory)
{
    return run_call(
        [&]
        {
            return Field(
                std::make_shared<const Data>(core::read_field(path), path, max_memory));
        });
}

Field Field::parse(std::string_view bytes, double max_memory)
{
    return run_call(
        [&]
        {
            return Field(std::make_shared<const Data>(core::parse_field("", bytes), "",
                                                      max_memory));
        });
}

std::string Field::bytes() const
{
    return run_call([&] { return field_bytes(data_->file); });
}

void Field::write(const std::string& path, Overwrite overwrite) const
{
    run_call(
        [&]
        {
            core::write_file(path, field_bytes(data_->file),
                             overwrite == Overwrite::Yes ? core::Overwrite::Yes
                                                         : core::Overwrite::No);
        });
}

std::size_t Field::apply(PointsSpan places, const Directions& directions,
                         const Control& control, int threads) const
{
    return run_call(
        control, threads,
        [&](Watcher& watcher)
        { return move_places(data_->deformation, places, places, directions, watcher); });
}

std::size_t Field::apply_to(PointsSpan to, PointsView from, const Control& control,
                            int threads) const
{
    return run_call(control, threads,
                    [&](Watcher& watcher)
                    { return move_places(data_->deformation, from, to, {}, watcher); });
}

std::size_t Field::num_maps() const
{
    return data_->deformation.num_maps();
}

std::uint64_t Field::num_outside(PointsView places) const
{
    return run_call(
        [&]
        {
            check_view(places, "places");
            std::uint64_t count = 0;
            Part<3> part;
            for (std::size_t first = 0; first < places.count; first += kAtOnce)
            {
                part.read(places, first, std::min(kAtOnce, places.count - first), {});
                count += data_->deformation.num_outside(part.moved());
            }
            return count;
        });
}

} // namespace cellwarp
