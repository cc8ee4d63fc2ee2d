// SPDX-License-Identifier: GPL-3.0-or-later
// A session whose memory fails at any place: what was thrown comes home from every
// thread, and nothing is left behind that the next session would notice.
#include <new>
#include <random>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "library/session/deformation.h"
#include "library/session/session.h"
#include "octree/base/parallel.h"
#include "tests/support/allocations.h"
#include "tests/support/sanitized.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

constexpr char kStatements[] = "cellwarp-handles 1\nfixed foot box -1 -1 -1 1 1 0.3\n"
                               "pin side sphere 0.5 0.5 2 0.1\n"
                               "handle head box -1 -1 3.7 1 1 5\n"
                               "frame 1\nmove head rotate 0 0 1 30\n"
                               "move side translate 0.1 0 0\n";

/// Where a bar's vertices end, and where its field file puts them.
std::vector<Eigen::Vector3d> bent(const std::string& model, FieldKind kind)
{
    SessionSettings settings;
    settings.cells.across = 8;
    settings.cells.max_depth = 1;
    settings.cells.threshold = 0.002;
    settings.field = kind;
    settings.keeps_fields = true;
    Session session(scan_geometry("bar.obj", model).geometry,
                    parse_handles("bar.handles", kStatements), settings);
    session.next_frame(true);
    std::vector<Eigen::Vector3d> places = session.geometry().samples;
    Deformation(parse_field("bar.cwf", field_bytes(session.field_file())), "bar.cwf")
        .carry({places});
    EXPECT_EQ(places, session.deformed().samples);
    return places;
}

} // namespace

TEST(OutOfMemory, any_allocation_of_a_session_may_fail_and_is_told)
{
    const ThreadLimit threads(4);
    const std::string model =
        support::obj_text(support::box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 2));
    for (const FieldKind kind : {FieldKind::Rbf, FieldKind::Closest4})
    {
        const std::vector<Eigen::Vector3d> whole = bent(model, kind);
        const std::size_t before = support::num_allocations();
        bent(model, kind);
        const std::size_t total = support::num_allocations() - before;
        std::mt19937 rng(4);
        std::size_t num_told = 0;
        constexpr std::size_t kTrials = support::kIsSanitized ? 20 : 120;
        for (std::size_t trial = 0; trial < kTrials; ++trial)
        {
            // In every part of the run, and the first ones.
            const std::size_t which =
                trial < 10 ? 1 + trial
                           : 1 + (trial * total + rng() % total) / (kTrials + 1);
            const support::FailingAllocation failing(which);
            try
            {
                EXPECT_EQ(bent(model, kind), whole) << which;
            }
            catch (const std::bad_alloc&)
            {
                ++num_told;
            }
        }
        EXPECT_GT(num_told, kTrials / 2);
        EXPECT_EQ(bent(model, kind), whole);
    }
}

} // namespace cellwarp::core
