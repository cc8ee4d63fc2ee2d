// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/simulation.h>

#include <cmath>

#include "tests/support/files.h"
#include "tests/support/interface.h"

namespace cellwarp
{

using support::contains;
using support::error_of;

namespace
{

const char* const kPendulum = R"({"cellwarp": 1,
    "rods": [{"name": "rope", "through": [[0, 0, 0], [1, 0, 0]], "spans": 8,
              "radius": 0.01, "E": 1e6, "fixed": [{"at": 0}]}],
    "simulate": {"dt": 0.005, "duration": 0.1, "every": 0.05}})";

} // namespace

TEST(Simulation, a_rope_falls)
{
    Simulation simulation = Simulation::parse(kPendulum);
    EXPECT_EQ(simulation.frame(), 0);
    EXPECT_EQ(simulation.last_frame(), 2);
    const double energy = simulation.report().gravity;
    EXPECT_EQ(simulation.rods(3)[0].places.size(), 9u);
    while (simulation.next())
    {
    }
    EXPECT_EQ(simulation.frame(), 2);
    EXPECT_NEAR(simulation.time(), 0.1, 1e-12);
    EXPECT_TRUE(simulation.report().is_converged);
    EXPECT_LT(simulation.report().gravity, energy);
    EXPECT_GT(simulation.report().kinetic, 0.0);
    const MovingRod rope = simulation.rods(3)[0];
    EXPECT_EQ(rope.name, "rope");
    EXPECT_NEAR(rope.places[0], 0.0, 1e-9);
    EXPECT_NEAR(rope.places[7], -0.5 * 9.81 * 0.01, 0.02);
    EXPECT_GT(simulation.surface(6).num_faces(), 0u);
    EXPECT_FALSE(simulation.model());
    EXPECT_TRUE(simulation.bodies().empty());
    EXPECT_FALSE(simulation.next());
}

TEST(Simulation, flesh_follows_its_skeleton_and_a_hand)
{
    const std::string scene = core::support::samples_folder() + "/flesh/limb.json";
    Simulation simulation = Simulation::read(scene), pulled = Simulation::read(scene);
    ASSERT_TRUE(simulation.model());
    EXPECT_FALSE(simulation.joints().empty());
    pulled.pull(0, {100, 0, 0});
    simulation.next();
    pulled.next();
    EXPECT_EQ(simulation.deformed().samples().size(),
              simulation.model()->samples().size());
    EXPECT_GT(pulled.deformed().samples()[0], simulation.deformed().samples()[0]);
    pulled.let_go();
    EXPECT_TRUE(pulled.next());
    error_of(Fault::Usage, [&] { simulation.surface(); });
    error_of(Fault::Usage, [&] { simulation.pull(1u << 30, {}); });
    error_of(Fault::Usage, [&] { simulation.pull(0, {NAN, 0, 0}); });
}

TEST(Simulation, names_the_key_that_is_wrong)
{
    std::string wrong = kPendulum;
    wrong.replace(wrong.find("0.01"), 4, "-1.0");
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { Simulation::parse(wrong); }),
                         "rods[0].radius"));
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, []
                          { Simulation::parse(R"({"cellwarp": 1, "model": "a.obj"})"); }),
                 "nothing to simulate"));
    error_of(Fault::File, [] { Simulation::read("/none.json"); });
    Simulation simulation = Simulation::parse(kPendulum);
    error_of(Fault::Usage, [&] { simulation.rods(1); });
    error_of(Fault::Usage, [&] { simulation.deformed(); });
    error_of(Fault::Usage, [&] { simulation.pull(0, {}); });
}

TEST(Simulation, ends_when_it_is_stopped)
{
    Simulation simulation = Simulation::parse(kPendulum);
    std::stop_source source;
    source.request_stop();
    Control control;
    control.stop = source.get_token();
    error_of(Fault::Stopped, [&] { simulation.next(true, control); });
    EXPECT_EQ(simulation.frame(), 0);
    error_of(Fault::Stopped, [&] { Simulation::parse(kPendulum, ".", control); });
}

} // namespace cellwarp
