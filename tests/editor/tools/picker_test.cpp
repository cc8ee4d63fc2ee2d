// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/picker.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <random>

#include <fcntl.h>
#include <unistd.h>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "io/base/error.h"
#include "octree/base/parallel.h"
#include "tests/editor/tools/shown.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/support/random.h"
#include "tests/support/sanitized.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::box_shape;
using support::layout_of;
using support::shown;

namespace
{

Camera looking(Camera::View view, bool is_perspective = true)
{
    Camera camera;
    camera.resize(400, 400);
    camera.look_from(view);
    if (!is_perspective)
        camera.toggle_perspective();
    return camera;
}

std::vector<std::uint32_t> all_of(const Shape& shape)
{
    std::vector<std::uint32_t> samples(shape.samples.size());
    std::iota(samples.begin(), samples.end(), 0u);
    return samples;
}

/// A quarter turn, a shift and half the size.
Eigen::Matrix4d some_frame()
{
    Eigen::Matrix4d to_view;
    to_view << 0, -0.5, 0, 0.1, 0.5, 0, 0, 0.2, 0, 0, 0.5, -0.3, 0, 0, 0, 1;
    return to_view;
}

/// Points on a ball of radius 0.5.
Shape ball_of_points(int count)
{
    std::mt19937 rng(2);
    Shape shape;
    while (static_cast<int>(shape.samples.size()) < count)
    {
        const Eigen::Vector3d x = support::random_vector(rng, 1.0);
        if (x.norm() > 0.1 && x.norm() < 1)
            shape.samples.push_back(0.5 * x.normalized());
    }
    return shape;
}

/// A flat grid of n x n samples, facing z, in [-0.5, 0.5].
Shape sheet(int n, double z)
{
    Shape shape;
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i)
            shape.samples.emplace_back(i / (n - 1.0) - 0.5, j / (n - 1.0) - 0.5, z);
    for (int j = 0; j + 1 < n; ++j)
        for (int i = 0; i + 1 < n; ++i)
        {
            const auto a = static_cast<std::uint32_t>(j * n + i);
            const auto right = a + 1, above = a + static_cast<std::uint32_t>(n);
            shape.triangles.push_back({a, right, above + 1});
            shape.triangles.push_back({a, above + 1, above});
        }
    return shape;
}

} // namespace

TEST(Picker, finds_the_nearest_face_and_its_nearest_sample_in_any_frame)
{
    const Shape shape = support::joined(box_shape({-0.4, -0.4, -0.4}, {0.4, 0.4, 0.4}),
                                        box_shape({-0.4, -0.4, -2.4}, {0.4, 0.4, -1.6}));
    for (const Eigen::Matrix4d& frame :
         {Eigen::Matrix4d(Eigen::Matrix4d::Identity()), some_frame()})
    {
        Picker picker;
        picker.update(shown(shape, layout_of(shape), 1, frame));
        ASSERT_TRUE(picker.is_ready());
        const auto picked = picker.pick({{0.19, -0.37, 5}, {0, 0, -1}});
        ASSERT_TRUE(picked);
        EXPECT_LT((picked->point - Eigen::Vector3d(0.19, -0.37, 0.4)).norm(), 1e-6);
        EXPECT_LT(
            (shape.samples[picked->sample] - Eigen::Vector3d(0.2, -0.4, 0.4)).norm(),
            1e-12);
        EXPECT_FALSE(picker.pick({{0.5, 0, 5}, {0, 0, -1}}));
        EXPECT_FALSE(picker.pick({{0, 0, 5}, {0, 0, 1}}));
    }
}

TEST(Picker, of_a_box_sees_the_samples_of_the_faces_that_face_the_viewer)
{
    const Shape shape = box_shape({-0.4, -0.4, -0.4}, {0.4, 0.4, 0.4});
    for (const bool is_perspective : {true, false})
    {
        Camera camera = looking(Camera::View::Front, is_perspective);
        camera.orbit({40, 30});
        for (const Eigen::Matrix4d& frame :
             {Eigen::Matrix4d(Eigen::Matrix4d::Identity()), some_frame()})
        {
            Picker picker;
            picker.update(shown(shape, layout_of(shape), 1, frame));
            const auto visible = picker.visible(all_of(shape), camera);
            for (std::size_t i = 0; i < shape.samples.size(); ++i)
            {
                SCOPED_TRACE(shape.samples[i].transpose());
                const Eigen::Vector3d to_eye =
                    is_perspective ? Eigen::Vector3d(camera.eye() - shape.samples[i])
                                   : Eigen::Vector3d(-camera.forward());
                bool expected = false;
                for (int k = 0; k < 3; ++k)
                    expected |= std::abs(shape.samples[i][k]) > 0.39 &&
                                shape.samples[i][k] * to_eye[k] > 0;
                EXPECT_EQ(visible[i] != 0, expected);
            }
        }
    }
}

TEST(Picker, sees_through_no_thin_part_even_right_behind_its_corners)
{
    // Two sheets, a thousandth apart; in parallel projection each sample of the rear one
    // is exactly behind one of the front's.
    const Shape shape = support::joined(sheet(21, 0.0005), sheet(21, -0.0005));
    Picker picker;
    picker.update(shown(shape, layout_of(shape), 1));
    for (const bool is_perspective : {true, false})
    {
        const Camera camera = looking(Camera::View::Front, is_perspective);
        const auto visible = picker.visible(all_of(shape), camera);
        for (std::size_t i = 0; i < shape.samples.size(); ++i)
        {
            SCOPED_TRACE(shape.samples[i].transpose());
            // Of the rear one's border nobody can tell.
            if (shape.samples[i].z() < 0 &&
                shape.samples[i].head<2>().cwiseAbs().maxCoeff() > 0.49)
                continue;
            EXPECT_EQ(visible[i] != 0, shape.samples[i].z() > 0);
        }
    }
}

TEST(Picker, a_cloud_is_closed_where_its_points_are_dense)
{
    const Shape shape = ball_of_points(5000);
    Picker picker;
    picker.update(shown(shape, layout_of(shape), 1, some_frame()));
    const Camera camera = looking(Camera::View::Front, false);
    const auto visible = picker.visible(all_of(shape), camera);
    std::size_t wrong = 0, counted = 0;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        if (std::abs(shape.samples[i].z()) < 0.15)
            continue;
        ++counted;
        wrong += (visible[i] != 0) != (shape.samples[i].z() > 0);
    }
    EXPECT_LT(wrong, counted / 50); // the points are random: there are holes
    std::mt19937 rng(9);
    int through = 0;
    for (int i = 0; i < 1000; ++i)
    {
        const Eigen::Vector3d x = support::random_vector(rng, 0.3);
        const auto picked = picker.pick({{x.x(), x.y(), 5}, {0, 0, -1}});
        ASSERT_TRUE(picked);
        through += picked->point.z() < 0;
        EXPECT_LT((shape.samples[picked->sample] - picked->point).norm(), 1e-6);
        EXPECT_LT((picked->point.head<2>() - x.head<2>()).norm(), 0.05);
    }
    EXPECT_LT(through, 20);
}

TEST(Picker, follows_samples_that_move_and_layouts_that_change)
{
    Shape shape = box_shape({-0.4, -0.4, -0.4}, {0.4, 0.4, 0.4});
    const auto layout = layout_of(shape);
    const Ray ray{{0.19, 0.21, 5}, {0, 0, -1}};
    Picker picker;
    picker.update(shown(shape, layout, 1));
    const auto before = picker.pick(ray);
    ASSERT_TRUE(before);
    for (Eigen::Vector3d& x : shape.samples)
        x.z() += 1.0;
    picker.update(shown(shape, layout, 1)); // says that nothing is new
    EXPECT_NEAR(picker.pick(ray)->point.z(), 0.4, 1e-6);
    picker.update(shown(shape, layout, 2));
    ASSERT_TRUE(picker.pick(ray));
    EXPECT_NEAR(picker.pick(ray)->point.z(), 1.4, 1e-6);
    EXPECT_EQ(picker.pick(ray)->sample, before->sample);
    for (Eigen::Vector3d& x : shape.samples)
        x.z() -= 3.0;
    picker.update(shown(shape, layout_of(shape, 77), 3));
    ASSERT_TRUE(picker.pick(ray));
    EXPECT_NEAR(picker.pick(ray)->point.z(), -1.6, 1e-6);
    EXPECT_EQ(picker.pick(ray)->sample, before->sample);
}

TEST(Picker, a_large_shape_never_keeps_the_caller_waiting_and_the_old_one_serves)
{
    const Shape small = box_shape({-0.4, -0.4, 0}, {0.4, 0.4, 0.4});
    Shape large = sheet(400, 1.0);
    const auto layout = layout_of(large);
    const Ray ray{{0.1, 0.2, 5}, {0, 0, -1}};
    Picker picker;
    picker.update(shown(small, layout_of(small), 1));
    picker.update(shown(large, layout, 2));
    ASSERT_TRUE(picker.is_ready());
    EXPECT_NEAR(picker.pick(ray)->point.z(), 0.4, 1e-6);
    picker.wait();
    EXPECT_NEAR(picker.pick(ray)->point.z(), 1.0, 1e-6);
    for (Eigen::Vector3d& x : large.samples)
        x.z() = 2.0;
    picker.update(shown(large, layout, 3));
    EXPECT_NEAR(picker.pick(ray)->point.z(), 1.0, 1e-6);
    picker.wait();
    EXPECT_NEAR(picker.pick(ray)->point.z(), 2.0, 1e-6);
    picker.update(shown(small, layout_of(small), 4)); // and ends well while one is made
    picker.update(shown(large, layout, 5));
}

namespace
{

/// In a process of which one allocation fails: 0 where none does that a picker makes, 5
/// where the picker tells so, finds nothing then, and serves again with a newer shape.
[[noreturn]] void pick_while_memory_ends()
{
    const Ray ray{{0.19, 0.21, 5}, {0, 0, -1}};
    // Two whose trees are waited for, and one whose tree is made behind.
    const Shape shapes[] = {box_shape({-0.4, -0.4, -0.4}, {0.4, 0.4, 0.4}),
                            ball_of_points(500), sheet(200, 0.4)};
    std::vector<ShownShape> given;
    for (const Shape& shape : shapes)
        given.push_back(shown(shape, layout_of(shape), given.size()));
    // Threads are there before a picker is, as in the editor: oneTBB, whose first
    // beginning fails, waits for ever in the second.
    parallel_for(64, [](int) {});
    ::close(::open(std::getenv("CELLWARP_FAILS_FROM"), O_RDONLY));
    int code = 0;
    std::unique_ptr<Picker> picker;
    for (std::size_t i = 0; i < given.size(); ++i)
        try
        {
            if (!picker)
                picker = std::make_unique<Picker>();
            picker->update(given[i]);
            picker->wait();
            if (!picker->pick(ray))
                std::_Exit(1);
        }
        catch (const std::bad_alloc&)
        {
            if (code != 0 || (picker && (picker->is_ready() || picker->pick(ray))))
                std::_Exit(2);
            code = static_cast<int>(Fault::Budget);
        }
    std::_Exit(code);
}

} // namespace

TEST(Picker, that_memory_ends_is_told_and_a_newer_shape_serves_again)
{
    if (support::kIsSanitized)
        GTEST_SKIP() << "the library that fails must be loaded before all others";
    if (std::getenv("CELLWARP_FAILS"))
        pick_while_memory_ends();
    const support::Folder folder;
    const std::string begins = folder.write("begins", ""), told = folder / "told";
    int num_told = 0;
    for (std::size_t which = 2;; which += 2)
    {
        SCOPED_TRACE(which);
        std::filesystem::remove(told);
        const support::Result result = support::run_program(
            "/proc/self/exe", {"--gtest_filter=Picker.that_memory_ends*"},
            [&]
            {
                ::setenv("LD_PRELOAD", CELLWARP_FAILING_PROCESS, 1);
                ::setenv("CELLWARP_FAILS", ("malloc " + std::to_string(which)).c_str(),
                         1);
                ::setenv("CELLWARP_FAILS_FROM", begins.c_str(), 1);
                ::setenv("CELLWARP_FAILS_TOLD", told.c_str(), 1);
            });
        if (!std::filesystem::exists(told)) // so many are not made
        {
            EXPECT_EQ(result.code, 0) << result.err;
            break;
        }
        num_told += result.code == static_cast<int>(Fault::Budget);
        EXPECT_TRUE(result.code == 0 || result.code == static_cast<int>(Fault::Budget))
            << result.code << "\n"
            << result.err;
    }
    EXPECT_GT(num_told, 20);
}

TEST(Picker, without_a_shape_finds_nothing_and_hides_nothing)
{
    Picker picker;
    picker.update(ShownShape{});
    picker.wait();
    EXPECT_FALSE(picker.is_ready());
    EXPECT_FALSE(picker.pick({{0, 0, 5}, {0, 0, -1}}));
    const std::vector<std::uint32_t> samples = {0, 1};
    EXPECT_EQ(picker.visible(samples, Camera()), (std::vector<std::uint8_t>{1, 1}));
}

} // namespace cellwarp::core
