// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/model.h>

#include <cmath>
#include <cstring>
#include <limits>

#include <Eigen/Core>

#include "tests/support/files.h"
#include "tests/support/interface.h"

namespace cellwarp
{

using support::contains;
using support::error_of;
using support::numbers;

namespace
{

struct Vertex // of a buffer for a graphics card
{
    float place[3], normal[3], uv[2];
};

const std::vector<double> kPlaces = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
const std::vector<std::array<std::uint32_t, 3>> kFaces = {
    {0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

std::vector<double> samples_of(const PointsView& view)
{
    ShapeView shape;
    shape.samples = view;
    return numbers(Model(shape).samples());
}

ShapeView tetrahedron()
{
    ShapeView shape;
    shape.samples = kPlaces;
    shape.faces = kFaces;
    return shape;
}

std::vector<std::uint32_t> corners_of(const FacesView& faces)
{
    ShapeView shape = tetrahedron();
    shape.faces = faces;
    const Model model(shape);
    return {model.corners().begin(), model.corners().end()};
}

} // namespace

TEST(Model, takes_places_of_every_layout)
{
    const std::size_t n = kPlaces.size() / 3;
    const std::vector<float> floats(kPlaces.begin(), kPlaces.end());
    std::vector<std::array<double, 3>> arrays(n);
    std::vector<std::array<float, 3>> float_arrays(n);
    std::vector<Eigen::Vector3d> eigen(n);
    Eigen::MatrixXd columns(n, 3); // as in libigl
    std::vector<Vertex> vertices(n);
    std::vector<double> backwards(kPlaces.rbegin(), kPlaces.rend());
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t k = 0; k < 3; ++k)
        {
            const double number = kPlaces[3 * i + k];
            arrays[i][k] = number;
            float_arrays[i][k] = static_cast<float>(number);
            eigen[i][static_cast<Eigen::Index>(k)] = number;
            columns(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)) = number;
            vertices[i].place[k] = static_cast<float>(number);
        }
    EXPECT_EQ(samples_of(kPlaces), kPlaces);
    EXPECT_EQ(samples_of(std::span<const double>(kPlaces)), kPlaces);
    EXPECT_EQ(samples_of(floats), kPlaces);
    EXPECT_EQ(samples_of(arrays), kPlaces);
    EXPECT_EQ(samples_of(float_arrays), kPlaces);
    EXPECT_EQ(samples_of(eigen), kPlaces);
    EXPECT_EQ(samples_of(PointsView::columns(columns.data(), n)), kPlaces);
    EXPECT_EQ(samples_of(PointsView(vertices, Scalar::Float32)), kPlaces);
    PointsView reversed;
    reversed.data = backwards.data() + backwards.size() - 1;
    reversed.count = n;
    reversed.stride = -3 * static_cast<std::ptrdiff_t>(sizeof(double));
    reversed.axis = -static_cast<std::ptrdiff_t>(sizeof(double));
    EXPECT_EQ(samples_of(reversed), kPlaces);
    // Numbers at odd addresses.
    std::vector<char> bytes(1 + kPlaces.size() * sizeof(double));
    std::memcpy(bytes.data() + 1, kPlaces.data(), kPlaces.size() * sizeof(double));
    PointsView odd;
    odd.data = bytes.data() + 1;
    odd.count = n;
    EXPECT_EQ(samples_of(odd), kPlaces);
}

TEST(Model, takes_faces_of_every_layout)
{
    std::vector<std::uint32_t> expected;
    std::vector<std::int64_t> wide;
    Eigen::MatrixXi columns(kFaces.size(), 3);
    for (std::size_t f = 0; f < kFaces.size(); ++f)
        for (std::size_t k = 0; k < 3; ++k)
        {
            expected.push_back(kFaces[f][k]);
            wide.push_back(kFaces[f][k]);
            columns(static_cast<Eigen::Index>(f), static_cast<Eigen::Index>(k)) =
                static_cast<int>(kFaces[f][k]);
        }
    const std::vector<std::uint64_t> ends = {3, 6, 9, 12};
    EXPECT_EQ(corners_of(kFaces), expected);
    EXPECT_EQ(corners_of(FacesView::packed(std::span<const std::uint32_t>(expected))),
              expected);
    EXPECT_EQ(corners_of(FacesView::packed(std::span<const std::int64_t>(wide))),
              expected);
    EXPECT_EQ(corners_of(FacesView::columns(columns.data(), kFaces.size())), expected);
    EXPECT_EQ(corners_of(FacesView::polygons(std::span<const std::int64_t>(wide), ends)),
              expected);
    const std::vector<std::array<int, 4>> quads = {{0, 1, 2, 3}};
    EXPECT_EQ(corners_of(quads), (std::vector<std::uint32_t>{0, 1, 2, 3}));
}

TEST(Model, keeps_order_and_number_of_samples)
{
    ShapeView shape = tetrahedron();
    std::vector<double> more = kPlaces;
    more.insert(more.end(), {0, 0, 0, 9, 9, 9}); // coincident, and without a face
    shape.samples = more;
    const Model model(shape);
    EXPECT_EQ(model.num_samples(), 6u);
    EXPECT_EQ(model.num_faces(), 4u);
    EXPECT_EQ(numbers(model.samples()), more);
    EXPECT_EQ(model.face_ends(), (std::vector<std::uint64_t>{3, 6, 9, 12}));
    EXPECT_EQ(model.box().high, (Vec3{9, 9, 9}));
    EXPECT_NEAR(model.diagonal(), 9 * std::sqrt(3.0), 1e-12);
    EXPECT_EQ(model.path(), "");
}

TEST(Model, names_the_first_wrong_number)
{
    const auto error = [](auto&& change)
    {
        ShapeView shape = tetrahedron();
        std::vector<double> places = kPlaces;
        auto faces = kFaces;
        change(places, faces);
        shape.samples = places;
        shape.faces = faces;
        return error_of(Fault::Malformed, [&] { Model{shape}; });
    };
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(contains(error([&](auto& places, auto&) { places[7] = nan; }),
                         "samples[2][1]: got nan"));
    EXPECT_TRUE(contains(error([&](auto& places, auto&) { places[0] = INFINITY; }),
                         "samples[0][0]: got inf"));
    EXPECT_TRUE(contains(error([&](auto& places, auto&) { places[3] = 1e200; }),
                         "samples[1]: is beyond 1e150"));
    EXPECT_TRUE(contains(error([&](auto&, auto& faces) { faces[2][1] = 4; }),
                         "faces[2][1]: got 4, there are 4 samples"));
    EXPECT_TRUE(contains(error([&](auto& places, auto&) { places.clear(); }),
                         "samples: there is none"));
    ShapeView shape = tetrahedron();
    const std::vector<std::array<int, 3>> negative = {{0, 1, -1}};
    shape.faces = negative;
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { Model{shape}; }),
                         "faces[0][2]: got -1"));
    const std::vector<std::array<std::int64_t, 3>> huge = {{0, std::int64_t(1) << 32, 1}};
    shape.faces = huge;
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { Model{shape}; }),
                         "faces[0][1]: got 4294967296"));
    const std::vector<std::uint32_t> corners = {0, 1, 2};
    const std::vector<std::uint64_t> falling = {2, 1}, beyond = {3, 3};
    shape.faces = FacesView::polygons(std::span(corners), falling);
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { Model{shape}; }),
                         "faces.ends[1]: got 1"));
    shape.faces = FacesView::polygons(std::span(corners), beyond);
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { Model{shape}; }),
                         "faces.ends[1]: got 3"));
    const std::vector<std::uint64_t> short_one = {2};
    shape.faces = FacesView::polygons(std::span(corners), short_one);
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { Model{shape}; }), "faces[0]"));
}

TEST(Model, refuses_arrays_that_do_not_fit_each_other)
{
    ShapeView shape = tetrahedron();
    const std::vector<double> three = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    shape.normals = three;
    EXPECT_TRUE(contains(error_of(Fault::Usage, [&] { Model{shape}; }),
                         "normals: got 3, need one for each of 4 samples"));
    shape = tetrahedron();
    shape.corner_normals = three;
    EXPECT_TRUE(contains(error_of(Fault::Usage, [&] { Model{shape}; }),
                         "corner_normals: got 3, need one for each of 12 corners"));
    shape = tetrahedron();
    shape.rotations = three;
    EXPECT_TRUE(contains(error_of(Fault::Usage, [&] { Model{shape}; }), "rotations"));
    shape = tetrahedron();
    const std::vector<double> eleven(11);
    shape.samples = eleven;
    EXPECT_TRUE(contains(error_of(Fault::Usage, [&] { Model{shape}; }),
                         "samples: its numbers are no multiple of 3"));
    shape.samples = PointsView();
    shape.samples.count = 5;
    EXPECT_TRUE(contains(error_of(Fault::Usage, [&] { Model{shape}; }), "null"));
    shape = tetrahedron();
    shape.groups = {{"all", 0, 5}};
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { Model{shape}; }), "groups[0]"));
    const std::vector<std::array<std::uint32_t, 2>> lines = {{0, 7}};
    shape = tetrahedron();
    shape.lines = lines;
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, [&] { Model{shape}; }), "lines[0][1]"));
}

TEST(Model, refuses_directions_that_are_none)
{
    ShapeView shape = tetrahedron();
    std::vector<double> tangents(12, 1.0);
    tangents[5] = -INFINITY;
    shape.tangents = tangents;
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { Model{shape}; }),
                         "tangents[1][2]: got -inf"));
    shape = tetrahedron();
    const std::vector<double> rotations(16, 0.0);
    shape.rotations = rotations;
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { Model{shape}; }),
                         "rotations[0]: has no length"));
}

TEST(Model, reads_files_and_names_them_in_errors)
{
    const core::support::Folder folder;
    const std::string path = core::support::samples_folder() + "/bar.obj";
    const Model model = Model::read(path);
    EXPECT_EQ(model.num_samples(), 4610u);
    EXPECT_EQ(model.path(), path);
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { Model::read(folder / "none.obj"); }),
                         "none.obj"));
    EXPECT_TRUE(contains(
        error_of(Fault::Usage, [&] { Model::read(folder / "none.what"); }), "what"));
    const std::string wrong = folder.write("wrong.obj", "v 0 0 0\nf 1 2 3\n");
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, [&] { Model::read(wrong); }), "wrong.obj:2"));
    ReadSettings little;
    little.max_memory = 1.0;
    error_of(Fault::Budget, [&] { Model::read(path, little); });
}

} // namespace cellwarp
