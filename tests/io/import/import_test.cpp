// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/import/import.h"

#include <algorithm>
#include <csignal>

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "tests/support/collada.h"
#include "tests/support/failing_calls.h"
#include "tests/support/process.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::collada;
using support::contains;
using support::error_of;

namespace
{

/// A tetrahedron whose edges along the axes are 50 units long. \p unit: of the file [cm];
/// empty: it says nothing.
std::string fbx(const std::string& unit)
{
    const std::string property =
        unit.empty() ? ""
                     : "P: \"UnitScaleFactor\", \"double\", \"Number\", \"\"," + unit;
    return R"(; FBX 7.4.0 project file
FBXHeaderExtension: {
  FBXHeaderVersion: 1003
  FBXVersion: 7400
}
GlobalSettings: {
  Version: 1000
  Properties70: {
    )" + property +
           R"(
  }
}
Objects: {
  Geometry: 10, "Geometry::a", "Mesh" {
    Vertices: *12 {
      a: 0,0,0,50,0,0,0,50,0,0,0,50
    }
    PolygonVertexIndex: *12 {
      a: 0,2,-2,0,1,-4,1,2,-4,0,3,-3
    }
    GeometryVersion: 124
  }
  Model: 20, "Model::a", "Mesh" {
    Version: 232
  }
}
Connections: {
  C: "OO",20,0
  C: "OO",10,20
}
)";
}

} // namespace

TEST(Import, instances_are_in_the_world_and_faces_share_their_corners)
{
    const Geometry geometry = import_geometry("x.dae", collada());
    ASSERT_EQ(geometry.samples.size(), 8u);
    EXPECT_EQ(geometry.num_faces(), 8u);
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& x : geometry.samples)
    {
        box.extend(x);
    }
    EXPECT_EQ(box.min(), Eigen::Vector3d(0, 0, 0));
    EXPECT_EQ(box.max(), Eigen::Vector3d(2, 2, 5));
    EXPECT_EQ(geometry.format, "dae");
    EXPECT_FALSE(geometry.not_writable.empty());
    ASSERT_EQ(geometry.warnings.size(), 1u);
    EXPECT_TRUE(contains(geometry.warnings[0], "32-bit floats"));
}

TEST(Import, an_fbx_is_in_metres_whatever_its_unit)
{
    for (const auto& [unit, edge] : std::vector<std::pair<std::string, double>>{
             {"", 0.5}, {"1", 0.5}, {"100", 50.0}, {"2.5", 1.25}, {"-1", 0.5}})
    {
        double most = 0.0;
        for (const Eigen::Vector3d& x : import_geometry("x.fbx", fbx(unit)).samples)
            most = std::max(most, x.cwiseAbs().maxCoeff());
        EXPECT_NEAR(most, edge, 1e-6 * edge) << "unit " << unit;
    }
}

TEST(Import, formats_of_our_own_are_not_imported)
{
    EXPECT_TRUE(is_import_format("fbx"));
    EXPECT_TRUE(is_import_format("3ds"));
    EXPECT_FALSE(is_import_format("unheard"));
    EXPECT_FALSE(is_import_format(""));
}

TEST(Import, what_cannot_be_read_is_malformed)
{
    for (const std::string& bytes : {std::string(), std::string("<?xml"),
                                     collada().substr(0, 700), std::string(1000, 'x')})
        for (const char* name : {"x.dae", "x.3ds", "x.fbx", "x.blend", "x.lwo", "x.x"})
        {
            const std::string error =
                error_of(Fault::Malformed, [&] { import_geometry(name, bytes); });
            EXPECT_TRUE(contains(error, name));
        }
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed,
                 [] { import_geometry("x.dae", collada("0 0 0 nan 0 0 0 1 0 0 0 1")); }),
        "x.dae: "));
}

TEST(Import, its_limits_do_not_count_what_the_program_has)
{
    // More than the importer may have.
    constexpr std::size_t kMuch = std::size_t(16) << 30;
    void* const much = ::mmap(nullptr, kMuch, PROT_NONE,
                              MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    ASSERT_NE(much, MAP_FAILED);
    // A file that asks for memory anew.
    const std::string padded =
        collada() + "<!--" + std::string(std::size_t(1) << 25, 'x') + "-->\n";
    EXPECT_EQ(import_geometry("x.dae", padded).samples.size(), 8u);
    ::munmap(much, kMuch);
    struct rlimit now;
    ::getrlimit(RLIMIT_AS, &now);
    EXPECT_EQ(now.rlim_cur, RLIM_INFINITY);
}

TEST(Import, ends_with_the_program_that_has_started_it)
{
    int model[2], life[2];
    ASSERT_EQ(::pipe2(model, O_CLOEXEC), 0); // never written to: it waits
    ASSERT_EQ(::pipe2(life, O_CLOEXEC), 0);  // closed when it has ended
    const char* const importer = CELLWARP_IMPORT_BINARY;
    const pid_t starter = ::fork();
    if (starter == 0)
    {
        const std::string self = std::to_string(::getpid());
        if (::fork() == 0)
        {
            ::dup2(model[0], 0);
            ::dup2(life[1], 1);
            ::execl(importer, importer, "dae", self.c_str(), nullptr);
            ::_exit(99);
        }
        for (;;)
            ::pause();
    }
    ::close(life[1]);
    pollfd ended{life[0], POLLIN, 0};
    EXPECT_EQ(::poll(&ended, 1, 500), 0) << "it has to wait for its model";
    ::kill(starter, SIGKILL);
    support::wait_for(starter);
    EXPECT_EQ(::poll(&ended, 1, 60'000), 1) << "it lives on";
    for (const int file : {model[0], model[1], life[0]})
        ::close(file);
}

TEST(Import, what_the_system_refuses_is_told_and_no_fault_of_the_file)
{
    std::size_t samples = 0;
    const int errors = support::with_each_call_failing(
        [&] { samples = 0; },
        [&] { samples = import_geometry("x.dae", collada()).samples.size(); },
        [&](bool is_done) { EXPECT_EQ(samples, is_done ? 8u : 0u); });
    EXPECT_GE(errors, 12);
}

} // namespace cellwarp::core
