// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/field.h>

#include <cmath>
#include <limits>
#include <random>

#include <cellwarp/session.h>

#include "tests/support/files.h"
#include "tests/support/interface.h"

namespace cellwarp
{

using support::Bar;
using support::bend;
using support::coarse;
using support::contains;
using support::error_of;
using support::numbers;

namespace
{

Session bent(const Model& model, Edit edit = bend())
{
    Session session(model, std::move(edit), coarse());
    while (session.next())
    {
    }
    return session;
}

} // namespace

TEST(Field, moves_the_samples_of_the_model_to_where_the_session_has_them)
{
    const Model model{Bar()};
    const Session session = bent(model);
    std::vector<double> places = numbers(model.samples());
    EXPECT_EQ(session.field().apply(places), 0u);
    EXPECT_TRUE(places == numbers(session.deformed().samples()));
}

TEST(Field, holds_the_maps_of_all_commits_also_after_a_change)
{
    const Model model{Bar()};
    Edit edit = bend(20.0);
    edit.commit()
        .fixed("foot", Selector::box({0, 0, 0}, {1, 1, 0.1}))
        .handle("head", Selector::box({0, 0, 0.9}, {1, 1, 1}));
    Edit other = edit;
    edit.frame(2).move("head", {translate({0, 0, 0.1})});
    other.frame(2).move("head", {translate({0, 0, -0.1})});
    Session session = bent(model, edit);
    session.set_edit(other);
    session.next();
    const Field field = session.field();
    EXPECT_EQ(field.num_maps(), 2u);
    std::vector<double> places = numbers(model.samples());
    field.apply(places);
    EXPECT_TRUE(places == numbers(session.deformed().samples()));
}

TEST(Field, gives_the_same_bits_however_arrays_are_cut)
{
    const Model model{Bar()};
    const Field field = bent(model).field();
    std::mt19937 random(7);
    std::uniform_real_distribution<double> at(-1.0, 6.0);
    std::vector<double> whole(3 * 5000);
    for (double& number : whole)
        number = at(random);
    std::vector<double> parts = whole, columns(whole.size());
    const std::vector<double> rest = whole;
    field.apply(whole);
    for (std::size_t first = 0; first < parts.size(); first += 3 * 777)
        field.apply(std::span(parts).subspan(
            first, std::min<std::size_t>(3 * 777, parts.size() - first)));
    EXPECT_TRUE(parts == whole);
    field.apply_to(PointsSpan::columns(columns.data(), columns.size() / 3), rest, {}, 1);
    for (std::size_t i = 0; i < columns.size(); ++i)
        EXPECT_EQ(columns[i % 3 * (columns.size() / 3) + i / 3], whole[i]);
    const Field again = Field::parse(field.bytes());
    std::vector<double> by_bytes = rest;
    again.apply(by_bytes);
    EXPECT_TRUE(by_bytes == whole);
}

TEST(Field, takes_floats_in_the_middle_of_structures)
{
    struct Vertex
    {
        float place[3], colour[4];
    };
    const Model model{Bar()};
    const Field field = bent(model).field();
    std::vector<Vertex> vertices = {{{0.5f, 0.5f, 4.9f}, {1, 2, 3, 4}},
                                    {{0.5f, 0.5f, 0.1f}, {5, 6, 7, 8}}};
    std::vector<double> doubles = {0.5f, 0.5f, 4.9f, 0.5f, 0.5f, 0.1f};
    field.apply(PointsSpan(vertices, Scalar::Float32));
    field.apply(doubles);
    for (std::size_t i = 0; i < 6; ++i)
        EXPECT_EQ(vertices[i / 3].place[i % 3], static_cast<float>(doubles[i]));
    EXPECT_EQ(vertices[1].colour[3], 8.0f);
    EXPECT_NE(vertices[0].place[1], 0.5f);
}

TEST(Field, leaves_places_that_are_not_finite)
{
    const Field field = bent(Model(Bar())).field();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    std::vector<double> places = {nan, 0, 0, 0.5, 0.5, 4.9, 0, INFINITY, 0};
    std::vector<double> normals = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    std::vector<double> rotations = {1, 0, 0, 0, nan, 0, 0, 0, 1, 0, 0, 0};
    EXPECT_EQ(field.apply(places, {.normals = normals, .rotations = rotations}), 2u);
    EXPECT_TRUE(std::isnan(places[0]));
    EXPECT_EQ(places[7], INFINITY);
    EXPECT_NE(places[4], 0.5);
    EXPECT_EQ(normals[2], 1.0);
    EXPECT_NEAR(normals[5], std::sqrt(0.5),
                0.02); // beside the end that turns by 45 degrees
    EXPECT_TRUE(std::isnan(rotations[4]));
    EXPECT_EQ(rotations[8], 1.0);
}

TEST(Field, refuses_arrays_that_do_not_fit_each_other)
{
    const Field field = bent(Model(Bar())).field();
    std::vector<double> two(6), three(9), four(4);
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, [&] { field.apply(two, {.normals = three}); }),
                 "normals"));
    error_of(Fault::Usage, [&] { field.apply_to(three, two); });
    error_of(Fault::Usage, [&] { field.apply(four); });
    error_of(Fault::Malformed, [] { Field::parse("cwfield"); });
    std::vector<double> none;
    EXPECT_EQ(field.apply(none), 0u);
}

TEST(Field, is_kept_in_a_file)
{
    const core::support::Folder folder;
    const Field field = bent(Model(Bar())).field();
    field.write(folder / "a.cwf");
    EXPECT_EQ(Field::read(folder / "a.cwf").bytes(), field.bytes());
    error_of(Fault::File, [&] { field.write(folder / "a.cwf"); });
    error_of(Fault::Budget, [&] { Field::read(folder / "a.cwf", 1.0); });
}

TEST(Field, counts_places_far_outside)
{
    const Field field = bent(Model(Bar())).field();
    const std::vector<double> places = {0.5, 0.5, 2.5, 0.5, 0.5, 50.0};
    EXPECT_EQ(field.num_outside(places), 1u);
}

TEST(Field, stops_when_it_is_asked_to)
{
    const Field field = bent(Model(Bar())).field();
    std::stop_source source;
    source.request_stop();
    Control control;
    control.stop = source.get_token();
    std::vector<double> places(3000, 0.5);
    error_of(Fault::Stopped, [&] { field.apply(places, {}, control); });
}

} // namespace cellwarp
