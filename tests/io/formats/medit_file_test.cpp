// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/medit_file.h"

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

const std::string kCube = "MeshVersionFormatted 2\nDimension 3\n# a cube\nVertices\n8\n"
                          "0 0 0 0\n1 0 0 0\n1 1 0 0\n0 1 0 0\n"
                          "0 0 1 0\n1 0 1 0\n1 1 1 0\n0 1 1 7\n"
                          "Hexahedra\n1\n1 2 3 4 5 6 7 8 3\n"
                          "Edges\n1\n1 5 2\nEnd\n";

std::string message_of(const std::string& text)
{
    try
    {
        parse_medit("x.mesh", text);
    }
    catch (const Error& error)
    {
        EXPECT_EQ(error.fault(), Fault::Malformed);
        return error.what();
    }
    return "";
}

std::string with(const std::string& old, const std::string& now)
{
    std::string text = kCube;
    text.replace(text.find(old), old.size(), now);
    return text;
}

} // namespace

TEST(MeditFile, cells_vertices_and_edges_are_read)
{
    const MeditMesh mesh = parse_medit("x.mesh", kCube);
    ASSERT_EQ(mesh.vertices.size(), 8u);
    EXPECT_EQ(mesh.vertices[6], Eigen::Vector3d(1, 1, 1));
    ASSERT_EQ(mesh.hexahedra.size(), 1u);
    EXPECT_EQ(mesh.hexahedra[0].vertices, (std::array<int, 8>{0, 1, 2, 3, 4, 5, 6, 7}));
    EXPECT_EQ(mesh.hexahedra[0].reference, 3);
    ASSERT_EQ(mesh.edges.size(), 1u);
    EXPECT_EQ(mesh.edges[0].vertices, (std::array<int, 2>{0, 4}));
    EXPECT_EQ(mesh.edges[0].line, 19);
}

TEST(MeditFile, other_sections_are_passed_over)
{
    const MeditMesh mesh = parse_medit(
        "x.mesh", with("Hexahedra", "Triangles\n1\n1 2 3 0\nQuadrilaterals 1 1 2 3 4 0\n"
                                    "Corners\n2\n1\n2\nPyramids\n0\nHexahedra"));
    EXPECT_EQ(mesh.hexahedra.size(), 1u);
}

TEST(MeditFile, what_is_wrong_is_told_by_line_and_section)
{
    EXPECT_TRUE(support::contains(
        support::error_of(Fault::Malformed, [] { parse_medit("m.mesh", "PK\x03\x04"); }),
        "is a ZIP archive, need a Medit mesh"));
    EXPECT_EQ(message_of(with("1 2 3 4 5 6 7 8", "1 2 3 4 5 6 7 9")),
              "x.mesh:16: Hexahedra: vertex 9 is not there (there are 8)");
    EXPECT_NE(message_of(with("1 1 1 0", "1 one 1 0")).find("x.mesh:12: vertex 7: got"),
              std::string::npos);
    EXPECT_NE(message_of(with("1 0 0 0", "1 nan 0 0")).find("vertex 2"),
              std::string::npos);
    EXPECT_NE(message_of(with("Dimension 3", "Dimension 2")).find("dimension: got"),
              std::string::npos);
    EXPECT_NE(message_of(with("Hexahedra\n1\n", "Hexahedra\n2\n")).find("hexahedra 2"),
              std::string::npos);
    EXPECT_NE(
        message_of(with("Hexahedra\n1\n1 2 3 4 5 6 7 8 3\n", "")).find("no lattice"),
        std::string::npos);
    EXPECT_NE(message_of(with("Edges", "Pyramids 1 1 2 3 4 5 0\nEdges"))
                  .find("cannot be cells"),
              std::string::npos);
    EXPECT_NE(message_of(with("Edges", "Edgy")).find("no section"), std::string::npos);
    EXPECT_NE(message_of("").find("no lattice"), std::string::npos);
    for (std::size_t cut = 1; cut + 24 < kCube.size(); cut += 7)
        EXPECT_NE(message_of(kCube.substr(0, cut)), "") << cut;
}

} // namespace cellwarp::core
