// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/field_file.h"

#include <functional>
#include <limits>

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

constexpr double kUnit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

/// Two cells of one voxel each, both in one RBF of one centre, with a region.
StoredField small_field()
{
    StoredField f;
    std::copy(kUnit, kUnit + 9, f.axes.begin());
    f.origin = {5, 6, 7};
    f.exponent = -2;
    f.size = {2, 1, 1};
    f.coarsest = {2, 1, 1};
    f.edge = 1.0;
    f.voxels_per_leaf = 1;
    f.run_lengths = {1, 1};
    f.run_pieces = {0, 1};
    f.box_centres = f.centres = {0.5, 0.5, 0.5, 1.5, 0.5, 0.5};
    f.edges = {1, 1};
    f.first_neighbour = {0, 1, 2};
    f.neighbours = {1, 0};
    for (int cell = 0; cell < 2; ++cell)
    {
        f.poses.insert(f.poses.end(), kUnit, kUnit + 9);
        f.poses.insert(f.poses.end(), {0.5 + cell, 0.75, 0.5});
    }
    f.is_idle = {0, 0};
    f.kind = 2;
    f.num_centres = 1;
    f.first_membership = {0, 1, 2};
    f.membership_fits = {0, 0};
    f.membership_weights = {1.0, 0.5};
    f.first_centre = {0, 1};
    f.rbf_origins = {1, 0.5, 0.5};
    f.rbf_polynomials.assign(30, 0.25);
    f.rbf_centres = {0, 0, 0, 0.1, 0.2, 0.3};
    StoredRegion& region = f.regions.emplace_back();
    std::copy(kUnit, kUnit + 9, region.motion.begin());
    region.radius = 1.5;
    region.nodes = {0.25, 0.5, 0.5};
    region.node_cells = {0};
    region.misses.assign(12, 0.01);
    region.near_cells = {0, 1};
    region.deep_cells = {0};
    return f;
}

std::string bytes_of(const StoredField& field)
{
    return field_bytes({{field}});
}

void expect_refused(const std::function<void(StoredField&)>& spoil, const char* message)
{
    StoredField field = small_field();
    spoil(field);
    const std::string bytes = bytes_of(field);
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { parse_field("f.cwf", bytes); }),
                         message))
        << error_of(Fault::Malformed, [&] { parse_field("f.cwf", bytes); });
}

} // namespace

TEST(FieldFile, comes_back_as_it_was)
{
    const std::string bytes = field_bytes({{small_field(), small_field()}});
    const FieldFile file = parse_field("f.cwf", bytes);
    ASSERT_EQ(file.stages.size(), 2u);
    EXPECT_EQ(field_bytes(file), bytes);
    EXPECT_EQ(file.stages[1].regions[0].misses, small_field().regions[0].misses);
    EXPECT_EQ(file.stages[1].exponent, -2);
    EXPECT_NE(file.checksum, 0u);
}

TEST(FieldFile, stands_byte_by_byte_as_documented)
{
    const std::string bytes = bytes_of(small_field());
    EXPECT_EQ(bytes.substr(0, 16), std::string("cwfield\n\1\0\0\0\1\0\0\0", 16));
    EXPECT_EQ(bytes.substr(16, 24),
              std::string("origin\0\0\0\0\0\0\3\0\0\0\3\0\0\0\0\0\0\0", 24));
    double origin[3];
    std::copy(bytes.data() + 40, bytes.data() + 64, reinterpret_cast<char*>(origin));
    EXPECT_EQ(origin[2], 7.0);
    EXPECT_EQ(bytes.substr(bytes.size() - 32, 3), "end");
}

TEST(FieldFile, is_refused_wherever_it_is_cut)
{
    const std::string bytes = bytes_of(small_field());
    for (std::size_t length = 0; length < bytes.size(); ++length)
        EXPECT_THROW(parse_field("f.cwf", std::string_view(bytes).substr(0, length)),
                     Error)
            << length;
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { parse_field("f.cwf", bytes.substr(0, 700)); }),
        "cut off"));
}

TEST(FieldFile, is_refused_whichever_byte_is_altered)
{
    std::string bytes = bytes_of(small_field());
    for (std::size_t i = 0; i < bytes.size(); ++i)
    {
        bytes[i] = static_cast<char>(bytes[i] ^ 0x10);
        EXPECT_THROW(parse_field("f.cwf", bytes), Error) << i;
        bytes[i] = static_cast<char>(bytes[i] ^ 0x10);
    }
}

TEST(FieldFile, of_another_kind_or_version_says_so)
{
    std::string bytes = bytes_of(small_field());
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [] { parse_field("f.cwf", "ply\nformat ascii"); }),
        "no field file"));
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, [] { parse_field("f.cwf", ""); }), "empty"));
    bytes[8] = 9;
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { parse_field("f.cwf", bytes); }),
                         "made by version 9"));
}

TEST(FieldFile, whose_parts_contradict_each_other_is_refused)
{
    expect_refused([](StoredField& f) { f.neighbours[0] = 2; }, "neighbours");
    expect_refused([](StoredField& f) { f.first_neighbour[1] = 3; }, "neighbours");
    expect_refused([](StoredField& f) { f.run_pieces[0] = 7; }, "belongs to no cell");
    expect_refused([](StoredField& f) { f.edges.push_back(1); }, "differ in length");
    expect_refused([](StoredField& f) { f.edges[0] = 0; }, "not of a size");
    expect_refused([](StoredField& f) { f.edges[0] = 1e308; }, "not of a size");
    expect_refused([](StoredField& f) { f.box_centres[1] = 1e9; }, "outside of the box");
    expect_refused([](StoredField& f) { f.exponent = 5000; }, "scale");
    expect_refused([](StoredField& f) { f.poses[0] = 2; }, "pose");
    expect_refused([](StoredField& f) { f.axes[0] = -1; }, "axes");
    expect_refused([](StoredField& f) { f.kind = 5; }, "kind");
    expect_refused([](StoredField& f) { f.membership_fits[0] = 1; }, "memberships");
    expect_refused([](StoredField& f) { f.membership_fits[0] = -2; }, "memberships");
    expect_refused([](StoredField& f) { f.first_membership = {0, 0, 2}; }, "no RBF");
    expect_refused([](StoredField& f) { f.membership_weights[0] = 0; }, "weight");
    expect_refused([](StoredField& f) { f.first_centre = {0, 2}; }, "RBFs");
    expect_refused(
        [](StoredField& f)
        {
            f.kind = 3, f.rbf_origins.clear(), f.rbf_polynomials.clear(),
            f.rbf_centres.clear(), f.first_centre = {0};
        },
        "global RBF");
    expect_refused([](StoredField& f)
                   { f.rbf_centres[0] = std::numeric_limits<double>::infinity(); },
                   "not finite");
    expect_refused([](StoredField& f) { f.regions[0].near_cells = {1, 0}; }, "region");
    expect_refused([](StoredField& f) { f.regions[0].node_cells = {}; }, "nodes");
    expect_refused([](StoredField& f) { f.regions[0].radius = 0; }, "radius");
    expect_refused(
        [](StoredField& f) {
            f.coarsest = {1 << 30, 1 << 30, 1 << 30};
        },
        "too large");
    expect_refused([](StoredField& f) { f.max_depth = 21; }, "grid");
}

TEST(FieldFile, claims_no_more_voxels_than_a_file_of_its_size_may)
{
    StoredField field = small_field();
    // 1625 voxels along each axis, all of one cell: one run.
    field.voxels_per_leaf = 1625;
    field.coarsest = {1, 1, 1};
    field.size = {2, 2, 2};
    field.edge = 2.0;
    field.edges = {2, 2};
    field.run_lengths = {4000000000u};
    field.run_pieces = {0};
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { parse_field("f.cwf", bytes_of(field)); }),
        "the grid is too large for a file of this size (got 4000000000 "
        "voxels, need "));
    // Many maps that claim a little each claim as much.
    field.run_lengths = {30000000u};
    const StoredField& one = field;
    EXPECT_NO_THROW(parse_field("f.cwf", bytes_of(one)));
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed,
                          [&] {
                              parse_field("f.cwf", field_bytes({{one, one, one, one}}));
                          }),
                 "the grid is too large for a file of this size"));
}

} // namespace cellwarp::core
